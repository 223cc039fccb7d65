"""Input of the kernels for checking a robot: links, attached objects, and the surroundings, behind a header.

A *body* moves with a link: the link's collision elements, or an object attached to the link. Bodies and surroundings
are runs of convex parts; a mesh is read as a part around it, so a miss of the part is a miss of the mesh, and a hit is
left to others.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.broadphase.graded_boxes import BODY, SKIP
from collide.broadphase.graded_boxes import LINK as NODE_LINK
from collide.kernels import kernel, view_f64, view_i64, view_u8
from collide.lowering.compound_table import MEASURE, PART, TURNED
from collide.lowering.shape_table import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS, PRODUCT_SLOP
from collide.narrowphase.posed_pair import stretch_of_pose
from collide.robots.forward_kinematics import Joints, view_joints

# Header. Joints, their number, the root link and its pose; number of links; address of `answer_pairs`.
(
    JOINT_INTS_AT, JOINT_DOUBLES_AT, N_JOINTS, ROOT, BASE_AT, N_LINKS, CORE,
    # bodies, their boxes in their links, how many; pairs of them that are tested, how many
    BODIES_AT, BODY_BOXES_AT, N_BODIES, SELF_PAIRS_AT, N_SELF_PAIRS,
    # parts of bodies in their links, how many there are of these, and how many numbers on their padded twins stand;
    # boxes of all parts in their own frames; whether a part only holds what is meant; all parts
    PARTS_AT, N_LINK_PARTS, PADDED, PART_BOXES_AT, IS_BOUND_AT, N_PARTS,
    # surroundings: nodes of the tree over their parts, their links, how many; those without end; bodies of parts, and
    # poses in them; a byte for every body and body of the surroundings: never tested; how many of the latter
    NODES_AT, NODE_LINKS_AT, N_NODES, UNBOUNDED_AT, N_UNBOUNDED, BODY_OF_AT, PART_POSES_AT, ALLOWED_AT, N_AROUND,
    # shapes
    INTS_AT, NUMBERS_AT, TERMS_AT, SHAPE_OF_AT,
    # workspace of one thread: poses of all parts; of links; boxes of bodies in the world; for which configuration a
    # part was placed; candidates; a pair and its row; those of `answer_pairs`
    POSES_AT, LINKS_AT, WORLD_BOXES_AT, PLACED_AT, CANDIDATES_AT, PAIR_AT, ROW_AT, DOUBLES_AT, INTEGERS_AT,
    # what is left to others: where it is written, for how many, how many there are; configurations seen so far
    OPEN_AT, OPEN_CAPACITY, N_OPEN, STAMP,
    # addresses of `state_of_part` and `gap_of_part`, and of what they ask: behind a 0, of each part of the surroundings
    # the header of its field, 0 of other shapes
    STATE_OF_PART, GAP_OF_PART, WALKS_AT,
    # the header of `sphere_lanes.py`, 0 without; questions of `mesh_states.py`, 0 without, two matrices, and a row with
    # a few bytes behind
    SPHERE_HEADER_AT, MESH_QUESTIONS_AT, MESH_POSES_AT, MESH_ROW_AT,
    # a double: boxes are moved outwards by this share of all that went into them
    SLACK,
) = range(52)
HEADER = 52

#: Sums of |RᵀR − 1| below this count as roundings of a rotation R.
ROUNDINGS_OF_ROTATIONS = 1e-13
# Integers of a body: its link, its first part and how many there are; of an obstacle that moves along, how many numbers
# on the padded twins of parts stand, which are asked in its pairs, else 0.
LINK, FIRST, COUNT, TWINS = range(4)
BODY_INTS = 4
# Doubles of a box: centre and half its sides.
CENTRE, HALF = 0, 3
BOX = 6
#: Half a side [m] of the box of a body without end, in place of infinity: kernels turn boxes, and 0 · ∞ is no number. A
#: row of a rotation has an entry of at least 0.5, so that a turned box still reaches 5e149 m, and nothing in the world
#: is farther than 1e50 m; its square is finite.
UNBOUNDED_HALF = 1e150
# Words of a pair that is left to others: the configuration, a body, another body or −1 − a body around; and a double,
# how far apart they are at least.
OPEN_INTS, OPEN_LOWER = 4, 3


class CheckScene(NamedTuple):
    """Views of what the header names.   words : the header itself."""

    words: Any
    slack: float
    joints: Joints
    links: Any
    bodies: Any
    body_boxes: Any
    world_boxes: Any
    parts: Any
    part_boxes: Any
    poses: Any
    placed: Any
    candidates: Any


@kernel(inline=True)
def skew_of(X):
    """The sum of |RᵀR − 1| of a pose's matrix R."""
    off = 0.0
    for i in range(3):
        for j in range(3):
            dot = X[i] * X[j] + X[4 + i] * X[4 + j] + X[8 + i] * X[8 + j]
            off += abs(dot - (1.0 if i == j else 0.0))
    return off


@kernel(inline=True)
def view_scene(header_at):
    """The `CheckScene` of a header."""
    words = view_i64(header_at, HEADER)
    joints = view_joints(
        words[JOINT_INTS_AT], words[JOINT_DOUBLES_AT], words[N_JOINTS], words[ROOT], words[BASE_AT]
    )
    n_bodies, n_parts = words[N_BODIES], words[N_PARTS]
    return CheckScene(
        words, view_f64(header_at + 8 * SLACK, 1)[0], joints, view_f64(words[LINKS_AT], POSE * words[N_LINKS]),
        view_i64(words[BODIES_AT], BODY_INTS * n_bodies),
        view_f64(words[BODY_BOXES_AT], BOX * n_bodies), view_f64(words[WORLD_BOXES_AT], BOX * n_bodies),
        view_f64(words[PARTS_AT], PART * words[N_LINK_PARTS]), view_f64(words[PART_BOXES_AT], BOX * n_parts),
        view_f64(words[POSES_AT], POSE * n_parts), view_i64(words[PLACED_AT], n_parts),
        view_i64(words[CANDIDATES_AT], n_parts),
    )


@kernel(inline=True)
def put_world_boxes(scene):
    """Boxes of all bodies in the world, for links that have their poses: low corner, high corner."""
    links, boxes, out = scene.links, scene.body_boxes, scene.world_boxes
    for b in range(scene.words[N_BODIES]):
        at = POSE * scene.bodies[BODY_INTS * b + LINK]
        box = BOX * b
        for i in range(3):
            x = links[at + 3 * i]
            y = links[at + 3 * i + 1]
            z = links[at + 3 * i + 2]
            t = links[at + 9 + i]
            centre = x * boxes[box] + y * boxes[box + 1] + z * boxes[box + 2]
            half = abs(x) * boxes[box + 3] + abs(y) * boxes[box + 4] + abs(z) * boxes[box + 5]
            half += scene.slack * (abs(centre) + abs(t) + half)
            out[box + i] = centre + t - half
            out[box + 3 + i] = centre + t + half


@kernel(inline=True)
def boxes_meet(scene, a, b, margin):
    """Whether the boxes of two bodies come within a margin along every axis."""
    boxes = scene.world_boxes
    p = BOX * a
    q = BOX * b
    return (
        boxes[p] - margin <= boxes[q + 3] and boxes[q] - margin <= boxes[p + 3]
        and boxes[p + 1] - margin <= boxes[q + 4] and boxes[q + 1] - margin <= boxes[p + 4]
        and boxes[p + 2] - margin <= boxes[q + 5] and boxes[q + 2] - margin <= boxes[p + 5]
    )


@kernel(inline=True)
def find_parts_around(scene, body, margin):
    """Candidates become the parts around whose boxes come within a margin of a body's; returns how many."""
    words, boxes, near = scene.words, scene.world_boxes, scene.candidates
    n_nodes = words[N_NODES]
    nodes = view_f64(words[NODES_AT], 6 * n_nodes)
    links = view_i64(words[NODE_LINKS_AT], NODE_LINK * n_nodes)
    unbounded = view_i64(words[UNBOUNDED_AT], words[N_UNBOUNDED])
    at = BOX * body
    low0 = boxes[at] - margin
    low1 = boxes[at + 1] - margin
    low2 = boxes[at + 2] - margin
    high0 = boxes[at + 3] + margin
    high1 = boxes[at + 4] + margin
    high2 = boxes[at + 5] + margin
    count = words[N_UNBOUNDED]
    for k in range(count):
        near[k] = unbounded[k]
    # As `walk_boxes.boxes_met` goes: to the first child where boxes meet, else to what comes after the subtree.
    node = 0
    while node < n_nodes:
        n = 6 * node
        meets = (
            nodes[n] <= high0 and nodes[n + 3] >= low0
            and nodes[n + 1] <= high1 and nodes[n + 4] >= low1
            and nodes[n + 2] <= high2 and nodes[n + 5] >= low2
        )
        if meets and links[NODE_LINK * node + BODY] >= 0:
            near[count] = links[NODE_LINK * node + BODY]
            count += 1
        node = node + 1 if meets else links[NODE_LINK * node + SKIP]
    return count


@kernel(inline=True)
def twins_of_pair(scene, a, b):
    """How many numbers on the parts to be asked of two bodies stand: padded where one of both is an obstacle."""
    return max(scene.bodies[BODY_INTS * a + TWINS], scene.bodies[BODY_INTS * b + TWINS])


@kernel(inline=True)
def is_allowed(scene, body, around):
    """Whether a body is never tested against a body around."""
    words = scene.words
    return view_u8(words[ALLOWED_AT] + body * words[N_AROUND], words[N_AROUND])[around] != 0


@kernel(inline=True)
def body_of_part(scene, around):
    """The body around that a part around, by its number among these, belongs to."""
    return view_i64(scene.words[BODY_OF_AT], around + 1)[around]


@kernel(inline=True)
def place(scene, part, body):
    """Place a body's part at the current configuration, unless placed already."""
    if scene.placed[part] != scene.words[STAMP]:
        scene.placed[part] = scene.words[STAMP]
        _put_part(scene, part, POSE * scene.bodies[BODY_INTS * body + LINK])


@kernel(inline=True)
def _put_part(scene, part, link):
    """The row of a part becomes the product of its link's pose, at ``link``, and its own; it knows its rounding."""
    poses, links, parts = scene.poses, scene.links, scene.parts
    to = POSE * part
    at = PART * part
    poses[to + POSE_TERMS] = -1.0
    if parts[at + TURNED] == 0.0:
        for k in range(12):
            poses[to + k] = links[link + k]
        poses[to + POSE_SLOP] = 0.0
        poses[to + POSE_STRETCH] = stretch_of_pose(poses, to)
        return
    stretch = 1.0
    shift = 0.0
    for i in range(3):
        x = links[link + 3 * i]
        y = links[link + 3 * i + 1]
        z = links[link + 3 * i + 2]
        t = links[link + 9 + i]
        stretch = max(stretch, abs(x) + abs(y) + abs(z))
        shift = max(shift, abs(t))
        for j in range(3):
            poses[to + 3 * i + j] = x * parts[at + j] + y * parts[at + 3 + j] + z * parts[at + 6 + j]
        poses[to + 9 + i] = x * parts[at + 9] + y * parts[at + 10] + z * parts[at + 11] + t
    poses[to + POSE_SLOP] = PRODUCT_SLOP * (stretch * parts[at + MEASURE] + shift)
    poses[to + POSE_STRETCH] = stretch_of_pose(poses, to)
