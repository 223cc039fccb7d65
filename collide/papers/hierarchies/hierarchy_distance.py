"""Distance of two hulls down their hierarchies: O(log n log m) rounds of constant size.

Dobkin, Kirkpatrick, "Determining the separation of preprocessed polyhedra: a unified approach" (1990), as section 4 of
Barba and Langerman repairs it, with hierarchies of bounded degree.

Let S be a small body and T_j a level, b the point of T_j nearest S, and H the plane through b perpendicular to the
shortest segment. Any point of T_{j−1} nearer to S lies beyond H. By Lemma 4.2 at most a single vertex p of T_{j−1}
lies beyond H, and the part of T_{j−1} beyond H is in the hull of p and its neighbours. So the new distance is the
smaller of the old distance and the distance from S to this hull: a small problem a level, and the distance of S from T
in O(log m).

Down the other hierarchy the same holds with T in the place of S: where a vertex p of P_{i−1} lies beyond the plane
through the nearest point of P_i, the distance is the smaller of the old distance and the distance from the hull of p
and its neighbours to T, found by a descent of its own. The nearest point of T may then be anywhere, far from the point
before: hence the second logarithm.

In doubles, without proof: the result is a proposal, settled by the exact stage (`hierarchy_queries.py`). Nearest
points of small hulls are found by GJK over their vertices.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.narrowphase.gjk.simplex import nearest_in_simplex
from collide.numerics.vec3 import add, cross, dot, neg, put_vec3, rotate, scale, sub, vec3_at
from collide.papers.hierarchies.packed_hierarchy import PackedHierarchy, levels_at, row_at

#: Rounds of a small GJK; a round without a smaller distance ends the search.
_ROUNDS = 200
#: Doubles of a nearest pair: squared distance, point of A, point of B. Its ids: three vertices of each, −1 beyond.
_PAIR, _IDS = 7, 6
_POINT_OF_A, _POINT_OF_B = 1, 4
#: Counters: levels gone down in A, levels gone down in B, small problems, vertices looked at.
COUNTERS = 4
_DOWN_A, _DOWN_B, _PROBLEMS, _VERTICES = range(COUNTERS)
#: Doubles of a simplex: five difference points, then weights and the nearest point.
_SIMPLEX, _WEIGHTS = 5 * POINT, 10
#: Where the nearest point stands among the weights.
_NEAREST = 4


class Nearest(NamedTuple):
    """distance (0 where they overlap), the nearest points in A's frame, the counters, and the vertices that span them:

    vertices : (3, 2) int64, pairs of vertices of A and of B whose differences span the nearest difference; −1 beyond.
    """

    distance: float
    point_a: np.ndarray
    point_b: np.ndarray
    counters: np.ndarray
    vertices: np.ndarray


def hierarchy_distance(A: PackedHierarchy, B: PackedHierarchy, rotation: np.ndarray, shift: np.ndarray) -> Nearest:
    """Distance of hull A from hull B at x ↦ rotation x + shift in A's frame [m].

    rotation (3, 3), shift (3,). The doubles of rotation and shift are taken as exact; the distance is infinite, without
    vertices, where squares overflow or numbers are not finite. Squares that underflow count as 0. O(log n log m).
    """
    pose = np.ascontiguousarray(np.concatenate([np.asarray(rotation, float).ravel(), np.asarray(shift, float)]))
    result = np.empty(_PAIR)
    counters = np.zeros(COUNTERS, dtype=np.int64)
    max_a, max_b = 1 + A.max_degree, 1 + B.max_degree
    doubles = np.zeros(3 * (max_a + max_b) + _SIMPLEX + _WEIGHTS + 2 * _PAIR)
    integers = np.full(max_a + max_b + 10 + 2 * _IDS, -1, dtype=np.int64)
    nearest(
        A.address, B.address, max_a, max_b, address_of(pose), address_of(doubles), address_of(integers),
        address_of(result), address_of(counters),
    )
    ids_at = max_a + max_b + 10
    vertices = integers[ids_at : ids_at + _IDS].reshape(2, 3).T
    return Nearest(math.sqrt(result[0]), result[1:4], result[4:7], counters, vertices)


class Body(NamedTuple):
    """A hierarchy at a pose.

    levels : its `Levels`.   pose : 12 doubles, rotation and shift; applied where ``is_b``.
    """

    levels: Any
    pose: Any
    is_b: bool


class Star(NamedTuple):
    """A small set of points of a body, in A's frame: three doubles each, and their ids."""

    coords: Any
    ids: Any


class Simplex(NamedTuple):
    """Difference points (POINT doubles each), weights and the nearest point, two places in the stars a point."""

    points: Any
    weights: Any
    ids: Any


class NearestPair(NamedTuple):
    """A nearest pair so far: _PAIR doubles, and _IDS ids."""

    numbers: Any
    ids: Any


@kernel
def vertex_of(body, v):
    """Vertex v in A's frame."""
    p = vec3_at(body.levels.points, 3 * v)
    return add(rotate(body.pose, 0, p), vec3_at(body.pose, 9)) if body.is_b else p


@kernel
def put_top(body, star):
    """The tetrahedron of the coarsest level becomes the star; returns its size."""
    first = body.levels.level_start[body.levels.depth - 1]
    for k in range(4):
        star.ids[k] = body.levels.level_vertices[first + k]
        put_vec3(star.coords, 3 * k, vertex_of(body, star.ids[k]))
    return 4


@kernel
def put_star(body, v, level, star):
    """Vertex v and its neighbours in a level become the star; returns its size."""
    levels = body.levels
    row = row_at(levels, v, level)
    star.ids[0] = v
    put_vec3(star.coords, 0, vertex_of(body, v))
    n = 1
    for at in range(levels.neighbour_start[row], levels.neighbour_start[row + 1]):
        star.ids[n] = levels.neighbours[at]
        put_vec3(star.coords, 3 * n, vertex_of(body, star.ids[n]))
        n += 1
    return n


@kernel
def support_of(coords, count, d):
    """The first point that is farthest along d."""
    best = -math.inf
    farthest = 0
    for k in range(count):
        value = dot(vec3_at(coords, 3 * k), d)
        if value > best:
            best = value
            farthest = k
    return farthest


@kernel
def nearest_of_stars(a, count_a, b, count_b, simplex, pair, counters):
    """Nearest points of the hulls of two stars, by GJK; written where they are nearer than ``pair``."""
    points, weights, ids = simplex.points, simplex.weights, simplex.ids
    counters[_PROBLEMS] += 1
    counters[_VERTICES] += count_a + count_b
    put_difference(a.coords, 0, b.coords, 0, points, ids, 0)
    n = 1
    square = nearest_in_simplex(points, n, weights, 15)
    for _ in range(_ROUNDS):
        d = vec3_at(weights, _NEAREST)
        if square == 0.0:
            break
        put_difference(
            a.coords, support_of(a.coords, count_a, neg(d)), b.coords, support_of(b.coords, count_b, d), points, ids, n
        )
        w = dot(vec3_at(points, POINT * n), d)
        if w > 0.0 and w * w >= pair.numbers[0] * square:
            return  # farther than the pair known
        repeated = False
        for k in range(n):
            repeated = repeated or (ids[2 * k] == ids[2 * n] and ids[2 * k + 1] == ids[2 * n + 1])
        if repeated or square - w <= 2.0**-50 * square:
            break
        before = (weights[0], weights[1], weights[2], weights[3])
        closer = nearest_in_simplex(points, n + 1, weights, 15)
        if n == 3 and encloses(points):
            closer = 0.0
        if not closer < square:
            weights[0], weights[1], weights[2], weights[3] = before
            put_vec3(weights, _NEAREST, d)
            break
        square = closer
        n = keep_used(points, ids, weights, n + 1)
    if square < pair.numbers[0]:
        write_pair(simplex, a.ids, b.ids, n, square, pair)


@kernel
def put_difference(a, i, b, j, points, ids, n):
    """Difference point n of the simplex, with the points it comes from."""
    p, q = vec3_at(a, 3 * i), vec3_at(b, 3 * j)
    put_vec3(points, POINT * n, sub(p, q))
    put_vec3(points, POINT * n + 3, p)
    put_vec3(points, POINT * n + 6, q)
    ids[2 * n] = i
    ids[2 * n + 1] = j


@kernel
def encloses(points):
    """Whether the origin is strictly inside the tetrahedron of four points, in doubles."""
    sign = 0.0
    for k in range(4):
        b, c = vec3_at(points, POINT * ((k + 2) % 4)), vec3_at(points, POINT * ((k + 3) % 4))
        value = dot(vec3_at(points, POINT * ((k + 1) % 4)), cross(b, c))
        value = value if k % 2 == 0 else -value
        if k == 0:
            sign = value
        if not value * sign > 0.0:
            return False
    return True


@kernel
def keep_used(points, ids, weights, n):
    """Keep the points with a positive weight; returns their number."""
    n_kept = 0
    for k in range(n):
        if weights[k] > 0.0:
            if n_kept != k:
                for t in range(POINT):
                    points[POINT * n_kept + t] = points[POINT * k + t]
                ids[2 * n_kept] = ids[2 * k]
                ids[2 * n_kept + 1] = ids[2 * k + 1]
                weights[n_kept] = weights[k]
            n_kept += 1
    for k in range(n_kept, 4):
        weights[k] = 0.0
    return n_kept


@kernel
def write_pair(simplex, ids_a, ids_b, n, square, pair):
    """The nearest points that the weights of the simplex give, and the vertices they are combinations of."""
    pair.numbers[0] = square
    for k in range(6):
        pair.numbers[1 + k] = 0.0
        pair.ids[k] = -1
    for k in range(min(n, 3)):
        for t in range(6):
            pair.numbers[1 + t] += simplex.weights[k] * simplex.points[POINT * k + 3 + t]
        pair.ids[k] = ids_a[simplex.ids[2 * k]]
        pair.ids[3 + k] = ids_b[simplex.ids[2 * k + 1]]


@kernel
def vertex_beyond(body, level, pair, counters):
    """The vertex of ``level`` beyond the plane through the body's nearest point of the level above, or −1.

    Vertices of the nearest point added by a cut above, hence not in this level, are replaced by the vertex
    cut.
    """
    levels = body.levels
    first_id = 3 if body.is_b else 0
    nearest_point = vec3_at(pair.numbers, _POINT_OF_B if body.is_b else _POINT_OF_A)
    to_b = sub(vec3_at(pair.numbers, _POINT_OF_B), vec3_at(pair.numbers, _POINT_OF_A))
    towards = scale(-1.0 if body.is_b else 1.0, to_b)
    best = 0.0
    beyond = -1
    for k in range(first_id, first_id + 3):
        v = pair.ids[k]
        if v < 0:
            continue
        row = row_at(levels, v, level + 1)
        for at in range(levels.removed_start[row], levels.removed_start[row + 1]):
            u = np.int64(levels.removed[at])
            height = dot(sub(vertex_of(body, u), nearest_point), towards)
            counters[_VERTICES] += 1
            if height > best:
                best = height
                beyond = u
        if levels.birth[v] > level:
            pair.ids[k] = levels.parent[v]
    return beyond


@kernel
def descend(a, count_a, B, b, simplex, pair, counters):
    """The nearest pair of a star ``a`` and the whole of B, whose stars are put in ``b``."""
    pair.numbers[0] = math.inf
    for k in range(_IDS):
        pair.ids[k] = -1  # stays so where squares overflow and nothing is found
    count_b = put_top(B, b)
    nearest_of_stars(a, count_a, b, count_b, simplex, pair, counters)
    level = B.levels.depth - 2
    while level >= 0 and pair.numbers[0] > 0.0:
        counters[_DOWN_B] += 1
        v = vertex_beyond(B, level, pair, counters)
        if v >= 0:
            count_b = put_star(B, v, level, b)
            nearest_of_stars(a, count_a, b, count_b, simplex, pair, counters)
        level -= 1


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def nearest(A_at, B_at, max_a, max_b, pose_at, doubles_at, integers_at, result_at, counters_at):
    """Nearest points of two packed hierarchies, into ``result``. max_a, max_b : points of their largest stars."""
    pose = view_f64(pose_at, 12)
    A, B = Body(levels_at(A_at), pose, False), Body(levels_at(B_at), pose, True)
    a = Star(view_f64(doubles_at, 3 * max_a), view_i64(integers_at, max_a))
    b = Star(view_f64(doubles_at + 24 * max_a, 3 * max_b), view_i64(integers_at + 8 * max_a, max_b))
    doubles_at += 24 * (max_a + max_b)
    integers_at += 8 * (max_a + max_b)
    simplex = Simplex(
        view_f64(doubles_at, _SIMPLEX), view_f64(doubles_at + 8 * _SIMPLEX, _WEIGHTS), view_i64(integers_at, 10)
    )
    doubles_at += 8 * (_SIMPLEX + _WEIGHTS)
    pair = NearestPair(view_f64(doubles_at, _PAIR), view_i64(integers_at + 80, _IDS))
    tried = NearestPair(view_f64(doubles_at + 8 * _PAIR, _PAIR), view_i64(integers_at + 80 + 8 * _IDS, _IDS))
    counters = view_i64(counters_at, COUNTERS)
    count_a = put_top(A, a)
    descend(a, count_a, B, b, simplex, pair, counters)
    level = A.levels.depth - 2
    while level >= 0 and pair.numbers[0] > 0.0:
        counters[_DOWN_A] += 1
        v = vertex_beyond(A, level, pair, counters)
        if v >= 0:
            count_a = put_star(A, v, level, a)
            descend(a, count_a, B, b, simplex, tried, counters)
            if tried.numbers[0] < pair.numbers[0]:
                for k in range(_PAIR):
                    pair.numbers[k] = tried.numbers[k]
                for k in range(_IDS):
                    pair.ids[k] = tried.ids[k]
        level -= 1
    result = view_f64(result_at, _PAIR)
    for k in range(_PAIR):
        result[k] = pair.numbers[k]
