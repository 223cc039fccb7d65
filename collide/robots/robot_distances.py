"""The nearest pair of each configuration as a result: names, signed distance, and its derivatives by the joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: One row a configuration.
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
}


class RobotDistances:
    """The nearest pair of each configuration; fields of `NEAREST_DTYPE` as attributes, arrays with a leading N.

    Parameters
    ----------
    rows : (N,) NEAREST_DTYPE
        ``distance`` [m], signed, with ``lower ≤ truth ≤ upper`` proven; ``normal`` (3,) a unit vector in W from A, on
        the robot, towards B; ``point_a``, ``point_b`` (3,) in W [m]; ``hit``, ``certified``; ``beyond`` where every
        tested pair is beyond the ``max_distance`` asked: distance and upper are infinite then. ``a`` is the number of a
        body, −1 without a pair; ``b`` of another, or −1 − the number of a body around.
        For overlapping bodies that are not convex, ``distance`` is minus the length of some separating
        translation, the bracket reaches up to 0, and ``certified`` is False.
    gradient : (N, dof) float64
        Derivative of ``distance`` by each column of q [m/rad or m/m]; NaN where no derivative is known, for the reason
        in `no_gradient`. Of two equally near pairs the gradient is the named pair's.
    bodies, around : sequence of str
        Names of the robot's bodies, and of the bodies around.
    """

    def __init__(self, rows: np.ndarray, gradient: np.ndarray, bodies: Sequence[str], around: Sequence[str]):
        self.rows, self.gradient = rows, gradient
        self._bodies, self._around = list(bodies), list(around)

    @property
    def names(self) -> list[tuple[str, str] | None]:
        """Names of both bodies of each configuration; ``None`` without a pair."""
        return [
            None if a < 0 else (self._bodies[a], self._bodies[b] if b >= 0 else self._around[-1 - b])
            for a, b in zip(self.rows["a"].tolist(), self.rows["b"].tolist())
        ]

    @property
    def no_gradient(self) -> list[str | None]:
        """Why a configuration's gradient is NaN, in the words of `NO_GRADIENT`; ``None`` beside a gradient.

        Returns
        -------
        list of N ``str | None``
        """
        return [_why_no_gradient(row) for row in self.rows]

    def __len__(self) -> int:
        return len(self.rows)

    def __getattr__(self, name: str):
        if name in NEAREST_DTYPE.names:  # type: ignore[operator]
            return self.rows[name]
        raise AttributeError(f"RobotDistances has no {name!r}; it has {', '.join(NEAREST_DTYPE.names or ())}")

    def __repr__(self) -> str:
        near = self.rows["distance"][~self.rows["beyond"]]
        least = f", least {near.min():.6g} m" if len(near) else ""
        return f"RobotDistances({len(self)} configurations, {int(self.rows['hit'].sum())} in collision{least})"


def _why_no_gradient(row) -> str | None:
    if row["beyond"]:
        return NO_GRADIENT["beyond"]
    if not row["certified"]:
        return NO_GRADIENT["depth" if row["upper"] <= 0.0 and row["hit"] else "bracket"]
    return NO_GRADIENT["touching"] if row["distance"] == 0.0 else None
