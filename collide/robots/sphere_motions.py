"""Eight intervals of a straight motion at once, a lane each: spheres prove intervals free, or a middle in collision.

As in `certify_motions.py` the middle of an interval is asked, with the farthest motion of bodies within half the
interval as a margin, here for the spheres of `sphere_lanes.py`. Open intervals are halved, and at last left to the
narrowphase.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.kernels.lanes import LANES, root_of, view_lanes
from collide.numerics.vec3 import Vec3, cross, dot, rotate, sub, vec3_at
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
)
from collide.robots.forward_kinematics import (
    AXIS,
    CHILD,
    COLUMN,
    FLOATING,
    JOINT_DOUBLES,
    JOINT_INTS,
    KIND,
    LINK_POSE,
    MULTIPLIER,
    PLANAR,
    TRANSLATION,
)
from collide.robots.motion_bounds import (
    BETWEEN_AT,
    INTERVAL,
    ITEM,
    ITEM_CAPACITY,
    MAX_PIECES,
    N_CHECKED,
    PATH_LENGTHS_AT,
    PATH_STRIDE,
    PATHS_AT,
    change_of,
    shortest_interval,
)
from collide.robots.sphere_lanes import (
    BODY_SPHERES,
    COLUMNS_AT,
    HALF_LANES_AT,
    IS_EXACT,
    MOVED_LANES_AT,
    N_PAIRS,
    OPEN_PAIR,
    PAIR_CAPACITY,
    PAIRS_AT,
    PIECES_AT,
    RADIUS,
    SPANS_AT,
    SPHERE,
    SPHERE_PLACE,
    VERDICTS_AT,
    check_among_parts,
    check_pair,
    no_verdicts,
    place_bodies,
    put_verdicts,
    view_spheres,
)

#: Intervals that a motion begins with, and the shortest that are halved further, as a share of the motion, where a
#: robot is not made of spheres alone.
_FIRST, _SHORTEST = 8, 1.0 / 8.0
_ROUNDING = 2.0**-50
#: Behind the intervals that remain: the eight at work.
_GROUP = 2 * MAX_PIECES


@kernel
def settle_pieces(motion):
    """(time of a collision or NaN, how many intervals the narrowphase is to be asked about: on the stack)."""
    spheres = view_spheres(motion.scene, motion.scene.words[SPHERE_HEADER_AT])
    pieces = view_f64(spheres.words[PIECES_AT], _GROUP + 2 * LANES)
    answers = view_f64(spheres.words[VERDICTS_AT], 2 * LANES)
    shortest = _shortest(motion, spheres)
    n = _FIRST
    for k in range(n):
        pieces[2 * k] = (n - 1 - k) / n
        pieces[2 * k + 1] = (n - k) / n
    n_open = 0
    while n > 0:
        count = min(n, LANES)
        n -= count
        for k in range(2 * LANES):
            pieces[_GROUP + k] = pieces[2 * n + min(k, 2 * count - 2 + k % 2)]
        _ask(motion, spheres, pieces)
        for back in range(count):  # the earliest stands last
            lane = count - 1 - back
            if answers[lane] != 0.0:
                return 0.5 * (pieces[_GROUP + 2 * lane] + pieces[_GROUP + 2 * lane + 1]), 0
        for lane in range(count):
            if answers[LANES + lane] == 0.0:
                continue
            begin = pieces[_GROUP + 2 * lane]
            end = pieces[_GROUP + 2 * lane + 1]
            # Halves need two places; each lane behind needs one for itself.
            if end - begin <= shortest or n + n_open + count - lane >= MAX_PIECES:
                motion.intervals[INTERVAL * n_open] = begin
                motion.intervals[INTERVAL * n_open + 1] = end
                n_open += 1
            else:
                middle = 0.5 * (begin + end)
                pieces[2 * n] = middle
                pieces[2 * n + 1] = end
                pieces[2 * n + 2] = begin
                pieces[2 * n + 3] = middle
                n += 2
    _sort(motion.intervals, n_open)
    if _SHORTEST == shortest and spheres.words[N_PAIRS] <= spheres.words[PAIR_CAPACITY]:
        _put_items(motion, spheres, pieces, n_open)
    return math.nan, n_open


@kernel
def _put_items(motion, spheres, pieces, n_open):
    """Write the open pairs of parts of the intervals on the stack, in the order of the stack. Without space an interval
    is asked about all pairs, and so are all intervals above.
    """
    pairs = view_i64(spheres.words[PAIRS_AT], OPEN_PAIR * spheres.words[N_PAIRS])
    top = 0
    for k in range(n_open):
        lane = 0
        while pieces[_GROUP + 2 * lane] != motion.intervals[INTERVAL * k]:
            lane += 1
        first = top
        for j in range(spheres.words[N_PAIRS]):
            if (pairs[OPEN_PAIR * j + 2] >> lane) & 1 != 0:
                top = _put_pair(motion, top, pairs[OPEN_PAIR * j], pairs[OPEN_PAIR * j + 1])
                if top < 0:
                    return
        motion.intervals[INTERVAL * k + 2] = float(first)
        motion.intervals[INTERVAL * k + 3] = float(top - first)


@kernel
def _put_pair(motion, top, a, b):
    """Write all pairs of parts of two bodies, or of a body and a part around, from ``top`` on; −1 without space."""
    scene, items = motion.scene, motion.items
    words = scene.words
    first_a = scene.bodies[BODY_INTS * a + FIRST]
    n_a = scene.bodies[BODY_INTS * a + COUNT]
    body = -1
    if b < 0:
        first_a += words[PADDED]
        first_b = words[N_LINK_PARTS] - 1 - b
        n_b = 1
        body = a
        partner = -1 - body_of_part(scene, -1 - b)
    else:
        first_b = scene.bodies[BODY_INTS * b + FIRST]
        n_b = scene.bodies[BODY_INTS * b + COUNT]
        partner = number_of_pair(scene, a, b)
    if top + n_a * n_b > motion.words[ITEM_CAPACITY]:
        return -1
    for p in range(first_a, first_a + n_a):
        for r in range(first_b, first_b + n_b):
            items[ITEM * top] = p
            items[ITEM * top + 1] = r
            items[ITEM * top + 2] = body
            items[ITEM * top + 3] = partner
            top += 1
    return top


@kernel(inline=True)
def number_of_pair(scene, a, b):
    """The number of a tested pair of bodies."""
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * scene.words[N_SELF_PAIRS])
    k = 0
    while pairs[2 * k] != a or pairs[2 * k + 1] != b:
        k += 1
    return k


@kernel(inline=True)
def _shortest(motion, spheres):
    """The length of intervals that are not halved any more."""
    for body in range(motion.scene.words[N_BODIES]):
        if spheres.counts[BODY_SPHERES * body + IS_EXACT] == 0:
            return _SHORTEST
    return shortest_interval(motion)


@kernel(inline=True)
def _sort(intervals, n):
    """Put intervals in order, the earliest last, each to be asked about all pairs."""
    for k in range(n):
        begin = intervals[INTERVAL * k]
        end = intervals[INTERVAL * k + 1]
        at = k
        while at > 0 and intervals[INTERVAL * (at - 1)] < begin:
            for j in range(2):
                intervals[INTERVAL * at + j] = intervals[INTERVAL * (at - 1) + j]
            at -= 1
        intervals[INTERVAL * at] = begin
        intervals[INTERVAL * at + 1] = end
    for k in range(n):
        intervals[INTERVAL * k + 2] = 0.0
        intervals[INTERVAL * k + 3] = -1.0


@kernel
def _ask(motion, spheres, pieces):
    """Write the verdicts of the eight intervals at work."""
    scene, words = motion.scene, motion.words
    columns = view_f64(spheres.words[COLUMNS_AT], LANES * motion.dof)
    spans = view_f64(spheres.words[SPANS_AT], LANES * motion.dof)
    half = view_lanes(spheres.words[HALF_LANES_AT], 1)
    half_lengths = view_f64(spheres.words[HALF_LANES_AT], LANES)
    for lane in range(LANES):
        begin = pieces[_GROUP + 2 * lane]
        end = pieces[_GROUP + 2 * lane + 1]
        time = 0.5 * (begin + end)
        half_lengths[lane] = 0.5 * (end - begin)
        for j in range(motion.dof):
            a = motion.q0[motion.at + j]
            b = motion.q1[motion.at + j]
            columns[LANES * j + lane] = a + time * (b - a)
            # Roundings of columns are a share of both ends.
            spans[LANES * j + lane] = half_lengths[lane] * abs(b - a) + _ROUNDING * (abs(a) + abs(b))
    words[N_CHECKED] += LANES
    place_bodies(scene, spheres)
    stride = words[PATH_STRIDE] + 1
    moved = view_lanes(spheres.words[MOVED_LANES_AT], scene.words[N_BODIES] * stride)
    for body in range(scene.words[N_BODIES]):
        _bound_motion(motion, spheres, body, half[0], moved)
    lengths = view_i64(words[PATH_LENGTHS_AT], scene.words[N_BODIES])
    verdicts = no_verdicts(spheres)
    for body in range(scene.words[N_BODIES]):
        verdicts = check_among_parts(scene, spheres, body, moved[body * stride + lengths[body]], verdicts)
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * scene.words[N_SELF_PAIRS])
    between = view_i64(words[BETWEEN_AT], 2 * scene.words[N_SELF_PAIRS])
    for k in range(scene.words[N_SELF_PAIRS]):
        a = pairs[2 * k]
        b = pairs[2 * k + 1]
        margin = moved[a * stride + between[2 * k]] + moved[b * stride + between[2 * k + 1]]
        verdicts = check_pair(scene, spheres, k, a, b, margin, verdicts)
    put_verdicts(spheres, verdicts)
    for k in range(LANES * motion.dof):
        spans[k] = 0.0


@kernel
def _bound_motion(motion, spheres, body, half, moved):
    """As `motion_bounds._bound_motion`, in lanes, of the sphere around a body."""
    scene, words = motion.scene, motion.words
    stride = words[PATH_STRIDE]
    path = view_i64(words[PATHS_AT] + 8 * body * stride, stride)
    place = spheres.around_lanes
    at = SPHERE_PLACE * body
    c = Vec3(place[at], place[at + 1], place[at + 2])
    radius = spheres.around_bodies[SPHERE * body + RADIUS] + motion.rounding + place[at + 3]
    by = motion.rounding + 0.0 * half
    out = body * (stride + 1)
    moved[out] = by
    for k in range(view_i64(words[PATH_LENGTHS_AT], body + 1)[body]):
        by = (by + _moved_by_joint(motion, spheres, path[k], c, radius, by, half)) * (1.0 + scene.slack)
        moved[out + k + 1] = by


@kernel(inline=True)
def _moved_by_joint(motion, spheres, joint, c, radius, moved, half):
    """Bounds [m] of a joint's motion of points in balls about c, moved by ``moved`` [m] by the joints beyond."""
    joints, links = motion.scene.joints, spheres.links
    at = JOINT_DOUBLES * joint
    kind = joints.ints[JOINT_INTS * joint + KIND]
    child = LINK_POSE * joints.ints[JOINT_INTS * joint + CHILD]
    column = joints.ints[JOINT_INTS * joint + COLUMN]
    angle = half * (change_of(motion, column) * abs(joints.doubles[at + MULTIPLIER]))
    if kind == TRANSLATION:
        return angle
    arm = sub(c, vec3_at(links, child + 9))
    shift = 0.0 * half
    if kind == FLOATING:
        for k in range(3):
            shift = shift + half * change_of(motion, column + k)
        angle = half * (change_of(motion, column + 3) + change_of(motion, column + 4) + change_of(motion, column + 5))
        return shift + angle * (root_of(dot(arm, arm)) + radius + moved + shift)
    if kind == PLANAR:
        shift = half * (change_of(motion, column) + change_of(motion, column + 1))
        angle = half * change_of(motion, column + 2)
    across = cross(arm, rotate(links, child, vec3_at(joints.doubles, at + AXIS)))
    return shift + angle * (root_of(dot(across, across)) + radius + moved + shift)
