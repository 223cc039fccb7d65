"""The Minkowski difference A ⊖ B of two posed cores, seen through its support mapping.

Both poses are used as given: a point of the difference is R_A a − R_B b − (p_WB − p_WA). The pair
is closest where this set is nearest the origin, overlaps where it contains the origin.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, add, column_at, dot, neg, put_vec3, rotate, rotate_back, scale, sub, vec3_at
from collide.support.support_mapping import settled_vertex, support
from collide.support.support_tree_query import two_extreme_vertices

#: Doubles stored a point of A ⊖ B: w = a − b − t, then a and b in W's axes from their own body's origin.
POINT, POINT_OF_A, POINT_OF_B = 9, 3, 6
#: Where weights of up to four points are followed by the point they make, and by a unit axis.
NEAREST_POINT, AXIS = 4, 7


@kernel(cold=True)
def listed_difference_point(pair, points, ids, k, d, list_a, list_b):
    """`inlined_difference_point` of whole bodies, called: a copy at every place where one is asked for took 8 s to
    compile."""
    return inlined_difference_point(pair, points, ids, k, d, False, list_a, list_b)


@kernel(inline=True)
def difference_point(pair, points, ids, k, d):
    """The same by walks through whole support trees."""
    return listed_difference_point(pair, points, ids, k, d, -1, -1)


@kernel(inline=True)
def inlined_difference_point(pair, points, ids, k, d, coarse, list_a, list_b):
    """Store as point k the point of A ⊖ B farthest in direction d; with a support tree, not proven to be the farthest.

    Returns the lists of the bodies' support trees with the vertices found (`extreme_vertex_listed`).

    pair : a `PosedPair`.   coarse : search the coarse points alone, where a body has them.
    points : POINT doubles a point.   ids : two a point, the support vertices of A and of B.
    list_a, list_b : the only lists to search, or −1.
    """
    A, B = pair.A, pair.B
    e = rotate_back(pair.poses, A.pose_at, d)
    f = rotate_back(pair.poses, B.pose_at, neg(d))
    if A.tree != 0 and B.tree != 0 and not coarse:
        a, b = two_extreme_vertices(A.tree, list_a, e, B.tree, list_b, f)
    else:
        a = _support(pair, A, coarse, list_a, e)
        b = _support(pair, B, coarse, list_b, f)
    ids[2 * k] = a.id
    ids[2 * k + 1] = b.id
    _put_point_of(pair, A, points, POINT * k + POINT_OF_A, a.point)
    _put_point_of(pair, B, points, POINT * k + POINT_OF_B, b.point)
    _put_difference(pair, points, k)
    return a.list_id, b.list_id


@kernel(inline=True)
def _support(pair, body, coarse, list_id, g):
    """`support` of one body in a direction of its own frame."""
    coarse_at = body.coarse_at if coarse else 0
    return support(
        body.kind, body.coords, body.padded, pair.numbers, body.params_at, body.tree, coarse_at, list_id, g
    )


@kernel(inline=True)
def _put_point_of(pair, body, points, at, p):
    """A point of a body's frame, in W's axes."""
    put_vec3(points, at, rotate(pair.poses, body.pose_at, p))


@kernel(inline=True)
def _put_difference(pair, points, k):
    """Point k from its a and b."""
    a = vec3_at(points, POINT * k + POINT_OF_A)
    b = vec3_at(points, POINT * k + POINT_OF_B)
    put_vec3(points, POINT * k, sub(sub(a, b), pair.t))


@kernel
def place_vertices(pair, points, ids, k, i, j):
    """Point k becomes the difference of vertex i of A and vertex j of B."""
    ids[2 * k] = i
    ids[2 * k + 1] = j
    _put_point_of(pair, pair.A, points, POINT * k + POINT_OF_A, column_at(pair.A.coords, pair.A.padded, i))
    _put_point_of(pair, pair.B, points, POINT * k + POINT_OF_B, column_at(pair.B.coords, pair.B.padded, j))
    _put_difference(pair, points, k)


@kernel(cold=True)
def settle_point(pair, points, ids, k, d):
    """Make point k, found by `difference_point`, a point certainly farthest in direction d.

    Support trees propose; no plane is a bound before its vertices are settled. A curved core has no vertex; its point
    stays.
    """
    A, B = pair.A, pair.B
    i = _settled(pair, A, ids[2 * k], d)
    j = _settled(pair, B, ids[2 * k + 1], neg(d))
    if i == ids[2 * k] and j == ids[2 * k + 1]:
        return
    if i != ids[2 * k]:
        _put_point_of(pair, A, points, POINT * k + POINT_OF_A, column_at(A.coords, A.padded, i))
    if j != ids[2 * k + 1]:
        _put_point_of(pair, B, points, POINT * k + POINT_OF_B, column_at(B.coords, B.padded, j))
    ids[2 * k] = i
    ids[2 * k + 1] = j
    _put_difference(pair, points, k)


@kernel(inline=True)
def _settled(pair, body, vertex, d):
    """The vertex of a body with a support tree that is farthest in a direction of the world for certain."""
    if body.tree == 0:
        return vertex
    g = rotate_back(pair.poses, body.pose_at, d)
    return settled_vertex(body.coords, body.padded, body.tree, vertex, g)


@kernel(inline=True)
def has_trees(pair):
    """Whether a support point of the pair is to be settled before anything is concluded from it."""
    return pair.A.tree != 0 or pair.B.tree != 0


@kernel(inline=True)
def point_at(points, k):
    """Point k of A ⊖ B."""
    return vec3_at(points, POINT * k)


@kernel(inline=True)
def height(points, k, d):
    """Point k along a direction."""
    return dot(point_at(points, k), d)


@kernel(inline=True)
def copy_point(points, ids, source, target):
    """Point ``target`` becomes point ``source``."""
    copy_coordinates(points, source, points, target)
    ids[2 * target] = ids[2 * source]
    ids[2 * target + 1] = ids[2 * source + 1]


@kernel(inline=True)
def copy_coordinates(sources, source, points, target):
    """The POINT doubles of a point, from one list of points to another."""
    for j in range(POINT):
        points[POINT * target + j] = sources[POINT * source + j]


@kernel(inline=True)
def weighted_sum(points, weights, n, first):
    """Weighted sum of n stored points, of the coordinates that begin at ``first``: 0, POINT_OF_A or POINT_OF_B."""
    total = Vec3(0.0, 0.0, 0.0)
    for k in range(n):
        total = add(total, scale(weights[k], vec3_at(points, POINT * k + first)))
    return total


class Places(NamedTuple):
    """Places in memory of points A, B and C of a simplex of n points, and of a new point D."""

    n: int
    a: int
    b: int
    c: int
    d: int


@kernel(inline=True)
def is_repeated(ids, places):
    """Whether point D is one of the n others (curved cores have no ids and never repeat)."""
    i = ids[2 * places.d]
    j = ids[2 * places.d + 1]
    if i < 0 or j < 0:
        return False
    if ids[2 * places.a] == i and ids[2 * places.a + 1] == j:
        return True
    if places.n > 1 and ids[2 * places.b] == i and ids[2 * places.b + 1] == j:
        return True
    return places.n > 2 and ids[2 * places.c] == i and ids[2 * places.c + 1] == j


@kernel(cold=True)
def bring_to_front(points, ids, places):
    """Bring the n points A, B, C to the front, and D behind them; returns where all of them stand then."""
    n, a, b, c, d = places
    if a != 0:
        _exchange_points(points, ids, 0, a)
        b = a if b == 0 else b
        c = a if c == 0 else c
        d = a if d == 0 else d
    if n > 1 and b != 1:
        _exchange_points(points, ids, 1, b)
        c = b if c == 1 else c
        d = b if d == 1 else d
    if n > 2 and c != 2:
        _exchange_points(points, ids, 2, c)
        d = c if d == 2 else d
    if d != n:
        _exchange_points(points, ids, n, d)
    return Places(n, 0, 1 if n > 1 else 2, 2 if n > 2 else 3, n)


@kernel(inline=True)
def _exchange_points(points, ids, k, j):
    for i in range(POINT):
        points[POINT * k + i], points[POINT * j + i] = points[POINT * j + i], points[POINT * k + i]
    for i in range(2):
        ids[2 * k + i], ids[2 * j + i] = ids[2 * j + i], ids[2 * k + i]


@kernel(inline=True)
def drop_unused(points, ids, weights, n):
    """Keep the points with a positive weight; returns their number."""
    n_kept = 0
    for k in range(n):
        if weights[k] > 0.0:
            if n_kept != k:
                copy_point(points, ids, k, n_kept)
                weights[n_kept] = weights[k]
            n_kept += 1
    for k in range(n_kept, 4):
        weights[k] = 0.0
    return n_kept
