"""When two convex sets in motion first touch: conservative advancement along kept axes.

Conservative advancement (Mirtich 1996; van den Bergen, "Collision detection in interactive 3D environments", 2004)
goes forward in time only as far as no contact can be. A step here: GJK gives an axis between the bodies; along the axis
the gap is followed, `kept_axis.py` proving each span free, until the axis is used up, and GJK gives the next. Near the
contact steps shrink as the square of the time left. Doubles propose a span; the span counts where its chord is proven.

Where bodies are about to touch, the pair is asked a little later than the gap's root: if GJK proves contact then, the
first contact is between the last time proven free and the time asked.

First of all, balls about the origins bound the time in which contact is possible at all.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, native_call
from collide.lowering.packed_convex import POINTS
from collide.motion.kept_axis import (
    AxisGap,
    axis_turning,
    axis_with,
    curvature,
    gap_along,
    is_free_between,
    turned_axis,
)
from collide.motion.moving_body import ANGLE, DRIFT_REACH, REACH_OF_CORE
from collide.motion.moving_pair import omega_of, origin_of_b, place_pair
from collide.motion.speed_bound import speed_bound
from collide.motion.swept_balls import time_of_balls
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.rows import COUNT, HOW, LOWER, NORMAL, UPPER, VERTICES_A, VERTICES_B, blank_row, view_row
from collide.numerics.vec3 import Vec3, add, column_at, cross, divide, dot, norm, put_vec3, rotate, scale, sub, vec3_at
from collide.results import REFUSED, UNDECIDED

_answer_pairs_at = native_call(SIGNATURE)

#: How a search ends: no contact in its time; contact between two times; contact, if any, not before a time, and not
#: proven; the same from the very start; a pair that is too small to be asked about.
FREE, CONTACT, OPEN, OPEN_START, TOO_SMALL = range(5)

#: Questions to GJK after which a search hands over the bracket it has.
MAX_QUERIES = 20000
#: Spans tried along one axis.
_MAX_SPANS = 24
#: An axis is used up where so much of its gap is left.
_USED_UP = 0.1
#: Times asked for a contact behind the gap's root, each a _PROBE_GROWTH farther.
_MAX_PROBES, _PROBES_ON_THE_WAY, _PROBE_GROWTH = 40, 2, 4.0
#: Squared sine of the angle between two edges that count as parallel.
_NEARLY_PARALLEL = 1e-6
#: Squared change of a unit vector that is too much to go on from.
_LARGE_TURN = 0.25
#: An axis of GJK that is worse than its bound is mixed with the one kept, in so many parts.
_AXES_BETWEEN = 8
#: How far a time is moved at least, in units of its own last place.
_LEAST_STEP = 2.0**-52


class Search(NamedTuple):
    """How a search ended, and when: free before ``lower``, contact proven at ``upper`` or infinite.

    n_queries : questions to GJK.
    """

    status: int
    lower: float
    upper: float
    n_queries: int


class Asking(NamedTuple):
    """What a question to `answer_pairs` takes: its address, the addresses of its arguments, and those of two rows.

    header : view of addresses: the kernel, a `ShapeTable`'s integers and numbers, poses, shape rows, the pair,
    workspace of doubles and of integers.   row_at : of the last free time.   probe_at : of times tried.
    """

    header: Any
    row_at: int
    probe_at: int


CORE, INTS_AT, NUMBERS_AT, POSES_AT, SHAPE_OF_AT, PAIR_AT, DOUBLES_AT, INTEGERS_AT = range(8)


@kernel
def ask_pair(asking, row_at, boolean):
    """Ask about the pair at its poses: the gap without its last digits, or whether it meets.

    GJK begins where the row's last answer was; of a boolean, with its normal.
    """
    row = view_row(row_at)
    row.flags[HOW] = UNDECIDED
    header = asking.header
    # "stop at a hit" leaves out the search by portals, eight pairs at once, and has rows begin with what they name
    _answer_pairs_at(
        header[CORE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], 0, header[SHAPE_OF_AT], header[PAIR_AT], 1, boolean,
            False, True, math.inf, row_at, header[DOUBLES_AT], header[INTEGERS_AT],
        ),
    )
    return row


@kernel(inline=True)
def _is_contact(row):
    return row.flags[HOW] != UNDECIDED and row.doubles[UPPER] <= 0.0


@kernel
def search_contact(motion, asking, begin, end, tolerance):
    """The `Search` for the first contact in begin … end; the row at ``asking.row_at`` becomes the row of its lower
    time.

    Before ``begin`` the pair is known to be free.
    tolerance : the bracket's width to reach, if possible [unit time].
    """
    first = begin
    if not motion.is_plane:
        reach = motion.a[REACH_OF_CORE] + motion.b[REACH_OF_CORE] + motion.a[DRIFT_REACH] + motion.b[DRIFT_REACH]
        reach += motion.radius + motion.error
        begin, end = time_of_balls(motion.d0, motion.v, motion.farthest, reach, begin, end)
    if begin > end:
        return Search(FREE, end, end, 0)
    place_pair(motion, begin)
    put_vec3(blank_row(asking.row_at).doubles, NORMAL, Vec3(0.0, 0.0, 0.0))
    row = ask_pair(asking, asking.row_at, False)
    if row.flags[HOW] == REFUSED:
        return Search(TOO_SMALL, begin, begin, 1)
    if _is_contact(row) and begin == first:
        return Search(CONTACT, begin, begin, 1)
    if not row.doubles[LOWER] > 0.0 and begin == 0.0:
        upper, more = _find_contact(motion, asking, 0.0, AxisGap(0.0, 0.0, _axis_of(motion, row)), end, _MAX_PROBES)
        return Search(OPEN_START, 0.0, upper, 1 + more)
    return _search_from(motion, asking, row, Time(begin, end, tolerance))


class Time(NamedTuple):
    """begin : a time when the pair is free, or not proven to meet.   end : of the search.   tolerance : of a
    bracket."""

    begin: float
    end: float
    tolerance: float


@kernel
def _search_from(motion, asking, row, span):
    """`search_contact` from a time on whose row is known."""
    time, upper, n_queries = span.begin, math.inf, 1
    axis = _axis_of(motion, row)
    last_gap = AxisGap(-math.inf, 0.0, axis)
    while n_queries < MAX_QUERIES:
        last = min(span.end, upper)
        if time == last and upper == math.inf and row.doubles[LOWER] > 0.0:
            return Search(FREE, last, last, n_queries)
        gap = _good_axis(motion, time, gap_along(motion, time, axis), last_gap, row.doubles[LOWER])
        later = time
        if gap.gap > 0.0:
            later, gap = _follow_axis(motion, time, gap, last)
            last_gap = gap
        elif row.doubles[LOWER] > 0.0 and not motion.is_plane:
            later = _go_slowly(motion, time, row.doubles[LOWER], last)
            last_gap = AxisGap(-math.inf, 0.0, axis)
        is_stuck = not later > time
        if later == last and upper == math.inf and not is_stuck:
            return Search(FREE, last, last, n_queries)
        if not is_stuck:
            place_pair(motion, later)
            row = ask_pair(asking, asking.row_at, False)
            n_queries += 1
            axis = _next_axis(motion, row, axis.n, later - time)
            time = later
        if is_stuck or (upper == math.inf and _is_near(gap, span.tolerance)):
            max_probes = _MAX_PROBES if is_stuck else _PROBES_ON_THE_WAY
            proven, n_probes = _find_contact(motion, asking, time, gap, last, max_probes)
            upper = min(upper, proven)
            n_queries += n_probes
            place_pair(motion, time)
        if is_stuck or upper - time <= span.tolerance:
            break
    return Search(OPEN if upper == math.inf else CONTACT, time, upper, n_queries)


@kernel(inline=True)
def _is_near(gap, tolerance):
    """Whether the gap's root is within the tolerance."""
    return gap.rate < 0.0 and gap.gap <= -gap.rate * 0.5 * tolerance


@kernel(inline=True)
def _axis_of(motion, row):
    """The normal of a row as an axis, turning as the normal does while the nearest features stay the same.

    With the body of a face, or of an edge against a point; across both of two edges. Curved cores name no features.
    """
    n = vec3_at(row.doubles, NORMAL)
    if motion.is_plane:
        return axis_with(n, motion.a)
    count = int(row.flags[COUNT])
    n_a, n_b = _n_distinct(row, VERTICES_A, count), _n_distinct(row, VERTICES_B, count)
    if n_a == 2 and n_b == 2:
        return axis_turning(n, _turn_across(motion, n, row))
    if n_a >= 2 and n_a >= n_b and motion.a[ANGLE] != 0.0:
        return axis_with(n, motion.a)
    if n_b >= 2 and n_b > n_a and motion.b[ANGLE] != 0.0:
        return axis_with(n, motion.b)
    return axis_turning(n, Vec3(0.0, 0.0, 0.0))


@kernel
def _next_axis(motion, row, n_before, passed):
    """`_axis_of`; beside a curved core, unless a face is nearest, an axis turning at the mean rate since the last
    axis."""
    axis = _axis_of(motion, row)
    if (motion.pair.A.kind == POINTS and motion.pair.B.kind == POINTS) or motion.is_plane:
        return axis
    count = int(row.flags[COUNT])
    if max(_n_distinct(row, VERTICES_A, count), _n_distinct(row, VERTICES_B, count)) >= 3:
        return axis
    moved = sub(axis.n, n_before)
    if not (passed > 0.0 and dot(moved, moved) <= _LARGE_TURN):
        return axis_turning(axis.n, Vec3(0.0, 0.0, 0.0))
    turning = scale(1.0 / passed, cross(n_before, moved))
    largest = 4.0 * (motion.a[ANGLE] + motion.b[ANGLE]) + 4.0 * norm(motion.v) / (motion.size - motion.farthest)
    return axis_turning(axis.n, turning if norm(turning) <= largest else Vec3(0.0, 0.0, 0.0))


@kernel(inline=True)
def _n_distinct(row, first, count):
    """How many distinct vertices of one body a row names, at most three; 0 of a curved core."""
    n = 0
    for i in range(min(count, 3)):
        is_new = row.words[first + i] >= 0
        for j in range(i):
            is_new = is_new and row.words[first + j] != row.words[first + i]
        n += 1 if is_new else 0
    return n


@kernel
def _turn_across(motion, n, row):
    """Ω of an n that stays across an edge of A and an edge of B: Ω·(n × e) = ω·(n × e) for both."""
    omega_a, omega_b = omega_of(motion.a), omega_of(motion.b)
    m_a = cross(n, _edge(motion.pair, motion.pair.A, row, VERTICES_A))
    m_b = cross(n, _edge(motion.pair, motion.pair.B, row, VERTICES_B))
    aa, bb, ab = dot(m_a, m_a), dot(m_b, m_b), dot(m_a, m_b)
    determinant = aa * bb - ab * ab
    if not determinant > _NEARLY_PARALLEL * aa * bb:
        return Vec3(0.0, 0.0, 0.0)
    of_a, of_b = dot(omega_a, m_a), dot(omega_b, m_b)
    across = add(
        scale((of_a * bb - of_b * ab) / determinant, m_a), scale((of_b * aa - of_a * ab) / determinant, m_b)
    )
    return add(across, scale(0.5 * (dot(omega_a, n) + dot(omega_b, n)), n))


@kernel(inline=True)
def _edge(pair, body, row, first):
    """The edge between the first two distinct vertices of a body that a row names, in W's axes."""
    i = row.words[first]
    j = row.words[first + 1] if row.words[first + 1] != i else row.words[first + 2]
    edge = sub(column_at(body.coords, body.padded, j), column_at(body.coords, body.padded, i))
    return rotate(pair.poses, body.pose_at, edge)


@kernel
def _follow_axis(motion, time, gap, end):
    """(time up to which the axis proves the pair free, the `AxisGap` then); leaves the pair's poses at any time.

    gap : at ``time``, positive.   end : no later than this.
    """
    bound = curvature(motion, gap.axis)
    enough = _USED_UP * gap.gap
    passed = _step(gap, bound, end - time, motion.error)
    for _ in range(_MAX_SPANS):
        later = time + passed if passed < end - time else end
        if not later > time:
            break
        place_pair(motion, later)
        then = gap_along(motion, later, turned_axis(gap.axis, later - time))
        span = later - time
        if is_free_between(gap.gap, then.gap, bound, span):
            time, gap = later, then
            if time == end or gap.gap <= enough:
                break
            passed = _step(gap, bound, end - time, motion.error)
            continue
        if then.gap > 0.0:
            passed = min(0.5 * span, _longest_span(gap.gap, then.gap, bound))
        else:
            root = span * gap.gap / (gap.gap - then.gap)
            missed = 0.5 * bound * root * root + 4.0 * motion.error
            passed = min(root * (1.0 - min(0.5, missed / gap.gap)), _longest_span(gap.gap, 0.0, bound))
    return time, gap


@kernel
def _good_axis(motion, time, gap, last_gap, lower):
    """The largest `AxisGap` of the pair as placed, of two axes and some between them.

    gap : along GJK's last normal. Beside curved cores this gap may be worse than the plane behind the proven bound
    ``lower``: the simplex is thin, the normal is its last sliver's.
    last_gap : at the same time, or without a gap.
    """
    if gap.gap > 0.5 * lower or motion.is_plane or not last_gap.gap > -math.inf:
        return gap
    best = gap if gap.gap > last_gap.gap else last_gap
    for k in range(1, _AXES_BETWEEN):
        share = k / _AXES_BETWEEN
        n = add(scale(1.0 - share, last_gap.axis.n), scale(share, gap.axis.n))
        length = norm(n)
        if length > 0.5:
            between = gap_along(motion, time, axis_turning(divide(n, length), last_gap.axis.turning))
            if between.gap > best.gap:
                best = between
    return best


@kernel
def _go_slowly(motion, time, lower, end):
    """A later time, no later than ``end``, up to which the pair is free by its distance and a bound of its speed."""
    d_begin, d_end = origin_of_b(motion, time), origin_of_b(motion, end)
    speed = speed_bound(motion.a, motion.b, motion.v, d_begin, d_end)
    passed = 0.99 * lower / speed if speed > 0.0 else end
    return time + passed if passed < end - time else end


@kernel(inline=True)
def _longest_span(gap0, gap1, bound):
    """The time between two gaps along an axis that the chord proves."""
    if not bound > 0.0:
        return math.inf
    return 0.98 * math.sqrt(2.0 / bound) * (math.sqrt(gap0) + math.sqrt(max(gap1, 0.0)))


@kernel(inline=True)
def _step(gap, bound, remaining, error):
    """How much time to try: to shortly before the gap's root, as far as the chord may prove it."""
    passed = remaining
    if gap.rate < 0.0 and gap.gap < -gap.rate * remaining:
        root = gap.gap / -gap.rate
        missed = 0.25 * bound * root * root + 4.0 * error
        passed = root * (1.0 - min(0.5, missed / gap.gap))
    for _ in range(2):
        passed = min(passed, _longest_span(gap.gap, gap.gap + gap.rate * passed, bound))
    return passed


@kernel
def _find_contact(motion, asking, time, gap, end, max_probes):
    """(a time at which contact is proven, or infinity; questions asked), looked for from a free time on, ever later."""
    rate = max(-gap.rate, 0.0)
    passed = 2.0 * end
    if rate > 0.0:
        passed = (max(gap.gap, 0.0) + 16.0 * motion.error) / rate
    if not passed < end - time:
        passed = 2.0**-44 * max(end, 2.0**-20)
    passed = max(passed, _LEAST_STEP * time)
    put_vec3(view_row(asking.probe_at).doubles, NORMAL, vec3_at(view_row(asking.row_at).doubles, NORMAL))
    for k in range(max_probes):
        later = time + passed if passed < end - time else end
        place_pair(motion, later)
        row = ask_pair(asking, asking.probe_at, True)
        if _is_contact(row):
            return later, k + 1
        if later == end:
            return math.inf, k + 1
        passed *= _PROBE_GROWTH
    return math.inf, max_probes
