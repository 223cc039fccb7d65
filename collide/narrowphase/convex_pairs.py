"""The narrowphase over a list of pairs: dispatch, bracket, witness points, one row a pair.

One entry point for booleans, distances and batches, because every further one compiles the whole
narrowphase again. The half of the pair matrix below the diagonal is answered by exchanging the
bodies and flipping the row.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.kernels.lanes import LANES
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.convex_methods import CAPSULES, HALFSPACE_CONVEX, HALFSPACES, method
from collide.narrowphase.core_distance import (
    FINE_AT,
    OWN_DOUBLES,
    OWN_INTEGERS,
    TIED,
    TIES,
    WEIGHTS,
    convex_cores,
    name_plane,
    segments,
)
from collide.narrowphase.epa.polytope_surface import DOUBLES as EPA_DOUBLES
from collide.narrowphase.epa.polytope_surface import INTEGERS as EPA_INTEGERS
from collide.narrowphase.exact.depth_requests import ENTRY, REQUESTS, add_request
from collide.narrowphase.gap.gap_queue import (
    KINDS,
    QUEUE_DOUBLES,
    QUEUE_INTEGERS,
    clear_queue,
    enqueue,
    refine_queued,
    write_guess,
)
from collide.narrowphase.gap.precise_pair import is_refinable
from collide.narrowphase.gjk.minkowski_difference import POINT, combined
from collide.narrowphase.gjk.mpr_batch import answer_small_hulls
from collide.narrowphase.halfspace_convex import opposite_halfspaces, plane_in_world, reach_of_plane, refine_height
from collide.narrowphase.posed_pair import ordered_pair, radius_of
from collide.narrowphase.rows import (
    CERTIFIED,
    COUNT,
    DISTANCE,
    HIT,
    HOW,
    ITERATIONS,
    LOWER,
    NORMAL,
    ROW,
    UPPER,
    VERTICES_A,
    VERTICES_B,
    view_row,
    write_decision,
    write_vectors,
    write_verdict,
    write_vertices,
)
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.vec3 import Vec3
from collide.results import FORMULA, PLANE, REFUSED, SIMPLEX, SWEPT, UNDECIDED
from collide.support.support_mapping import settled_vertex, support
from collide.transforms import SMALLEST

#: Workspace of one thread: behind EPA's what waits for its last digits; the requests to the exact stage stand last.
_QUEUE_DOUBLES_AT, _QUEUE_INTEGERS_AT = OWN_DOUBLES + EPA_DOUBLES, OWN_INTEGERS + EPA_INTEGERS
REQUESTS_AT = _QUEUE_INTEGERS_AT + QUEUE_INTEGERS
DOUBLES, INTEGERS = _QUEUE_DOUBLES_AT + QUEUE_DOUBLES, REQUESTS_AT + REQUESTS


@kernel(inline=True)
def _swept(
    pair, closed_form, terms_at, row, words, marks, doubles_at, integers_at, boolean, depths, limit, size, slop, error, exactly,
    flip, row_number, given,
):  # fmt: skip
    """Two convex cores, each swept by a ball: the cores' answer, moved by the sum of the radii.

    closed_form : both cores are points or segments.   given : as `gjk` has it.
    Returns the kind of gap of a row that waits for its last digits and is finished then (`gap_queue.py`), or −1.
    """
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    radius_a = radius_of(pair, A)
    radius_b = radius_of(pair, B)
    radius = radius_a + radius_b
    points = view_f64(doubles_at, 5 * POINT)
    weights = view_f64(doubles_at + 8 * WEIGHTS, 10)
    ids = view_i64(integers_at, 10)
    curved = A.kind != POINTS or B.kind != POINTS
    # A boolean may begin with an axis that parted the bodies before; reported numbers never do.
    sign = (-1.0 if flip else 1.0) if boolean else 0.0
    for axis in range(3):
        weights[7 + axis] = sign * row[NORMAL + axis]
    view_i64(integers_at + 8 * TIED, 2)[1] = 0
    if closed_form:
        depth, bound, above, nx, ny, nz = segments(pair, points, ids, weights, error)
        n, vertices, rounds = 4, 4, 0
        shallowest = -math.inf
        deepest = math.inf
    else:
        depth, bound, above, shallowest, deepest, nx, ny, nz, n, vertices, rounds = convex_cores(
            pair, terms_at, doubles_at, integers_at, boolean, depths, radius, limit, size, slop, error, curved,
            exactly and not curved, given,
        )  # fmt: skip
    lower = bound - error - radius
    upper = above + error - radius
    how = FORMULA if closed_form else (PLANE if lower > 0.0 else (SIMPLEX if above < 0.0 or radius == 0.0 else SWEPT))
    words[ITERATIONS] = rounds
    distance = -depth - radius
    width = math.inf
    gap = False
    if not boolean:
        width = PROMISE_CURVED * size if curved else (0.0 if exactly else PROMISE_STORED * size)
        gap = exactly and not curved and depth < -error and lower <= limit
        if gap and is_refinable(size):
            write_guess(row, distance, lower, upper, Vec3(nx, ny, nz))
            write_vertices(words, marks, ids, vertices, flip)
            return enqueue(
                pair, terms_at, ids, weights, n, flip, how, row_number, size, slop, error,
                doubles_at + 8 * _QUEUE_DOUBLES_AT, integers_at + 8 * _QUEUE_INTEGERS_AT,
            )  # fmt: skip
    # Radii may prove an overlap of cores between which doubles see no clear direction.
    vague = gap and radius > 0.0
    decided = lower > 0.0 or upper <= 0.0
    if deepest < math.inf:
        rounding = 4.0 * 2.0**-53 * radius
        lower = max(lower, -deepest - radius - rounding)
        upper = min(upper, -shallowest - radius + rounding)
    if boolean and decided:
        write_decision(row, marks, distance, lower, upper, how, limit)
    else:
        write_verdict(row, marks, distance, lower, upper, how, width, limit)
    unfinished = marks[CERTIFIED] == 0 and (depth < -error or radius > 0.0) and (depths or upper > 0.0)
    if width == 0.0 and (not decided or unfinished or vague):
        marks[HOW] = UNDECIDED  # the sign or the last digits are for integers to find
        tied = view_i64(integers_at + 8 * TIED, ENTRY)
        if closed_form:
            name_plane(ids, tied)
        if tied[1] > 0 and not boolean:
            add_request(view_i64(integers_at + 8 * REQUESTS_AT, REQUESTS), row_number, tied)
    if boolean and marks[HOW] != UNDECIDED:
        if marks[HIT] == 0:
            row[NORMAL] = sign * nx
            row[NORMAL + 1] = sign * ny
            row[NORMAL + 2] = sign * nz
        return -1
    ax = combined(points, weights, n, 3)
    ay = combined(points, weights, n, 4)
    az = combined(points, weights, n, 5)
    bx = combined(points, weights, n, 6)
    by = combined(points, weights, n, 7)
    bz = combined(points, weights, n, 8)
    if not (boolean or depths) and bound == -math.inf:
        radius_a = radius_b = 0.0  # a point of both cores is one of both bodies
    # On curved cores the last facet still has a width: what the two points miss of depth·n is shared between them.
    missing = 0.5 if curved and not boolean else 0.0
    ox = missing * (ax - bx - pair.t.x - depth * nx)
    oy = missing * (ay - by - pair.t.y - depth * ny)
    oz = missing * (az - bz - pair.t.z - depth * nz)
    write_vectors(
        row, nx, ny, nz,
        (ax - ox + radius_a * nx) + poses[p + 9],
        (ay - oy + radius_a * ny) + poses[p + 10],
        (az - oz + radius_a * nz) + poses[p + 11],
        (bx + ox - radius_b * nx) + poses[q + 9],
        (by + oy - radius_b * ny) + poses[q + 10],
        (bz + oz - radius_b * nz) + poses[q + 11],
        flip,
    )  # fmt: skip
    write_vertices(words, marks, ids, vertices, flip)
    return -1


@kernel
def _half(pair, row, words, marks, doubles_at, integers_at, boolean, limit, size, error, skew, known, flip):
    """A half-space A and a convex B: the point of B deepest behind the plane."""
    A, B, numbers, poses = pair.A, pair.B, pair.numbers, pair.poses
    p, q = A.pose_at, B.pose_at
    t = pair.t
    ids = view_i64(integers_at, 10)
    nx, ny, nz, offset, length = plane_in_world(numbers, A.params_at, poses, p)
    nx /= length
    ny /= length
    nz /= length
    gx = -(poses[q] * nx + poses[q + 3] * ny + poses[q + 6] * nz)
    gy = -(poses[q + 1] * nx + poses[q + 4] * ny + poses[q + 7] * nz)
    gz = -(poses[q + 2] * nx + poses[q + 5] * ny + poses[q + 8] * nz)
    k, x, y, z, _ = support(B.kind, B.coords, B.n, B.padded, numbers, B.params_at, B.tree, 0, -1, gx, gy, gz)
    if B.tree != 0:
        k = settled_vertex(B.coords, B.n, B.padded, B.tree, k, gx, gy, gz)
        x = B.coords[k]
        y = B.coords[B.padded + k]
        z = B.coords[2 * B.padded + k]
    bx = poses[q] * x + poses[q + 1] * y + poses[q + 2] * z
    by = poses[q + 3] * x + poses[q + 4] * y + poses[q + 5] * z
    bz = poses[q + 6] * x + poses[q + 7] * y + poses[q + 8] * z
    radius = radius_of(pair, B)
    gap = ((bx + t.x) * nx + (by + t.y) * ny + (bz + t.z) * nz) - offset / length - radius
    lower = gap - error
    upper = gap + error
    decided = lower > 0.0 or upper <= 0.0
    exactly = known and B.kind == POINTS
    width = 0.0 if exactly else math.inf
    if exactly and lower <= limit and not boolean:
        refined = refine_height(pair, doubles_at + 8 * FINE_AT, integers_at + 8 * TIES, k, size, error, skew)
        if refined.proven:
            bracket = dd.bracket(dd.sub(refined.height, DD(radius, 0.0)), refined.error)
            gap = bracket.nearest
            lower = max(lower, bracket.lower)
            upper = min(upper, bracket.upper)
    write_verdict(row, marks, gap, lower, upper, FORMULA, math.inf if boolean else width, limit)
    if exactly and (not decided or (marks[CERTIFIED] == 0 and not boolean)):
        marks[HOW] = UNDECIDED  # the sign or the last digits are for integers to find
    bx += poses[q + 9] - radius * nx
    by += poses[q + 10] - radius * ny
    bz += poses[q + 11] - radius * nz
    write_vectors(row, nx, ny, nz, bx - gap * nx, by - gap * ny, bz - gap * nz, bx, by, bz, flip)
    ids[0] = -1
    ids[1] = k
    write_vertices(words, marks, ids, 1, flip)


@kernel
def _halves(pair, row, marks, flip):
    """Two half-spaces: unless their normals are exactly opposite they meet, and the overlap has no end.

    Opposite within rounding is left open, for `opposite_halfspaces.py` to settle.
    """
    A, B, numbers, poses = pair.A, pair.B, pair.numbers, pair.poses
    p, q = A.pose_at, B.pose_at
    opposite, nx, ny, nz = opposite_halfspaces(numbers, A.params_at, p, B.params_at, q, poses)
    row[LOWER] = -math.inf
    row[DISTANCE] = -math.inf
    row[UPPER] = 0.0
    marks[HIT] = 1
    marks[HOW] = UNDECIDED if opposite else FORMULA
    marks[CERTIFIED] = 0 if opposite else 1
    write_vectors(
        row, nx, ny, nz, poses[p + 9], poses[p + 10], poses[p + 11], poses[q + 9], poses[q + 10], poses[q + 11], flip
    )


#: How `answer_pairs` is called.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, boolean, float64, int64, int64, int64)"
)


@entry(SIGNATURE)
def answer_pairs(
    ints_at, numbers_at, poses_at, terms_at, shape_of_at, pairs_at, n_pairs, boolean, depths, stop_at_hit, limit, rows_at,
    doubles_at, integers_at,
):  # fmt: skip
    """Answer pairs of posed convex sets, one row each; returns how many were answered.

    ints, numbers : a `ShapeTable`.   poses : POSE doubles a part.   terms : of a `PoseTable`.   shape_of : a shape row a part.
    pairs : two part numbers a pair.
    boolean : only hit and how are wanted; of a decided row little else is set but the normal of a miss. A
        normal that is there is the axis to try first.
    stop_at_hit : stop after the first hit.   limit : farther apart than this is not looked at.
    rows : PAIR_DTYPE, zeroed but for that.   doubles, integers : workspace, see `run`.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    view_i64(integers_at + 8 * REQUESTS_AT, 1)[0] = 0
    queue_at = integers_at + 8 * _QUEUE_INTEGERS_AT
    n_queued = view_i64(queue_at, KINDS)
    # Whoever still waits when all pairs have had their turn is seen to then, kind by kind.
    most = 1 if stop_at_hit else LANES
    begun = 0
    if not depths and not stop_at_hit:
        begun = answer_small_hulls(
            ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, limit, rows_at,
            doubles_at + 8 * _QUEUE_DOUBLES_AT, queue_at,
        )  # fmt: skip
    clear_queue(queue_at)
    for turn in range(n_pairs if boolean else n_pairs + KINDS):
        kind = turn - n_pairs
        if begun > 0 and turn < n_pairs and view_u8(rows_at + ROW * turn, ROW)[HOW] != UNDECIDED:
            continue
        if turn < n_pairs:
            kind = _answer(
                ints_at, numbers_at, poses_at, terms_at, shape_of_at, pairs[2 * turn], pairs[2 * turn + 1], turn, begun > 0, boolean,
                depths, limit, rows_at, doubles_at, integers_at,
            )  # fmt: skip
        if kind >= 0 and n_queued[kind] >= (most if turn < n_pairs else 1):
            refine_queued(
                ints_at, numbers_at, poses_at, kind, depths, limit, rows_at, doubles_at + 8 * _QUEUE_DOUBLES_AT, queue_at
            )
        if stop_at_hit and turn < n_pairs and view_u8(rows_at + ROW * turn, ROW)[HIT] == 1:
            return turn + 1
    return n_pairs


@kernel(inline=True)
def _take_vertices(words, marks, ids, begun):
    """Have the last three ids name what a row names to begin with, and the row nothing; returns how many there are."""
    given = int(marks[COUNT]) if begun else 0
    for k in range(4):
        if k < 3 and given > 0:
            ids[2 * k + 4] = words[VERTICES_A + k]
            ids[2 * k + 5] = words[VERTICES_B + k]
        words[VERTICES_A + k] = -1
        words[VERTICES_B + k] = -1
    marks[COUNT] = 0
    return given


@kernel(inline=True)
def _answer(
    ints_at, numbers_at, poses_at, terms_at, shape_of_at, pa, pb, row_number, begun, boolean, depths, limit, rows_at,
    doubles_at, integers_at,
):  # fmt: skip
    """Answer one pair; returns the kind of gap if the row waits for its last digits, else −1.

    begun : the row may name vertices to begin with. To look costs 1 to 2 % of a gap: rows are seldom in the cache.
    """
    row, words, marks = view_row(rows_at + ROW * row_number)
    pair, _, flip, size, slop, known = ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pa, pb)
    how = method(pair.A.kind, pair.A.n, pair.B.kind, pair.B.n)
    given = _take_vertices(words, marks, view_i64(integers_at, 10), begun)
    if 0.0 < size < SMALLEST:
        marks[HOW] = REFUSED
        return -1
    if how == HALFSPACES:
        _halves(pair, row, marks, flip)
        return -1
    if how == HALFSPACE_CONVEX:
        offset, skew = reach_of_plane(pair.numbers, pair.A.params_at, pair.poses, pair.A.pose_at)
        size += offset
        error = ERROR * size * skew + slop
        _half(
            pair, row, words, marks, doubles_at, integers_at, boolean, limit, size, error, skew, known, flip
        )
        return -1
    return _swept(
        pair, how == CAPSULES, terms_at, row, words, marks, doubles_at, integers_at, boolean, depths, limit, size,
        slop, ERROR * size + slop, known, flip, row_number, given,
    )  # fmt: skip
