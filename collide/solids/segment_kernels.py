"""Crossings of segments drawn on a facet by facets of several bodies, in doubles, where bounds of errors prove them."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.narrowphase.facets.facet_crossings import end_of_segment
from collide.numerics.vec3 import component, max_abs, sub, vec3_at
from collide.solids.polygon_ears import area_limit, front_axes, posed_facet

#: Facets with more segments, of two bodies or more, are left to the sweep: pairs of segments are tested one by one.
MAX_SEGMENTS = 64
_U = 2.0**-53


@kernel
def _area(a, b, c, u, v):
    """Twice the area of three points seen along an axis."""
    e, f = sub(b, a), sub(c, a)
    return component(e, u) * component(f, v) - component(e, v) * component(f, u)


@kernel
def _are_apart(a, b, c, d, k, margin):
    """Whether coordinate k keeps two segments apart."""
    a, b, c, d = component(a, k), component(b, k), component(c, k), component(d, k)
    return max(a, b) + margin < min(c, d) or max(c, d) + margin < min(a, b)


@kernel
def _crossing(a, b, c, d, u, v, limit, margin):
    """(1 where segment c – d crosses a – b from right to left, −1 from left to right, 0 where they do not cross, 2
    where nothing is proven; areas of c, d, a and of c, d, b).
    """
    if _are_apart(a, b, c, d, u, margin) or _are_apart(a, b, c, d, v, margin):
        return 0, 0.0, 0.0
    of_c, of_d = _area(a, b, c, u, v), _area(a, b, d, u, v)
    if min(of_c, of_d) > limit or max(of_c, of_d) < -limit:
        return 0, 0.0, 0.0
    of_a, of_b = _area(c, d, a, u, v), _area(c, d, b, u, v)
    if min(of_a, of_b) > limit or max(of_a, of_b) < -limit:
        return 0, 0.0, 0.0
    if not (min(abs(of_c), abs(of_d)) > limit and min(abs(of_a), abs(of_b)) > limit):
        return 2, 0.0, 0.0
    return 1 if of_d > 0.0 else -1, of_a, of_b


@entry(
    "int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, "
    "int64, int64, int64, int64, int64)"
)
def cross_segments(
    poses_at, n_bodies, local_at, n_vertices, corners_at, body_at, n_facets, rows_at, first_at, n_rows, segments_at,
    n_sides, pairs_at, place_at, error_at, n, failed_at, meeting_at, where_at, capacity,
):
    """The number of crossings of segments on facets.

    poses, local, corners, body : of `PlacedFacets`.   rows, first, segments : facets, and numbers of the segments on
    each.   pairs, place, error : of n segments, as of `CrossingPairs`.   failed : (F,) uint8, set for facets with an
    unproven pair.   meeting : out, (capacity, 4) int64, the facet, both segments and the sign of their crossing.
    where : out, (capacity, 4), the point and a bound of its error.

    With coordinates off by E areas of points within D are off by `area_limit`; the crossing a + (b − a) s / (s − t) of
    areas s and t is off by what `end_of_segment` says, and by the errors of both ends and of the sum.
    """
    poses, local = view_f64(poses_at, 16 * n_bodies), view_f64(local_at, 3 * n_vertices)
    corners, body = view_i64(corners_at, 3 * n_facets), view_i64(body_at, n_facets)
    rows, first, segments = view_i64(rows_at, n_rows), view_i64(first_at, n_rows + 1), view_i64(segments_at, n_sides)
    pairs, place, error = view_i64(pairs_at, 2 * n), view_f64(place_at, 6 * n), view_f64(error_at, n)
    failed = view_u8(failed_at, n_facets)
    meeting, where = view_i64(meeting_at, 4 * capacity), view_f64(where_at, 4 * capacity)
    count = 0
    for row in range(n_rows):
        f = rows[row]
        X = 16 * body[f]
        a, b, c = corners[3 * f], corners[3 * f + 1], corners[3 * f + 2]
        p, q, r, off = posed_facet(poses, X, local, a, b, c)
        for k in range(first[row], first[row + 1]):
            off = max(off, error[segments[k]])
        u, v = front_axes(p, q, r)
        largest = max(max_abs(p), max_abs(q), max_abs(r))
        far = max(max_abs(sub(q, p)), max_abs(sub(r, p)))
        # All points lie in the facet, or farther by their error; differences are rounded.
        E = 2.0 * off + _U * (far + off)
        limit = area_limit(2.0 * (far + 2.0 * off), E)
        if not _area(p, q, r, u, v) > limit:
            failed[f] = 1
            continue
        for k in range(first[row], first[row + 1]):
            i = segments[k]
            g = pairs[2 * i] + pairs[2 * i + 1] - f
            s, t = vec3_at(place, 6 * i), vec3_at(place, 6 * i + 3)
            for m in range(k + 1, first[row + 1]):
                j = segments[m]
                h = pairs[2 * j] + pairs[2 * j + 1] - f
                if body[g] == body[h]:
                    continue
                x, y = vec3_at(place, 6 * j), vec3_at(place, 6 * j + 3)
                sign, of_s, of_t = _crossing(s, t, x, y, u, v, limit, 4.0 * E)
                if sign == 2:
                    failed[f] = 1
                elif sign != 0:
                    point, far_off = end_of_segment(s, of_s, t, of_t, limit)
                    meeting[4 * count], meeting[4 * count + 1], meeting[4 * count + 2] = f, i, j
                    meeting[4 * count + 3] = sign
                    where[4 * count], where[4 * count + 1], where[4 * count + 2] = point.x, point.y, point.z
                    where[4 * count + 3] = far_off + 4.0 * off + 4.0 * _U * largest
                    count += 1
    return count


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64)")
def points_on_segments(near_at, n, ends_at, n_segments, u, v, pairs_at, capacity):
    """The number of pairs of a segment and a point of a facet, the point perhaps within the segment; no pair is lost.

    near : (n, 3) points, rounded.   ends : (n_segments, 2) of them.   u, v : the axes across the view.
    pairs : out, (capacity, 2), segments in order.   capacity : all pairs. O(capacity).

    Rounding keeps the order of coordinates, and twice the area of three points seen along an axis is off by less than
    2⁻⁴⁷ D (M + D): differences D of coordinates below M + D, each rounded, are off by a unit of that.
    """
    near, ends = view_f64(near_at, 3 * n), view_i64(ends_at, 2 * n_segments)
    pairs = view_i64(pairs_at, 2 * capacity)
    count = 0
    for k in range(n_segments):
        i, j = ends[2 * k], ends[2 * k + 1]
        ax, ay, bx, by = near[3 * i + u], near[3 * i + v], near[3 * j + u], near[3 * j + v]
        ex, ey = bx - ax, by - ay
        for p in range(n):
            x, y = near[3 * p + u], near[3 * p + v]
            is_within = min(ax, bx) <= x <= max(ax, bx) and min(ay, by) <= y <= max(ay, by)
            if not is_within or p == i or p == j:
                continue
            wx, wy = x - ax, y - ay
            size = max(abs(ex), abs(ey), abs(wx), abs(wy))
            if not abs(ex * wy - ey * wx) > 2.0**-47 * size * (max(abs(ax), abs(ay)) + size):
                pairs[2 * count], pairs[2 * count + 1] = k, p
                count += 1
    return count
