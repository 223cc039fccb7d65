"""Two convex cores, each swept by a ball: the cores' answer, moved by the sum of the radii."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.capsule_capsule import segment_cores
from collide.narrowphase.core_distance import convex_cores, request_plane
from collide.narrowphase.exact.depth_requests import add_request
from collide.narrowphase.gap.curved_gap import refine_curved_gap
from collide.narrowphase.gap.gap_queue import enqueue, write_guess
from collide.narrowphase.gap.precise_pair import is_refinable
from collide.narrowphase.gjk.minkowski_difference import AXIS, POINT_OF_A, POINT_OF_B, weighted_sum
from collide.narrowphase.kernel_dispatch import CONVEX, SPHERE_CAPSULE, SPHERES
from collide.narrowphase.posed_pair import radius_of
from collide.narrowphase.rows import (
    CERTIFIED,
    HIT,
    HOW,
    ITERATIONS,
    NORMAL,
    is_undecided,
    write_decision,
    write_vectors,
    write_verdict,
    write_vertices,
)
from collide.narrowphase.sphere_capsule import point_segment_cores
from collide.narrowphase.sphere_sphere import point_cores
from collide.numerics import double_double as dd
from collide.numerics.error_free import two_sum
from collide.numerics.vec3 import add, put_vec3, scale, sub, vec3_at
from collide.results import FORMULA, PLANE, SIMPLEX, SWEPT, UNDECIDED


@kernel(inline=True)
def convex_convex(ordered, how, query, row, row_number, n_start, work):
    """Write the row of two swept convex cores.

    how : the method, of cores: SPHERES, SPHERE_CAPSULE, CAPSULES or CONVEX.
    n_start : pairs of vertices for GJK to begin with (`gjk`).
    Returns the kind of gap of a row that is queued for its last digits and finished then (`gap_queue.py`), or −1.
    """
    pair, size, flip = ordered.pair, ordered.size, ordered.flip
    radius_a, radius_b = radius_of(pair, pair.A), radius_of(pair, pair.B)
    radius = radius_a + radius_b
    error = ERROR * size + ordered.slop
    curved = pair.A.kind != POINTS or pair.B.kind != POINTS
    exact_numbers = ordered.exact_numbers and not curved
    # A boolean may begin with an axis that separated the bodies before; reported numbers do in motions alone.
    sign = (-1.0 if flip else 1.0) if query.boolean or query.resumes else 0.0
    put_vec3(work.weights, AXIS, scale(sign, vec3_at(row.doubles, NORMAL)))
    work.request[1] = 0
    is_closed_form = how != CONVEX
    if is_closed_form:
        core = closed_form_cores(pair, how, work, error)
    else:
        core = convex_cores(ordered, query, work, radius, error, curved, n_start)
    lower = core.lower - error - radius
    upper = core.upper + error - radius
    argument = _argument(core, is_closed_form, lower, radius)
    row.words[ITERATIONS] = core.iterations
    distance = -core.depth - radius
    is_gap = exact_numbers and not query.boolean and core.depth < -error and lower <= query.limit
    if is_gap and is_refinable(size):
        write_guess(row, distance, lower, upper, core.nhat)
        write_vertices(row, work.ids, core.n_vertices, flip)
        return enqueue(ordered, query, work, core.n_points, argument, row_number, error)
    is_curved_gap = curved and ordered.exact_numbers and core.depth < -error and lower <= query.limit
    is_wanted = is_curved_gap and not (query.boolean or query.resumes)
    if is_wanted and _write_curved_gap(ordered, query, work, core, row, lower, upper):
        return -1
    decided = lower > 0.0 or upper <= 0.0
    if core.deepest < math.inf:
        rounding = 4.0 * 2.0**-53 * radius
        lower = max(lower, dd.bracket(two_sum(-core.deepest, -radius), rounding).lower)
        upper = min(upper, dd.bracket(two_sum(-core.shallowest, -radius), rounding).upper)
    width = math.inf
    if not query.boolean:
        width = PROMISE_CURVED * size if curved else (0.0 if exact_numbers else PROMISE_STORED * size)
    if query.boolean and decided:
        write_decision(row, distance, lower, upper, argument, query.limit)
    else:
        write_verdict(row, distance, lower, upper, argument, width, query.limit)
    is_open = row.flags[CERTIFIED] == 0 and (core.depth < -error or radius > 0.0) and (query.depths or upper > 0.0)
    # Radii may prove an overlap of cores between which doubles see no clear direction: such a gap is open, too.
    if width == 0.0 and (not decided or is_open or (is_gap and radius > 0.0)):
        row.flags[HOW] = UNDECIDED  # the exact stage settles the sign, or the last digits
        if is_closed_form:
            request_plane(work.ids, work.request)
        if work.request[1] > 0:
            add_request(work.requests, row_number, work.request)
    if query.boolean and not is_undecided(row):
        if row.flags[HIT] == 0:
            put_vec3(row.doubles, NORMAL, scale(sign, core.nhat))
        return -1
    if not (query.boolean or query.depths) and core.lower == -math.inf:
        radius_a = radius_b = 0.0  # a point of both cores is one of both bodies
    # On curved cores the last facet still has a width: what the two points miss of depth·n is shared between them.
    share = 0.5 if curved and not query.boolean else 0.0
    write_witness_points(pair, core, work, row, radius_a, radius_b, share, flip)
    write_vertices(row, work.ids, core.n_vertices, flip)
    return -1


@kernel
def _write_curved_gap(ordered, query, work, core, row, lower, upper):
    """Write the row of curved cores apart, if `refine_curved_gap` proves more than doubles: lower, upper."""
    pair = ordered.pair
    gap = refine_curved_gap(ordered, work, core.n_points, core.nhat)
    if not gap.is_proven:
        return False
    radius_a, radius_b = radius_of(pair, pair.A), radius_of(pair, pair.B)
    radius = two_sum(radius_a, radius_b)
    least, greatest = dd.sub(gap.lower, radius), dd.sub(gap.upper, radius)
    low, high = dd.bracket(least, gap.error).lower, dd.bracket(greatest, gap.error).upper
    if not high - low < upper - lower:
        return False
    middle = dd.scale(0.5, dd.add(least, greatest))
    argument = PLANE if low > 0.0 else SWEPT
    write_verdict(
        row, middle.high, max(low, lower), min(high, upper), argument, PROMISE_CURVED * ordered.size, query.limit
    )
    # Where Newton's method ended early, the points share what they miss of the gap along the normal.
    apart = sub(add(gap.b, pair.t), gap.a)
    shift = scale(0.5, sub(apart, scale(middle.high + radius.high, gap.nhat)))
    p_WA, p_WB = vec3_at(pair.poses, pair.A.pose_at + 9), vec3_at(pair.poses, pair.B.pose_at + 9)
    p_WAa = add(add(gap.a, shift), add(scale(radius_a, gap.nhat), p_WA))
    p_WBb = sub(add(sub(gap.b, shift), p_WB), scale(radius_b, gap.nhat))
    write_vectors(row, gap.nhat, p_WAa, p_WBb, ordered.flip)
    write_vertices(row, work.ids, core.n_vertices, ordered.flip)
    return True


@kernel(inline=True)
def closed_form_cores(pair, how, work, error):
    """The `CoreDistance` of two cores that are points or segments, by the method in its file."""
    if how == SPHERES:
        return point_cores(pair, work, error)
    if how == SPHERE_CAPSULE:
        return point_segment_cores(pair, work, error)
    return segment_cores(pair, work, error)


@kernel(inline=True)
def _argument(core, is_closed_form, lower, radius):
    """What decides the pair, if its bracket leaves out 0: see `results.How`."""
    if is_closed_form:
        return FORMULA
    if lower > 0.0:
        return PLANE
    return SIMPLEX if core.upper < 0.0 or radius == 0.0 else SWEPT


@kernel(inline=True)
def write_witness_points(pair, core, work, row, radius_a, radius_b, share, flip):
    """Normal and witness points of the bodies, from the deciding feature of the cores.

    share : of what the cores' points miss ``depth · nhat`` by, how much each of them is moved.
    """
    a = weighted_sum(work.points, work.weights, core.n_points, POINT_OF_A)
    b = weighted_sum(work.points, work.weights, core.n_points, POINT_OF_B)
    shift = scale(share, sub(sub(sub(a, b), pair.t), scale(core.depth, core.nhat)))
    p_WA, p_WB = vec3_at(pair.poses, pair.A.pose_at + 9), vec3_at(pair.poses, pair.B.pose_at + 9)
    p_WAa = add(add(sub(a, shift), scale(radius_a, core.nhat)), p_WA)
    p_WBb = add(sub(add(b, shift), scale(radius_b, core.nhat)), p_WB)
    write_vectors(row, core.nhat, p_WAa, p_WBb, flip)
