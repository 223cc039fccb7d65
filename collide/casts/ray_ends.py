"""Ends of chords and crossings of facets as places where rays meet a surface, and the first place of each ray.

Callers in Python and in C go through these kernels: `ray_parts.py`, `ray_facets.py` and `ray_hits.py` say what columns
hold.
"""

from __future__ import annotations

import math

from collide.casts.cut_parts import (
    FIRST,
    FIRST_LOWER,
    FIRST_NORMAL,
    FIRST_SIDE,
    FIRST_UPPER,
    LAST_LOWER,
    MAX_WIDTH,
    RAY_ROW,
    STATE,
)
from collide.curved.chords import MET, MISSED, UNCLEAR
from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, NUMBERS, RADIUS, SLOP
from collide.narrowphase.facets.ray_surface import FACET_OF, HIT, LOWER, OPEN, RAY, RAY_OF, UPPER, VALUE
from collide.numerics.vec3 import Vec3, dot, norm1, put_vec3, sub, vec3_at

#: Brackets of facets wider than this, in units of the length of the ray up to beyond the body, are worked out exactly.
_MAX_WIDTH_OF_FACET = 2.0**-40
#: Limits below this, in the same units, may have lost digits: facets within them are worked out exactly.
_MIN_LIMIT = 1e-290

#: Marks of hits (`group_first_facets`), the better the larger.
NARROW_BUT_OPEN, NARROW = 1, 2

# Columns of places, integers: ray, facet, item; bytes: proven, certified.
_RAY_OF_PLACE, _FACET_OF_PLACE, _ITEM = range(3)
_PROVEN, _CERTIFIED = range(2)


# --- chords -----------------------------------------------------------------------------------------------------------


@kernel(inline=True)
def _chord_at(rows_at, k):
    return view_f64(rows_at + 8 * RAY_ROW * k, RAY_ROW)


@kernel
def _is_wide(row, end):
    """Whether an end of a chord, 0 or 1, has a bracket too wide to be certified."""
    far, lower, upper = 0.0, row[FIRST_LOWER + 3 * end], row[FIRST_UPPER + 3 * end]
    for value in (row[FIRST], row[FIRST + 3]):
        if math.isfinite(value):
            far = max(far, abs(value))
    return math.isfinite(upper) and math.isfinite(lower) and not upper - lower <= MAX_WIDTH * far


@entry("int64(int64, int64, int64, int64, int64, int64, int64, boolean, int64)")
def list_open_chords(
    ints_at, numbers_at, shape_of_at, questions_at, rows_at, limits_at, n, both, listed_at
):
    """List chords of parts with exact numbers that doubles leave open: an end may be on either side of the origin or of
    the limit, or is bracketed too widely. Returns how many are listed.

    Arguments as of `cut_parts`, whose rows these are.   limits : of t, a double a chord.   both : flat parts, and rays
    that touch, are open as well: their ends may be a single place.
    """
    questions, limits, listed = view_i64(questions_at, 2 * n), view_f64(limits_at, n), view_i64(listed_at, n)
    count = 0
    for k in range(n):
        row = _chord_at(rows_at, k)
        if row[STATE] == MISSED:
            continue
        is_open = row[STATE] == UNCLEAR or (both and row[FIRST_UPPER] >= row[LAST_LOWER])
        for end in range(2):
            lower, upper = row[FIRST_LOWER + 3 * end], row[FIRST_UPPER + 3 * end]
            is_ahead, is_before = upper >= 0.0, lower <= limits[k]
            is_open = is_open or (lower <= 0.0 and is_ahead) or (is_before and upper > limits[k])
            is_open = is_open or (is_ahead and is_before and _is_wide(row, end))
        shape = view_i64(shape_of_at, questions[2 * k + 1] + 1)[questions[2 * k + 1]]
        numbers = view_f64(numbers_at + 8 * NUMBERS * shape, NUMBERS)
        kind = view_i64(ints_at + 8 * INTS * shape, INTS)[KIND]
        if is_open and (kind == POINTS or kind == HALFSPACE) and numbers[RADIUS] == 0.0 and numbers[SLOP] == 0.0:
            listed[count] = k
            count += 1
    return count


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def write_chord_ends(
    rows_at, questions_at, limits_at, exponents_at, exact_at, n, t_at, normals_at, columns_at, flags_at
):
    """Write the ends of n chords within the limit, from the origin on: first ends, then last ends; returns how many.

    exponents : of the rays' vectors.   exact : a byte a chord, 1 where `list_open_chords` had the caller settle it.
    t : value, from below, from above, in units of the directions given.   normals : 3 doubles.   columns, flags : as
    above, the item being the chord's number; room for 2 n of each.
    """
    questions, limits, exact = view_i64(questions_at, 2 * n), view_f64(limits_at, n), view_u8(exact_at, n)
    t, normals = view_f64(t_at, 6 * n), view_f64(normals_at, 6 * n)
    columns, flags, count = view_i64(columns_at, 6 * n), view_u8(flags_at, 4 * n), 0
    for end in range(2):
        for k in range(n):
            row = _chord_at(rows_at, k)
            value, lower, upper = row[FIRST + 3 * end], row[FIRST_LOWER + 3 * end], row[FIRST_UPPER + 3 * end]
            if row[STATE] == MISSED or not (math.isfinite(value) and upper >= 0.0 and lower <= limits[k]):
                continue
            is_exact = exact[k] != 0
            if is_exact and not 0.0 <= value <= limits[k]:  # as it is said, within doubles that hold it
                continue
            ray = questions[2 * k]
            shift = -int(view_i64(exponents_at, ray + 1)[ray])
            is_proven = is_exact or (row[STATE] == MET and lower >= 0.0 and upper <= limits[k])
            t[3 * count] = math.ldexp(min(_at_least_0(value), limits[k]), shift)
            t[3 * count + 1] = math.ldexp(min(_at_least_0(lower), limits[k]), shift)
            t[3 * count + 2] = math.ldexp(_at_least_0(upper), shift)
            put_vec3(normals, 3 * count, vec3_at(row, FIRST_NORMAL + 3 * end))
            columns[3 * count + _RAY_OF_PLACE] = ray
            columns[3 * count + _FACET_OF_PLACE] = int(row[FIRST_SIDE + end])
            columns[3 * count + _ITEM] = k
            flags[2 * count + _PROVEN] = 1 if is_proven else 0
            flags[2 * count + _CERTIFIED] = 1 if is_proven and not _is_wide(row, end) else 0
            count += 1
    return count


@kernel(inline=True)
def _at_least_0(x):
    return max(0.0, x)


# --- the first of each ray --------------------------------------------------------------------------------------------


@entry("int64(int64, int64, int64, int64, int64)")
def first_places(t_at, columns_at, flags_at, n, first_at):
    """Write the number of the first place of each ray, by t, item and facet, of n places, a ray's side by side; returns
    how many rays there are.

    The first place's t becomes a bracket of what the ray meets first, and its flags tell what is known with regard to
    the ray's other places. Columns as of `write_chord_ends`.   first : n numbers, out.
    """
    t, columns, flags = view_f64(t_at, 3 * n), view_i64(columns_at, 3 * n), view_u8(flags_at, 2 * n)
    first, count, begin = view_i64(first_at, n), 0, 0
    while begin < n:
        end, best, lower, upper, farthest = begin, begin, math.inf, math.inf, -math.inf
        is_proven, is_certified = False, True
        while end < n and columns[3 * end] == columns[3 * begin]:
            if _comes_before(t, columns, end, best):
                best = end
            lower, farthest = min(lower, t[3 * end + 1]), max(farthest, t[3 * end + 2])
            if flags[2 * end + _PROVEN] != 0:  # what may be no place bounds nothing from above, unless alone
                upper, is_proven = min(upper, t[3 * end + 2]), True
            end += 1
        upper = farthest if upper == math.inf else upper
        for k in range(begin, end):  # a place beyond the first has no say in it
            is_certified = is_certified and (flags[2 * k + _CERTIFIED] != 0 or t[3 * k + 1] > upper)
        t[3 * best + 1], t[3 * best + 2] = lower, upper
        flags[2 * best + _PROVEN] = 1 if is_proven else 0
        flags[2 * best + _CERTIFIED] = 1 if is_certified else 0
        first[count] = best
        count += 1
        begin = end
    return count


@kernel(inline=True)
def _comes_before(t, columns, i, j):
    if t[3 * i] != t[3 * j]:
        return t[3 * i] < t[3 * j]
    if columns[3 * i + _ITEM] != columns[3 * j + _ITEM]:
        return columns[3 * i + _ITEM] < columns[3 * j + _ITEM]
    return columns[3 * i + _FACET_OF_PLACE] < columns[3 * j + _FACET_OF_PLACE]


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def write_places(origins_at, vectors_at, exponents_at, rays_at, t_at, n, points_at):
    """Write origin + t · direction of n places; returns 0.

    origins, vectors : 3 doubles a ray.   rays : the ray of each place.   t : 3 doubles a place, of which the first is
    read, in units of the directions given.
    """
    rays, t, points = view_i64(rays_at, n), view_f64(t_at, 3 * n), view_f64(points_at, 3 * n)
    for k in range(n):
        exponent = int(view_i64(exponents_at, rays[k] + 1)[rays[k]])
        origin, vector = view_f64(origins_at + 24 * rays[k], 3), view_f64(vectors_at + 24 * rays[k], 3)
        for axis in range(3):
            points[3 * k + axis] = origin[axis] + t[3 * k] * math.ldexp(vector[axis], exponent)
    return 0


# --- facets -----------------------------------------------------------------------------------------------------------


@entry("int64(int64, int64, int64, float64, int64, int64, int64, int64, int64)")
def put_rays_to_facets(X_at, step, centre_at, reach, origins_at, vectors_at, limits_at, n, rays_at):
    """Write n rays as `cast_rays` takes them; returns 0.

    X : the body's poses.   centre, reach : of a ball around it, in its frame.   limits : of t, a double a ray.
    """
    limits, centre = view_f64(limits_at, n), vec3_at(view_f64(centre_at, 3), 0)
    for k in range(n):
        X, ray = view_f64(X_at + 8 * step * k, 16), view_f64(rays_at + 8 * RAY * k, RAY)
        origin = vec3_at(view_f64(origins_at + 24 * k, 3), 0)
        put_vec3(ray, 0, origin)
        put_vec3(ray, 3, vec3_at(view_f64(vectors_at + 24 * k, 3), 0))
        # Beyond the ball around the body, wherever the ray begins.
        stretch, there = 0.0, Vec3(0.0, 0.0, 0.0)
        for i in range(3):
            stretch += norm1(vec3_at(X, 4 * i))
        there = Vec3(
            X[3] + dot(vec3_at(X, 0), centre), X[7] + dot(vec3_at(X, 4), centre), X[11] + dot(vec3_at(X, 8), centre)
        )
        away = norm1(sub(origin, there)) + stretch * reach + 1e-100
        ray[6] = math.ldexp(1.0, int(math.frexp(away)[1]) + 2)
        ray[7] = max(limits[k] / ray[6], _MIN_LIMIT)
    return 0


@entry("int64(int64, int64, int64, int64, int64)")
def group_first_facets(hits_at, n, rays_at, is_narrow_at, groups_at):
    """Group the hits of `cast_rays` that a ray may meet first, by brackets that overlap; returns how many rays hit.

    hits : a ray's side by side.   is_narrow : out, a byte a hit: NARROW where the bracket of t is good enough, and
    within the limit; NARROW_BUT_OPEN where doubles could not tell besides whether ray and facet meet; else 0.
    groups : out, 5 integers a ray with hits: the hit of the least facet in the group; how many hits the group has; the
    least of their marks; the hits of the least lower and of the least upper bound.
    """
    hits, is_narrow = view_f64(hits_at, HIT * n), view_u8(is_narrow_at, n)
    count, begin = 0, 0
    while begin < n:
        ray, end = int(hits[HIT * begin + RAY_OF]), begin
        limit = view_f64(rays_at + 8 * RAY * ray, RAY)[7]
        while end < n and hits[HIT * end + RAY_OF] == ray:
            at = HIT * end
            is_good = hits[at + UPPER] - hits[at + LOWER] <= _MAX_WIDTH_OF_FACET
            is_narrow[end] = NARROW if is_good and hits[at + UPPER] <= limit and limit > _MIN_LIMIT else 0
            if is_narrow[end] != 0 and hits[at + OPEN] != 0.0:
                is_narrow[end] = NARROW_BUT_OPEN
            end += 1
        group, first = view_i64(groups_at + 40 * count, 5), begin
        for k in range(begin + 1, end):
            first = k if hits[HIT * k + LOWER] < hits[HIT * first + LOWER] else first
        reach, size, n_hits = hits[HIT * first + UPPER], -1, 0
        while n_hits != size:  # what came before may reach as far as the largest end among them
            size, n_hits = n_hits, 0
            for k in range(begin, end):
                if hits[HIT * k + LOWER] <= reach:
                    n_hits += 1
                    reach = max(reach, hits[HIT * k + UPPER])
        group[0], group[1], group[2], group[3], group[4] = first, size, NARROW, first, first
        for k in range(begin, end):
            if hits[HIT * k + LOWER] <= reach:
                group[0] = k if hits[HIT * k + FACET_OF] < hits[HIT * group[0] + FACET_OF] else group[0]
                group[2] = min(group[2], is_narrow[k])
                group[4] = k if hits[HIT * k + UPPER] < hits[HIT * group[4] + UPPER] else group[4]
        count += 1
        begin = end
    return count


@entry("void(int64, int64, int64, int64, int64)")
def scale_facet_t(hits_at, n, rays_at, exponents_at, t_at):
    """Write t of n hits of `cast_rays`, value, from below, from above, in units of the directions given."""
    hits, t = view_f64(hits_at, HIT * n), view_f64(t_at, 3 * n)
    for k in range(n):
        ray = int(hits[HIT * k + RAY_OF])
        unit = view_f64(rays_at + 8 * RAY * ray, RAY)[6]
        shift = -int(view_i64(exponents_at, ray + 1)[ray])
        t[3 * k] = math.ldexp(hits[HIT * k + VALUE] * unit, shift)
        t[3 * k + 1] = math.ldexp(hits[HIT * k + LOWER] * unit, shift)
        t[3 * k + 2] = math.ldexp(hits[HIT * k + UPPER] * unit, shift)
