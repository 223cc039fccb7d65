"""Points of a convex manifold: corners of the overlap of two support faces, thinned out and put in order."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.clip_polygons import Clipped, clip_polygons, clip_segment, corner_of_b
from collide.kernels import kernel

#: Doubles of a point: place across the normal, gap along it, height of the middle between both bodies.
U, V, GAP, HEIGHT = range(4)
POINT = 4
#: Sines up to this are those of parallel lines: where these overlap they touch along a line, and each end lies off the
#: other line by so much of its length at most.
_PARALLEL = 2.0**-36
#: Lines farther beside each other than this part of the shorter do not touch along it.
_BESIDE = 2.0**-20


class ManifoldPoints(NamedTuple):
    """Views of points (POINT doubles each) and of a feature of A and one of B for each; both have room for all."""

    points: Any
    features: Any


@kernel(inline=True)
def _put(manifold, k, u, v, h_a, h_b, feature_a, feature_b):
    manifold.points[POINT * k + U] = u
    manifold.points[POINT * k + V] = v
    manifold.points[POINT * k + GAP] = h_b - h_a
    manifold.points[POINT * k + HEIGHT] = 0.5 * (h_a + h_b)
    manifold.features[2 * k] = feature_a
    manifold.features[2 * k + 1] = feature_b


@kernel(inline=True)
def height_at(face, u, v):
    """Of the plane of a face over a place; of an edge, on its line."""
    if face.n == 2:
        u0, v0, h0 = face.corners[0], face.corners[1], face.corners[2]
        du, dv, dh = face.corners[3] - u0, face.corners[4] - v0, face.corners[5] - h0
        square = du * du + dv * dv
        t = 0.0 if square == 0.0 else min(max((du * (u - u0) + dv * (v - v0)) / square, 0.0), 1.0)
        return h0 + t * dh
    return face.h + face.slope_u * (u - face.u) + face.slope_v * (v - face.v)


@kernel
def overlap_points(face_a, face_b, tolerance, first, second, manifold):
    """Put the corners of the overlap of two support faces, counter-clockwise; how many. None where one is a vertex.

    tolerance : corners so far outside count as inside [m].   first, second : room for polygons (`clip_polygons`).
    """
    if face_a.n < 2 or face_b.n < 2:
        return 0
    if face_a.n == 2 and face_b.n == 2:
        return _overlap_of_edges(face_a, face_b, tolerance, manifold)
    if face_a.n == 2:
        return _edge_over_face(face_a, face_b, False, tolerance, manifold)
    if face_b.n == 2:
        return _edge_over_face(face_b, face_a, True, tolerance, manifold)
    n, in_second = clip_polygons(face_a, face_b, tolerance, first, second)
    polygon = Clipped(second.points if in_second else first.points, second.sides if in_second else first.sides)
    before = polygon.sides[n - 1] if n > 0 else 0
    for k in range(n):
        side = polygon.sides[k]
        _put_corner(face_a, face_b, before, side, polygon.points[2 * k], polygon.points[2 * k + 1], manifold, k)
        before = side
    return n


@kernel
def _put_corner(face_a, face_b, before, side, u, v, manifold, k):
    """Point k, between two sides of the overlap (`Clipped`), at (u, v) unless it is a corner of one of the faces."""
    if before >= 0 and side >= 0:
        at = 3 * side
        u, v = face_a.corners[at], face_a.corners[at + 1]
        _put(
            manifold, k, u, v, face_a.corners[at + 2], height_at(face_b, u, v), face_a.features[side], face_b.feature
        )
    elif before < 0 and side < 0:
        corner = corner_of_b(face_b, -1 - side)
        u, v = face_b.corners[3 * corner], face_b.corners[3 * corner + 1]
        _put(
            manifold, k, u, v, height_at(face_a, u, v), face_b.corners[3 * corner + 2], face_a.feature,
            face_b.features[corner],
        )  # fmt: skip
    else:
        of_a, of_b = (side, before) if side >= 0 else (before, side)
        corner = corner_of_b(face_b, -1 - of_b)
        edge = corner - 1 if corner > 0 else face_b.n - 1
        _put(
            manifold, k, u, v, height_at(face_a, u, v), height_at(face_b, u, v), face_a.edges[of_a],
            face_b.edges[edge],
        )  # fmt: skip


@kernel
def _edge_over_face(edge, face, is_edge_of_b, tolerance, manifold):
    """The ends of what lies over a face of an edge; how many."""
    u0, v0 = edge.corners[0], edge.corners[1]
    u1, v1 = edge.corners[3], edge.corners[4]
    low, high, low_side, high_side = clip_segment(face, not is_edge_of_b, u0, v0, u1, v1, tolerance)
    if low > high:
        return 0
    for k in range(2):
        t, side = (low, low_side) if k == 0 else (high, high_side)
        u, v = u0 + t * (u1 - u0), v0 + t * (v1 - v0)
        h = edge.corners[2] + t * (edge.corners[5] - edge.corners[2])
        of_edge = edge.features[k] if side < 0 else edge.edges[0]
        of_face = face.feature if side < 0 else face.edges[side]
        if is_edge_of_b:
            _put(manifold, k, u, v, height_at(face, u, v), h, of_face, of_edge)
        else:
            _put(manifold, k, u, v, h, height_at(face, u, v), of_edge, of_face)
    return 2


@kernel
def _overlap_of_edges(edge_a, edge_b, tolerance, manifold):
    """The ends of what two parallel edges share; how many. Crossing ones have their nearest points and no more."""
    u0, v0 = edge_a.corners[0], edge_a.corners[1]
    du, dv = edge_a.corners[3] - u0, edge_a.corners[4] - v0
    eu, ev = edge_b.corners[3] - edge_b.corners[0], edge_b.corners[4] - edge_b.corners[1]
    length_a, length_b = math.sqrt(du * du + dv * dv), math.sqrt(eu * eu + ev * ev)
    if length_a == 0.0 or length_b == 0.0:
        return 0
    if abs(du * ev - dv * eu) > _PARALLEL * length_a * length_b + tolerance * (length_a + length_b):
        return 0
    # The normal of curved bodies is good to 2⁻²⁶: seen along it, lines that touch may lie beside each other by as much.
    beside = abs(du * (edge_b.corners[1] - v0) - dv * (edge_b.corners[0] - u0)) / length_a
    if beside > _BESIDE * min(length_a, length_b) + tolerance:
        return 0
    square = length_a * length_a
    at_0 = ((edge_b.corners[0] - u0) * du + (edge_b.corners[1] - v0) * dv) / square
    at_1 = ((edge_b.corners[3] - u0) * du + (edge_b.corners[4] - v0) * dv) / square
    first_b, last_b = (0, 1) if at_0 <= at_1 else (1, 0)
    low_b, high_b = min(at_0, at_1), max(at_0, at_1)
    low, high = max(0.0, low_b), min(1.0, high_b)
    if low > high:
        return 0
    for k in range(2):
        t = low if k == 0 else high
        u, v = u0 + t * du, v0 + t * dv
        is_of_a = low_b <= 0.0 if k == 0 else high_b >= 1.0
        feature_a = edge_a.features[k] if is_of_a else edge_a.edges[0]
        feature_b = edge_b.edges[0] if is_of_a else edge_b.features[first_b if k == 0 else last_b]
        _put(
            manifold, k, u, v, edge_a.corners[2] + t * (edge_a.corners[5] - edge_a.corners[2]),
            height_at(edge_b, u, v), feature_a, feature_b,
        )  # fmt: skip
    return 2


@kernel(inline=True)
def copy_point(manifold, source, target):
    for k in range(POINT):
        manifold.points[POINT * target + k] = manifold.points[POINT * source + k]
    for k in range(2):
        manifold.features[2 * target + k] = manifold.features[2 * source + k]


@kernel
def keep_near(manifold, n, max_gap):
    """Keep the points whose gap is at most so much, in order; how many."""
    n_kept = 0
    for k in range(n):
        if manifold.points[POINT * k + GAP] <= max_gap:
            copy_point(manifold, k, n_kept)
            n_kept += 1
    return n_kept


@kernel
def least_gap(manifold, n):
    gap = math.inf
    for k in range(n):
        gap = min(gap, manifold.points[POINT * k + GAP])
    return gap


@kernel
def drop_repeated(manifold, n, error, tolerance):
    """Drop points nearer than the tolerance to the one before, or to the line between their neighbours; how many stay.

    Of points in one place the one of least gap stays, and so does one deeper than both its neighbours by more than the
    error of gaps.
    """
    points = manifold.points
    n_kept = 0
    for k in range(n):
        last = n_kept - 1
        if n_kept > 0 and _square(points, last, k) <= tolerance * tolerance:
            if points[POINT * k + GAP] < points[POINT * last + GAP]:
                copy_point(manifold, k, last)
            continue
        copy_point(manifold, k, n_kept)
        n_kept += 1
    if n_kept > 1 and _square(points, 0, n_kept - 1) <= tolerance * tolerance:
        if points[POINT * (n_kept - 1) + GAP] < points[GAP]:
            copy_point(manifold, n_kept - 1, 0)
        n_kept -= 1
    k = 0
    while n_kept > 2 and k < n_kept:
        before, after = (k - 1 if k > 0 else n_kept - 1), (k + 1 if k + 1 < n_kept else 0)
        shallowest = min(points[POINT * before + GAP], points[POINT * after + GAP])
        if (
            _is_right_of(points, before, after, k, tolerance)
            or points[POINT * k + GAP] < shallowest - error
            or not _is_between(points, before, after, k)
        ):
            k += 1
            continue
        for j in range(k, n_kept - 1):
            copy_point(manifold, j + 1, j)
        n_kept -= 1
    return n_kept


@kernel(inline=True)
def _square(points, i, j):
    """Of the distance of two points."""
    du, dv = points[POINT * i] - points[POINT * j], points[POINT * i + V] - points[POINT * j + V]
    return du * du + dv * dv


@kernel(inline=True)
def _is_right_of(points, i, j, k, tolerance):
    """Whether point k is farther than the tolerance to the right of the line from i to j."""
    du, dv = points[POINT * j] - points[POINT * i], points[POINT * j + V] - points[POINT * i + V]
    wide = dv * (points[POINT * k] - points[POINT * i]) - du * (points[POINT * k + V] - points[POINT * i + V])
    return wide > 0.0 and wide * wide > tolerance * tolerance * (du * du + dv * dv)


@kernel(inline=True)
def _is_between(points, i, j, k):
    """Whether point k is not before i, and not behind j, along the way from i to j; nearest points may be either."""
    du, dv = points[POINT * j] - points[POINT * i], points[POINT * j + V] - points[POINT * i + V]
    behind_i = du * (points[POINT * k] - points[POINT * i]) + dv * (points[POINT * k + V] - points[POINT * i + V])
    return 0.0 <= behind_i <= du * du + dv * dv


@kernel
def deepest_point(manifold, n, error, tolerance):
    """Which of n points is to come first: of those as deep as the deepest, but for rounding, the one of least u, v."""
    points = manifold.points
    known = least_gap(manifold, n) + 2.0 * error + tolerance
    best = -1
    for k in range(n):
        if points[POINT * k + GAP] > known:
            continue
        u, v = points[POINT * k], points[POINT * k + V]
        if best < 0 or u < points[POINT * best] or (u == points[POINT * best] and v < points[POINT * best + V]):
            best = k
    return best
