"""Points and half-spaces at poses, entries taken as exact numbers. No kernel is imported: `verify` reads this."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from collide.numerics.exact_vectors import cross, dot

#: Numbers of `ExactPose` are R row by row, then t, without rounding.
ExactPose = Sequence[Fraction]
#: Three coordinates, or a normal and an offset.
ExactRow = list[Fraction]
#: A half-space is left out that a ball is inside by more than this part of the numbers that say so.
_MARGIN = 2.0**-40


def exact_pose(X: np.ndarray) -> list[Fraction]:
    """The 12 numbers of a pose (4, 4)."""
    return [Fraction(v) for v in (*X[:3, :3].ravel().tolist(), *X[:3, 3].tolist())]


def points_at(points: np.ndarray, pose: ExactPose) -> list[ExactRow]:
    """Points (n, 3) at a pose."""
    return [
        [dot(pose[3 * i : 3 * i + 3], point) + pose[9 + i] for i in range(3)]
        for point in ([Fraction(v) for v in row] for row in points.tolist())
    ]


def planes_at(normals: np.ndarray, offsets: np.ndarray, pose: ExactPose) -> list[ExactRow]:
    """Half-spaces at a pose: {x : n·x ≤ b} becomes n' = cof(R) n, b' = b det R + n'·t."""
    r = [pose[0:3], pose[3:6], pose[6:9]]
    cofactors = [cross(r[1], r[2]), cross(r[2], r[0]), cross(r[0], r[1])]
    determinant, t = dot(r[0], cofactors[0]), pose[9:12]
    planes = []
    for *normal, offset in np.column_stack((normals, offsets)).tolist():
        n = [dot(row, [Fraction(v) for v in normal]) for row in cofactors]
        planes.append([*n, Fraction(offset) * determinant + dot(n, t)])
    return planes


def planes_near(
    normals: np.ndarray, offsets: np.ndarray, X_WP: np.ndarray, X_WB: np.ndarray, reach: float
) -> np.ndarray:
    """Numbers of the half-spaces that do not surely hold the ball of a body.

    X_WP, X_WB : (4, 4) where they stand, in doubles, rounded or not.   reach : of the body from its origin [m].
    """
    R, t, R_body, t_body = X_WP[:3, :3], X_WP[:3, 3], X_WB[:3, :3], X_WB[:3, 3]
    centre = np.linalg.solve(R, t_body - t)
    inverse = np.linalg.inv(R)
    reach *= (1.0 + _MARGIN) * max(np.linalg.norm(inverse @ R_body, 2), np.linalg.norm(inverse, 2))
    lengths = np.sqrt(np.square(normals).sum(axis=1))
    size = lengths * (np.abs(centre).sum() + np.abs(t).max() + np.abs(t_body).max() + reach) + np.abs(offsets)
    return np.flatnonzero(normals @ centre + lengths * reach > offsets - _MARGIN * size)


def point_seen_from(point: Sequence[Fraction], pose: ExactPose) -> ExactRow:
    """A point of the world, in the frame that stands at a pose."""
    r = [pose[0:3], pose[3:6], pose[6:9]]
    cofactors = [cross(r[1], r[2]), cross(r[2], r[0]), cross(r[0], r[1])]
    determinant = dot(r[0], cofactors[0])
    away = [x - t for x, t in zip(point, pose[9:12])]
    return [sum((cofactors[i][k] * away[i] for i in range(3)), Fraction(0)) / determinant for k in range(3)]


def planes_seen_from(planes: list[ExactRow], pose: ExactPose) -> list[ExactRow]:
    """Half-spaces of the world, in the frame that stands at a pose."""
    columns = [pose[0:9:3], pose[1:9:3], pose[2:9:3]]
    return [
        [*(dot(column, n) for column in columns), b - dot(n, pose[9:12])]
        for *n, b in planes
    ]
