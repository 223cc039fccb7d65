"""Derivatives of distances by each column of q.

Moving with joint j, a point p of its child's subtree has velocity ω × (p − o) or along the axis; the distance of
separate bodies changes by the normal times the difference of both witness points' velocities.

A depth has a derivative where proven the least of all directions. The depth of bodies that are not convex is the length
of some separating translation; a shorter translation may exist, and the next configuration may find the shorter. These
rows are not certified, and only certified rows have a gradient. Between curved parts normals are taken to more digits
than rows have (`settled_normals.py`).
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE
from collide.narrowphase.rows import BODY_B, CERTIFIED, DISTANCE, ROW, view_row
from collide.numerics.vec3 import Vec3, cross, dot, neg, put_vec3, rotate, sub, vec3_at
from collide.robots.check_configurations import begin_configuration
from collide.robots.check_scene import BODY_INTS, LINK, N_LINKS, view_scene
from collide.robots.forward_kinematics import (
    ACROSS,
    AXIS,
    CHILD,
    COLUMN,
    FIXED,
    FLOATING,
    JOINT_DOUBLES,
    JOINT_INTS,
    KIND,
    MULTIPLIER,
    PARENT,
    PLANAR,
    TRANSLATION,
    X_PJ,
    sine_cosine_of,
)
from collide.robots.nearest_pairs import BODY_A, NONE
from collide.robots.settled_normals import normal_of_row, unknown_normal

#: Doubles of a row's normal and witness points, as derivatives take them.
WITNESS = 9


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def distance_gradients(header_at, q_at, dof, n, of_at, m, moves_at, rows_at, witness_at, out_at):
    """(m, dof) derivatives [m/rad or m/m] for rows of `nearest_pairs.py`; NaN where the distance has no derivative, for
    the reason in `RobotDistances.no_gradient`.

    of : (m,) the configuration of each row, of n.   moves : (joints, links) bytes, 1 where a joint moves a link.
    witness : (m, WITNESS) receives the normal, NaN where not known, and points of both bodies in W; 0 for nowhere.
    """
    scene = view_scene(header_at)
    joints = scene.joints
    n_links = scene.words[N_LINKS]
    q = view_f64(q_at, dof * n)
    of = view_i64(of_at, m)
    witness = view_f64(witness_at, WITNESS * m)
    out = view_f64(out_at, dof * m)
    moves = view_u8(moves_at, joints.n * n_links)
    placed = -1
    for k in range(m):
        row = view_row(rows_at + ROW * k)
        is_known = row.words[BODY_A] != NONE and row.flags[CERTIFIED] != 0
        normal = unknown_normal()
        at = dof * of[k]
        if is_known and row.doubles[DISTANCE] != 0.0:
            if placed != at:
                placed = at
                begin_configuration(scene, q, at)
            normal = normal_of_row(scene, row)
        if witness_at != 0:
            put_vec3(witness, WITNESS * k, normal.nhat)
            put_vec3(witness, WITNESS * k + 3, normal.p_a)
            put_vec3(witness, WITNESS * k + 6, normal.p_b)
        is_differentiable = normal.nhat.x == normal.nhat.x
        for j in range(dof):
            out[dof * k + j] = 0.0 if is_differentiable else math.nan
        if not is_differentiable:
            continue
        link_a = scene.bodies[BODY_INTS * row.words[BODY_A] + LINK]
        link_b = scene.bodies[BODY_INTS * row.words[BODY_B] + LINK] if row.words[BODY_B] >= 0 else -1
        for j in range(joints.n):
            moves_a = moves[n_links * j + link_a] != 0
            moves_b = link_b >= 0 and moves[n_links * j + link_b] != 0
            if moves_a and not moves_b:
                _add_joint(scene, j, q, at, neg(normal.nhat), normal.p_a, out, dof * k)
            elif moves_b and not moves_a:
                _add_joint(scene, j, q, at, normal.nhat, normal.p_b, out, dof * k)


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def point_jacobians(header_at, q_at, dof, m, moves_at, bodies_at, points_at, out_at):
    """(m, 3, dof) derivatives by q of points (m, 3) in W that move with bodies of the robot, at configurations q
    (m, dof).

    moves : (joints, links) bytes, 1 where a joint moves a link.   bodies : (m,) int64.
    """
    scene = view_scene(header_at)
    n_links = scene.words[N_LINKS]
    q = view_f64(q_at, dof * m)
    bodies = view_i64(bodies_at, m)
    points = view_f64(points_at, 3 * m)
    out = view_f64(out_at, 3 * dof * m)
    moves = view_u8(moves_at, scene.joints.n * n_links)
    for k in range(m):
        begin_configuration(scene, q, dof * k)
        link = scene.bodies[BODY_INTS * bodies[k] + LINK]
        for j in range(3 * dof):
            out[3 * dof * k + j] = 0.0
        for j in range(scene.joints.n):
            if moves[n_links * j + link] != 0:
                p_W = vec3_at(points, 3 * k)
                _add_joint(scene, j, q, dof * k, Vec3(1.0, 0.0, 0.0), p_W, out, dof * (3 * k))
                _add_joint(scene, j, q, dof * k, Vec3(0.0, 1.0, 0.0), p_W, out, dof * (3 * k + 1))
                _add_joint(scene, j, q, dof * k, Vec3(0.0, 0.0, 1.0), p_W, out, dof * (3 * k + 2))


@kernel
def _add_joint(scene, j, q, first, direction, p_W, out, to):
    """Add what the columns of joint j do to a point p along a direction.

    first, to : where the configuration begins in q, and the row of derivatives in out.
    """
    joints, links = scene.joints, scene.links
    at = JOINT_DOUBLES * j
    kind = joints.ints[JOINT_INTS * j + KIND]
    column = to + joints.ints[JOINT_INTS * j + COLUMN]
    child = POSE * joints.ints[JOINT_INTS * j + CHILD]
    if kind == FIXED:
        return
    if kind == FLOATING:
        _add_floating(scene, j, q[first + joints.ints[JOINT_INTS * j + COLUMN] + 5], column, direction, p_W, out)
        return
    axis = rotate(links, child, vec3_at(joints.doubles, at + AXIS))
    multiplier = joints.doubles[at + MULTIPLIER]
    if kind == TRANSLATION:
        out[column] += multiplier * dot(axis, direction)
        return
    if kind == PLANAR:
        # The joint shifts before turning: along axes of the frame before the turn.
        for k in range(2):
            across = _in_joint_frame(scene, j, vec3_at(joints.doubles, at + ACROSS + 3 * k))
            out[column + k] += dot(across, direction)
        column += 2
    arm = sub(p_W, vec3_at(links, child + 9))
    out[column] += multiplier * dot(cross(axis, arm), direction)


@kernel(cold=True)
def _add_floating(scene, j, yaw, column, direction, p_W, out):
    """x, y, z along the joint frame's axes; yaw about its z, pitch about its y as yaw leaves it, roll about the child's
    x.
    """
    links = scene.links
    child = POSE * scene.joints.ints[JOINT_INTS * j + CHILD]
    arm = sub(p_W, vec3_at(links, child + 9))
    rotation = sine_cosine_of(yaw)
    z = _in_joint_frame(scene, j, Vec3(0.0, 0.0, 1.0))
    out[column] += dot(_in_joint_frame(scene, j, Vec3(1.0, 0.0, 0.0)), direction)
    out[column + 1] += dot(_in_joint_frame(scene, j, Vec3(0.0, 1.0, 0.0)), direction)
    out[column + 2] += dot(z, direction)
    pitch_axis = _in_joint_frame(scene, j, Vec3(-rotation.sine, rotation.cosine, 0.0))
    out[column + 3] += dot(cross(rotate(links, child, Vec3(1.0, 0.0, 0.0)), arm), direction)
    out[column + 4] += dot(cross(pitch_axis, arm), direction)
    out[column + 5] += dot(cross(z, arm), direction)


@kernel(inline=True)
def _in_joint_frame(scene, j, v):
    """A vector of joint j's frame, in W's axes."""
    parent = POSE * scene.joints.ints[JOINT_INTS * j + PARENT]
    return rotate(scene.links, parent, rotate(scene.joints.doubles, JOINT_DOUBLES * j + X_PJ, v))
