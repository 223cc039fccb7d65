"""Distance of two hulls down their hierarchies: O(log n log m) rounds of constant size.

Dobkin, Kirkpatrick, "Determining the separation of preprocessed polyhedra: a unified approach" (1990), as section 4 of
Barba and Langerman repairs it, with hierarchies of bounded degree.

Let S be a small body and T_j a level, b the point of T_j nearest S, and H the plane through b square to the shortest way.
Any point of T_{j−1} that is nearer S lies beyond H. By Lemma 4.2 at most one vertex p of T_{j−1} does, and what
T_{j−1} has beyond H is in the hull of p and its neighbours. So the new distance is the smaller one of the old one and
that from S to this hull: one small problem a level, and the distance of S from T in O(log m).

Down the other hierarchy the same holds with T in the place of S: where a vertex p of P_{i−1} lies beyond the plane
through the nearest point of P_i, the distance is the smaller one of the old one and that from the hull of p and
its neighbours to T, found by a descent of its own. The nearest point of T may be anywhere then: one cannot go on from
the one before, and this is where the second logarithm comes from.

In doubles, without proof: what comes out is a proposal, which the exact stage settles (`collide/hierarchies/hierarchy_queries.py`). Nearest points
of small hulls are found by GJK over their vertices.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.hierarchies.hierarchy import Hierarchy
from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.narrowphase.gjk.simplex import nearest_in_simplex

#: Rounds of one small GJK; it ends when the distance no longer falls.
_ROUNDS = 200
#: Places of a nearest pair: squared distance, point of A, point of B; then, as ids, three vertices of each, −1 beyond.
_PAIR, _IDS = 7, 6
#: Counters: levels gone down in A, levels gone down in B, small problems, vertices looked at.
COUNTERS = 4


class Nearest(NamedTuple):
    """distance (0 where they overlap), the nearest points in A's frame, the counters, and what the points lie on:

    vertices : (3, 2) int64, pairs of a vertex of A and one of B whose differences span the nearest one; −1 beyond.
    """

    distance: float
    point_a: np.ndarray
    point_b: np.ndarray
    counters: np.ndarray
    vertices: np.ndarray


class PackedHierarchy:
    """Addresses of a hierarchy's arrays for kernels; keeps the arrays alive."""

    def __init__(self, hierarchy: Hierarchy):
        self.hierarchy = hierarchy
        self.points = np.ascontiguousarray(hierarchy.points)
        self.top = np.ascontiguousarray(hierarchy.vertices(hierarchy.depth - 1))
        self.most = 1 + int(np.diff(hierarchy.neighbour_start).max())
        arrays = (
            self.points, hierarchy.birth, hierarchy.parent, hierarchy.row, hierarchy.neighbour_start,
            hierarchy.neighbours, hierarchy.removed_start, hierarchy.removed, self.top,
        )  # fmt: skip
        sizes = (len(self.points), len(hierarchy.level_vertices), len(hierarchy.neighbours), len(hierarchy.removed))
        self.handles = np.array([*map(address_of, arrays), *sizes, hierarchy.depth], dtype=np.int64)


def hierarchy_distance(a: PackedHierarchy, b: PackedHierarchy, rotation: np.ndarray, shift: np.ndarray) -> Nearest:
    """Distance of hull A from hull B at x ↦ rotation x + shift in A's frame.

    rotation (3, 3), shift (3,). The distance is that of what the doubles of rotation and shift place; infinite, without
    vertices, where squares overflow or numbers are not finite. Squares that underflow count as 0.
    """
    pose = np.ascontiguousarray(np.concatenate([np.asarray(rotation, float).ravel(), np.asarray(shift, float)]))
    result = np.empty(_PAIR)
    counters = np.zeros(COUNTERS, dtype=np.int64)
    room = a.most + b.most
    doubles = np.zeros(3 * room + 5 * POINT + 16 + 2 * _PAIR)
    integers = np.full(room + 16 + 2 * _IDS, -1, dtype=np.int64)
    nearest(
        address_of(a.handles), address_of(b.handles), a.most, b.most, address_of(pose), address_of(doubles),
        address_of(integers), address_of(result), address_of(counters),
    )  # fmt: skip
    vertices = integers[room + 10 : room + 10 + _IDS].reshape(2, 3).T
    return Nearest(math.sqrt(result[0]), result[1:4], result[4:7], counters, vertices)


@kernel
def levels_at(handles_at):
    """(points, birth, parent, row, neighbour_start, neighbours, removed_start, removed, top, depth)"""
    h = view_i64(handles_at, 14)
    points, rows = h[9], h[10]
    return (
        view_f64(h[0], 3 * points), view_i32(h[1], points), view_i32(h[2], points), view_i64(h[3], points),
        view_i64(h[4], rows + 1), view_i32(h[5], h[11]), view_i64(h[6], rows + 1), view_i32(h[7], h[12]),
        view_i32(h[8], 4), h[13],
    )  # fmt: skip


@kernel
def put_vertex(levels, pose, posed, v, coordinates, at):
    """Vertex v as point ``at`` of a set, at the pose if it is posed."""
    points = levels[0]
    x, y, z = points[3 * v], points[3 * v + 1], points[3 * v + 2]
    for k in range(3):
        if posed != 0:
            value = pose[3 * k] * x + pose[3 * k + 1] * y + pose[3 * k + 2] * z + pose[9 + k]
        else:
            value = points[3 * v + k]
        coordinates[3 * at + k] = value


@kernel
def put_top(levels, pose, posed, coordinates, ids):
    """The tetrahedron of the last level as a set; returns its size."""
    for k in range(4):
        ids[k] = levels[8][k]
        put_vertex(levels, pose, posed, ids[k], coordinates, k)
    return 4


@kernel
def put_star(levels, pose, posed, v, level, coordinates, ids):
    """Vertex v and its neighbours in a level as a set; returns its size."""
    own = levels[3][v] + level - levels[1][v]
    ids[0] = v
    put_vertex(levels, pose, posed, v, coordinates, 0)
    n = 1
    for at in range(levels[4][own], levels[4][own + 1]):
        ids[n] = levels[5][at]
        put_vertex(levels, pose, posed, ids[n], coordinates, n)
        n += 1
    return n


@kernel
def support_of(coordinates, count, x, y, z):
    """The first point that is farthest along (x, y, z)."""
    best = -math.inf
    found = 0
    for k in range(count):
        value = coordinates[3 * k] * x + coordinates[3 * k + 1] * y + coordinates[3 * k + 2] * z
        if value > best:
            best = value
            found = k
    return found


@kernel
def nearest_of_sets(a, ids_a, count_a, b, ids_b, count_b, space, simplex_ids, pair, pair_ids, counters):
    """Nearest points of the hulls of two sets, by GJK; written if nearer than ``pair``; returns whether they are."""
    points, weights = space
    counters[2] += 1
    counters[3] += count_a + count_b
    put_difference(a, 0, b, 0, points, simplex_ids, 0)
    n = 1
    square = nearest_in_simplex(points, n, weights, 15)
    for _ in range(_ROUNDS):
        x, y, z = weights[4], weights[5], weights[6]
        if square == 0.0:
            break
        put_difference(a, support_of(a, count_a, -x, -y, -z), b, support_of(b, count_b, x, y, z), points, simplex_ids, n)
        w = points[POINT * n] * x + points[POINT * n + 1] * y + points[POINT * n + 2] * z
        if w > 0.0 and w * w >= pair[0] * square:
            return False  # farther than the pair known
        repeated = False
        for k in range(n):
            repeated = repeated or (simplex_ids[2 * k] == simplex_ids[2 * n] and simplex_ids[2 * k + 1] == simplex_ids[2 * n + 1])
        if repeated or square - w <= 2.0**-50 * square:
            break
        before = (weights[0], weights[1], weights[2], weights[3])
        closer = nearest_in_simplex(points, n + 1, weights, 15)
        if n == 3 and encloses(points):
            closer = 0.0
        if not closer < square:
            weights[0], weights[1], weights[2], weights[3] = before
            weights[4], weights[5], weights[6] = x, y, z
            break
        square = closer
        n = keep_used(points, simplex_ids, weights, n + 1)
    if not square < pair[0]:
        return False
    write_pair(points, simplex_ids, ids_a, ids_b, weights, n, square, pair, pair_ids)
    return True


@kernel
def put_difference(a, i, b, j, points, simplex_ids, n):
    """Difference point n of the simplex, with the points it comes from."""
    at = POINT * n
    for k in range(3):
        points[at + k] = a[3 * i + k] - b[3 * j + k]
        points[at + 3 + k] = a[3 * i + k]
        points[at + 6 + k] = b[3 * j + k]
    simplex_ids[2 * n] = i
    simplex_ids[2 * n + 1] = j


@kernel
def encloses(points):
    """Whether the origin is strictly inside the tetrahedron of four points, in doubles."""
    sign = 0.0
    for k in range(4):
        a, b, c = POINT * ((k + 1) % 4), POINT * ((k + 2) % 4), POINT * ((k + 3) % 4)
        value = (
            points[a] * (points[b + 1] * points[c + 2] - points[b + 2] * points[c + 1])
            + points[a + 1] * (points[b + 2] * points[c] - points[b] * points[c + 2])
            + points[a + 2] * (points[b] * points[c + 1] - points[b + 1] * points[c])
        )
        value = value if k % 2 == 0 else -value
        if k == 0:
            sign = value
        if not value * sign > 0.0:
            return False
    return True


@kernel
def keep_used(points, simplex_ids, weights, n):
    """Keep the points with a positive weight; returns their number."""
    kept = 0
    for k in range(n):
        if weights[k] > 0.0:
            if kept != k:
                for t in range(POINT):
                    points[POINT * kept + t] = points[POINT * k + t]
                simplex_ids[2 * kept] = simplex_ids[2 * k]
                simplex_ids[2 * kept + 1] = simplex_ids[2 * k + 1]
                weights[kept] = weights[k]
            kept += 1
    for k in range(kept, 4):
        weights[k] = 0.0
    return kept


@kernel
def write_pair(points, simplex_ids, ids_a, ids_b, weights, n, square, pair, pair_ids):
    """The nearest points of the simplex found, and the vertices they are combinations of."""
    pair[0] = square
    for k in range(6):
        pair[1 + k] = 0.0
        pair_ids[k] = -1
    for k in range(min(n, 3)):
        for t in range(6):
            pair[1 + t] += weights[k] * points[POINT * k + 3 + t]
        pair_ids[k] = ids_a[simplex_ids[2 * k]]
        pair_ids[3 + k] = ids_b[simplex_ids[2 * k + 1]]


@kernel
def beyond(levels, pose, posed, level, pair, pair_ids, side, sign, spot):
    """The vertex of ``level`` that lies beyond the plane through a nearest point of the level above it, or −1.

    side : 0 or 3, where the nearest point's vertices stand in ``pair_ids``. Those that this level has not, because a cut
        added them above, are replaced by the vertex cut.
    """
    x, y, z = pair[4] - pair[1], pair[5] - pair[2], pair[6] - pair[3]
    x, y, z = sign * x, sign * y, sign * z
    best = 0.0
    found = -1
    looked = 0
    for k in range(side, side + 3):
        v = pair_ids[k]
        if v < 0:
            continue
        own = levels[3][v] + level + 1 - levels[1][v]
        for at in range(levels[6][own], levels[6][own + 1]):
            u = np.int64(levels[7][at])
            put_vertex(levels, pose, posed, u, spot, 0)
            height = (spot[0] - pair[1 + side]) * x + (spot[1] - pair[2 + side]) * y + (spot[2] - pair[3 + side]) * z
            looked += 1
            if height > best:
                best = height
                found = u
        if levels[1][v] > level:
            pair_ids[k] = levels[2][v]
    return found, looked


@kernel
def descend(a, ids_a, count_a, b, ids_b, levels, pose, space, simplex_ids, spot, pair, pair_ids, counters):
    """The pair of the set A and the whole of hierarchy B nearest to each other."""
    pair[0] = math.inf
    for k in range(_IDS):
        pair_ids[k] = -1  # stays so where squares overflow and nothing is found
    count = put_top(levels, pose, 1, b, ids_b)
    nearest_of_sets(a, ids_a, count_a, b, ids_b, count, space, simplex_ids, pair, pair_ids, counters)
    level = levels[9] - 2
    while level >= 0 and pair[0] > 0.0:
        counters[1] += 1
        p, looked = beyond(levels, pose, 1, level, pair, pair_ids, 3, -1.0, spot)
        counters[3] += looked
        if p >= 0:
            count = put_star(levels, pose, 1, p, level, b, ids_b)
            nearest_of_sets(a, ids_a, count_a, b, ids_b, count, space, simplex_ids, pair, pair_ids, counters)
        level -= 1


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def nearest(handles_a, handles_b, most_a, most_b, pose_at, doubles_at, integers_at, result_at, counters_at):
    """Nearest points of two hierarchies, into ``result``."""
    a_levels, b_levels = levels_at(handles_a), levels_at(handles_b)
    pose = view_f64(pose_at, 12)
    a = view_f64(doubles_at, 3 * most_a)
    b = view_f64(doubles_at + 24 * most_a, 3 * most_b)
    rest = doubles_at + 24 * (most_a + most_b)
    space = (view_f64(rest, 5 * POINT), view_f64(rest + 40 * POINT, 10))
    spot = view_f64(rest + 40 * POINT + 80, 3)
    pair = view_f64(rest + 40 * POINT + 104, _PAIR)
    tried = view_f64(rest + 40 * POINT + 104 + 8 * _PAIR, _PAIR)
    ids_a = view_i64(integers_at, most_a)
    ids_b = view_i64(integers_at + 8 * most_a, most_b)
    tail = integers_at + 8 * (most_a + most_b)
    simplex_ids = view_i64(tail, 10)
    pair_ids = view_i64(tail + 80, _IDS)
    tried_ids = view_i64(tail + 80 + 8 * _IDS, _IDS)
    result = view_f64(result_at, _PAIR)
    counters = view_i64(counters_at, COUNTERS)
    count = put_top(a_levels, pose, 0, a, ids_a)
    descend(a, ids_a, count, b, ids_b, b_levels, pose, space, simplex_ids, spot, pair, pair_ids, counters)
    level = a_levels[9] - 2
    while level >= 0 and pair[0] > 0.0:
        counters[0] += 1
        p, looked = beyond(a_levels, pose, 0, level, pair, pair_ids, 0, 1.0, spot)
        counters[3] += looked
        if p >= 0:
            count = put_star(a_levels, pose, 0, p, level, a, ids_a)
            descend(a, ids_a, count, b, ids_b, b_levels, pose, space, simplex_ids, spot, tried, tried_ids, counters)
            if tried[0] < pair[0]:
                for k in range(_PAIR):
                    pair[k] = tried[k]
                for k in range(_IDS):
                    pair_ids[k] = tried_ids[k]
        level -= 1
    for k in range(_PAIR):
        result[k] = pair[k]
