"""Pairs of facets near each other, posed, and their links.

Two pairs are linked where they share a corner on both bodies, or a facet on either and a corner on the other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.contact.contact_facets import posed_corner
from collide.kernels import kernel, view_f64, view_i64
from collide.mesh.triangle import triangle_at
from collide.narrowphase.facets.facets_within import INTS_OF_PAIR, MEETS, NUMBERS_OF_PAIR, unit_normal
from collide.numerics.vec3 import dot, put_vec3, vec3_at

# What a pair is, bits: its facets meet or nearly; it was told apart by a translation, or is in a patch; its nearest
# points are local minima; then what searches mark: where they start, what they may pass, what they reached; pairs of
# the translation in hand; and whether it is known that nearest points are local minima.
TOUCHING, COVERED, LEAST, SEED, PASSABLE, REACHED, WANTED, JUDGED = (1 << bit for bit in range(8))
# What is known of the last search: its number, and how many pairs it reached: those in the queue.
SEARCH, N_REACHED = range(2)

#: Most corners of an overlap of two facets, with what rounding may add: 3 and 3 corners, 9 crossings.
MAX_POINTS = 15

# Workspace, words a pair: of `ContactPairs`, in the order of its fields from `near` on.
_WORDS = (NUMBERS_OF_PAIR, INTS_OF_PAIR, 18, 6, 6, 9, 9, 10, 9, 1, 1, 1, 1, 2, 3, 1, 1, 1, 80)
WORDS_OF_PAIRS = sum(_WORDS)


class ContactPairs(NamedTuple):
    """n pairs of facets.

    near, facets : as `list_near_pairs` gives them.
    corners : of both facets (18), seen from A's origin.   normals : unit vectors (6), 0 of facets without area.
    ids : numbers of the corners (6).   keys : numbers of the pairs of corners (9): linked pairs share a key.
    by_key, key_starts : pairs at key after key, and where the pairs of each key begin.   seen_keys : the last search to
    visit each key.   states : bits.   groups : number of the translation separating the pair, or −1.
    queue, tried, search : of searches: pairs reached, the last search to look at each pair, SEARCH and N_REACHED.
    directions, slacks, gaps : of pairs apart, from A's nearest point to B's, its possible rounding, and its length in
    errors of a coordinate; infinite of other pairs.   order : numbers of pairs.
    table : of hashes.
    """

    n: int
    near: Any
    facets: Any
    corners: Any
    normals: Any
    ids: Any
    keys: Any
    by_key: Any
    key_starts: Any
    seen_keys: Any
    states: Any
    groups: Any
    queue: Any
    tried: Any
    search: Any
    directions: Any
    slacks: Any
    gaps: Any
    order: Any
    table: Any


@kernel
def open_pairs(words_at, capacity, n):
    """Views of the workspace for so many pairs."""
    at = words_at
    step = 8 * capacity
    near, facets = view_f64(at, 8 * capacity), view_i64(at + 8 * step, 3 * capacity)
    at += 11 * step
    corners, normals = view_f64(at, 18 * capacity), view_f64(at + 18 * step, 6 * capacity)
    at += 24 * step
    ids, keys = view_i64(at, 6 * capacity), view_i64(at + 6 * step, 9 * capacity)
    at += 15 * step
    by_key, key_starts = view_i64(at, 9 * capacity), view_i64(at + 9 * step, 10 * capacity)
    at += 19 * step
    seen_keys, states = view_i64(at, 9 * capacity), view_i64(at + 9 * step, capacity)
    at += 10 * step
    groups, queue = view_i64(at, capacity), view_i64(at + step, capacity)
    tried, search = view_i64(at + 2 * step, capacity), view_i64(at + 3 * step, 2)
    at += 5 * step
    directions, slacks = view_f64(at, 3 * capacity), view_f64(at + 3 * step, capacity)
    at += 4 * step
    gaps, order, table = view_f64(at, capacity), view_i64(at + step, capacity), view_i64(at + 2 * step, 80 * capacity)
    return ContactPairs(
        n, near, facets, corners, normals, ids, keys, by_key, key_starts, seen_keys, states, groups, queue, tried,
        search, directions, slacks, gaps, order, table,
    )


@kernel
def pose_pairs(pairs, first, A, B):
    """Fill in corners, normals and numbers of corners of pairs from ``first`` on; there was no search yet."""
    pairs.search[SEARCH] = 0
    pairs.search[N_REACHED] = 0
    for k in range(first, pairs.n):
        for side in range(2):
            # Pairs that follow each other mostly share a facet.
            at = INTS_OF_PAIR * k + side
            if k > first and pairs.facets[at] == pairs.facets[at - INTS_OF_PAIR]:
                _copy_facet(pairs, k - 1, k, side)
            elif side == 0:
                _pose_facet(pairs, k, 0, A)
            else:
                _pose_facet(pairs, k, 1, B)
        pairs.states[k] = 0
        pairs.tried[k] = 0
        pairs.groups[k] = -1


@kernel
def _pose_facet(pairs, k, side, body):
    facet = pairs.facets[INTS_OF_PAIR * k + side]
    place = int(body.places[facet])
    at = 18 * k + 9 * side
    for j in range(3):
        put_vec3(pairs.corners, at + 3 * j, posed_corner(body, place, j))
        pairs.ids[6 * k + 3 * side + j] = int(body.corners[3 * facet + j])
    put_vec3(pairs.normals, 6 * k + 3 * side, unit_normal(triangle_at(pairs.corners, at)))


@kernel(inline=True)
def _copy_facet(pairs, source, to, side):
    """Copy corners, normal and numbers of corners of a pair's facet from another pair."""
    for i in range(9):
        pairs.corners[18 * to + 9 * side + i] = pairs.corners[18 * source + 9 * side + i]
    for i in range(3):
        pairs.normals[6 * to + 3 * side + i] = pairs.normals[6 * source + 3 * side + i]
        pairs.ids[6 * to + 3 * side + i] = pairs.ids[6 * source + 3 * side + i]


@kernel
def move_pair(pairs, k, to):
    """Move a posed pair to number ``to``, marked as not searched."""
    for i in range(NUMBERS_OF_PAIR):
        pairs.near[NUMBERS_OF_PAIR * to + i] = pairs.near[NUMBERS_OF_PAIR * k + i]
    for i in range(INTS_OF_PAIR):
        pairs.facets[INTS_OF_PAIR * to + i] = pairs.facets[INTS_OF_PAIR * k + i]
    _copy_facet(pairs, k, to, 0)
    _copy_facet(pairs, k, to, 1)


@kernel(inline=True)
def pair_meets(pairs, k):
    return pairs.facets[INTS_OF_PAIR * k + MEETS] != 0


@kernel(inline=True)
def facing_a(pairs, k, nhat, A):
    """Cosine of A's facet with a direction; of an open surface the larger of its two sides' cosines."""
    cosine = dot(vec3_at(pairs.normals, 6 * k), nhat)
    return cosine if A.solid else abs(cosine)


@kernel(inline=True)
def facing_b(pairs, k, nhat, B):
    """Cosine of B's facet with the opposite direction."""
    cosine = -dot(vec3_at(pairs.normals, 6 * k + 3), nhat)
    return cosine if B.solid else abs(cosine)


# --- links --------------------------------------------------------------------------------------


@kernel
def clear_table(table, n_keys):
    """Make a table of hashes, two words an entry, empty for so many keys; its length less one."""
    size = 64
    while size < 2 * n_keys:
        size *= 2
    for k in range(size):
        table[2 * k] = -1
    return size - 1


@kernel(inline=True)
def slot_of(table, mask, key):
    """Where a key ≥ 0 stands in the table, or would."""
    mixed = (key ^ (key >> 21)) & 0x3FFFFFFF
    slot = ((mixed * 1540483477) >> 9) & mask
    while table[2 * slot] != -1 and table[2 * slot] != key:
        slot = (slot + 1) & mask
    return slot


@kernel
def link_pairs(pairs, n_corners_b):
    """Number the pairs of corners, and list the pairs of facets at each."""
    n, table, keys, starts = pairs.n, pairs.table, pairs.keys, pairs.key_starts
    mask = clear_table(table, 9 * n)
    n_keys = 0
    for k in range(n):
        for i in range(3):
            row = pairs.ids[6 * k + i] * n_corners_b
            for j in range(3):
                key = row + pairs.ids[6 * k + 3 + j]
                slot = slot_of(table, mask, key)
                if table[2 * slot] == -1:
                    table[2 * slot] = key
                    table[2 * slot + 1] = n_keys
                    starts[n_keys] = 0
                    pairs.seen_keys[n_keys] = 0
                    n_keys += 1
                number = table[2 * slot + 1]
                keys[9 * k + 3 * i + j] = number
                starts[number] += 1
    total = 0
    for number in range(n_keys):  # where those of a key end; filled from there backwards
        total += starts[number]
        starts[number] = total
    starts[n_keys] = total
    for k in range(n - 1, -1, -1):
        for i in range(9):
            number = keys[9 * k + i]
            starts[number] -= 1
            pairs.by_key[starts[number]] = k


@kernel
def begin_search(pairs):
    """Take the marks of the last search from what it reached; the number of the next."""
    for i in range(pairs.search[N_REACHED]):
        pairs.states[pairs.queue[i]] &= ~REACHED
    pairs.search[N_REACHED] = 0
    pairs.search[SEARCH] += 1
    return pairs.search[SEARCH]


@kernel
def spread(pairs):
    """Mark as REACHED all SEED pairs, and all PASSABLE pairs linked with them by chains of PASSABLE pairs."""
    number = begin_search(pairs)
    end = 0
    for k in range(pairs.n):
        if pairs.states[k] & SEED:
            pairs.states[k] |= REACHED
            pairs.queue[end] = k
            end += 1
    begin = 0
    while begin < end:
        k = pairs.queue[begin]
        begin += 1
        for i in range(9 * k, 9 * k + 9):
            key = pairs.keys[i]
            if pairs.seen_keys[key] == number:
                continue
            pairs.seen_keys[key] = number
            for at in range(pairs.key_starts[key], pairs.key_starts[key + 1]):
                linked = pairs.by_key[at]
                if pairs.states[linked] & REACHED == 0 and pairs.states[linked] & PASSABLE:
                    pairs.states[linked] |= REACHED
                    pairs.queue[end] = linked
                    end += 1
    pairs.search[N_REACHED] = end
