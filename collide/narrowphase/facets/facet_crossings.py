"""What clearly crossing pairs of facets share, in doubles: a segment, each end on an edge of one through the other.

Signs and orders are taken only where bounds of the errors prove them; other pairs are left open.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64, view_u8
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, max_abs, put_vec3, scale, sub

#: Ends of segments are this good, in units of the largest coordinate of the pair in W.
PROMISE = 2.0**-40
_U = 2.0**-53


class FacetCrossings(NamedTuple):
    """Of k pairs of facets A and B.

    is_segment : (k,) bool: they share a segment, proven, its ends as good as `PROMISE` says.
    is_clear : (k,) bool: they share one whose ends are inside an edge and inside a facet on both sides, proven.
    slots : (k, 2) int64 of the ends, the lower along n_A × n_B first: 0, 1 or 2 where A's edge from that corner to the
        next pierces B, 3 more where B's pierces A.
    place : (k, 2, 3) the ends in W [m], off by ``error`` (k,) at most.
    """

    is_segment: np.ndarray
    is_clear: np.ndarray
    slots: np.ndarray
    place: np.ndarray
    error: np.ndarray


def facet_crossings(A: np.ndarray, B: np.ndarray, X_WA: np.ndarray, X_WB: np.ndarray) -> FacetCrossings:
    """Crossings of facets by pairs.   A, B : (k, 3, 3) corners in their bodies' frames.   X_WA, X_WB : (k, 4, 4)."""
    k = len(A)
    arguments = [np.ascontiguousarray(x, dtype=np.float64) for x in (A, B, X_WA, X_WB)]
    is_segment, is_clear = np.zeros(k, dtype=np.uint8), np.zeros(k, dtype=np.uint8)
    slots, place, error = np.zeros((k, 2), dtype=np.int64), np.zeros((k, 2, 3)), np.zeros(k)
    cross_facets(
        *map(address_of, arguments), k, *map(address_of, (is_segment, is_clear, slots, place, error))
    )
    return FacetCrossings(is_segment.view(bool), is_clear.view(bool), slots, place, error)


@kernel
def posed_corner(poses, X, local, v):
    """Vertex v in W, rounded.   X : where its pose begins."""
    x, y, z = local[3 * v], local[3 * v + 1], local[3 * v + 2]
    return Vec3(
        poses[X] * x + poses[X + 1] * y + poses[X + 2] * z + poses[X + 3],
        poses[X + 4] * x + poses[X + 5] * y + poses[X + 6] * z + poses[X + 7],
        poses[X + 8] * x + poses[X + 9] * y + poses[X + 10] * z + poses[X + 11],
    )


@kernel
def corner_error(poses, X, local, v):
    """A bound of the errors of its coordinates: six units of the sum of the sizes of what is added."""
    largest = 0.0
    for i in range(3):
        size = 0.0
        for j in range(3):
            size += abs(poses[X + 4 * i + j] * local[3 * v + j])
        largest = max(largest, size + abs(poses[X + 4 * i + 3]))
    return 6.0 * _U * largest


@kernel
def _heights(p, n, edge, a, b, c, error):
    """(heights of three points over a plane through p times its normal's length, a bound of their errors).

    As in `filtered_triangles.py`, all corners off by E: edges by f = 2E + 2uL, components of normals
    by 4Lf + 2f² + 3uL², heights by 3 D times that, 3·(2L² + …)·(2E + 2uD), and 4u of the terms: below 40 L D f' with
    the larger of both f.
    """
    v, w, x = sub(a, p), sub(b, p), sub(c, p)
    far = max(max_abs(v), max_abs(w), max_abs(x), edge)
    f = 2.0 * error + 4.0 * _U * far
    limit = 40.0 * edge * far * f + 12.0 * far * f * f + 60.0 * _U * edge * edge * far + 1e-260
    return Vec3(dot(v, n), dot(w, n), dot(x, n)), limit


@kernel
def _alone(heights, limit):
    """Number of the corner proven alone on its side, both others on the other; −1 where no corner is."""
    if not (abs(heights.x) > limit and abs(heights.y) > limit and abs(heights.z) > limit):
        return -1
    x, y, z = heights.x > 0.0, heights.y > 0.0, heights.z > 0.0
    if x == y:
        return -1 if y == z else 2
    return 1 if x == z else 0


@kernel
def _shifted(a, i):
    """Three things from number i on."""
    p, q, r = a
    return (p, q, r) if i == 0 else ((q, r, p) if i == 1 else (r, p, q))


@kernel
def _ends(corners, heights, limit, error):
    """(where the two sides from the first corner cross the other's plane, a bound of the errors).

    A point a + (b − a) s / (s − t) is off by |b − a| · δ(s / (s − t)) ≤ |b − a| · 2 δ / (|s − t| − 2δ), and by E and
    rounding.
    """
    a, b, c = corners
    s, t, u = heights
    largest = max(max_abs(a), max_abs(b), max_abs(c))
    p, off_p = end_of_segment(a, s, b, t, limit)
    q, off_q = end_of_segment(a, s, c, u, limit)
    return p, q, max(off_p + 4.0 * error + 4.0 * _U * largest, off_q + 4.0 * error + 4.0 * _U * largest)


@kernel
def end_of_segment(a, s, b, t, limit):
    """(where a segment from a to b, of heights s and t off by ``limit``, has height 0, a bound of the error)."""
    edge = sub(b, a)
    slope = abs(s - t)
    if not slope > 4.0 * limit:
        return a, math.inf
    point = add(a, scale(s / (s - t), edge))
    return point, max_abs(edge) * (2.0 * limit / (slope - 2.0 * limit) + 8.0 * _U)


@kernel
def _put(slots, place, row, end, which, corner_a, corner_b, a, b, c, d):
    """Put end number ``which`` of both pieces, 0 and 1 of A and 2 and 3 of B, as an end of the segment.

    corner_a, corner_b : the corners alone on their sides, from which the first side and the last go.
    """
    slot = (corner_a if which < 2 else corner_b) + (2 if which % 2 == 1 else 0)
    slots[2 * row + end] = slot % 3 + (3 if which >= 2 else 0)
    put_vec3(place, 6 * row + 3 * end, a if which == 0 else (b if which == 1 else (c if which == 2 else d)))


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def cross_facets(A_at, B_at, poses_a_at, poses_b_at, n, is_segment_at, is_clear_at, slots_at, place_at, error_at):
    """Fields of `FacetCrossings`, zeros at first, of n pairs."""
    A, B = view_f64(A_at, 9 * n), view_f64(B_at, 9 * n)
    poses_a, poses_b = view_f64(poses_a_at, 16 * n), view_f64(poses_b_at, 16 * n)
    is_segment, is_clear = view_u8(is_segment_at, n), view_u8(is_clear_at, n)
    slots, place, error_of = view_i64(slots_at, 2 * n), view_f64(place_at, 6 * n), view_f64(error_at, n)
    for row in range(n):
        v, X = 3 * row, 16 * row
        p, q, r = posed_corner(poses_a, X, A, v), posed_corner(poses_a, X, A, v + 1), posed_corner(poses_a, X, A, v + 2)
        s, t, u = posed_corner(poses_b, X, B, v), posed_corner(poses_b, X, B, v + 1), posed_corner(poses_b, X, B, v + 2)
        error = 0.0
        for k in range(3):
            error = max(error, corner_error(poses_a, X, A, v + k), corner_error(poses_b, X, B, v + k))
        pq, pr = sub(q, p), sub(r, p)
        n_a = cross(pq, pr)
        heights_b, limit_b = _heights(p, n_a, max(max_abs(pq), max_abs(pr)), s, t, u, error)
        corner_b = _alone(heights_b, limit_b)
        if corner_b < 0:
            continue
        st, su = sub(t, s), sub(u, s)
        n_b = cross(st, su)
        heights_a, limit_a = _heights(s, n_b, max(max_abs(st), max_abs(su)), p, q, r, error)
        corner_a = _alone(heights_a, limit_a)
        if corner_a < 0:
            continue
        a, b, off_a = _ends(
            _shifted((p, q, r), corner_a), _shifted((heights_a.x, heights_a.y, heights_a.z), corner_a), limit_a, error
        )
        c, d, off_b = _ends(
            _shifted((s, t, u), corner_b), _shifted((heights_b.x, heights_b.y, heights_b.z), corner_b), limit_b, error
        )
        off = max(off_a, off_b)
        along = cross(n_a, n_b)
        along = divide(along, max_abs(along))
        # Heights along a direction near that of the common line: off by 6 times the points' error, all differences
        # included. How far apart points are that are one by their heights: no farther than 2½ times that, where the
        # longer of both pieces rises by half its length at least. Any direction puts points of one line in order.
        ab, ac, ad = sub(b, a), sub(c, a), sub(d, a)
        h_a, h_b = dot(sub(a, a), along), dot(ab, along)
        h_c, h_d = dot(ac, along), dot(ad, along)
        length_a, length_b = max_abs(ab), max_abs(sub(ad, ac))
        steep_a = abs(h_b - h_a) >= 0.5 * length_a and length_a > 64.0 * off
        steep_b = abs(h_d - h_c) >= 0.5 * length_b and length_b > 64.0 * off
        if not (steep_a or steep_b):
            continue
        largest = max(max_abs(p), max_abs(q), max_abs(r), max_abs(s), max_abs(t), max_abs(u))
        slack = 16.0 * off + 64.0 * _U * largest
        # Of two segments on one line the common part is from the higher of the lower ends to the lower of the higher.
        low = (0 if h_a < h_b else 1) if min(h_a, h_b) > min(h_c, h_d) else (2 if h_c < h_d else 3)
        high = (1 if h_a < h_b else 0) if max(h_a, h_b) < max(h_c, h_d) else (3 if h_c < h_d else 2)
        if not min(max(h_a, h_b), max(h_c, h_d)) - max(min(h_a, h_b), min(h_c, h_d)) > slack:
            continue
        _put(slots, place, row, 0, low, corner_a, corner_b, a, b, c, d)
        _put(slots, place, row, 1, high, corner_a, corner_b, a, b, c, d)
        error_of[row] = off
        apart = abs(h_a - h_c) > slack and abs(h_a - h_d) > slack and abs(h_b - h_c) > slack and abs(h_b - h_d) > slack
        is_clear[row] = 1 if apart else 0
        # Where two ends are too near to be told apart, the segment may end at the other.
        is_segment[row] = 1 if (off if apart else 16.0 * off) <= PROMISE * largest else 0
