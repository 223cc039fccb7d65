"""Pairs of bodies with a mesh as kernels of robots ask them: facets against facets, or against a convex part."""

from __future__ import annotations

from collide.kernels import kernel, native_call, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS
from collide.narrowphase.facets.item_questions import MEETS, SURFACES_APART
from collide.narrowphase.facets.item_questions import POSES_AT as ITEM_POSES_AT
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT, RADIUS_A
from collide.narrowphase.facets.nearest_item_kernel import PART_SIGNATURE
from collide.narrowphase.rows import HIT as HIT_FLAG
from collide.narrowphase.rows import LOWER, ROW, is_undecided_or_refused, view_row
from collide.numerics.vec3 import Vec3
from collide.robots.check_scene import (
    BODY_INTS,
    LINK,
    MESH_POSES_AT,
    MESH_QUESTIONS_AT,
    MESH_ROW_AT,
    N_AROUND,
    STATE_OF_PART,
)
from collide.robots.part_pairs import BEYOND_MARGIN, HITTING, NEAR, OPEN, ask, rows_of_part

#: How a pair is asked: left to others; facets against facets; the facets of body, or of its partner, against a convex
#: part; by the hulls, which meet a half-space where the meshes do.
UNKNOWN, FACETS, FACETS_OF_BODY, FACETS_OF_PARTNER, HULLS = range(5)
# Integers of a question: how, the address of its header, and the row of the poses of a body around, −1 of a link's.
HOW, HEADER_AT, POSE_ROW = range(3)
QUESTION = 3
#: `meet_poses` and `gap_poses`, whose addresses stand before the questions, and how many questions a body has: those
#: about bodies around first.
MEET_AT, GAP_AT, STRIDE, QUESTIONS = range(4)

_MEET_SIGNATURE = "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, int64, int64)"
_GAP_SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, float64, boolean, int64, int64, int64)"
)
_meet_at, _gap_at = native_call(_MEET_SIGNATURE), native_call(_GAP_SIGNATURE)
_state_of_part_at = native_call(PART_SIGNATURE)


@kernel
def state_of_meshes(scene, body, partner, p, q, margin):
    """BEYOND_MARGIN, NEAR, HITTING or OPEN of two bodies with a mesh, at the poses of links.

    partner : a body, or −1 − a body around.   p, q : a part of each, placed.
    """
    words = scene.words
    if words[MESH_QUESTIONS_AT] == 0:
        return OPEN
    column = words[N_AROUND] + partner if partner >= 0 else -1 - partner
    stride = view_i64(words[MESH_QUESTIONS_AT], QUESTIONS)[STRIDE]
    at = QUESTIONS + QUESTION * (body * stride + column)
    table = view_i64(words[MESH_QUESTIONS_AT], at + QUESTION)
    how = table[at + HOW]
    if how == UNKNOWN:
        return OPEN
    if how == HULLS:
        return _state_of_hulls(scene, p, q, margin)
    X = view_f64(words[MESH_POSES_AT], 32)
    _put_matrix(scene, body, -1, X, 0)
    _put_matrix(scene, partner, table[at + POSE_ROW], X, 16)
    if how == FACETS:
        return _state_of_facets(scene, table, table[at + HEADER_AT], margin)
    is_body = how == FACETS_OF_BODY
    header_at = table[at + HEADER_AT]
    part = q if is_body else p
    _place_items(header_at, X, 0 if is_body else 16)
    state = _state_of_part_at(words[STATE_OF_PART], (header_at, *rows_of_part(scene, part), margin))
    if state == MEETS:
        return HITTING
    return BEYOND_MARGIN if state == SURFACES_APART else OPEN


@kernel(inline=True)
def _state_of_hulls(scene, p, q, margin):
    row = ask(scene, p, q, Vec3(0.0, 0.0, 0.0), True, margin)
    if is_undecided_or_refused(row):
        return OPEN
    return BEYOND_MARGIN if row.doubles[LOWER] > margin else HITTING if row.flags[HIT_FLAG] != 0 else NEAR


@kernel(inline=True)
def _put_matrix(scene, body, row, X, to):
    """Write the (4, 4) pose of a body of the robot, or of a row of poses."""
    poses = scene.poses
    at = POSE * row
    if row < 0:
        poses = scene.links
        at = POSE * scene.bodies[BODY_INTS * body + LINK]
    for i in range(3):
        for j in range(3):
            X[to + 4 * i + j] = poses[at + 3 * i + j]
        X[to + 4 * i + 3] = poses[at + 9 + i]
        X[to + 12 + i] = 0.0
    X[to + 15] = 1.0


@kernel(inline=True)
def _place_items(header_at, X, at):
    """Write the pose of facets into their question."""
    poses = view_f64(view_i64(header_at, ITEM_POSES_AT + 1)[ITEM_POSES_AT], POSE)
    for i in range(3):
        for j in range(3):
            poses[3 * i + j] = X[at + 4 * i + j]
        poses[9 + i] = X[at + 4 * i + 3]
    poses[POSE_SLOP] = 0.0
    poses[POSE_TERMS] = poses[POSE_STRETCH] = -1.0


@kernel
def _state_of_facets(scene, table, header_at, margin):
    """Two bodies of facets: whether they meet, and with a margin whether they are farther apart."""
    words = scene.words
    XA_at = words[MESH_POSES_AT]
    states = view_u8(words[MESH_ROW_AT] + ROW, 2)
    states[0] = 0
    states[1] = 0
    if margin == 0.0:
        done = _meet_at(
            table[MEET_AT],
            (header_at, XA_at, 0, XA_at + 128, 0, 0, 1, False, False, 0, words[MESH_ROW_AT] + ROW),
        )
        return OPEN if done < 1 or states[0] > HIT else BEYOND_MARGIN if states[0] == APART else HITTING
    # Cores are looked for as far as the margin and both radii reach, rounded upwards.
    radii = view_f64(header_at + 8 * RADIUS_A, 2)
    reach = (margin + (radii[0] + radii[1])) * (1.0 + 2.0**-50)
    blank = view_i64(words[MESH_ROW_AT], ROW // 8)
    for k in range(ROW // 8):
        blank[k] = 0
    done = _gap_at(table[GAP_AT], (
        header_at, XA_at, 0, XA_at + 128, 0, 0, 1, False, margin, reach, False, 0, words[MESH_ROW_AT],
        words[MESH_ROW_AT] + ROW,
    ))
    row = view_row(words[MESH_ROW_AT])
    if done < 1 or is_undecided_or_refused(row):
        return OPEN
    if row.flags[HIT_FLAG] != 0:
        return HITTING
    return BEYOND_MARGIN if row.doubles[LOWER] > margin else NEAR
