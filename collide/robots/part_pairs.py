"""A pair of posed parts of a robot that is checked: their boxes first, then the narrowphase."""

from __future__ import annotations

import math

from collide.kernels import kernel, native_call, view_i64, view_u8
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.facets.item_questions import (
    LONG_WAY,
    MAYBE_INSIDE,
    MEETS,
    SURFACES_APART,
)
from collide.narrowphase.facets.nearest_item_kernel import (
    GAP_SIGNATURE,
    PART_SIGNATURE,
)
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.rows import HIT, LOWER, NORMAL, ROW, is_undecided_or_refused, view_row
from collide.numerics.vec3 import Vec3, dot, put_vec3, rotate, rotate_back, sub, vec3_at
from collide.robots.check_scene import (
    BOX,
    CORE,
    DOUBLES_AT,
    GAP_OF_PART,
    HALF,
    INTEGERS_AT,
    INTS_AT,
    IS_BOUND_AT,
    N_LINK_PARTS,
    N_PARTS,
    NUMBERS_AT,
    PAIR_AT,
    PART_BOXES_AT,
    POSES_AT,
    ROW_AT,
    SHAPE_OF_AT,
    STATE_OF_PART,
    TERMS_AT,
    WALKS_AT,
)

#: What is known of two parts: proven farther apart than the margin; nearer, and apart; they meet; left to others.
BEYOND_MARGIN, NEAR, HITTING, OPEN = range(4)

_answer_pairs_at = native_call(SIGNATURE)
_state_of_part_at, _gap_of_part_at = native_call(PART_SIGNATURE), native_call(GAP_SIGNATURE)


@kernel(inline=True)
def state_of_parts(scene, p, q, margin):
    """BEYOND_MARGIN, NEAR, HITTING or OPEN of two parts whose poses are written; without a margin [m] never NEAR."""
    d = Vec3(0.0, 0.0, 0.0)
    if is_bounded(scene, p) and is_bounded(scene, q):
        d = sub(middle(scene, q), middle(scene, p))
        if boxes_are_apart(scene, p, q, d, margin):
            return BEYOND_MARGIN
    walk = walk_of(scene, q)
    if walk != 0 and is_bounded(scene, p):  # fields know no sets without end
        return _state_of_field(scene, p, walk, margin)
    row = ask(scene, p, q, d, True, margin)
    if is_undecided_or_refused(row):
        return OPEN
    if row.doubles[LOWER] > margin:
        return BEYOND_MARGIN
    if row.flags[HIT] == 0:
        return NEAR
    return OPEN if only_holds(scene, p) or only_holds(scene, q) else HITTING


@kernel(inline=True)
def walk_of(scene, part):
    """The address of a part's field; 0 of what is no field around, or is asked as any shape."""
    k = max(part - scene.words[N_LINK_PARTS] + 1, 0)
    return view_i64(scene.words[WALKS_AT], k + 1)[k]


@kernel
def _state_of_field(scene, p, walk, margin):
    """`state_of_parts` of a part and a field around; NEAR where items may be within the margin, and OPEN where a part
    only holds what is meant: what the part is apart from, the mesh within is apart from.
    """
    state = _state_of_part_at(scene.words[STATE_OF_PART], (walk, *rows_of_part(scene, p), margin))
    if state == SURFACES_APART or state == MAYBE_INSIDE:
        return BEYOND_MARGIN
    if state == LONG_WAY or only_holds(scene, p):
        return OPEN
    return HITTING if state == MEETS else NEAR


@kernel(inline=True)
def gap_of_field(scene, p, walk, limit):
    """(NEAR, BEYOND_MARGIN or OPEN, the row) of a part and a field around.   limit : [m]."""
    row_at = scene.words[ROW_AT]
    blank = view_i64(row_at, ROW // 8)
    for k in range(ROW // 8):
        blank[k] = 0
    state = _gap_of_part_at(scene.words[GAP_OF_PART], (walk, *rows_of_part(scene, p), limit, row_at))
    return (OPEN if state == LONG_WAY else BEYOND_MARGIN if state == SURFACES_APART else NEAR), view_row(row_at)


@kernel(inline=True)
def rows_of_part(scene, p):
    """Addresses of a part's rows of the shapes, of its pose, of its box."""
    words = scene.words
    row = view_i64(words[SHAPE_OF_AT], p + 1)[p]
    return (
        words[INTS_AT] + 8 * INTS * row, words[NUMBERS_AT] + 8 * NUMBERS * row, words[POSES_AT] + 8 * POSE * p,
        words[PART_BOXES_AT] + 8 * BOX * p,
    )


@kernel(inline=True)
def only_holds(scene, part):
    """Whether a part is more than what is meant: a mesh is within."""
    return view_u8(scene.words[IS_BOUND_AT], scene.words[N_PARTS])[part] != 0


@kernel
def ask(scene, p, q, d, boolean, limit):
    """The row of `answer_pairs` about two parts.   d : a direction from p to q to begin with, or zeros."""
    words = scene.words
    row_at = words[ROW_AT]
    blank = view_i64(row_at, ROW // 8)
    for k in range(ROW // 8):
        blank[k] = 0
    row = view_row(row_at)
    if boolean:
        put_vec3(row.doubles, NORMAL, d)
    pair = view_i64(words[PAIR_AT], 2)
    pair[0] = p
    pair[1] = q
    _answer_pairs_at(
        words[CORE],
        (
            words[INTS_AT], words[NUMBERS_AT], words[POSES_AT], words[TERMS_AT], words[SHAPE_OF_AT], words[PAIR_AT], 1,
            boolean, not boolean, boolean, limit, row_at, words[DOUBLES_AT], words[INTEGERS_AT],
        ),
    )
    return row


@kernel(inline=True)
def is_bounded(scene, part):
    return scene.part_boxes[BOX * part + HALF] < math.inf


@kernel(inline=True)
def middle(scene, part):
    """The centre of a part's box in the world."""
    poses = scene.poses
    at = POSE * part
    c = rotate(poses, at, vec3_at(scene.part_boxes, BOX * part))
    return Vec3(c.x + poses[at + 9], c.y + poses[at + 10], c.z + poses[at + 11])


@kernel(inline=True)
def boxes_are_apart(scene, p, q, d, margin):
    """Whether a face of a turned box is farther than the margin [m] from the other box.

    d : from the centre of p's box to the centre of q's.   A face's axis is tested by the other box's extent along the
        axis.
    """
    poses, boxes = scene.poses, scene.part_boxes
    at_p = POSE * p
    at_q = POSE * q
    a = vec3_at(boxes, BOX * p + HALF)
    b = vec3_at(boxes, BOX * q + HALF)
    # Columns of a pose are its box's axes; entry (i, j) is axis i of p along axis j of q.
    x = rotate_back(poses, at_q, Vec3(poses[at_p], poses[at_p + 3], poses[at_p + 6]))
    y = rotate_back(poses, at_q, Vec3(poses[at_p + 1], poses[at_p + 4], poses[at_p + 7]))
    z = rotate_back(poses, at_q, Vec3(poses[at_p + 2], poses[at_p + 5], poses[at_p + 8]))
    x = Vec3(abs(x.x), abs(x.y), abs(x.z))
    y = Vec3(abs(y.x), abs(y.y), abs(y.z))
    z = Vec3(abs(z.x), abs(z.y), abs(z.z))
    u = rotate_back(poses, at_p, d)
    v = rotate_back(poses, at_q, d)
    sizes = abs(d.x) + abs(d.y) + abs(d.z) + a.x + a.y + a.z + b.x + b.y + b.z + margin
    least = margin + scene.slack * (sizes + _far(poses, at_p) + _far(poses, at_q))
    return (
        abs(u.x) - a.x - dot(x, b) > least
        or abs(u.y) - a.y - dot(y, b) > least
        or abs(u.z) - a.z - dot(z, b) > least
        or abs(v.x) - b.x - (x.x * a.x + y.x * a.y + z.x * a.z) > least
        or abs(v.y) - b.y - (x.y * a.x + y.y * a.y + z.y * a.z) > least
        or abs(v.z) - b.z - (x.z * a.x + y.z * a.y + z.z * a.z) > least
    )


@kernel(inline=True)
def _far(poses, at):
    """How far from the world's origin a part stands, coordinates added up: centres are rounded by that."""
    return abs(poses[at + 9]) + abs(poses[at + 10]) + abs(poses[at + 11])
