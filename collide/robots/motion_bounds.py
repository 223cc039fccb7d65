"""How far the bodies of a robot move in an interval of a motion, or within a box of configurations, at most.

By how much column j of q differs from the value in the middle, at most: of a straight motion by half its change. Of a
Bézier curve by the largest difference of a control point of the interval's part of the curve, since the part lies in
the hull of its control points (Farin, "Curves and Surfaces for CAGD", 5th edition, 4.3 and 5.4), and by roundings. Of
a box by half its width. Joints bound how far bodies move by these differences alone, so that all three bounds hold.

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
    # what motions are, the degree of curves, whether an earlier collision is searched after a hit; how many cells of a
    # box are asked, at most; doubles of a row that stays open
    MOTION_KIND, DEGREE, IS_EARLIEST, CELL_LIMIT, OPEN_STRIDE,
    # workspace: by how much columns change, and their width; control points of a column; boxes on the stack; of each
    # box that collides a configuration
    CHANGES_AT, POINTS_AT, BOXES_AT, HITS_AT,
    # two doubles: intervals no longer than this are not halved [rad or m, of the column that moves by most]; how far
    # a link may be off by rounding [m]
    RESOLUTION, ROUNDING,
) = range(27)
MOTION_HEADER = 27
#: Kinds of motions: straight, between rows of q0 and q1; Bézier curves, whose control points (degree + 1, dof) are in
#: q0 and by how much each column may be off in q1; boxes of configurations from q0 to q1, whose intervals are cells.
STRAIGHT, CURVED, BOX_OF_CONFIGURATIONS = range(3)
#: Degrees of curves: a column is off by less than 20 roundings of its largest control point for each degree.
MAX_DEGREE = 15
#: Doubles of an interval on the stack: where it begins and ends, the first of its pairs and how many, −1 for all there
#: are.
BEGIN, END, FIRST_ITEM, N_ITEMS = range(4)
INTERVAL = 4
#: Intervals on the stack: those that a motion begins with, a power of two and at most so many, no longer than PIECE
#: where that suffices [rad or m, of the column that moves by most]; and one more with every halving.
MAX_PIECES, PIECE = 32, 0.05
MAX_INTERVALS = 96
#: Roundings of forward kinematics, as a share of where links are and how far they reach, and of columns.
ROUNDING_SHARE = 2.0**-40
#: Integers of a pair of parts: both, and the pair of bodies: a body and −1 − a body around, or −1 and a tested pair.
ITEM = 4
#: Doubles of an interval that stays open for a pair: motion, begin, end, and as in ITEM a body and its partner. Of a
#: cell the lowest and the highest corner follow.
OPEN_INTERVAL = 5
#: On the stack of intervals, behind all: the one at work, and the number of its motion.
CURRENT = INTERVAL * MAX_INTERVALS


class Motion(NamedTuple):
    """A motion, and the workspace.

    kind, q0, q1 : as of `STRAIGHT` and its siblings, from ``at`` and ``at_q1`` on.
    changes : (dof + 1,) by how much columns differ from the middle, for a factor of `begin_interval`, and the width of
        the interval [rad or m].   points : control points of a column.   boxes : of cells on the stack, the one at work
        behind all.   max_change : the largest change of a column from the begin [rad or m], of
        curves of a control point; 0 of boxes.
    """

    scene: Any
    words: Any
    kind: int
    q0: Any
    q1: Any
    at: int
    at_q1: int
    dof: int
    q: Any
    moved: Any
    intervals: Any
    items: Any
    changes: Any
    points: Any
    boxes: Any
    resolution: float
    rounding: float
    max_change: float


@kernel(inline=True)
def motion_at(scene, motions_at, q0_at, q1_at, dof, number):
    """The `Motion` of this number."""
    words = view_i64(motions_at, MOTION_HEADER)
    settings = view_f64(motions_at + 8 * RESOLUTION, 2)
    kind = words[MOTION_KIND]
    row = dof * (words[DEGREE] + 1) if kind == CURVED else dof
    q0, q1 = view_f64(q0_at, row * (number + 1)), view_f64(q1_at, dof * (number + 1))
    at, at_q1 = row * number, dof * number
    max_change = 0.0
    for j in range(dof):
        if kind == STRAIGHT:
            max_change = max(max_change, abs(q1[at_q1 + j] - q0[at + j]))
        elif kind == CURVED:
            for k in range(1, words[DEGREE] + 1):
                max_change = max(max_change, abs(q0[at + k * dof + j] - q0[at + j]))
    return Motion(
        scene, words, kind, q0, q1, at, at_q1, dof, view_f64(words[CONFIGURATION_AT], dof),
        view_f64(words[MOVED_AT], scene.words[N_BODIES] * (words[PATH_STRIDE] + 1)),
        view_f64(words[INTERVALS_AT], INTERVAL * (MAX_INTERVALS + 1)),
        view_i64(words[ITEMS_AT], ITEM * (words[ITEM_CAPACITY] + 1)), view_f64(words[CHANGES_AT], dof + 1),
        view_f64(words[POINTS_AT], MAX_DEGREE + 1), view_f64(words[BOXES_AT], 2 * dof * (MAX_INTERVALS + 1)),
        settings[0], settings[1], max_change,
    )


@kernel(inline=True)
def shortest_width(motion):
    """By how much columns change in intervals not halved any more: by no more than the resolution, nor than PIECE, the
    length of the first intervals [rad or m].
    """
    return min(motion.resolution, max(PIECE, motion.max_change / MAX_PIECES))


@kernel(inline=True)
def shortest_interval(motion):
    """The same as a share of a straight motion."""
    return shortest_width(motion) / motion.max_change if motion.max_change > 0.0 else 1.0


@kernel(inline=True)
def begin_interval(motion, begin, end):
    """Place links for the middle of an interval, and bound how far bodies move away from there within the interval."""
    half = 1.0
    if motion.kind == STRAIGHT:
        half = 0.5 * (end - begin)
        _begin_straight(motion, begin, end)
    elif motion.kind == CURVED:
        _begin_curved(motion, begin, end)
    else:
        _begin_cell(motion)
    motion.words[N_CHECKED] += 1
    begin_configuration(motion.scene, motion.q, 0)
    for body in range(motion.scene.words[N_BODIES]):
        _bound_motion(motion, body, half)


@kernel(inline=True)
def _begin_straight(motion, begin, end):
    """Columns of a straight motion in the middle of an interval, and their changes in all of the motion."""
    time = 0.5 * (begin + end)
    for j in range(motion.dof):
        a = motion.q0[motion.at + j]
        b = motion.q1[motion.at_q1 + j]
        motion.q[j] = a + time * (b - a)
        motion.changes[j] = abs(b - a)
    motion.changes[motion.dof] = motion.max_change * (end - begin)


@kernel(cold=True)
def _begin_curved(motion, begin, end):
    """Columns of a curve in the middle of an interval, and the largest distance of a control point from the middle.

    De Casteljau's algorithm at the end, then at the begin of the curve up to the end: each of 2 · degree averages of
    numbers up to M is off by 5 u M at most, u = 2^−53. Rounding the place of the begin moves points by up to
    2 · degree · u M, and the sum in the middle is off by (degree + 2) u M. The roundings add up to less than
    20 · degree · u M; q1 contains more.
    """
    points, n, dof = motion.points, motion.words[DEGREE], motion.dof
    width = 0.0
    error = 0.0
    for j in range(dof):
        for k in range(n + 1):
            points[k] = motion.q0[motion.at + k * dof + j]
        for level in range(1, n + 1):  # up to the end; what comes behind is dropped
            for k in range(n, level - 1, -1):
                points[k] = points[k - 1] + end * (points[k] - points[k - 1])
        share = begin / end
        for level in range(n, 0, -1):  # from the begin on
            for k in range(level):
                points[k] = points[k] + share * (points[k + 1] - points[k])
        motion.q[j] = _middle_of(points, n)
        change = 0.0
        for k in range(n + 1):
            change = max(change, abs(points[k] - motion.q[j]))
        off = motion.q1[motion.at_q1 + j]
        width = max(width, 2.0 * change)
        error = max(error, off)
        motion.changes[j] = change + off
    # An interval about as wide as roundings is not halved.
    motion.changes[dof] = width if width > 4.0 * error else 0.0


@kernel(inline=True)
def _middle_of(points, n):
    """The value of a Bézier curve in the middle: point k has the weight C(n, k) / 2^n."""
    weight = math.ldexp(1.0, -n)
    total = 0.0
    for k in range(n + 1):
        total += weight * points[k]
        weight = weight * (n - k) / (k + 1)
    return total


@kernel(cold=True)
def _begin_cell(motion):
    """The middle of the cell at work and its half widths, rounded upwards by far more than roundings."""
    low = 2 * motion.dof * MAX_INTERVALS
    width = 0.0
    for j in range(motion.dof):
        a = motion.boxes[low + j]
        b = motion.boxes[low + motion.dof + j]
        motion.q[j] = 0.5 * a + 0.5 * b
        motion.changes[j] = 0.5 * (b - a) + ROUNDING_SHARE * max(abs(a), abs(b))
        width = max(width, b - a)
    motion.changes[motion.dof] = width


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
def change_of(motion, column):
    """By how much a column of a straight motion changes, all of the way."""
    return abs(motion.q1[motion.at_q1 + column] - motion.q0[motion.at + column])


@kernel(inline=True)
def _change(motion, column):
    return motion.changes[column]


@kernel(cold=True)
def column_to_halve(motion, body, partner):
    """The widest column of the joint that moves a pair of bodies, as of ITEM, by most in the cell at work; −1 where no
    column of theirs is wider than the resolution.
    """
    n, m = 0, 0
    if body >= 0:
        partner_body = body
        n = view_i64(motion.words[PATH_LENGTHS_AT], body + 1)[body]
    else:
        pairs = view_i64(motion.scene.words[SELF_PAIRS_AT], 2 * partner + 2)
        between = view_i64(motion.words[BETWEEN_AT], 2 * partner + 2)
        body = pairs[2 * partner]
        partner_body = pairs[2 * partner + 1]
        n = between[2 * partner]
        m = between[2 * partner + 1]
    best = -1
    largest = -1.0
    stride = motion.words[PATH_STRIDE]
    for k in range(n + m):
        of = body if k < n else partner_body
        step = k if k < n else k - n
        column = _widest_column(motion, view_i64(motion.words[PATHS_AT] + 8 * of * stride, stride)[step])
        at = of * (stride + 1) + step
        gain = motion.moved[at + 1] - motion.moved[at]
        if gain > largest and _cell_width(motion, column) > motion.resolution:
            best = column
            largest = gain
    return best


@kernel(inline=True)
def _widest_column(motion, joint):
    ints = motion.scene.joints.ints
    kind = ints[JOINT_INTS * joint + KIND]
    first = ints[JOINT_INTS * joint + COLUMN]
    best = first
    for column in range(first, first + (6 if kind == FLOATING else 3 if kind == PLANAR else 1)):
        if _cell_width(motion, column) > _cell_width(motion, best):
            best = column
    return best


@kernel(inline=True)
def _cell_width(motion, column):
    low = 2 * motion.dof * MAX_INTERVALS
    return motion.boxes[low + motion.dof + column] - motion.boxes[low + column]


@kernel(inline=True)
def moved_between(motion, k, a, b):
    """How far two bodies of the robot, the k-th pair, move towards each other."""
    between = view_i64(motion.words[BETWEEN_AT], 2 * k + 2)
    stride = motion.words[PATH_STRIDE] + 1
    return motion.moved[a * stride + between[2 * k]] + motion.moved[b * stride + between[2 * k + 1]]


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def bound_motions(header_at, motions_at, q0_at, q1_at, dof, intervals_at, n, bounds_at):
    """For each of n intervals, rows as of OPEN_INTERVAL: how far both bodies move towards each other from the middle
    [m], the width of the interval, and q in the middle; dof + 2 doubles in all.

    Intervals name motions by their row of q0 and q1. Of a cell, the column to halve becomes the begin, and its width 0
    where no column is to be halved.
    """
    scene, stride = view_scene(header_at), view_i64(motions_at, MOTION_HEADER)[OPEN_STRIDE]
    intervals, bounds = view_f64(intervals_at, stride * n), view_f64(bounds_at, (dof + 2) * n)
    pairs = view_i64(scene.words[SELF_PAIRS_AT], 2 * scene.words[N_SELF_PAIRS])
    for k in range(n):
        at = stride * k
        motion = motion_at(scene, motions_at, q0_at, q1_at, dof, int(intervals[at]))
        body = int(intervals[at + 3])
        partner = int(intervals[at + 4])
        for j in range(stride - OPEN_INTERVAL):
            motion.boxes[2 * dof * MAX_INTERVALS + j] = intervals[at + OPEN_INTERVAL + j]
        begin_interval(motion, intervals[at + 1], intervals[at + 2])
        out = (dof + 2) * k
        bounds[out + 1] = motion.changes[dof]
        for j in range(dof):
            bounds[out + 2 + j] = motion.q[j]
        if motion.kind == BOX_OF_CONFIGURATIONS:
            column = column_to_halve(motion, body, partner)
            intervals[at + 1] = float(column)
            bounds[out + 1] = 0.0 if column < 0 else motion.changes[dof]
        if body >= 0:
            lengths = view_i64(motion.words[PATH_LENGTHS_AT], body + 1)
            bounds[out] = motion.moved[body * (motion.words[PATH_STRIDE] + 1) + lengths[body]]
        else:
            bounds[out] = moved_between(motion, partner, pairs[2 * partner], pairs[2 * partner + 1])
