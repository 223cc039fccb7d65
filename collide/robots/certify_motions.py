"""Motions and boxes of configurations, proven free: distances at some configurations, and bounds of what is in between.

In the middle of an interval the distance of every pair of parts is compared with the most both can move away from there
within the interval (`motion_bounds.py`). A pair farther apart is proven apart in the whole interval; any other pair is
asked again in both halves. A hit ends the search: the motion collides at the middle. Where the earliest collision is
asked for, the search goes on before the middle alone. Intervals of a box are cells, halved in the column that moves a
pair by most.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.robots.check_scene import (
    BODY_INTS,
    COUNT,
    FIRST,
    N_BODIES,
    N_LINK_PARTS,
    N_SELF_PAIRS,
    PADDED,
    SELF_PAIRS_AT,
    SPHERE_HEADER_AT,
    body_of_part,
    boxes_meet,
    find_parts_around,
    is_allowed,
    place,
    twins_of_pair,
    view_scene,
)
from collide.robots.mesh_states import state_of_meshes
from collide.robots.motion_bounds import (
    BEGIN,
    BOX_OF_CONFIGURATIONS,
    CELL_LIMIT,
    CURRENT,
    END,
    FIRST_ITEM,
    HITS_AT,
    INTERVAL,
    IS_EARLIEST,
    ITEM,
    ITEM_CAPACITY,
    MAX_INTERVALS,
    MAX_PIECES,
    MESH_PAIR_CAPACITY,
    MESH_PAIRS_AT,
    MOTION_HEADER,
    N_CHECKED,
    N_ITEMS,
    N_MESH_PAIRS,
    N_OPEN_INTERVALS,
    OPEN_INTERVAL,
    OPEN_INTERVAL_CAPACITY,
    OPEN_INTERVALS_AT,
    OPEN_STRIDE,
    PATH_LENGTHS_AT,
    PATH_STRIDE,
    PIECE,
    STRAIGHT,
    begin_interval,
    column_to_halve,
    motion_at,
    moved_between,
    shortest_width,
)
from collide.robots.part_pairs import BEYOND_MARGIN, HITTING, OPEN, only_holds, state_of_parts
from collide.robots.sphere_motions import settle_pieces


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64)")
def certify_motions(header_at, motions_at, q0_at, q1_at, dof, first, n, times_at):
    """Write a time of collision of each motion from ``first`` on, of n, whose time is NaN so far and stays NaN where
    free; returns the first motion not done.

    q0, q1 : as of `STRAIGHT` and its siblings.   The kernel ends early once the open intervals of a motion exceed the
        workspace.
    """
    scene = view_scene(header_at)
    words = view_i64(motions_at, MOTION_HEADER)
    times = view_f64(times_at, n)
    words[N_OPEN_INTERVALS] = 0
    words[N_MESH_PAIRS] = 0
    for k in range(first, n):
        if times[k] == times[k]:
            continue
        motion = motion_at(scene, motions_at, q0_at, q1_at, dof, k)
        n_open = words[N_OPEN_INTERVALS]
        n_mesh = words[N_MESH_PAIRS]
        time = _certify(motion, k)
        is_full = (
            words[N_OPEN_INTERVALS] > words[OPEN_INTERVAL_CAPACITY] or words[N_MESH_PAIRS] > words[MESH_PAIR_CAPACITY]
        )
        if is_full or not (math.isnan(time) or words[IS_EARLIEST]):
            words[N_OPEN_INTERVALS] = n_open
            words[N_MESH_PAIRS] = n_mesh
        if is_full:
            return k
        times[k] = time
    return n


@kernel
def _certify(motion, number):
    """Time of a collision, or NaN: proven free but for the intervals and pairs that are left open."""
    intervals, words = motion.intervals, motion.words
    hit = math.nan
    last_cell = words[N_CHECKED] + words[CELL_LIMIT]
    # Pairs far apart are told from their boxes where bounds of the motion are small: long intervals are not asked.
    n_stack = 1
    if motion.kind == STRAIGHT and motion.scene.words[SPHERE_HEADER_AT] != 0:
        hit, n_stack = settle_pieces(motion)
        if not math.isnan(hit):
            if words[IS_EARLIEST] == 0:
                return hit
            _push(intervals, 0, 0.0, hit, 0.0, -1.0)
            n_stack = 1
    else:
        while n_stack < MAX_PIECES and n_stack * PIECE < motion.max_change:
            n_stack *= 2
        for k in range(n_stack):
            _push(intervals, n_stack - 1 - k, k / n_stack, (k + 1) / n_stack, 0.0, -1.0)
    if motion.kind == BOX_OF_CONFIGURATIONS:
        for j in range(motion.dof):
            motion.boxes[j] = motion.q0[motion.at + j]
            motion.boxes[motion.dof + j] = motion.q1[motion.at_q1 + j]
    while n_stack > 0:
        n_stack -= 1
        at = INTERVAL * n_stack
        begin = intervals[at + BEGIN]
        end = intervals[at + END]
        first = int(intervals[at + FIRST_ITEM])
        n_items = int(intervals[at + N_ITEMS])
        time = 0.5 * (begin + end)
        if motion.kind == BOX_OF_CONFIGURATIONS:
            _copy_box(motion, n_stack, MAX_INTERVALS)
        begin_interval(motion, begin, end)
        top = first if n_items < 0 else first + n_items
        _push(intervals, MAX_INTERVALS, begin, end, float(number), 0.0)
        state = _gather(motion, top) if n_items < 0 else _pass_on(motion, first, n_items, top)
        if state == 0:
            continue
        if state == -2:
            hit = time
            if words[IS_EARLIEST] == 0:
                _put_hit(motion, number)
                return hit
            # What waits on the stack comes later; an earlier collision may be of any pair.
            n_stack = 0
            if motion.changes[motion.dof] <= motion.resolution:
                _leave_interval(motion, number, begin, time, top, -1)
            else:
                _push(intervals, 0, begin, time, 0.0, -1.0)
                n_stack = 1
            continue
        body, partner = _pair_left(motion, top, state)
        is_cut_off = motion.kind == BOX_OF_CONFIGURATIONS and words[N_CHECKED] >= last_cell
        if is_cut_off or _is_last(motion, body, partner) or n_stack + 2 > MAX_INTERVALS:
            _leave_interval(motion, number, begin, end, top, state)
            continue
        # Both halves read the same pairs; what the left one keeps stands beyond them, and is gone when the right one
        # begins.
        _push(intervals, n_stack, time, end, float(top), float(state))
        _push(intervals, n_stack + 1, begin, time, float(top), float(state))
        if motion.kind == BOX_OF_CONFIGURATIONS:
            _push_halves(motion, n_stack, column_to_halve(motion, body, partner))
        n_stack += 2
    return hit


@kernel(inline=True)
def _copy_box(motion, k, to):
    n = 2 * motion.dof
    for j in range(n):
        motion.boxes[n * to + j] = motion.boxes[n * k + j]


@kernel(cold=True)
def _push_halves(motion, k, column):
    """Write both halves of the cell at work, halved in a column, as the boxes k and k + 1 of the stack."""
    n = 2 * motion.dof
    _copy_box(motion, MAX_INTERVALS, k)
    _copy_box(motion, MAX_INTERVALS, k + 1)
    motion.boxes[n * k + column] = motion.q[column]
    motion.boxes[n * (k + 1) + motion.dof + column] = motion.q[column]


@kernel(cold=True)
def _put_hit(motion, number):
    """Write the configuration at work where a box of this number collides."""
    if motion.kind == BOX_OF_CONFIGURATIONS:
        hits = view_f64(motion.words[HITS_AT], motion.dof * (number + 1))
        for j in range(motion.dof):
            hits[motion.dof * number + j] = motion.q[j]


@kernel(inline=True)
def _pair_left(motion, top, n_items):
    """(body, partner) of the first pair that an interval leaves, or of the pair without space."""
    item = ITEM * (top if n_items > 0 else motion.words[ITEM_CAPACITY])
    return motion.items[item + 2], motion.items[item + 3]


@kernel(inline=True)
def _is_last(motion, body, partner):
    """Whether the interval or cell at work is not halved any more for a pair of bodies, as of ITEM."""
    if motion.kind == BOX_OF_CONFIGURATIONS:
        return column_to_halve(motion, body, partner) < 0
    return motion.changes[motion.dof] <= shortest_width(motion)


@kernel(inline=True)
def _push(intervals, k, begin, end, first, n_items):
    at = INTERVAL * k
    intervals[at + BEGIN] = begin
    intervals[at + END] = end
    intervals[at + FIRST_ITEM] = first
    intervals[at + N_ITEMS] = n_items


@kernel
def _gather(motion, top):
    """Write all pairs not proven apart in the interval from ``top`` on; returns their number, −2 where a pair meets.

    Returns −1 without space: both halves then gather anew.
    """
    scene, words = motion.scene, motion.words
    n = 0
    stride = words[PATH_STRIDE] + 1
    lengths = view_i64(words[PATH_LENGTHS_AT], scene.words[N_BODIES])
    for body in range(scene.words[N_BODIES]):
        margin = motion.moved[body * stride + lengths[body]]
        n_near = find_parts_around(scene, body, margin)
        for k in range(n_near):
            part = scene.candidates[k]
            around = body_of_part(scene, part)
            if is_allowed(scene, body, around):
                continue
            first = scene.bodies[BODY_INTS * body + FIRST] + scene.words[PADDED]
            for p in range(first, first + scene.bodies[BODY_INTS * body + COUNT]):
                n = _take(motion, top, n, p, scene.words[N_LINK_PARTS] + part, body, -1 - around, margin)
                if n < 0:
                    return n
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * scene.words[N_SELF_PAIRS])
    for k in range(scene.words[N_SELF_PAIRS]):
        a = pairs[2 * k]
        b = pairs[2 * k + 1]
        margin = moved_between(motion, k, a, b)
        if not boxes_meet(scene, a, b, margin):
            continue
        twins = twins_of_pair(scene, a, b)
        first_a = scene.bodies[BODY_INTS * a + FIRST] + twins
        first_b = scene.bodies[BODY_INTS * b + FIRST] + twins
        for p in range(first_a, first_a + scene.bodies[BODY_INTS * a + COUNT]):
            for r in range(first_b, first_b + scene.bodies[BODY_INTS * b + COUNT]):
                n = _take(motion, top, n, p, r, -1, k, margin)
                if n < 0:
                    return n
    return n


@kernel(inline=True)
def _take(motion, top, n, p, q, body, partner, margin):
    """Ask about a pair of parts; write the pair unless proven apart. Returns the number written, or −1 or −2 as
    `_gather`.
    """
    state = _state(motion, p, q, body, partner, margin)
    if state == BEYOND_MARGIN:
        return n
    if state != HITTING and (only_holds(motion.scene, p) or only_holds(motion.scene, q)):
        meshes = _state_of_meshes(motion, body, partner, p, q, margin)
        if meshes == BEYOND_MARGIN:
            return n
        # Parts around meshes that are near to the last may be far from the meshes.
        if meshes == OPEN and (state == OPEN or _is_last(motion, body, partner)):
            _leave_meshes(motion, body, partner)
            return n
        state = meshes
    elif state == OPEN and motion.kind != STRAIGHT:
        # Samples of straight motions decide what doubles do not; other motions have none.
        _leave_meshes(motion, body, partner)
        return n
    has_space = top + n < motion.words[ITEM_CAPACITY] and state != HITTING
    at = ITEM * (top + n if has_space else motion.words[ITEM_CAPACITY])  # the last place is for names alone
    motion.items[at] = p
    motion.items[at + 1] = q
    motion.items[at + 2] = body
    motion.items[at + 3] = partner
    if state == HITTING:
        return -2
    return n + 1 if has_space else -1


@kernel
def _state_of_meshes(motion, body, partner, p, q, margin):
    """`state_of_meshes` of a pair as `_take` has it."""
    if body >= 0:
        return state_of_meshes(motion.scene, body, partner, p, q, margin)
    pair = view_i64(motion.scene.words[SELF_PAIRS_AT] + 16 * partner, 2)
    return state_of_meshes(motion.scene, pair[0], pair[1], p, q, margin)


@kernel
def _state(motion, p, q, body, partner, margin):
    """`state_of_parts` of a pair in the middle of the interval."""
    scene = motion.scene
    if body >= 0:
        place(scene, p, body)
    else:
        pair = view_i64(scene.words[SELF_PAIRS_AT] + 16 * partner, 2)
        place(scene, p, pair[0])
        place(scene, q, pair[1])
    return state_of_parts(scene, p, q, margin)


@kernel
def _pass_on(motion, first, n_items, top):
    """Write the pairs, from ``first`` on, not proven apart, from ``top`` on; returns as `_gather` does."""
    scene, words, items = motion.scene, motion.words, motion.items
    stride = words[PATH_STRIDE] + 1
    lengths = view_i64(words[PATH_LENGTHS_AT], scene.words[N_BODIES])
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * scene.words[N_SELF_PAIRS])
    n = 0
    for k in range(first, first + n_items):
        body = items[ITEM * k + 2]
        partner = items[ITEM * k + 3]
        if body >= 0:
            margin = motion.moved[body * stride + lengths[body]]
        else:
            margin = moved_between(motion, partner, pairs[2 * partner], pairs[2 * partner + 1])
        n = _take(motion, top, n, items[ITEM * k], items[ITEM * k + 1], body, partner, margin)
        if n < 0:
            return n
    return n


@kernel
def _leave_interval(motion, number, begin, end, top, n_items):
    """Append an open interval with the first of its pairs, or the pair without space; a continuation lengthens the last
    interval instead.

    Without space the interval is counted alone.
    """
    words = motion.words
    stride = words[OPEN_STRIDE]
    out = view_f64(words[OPEN_INTERVALS_AT], stride * words[OPEN_INTERVAL_CAPACITY])
    at = stride * words[N_OPEN_INTERVALS]
    if 0 < words[N_OPEN_INTERVALS] <= words[OPEN_INTERVAL_CAPACITY] and motion.kind != BOX_OF_CONFIGURATIONS:
        last = at - stride
        if out[last] == float(number) and out[last + 2] == begin:
            out[last + 2] = end
            return
    words[N_OPEN_INTERVALS] += 1
    if words[N_OPEN_INTERVALS] <= words[OPEN_INTERVAL_CAPACITY]:
        body, partner = _pair_left(motion, top, n_items)
        _put_open(motion, out, at, float(number), begin, end, body, partner)


@kernel
def _leave_meshes(motion, body, partner):
    """Append a pair of bodies, for a mesh query in the current interval; without space the pair is counted alone."""
    words = motion.words
    stride = words[OPEN_STRIDE]
    out = view_f64(words[MESH_PAIRS_AT], stride * words[MESH_PAIR_CAPACITY])
    at = stride * words[N_MESH_PAIRS]
    words[N_MESH_PAIRS] += 1
    if words[N_MESH_PAIRS] <= words[MESH_PAIR_CAPACITY]:
        current = motion.intervals
        number, begin, end = current[CURRENT + FIRST_ITEM], current[CURRENT + BEGIN], current[CURRENT + END]
        _put_open(motion, out, at, number, begin, end, body, partner)


@kernel(inline=True)
def _put_open(motion, out, at, number, begin, end, body, partner):
    """Write a row of OPEN_INTERVAL doubles, and behind it the cell at work where the motion is a box."""
    out[at] = number
    out[at + 1] = begin
    out[at + 2] = end
    out[at + 3] = float(body)
    out[at + 4] = float(partner)
    for j in range(motion.words[OPEN_STRIDE] - OPEN_INTERVAL):
        out[at + OPEN_INTERVAL + j] = motion.boxes[2 * motion.dof * MAX_INTERVALS + j]
