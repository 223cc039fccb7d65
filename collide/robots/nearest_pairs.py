"""The nearest pair of each configuration, or of each body of the robot, and all near pairs: signed distance, witness
points, and the numbers of both bodies.

Growing limits are tried in sequence: near pairs are met first, and their distances bound the search. Every pair not
named by a search is farther apart than the limit. So only a row whose distance is within the limit ends the search:
a pair left to others may turn out far apart.

A *slot* is a row being filled: of a configuration, of a body, or of a pair. A slot's reach is the limit for the next
two parts [m]: at first the limit of the search, then at most the upper bound of the slot's row. Parts proven farther
apart than the reach cannot lower the row's distance.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.narrowphase.rows import (
    BEYOND,
    BODY_B,
    CERTIFIED,
    DISTANCE,
    LOWER,
    PART_A,
    PART_B,
    ROW,
    UPPER,
    copy_row,
    is_undecided_or_refused,
    view_row,
)
from collide.numerics.vec3 import Vec3, sub
from collide.robots.check_configurations import begin_configuration, leave_open
from collide.robots.check_scene import (
    BODY_INTS,
    COUNT,
    FIRST,
    N_AROUND,
    N_BODIES,
    N_LINK_PARTS,
    N_OPEN,
    N_SELF_PAIRS,
    OPEN_CAPACITY,
    PADDED,
    ROW_AT,
    SELF_PAIRS_AT,
    body_of_part,
    boxes_meet,
    find_parts_around,
    is_allowed,
    place,
    twins_of_pair,
    view_scene,
)
from collide.robots.part_pairs import (
    BEYOND_MARGIN,
    NEAR,
    OPEN,
    ask,
    boxes_are_apart,
    gap_of_field,
    is_bounded,
    middle,
    only_holds,
    walk_of,
)

#: The first distance looked within [m], and by how much more each time.
FIRST_LIMIT, GROWTH = 0.05, 8.0
#: The largest that is tried before all pairs are.
LAST_LIMIT = 10.0
#: `a` of a row where there is no pair.
NONE = -1
BODY_A = BODY_B - 1

#: What a row is of.
OF_ROBOT, OF_BODY, OF_PAIR = range(3)
#: Between which bodies pairs are asked: bits.
WITH_AROUND, AMONG_ROBOT = 1, 2
# Words of a search: what a row is of; pairs between which bodies; slots of a configuration, or space for rows of pairs;
# reaches of slots; for each slot a byte, whether the slot has a tested pair; rows of pairs written so far; for each
# body around the slot of the last pair with it.
PER, BETWEEN, SLOTS, REACHES_AT, IS_ASKED_AT, N_ROWS, SLOT_OF_AT = range(7)
SEARCH = 7


class Search(NamedTuple):
    """Views of a search's words, of the reaches of slots [m], and the address of the first slot's row."""

    words: Any
    reaches: Any
    rows_at: Any


@entry("int64(int64, int64, int64, int64, int64, float64, int64, int64, int64)")
def nearest_pairs(header_at, q_at, dof, first, n, max_distance, limits_at, search_at, rows_at):
    """(n, SLOTS) rows of PAIR_DTYPE, zeroed, of configurations from ``first`` on, of n; returns the first configuration
    not done.

    limits : (n,) the limit [m] to begin with, at most max_distance; then the limit searched last. Every other tested
        pair not left to others is farther apart than the limit, or at least as far apart as the slot's pair.
    search : of OF_ROBOT, a slot a configuration, or of OF_BODY, a slot a body, filled by all pairs with the body.
    A row's ``a`` is a body, or NONE where no pair is known within the limit; ``b`` is another body, or −1 − the number
    of a body around; ``part_a`` and ``part_b`` are numbers of parts, NONE of a field. Pairs left to others may be
    nearer; a configuration with open pairs tries no larger limit.
    """
    scene = view_scene(header_at)
    words, search_words = scene.words, view_i64(search_at, SEARCH)
    n_slots = search_words[SLOTS]
    q, limits = view_f64(q_at, dof * n), view_f64(limits_at, n)
    words[N_OPEN] = 0
    for k in range(first, n):
        n_open = words[N_OPEN]
        begin_configuration(scene, q, dof * k)
        search = Search(search_words, view_f64(search_words[REACHES_AT], n_slots), rows_at + ROW * n_slots * k)
        limit = limits[k]
        _begin_slots(search, limit)
        while True:
            _fill_slots(scene, search, k, limit)
            if _are_settled(search, limit) or words[N_OPEN] > n_open or limit >= max_distance:
                break
            limit = min(limit * GROWTH, max_distance) if limit < LAST_LIMIT else max_distance
            _widen_slots(search, limit)
        limits[k] = limit
        if words[N_OPEN] > words[OPEN_CAPACITY]:
            words[N_OPEN] = n_open
            return k
    return n


@entry("int64(int64, int64, int64, int64, int64, float64, int64, int64, int64)")
def near_pairs(header_at, q_at, dof, first, n, limit, starts_at, search_at, rows_at):
    """Append rows of PAIR_DTYPE, of all pairs of bodies within a limit [m], of configurations from ``first`` on, of n;
    returns the first configuration not done: ``first`` itself where its pairs need more slots.

    starts : (n + 1,) rows of configuration k begin at starts[k], and end at starts[k + 1].   search : of OF_PAIR.
    The row of two bodies is of their nearest parts. Pairs left to others are to be asked for besides.
    """
    scene = view_scene(header_at)
    words, search_words = scene.words, view_i64(search_at, SEARCH)
    n_slots = search_words[SLOTS]
    search = Search(search_words, view_f64(search_words[REACHES_AT], n_slots), rows_at)
    q, starts = view_f64(q_at, dof * n), view_i64(starts_at, n + 1)
    slot_of = view_i64(search_words[SLOT_OF_AT], words[N_AROUND])
    for k in range(words[N_AROUND]):
        slot_of[k] = NONE
    words[N_OPEN] = 0
    search_words[N_ROWS] = 0
    starts[first] = 0
    for k in range(first, n):
        n_open = words[N_OPEN]
        begin_configuration(scene, q, dof * k)
        _fill_slots(scene, search, k, limit)
        if words[N_OPEN] > words[OPEN_CAPACITY] or search_words[N_ROWS] >= n_slots - 1:
            words[N_OPEN] = n_open
            return k
        starts[k + 1] = search_words[N_ROWS]
    return n


# --- slots ------------------------------------------------------------------------------------------


@kernel(inline=True)
def _row_of(search, slot):
    return view_row(search.rows_at + ROW * slot)


@kernel(inline=True)
def _begin_slots(search, limit):
    """All slots of a configuration are without a pair; a slot without tested pairs reaches nowhere."""
    n_slots = search.words[SLOTS]
    is_asked = view_u8(search.words[IS_ASKED_AT], n_slots)
    for slot in range(n_slots):
        _row_of(search, slot).words[BODY_A] = NONE
        search.reaches[slot] = limit if is_asked[slot] != 0 else -math.inf


@kernel(inline=True)
def _are_settled(search, limit):
    """Whether all slots are settled: slots with a pair within the limit reach nowhere from then on."""
    settled = True
    for slot in range(search.words[SLOTS]):
        row = _row_of(search, slot)
        if row.words[BODY_A] != NONE and row.doubles[DISTANCE] <= limit:
            search.reaches[slot] = -math.inf
        elif search.reaches[slot] > -math.inf:
            settled = False
    return settled


@kernel(inline=True)
def _widen_slots(search, limit):
    """Slots that reach anywhere begin again with a larger limit."""
    for slot in range(search.words[SLOTS]):
        if search.reaches[slot] > -math.inf:
            _row_of(search, slot).words[BODY_A] = NONE
            search.reaches[slot] = limit


@kernel(inline=True)
def _slot_of_pair(search, known, begin, limit):
    """``known``, the slot of a pair of bodies where that is a slot from ``begin`` on, else the next free slot."""
    if known >= begin:
        return known
    slot = search.words[N_ROWS]
    _row_of(search, slot).words[BODY_A] = NONE
    search.reaches[slot] = limit
    return slot


@kernel(inline=True)
def _take_slot(search, slot):
    """Whether a slot has a pair; the next free slot is then taken, but for the last, which stays free."""
    if _row_of(search, slot).words[BODY_A] == NONE:
        return False
    if slot == search.words[N_ROWS]:
        search.words[N_ROWS] = min(slot + 1, search.words[SLOTS] - 1)
    return True


# --- pairs ------------------------------------------------------------------------------------------


@kernel(inline=True)
def _fill_slots(scene, search, number, limit):
    """Ask the pairs of a configuration, by its number, that may be within the reach of their slots."""
    between = search.words[BETWEEN]
    if between & WITH_AROUND != 0:
        _fill_around(scene, search, number, limit)
    if between & AMONG_ROBOT != 0:
        _fill_among_robot(scene, search, number, limit)


@kernel(inline=True)
def _fill_around(scene, search, number, limit):
    words = scene.words
    per = search.words[PER]
    slot_of = view_i64(search.words[SLOT_OF_AT], words[N_AROUND])
    for body in range(words[N_BODIES]):
        at = BODY_INTS * body
        first = scene.bodies[at + FIRST] + words[PADDED]
        slot = body if per == OF_BODY else 0
        begin = search.words[N_ROWS]
        reach = limit if per == OF_PAIR else search.reaches[slot]
        n = find_parts_around(scene, body, reach) if reach > -math.inf else 0
        for k in range(n):
            part = scene.candidates[k]
            around = body_of_part(scene, part)
            if is_allowed(scene, body, around):
                continue
            if per == OF_PAIR:
                slot = _slot_of_pair(search, slot_of[around], begin, limit)
            for p in range(first, first + scene.bodies[at + COUNT]):
                place(scene, p, body)
                _ask_parts(scene, search, p, words[N_LINK_PARTS] + part, body, -1 - around, number, slot, NONE)
            if per == OF_PAIR and _take_slot(search, slot):
                slot_of[around] = slot


@kernel(inline=True)
def _fill_among_robot(scene, search, number, limit):
    words = scene.words
    per = search.words[PER]
    pairs = view_i64(words[SELF_PAIRS_AT], 2 * words[N_SELF_PAIRS])
    for k in range(words[N_SELF_PAIRS]):
        a = pairs[2 * k]
        b = pairs[2 * k + 1]
        slot, slot_b = 0, NONE
        if per == OF_BODY:
            slot, slot_b = a, b
        elif per == OF_PAIR:
            slot = _slot_of_pair(search, NONE, 0, limit)
        reach = _reach_of(search, slot, slot_b)
        if reach == -math.inf or not boxes_meet(scene, a, b, reach):
            continue
        twins = twins_of_pair(scene, a, b)
        first_a = scene.bodies[BODY_INTS * a + FIRST] + twins
        first_b = scene.bodies[BODY_INTS * b + FIRST] + twins
        for p in range(first_a, first_a + scene.bodies[BODY_INTS * a + COUNT]):
            place(scene, p, a)
            for r in range(first_b, first_b + scene.bodies[BODY_INTS * b + COUNT]):
                place(scene, r, b)
                _ask_parts(scene, search, p, r, a, b, number, slot, slot_b)
        if per == OF_PAIR:
            _take_slot(search, slot)


@kernel(inline=True)
def _reach_of(search, slot, slot_b):
    """The farther reach of two slots; ``slot_b`` may be NONE."""
    return search.reaches[slot] if slot_b == NONE else max(search.reaches[slot], search.reaches[slot_b])


@kernel
def _ask_parts(scene, search, p, q, a, b, number, slot, slot_b):
    """Put the row of two parts, of bodies a and b, into a slot, and into slot_b unless NONE, where nearer.

    An undecided pair, or a pair with a part around a mesh, is left to others where possibly nearer.
    """
    limit = _reach_of(search, slot, slot_b)
    within = max(limit, 0.0)
    d = Vec3(0.0, 0.0, 0.0)
    if is_bounded(scene, p) and is_bounded(scene, q):
        d = sub(middle(scene, q), middle(scene, p))
        if boxes_are_apart(scene, p, q, d, within):
            return
    walk = walk_of(scene, q)
    is_walked = walk != 0 and is_bounded(scene, p)
    if is_walked:
        state, row = gap_of_field(scene, p, walk, within)
    else:
        row = ask(scene, p, q, d, False, within)
        state = OPEN if is_undecided_or_refused(row) else NEAR
    if state == OPEN:
        leave_open(scene, number, a, b, -math.inf)
        return
    if state == BEYOND_MARGIN or row.flags[BEYOND] != 0 or not row.doubles[LOWER] <= limit:
        return
    if only_holds(scene, p) or (not is_walked and only_holds(scene, q)):
        leave_open(scene, number, a, b, row.doubles[LOWER])
        return
    row.words[PART_A], row.words[PART_B] = p, NONE if is_walked else q
    _put_nearer(scene, search, slot, a, b, row)
    if slot_b != NONE:
        _put_nearer(scene, search, slot_b, a, b, row)


@kernel
def _put_nearer(scene, search, slot, a, b, row):
    """The slot's row becomes the row of two parts, at ROW_AT, if nearer. A rival (a row whose bracket overlaps the
    nearest row's) widens the bracket.
    """
    reach = search.reaches[slot]
    if reach == -math.inf or not row.doubles[LOWER] <= reach:
        return
    out_at = search.rows_at + ROW * slot
    out = view_row(out_at)
    # The least distance of all is at least the least of the lower bounds, and at most the upper bound of any pair.
    lower = row.doubles[LOWER]
    is_certified = row.flags[CERTIFIED]
    is_first = out.words[BODY_A] == NONE
    if is_first or row.doubles[DISTANCE] < out.doubles[DISTANCE]:
        if not is_first and out.doubles[LOWER] <= row.doubles[UPPER]:
            lower = min(lower, out.doubles[LOWER])
            is_certified &= out.flags[CERTIFIED]
        copy_row(scene.words[ROW_AT], out_at)
        out.words[BODY_A] = a
        out.words[BODY_B] = b
    elif lower <= out.doubles[UPPER]:
        lower = min(lower, out.doubles[LOWER])
        is_certified &= out.flags[CERTIFIED]
    else:
        return
    out.doubles[LOWER] = lower
    out.flags[CERTIFIED] = is_certified
    if out.doubles[UPPER] > -math.inf:
        search.reaches[slot] = min(reach, out.doubles[UPPER])
