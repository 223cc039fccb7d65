"""Contacts of two bodies of facets at many pairs of poses: from matrices to rows inside one kernel.

Pairs of facets within reach (`facets_within.py`), patches of them (`contact_patches.py`), rows (`patch_rows.py`). What
only `distance` answers (bodies inside each other, overlaps too deep for a patch) is marked for Python to append.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.contact.candidate_normals import MAX_NORMALS, N_WAYS, TRANSLATION_WORDS, open_translations
from collide.contact.carrying_points import CELLS
from collide.contact.clearing_length import CLEARING_WORDS, Clearing, clearing_length
from collide.contact.contact_facets import open_facets
from collide.contact.contact_pairs import (
    MAX_POINTS,
    WORDS_OF_PAIRS,
    clear_table,
    link_pairs,
    move_pair,
    open_pairs,
    pose_pairs,
    slot_of,
)
from collide.contact.contact_patches import (
    DEEPEST,
    ContactFrame,
    Patch,
    cover_close,
    cover_patch,
    grow_gap,
    grow_overlap,
    least_gap_of,
    mark_touching,
    may_be_reached,
    need_nearest,
    next_minimum,
    next_seed,
    put_view,
    seed_group,
    set_directions,
    sort_by_gap,
)
from collide.contact.contact_points import PatchPoints
from collide.contact.manifold_points import POINT, ManifoldPoints
from collide.contact.patch_rows import CONTACT, PatchSpace, flip_row, put_patch
from collide.contact.reduce_patch import HullSpace, column_words
from collide.contact.shallow_overlaps import STEP_ERRORS, separate_pairs
from collide.contact.support_face import axes_across
from collide.kernels import entry, kernel, native_call, view_f64, view_i64, view_u8
from collide.mesh.bvh import INTS, N_FACETS, open_tree
from collide.narrowphase.facets import facets_within
from collide.narrowphase.facets.facets_within import (
    FACET_A,
    FACET_B,
    INTS_OF_PAIR,
    MEETS,
    N_LISTED,
    N_VIEWS,
    NUMBERS_OF_PAIR,
    STACKED,
    TWO_SIDES,
    VIEW,
    VIEWS_AT,
    world_error,
)
from collide.narrowphase.facets.mesh_collide_kernel import (
    APART,
    EXCHANGED,
    HEADER,
    HIT,
    SAME_BODY,
    PosedPair,
    Space,
    balls_farther_than,
    inside_state,
    open_pair,
    open_space,
)
from collide.narrowphase.facets.mesh_collide_kernel import SINGULAR as PLACES_NOTHING
from collide.narrowphase.facets.posed_surfaces import is_swapped_order, shift_between
from collide.narrowphase.facets.surface_collision import FULL
from collide.numerics.vec3 import Vec3, vec3_at

_list_pairs = native_call(facets_within.SIGNATURE)

# Header: that of `mesh_collide_kernel.py`, then addresses of both topologies, the longest separating translation (a
# double), the address of `list_near_pairs`, the workspace and how many pairs it is for, whether that is the most there
# may be, max_contacts; then what a call has done: poses, rows.
(
    TOPOLOGY_A, TOPOLOGY_B, LIMIT, NEAR_CODE, WORDS_AT, CAPACITY, IS_LARGEST, MAX_CONTACTS, POSES_DONE, ROWS_DONE,
) = range(HEADER, HEADER + 10)
CONTACT_HEADER = HEADER + 10
#: Why a call ended: all is done; no place for rows; none for pairs; more pairs than may be looked at; a matrix that
#: places no mesh.
DONE, ROWS_FULL, PAIRS_FULL, TOO_MANY, SINGULAR = range(5)
#: Words of one set of points, a pair; of all that does not grow with them.
_WORDS_OF_POINTS = MAX_POINTS * (POINT + 4)
_WORDS_OF_HULL = 4 * MAX_POINTS
#: Pairs are compared one by one with translations where these are no more.
_MAX_WAYS = 8
_WORDS_OF_VIEWS = VIEWS_AT + VIEW * _MAX_WAYS
_FIXED_WORDS = TRANSLATION_WORDS + CLEARING_WORDS + 18 + 8 + _WORDS_OF_VIEWS + CELLS
#: Integers that are kept of a pair while more are listed: those of the list, and its group.
_KNOWN = INTS_OF_PAIR + 1


def workspace_words(capacity: int) -> int:
    """64-bit words the kernel works in, for so many pairs of facets."""
    each = WORDS_OF_PAIRS + 2 * _WORDS_OF_POINTS + _WORDS_OF_HULL + MAX_NORMALS
    return each * capacity + _FIXED_WORDS + column_words(MAX_POINTS * capacity)


class _Task(NamedTuple):
    """Two bodies at their poses, in working order, with workspace and limits.

    space : of the traversals.   topology_a, topology_b : addresses.   limit : of separating translations [m].
    margin : [m].   error : of a coordinate [m].   words_at, capacity : the workspace, and its pairs at most.
    is_largest : no workspace is larger.   near_code : address of `list_near_pairs`.
    """

    pair: PosedPair
    space: Space
    topology_a: int
    topology_b: int
    limit: float
    margin: float
    error: float
    words_at: int
    capacity: int
    is_largest: bool
    near_code: int


@kernel
def _open_points(words_at, capacity, seen_at):
    """`PatchPoints` on the workspace."""
    n = MAX_POINTS * capacity
    manifold = ManifoldPoints(view_f64(words_at, POINT * n), view_i64(words_at + 8 * POINT * n, 2 * n))
    at = words_at + 8 * (POINT + 2) * n
    return PatchPoints(manifold, view_f64(at, n), view_i64(at + 8 * n, n), view_f64(seen_at, 18))


@kernel(inline=True)
def _after_pairs(task, words_a_pair):
    """Address behind so many words a pair of facets."""
    return task.words_at + 8 * (WORDS_OF_PAIRS + words_a_pair) * task.capacity


@kernel(inline=True)
def _fixed_at(task):
    return _after_pairs(task, 2 * _WORDS_OF_POINTS + _WORDS_OF_HULL + MAX_NORMALS)


@kernel
def _open_frame(task, n):
    """The `ContactFrame` of n pairs that are listed."""
    pair = task.pair
    shift = shift_between(view_f64(pair.XA_at, 16), view_f64(pair.XB_at, 16))
    A = open_facets(pair.A, task.topology_a, pair.XA_at, Vec3(0.0, 0.0, 0.0))
    B = open_facets(pair.B, task.topology_b, pair.XB_at, shift)
    seen_at = _fixed_at(task) + 8 * (TRANSLATION_WORDS + CLEARING_WORDS)
    points = _open_points(_after_pairs(task, 0), task.capacity, seen_at)
    pairs = open_pairs(task.words_at, task.capacity, n)
    pose_pairs(pairs, 0, A, B)
    return ContactFrame(pairs, A, B, task.error, _reach_of(task), points)


@kernel(inline=True)
def _reach_of(task):
    """How far apart facets may be that are listed [m]."""
    reach = task.margin + task.pair.A.radius + task.pair.B.radius
    return reach + STEP_ERRORS * task.error if reach > 0.0 else reach


@kernel
def _open_rows(task, max_contacts, out_at, capacity):
    """The `PatchSpace` of a task."""
    seen_at = _fixed_at(task) + 8 * (TRANSLATION_WORDS + CLEARING_WORDS)
    target = _open_points(_after_pairs(task, _WORDS_OF_POINTS), task.capacity, seen_at)
    numbers_at = _after_pairs(task, 2 * _WORDS_OF_POINTS)
    n = MAX_POINTS * task.capacity
    cells_at = _fixed_at(task) + 8 * (_FIXED_WORDS - CELLS)
    hull = HullSpace(
        view_i64(numbers_at, n), view_i64(numbers_at + 8 * n, n), view_i64(numbers_at + 16 * n, n),
        view_i64(numbers_at + 24 * n, n), view_i64(cells_at, CELLS), cells_at + 8 * CELLS,
    )
    X = view_f64(task.pair.XA_at, 16)
    return PatchSpace(target, hull, Vec3(X[3], X[7], X[11]), out_at, capacity, max_contacts, task.margin)


@kernel
def _open_clearing(task):
    pair, space = task.pair, task.space
    return Clearing(
        pair.A.tree_at, pair.B.tree_at, pair.XA_at, pair.XB_at, space.exact, space.doubles_at, space.integers_at,
        _fixed_at(task) + 8 * TRANSLATION_WORDS, pair.A.radius + pair.B.radius, task.error,
    )


SIGNATURE = "int64(int64, int64, int64, int64, int64, int64, float64, int64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def facet_manifolds(
    header_at, XA_at, step_a, XB_at, step_b, n, margin, slack_at, out_at, capacity, ends_at, lacks_at
):
    """Contacts at pairs of poses from header[POSES_DONE] on, of n; returns why the kernel ended.

    XA, XB : checked matrices; step 16 or, for a single pose, 0.   margin : [m].
    slack : 0, or a double a pose, added to the margin.   out : `CONTACT_DTYPE`, zeroed, ``capacity`` rows,
    filled from header[ROWS_DONE] on.   ends : where the contacts of each pose end.
    lacks : a byte a pose: the row of `distance` is to be added, perhaps as the only row.

    Twelve arguments: called by Python and `facet_contact_call.py`, with integers and doubles alone.
    """
    header = view_i64(header_at, CONTACT_HEADER)
    ends, lacks = view_i64(ends_at, n), view_u8(lacks_at, n)
    for k in range(header[POSES_DONE], n):
        slack = view_f64(slack_at + 8 * k, 1)[0] if slack_at != 0 else 0.0
        first = header[ROWS_DONE]
        pose_a, pose_b = XA_at + 8 * step_a * k, XB_at + 8 * step_b * k
        status, n_rows, is_deep = _contacts_at(header_at, pose_a, pose_b, margin + slack, out_at, capacity, first)
        if status != DONE:
            return status
        ends[k] = n_rows
        lacks[k] = 1 if is_deep else 0
        header[ROWS_DONE] = n_rows
        header[POSES_DONE] = k + 1
    return DONE


@kernel
def _contacts_at(header_at, XA_at, XB_at, margin, out_at, capacity, first):
    """(status, rows then, whether a row of `distance` is lacking) of one pair of poses.

    Bodies are worked on in the order of their contents, equal bodies in the order of their poses: swapped questions
    give the same numbers.
    """
    words = view_i64(header_at, CONTACT_HEADER)
    exchanged = words[EXCHANGED] != 0
    pair = open_pair(header_at, XA_at, XB_at, exchanged)
    topology_a, topology_b = words[TOPOLOGY_A], words[TOPOLOGY_B]
    if words[SAME_BODY] != 0 and is_swapped_order(view_f64(pair.XA_at, 12), view_f64(pair.XB_at, 12)):
        pair = PosedPair(pair.B, pair.A, pair.XB_at, pair.XA_at, pair.same_tree)
        topology_a, topology_b = topology_b, topology_a
        exchanged = not exchanged
    error = world_error(
        open_tree(pair.A.tree_at), view_f64(pair.XA_at, 16), open_tree(pair.B.tree_at), view_f64(pair.XB_at, 16)
    )
    task = _Task(
        pair, open_space(header_at), topology_a, topology_b, view_f64(header_at + 8 * LIMIT, 1)[0], margin, error,
        words[WORDS_AT], words[CAPACITY], words[IS_LARGEST] != 0, words[NEAR_CODE],
    )
    if balls_farther_than(pair, _reach_of(task)):
        return DONE, first, False
    rows = _open_rows(task, words[MAX_CONTACTS], out_at, capacity)
    status, n_rows, is_deep = _put_contacts(task, rows, first)
    if exchanged and status == DONE:
        for k in range(first, n_rows):
            flip_row(out_at + CONTACT * k)
    return status, n_rows, is_deep


@kernel
def _list(task, reach, measures, views_at):
    """(DONE, PAIRS_FULL, TOO_MANY or SINGULAR, how many pairs): facets within reach, into the workspace.

    measures, views : as of `list_near_pairs`.
    """
    pair, space = task.pair, task.space
    n = _list_pairs(
        task.near_code,
        (
            pair.A.tree_at, pair.B.tree_at, pair.XA_at, pair.XB_at, reach, task.words_at,
            task.words_at + 8 * NUMBERS_OF_PAIR * task.capacity, task.capacity, space.stack_at, space.n_stack,
            space.doubles_at, space.integers_at, space.exact, measures, views_at,
        ),
    )
    if n >= 0:
        return DONE, n
    if n != -FULL:
        return SINGULAR, 0
    return (TOO_MANY if task.is_largest else PAIRS_FULL), 0


@kernel
def _put_contacts(task, rows, first):
    """(status, rows then, whether a row of `distance` is lacking) of bodies that may be within the margin."""
    reach = _reach_of(task)
    status, n = _list(task, reach, True, 0)
    if status == TOO_MANY and reach == 0.0:
        return DONE, first, True
    if status != DONE:
        return status, first, False
    frame = _open_frame(task, n)
    n_touching, n_meeting = mark_touching(frame)
    if n_meeting == 0:
        state = _inside(task)
        if state == PLACES_NOTHING:
            return SINGULAR, first, False
        if state == HIT or n == 0 or reach == 0.0:  # without a pair that meets: apart, be it by less than rounding
            return DONE, first, state == HIT
    ways_at = _fixed_at(task)
    depths_at = _after_pairs(task, 2 * _WORDS_OF_POINTS + _WORDS_OF_HULL)
    ways = open_translations(ways_at, depths_at, task.capacity)
    is_deep = False
    link_pairs(frame.pairs, frame.B.n_corners)
    if n_touching > 0:
        is_deep = separate_pairs(frame.pairs, frame.A, frame.B, task.error, task.limit, ways, frame.points)
        farthest = 0.0
        for i in range(ways.counts[N_WAYS]):
            farthest = max(farthest, DEEPEST * ways.lengths[i])
        if farthest > reach:
            status, frame = _list_wider(task, frame, ways, farthest)
            if status == TOO_MANY:
                return DONE, first, True
            if status != DONE:
                return status, first, False
    else:
        ways.counts[N_WAYS] = 0
    return _put_patches(frame, ways, rows, _open_clearing(task), first, is_deep)


@kernel
def _inside(task):
    """HIT where a point of a part of one body lies inside the other; else APART or SINGULAR."""
    pair, space = task.pair, task.space
    state = inside_state(space, pair.A, pair.XA_at, pair.B, pair.XB_at, 0)
    if state == APART:
        state = inside_state(space, pair.B, pair.XB_at, pair.A, pair.XA_at, 0)
    return state


@kernel
def _list_wider(task, frame, ways, reach):
    """(status, frame) with all pairs within a larger reach, as far as a translation's patch may reach them.

    Pairs listed before keep their states; new pairs are not measured: all pairs in contact, or within the margin, are
    among the old. The list is thinned out whenever the workspace is full.
    """
    before, numbers, integers = frame.pairs, frame.points.manifold.points, frame.points.pairs
    n_before = before.n
    for k in range(n_before):
        for i in range(NUMBERS_OF_PAIR):
            numbers[NUMBERS_OF_PAIR * k + i] = before.near[NUMBERS_OF_PAIR * k + i]
        for i in range(INTS_OF_PAIR):
            integers[_KNOWN * k + i] = before.facets[INTS_OF_PAIR * k + i]
        integers[_KNOWN * k + INTS_OF_PAIR] = before.groups[k]
    n_facets_b = view_i64(task.pair.B.tree_at, INTS)[N_FACETS]
    mask = clear_table(before.table, n_before)
    for i in range(n_before):
        key = integers[_KNOWN * i + FACET_A] * n_facets_b + integers[_KNOWN * i + FACET_B]
        slot = slot_of(before.table, mask, key)
        before.table[2 * slot] = key
        before.table[2 * slot + 1] = i
    views_at = _fixed_at(task) + 8 * (_FIXED_WORDS - CELLS - _WORDS_OF_VIEWS)
    n_views = ways.counts[N_WAYS] if ways.counts[N_WAYS] <= _MAX_WAYS else 0
    words, views = view_i64(views_at, VIEWS_AT), view_f64(views_at + 8 * VIEWS_AT, VIEW * n_views)
    words[N_VIEWS], words[STACKED], words[N_LISTED] = n_views, 0, 0
    words[TWO_SIDES] = (0 if frame.A.solid else 1) | (0 if frame.B.solid else 2)
    for i in range(n_views):
        put_view(frame, axes_across(vec3_at(ways.ways, 3 * i)), ways.lengths[i], views, VIEW * i)
    n_kept, n_known = 0, 0
    while True:
        status, _ = _list(task, reach, False, views_at)
        if status == SINGULAR:
            return status, frame
        pairs = open_pairs(task.words_at, task.capacity, words[N_LISTED])
        pose_pairs(pairs, n_kept, frame.A, frame.B)
        wide = ContactFrame(pairs, frame.A, frame.B, frame.error, frame.reach, frame.points)
        for k in range(n_kept, pairs.n):
            key = pairs.facets[INTS_OF_PAIR * k + FACET_A] * n_facets_b + pairs.facets[INTS_OF_PAIR * k + FACET_B]
            slot = slot_of(pairs.table, mask, key)
            is_known = pairs.table[2 * slot] == key
            if not (is_known or _may_be_in_a_patch(wide, ways, k)):
                continue
            if n_kept < k:
                move_pair(pairs, k, n_kept)
            if is_known:
                i = pairs.table[2 * slot + 1]
                for j in range(NUMBERS_OF_PAIR):
                    pairs.near[NUMBERS_OF_PAIR * n_kept + j] = numbers[NUMBERS_OF_PAIR * i + j]
                pairs.facets[INTS_OF_PAIR * n_kept + MEETS] = integers[_KNOWN * i + MEETS]
                pairs.groups[n_kept] = integers[_KNOWN * i + INTS_OF_PAIR]
                n_known += 1
            n_kept += 1
        words[N_LISTED] = n_kept
        if status == DONE:
            if n_known == n_before or words[N_VIEWS] == 0:
                break
            # Nearest points that came out badly: a pair farther apart is listed at first. It is kept as well.
            words[N_VIEWS], words[N_LISTED], n_kept, n_known = 0, 0, 0, 0
        elif 8 * (task.capacity - n_kept) < task.capacity:
            return status, frame
    pairs = open_pairs(task.words_at, task.capacity, n_kept)
    link_pairs(pairs, frame.B.n_corners)
    return DONE, ContactFrame(pairs, frame.A, frame.B, frame.error, frame.reach, frame.points)


@kernel
def _may_be_in_a_patch(frame, ways, k):
    """Whether a pair that was not listed at first may be in the patch of a translation."""
    n_ways = ways.counts[N_WAYS]
    if n_ways > _MAX_WAYS:
        return True
    for i in range(n_ways):
        if may_be_reached(frame, k, axes_across(vec3_at(ways.ways, 3 * i)), ways.lengths[i]):
            return True
    return False


@kernel
def _put_patches(frame, ways, rows, clearing, first, is_deep):
    """The rows of pairs that are listed, posed, linked and grouped."""
    cover_close(frame)
    n_apart = set_directions(frame)
    n_rows, number = first, 0
    for i in range(ways.counts[N_WAYS]):
        axes = axes_across(vec3_at(ways.ways, 3 * i))
        seed_group(frame, i)
        seed = next_seed(frame, 0)
        while seed >= 0:
            patch = grow_overlap(frame, seed, axes, ways.lengths[i])
            if patch.n > 0:
                n_rows = _put_patch(frame, patch, rows, clearing, number, n_rows)
                if n_rows < 0:
                    return ROWS_FULL, first, False
                number += 1
            else:
                is_deep = is_deep or patch.meets
            seed = next_seed(frame, seed)
    n_apart = sort_by_gap(frame, n_apart)
    if number == 0:
        need_nearest(frame, n_apart)
    start = next_minimum(frame, 0, n_apart)
    while start < n_apart:
        patch = grow_gap(frame, frame.pairs.order[start])
        depth = clearing.radius - least_gap_of(frame.points, patch.n)
        n_rows = _put_patch(frame, Patch(patch.axes, patch.n, depth >= 0.0), rows, clearing, number, n_rows)
        if n_rows < 0:
            return ROWS_FULL, first, False
        number += 1
        start = next_minimum(frame, start, n_apart)
    return DONE, n_rows, is_deep or number == 0


@kernel
def _put_patch(frame, patch, rows, clearing, number, n_rows):
    """Append the rows of a patch and cover its REACHED pairs, so that they start no others; returns the new number of
    rows, −1 where they do not fit.
    """
    apart = 0.0
    if patch.meets or clearing.radius - least_gap_of(frame.points, patch.n) >= 0.0:
        depth = clearing.radius - least_gap_of(frame.points, patch.n)
        apart = clearing_length(frame.pairs, frame.A, frame.B, patch.axes, depth, clearing, frame.points.seen)
    cover_patch(frame, patch.axes.nhat)
    return put_patch(frame, patch, apart, number, rows, n_rows)
