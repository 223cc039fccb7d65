"""The Minkowski difference A ⊖ B of two posed cores, seen through its support mapping.

Both poses are used as given: a point of the difference is R_A a − R_B b − (p_WB − p_WA). The pair
is closest where this set is nearest the origin, overlaps where it contains the origin.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.support.support_mapping import settled_vertex, support
from collide.support.support_tree_query import two_extreme_vertices

#: Doubles stored a difference point: w, then a and b in W's axes from their own body's origin.
POINT = 9


@kernel(cold=True)
def listed_difference_point(pair, points, ids, k, dx, dy, dz, listed_a, listed_b):
    """`inlined_difference_point` of whole bodies, called: a copy at every place where one is asked for took 8 s to compile."""
    return inlined_difference_point(pair, points, ids, k, dx, dy, dz, False, listed_a, listed_b)


@kernel(inline=True)
def difference_point(pair, points, ids, k, dx, dy, dz):
    """The same by walks through whole support trees."""
    return listed_difference_point(pair, points, ids, k, dx, dy, dz, -1, -1)


@kernel(inline=True)
def inlined_difference_point(pair, points, ids, k, dx, dy, dz, coarse, listed_a, listed_b):
    """Store as point k the one of A ⊖ B farthest in direction d; of a support tree, not proven to be.

    Returns the lists of the bodies' support trees in which vertices were found (`extreme_vertex_listed`).

    pair : `posed_pair.posed_pair`.   coarse : ask the coarse points alone, where there are any.
    points : POINT doubles a point.   ids : two a point, the support vertices of A and of B.
    listed_a, listed_b : lists to look in alone, or −1.
    """
    A, B, numbers, poses = pair.A, pair.B, pair.numbers, pair.poses
    p, q = A.pose_at, B.pose_at
    ex, ey, ez = _turned_back(poses, p, dx, dy, dz)
    fx, fy, fz = _turned_back(poses, q, -dx, -dy, -dz)
    if A.tree != 0 and B.tree != 0 and not coarse:
        ia, ax, ay, az, listed_a, ib, bx, by, bz, listed_b = two_extreme_vertices(
            A.tree, listed_a, ex, ey, ez, B.tree, listed_b, fx, fy, fz
        )
    else:
        one, other = (A.coarse_at, B.coarse_at) if coarse else (0, 0)
        ia, ax, ay, az, listed_a = support(A.kind, A.coords, A.n, A.padded, numbers, A.params_at, A.tree, one, listed_a, ex, ey, ez)
        ib, bx, by, bz, listed_b = support(B.kind, B.coords, B.n, B.padded, numbers, B.params_at, B.tree, other, listed_b, fx, fy, fz)
    ids[2 * k] = ia
    ids[2 * k + 1] = ib
    _place(pair, points, k, ax, ay, az, bx, by, bz)
    return listed_a, listed_b


@kernel(inline=True)
def _turned_back(poses, p, dx, dy, dz):
    """A direction of the world in the axes of a body."""
    return (
        poses[p] * dx + poses[p + 3] * dy + poses[p + 6] * dz,
        poses[p + 1] * dx + poses[p + 4] * dy + poses[p + 7] * dz,
        poses[p + 2] * dx + poses[p + 5] * dy + poses[p + 8] * dz,
    )


@kernel(inline=True)
def _place(pair, points, k, ax, ay, az, bx, by, bz):
    """Point k becomes the difference of a and b, given in their bodies' frames."""
    p = pair.A.pose_at
    q = pair.B.pose_at
    poses = pair.poses
    t = pair.t
    at = POINT * k
    points[at + 3] = poses[p] * ax + poses[p + 1] * ay + poses[p + 2] * az
    points[at + 4] = poses[p + 3] * ax + poses[p + 4] * ay + poses[p + 5] * az
    points[at + 5] = poses[p + 6] * ax + poses[p + 7] * ay + poses[p + 8] * az
    points[at + 6] = poses[q] * bx + poses[q + 1] * by + poses[q + 2] * bz
    points[at + 7] = poses[q + 3] * bx + poses[q + 4] * by + poses[q + 5] * bz
    points[at + 8] = poses[q + 6] * bx + poses[q + 7] * by + poses[q + 8] * bz
    points[at] = (points[at + 3] - points[at + 6]) - t.x
    points[at + 1] = (points[at + 4] - points[at + 7]) - t.y
    points[at + 2] = (points[at + 5] - points[at + 8]) - t.z


@kernel
def place_vertices(pair, points, ids, k, i, j):
    """Point k becomes the difference of vertex i of A and vertex j of B."""
    A, B = pair.A, pair.B
    ids[2 * k] = i
    ids[2 * k + 1] = j
    _place(
        pair, points, k, A.coords[i], A.coords[A.padded + i], A.coords[2 * A.padded + i],
        B.coords[j], B.coords[B.padded + j], B.coords[2 * B.padded + j],
    )  # fmt: skip


@kernel(cold=True)
def settle_point(pair, points, ids, k, dx, dy, dz):
    """Make point k, found by `difference_point`, one that is farthest in direction d for certain.

    Support trees propose; nothing may be concluded from a plane before their vertices are settled.
    """
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    ia = ids[2 * k]
    ib = ids[2 * k + 1]
    if A.tree != 0:
        ex, ey, ez = _turned_back(poses, p, dx, dy, dz)
        ia = settled_vertex(A.coords, A.n, A.padded, A.tree, ia, ex, ey, ez)
    if B.tree != 0:
        fx, fy, fz = _turned_back(poses, q, -dx, -dy, -dz)
        ib = settled_vertex(B.coords, B.n, B.padded, B.tree, ib, fx, fy, fz)
    if ia == ids[2 * k] and ib == ids[2 * k + 1]:
        return
    at = POINT * k
    # A curved core has no id; its point stays as it is.
    if ia != ids[2 * k]:
        x = A.coords[ia]
        y = A.coords[A.padded + ia]
        z = A.coords[2 * A.padded + ia]
        points[at + 3] = poses[p] * x + poses[p + 1] * y + poses[p + 2] * z
        points[at + 4] = poses[p + 3] * x + poses[p + 4] * y + poses[p + 5] * z
        points[at + 5] = poses[p + 6] * x + poses[p + 7] * y + poses[p + 8] * z
    if ib != ids[2 * k + 1]:
        x = B.coords[ib]
        y = B.coords[B.padded + ib]
        z = B.coords[2 * B.padded + ib]
        points[at + 6] = poses[q] * x + poses[q + 1] * y + poses[q + 2] * z
        points[at + 7] = poses[q + 3] * x + poses[q + 4] * y + poses[q + 5] * z
        points[at + 8] = poses[q + 6] * x + poses[q + 7] * y + poses[q + 8] * z
    ids[2 * k] = ia
    ids[2 * k + 1] = ib
    points[at] = (points[at + 3] - points[at + 6]) - pair.t.x
    points[at + 1] = (points[at + 4] - points[at + 7]) - pair.t.y
    points[at + 2] = (points[at + 5] - points[at + 8]) - pair.t.z


@kernel(inline=True)
def has_trees(pair):
    """Whether a support point of the pair is to be settled before anything is concluded from it."""
    return pair.A.tree != 0 or pair.B.tree != 0


@kernel(inline=True)
def copy_point(points, ids, source, target):
    """Point ``target`` becomes point ``source``."""
    for j in range(POINT):
        points[POINT * target + j] = points[POINT * source + j]
    ids[2 * target] = ids[2 * source]
    ids[2 * target + 1] = ids[2 * source + 1]


@kernel(inline=True)
def combined(points, weights, n, j):
    """Coordinate j of the weighted sum of n stored points."""
    total = 0.0
    for k in range(n):
        total += weights[k] * points[POINT * k + j]
    return total
