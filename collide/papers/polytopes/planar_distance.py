"""Gap or depth of two convex polygons: doubles, with a bound of their error.

Apart: GJK on B ⊖ A, support vertices by binary search in O(log n). Meeting: the least depth over the normals of all
edges, in O(n + m), the support vertices of a polygon running around as the normals of the other do (M. I. Shamos,
"Computational Geometry", 1978: rotating calipers). The hit itself is decided in `planar_search.py`.

u is 2⁻⁵³ and S the size of the pair: the reach of the polygons from their origins, and the distance of the origins. A
placed vertex is off by 3 u S, a difference of two by 7 u S, its product with a unit vector by 12 u S; a support vertex,
whose neighbours are no farther in doubles, is behind the true vertex by less than 4 u times the polygon's perimeter, 8
times its reach. 2⁻⁴⁶ S, 128 u, covers them.

For polygons apart, the lower bound is positive. Where the bound in doubles is not, the support vertices across the
feature found are taken in double-doubles (16 u² an operation): placed vertices, shift and product are good to 2⁻⁹⁶ S,
steps between neighbours to 2⁻¹⁰⁰ of themselves. Cases open even then take the separating line of `planar_search.py`,
in fractions (`planar_pairs.py`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.numerics import double_double as dd
from collide.numerics.error_free import DD, two_sum
from collide.papers.polytopes.planar_layout import HIT, ROW

#: Doubles of a row of results: distance, lower and upper bound, normal, point of A, point of B.
DISTANCE, LOWER, UPPER, NORMAL, POINT_A, POINT_B, DISTANCE_ROW = 0, 1, 2, 3, 5, 7, 9
#: Bound of the error of a distance, in units of the size.
_ERROR = 2.0**-46
#: The same of double-doubles.
_ERROR_DD = 2.0**-94
#: A duality gap below this times the size is left as it is.
_ENOUGH = 2.0**-51
#: The least positive double.
_LEAST = 5e-324
#: Up to so many vertices are scanned.
_SCANNED = 8
#: Limits never reached: rounds of GJK, steps of a binary search.
_MAX_ROUNDS, _MAX_STEPS = 200, 80


class PosedPolygon(NamedTuple):
    """A polygon: coordinates, how many vertices, rotation row by row, origin relative to A's [m]."""

    vertices: Any
    n: int
    xx: float
    xy: float
    yx: float
    yy: float
    x: float
    y: float


class PlanarSpot(NamedTuple):
    """Coordinates in W relative to A's origin, or a direction [m]."""

    x: float
    y: float


@kernel(inline=True)
def _place(polygon, k):
    x = polygon.vertices[2 * k]
    y = polygon.vertices[2 * k + 1]
    return PlanarSpot(polygon.xx * x + polygon.xy * y + polygon.x, polygon.yx * x + polygon.yy * y + polygon.y)


@kernel(inline=True)
def _edge(polygon, k):
    """From vertex k to the next, in W's axes."""
    i = 2 * k
    j = 2 * (k + 1) if k + 1 < polygon.n else 0
    x = polygon.vertices[j] - polygon.vertices[i]
    y = polygon.vertices[j + 1] - polygon.vertices[i + 1]
    return PlanarSpot(polygon.xx * x + polygon.xy * y, polygon.yx * x + polygon.yy * y)


@kernel
def _length(x, y):
    """Of a vector; squares of small numbers vanish, their ratio's does not."""
    largest = max(abs(x), abs(y))
    if largest == 0.0:
        return 0.0
    smaller = min(abs(x), abs(y)) / largest
    return largest * math.sqrt(1.0 + smaller * smaller)


@kernel
def _along(polygon, i, j, x, y):
    """How much farther vertex j lies than i along a direction in the polygon's frame."""
    v = polygon.vertices
    return x * (v[2 * j] - v[2 * i]) + y * (v[2 * j + 1] - v[2 * i + 1])


@kernel
def extreme_corner(polygon, direction):
    """The vertex farthest along a direction in W's axes: none of its neighbours is farther, in doubles."""
    x = polygon.xx * direction.x + polygon.yx * direction.y
    y = polygon.xy * direction.x + polygon.yy * direction.y
    return _extreme_local(polygon, x, y)


@kernel
def _extreme_local(polygon, x, y):
    n = polygon.n
    best = 0
    if n <= _SCANNED:
        for k in range(1, n):
            if _along(polygon, best, k, x, y) > 0.0:
                best = k
        return best
    low = 0
    high = n
    rising = _along(polygon, 0, 1, x, y) > 0.0
    for _ in range(_MAX_STEPS):
        if high - low < 2:
            break
        middle = (low + high) // 2
        rises = _along(polygon, middle, (middle + 1) % n, x, y) > 0.0
        farther = _along(polygon, low, middle, x, y) > 0.0
        # The farthest lies between low and middle, or beyond middle.
        if (rising and (not rises or not farther)) or (not rising and not rises and farther):
            high = middle
        else:
            low = middle
            rising = rises
    best = low
    if _along(polygon, best, high % n, x, y) > 0.0:
        best = high % n
    for _ in range(n):  # rounding may have led astray by some vertices
        after = (best + 1) % n
        before = (best + n - 1) % n
        if _along(polygon, best, after, x, y) > 0.0:
            best = after
        elif _along(polygon, best, before, x, y) > 0.0:
            best = before
        else:
            break
    return best


@kernel
def _reach(polygon):
    """No less than the distance of any vertex from the polygon's origin, and less than thrice that."""
    v = polygon.vertices
    x = max(abs(v[2 * _extreme_local(polygon, 1.0, 0.0)]), abs(v[2 * _extreme_local(polygon, -1.0, 0.0)]))
    y = max(abs(v[2 * _extreme_local(polygon, 0.0, 1.0) + 1]), abs(v[2 * _extreme_local(polygon, 0.0, -1.0) + 1]))
    return 1.001 * (x + y)


class _Simplex(NamedTuple):
    """Vertices i, j of A and B, a pair or two, and the point nearest to the origin of their segment of B − A: (1 − t)
    of the first and t of the second.

    i1 : −1 for a single pair.
    """

    i0: int
    j0: int
    i1: int
    j1: int
    t: float
    x: float
    y: float


@kernel
def _difference(A, B, i, j):
    a = _place(A, i)
    b = _place(B, j)
    return PlanarSpot(b.x - a.x, b.y - a.y)


@kernel
def _nearest_on_segment(A, B, i0, j0, i1, j1):
    p = _difference(A, B, i0, j0)
    q = _difference(A, B, i1, j1)
    x = q.x - p.x
    y = q.y - p.y
    length = x * x + y * y
    t = -(p.x * x + p.y * y) / length if length > 0.0 else 0.0
    if t <= 0.0:
        return _Simplex(i0, j0, -1, -1, 0.0, p.x, p.y)
    if t >= 1.0:
        return _Simplex(i1, j1, -1, -1, 0.0, q.x, q.y)
    # Across the segment, so that the direction is good where the distance is small.
    height = (p.x * y - p.y * x) / length
    return _Simplex(i0, j0, i1, j1, t, height * y, -height * x)


class _Gap(NamedTuple):
    """A lower bound of a distance [m], and the unit direction from A to B of its proof."""

    lower: float
    x: float
    y: float


@kernel(inline=True)
def _turned(polygon, x, y):
    """A vector of a polygon's frame in W's axes, in double-doubles."""
    of_x = dd.add(dd.mul(DD(polygon.xx, 0.0), x), dd.mul(DD(polygon.xy, 0.0), y))
    return of_x, dd.add(dd.mul(DD(polygon.yx, 0.0), x), dd.mul(DD(polygon.yy, 0.0), y))


@kernel
def _step(polygon, i, j):
    """From vertex i to vertex j, in W's axes."""
    v = polygon.vertices
    return _turned(polygon, two_sum(v[2 * j], -v[2 * i]), two_sum(v[2 * j + 1], -v[2 * i + 1]))


@kernel(inline=True)
def _dot(ax, ay, bx, by):
    return dd.add(dd.mul(ax, bx), dd.mul(ay, by))


@kernel
def _climbed(polygon, k, x, y):
    """The vertex farthest along a direction in double-doubles, searched from a nearly farthest vertex."""
    for _ in range(polygon.n):
        after, before = (k + 1) % polygon.n, (k + polygon.n - 1) % polygon.n
        to_after, to_before = _step(polygon, k, after), _step(polygon, k, before)
        if _dot(x, y, to_after[0], to_after[1]).high > 0.0:
            k = after
        elif _dot(x, y, to_before[0], to_before[1]).high > 0.0:
            k = before
        else:
            break
    return k


@kernel(cold=True)
def _precise_gap(A, B, nearest, shift_x, shift_y, size):
    """The `_Gap` of polygons that are apart by less than doubles can tell.   shift : from A's origin to B's."""
    i, j = nearest.i0, nearest.j0
    x, y = _between(A, B, i, j, shift_x, shift_y)
    if nearest.i1 >= 0:
        # Across the edges: of parallel ones across that of A.
        e, f = _step(A, i, nearest.i1) if nearest.i1 != i else _step(B, j, nearest.j1)
        ahead = _dot(f, dd.neg(e), x, y).high > 0.0
        x, y = (f, dd.neg(e)) if ahead else (dd.neg(f), e)
    i, j = _climbed(A, i, x, y), _climbed(B, j, dd.neg(x), dd.neg(y))
    w = _between(A, B, i, j, shift_x, shift_y)
    length = dd.sqrt(_dot(x, y, x, y))
    if not length.high > 0.0:
        return _Gap(0.0, 1.0, 0.0)
    gap = dd.div(_dot(x, y, w[0], w[1]), length)
    return _Gap(dd.bracket(gap, _ERROR_DD * size).lower, x.high / length.high, y.high / length.high)


@kernel
def _between(A, B, i, j, shift_x, shift_y):
    """From vertex i of A to vertex j of B."""
    a = _turned(A, DD(A.vertices[2 * i], 0.0), DD(A.vertices[2 * i + 1], 0.0))
    b = _turned(B, DD(B.vertices[2 * j], 0.0), DD(B.vertices[2 * j + 1], 0.0))
    return dd.add(dd.sub(b[0], a[0]), shift_x), dd.add(dd.sub(b[1], a[1]), shift_y)


@kernel
def _write_gap(A, B, shift_x, shift_y, size, out, at):
    """The distance of polygons that are apart.   shift : from A's origin to B's, in double-doubles."""
    p = _difference(A, B, 0, 0)
    nearest = _Simplex(0, 0, -1, -1, 0.0, p.x, p.y)
    lower = 0.0
    for _ in range(_MAX_ROUNDS):
        length = _length(nearest.x, nearest.y)
        if length == 0.0:
            break
        towards = PlanarSpot(nearest.x / length, nearest.y / length)
        i = extreme_corner(A, towards)
        j = extreme_corner(B, PlanarSpot(-towards.x, -towards.y))
        w = _difference(A, B, i, j)
        bound = towards.x * w.x + towards.y * w.y
        lower = max(lower, bound)
        known = (i == nearest.i0 and j == nearest.j0) or (i == nearest.i1 and j == nearest.j1)
        if known or length - bound <= _ENOUGH * size:
            break
        improved = _nearest_on_segment(A, B, nearest.i0, nearest.j0, i, j)
        if nearest.i1 >= 0:
            second = _nearest_on_segment(A, B, nearest.i1, nearest.j1, i, j)
            if _length(second.x, second.y) < _length(improved.x, improved.y):
                improved = second
        if _length(improved.x, improved.y) >= length:
            break
        nearest = improved
    length = _length(nearest.x, nearest.y)
    a = _place(A, nearest.i0)
    b = _place(B, nearest.j0)
    if nearest.i1 >= 0:
        t = nearest.t
        end = _place(A, nearest.i1)
        a = PlanarSpot(a.x + t * (end.x - a.x), a.y + t * (end.y - a.y))
        end = _place(B, nearest.j1)
        b = PlanarSpot(b.x + t * (end.x - b.x), b.y + t * (end.y - b.y))
    normal = PlanarSpot(nearest.x / length, nearest.y / length) if length > 0.0 else PlanarSpot(1.0, 0.0)
    upper = length + _ERROR * size
    lower = min(lower, length) - _ERROR * size
    if not lower > 0.0:
        gap = _precise_gap(A, B, nearest, shift_x, shift_y, size)
        lower = max(gap.lower, 0.0)
        if gap.lower > 0.0 and length <= _ERROR * size:  # the direction is known no better from the points
            normal = PlanarSpot(gap.x, gap.y)
        length = min(max(length, lower, _LEAST), upper)
    _write_row(length, normal, a, b, out, at)
    out[at + LOWER] = lower
    out[at + UPPER] = upper


@kernel
def _write_row(distance, normal, a, b, out, at):
    out[at + DISTANCE] = distance
    out[at + NORMAL] = normal.x
    out[at + NORMAL + 1] = normal.y
    out[at + POINT_A] = a.x
    out[at + POINT_A + 1] = a.y
    out[at + POINT_B] = b.x
    out[at + POINT_B + 1] = b.y


class _Depth(NamedTuple):
    """The least depth so far [m], an edge and its unit normal, out of its polygon, the other's deepest vertex."""

    depth: float
    x: float
    y: float
    edge: int
    vertex: int


@kernel
def _least_depth(A, B):
    """The least `_Depth` of B in A over A's edges; infinite where A is a point."""
    least = _Depth(math.inf, 1.0, 0.0, 0, 0)
    j = -1
    for k in range(A.n if A.n > 1 else 0):
        e = _edge(A, k)
        length = _length(e.x, e.y)
        if length == 0.0:
            continue
        x = e.y / length
        y = -e.x / length
        if j < 0:
            j = extreme_corner(B, PlanarSpot(-x, -y))
        for _ in range(B.n):
            step = _edge(B, j)
            if x * step.x + y * step.y >= 0.0:
                break
            j = (j + 1) % B.n
        d = _difference(B, A, j, k)
        depth = x * d.x + y * d.y
        if depth < least.depth:
            least = _Depth(depth, x, y, k, j)
    return least


@kernel
def _deepest_point(A, B, least, size):
    """The point of B deepest in A beyond an edge of A: a vertex; for an edge parallel to A's a point across from A's
    edge.
    """
    b = _place(B, least.vertex)
    a = _place(A, least.edge)
    length = _length(_edge(A, least.edge).x, _edge(A, least.edge).y)
    along = -least.y * (b.x - a.x) + least.x * (b.y - a.y)
    excess = along if along < 0.0 else max(along - length, 0.0)
    if excess == 0.0:
        return b
    for step in range(2):
        end = _place(B, (least.vertex + (1 if step == 0 else B.n - 1)) % B.n)
        x = end.x - b.x
        y = end.y - b.y
        t = -excess / (-least.y * x + least.x * y) if -least.y * x + least.x * y != 0.0 else -1.0
        if 0.0 < t and least.x * x + least.y * y <= _ERROR * size:
            t = min(t, 1.0)
            return PlanarSpot(b.x + t * x, b.y + t * y)
    return b


@kernel
def _write_depth(A, B, size, out, at):
    """The depth of polygons that meet, as a distance below 0; 0 where B ⊖ A has no area."""
    in_a = _least_depth(A, B)
    in_b = _least_depth(B, A)
    depth = max(min(in_a.depth, in_b.depth), 0.0)
    if depth == math.inf:  # two points
        depth = 0.0
        in_a = _Depth(0.0, 1.0, 0.0, 0, 0)
    if in_a.depth <= in_b.depth:
        b = _deepest_point(A, B, in_a, size)
        normal = PlanarSpot(in_a.x, in_a.y)
        a = PlanarSpot(b.x + depth * in_a.x, b.y + depth * in_a.y)
    else:
        a = _deepest_point(B, A, in_b, size)
        normal = PlanarSpot(-in_b.x, -in_b.y)
        b = PlanarSpot(a.x + depth * in_b.x, a.y + depth * in_b.y)
    _write_row(-depth if depth > 0.0 else 0.0, normal, a, b, out, at)
    out[at + LOWER] = -depth - _ERROR * size
    out[at + UPPER] = min(-depth + _ERROR * size, 0.0)


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def measure_polygons(
    polygons_a, step_a, poses_a, pose_step_a, polygons_b, step_b, poses_b, pose_step_b, n, hits, out
):
    """Signed distances of n pairs, given as for `planar_kernel.py: meet_polygons`.

    hits : address of the rows of `meet_polygons`.   out : address of n rows of DISTANCE_ROW doubles.
    """
    known = view_i64(hits, ROW * n)
    rows = view_f64(out, DISTANCE_ROW * n)
    for k in range(n):
        a = view_i64(polygons_a + 16 * step_a * k, 2)
        b = view_i64(polygons_b + 16 * step_b * k, 2)
        X = view_f64(poses_a + 72 * pose_step_a * k, 9)
        Y = view_f64(poses_b + 72 * pose_step_b * k, 9)
        A = PosedPolygon(view_f64(a[0], 2 * a[1]), a[1], X[0], X[1], X[3], X[4], 0.0, 0.0)
        B = PosedPolygon(view_f64(b[0], 2 * b[1]), b[1], Y[0], Y[1], Y[3], Y[4], Y[2] - X[2], Y[5] - X[5])
        size = _reach(A) + _reach(B) + abs(B.x) + abs(B.y)
        at = DISTANCE_ROW * k
        if known[ROW * k + HIT] != 0:
            _write_depth(A, B, size, rows, at)
        else:
            _write_gap(A, B, two_sum(Y[2], -X[2]), two_sum(Y[5], -X[5]), size, rows, at)
        for axis in range(2):
            rows[at + POINT_A + axis] += X[2 + 3 * axis]
            rows[at + POINT_B + axis] += X[2 + 3 * axis]
