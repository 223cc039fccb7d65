"""The Minkowski difference A ⊖ B of two posed cores, seen through its support mapping.

Both poses are used as given: a point of the difference is R_A a − R_B b − (p_WB − p_WA). The pair
is closest where this set is nearest the origin, overlaps where it contains the origin.
"""

from __future__ import annotations

from collide._jit import kernel
from collide.geometry.supports import support

#: Doubles stored a difference point: w, then a and b in W's axes from their own body's origin.
POINT = 9


@kernel(inline=True)
def difference_point(pair, points, ids, k, dx, dy, dz):
    """Store as point k the one of A ⊖ B farthest in direction d.

    pair : (coordinates, n, m, kind, row of numbers, pose row start) of A, the same of B, then
        numbers, poses, t.
    points : POINT doubles a point.   ids : two a point, the support vertices of A and of B.
    """
    (coords_a, n_a, m_a, kind_a, at_a, p, coords_b, n_b, m_b, kind_b, at_b, q, numbers, poses, tx, ty, tz) = pair
    ia, x, y, z = support(
        kind_a, coords_a, n_a, m_a, numbers, at_a,
        poses[p] * dx + poses[p + 3] * dy + poses[p + 6] * dz,
        poses[p + 1] * dx + poses[p + 4] * dy + poses[p + 7] * dz,
        poses[p + 2] * dx + poses[p + 5] * dy + poses[p + 8] * dz,
    )  # fmt: skip
    ax = poses[p] * x + poses[p + 1] * y + poses[p + 2] * z
    ay = poses[p + 3] * x + poses[p + 4] * y + poses[p + 5] * z
    az = poses[p + 6] * x + poses[p + 7] * y + poses[p + 8] * z
    ib, x, y, z = support(
        kind_b, coords_b, n_b, m_b, numbers, at_b,
        -(poses[q] * dx + poses[q + 3] * dy + poses[q + 6] * dz),
        -(poses[q + 1] * dx + poses[q + 4] * dy + poses[q + 7] * dz),
        -(poses[q + 2] * dx + poses[q + 5] * dy + poses[q + 8] * dz),
    )  # fmt: skip
    bx = poses[q] * x + poses[q + 1] * y + poses[q + 2] * z
    by = poses[q + 3] * x + poses[q + 4] * y + poses[q + 5] * z
    bz = poses[q + 6] * x + poses[q + 7] * y + poses[q + 8] * z
    at = POINT * k
    points[at] = (ax - bx) - tx
    points[at + 1] = (ay - by) - ty
    points[at + 2] = (az - bz) - tz
    points[at + 3] = ax
    points[at + 4] = ay
    points[at + 5] = az
    points[at + 6] = bx
    points[at + 7] = by
    points[at + 8] = bz
    ids[2 * k] = ia
    ids[2 * k + 1] = ib


@kernel(inline=True)
def copy_point(points, ids, source, target):
    """Point ``target`` becomes point ``source``."""
    for j in range(POINT):
        points[POINT * target + j] = points[POINT * source + j]
    ids[2 * target] = ids[2 * source]
    ids[2 * target + 1] = ids[2 * source + 1]
