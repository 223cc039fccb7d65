"""A mesh and a curved shape, or a field and a convex set: states and gaps by walks to the nearest items.

A boolean is a walk (`item_walks.py`) with the upper bound 0 from the beginning, and whether the bodies come within a
margin a walk with the margin; the convex engine answers at single items (`item_questions.py`).
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, prepared, view_f64, view_i64, view_u8
from collide.lowering.shape_table import (
    NUMBERS,
    REACH,
)
from collide.mesh.bvh import (
    N_FACETS,
)
from collide.mesh.bvh import REACH as TREE_REACH
from collide.narrowphase.facets.item_questions import (
    BALLS,
    EXCHANGED,
    FACETS,
    HEADER,
    ITEMS_ARE,
    LONG_WAY,
    MAYBE_INSIDE,
    MEETS,
    NEAR,
    PROMISE,
    REACH_OF_ITEMS,
    ROW_AT,
    SURFACES_APART,
    ask_item,
    begin_walk,
    number_of_item,
    set_poses,
    take_part,
    with_box,
)
from collide.narrowphase.facets.item_walks import places_within, walk_down
from collide.narrowphase.fallback_searches import lay_row_apart
from collide.narrowphase.fields.convex_walk_kernel import nearest_ball, state_of_cloud
from collide.narrowphase.finish_rows import forget_depth
from collide.narrowphase.rows import (
    BEYOND,
    BODY_B,
    CERTIFIED,
    COUNT,
    DISTANCE,
    HIT,
    HOW,
    ITERATIONS,
    LOWER,
    NORMAL,
    PART_A,
    PART_B,
    POINT_A,
    POINT_B,
    ROW,
    UPPER,
    VERTICES_A,
    VERTICES_B,
    copy_row,
    is_undecided_or_refused,
    view_row,
)
from collide.numerics.vec3 import (
    Vec3,
    norm,
    put_vec3,
    scale,
    sub,
    vec3_at,
)

#: Where so many facets of a mesh leave it open whether it meets the shape, polytopes around and inside the shape may
#: decide sooner: a tube around a cylinder, whose facets are all near.
_MAX_ASKED = 64
#: Facets are looked at that are farther than a limit by so many times what rounding takes off a gap.
NEAR_SLACK = 64.0


@kernel
def rows_within(walk, limit, capacity, rows_at, places_at):
    """(state, n) of the facets no farther than a limit [m]: writes their rows, with depths, and their places.

    state : SURFACES_APART or MAYBE_INSIDE where n is 0; LONG_WAY where boxes of more than ``capacity`` facets are near,
    or a facet is undecided; else NEAR.   rows, places : room for ``capacity``.
    """
    places = view_i64(places_at, capacity)
    # Looked at are facets a little farther away: what is near is told by their rows, as in batches.
    n_looked_at = places_within(walk, limit + NEAR_SLACK * walk.slack, capacity, places)
    if n_looked_at > capacity:
        return LONG_WAY, 0
    n = 0
    for i in range(n_looked_at):
        row = ask_item(walk, places[i], True, math.inf)
        if row.doubles[LOWER] > limit:
            continue
        if is_undecided_or_refused(row):
            return LONG_WAY, n
        copy_row(walk.words[ROW_AT] + ROW, rows_at + ROW * n)
        places[n] = places[i]
        n += 1
    return (NEAR if n > 0 else _inside_or_apart(walk)), n


@kernel
def _inside_or_apart(walk):
    """SURFACES_APART or MAYBE_INSIDE, of surfaces that are apart: by the middle of the shape's box."""
    centre = scale(0.5, Vec3(walk.low.x + walk.high.x, walk.low.y + walk.high.y, walk.low.z + walk.high.z))
    reach = vec3_at(walk.tree.numbers, TREE_REACH)
    inside = abs(centre.x) <= reach.x + walk.slack and abs(centre.y) <= reach.y + walk.slack
    return MAYBE_INSIDE if inside and abs(centre.z) <= reach.z + walk.slack else SURFACES_APART


@kernel(inline=True)
def _max_asked(walk):
    """After how many items a boolean is given up: of balls and cells, whose unions take longer, after all."""
    return _MAX_ASKED if walk.words[ITEMS_ARE] == FACETS else walk.tree.header[N_FACETS]


@kernel
def _is_proven_hit(row):
    return row.flags[HIT] != 0 and not is_undecided_or_refused(row)


@kernel
def _write_meeting(walk, place, row_at):
    """The mesh's row, without a depth, where a facet meets the shape: at a point of both, by the row of the facet asked
    last."""
    facet, row = view_row(walk.words[ROW_AT] + ROW), view_row(row_at)
    forget_depth(facet)
    put_vec3(row.doubles, POINT_A, vec3_at(facet.doubles, POINT_A))
    put_vec3(row.doubles, POINT_B, vec3_at(facet.doubles, POINT_B))
    row.words[PART_A] = number_of_item(walk, place)
    row.flags[HIT], row.flags[HOW], row.flags[CERTIFIED] = 1, facet.flags[HOW], 1
    for k in range(4):
        row.words[VERTICES_A + k] = row.words[VERTICES_B + k] = -1


@kernel(inline=True)
def _is_cloud(walk):
    """Whether items are balls, which have a walk of their own (`fields/convex_walk_kernel.py`)."""
    return walk.words[ITEMS_ARE] == BALLS


@kernel
def _gap(header_at, XA_at, XB_at, check, depths, row_at):
    """The row of one pair of poses, the mesh's first; LONG_WAY, SURFACES_APART or MAYBE_INSIDE, and without depths
    MEETS."""
    placed = set_poses(header_at, XA_at, XB_at, check)
    is_near, walk = begin_walk(header_at)
    if not (placed and is_near):
        return LONG_WAY
    if _is_cloud(walk):
        nearest = nearest_ball(walk, math.inf)
    else:
        walk = with_box(walk)
        nearest = walk_down(walk, math.inf, 0.0, walk.tree.header[N_FACETS])
    if nearest.failed and not depths:
        meeting = walk_down(with_box(walk), 0.0, 0.0, _max_asked(walk))  # the item that batches name
        if not (meeting.failed and _is_proven_hit(view_row(walk.words[ROW_AT] + ROW))):
            return LONG_WAY
        _write_meeting(walk, meeting.place, row_at)
        return MEETS
    if nearest.failed or nearest.place < 0:
        return LONG_WAY
    _write_gap(walk, nearest, row_at)
    return SURFACES_APART if _is_cloud(walk) else _inside_or_apart(walk)


@kernel
def _state(header_at, XA_at, XB_at, check, margin):
    """`_state_of_walk` of one pair of poses, the mesh's first; of balls no place, nor how."""
    placed = set_poses(header_at, XA_at, XB_at, check)
    is_near, walk = begin_walk(header_at)
    if not (placed and is_near):
        return LONG_WAY, -1, 0
    if _is_cloud(walk):
        return state_of_cloud(walk, margin), -1, 0
    return _state_of_walk(with_box(walk), margin)


@kernel
def _state_of_walk(walk, margin):
    """(state, place, how) of a mesh, or of items, and a shape.

    state : LONG_WAY, SURFACES_APART, MAYBE_INSIDE, MEETS or, with a margin above 0 [m], NEAR: apart is then farther
    apart than the margin.   place : of MEETS the triangle meeting the shape, in the order of the tree.   how : index
    into `results.HOW`.
    """
    max_asked = _max_asked(walk)
    nearest = walk_down(walk, margin, margin, max_asked)
    if nearest.failed:
        row = view_row(walk.words[ROW_AT] + ROW)
        return (MEETS if _is_proven_hit(row) else LONG_WAY), nearest.place, int(row.flags[HOW])
    if nearest.n_asked > max_asked:
        return LONG_WAY, -1, 0
    return (NEAR if nearest.lower <= margin else _inside_or_apart(walk)), -1, 0


@kernel
def _write_gap(walk, nearest, row_at):
    """The mesh's row from the best facet's and the least of all brackets."""
    copy_row(walk.words[ROW_AT], row_at)
    row = view_row(row_at)
    of_best = row.doubles[DISTANCE]
    distance = min(max(of_best, nearest.lower), nearest.upper)
    row.doubles[LOWER], row.doubles[UPPER], row.doubles[DISTANCE] = nearest.lower, nearest.upper, distance
    if distance != of_best:
        lay_row_apart(row)
    numbers = walk.numbers
    reach, promise = view_f64(walk.header_at + 8 * REACH_OF_ITEMS, 1)[0], view_f64(walk.header_at + 8 * PROMISE, 1)[0]
    size = reach + numbers[NUMBERS + REACH] + norm(walk.t)
    certified = nearest.open_lower > nearest.upper or nearest.upper - nearest.lower <= promise * size
    row.flags[CERTIFIED] = 1 if certified else 0
    row.flags[HIT] = row.flags[BEYOND] = row.flags[COUNT] = 0
    row.words[PART_A], row.words[PART_B] = number_of_item(walk, nearest.place), 0
    row.words[ITERATIONS] = 0
    for k in range(4):
        row.words[VERTICES_A + k] = row.words[VERTICES_B + k] = -1


#: How a part's state is asked for, wherever items have a kernel for it.
PART_SIGNATURE = "int64(int64, int64, int64, int64, int64, float64)"


@entry(PART_SIGNATURE)
def state_of_part(header_at, ints_at, numbers_at, pose_at, box_at, margin):
    """The state, as of `_state_of_walk`, of items where they stand and a part as of `take_part`; never NEAR where an
    item is known to meet the part.

    With a margin an item within it ends the walk: whether another meets the part is asked once more.
    """
    take_part(header_at, ints_at, numbers_at, pose_at, box_at)
    is_near, walk = begin_walk(header_at)
    if not is_near:
        return LONG_WAY
    if _is_cloud(walk):
        return state_of_cloud(walk, margin)
    walk = with_box(walk)
    state, _, _ = _state_of_walk(walk, margin)
    if state == NEAR and _state_of_walk(walk, 0.0)[0] == MEETS:
        return MEETS
    return state


#: The same for a part's gap.
GAP_SIGNATURE = "int64(int64, int64, int64, int64, int64, float64, int64)"


@entry(GAP_SIGNATURE)
def gap_of_part(header_at, ints_at, numbers_at, pose_at, box_at, limit, row_at):
    """Write the row of a part as of `take_part`, as A, and of the nearest item where items stand: NEAR; SURFACES_APART
    of items beyond the limit [m]; LONG_WAY.
    """
    take_part(header_at, ints_at, numbers_at, pose_at, box_at)
    is_near, walk = begin_walk(header_at)
    if not is_near:
        return LONG_WAY
    if _is_cloud(walk):
        nearest = nearest_ball(walk, limit)
    else:
        nearest = walk_down(with_box(walk), limit, 0.0, walk.tree.header[N_FACETS])
    if nearest.failed:
        return LONG_WAY
    if nearest.place < 0:
        return SURFACES_APART
    _write_gap(walk, nearest, row_at)
    _finish_single(row_at, True)
    return NEAR


@entry("int64(int64, int64, int64, int64, boolean, int64, int64)")
def curved_gaps(header_at, XA_at, XB_at, n, depths, rows_at, states_at):
    """Rows of items and a shape at n pairs of checked poses that are apart, or, without depths, meet; returns how many
    are written.

    header : of HEADER integers.   XA, XB : 16 doubles a pose.   rows : of PAIR_DTYPE.   states : a byte a pose, 1 where
    its row is written.
    """
    states, n_written = view_u8(states_at, n), 0
    for k in range(n):
        status = _gap(header_at, XA_at + 128 * k, XB_at + 128 * k, False, depths, rows_at + ROW * k)
        states[k] = 0 if status == LONG_WAY else 1
        n_written += int(states[k])
    return n_written


@entry("int64(int64, int64, int64, int64, float64, int64, int64, int64)")
def curved_states_of(header_at, XA_at, XB_at, n, margin, states_at, places_at, how_at):
    """States of a mesh and a shape at n pairs of checked poses; returns how many are not left to the long way.

    header, XA, XB : as of `curved_gaps`.   margin, states, places, how : of `_state`, n integers each.
    """
    states, places, how = view_i64(states_at, n), view_i64(places_at, n), view_i64(how_at, n)
    n_decided = 0
    for k in range(n):
        states[k], places[k], how[k] = _state(header_at, XA_at + 128 * k, XB_at + 128 * k, False, margin)
        n_decided += int(states[k] != LONG_WAY)
    return n_decided


@entry(prepared.ROW, nogil=False)
def curved_state_single(header_at, XA_at, XB_at, row_at, _unused, margin):
    """1 with the bodies' state, as of `_state`, in the first word of a row; LONG_WAY.

    header : as of `curved_gap_single`.
    """
    exchanged = view_i64(header_at, HEADER)[EXCHANGED] != 0
    state, _, _ = _state(header_at, XB_at if exchanged else XA_at, XA_at if exchanged else XB_at, True, margin)
    if state == LONG_WAY:
        return LONG_WAY
    view_i64(row_at, 1)[0] = state
    return 1


@entry(prepared.ROW, nogil=False)
def curved_gap_single(header_at, XA_at, XB_at, row_at, depths, _unlimited):
    """ROW zero bytes become the row of bodies whose surfaces are apart, or, without depths, meet; returns as `_gap`.

    header : its [EXCHANGED] says that the shape stands first.
    """
    exchanged = view_i64(header_at, HEADER)[EXCHANGED] != 0
    status = _gap(header_at, XB_at if exchanged else XA_at, XA_at if exchanged else XB_at, True, depths, row_at)
    if status != LONG_WAY:
        _finish_single(row_at, exchanged)
    return status


@kernel
def _finish_single(row_at, exchanged):
    """Name the bodies of a row of a single call.   exchanged : the shape stands first."""
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if exchanged:
        normal, p_a = vec3_at(row.doubles, NORMAL), vec3_at(row.doubles, POINT_A)
        put_vec3(row.doubles, NORMAL, sub(Vec3(0.0, 0.0, 0.0), normal))
        put_vec3(row.doubles, POINT_A, vec3_at(row.doubles, POINT_B))
        put_vec3(row.doubles, POINT_B, p_a)
        row.words[PART_A], row.words[PART_B] = row.words[PART_B], row.words[PART_A]
