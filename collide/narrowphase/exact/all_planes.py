"""The depth of two small hulls from all planes there are, where no surface around the origin could be closed.

A facet of A ⊖ B is a facet of A, one of B, or spanned by an edge of each. So its depth is the least extent of A ⊖ B
from the origin along the normals of any three vertices of one body and of any two pairs of vertices: no direction gives
less, so normals of what is no facet do no harm. Nothing is said about how facets hang together, which is what needles
a billion times as long as wide, pressed flat on each other, leave open in doubles and in double-doubles.

Doubles leave out nearly all, double-doubles nearly all of the rest; integers measure the others. O((n + m)·n²·m²).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64
from collide.narrowphase.epa.origin_foot import nearest_of_triangle
from collide.narrowphase.exact.exact_directions import direction_length, height_along, reverse_direction, set_normal
from collide.narrowphase.exact.exact_supports import support_pair
from collide.narrowphase.exact.exact_workspace import exact_pair, fits, load_poses, set_point
from collide.narrowphase.gap.precise_pair import (
    HEIGHT_ERROR,
    LOW_PARTS_OF_PAIR,
    fine_edge,
    fine_height,
    fine_length,
    fine_point,
    is_refinable,
    put_low_parts,
    unit_scale,
)
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, STRIDE
from collide.numerics.vec3 import (
    Vec3,
    column_at,
    cross,
    dot,
    neg,
    norm,
    norm1,
    put_vec3,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)

#: Most vertices of both bodies, and most planes: some ten milliseconds.
MAX_VERTICES, MAX_PLANES = 64, 60_000
#: Most planes that double-doubles may leave.
_MAX_CANDIDATES = 256
#: Of a candidate: the ends of two edges along its plane, numbers among the points of A, then of B; a lower bound of the
#: extent.
_EXTENT, _PLANE = 4, 5
#: Most points of a facet that are looked at for the nearest one, and doubles of each: the point, its vertex pair.
_MAX_CORNERS, _CORNER = 64, 5
# Doubles of workspace: points of A and of B, a direction, low parts of poses, candidates.
_DIRECTION = STRIDE * (MAX_VERTICES + 1)
_LOW = _DIRECTION + STRIDE
_PLANES = _LOW + LOW_PARTS_OF_PAIR
DOUBLES = _PLANES + _PLANE * _MAX_CANDIDATES
#: What rounding does to a normal, in doubles and in double-doubles, in units of |e||f| and of |e| + |f|.
_DOUBLE_ERROR, _DD_ERROR = 2.0**-49, 2.0**-96
#: Extents are told apart to this, relatively, four roundings of doubles doubled; integers do the rest.
_ROUNDED = 2.0**-50


class PlaneDepth(NamedTuple):
    """The depth of cores that share a point [m], however small, and the unit vector outwards of A ⊖ B; if proven."""

    proven: bool
    depth: DD
    nhat: Vec3


class PlaneSearch(NamedTuple):
    """Where candidates come from and go to.

    fine : points of A, then of B, scaled to size 1, as double-doubles.   direction : a workspace.
    planes : candidates.
    """

    fine: Any
    direction: Any
    planes: Any
    n_a: int
    n_b: int


class Candidates(NamedTuple):
    """How many planes may decide so far, −1 where there are too many, and the least extent so far, scaled."""

    n: int
    extent: float


@kernel
def planes_of(n_a, n_b):
    """How many planes there are."""
    pairs = (n_a * (n_a - 1) // 2) * (n_b * (n_b - 1) // 2)
    return pairs + n_a * (n_a - 1) * (n_a - 2) // 6 + n_b * (n_b - 1) * (n_b - 2) // 6


@kernel
def depth_by_all_planes(ordered, terms, terms_at, digits, doubles_at, ids):
    """The `PlaneDepth` of an `OrderedPair`.

    doubles_at : DOUBLES doubles of workspace.   ids : out, the vertex pairs of three points around the nearest one.
    Other arguments as in `touch_exactly`.
    """
    pair = ordered.pair
    unproven = PlaneDepth(False, DD(0.0, 0.0), Vec3(0.0, 0.0, 1.0))
    n_a, n_b = pair.A.n, pair.B.n
    if n_a + n_b > MAX_VERTICES or planes_of(n_a, n_b) > MAX_PLANES or not is_refinable(ordered.size):
        return unproven
    exact = exact_pair(ordered, terms, digits, 0.0, 0.0)
    if not fits(exact):
        return unproven
    n_planes = _find_candidates(ordered, terms_at, doubles_at)
    if n_planes == 0:
        return unproven
    load_poses(exact)
    planes = view_f64(doubles_at + 8 * _PLANES, _PLANE * _MAX_CANDIDATES)
    best = PlaneDepth(False, DD(math.inf, 0.0), Vec3(0.0, 0.0, 1.0))
    for k in range(n_planes):
        _set_points(exact, planes, _PLANE * k)
        extent = _extent(exact)
        if dd.less(extent.depth, best.depth):
            best = extent
    if not best.proven:
        return unproven
    _find_corners(exact, doubles_at, ids, best)
    return best


@kernel
def _set_points(exact, planes, at):
    """Points 0, 1, 2 become points of A ⊖ B: a corner of both edges, and where either leads from it."""
    n_a = exact.pair.A.n
    p, q, r, s = int(planes[at]), int(planes[at + 1]), int(planes[at + 2]), int(planes[at + 3])
    set_point(exact, 0, _of_a(p, n_a), _of_b(r, n_a))
    set_point(exact, 1, _of_a(q, n_a), _of_b(q if q >= n_a else r, n_a))
    set_point(exact, 2, _of_a(s if s < n_a else p, n_a), _of_b(s, n_a))


@kernel(inline=True)
def _of_a(k, n_a):
    """The vertex of A of point k; 0 for a vertex of B, A's vertex then being common to all points of the plane."""
    return k if k < n_a else 0


@kernel(inline=True)
def _of_b(k, n_a):
    return k - n_a if k >= n_a else 0


@kernel
def _extent(exact):
    """The lesser of both extents of A ⊖ B across points 0 … 2; infinite, unproven, where these lie in line."""
    best = PlaneDepth(False, DD(math.inf, 0.0), Vec3(0.0, 0.0, 0.0))
    n, _ = set_normal(exact)
    length = direction_length(exact, n)
    if length.value.high == 0.0:
        return best
    for _ in range(2):
        reverse_direction(exact, n)
        # The last vertex against the direction is the first one along its opposite.
        i, j, v = support_pair(exact, n)
        set_point(exact, 3, i, j)
        extent = dd.neg(height_along(exact, n, length, 3))
        if dd.less(extent, best.depth):
            best = PlaneDepth(True, extent, neg(v))
    return best


# --- candidates -----------------------------------------------------------------------------------


@kernel
def _find_candidates(ordered, terms_at, doubles_at):
    """Number of candidate planes, written into the workspace; 0 where they exceed the workspace."""
    pair = ordered.pair
    n_a, n_b = pair.A.n, pair.B.n
    low_at = doubles_at + 8 * _LOW
    low = view_f64(low_at, put_low_parts(pair, terms_at, low_at))
    search = PlaneSearch(
        view_f64(doubles_at, STRIDE * (MAX_VERTICES + 1)), view_f64(doubles_at + 8 * _DIRECTION, STRIDE),
        view_f64(doubles_at + 8 * _PLANES, _PLANE * _MAX_CANDIDATES), n_a, n_b,
    )
    unit = unit_scale(ordered.size)
    for i in range(n_a):
        fine_point(pair, low, search.fine, i, i, 0, unit)
    for j in range(n_b):
        fine_point(pair, low, search.fine, n_a + j, 0, j, unit)
    candidates = Candidates(0, math.inf)
    for body in range(2):  # three vertices of A, or of B
        first = 0 if body == 0 else n_a
        last = n_a if body == 0 else n_a + n_b
        for p in range(first, last):
            for q in range(p + 1, last):
                for r in range(q + 1, last):
                    candidates = _consider(search, p, q, p, r, candidates)
                    if candidates.n < 0:
                        return 0
    for p in range(n_a):  # an edge of A, and one of B
        for q in range(p + 1, n_a):
            for r in range(n_a, n_a + n_b):
                for s in range(r + 1, n_a + n_b):
                    candidates = _consider(search, p, q, r, s, candidates)
                    if candidates.n < 0:
                        return 0
    return _prune(search.planes, candidates.n, candidates.extent)


@kernel(inline=True)
def _point(fine, k):
    return dd.leading(dd.vec3_at(fine, STRIDE * k))


@kernel
def _consider(search, p, q, r, s, candidates):
    """The candidates with the plane along the edges from p to q and from r to s, if it may decide."""
    fine, n_a, n_b = search.fine, search.n_a, search.n_b
    e = sub(_point(fine, q), _point(fine, p))
    f = sub(_point(fine, s), _point(fine, r))
    n = cross(e, f)
    high_a, low_a = _span_of_heights(fine, 0, n_a, n)
    high_b, low_b = _span_of_heights(fine, n_a, n_a + n_b, n)
    base = dot(n, _point(fine, 0))
    # Points are at most 1 in size, so are heights in units of the normal; edges are off by roundings of points.
    error = 8.0 * _DOUBLE_ERROR * (norm1(e) * norm1(f) + norm1(e) + norm1(f))
    if min(high_a + high_b - base, base - low_a - low_b) - error > candidates.extent * norm(n):
        return candidates
    return _consider_finely(search, p, q, r, s, candidates)


@kernel(inline=True)
def _span_of_heights(fine, first, last, n):
    """(greatest, least) height of points along n."""
    high = -math.inf
    low = math.inf
    for k in range(first, last):
        height = dot(n, _point(fine, k))
        high = max(high, height)
        low = min(low, height)
    return high, low


@kernel
def _consider_finely(search, p, q, r, s, candidates):
    """`_consider` in double-doubles."""
    e = fine_edge(search.fine, q, p)
    f = fine_edge(search.fine, s, r)
    e_size = norm1(dd.leading(e))
    f_size = norm1(dd.leading(f))
    dd.put_vec3(search.direction, 0, dd.cross(e, f))
    length = fine_length(search.direction).high
    error = 8.0 * (_DD_ERROR * e_size * f_size + 4.0 * HEIGHT_ERROR * (e_size + f_size))
    n, best = candidates
    extent = 0.0
    if length > 0.0:
        extent = max(min(_extent_above(search, 1.0), _extent_above(search, -1.0)), 0.0) / length
        best = min(best, extent * (1.0 + _ROUNDED) + 8.0 * HEIGHT_ERROR)
        extent = extent * (1.0 - _ROUNDED) - error / length - 8.0 * HEIGHT_ERROR
    if extent > best:
        return Candidates(n, best)
    if n == _MAX_CANDIDATES:
        n = _prune(search.planes, n, best)
        if n == _MAX_CANDIDATES:
            return Candidates(-1, best)
    at = _PLANE * n
    search.planes[at] = p
    search.planes[at + 1] = q
    search.planes[at + 2] = r
    search.planes[at + 3] = s
    search.planes[at + _EXTENT] = extent
    return Candidates(n + 1, best)


@kernel
def _extent_above(search, sign):
    """The greatest height of A ⊖ B along the direction (sign 1) or its opposite (−1), rounded once."""
    n_a = search.n_a
    # Point 0 stands among those of A and those of B, and once too often.
    total = dd.scale(-sign, fine_height(search.fine, 0, search.direction))
    total = dd.add(total, _highest(search, 0, n_a, sign))
    return dd.add(total, _highest(search, n_a, n_a + search.n_b, sign)).high


@kernel
def _highest(search, first, last, sign):
    highest = DD(-math.inf, 0.0)
    for k in range(first, last):
        height = dd.scale(sign, fine_height(search.fine, k, search.direction))
        if dd.less(highest, height):
            highest = height
    return highest


@kernel
def _prune(planes, n, extent):
    """Drop candidates whose extent is greater; how many remain."""
    remaining = 0
    for k in range(n):
        if planes[_PLANE * k + _EXTENT] <= extent:
            for j in range(_PLANE):
                planes[_PLANE * remaining + j] = planes[_PLANE * k + j]
            remaining += 1
    return remaining


# --- the facet ------------------------------------------------------------------------------------


@kernel
def _find_corners(exact, doubles_at, ids, best_plane):
    """The vertex pairs of three points of the facet across the direction of a `PlaneDepth`, around the foot of the
    origin.

    Any three of its corners may not do; the triangle that comes nearest does, or an edge, or a corner.
    """
    corners = view_f64(doubles_at, _CORNER * _MAX_CORNERS)
    n_corners = _list_corners(exact, corners, best_plane)
    best = math.inf
    for i in range(n_corners):
        for j in range(i + 1):
            for k in range(j + 1):
                a, b, c = vec3_at(corners, _CORNER * i), vec3_at(corners, _CORNER * j), vec3_at(corners, _CORNER * k)
                distance = nearest_of_triangle(a, b, c, Vec3(0.0, 0.0, 0.0)).distance
                if distance < best:
                    best = distance
                    for corner in range(3):
                        at = _CORNER * (i if corner == 0 else j if corner == 1 else k)
                        ids[2 * corner] = int(corners[at + 3])
                        ids[2 * corner + 1] = int(corners[at + 4])


@kernel
def _list_corners(exact, corners, best_plane):
    """Points of A ⊖ B that are level with the farthest along n, less the foot, with their vertices; their number."""
    A, B, poses = exact.pair.A, exact.pair.B, exact.pair.poses
    along_a = rotate_back(poses, A.pose_at, best_plane.nhat)
    along_b = rotate_back(poses, B.pose_at, best_plane.nhat)
    foot = scale(best_plane.depth.high, best_plane.nhat)
    high = -math.inf
    for i in range(A.n):
        high = max(high, dot(along_a, column_at(A.coords, A.padded, i)))
    low = math.inf
    for j in range(B.n):
        low = min(low, dot(along_b, column_at(B.coords, B.padded, j)))
    n_corners = 0
    for i in range(A.n):
        a = column_at(A.coords, A.padded, i)
        if dot(along_a, a) < high - exact.error:
            continue
        for j in range(B.n):
            b = column_at(B.coords, B.padded, j)
            if dot(along_b, b) > low + exact.error or n_corners == _MAX_CORNERS:
                continue
            difference = sub(rotate(poses, A.pose_at, a), rotate(poses, B.pose_at, b))
            put_vec3(corners, _CORNER * n_corners, sub(sub(difference, exact.pair.t), foot))
            corners[_CORNER * n_corners + 3] = i
            corners[_CORNER * n_corners + 4] = j
            n_corners += 1
    return n_corners
