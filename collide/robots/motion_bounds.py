"""How far the bodies of a robot move along a straight motion, at most.

How far a point moves within joint j's parent frame: at most D_j = D + δ_j (ρ_j + D), where D is what joints beyond j
move it by, δ_j by how much the joint turns, and ρ_j the point's greatest distance from its axis in the middle of the
interval: on the way it is at most ρ_j + D away, and a chord is no longer than its arc. (Schwarzer, Saha and Latombe,
"Exact collision checking of robot paths", 2002, bound motions so by the longest a link can reach; here by where it is.)
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import POSE
from collide.numerics.vec3 import Vec3, cross, dot, norm, rotate, sub, vec3_at
from collide.robots.check_configurations import begin_configuration
from collide.robots.check_scene import BODY_INTS, BOX, HALF, LINK, N_BODIES, N_SELF_PAIRS, SELF_PAIRS_AT, view_scene
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

# Header of motions. For each body its joints that move, from the link to the root, and how many; for each pair of
# bodies tested, how many of each one's joints stand between them; how many places a body has for joints.
(
    PATHS_AT, PATH_LENGTHS_AT, BETWEEN_AT, PATH_STRIDE,
    # workspace: a configuration; how far each body may move, joint by joint; intervals; pairs left in them, how many
    # there may be
    CONFIGURATION_AT, MOVED_AT, INTERVALS_AT, ITEMS_AT, ITEM_CAPACITY,
    # open intervals: address, capacity, number
    OPEN_INTERVALS_AT, OPEN_INTERVAL_CAPACITY, N_OPEN_INTERVALS, N_CHECKED,
    # pairs of bodies with meshes, which others are to ask: where they are written, for how many, how many there are
    MESH_PAIRS_AT, MESH_PAIR_CAPACITY, N_MESH_PAIRS,
    # two doubles: intervals no longer than this are not halved [rad or m, of the column that moves by most]; how far
    # a link may be off by rounding [m]
    RESOLUTION, ROUNDING,
) = range(18)
MOTION_HEADER = 18
#: Doubles of an interval on the stack: where it begins and ends, the first of its pairs and how many, −1 for all there
#: are.
BEGIN, END, FIRST_ITEM, N_ITEMS = range(4)
INTERVAL = 4
#: Intervals on the stack: those that a motion begins with, a power of two and at most so many, no longer than PIECE
#: where that suffices [rad or m, of the column that moves by most]; and one more with every halving.
MAX_PIECES, PIECE = 32, 0.05
MAX_INTERVALS = 96
#: Integers of a pair of parts: both, and the pair of bodies: a body and −1 − a body around, or −1 and a tested pair.
ITEM = 4
#: Doubles of an interval that stays open for a pair: motion, begin, end, and as in ITEM a body and its partner.
OPEN_INTERVAL = 5
#: On the stack of intervals, behind all: the one at work, and the number of its motion.
CURRENT = INTERVAL * MAX_INTERVALS


class Motion(NamedTuple):
    """A straight motion, and the workspace.

    q0, q1 : views of both ends, from ``at`` on.   max_change : the largest change of a column [rad or m].
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


@kernel(inline=True)
def motion_at(scene, motions_at, q0, q1, at, dof):
    """The `Motion` whose ends begin at ``at`` of q0 and q1."""
    words = view_i64(motions_at, MOTION_HEADER)
    settings = view_f64(motions_at + 8 * RESOLUTION, 2)
    max_change = 0.0
    for j in range(dof):
        max_change = max(max_change, abs(q1[at + j] - q0[at + j]))
    return Motion(
        scene, words, q0, q1, at, dof, view_f64(words[CONFIGURATION_AT], dof),
        view_f64(words[MOVED_AT], scene.words[N_BODIES] * (words[PATH_STRIDE] + 1)),
        view_f64(words[INTERVALS_AT], INTERVAL * (MAX_INTERVALS + 1)),
        view_i64(words[ITEMS_AT], ITEM * (words[ITEM_CAPACITY] + 1)), settings[0], settings[1], max_change,
    )


@kernel(inline=True)
def shortest_interval(motion):
    """The length of intervals not halved any more, as a share of the motion: no column changes by more than the
    resolution, nor by more than PIECE, the length of the first intervals.
    """
    if motion.max_change <= 0.0:
        return 1.0
    return min(motion.resolution, max(PIECE, motion.max_change / MAX_PIECES)) / motion.max_change


@kernel(inline=True)
def begin_interval(motion, time, half):
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
    """Bound [m] of a joint's motion of points in a ball about c, moved by ``moved`` [m] by the joints beyond."""
    joints, links = motion.scene.joints, motion.scene.links
    at = JOINT_DOUBLES * joint
    kind = joints.ints[JOINT_INTS * joint + KIND]
    child = POSE * joints.ints[JOINT_INTS * joint + CHILD]
    column = joints.ints[JOINT_INTS * joint + COLUMN]
    angle = change_of(motion, column) * abs(joints.doubles[at + MULTIPLIER]) * half
    if kind == TRANSLATION:
        return angle
    arm = sub(c, vec3_at(links, child + 9))
    if kind == FLOATING:
        shift = change_of(motion, column) + change_of(motion, column + 1) + change_of(motion, column + 2)
        angle = change_of(motion, column + 3) + change_of(motion, column + 4) + change_of(motion, column + 5)
        return half * (shift + angle * (norm(arm) + radius + moved + half * shift))
    shift = 0.0
    if kind == PLANAR:
        shift = half * (change_of(motion, column) + change_of(motion, column + 1))
        angle = half * change_of(motion, column + 2)
    axis = rotate(links, child, vec3_at(joints.doubles, at + AXIS))
    across = cross(arm, axis)
    return shift + angle * (math.sqrt(dot(across, across)) + radius + moved + shift)


@kernel(inline=True)
def change_of(motion, column):
    """By how much a column changes, all of the way."""
    return abs(motion.q1[motion.at + column] - motion.q0[motion.at + column])


@kernel(inline=True)
def moved_between(motion, k, a, b):
    """How far two bodies of the robot, the k-th pair, move towards each other."""
    between = view_i64(motion.words[BETWEEN_AT], 2 * k + 2)
    stride = motion.words[PATH_STRIDE] + 1
    return motion.moved[a * stride + between[2 * k]] + motion.moved[b * stride + between[2 * k + 1]]


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def bound_motions(header_at, motions_at, q0_at, q1_at, dof, intervals_at, n, bounds_at):
    """How far the bodies of n intervals of OPEN_INTERVAL doubles move towards each other within half of each [m].

    Intervals name motions by their row of q0 and q1.
    """
    scene = view_scene(header_at)
    intervals, bounds = view_f64(intervals_at, OPEN_INTERVAL * n), view_f64(bounds_at, n)
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * scene.words[N_SELF_PAIRS])
    for k in range(n):
        at = OPEN_INTERVAL * k
        number = int(intervals[at])
        q0 = view_f64(q0_at + 8 * dof * number, dof)
        q1 = view_f64(q1_at + 8 * dof * number, dof)
        motion = motion_at(scene, motions_at, q0, q1, 0, dof)
        begin = intervals[at + 1]
        end = intervals[at + 2]
        body = int(intervals[at + 3])
        partner = int(intervals[at + 4])
        begin_interval(motion, 0.5 * (begin + end), 0.5 * (end - begin))
        if body >= 0:
            lengths = view_i64(motion.words[PATH_LENGTHS_AT], body + 1)
            bounds[k] = motion.moved[body * (motion.words[PATH_STRIDE] + 1) + lengths[body]]
        else:
            bounds[k] = moved_between(motion, partner, pairs[2 * partner], pairs[2 * partner + 1])
