"""Distances of a robot as a result: names of pairs, signed distances, and their derivatives by the joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: A row of a pair.
NEAREST_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point_a", "f8", 3),
        ("point_b", "f8", 3), ("a", "i4"), ("b", "i4"), ("hit", "?"), ("certified", "?"), ("beyond", "?"),
    ]
)


#: Reasons of a missing gradient: the cause, and a remedy where one exists.
NO_GRADIENT = {
    "beyond": "no tested pair is within max_distance",
    "touching": "the bodies touch: distances have no derivative at 0",
    "depth": (
        "the bodies overlap and are not convex: their depth is known from above alone, and has no derivative; robots "
        'and bodies of hulls have (meshes="hull")'
    ),
    "bracket": "the bracket of the distance is not certified",
    "normal": (
        "a cylinder, a cone or an ellipsoid overlaps or nearly touches, and its normal is not known to the digits of a "
        "derivative"
    ),
}


class RobotDistances:
    """Pairs of N configurations, M rows: fields of `NEAREST_DTYPE` as attributes, arrays with a leading M.

    Rows are sorted by configuration; ``starts[k]:starts[k + 1]`` are of configuration k: a single row of the nearest
    pair (``per="robot"``); a row for each body of the robot, body i in row ``starts[k] + i`` and the first of the row's
    pair (``per="link"``); all pairs within the limit, sorted by bodies, with those around last (``per="pair"``).

    Parameters
    ----------
    rows : (M,) NEAREST_DTYPE
        ``distance`` [m], signed, with ``lower ≤ truth ≤ upper`` proven; ``normal`` (3,) a unit vector in W from A, on
        the robot, towards B; ``point_a``, ``point_b`` (3,) in W [m]; ``hit``, ``certified``; ``beyond`` where every
        tested pair is beyond the ``max_distance`` asked: distance and upper are infinite then. ``a`` is the number of a
        body, −1 without a pair; ``b`` of another, or −1 − the number of a body around.
        For overlapping bodies that are not convex, ``distance`` is minus the length of some separating
        translation, the bracket reaches up to 0, and ``certified`` is False.
    gradient : (M, dof) float64
        Derivative of ``distance`` by each column of q [m/rad or m/m]; NaN where no derivative is known, for the reason
        in `no_gradient`. Of two equally near pairs the gradient is the named pair's.
    bodies, around : sequence of str
        Names of the robot's bodies, and of the bodies around.
    starts : (N + 1,) int64
        Where rows of configurations begin and end, by default a row each.
    witness : (M, 9) float64
        The normal and both witness points in W as derivatives take them; NaN where no derivative is known.

    """

    def __init__(
        self, rows: np.ndarray, gradient: np.ndarray, bodies: Sequence[str], around: Sequence[str],
        starts: np.ndarray | None = None, witness: np.ndarray | None = None,
    ):
        self.rows, self.gradient = rows, gradient
        self._witness = np.full((len(rows), 9), np.nan) if witness is None else witness
        self.starts = np.arange(len(rows) + 1) if starts is None else starts
        self._bodies, self._around = list(bodies), list(around)

    @property
    def configuration(self) -> np.ndarray:
        """The configuration of each row.

        Returns
        -------
        (M,) int64
        """
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))

    @property
    def names(self) -> list[tuple[str, str] | None]:
        """Names of both bodies of each row; ``None`` without a pair."""
        return [
            None if a < 0 else (self._bodies[a], self._bodies[b] if b >= 0 else self._around[-1 - b])
            for a, b in zip(self.rows["a"].tolist(), self.rows["b"].tolist())
        ]

    @property
    def d_pose_a(self) -> np.ndarray:
        """Derivative of ``distance`` by the pose of body a alone: of the link, or of the object attached to the link.

        Returns
        -------
        (M, 6) float64
            By a turn about the origin of W [m/rad], then by a shift [m/m], along the axes of W:
            −(point_a × normal), −normal. About another point o: the turn's minus o × the shift's. NaN where
            ``gradient`` is.
        """
        return -self._wrench(3)

    @property
    def d_pose_b(self) -> np.ndarray:
        """Derivative of ``distance`` by the pose of body b alone, a body of the robot or around.

        Returns
        -------
        (M, 6) float64
            As `d_pose_a`: point_b × normal, normal.
        """
        return self._wrench(6)

    @property
    def d_base(self) -> np.ndarray:
        """Derivative of ``distance`` by the pose of the robot's base: all bodies of the robot move together.

        Returns
        -------
        (M, 6) float64
            As `d_pose_a`, and 0 between two bodies of the robot.
        """
        return np.where(self.rows["b"][:, None] >= 0, 0.0 * self.d_pose_a, self.d_pose_a)

    def _wrench(self, at: int) -> np.ndarray:
        normal, point = self._witness[:, :3], self._witness[:, at : at + 3]
        unknown = np.isnan(self.gradient).any(axis=1) | np.isnan(normal).any(axis=1)
        return np.where(unknown[:, None], np.nan, np.hstack([np.cross(point, normal), normal]))

    @property
    def no_gradient(self) -> list[str | None]:
        """Why a row's gradient is NaN, in the words of `NO_GRADIENT`; ``None`` beside a gradient.

        Returns
        -------
        list of M ``str | None``
        """
        is_unknown = np.isnan(self.gradient).any(axis=1).tolist()
        return [_why_no_gradient(*row_and_gradient) for row_and_gradient in zip(self.rows, is_unknown)]

    def __len__(self) -> int:
        return len(self.rows)

    def __getattr__(self, name: str):
        if name in NEAREST_DTYPE.names:  # type: ignore[operator]
            return self.rows[name]
        raise AttributeError(f"RobotDistances has no {name!r}; it has {', '.join(NEAREST_DTYPE.names or ())}")

    def __repr__(self) -> str:
        near = self.rows["distance"][~self.rows["beyond"]]
        least = f", least {near.min():.6g} m" if len(near) else ""
        n_hits = int(self.rows["hit"].sum())
        n = len(self.starts) - 1
        if n == len(self) and (np.diff(self.starts) == 1).all():
            return f"RobotDistances({n} configurations, {n_hits} in collision{least})"
        return f"RobotDistances({len(self)} rows of {n} configurations, {n_hits} hits{least})"


def _why_no_gradient(row, is_unknown: bool) -> str | None:
    if row["beyond"]:
        return NO_GRADIENT["beyond"]
    if not row["certified"]:
        return NO_GRADIENT["depth" if row["upper"] <= 0.0 and row["hit"] else "bracket"]
    if row["distance"] == 0.0:
        return NO_GRADIENT["touching"]
    return NO_GRADIENT["normal"] if is_unknown else None
