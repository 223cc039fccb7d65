"""The nearest pair of each configuration: signed distance, witness points, and the names of both bodies.

Growing limits are tried in sequence: near pairs are met first, and their distances bound the search. Every pair not
named by a search is farther apart than the limit. So only a row whose distance is within the limit ends the search:
a pair left to others may turn out far apart.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.narrowphase.rows import (
    BEYOND,
    BODY_B,
    CERTIFIED,
    DISTANCE,
    LOWER,
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
_LAST_LIMIT = 10.0
#: `a` of a row where there is no pair.
NONE = -1
BODY_A = BODY_B - 1


@entry("int64(int64, int64, int64, int64, int64, float64, int64, int64)")
def nearest_pairs(header_at, q_at, dof, first, n, max_distance, limits_at, rows_at):
    """Rows of PAIR_DTYPE, zeroed, of configurations from ``first`` on, of n; returns the first configuration not done.

    limits : (n,) the limit [m] to begin with, at most max_distance; then the limit searched last. Every other tested
        pair not left to others is farther apart than the limit, or at least as far apart as the row's pair.
    A row's ``a`` is a body, or NONE where no pair is known within the limit; ``b`` is another body, or −1 − the number
    of a body around. Pairs left to others may be nearer; a configuration with open pairs tries no larger limit.
    """
    scene = view_scene(header_at)
    words = scene.words
    q = view_f64(q_at, dof * n)
    limits = view_f64(limits_at, n)
    words[N_OPEN] = 0
    for k in range(first, n):
        n_open = words[N_OPEN]
        begin_configuration(scene, q, dof * k)
        row = view_row(rows_at + ROW * k)
        limit = limits[k]
        while True:
            words[N_OPEN] = n_open
            row.words[BODY_A] = NONE
            _find_nearest(scene, rows_at + ROW * k, k, limit)
            is_settled = row.words[BODY_A] != NONE and row.doubles[DISTANCE] <= limit
            if is_settled or words[N_OPEN] > n_open or limit >= max_distance:
                break
            limit = min(limit * GROWTH, max_distance) if limit < _LAST_LIMIT else max_distance
        limits[k] = limit
        if words[N_OPEN] > words[OPEN_CAPACITY]:
            words[N_OPEN] = n_open
            return k
    return n


@kernel(inline=True)
def _find_nearest(scene, row_at, number, limit):
    """Make the row at an address that of the nearest pair within the limit."""
    words = scene.words
    for body in range(words[N_BODIES]):
        at = BODY_INTS * body
        first = scene.bodies[at + FIRST] + words[PADDED]
        n = find_parts_around(scene, body, limit)
        for k in range(n):
            part = scene.candidates[k]
            around = body_of_part(scene, part)
            if is_allowed(scene, body, around):
                continue
            for p in range(first, first + scene.bodies[at + COUNT]):
                place(scene, p, body)
                limit = _take_nearer(scene, p, words[N_LINK_PARTS] + part, body, -1 - around, number, row_at, limit)
    pairs = view_i64(words[SELF_PAIRS_AT], 2 * words[N_SELF_PAIRS])
    for k in range(words[N_SELF_PAIRS]):
        a = pairs[2 * k]
        b = pairs[2 * k + 1]
        if not boxes_meet(scene, a, b, limit):
            continue
        first_a = scene.bodies[BODY_INTS * a + FIRST]
        first_b = scene.bodies[BODY_INTS * b + FIRST]
        for p in range(first_a, first_a + scene.bodies[BODY_INTS * a + COUNT]):
            place(scene, p, a)
            for r in range(first_b, first_b + scene.bodies[BODY_INTS * b + COUNT]):
                place(scene, r, b)
                limit = _take_nearer(scene, p, r, a, b, number, row_at, limit)


@kernel
def _take_nearer(scene, p, q, a, b, number, row_at, limit):
    """Copy the row of two parts of bodies a and b if nearer; returns the limit from then on [m].

    An undecided pair, or a pair with a part around a mesh, is left to others where possibly nearer. A rival (a row
    whose bracket overlaps the nearest row's) widens the row's bracket.
    """
    within = max(limit, 0.0)
    d = Vec3(0.0, 0.0, 0.0)
    if is_bounded(scene, p) and is_bounded(scene, q):
        d = sub(middle(scene, q), middle(scene, p))
        if boxes_are_apart(scene, p, q, d, within):
            return limit
    walk = walk_of(scene, q)
    is_walked = walk != 0 and is_bounded(scene, p)
    if is_walked:
        state, row = gap_of_field(scene, p, walk, within)
    else:
        row = ask(scene, p, q, d, False, within)
        state = OPEN if is_undecided_or_refused(row) else NEAR
    if state == OPEN:
        leave_open(scene, number, a, b, -math.inf)
        return limit
    if state == BEYOND_MARGIN or row.flags[BEYOND] != 0 or not row.doubles[LOWER] <= limit:
        return limit
    if only_holds(scene, p) or (not is_walked and only_holds(scene, q)):
        leave_open(scene, number, a, b, row.doubles[LOWER])
        return limit
    out = view_row(row_at)
    # The least distance of all is at least the least of the lower bounds, and at most the upper bound of any pair.
    lower = row.doubles[LOWER]
    is_certified = row.flags[CERTIFIED]
    is_first = out.words[BODY_A] == NONE
    if is_first or row.doubles[DISTANCE] < out.doubles[DISTANCE]:
        if not is_first and out.doubles[LOWER] <= row.doubles[UPPER]:
            lower = min(lower, out.doubles[LOWER])
            is_certified &= out.flags[CERTIFIED]
        copy_row(scene.words[ROW_AT], row_at)
        out.words[BODY_A] = a
        out.words[BODY_B] = b
    elif lower <= out.doubles[UPPER]:
        lower = min(lower, out.doubles[LOWER])
        is_certified &= out.flags[CERTIFIED]
    else:
        return limit
    out.doubles[LOWER] = lower
    out.flags[CERTIFIED] = is_certified
    return min(limit, out.doubles[UPPER]) if out.doubles[UPPER] > -math.inf else limit
