"""The nearest pair of each configuration as a result: which links, how far, and which way joints change it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from collide.robots.forward_kinematics import (
    ACROSS,
    AXIS,
    CHILD,
    COLUMN,
    FIXED,
    FLOATING,
    KIND,
    MULTIPLIER,
    PLANAR,
    TRANSLATION,
    JointTable,
)

#: One row a configuration.
NEAREST_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point_a", "f8", 3),
        ("point_b", "f8", 3), ("a", "i4"), ("b", "i4"), ("hit", "?"), ("certified", "?"), ("beyond", "?"),
    ]
)  # fmt: skip


class RobotDistances:
    """The nearest pair of each configuration; fields of `NEAREST_DTYPE` as attributes, arrays with a leading N.

    Parameters
    ----------
    rows : (N,) NEAREST_DTYPE
        ``distance`` [m], signed, with ``lower ≤ truth ≤ upper`` proven; ``normal`` (3,) a unit vector in W from A, on
        the robot, towards B; ``point_a``, ``point_b`` (3,) in W [m]; ``hit``, ``certified``; ``beyond`` where nothing
        tested is within the ``max_distance`` asked: distance and upper are infinite then. ``a`` is the number of a
        body, −1 for none; ``b`` of another, or −1 − the number of one around.
    gradient : (N, dof) float64
        How ``distance`` changes with each column of q [m/rad or m/m]; NaN where it has no derivative: touching, beyond.
        Where two pairs are equally near, it is that of the pair named.
    bodies, around : sequence of str
        Names of what moves, and of what is around.
    """

    def __init__(self, rows: np.ndarray, gradient: np.ndarray, bodies: Sequence[str], around: Sequence[str]):
        self.rows, self.gradient = rows, gradient
        self._bodies, self._around = list(bodies), list(around)

    @property
    def names(self) -> list[tuple[str, str] | None]:
        """Both bodies of each configuration; None where there is no pair."""
        return [
            None if a < 0 else (self._bodies[a], self._bodies[b] if b >= 0 else self._around[-1 - b])
            for a, b in zip(self.rows["a"].tolist(), self.rows["b"].tolist())
        ]

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


def gradients(
    table: JointTable, moves: np.ndarray, q: np.ndarray, X_WLs: np.ndarray, rows: np.ndarray, link_of: np.ndarray
) -> np.ndarray:
    """(N, dof) of `RobotDistances`.

    moves : (joints, links) bool: whether a joint moves a link.   link_of : (bodies,) link of each body.
    """
    out = np.zeros((len(q), table.dof))
    a, b, n = rows["a"], rows["b"], rows["normal"]
    has_pair = a >= 0
    link_a = link_of[np.maximum(a, 0)]
    link_b = np.where(b >= 0, link_of[np.maximum(b, 0)], -1)
    for j in range(len(table.ints)):
        if table.ints[j, KIND] == FIXED:
            continue
        moves_a = has_pair & moves[j, link_a]
        moves_b = has_pair & (link_b >= 0) & moves[j, np.maximum(link_b, 0)]
        for sign, which, points in ((-1.0, moves_a, rows["point_a"]), (1.0, moves_b, rows["point_b"])):
            at = np.flatnonzero(which & ~(moves_a & moves_b))
            if len(at):
                for column, v in _velocities(table, j, q[at], X_WLs[at], points[at]):
                    out[at, column] += sign * (n[at] * v).sum(axis=1)
    out[~has_pair | (rows["distance"] == 0.0)] = np.nan
    return out


def _velocities(table: JointTable, j: int, q: np.ndarray, X_WLs: np.ndarray, p_W: np.ndarray):
    """(column, (k, 3) velocity of points of the joint's child) for each column that moves joint j."""
    ints, doubles = table.ints[j], table.doubles[j]
    column, X_WC = int(ints[COLUMN]), X_WLs[:, ints[CHILD]]
    R, arm = X_WC[:, :3, :3], p_W - X_WC[:, :3, 3]
    axis = R @ doubles[AXIS : AXIS + 3]
    if ints[KIND] == TRANSLATION:
        yield column, doubles[MULTIPLIER] * axis
    elif ints[KIND] == PLANAR:
        # The shift comes before the turn: its axes are those of the frame not yet turned.
        before = _turned_back(R, doubles[AXIS : AXIS + 3], q[:, column + 2])
        for k in range(2):
            yield column + k, before @ doubles[ACROSS + 3 * k : ACROSS + 3 * k + 3]
        yield column + 2, np.cross(axis, arm)
    elif ints[KIND] == FLOATING:
        yield from _floating_velocities(column, q, R, arm)
    else:
        yield column, doubles[MULTIPLIER] * np.cross(axis, arm)


def _floating_velocities(column: int, q: np.ndarray, R: np.ndarray, arm: np.ndarray):
    """x, y, z along the parent's axes; then roll about its own x, pitch before that, yaw before both."""
    x, y, z = np.eye(3)
    after_pitch = _turned_back(R, x, q[:, column + 3])
    after_yaw = _turned_back(after_pitch, y, q[:, column + 4])
    parent = _turned_back(after_yaw, z, q[:, column + 5])
    for k in range(3):
        yield column + k, parent[:, :, k]
    for k, (frame, axis) in enumerate(((R, x), (after_pitch, y), (after_yaw, z))):
        yield column + 3 + k, np.cross(frame @ axis, arm)


def _turned_back(R: np.ndarray, axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(k, 3, 3) R with a turn about an axis of its own frame taken back: R times the transposed turn."""
    skew = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    back = np.eye(3) - s * skew + (1.0 - c) * (skew @ skew)
    return R @ back

