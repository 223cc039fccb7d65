"""Whether configurations collide: for each, links are placed, boxes compared, and pairs asked up to the first hit.

Surroundings come first, bodies from the hand to the base: the order of likely collisions.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.kernels.lanes import LANES
from collide.lowering.shape_table import POSE
from collide.robots.check_scene import (
    BODY_INTS,
    COUNT,
    FIRST,
    N_BODIES,
    N_LINK_PARTS,
    N_OPEN,
    N_SELF_PAIRS,
    OPEN_AT,
    OPEN_CAPACITY,
    OPEN_INTS,
    OPEN_LOWER,
    PADDED,
    SELF_PAIRS_AT,
    SPHERE_HEADER_AT,
    STAMP,
    body_of_part,
    boxes_meet,
    find_parts_around,
    is_allowed,
    place,
    put_world_boxes,
    twins_of_pair,
    view_scene,
)
from collide.robots.forward_kinematics import pose_links
from collide.robots.mesh_states import state_of_meshes
from collide.robots.part_pairs import HITTING, OPEN, state_of_parts
from collide.robots.sphere_lanes import (
    COLUMNS_AT,
    FEWEST,
    N_PAIRS,
    OPEN_PAIR,
    PAIR_CAPACITY,
    PAIRS_AT,
    VERDICTS_AT,
    check_eight,
    copy_links,
    view_spheres,
)

#: What is known of a configuration: free; it collides; free but for the pairs left to others.
IS_FREE, COLLIDES, IS_OPEN = range(3)


@entry("int64(int64, int64, int64, int64, int64, int64)")
def check_configurations(header_at, q_at, dof, first, n, verdicts_at):
    """Write verdicts, a byte each, of configurations from ``first`` on, of n; returns the first configuration not done.

    The kernel ends early once the pairs a configuration leaves to others exceed the workspace.
    """
    scene = view_scene(header_at)
    words = scene.words
    q = view_f64(q_at, dof * n)
    verdicts = view_u8(verdicts_at, n)
    words[N_OPEN] = 0
    begin = settled = first
    # A configuration leaves each pair of bodies to others once, and once more for what stands in between.
    for k in range(first, n):
        if k >= settled and words[SPHERE_HEADER_AT] != 0:
            begin = k
            settled = settle_eight(scene, q, dof, k, n)
            for j in range(k, settled):
                verdicts[j] = verdict_in_lane(scene, j - k)
        if k < settled and verdicts[k] != IS_OPEN:
            continue
        n_open = words[N_OPEN]
        verdicts[k] = verdict_among(scene, q, dof * k, k, k - begin, k < settled)
        if words[N_OPEN] > words[OPEN_CAPACITY]:
            words[N_OPEN] = n_open
            return k
        if verdicts[k] == COLLIDES:
            words[N_OPEN] = n_open
    return n


@kernel
def settle_eight(scene, q, dof, first, n):
    """Ask spheres about eight configurations from ``first`` on, of n; returns the first configuration not asked:
    ``first`` itself where too few remain.
    """
    spheres = view_spheres(scene, scene.words[SPHERE_HEADER_AT])
    count = min(n - first, LANES)
    if count < spheres.words[FEWEST]:
        return first
    columns = view_f64(spheres.words[COLUMNS_AT], LANES * dof)
    for lane in range(LANES):
        at = dof * (first + min(lane, count - 1))
        for j in range(dof):
            columns[LANES * j + lane] = q[at + j]
    check_eight(scene, spheres)
    return first + count


@kernel(inline=True)
def verdict_in_lane(scene, lane):
    """The verdict of spheres, IS_OPEN where they settle nothing."""
    spheres_at = scene.words[SPHERE_HEADER_AT]
    answers = view_f64(view_i64(spheres_at, VERDICTS_AT + 1)[VERDICTS_AT], 2 * LANES)
    return COLLIDES if answers[lane] != 0.0 else IS_OPEN if answers[LANES + lane] != 0.0 else IS_FREE


@kernel(inline=True)
def verdict_among(scene, q, at, number, lane, in_lanes):
    """`verdict_of`, or `verdict_after` where eight configurations were asked in lanes."""
    return verdict_after(scene, q, at, number, lane) if in_lanes else verdict_of(scene, q, at, number)


@kernel
def verdict_after(scene, q, at, number, lane):
    """`verdict_of` a configuration left open by spheres in a lane: pairs left open there are asked."""
    words = scene.words
    spheres = view_spheres(scene, words[SPHERE_HEADER_AT])
    if spheres.words[N_PAIRS] > spheres.words[PAIR_CAPACITY]:
        return verdict_of(scene, q, at, number)
    copy_links(scene, spheres, lane)
    pairs = view_i64(spheres.words[PAIRS_AT], OPEN_PAIR * spheres.words[N_PAIRS])
    verdict = IS_FREE
    for k in range(spheres.words[N_PAIRS]):
        if (pairs[OPEN_PAIR * k + 2] >> lane) & 1 == 0:
            continue
        a = pairs[OPEN_PAIR * k]
        b = pairs[OPEN_PAIR * k + 1]
        first = scene.bodies[BODY_INTS * a + FIRST]
        if b < 0:
            part = -1 - b
            around = -1 - body_of_part(scene, part)
            first += words[PADDED]
            state = _state_of_bodies(scene, number, a, first, around, words[N_LINK_PARTS] + part, 1)
        else:
            at_b = BODY_INTS * b
            state = _state_of_bodies(scene, number, a, first, b, scene.bodies[at_b + FIRST], scene.bodies[at_b + COUNT])
        if state == HITTING:
            return COLLIDES
        if state == OPEN:
            verdict = IS_OPEN
    return verdict


@kernel(inline=True)
def begin_configuration(scene, q, first):
    """Place links and boxes of bodies for the configuration at ``first`` of q."""
    scene.words[STAMP] += 1
    pose_links(scene.joints, q, first, scene.links, POSE)
    put_world_boxes(scene)


@kernel
def verdict_of(scene, q, at, number):
    """IS_FREE, COLLIDES or IS_OPEN of the configuration at ``at`` of q; pairs left to others name it by a number."""
    words = scene.words
    begin_configuration(scene, q, at)
    verdict = IS_FREE
    for body in range(words[N_BODIES]):
        n = find_parts_around(scene, body, 0.0)
        for k in range(n):
            part = scene.candidates[k]
            around = body_of_part(scene, part)
            if is_allowed(scene, body, around):
                continue
            first = scene.bodies[BODY_INTS * body + FIRST] + words[PADDED]
            state = _state_of_bodies(scene, number, body, first, -1 - around, words[N_LINK_PARTS] + part, 1)
            if state == HITTING:
                return COLLIDES
            if state == OPEN:
                verdict = IS_OPEN
    pairs = view_i64(words[SELF_PAIRS_AT], 2 * words[N_SELF_PAIRS])
    for k in range(words[N_SELF_PAIRS]):
        a = pairs[2 * k]
        b = pairs[2 * k + 1]
        if not boxes_meet(scene, a, b, 0.0):
            continue
        at_b = BODY_INTS * b
        twins = twins_of_pair(scene, a, b)
        first = scene.bodies[BODY_INTS * a + FIRST] + twins
        first_b = scene.bodies[at_b + FIRST] + twins
        state = _state_of_bodies(scene, number, a, first, b, first_b, scene.bodies[at_b + COUNT])
        if state == HITTING:
            return COLLIDES
        if state == OPEN:
            verdict = IS_OPEN
    return verdict


@kernel(inline=True)
def _state_of_bodies(scene, number, a, first_a, partner, first_b, n_b):
    """State of a's parts against the parts of its partner: HITTING, OPEN (and left to others), or neither.

    first_a : a's first part, padded or not.   partner : a body, or −1 − the number of a body around, whose parts are
        placed already.
    """
    for p in range(first_a, first_a + scene.bodies[BODY_INTS * a + COUNT]):
        place(scene, p, a)
        for r in range(first_b, first_b + n_b):
            if partner >= 0:
                place(scene, r, partner)
            state = state_of_parts(scene, p, r, 0.0)
            if state == HITTING:
                return HITTING
            if state == OPEN:
                state = state_of_meshes(scene, a, partner, p, r, 0.0)
                if state != OPEN:
                    return state if state == HITTING else 0
                leave_open(scene, number, a, partner, -math.inf)
                return OPEN
    return 0


@kernel(inline=True)
def leave_open(scene, number, body, partner, lower):
    """Append a pair of bodies, at least ``lower`` apart [m], to the pairs left to others.

    Without space N_OPEN counts the pair alone.
    """
    words = scene.words
    at = OPEN_INTS * words[N_OPEN]
    words[N_OPEN] += 1
    if words[N_OPEN] > words[OPEN_CAPACITY]:
        return
    out = view_i64(words[OPEN_AT], OPEN_INTS * words[OPEN_CAPACITY])
    out[at] = number
    out[at + 1] = body
    out[at + 2] = partner
    view_f64(words[OPEN_AT], OPEN_INTS * words[OPEN_CAPACITY])[at + OPEN_LOWER] = lower
