"""Straight motions between configurations, proven free: distances at some, and how far anything moves in between.

In the middle of an interval every pair of parts is asked whether it is farther apart than both can move within half of
it. Pairs that are, are done with; those that are not are asked again in both halves of the interval. A pair that meets
ends the search: the motion collides there.

How far a point moves: within joint j's parent frame at most D_j = D + δ_j (ρ_j + D), where D is what joints beyond j
move it by, δ_j by how much the joint turns, and ρ_j the point's greatest distance from its axis in the middle: on the
way it is at most ρ_j + D away, and a chord is no longer than its arc. (Schwarzer, Saha and Latombe, "Exact collision
checking of robot paths", 2002, bound motions so by the longest a link can reach; here by where it is.)
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE
from collide.numerics.vec3 import Vec3, cross, dot, norm, rotate, sub, vec3_at
from collide.robots.check_configurations import begin_configuration
from collide.robots.check_scene import (
    BODY_INTS,
    BOX,
    COUNT,
    FIRST,
    HALF,
    LINK,
    N_BODIES,
    N_LINK_PARTS,
    N_SELF_PAIRS,
    PADDED,
    SELF_PAIRS_AT,
    body_of_part,
    boxes_meet,
    find_parts_around,
    is_allowed,
    place,
    view_scene,
)
from collide.robots.forward_kinematics import (
    AXIS,
    CHILD,
    COLUMN,
    FLOATING,
    JOINT_DOUBLES,
    JOINT_INTS,
    KIND,
    MULTIPLIER,
    PLANAR,
    TRANSLATION,
)
from collide.robots.part_pairs import BEYOND_MARGIN, HITTING, state_of_parts

# Header of motions. For each body its joints that move, from the link to the root, and how many; for each pair of
# bodies tested, how many of each one's joints stand between them; how many places a body has for joints.
(
    PATHS_AT, PATH_LENGTHS_AT, BETWEEN_AT, PATH_STRIDE,
    # workspace: a configuration; how far each body may move, joint by joint; intervals; pairs left in them, how many
    # there may be
    CONFIGURATION_AT, MOVED_AT, INTERVALS_AT, ITEMS_AT, ITEM_CAPACITY,
    # intervals that stay open: where they are written, for how many, how many there are
    OPEN_INTERVALS_AT, OPEN_INTERVAL_CAPACITY, N_OPEN_INTERVALS, N_CHECKED,
    # two doubles: intervals no longer than this are not halved [rad or m, of the column that moves by most]; how far
    # a link may be off by rounding [m]
    RESOLUTION, ROUNDING,
) = range(15)  # fmt: skip
MOTION_HEADER = 15
#: Doubles of an interval on the stack: where it begins and ends, the first of its pairs and how many, −1 for all there
#: are.
BEGIN, END, FIRST_ITEM, N_ITEMS = range(4)
INTERVAL = 4
#: Intervals on the stack: one more with every halving.
MAX_INTERVALS = 64
#: Integers of a pair of parts: both, and the pair of bodies: a body and −1 − a body around, or −1 and a tested pair.
ITEM = 4
#: Doubles of an interval that stays open: motion, begin, end, body, partner (as pairs left to others name it).
OPEN_INTERVAL = 5
#: What is known of a motion: proven free; it collides; parts of it stay open.
IS_PROVEN, COLLIDES_AT, STAYS_OPEN = range(3)


class Motion(NamedTuple):
    """One straight motion, and the workspace.

    q0, q1 : views of both ends, from ``at`` on.   max_change : by how much the column moves that moves by most.
    """

    scene: Any
    words: Any
    q0: Any
    q1: Any
    at: int
    dof: int
    q: Any
    moved: Any
    intervals: Any
    items: Any
    resolution: float
    rounding: float
    max_change: float


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def certify_motions(header_at, motions_at, q0_at, q1_at, dof, first, n, verdicts_at, times_at):
    """Verdicts, a byte each, of motions from ``first`` on, of n, and the times of collisions; the first one without.

    It ends early where there may be no space for the intervals of one more that stay open.
    """
    scene = view_scene(header_at)
    words = view_i64(motions_at, MOTION_HEADER)
    settings = view_f64(motions_at + 8 * RESOLUTION, 2)
    q0, q1 = view_f64(q0_at, dof * n), view_f64(q1_at, dof * n)
    verdicts, times = view_u8(verdicts_at, n), view_f64(times_at, n)
    words[N_OPEN_INTERVALS] = 0
    for k in range(first, n):
        max_change = 0.0
        for j in range(dof):
            max_change = max(max_change, abs(q1[dof * k + j] - q0[dof * k + j]))
        motion = Motion(
            scene, words, q0, q1, dof * k, dof, view_f64(words[CONFIGURATION_AT], dof),
            view_f64(words[MOVED_AT], scene.words[N_BODIES] * (words[PATH_STRIDE] + 1)),
            view_f64(words[INTERVALS_AT], INTERVAL * MAX_INTERVALS),
            view_i64(words[ITEMS_AT], ITEM * words[ITEM_CAPACITY]), settings[0], settings[1], max_change,
        )  # fmt: skip
        n_open = words[N_OPEN_INTERVALS]
        verdict, time = _certify(motion, k)
        if words[N_OPEN_INTERVALS] > words[OPEN_INTERVAL_CAPACITY]:
            words[N_OPEN_INTERVALS] = n_open
            return k
        if verdict == COLLIDES_AT:
            words[N_OPEN_INTERVALS] = n_open
        verdicts[k] = verdict
        times[k] = time
    return n


@kernel
def _certify(motion, number):
    """(verdict, time of a collision or NaN) of one motion."""
    intervals = motion.intervals
    verdict = IS_PROVEN
    n_stack = 1
    _push(intervals, 0, 0.0, 1.0, 0.0, -1.0)
    while n_stack > 0:
        n_stack -= 1
        at = INTERVAL * n_stack
        begin = intervals[at + BEGIN]
        end = intervals[at + END]
        first = int(intervals[at + FIRST_ITEM])
        n_items = int(intervals[at + N_ITEMS])
        time = 0.5 * (begin + end)
        _begin_interval(motion, time, 0.5 * (end - begin))
        top = first if n_items < 0 else first + n_items
        state = _gather(motion, top) if n_items < 0 else _pass_on(motion, first, n_items, top)
        if state == -2:
            return COLLIDES_AT, time
        if state == 0:
            continue
        if motion.max_change * (end - begin) <= motion.resolution or n_stack + 2 > MAX_INTERVALS:
            verdict = STAYS_OPEN
            _leave_interval(motion, number, begin, end, top, state)
            continue
        # Both halves read the same pairs; what the left one keeps stands beyond them, and is gone when the right one
        # begins.
        _push(intervals, n_stack, time, end, float(top), float(state))
        _push(intervals, n_stack + 1, begin, time, float(top), float(state))
        n_stack += 2
    return verdict, math.nan


@kernel(inline=True)
def _push(intervals, k, begin, end, first, n_items):
    at = INTERVAL * k
    intervals[at + BEGIN] = begin
    intervals[at + END] = end
    intervals[at + FIRST_ITEM] = first
    intervals[at + N_ITEMS] = n_items


@kernel(inline=True)
def _begin_interval(motion, time, half):
    """Place links for the middle of an interval, and bound how far bodies move within half of it."""
    for j in range(motion.dof):
        a = motion.q0[motion.at + j]
        b = motion.q1[motion.at + j]
        motion.q[j] = a + time * (b - a)
    motion.words[N_CHECKED] += 1
    begin_configuration(motion.scene, motion.q, 0)
    for body in range(motion.scene.words[N_BODIES]):
        _bound_motion(motion, body, half)


@kernel
def _bound_motion(motion, body, half):
    """Write how far any point of a body moves within half an interval: behind its first joint, its first two, ….

    Joints are counted from the body's own link to the root.
    """
    scene, words = motion.scene, motion.words
    stride = words[PATH_STRIDE]
    path = view_i64(words[PATHS_AT] + 8 * body * stride, stride)
    n = view_i64(words[PATH_LENGTHS_AT], body + 1)[body]
    out = body * (stride + 1)
    link = POSE * scene.bodies[BODY_INTS * body + LINK]
    centre = rotate(scene.links, link, vec3_at(scene.body_boxes, BOX * body))
    p_WL = vec3_at(scene.links, link + 9)
    c = Vec3(centre.x + p_WL.x, centre.y + p_WL.y, centre.z + p_WL.z)
    radius = norm(vec3_at(scene.body_boxes, BOX * body + HALF)) * (1.0 + scene.slack) + motion.rounding
    moved = motion.rounding
    motion.moved[out] = moved
    for k in range(n):
        moved += _moved_by_joint(motion, path[k], c, radius, moved, half)
        moved *= 1.0 + scene.slack
        motion.moved[out + k + 1] = moved


@kernel(inline=True)
def _moved_by_joint(motion, joint, c, radius, moved, half):
    """How far a joint moves points of a ball about c that joints beyond it move by ``moved``."""
    joints, links = motion.scene.joints, motion.scene.links
    at = JOINT_DOUBLES * joint
    kind = joints.ints[JOINT_INTS * joint + KIND]
    child = POSE * joints.ints[JOINT_INTS * joint + CHILD]
    column = joints.ints[JOINT_INTS * joint + COLUMN]
    angle = _change(motion, column) * abs(joints.doubles[at + MULTIPLIER]) * half
    if kind == TRANSLATION:
        return angle
    arm = sub(c, vec3_at(links, child + 9))
    if kind == FLOATING:
        shift = _change(motion, column) + _change(motion, column + 1) + _change(motion, column + 2)
        angle = _change(motion, column + 3) + _change(motion, column + 4) + _change(motion, column + 5)
        return half * (shift + angle * (norm(arm) + radius + moved + half * shift))
    shift = 0.0
    if kind == PLANAR:
        shift = half * (_change(motion, column) + _change(motion, column + 1))
        angle = half * _change(motion, column + 2)
    axis = rotate(links, child, vec3_at(joints.doubles, at + AXIS))
    across = cross(arm, axis)
    return shift + angle * (math.sqrt(dot(across, across)) + radius + moved + shift)


@kernel(inline=True)
def _change(motion, column):
    return abs(motion.q1[motion.at + column] - motion.q0[motion.at + column])


@kernel
def _gather(motion, top):
    """Of all pairs, write those that are not done with from ``top`` on; how many, −2 where a pair meets.

    Where there is no space: -1, and the halves gather anew.
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
        margin = _moved_between(motion, k, a, b)
        if not boxes_meet(scene, a, b, margin):
            continue
        first_a = scene.bodies[BODY_INTS * a + FIRST]
        first_b = scene.bodies[BODY_INTS * b + FIRST]
        for p in range(first_a, first_a + scene.bodies[BODY_INTS * a + COUNT]):
            for r in range(first_b, first_b + scene.bodies[BODY_INTS * b + COUNT]):
                n = _take(motion, top, n, p, r, -1, k, margin)
                if n < 0:
                    return n
    return n


@kernel(inline=True)
def _moved_between(motion, k, a, b):
    """How far two bodies of the robot, the k-th pair, move towards each partner."""
    between = view_i64(motion.words[BETWEEN_AT], 2 * k + 2)
    stride = motion.words[PATH_STRIDE] + 1
    return motion.moved[a * stride + between[2 * k]] + motion.moved[b * stride + between[2 * k + 1]]


@kernel(inline=True)
def _take(motion, top, n, p, q, body, partner, margin):
    """Ask about a pair of parts and write it where it is not done with; how many are, −1, or −2 as of `_gather`."""
    state = _state(motion, p, q, body, partner, margin)
    if state == HITTING:
        return -2
    if state == BEYOND_MARGIN:
        return n
    if top + n + 1 > motion.words[ITEM_CAPACITY]:
        return -1
    at = ITEM * (top + n)
    motion.items[at] = p
    motion.items[at + 1] = q
    motion.items[at + 2] = body
    motion.items[at + 3] = partner
    return n + 1


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
    """Of the pairs from ``first`` on, write those that are not done with from ``top`` on; returns as `_gather` does."""
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
            margin = _moved_between(motion, partner, pairs[2 * partner], pairs[2 * partner + 1])
        n = _take(motion, top, n, items[ITEM * k], items[ITEM * k + 1], body, partner, margin)
        if n < 0:
            return n
    return n


@kernel
def _leave_interval(motion, number, begin, end, top, n_items):
    """Note an interval that stays open, with the first of its pairs; what follows on the last one lengthens that.

    It is counted where there is no space.
    """
    words = motion.words
    out = view_f64(words[OPEN_INTERVALS_AT], OPEN_INTERVAL * words[OPEN_INTERVAL_CAPACITY])
    at = OPEN_INTERVAL * words[N_OPEN_INTERVALS]
    if 0 < words[N_OPEN_INTERVALS] <= words[OPEN_INTERVAL_CAPACITY]:
        last = at - OPEN_INTERVAL
        if out[last] == float(number) and out[last + 2] == begin:
            out[last + 2] = end
            return
    words[N_OPEN_INTERVALS] += 1
    if words[N_OPEN_INTERVALS] > words[OPEN_INTERVAL_CAPACITY]:
        return
    body, partner = -1, -1
    if n_items > 0:
        body = motion.items[ITEM * top + 2]
        partner = motion.items[ITEM * top + 3]
    if n_items > 0 and body < 0:
        pair = view_i64(motion.scene.words[SELF_PAIRS_AT] + 16 * partner, 2)
        body = pair[0]
        partner = pair[1]
    out[at] = float(number)
    out[at + 1] = begin
    out[at + 2] = end
    out[at + 3] = float(body)
    out[at + 4] = float(partner)
