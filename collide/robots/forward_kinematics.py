"""Forward kinematics: the pose of every link for given joint values, many configurations at a time.

Frames as in `robot.py`: ``X_WL = X_WP @ X_PJ @ X_JL(q)``, a joint at a time from the root on. Products and sums are
written out, so that a configuration gives the same bits alone, in a batch, and in a checker.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.kernels.lanes import any_of, select
from collide.numerics.sine_cosine import LARGEST_ANGLE, SineCosine, floor_of, sine_cosine
from collide.robots.kinematic_tree import Joint

#: What a joint does. A turn about a coordinate axis of its frame, as nearly all are, mixes two columns of the pose.
FIXED, ROTATION, ROTATION_ABOUT_COORDINATE, TRANSLATION, PLANAR, FLOATING = range(6)
# Integers of a joint: what it does, parent and child link, its first column of q, and the coordinate it turns about.
KIND, PARENT, CHILD, COLUMN, COORDINATE = range(5)
JOINT_INTS = 5
# Doubles of a joint: X_PJ (R row by row, then t), its axis, two axes of a planar joint across it, and what its value is
# of its column's: multiplier and offset.
X_PJ, AXIS, ACROSS, MULTIPLIER, OFFSET = 0, 12, 15, 21, 22
JOINT_DOUBLES = 23
#: Doubles of a link's pose: R row by row, then t.
LINK_POSE = 12

_KINDS = {
    "fixed": FIXED, "revolute": ROTATION, "continuous": ROTATION, "prismatic": TRANSLATION, "planar": PLANAR,
    "floating": FLOATING,
}
_FULL_CIRCLE = 2.0 * math.pi


class JointTable(NamedTuple):
    """Joints as kernels read them, parents before children.

    ints : (joints, JOINT_INTS) int64.   doubles : (joints, JOINT_DOUBLES).   root : number of the root link.
    n_links, dof : of the robot.
    """

    ints: np.ndarray
    doubles: np.ndarray
    root: int
    n_links: int
    dof: int


def joint_table(
    joints: Sequence[Joint], link_numbers: Mapping[str, int], columns: Mapping[str, int],
    drivers: Mapping[str, tuple[str, float, float]], root: str, dof: int,
) -> JointTable:
    """The `JointTable` of joints sorted from the root on.

    columns : joint → its first column of q.   drivers : joint → (its driving joint, multiplier, offset).
    """
    ints = np.zeros((len(joints), JOINT_INTS), dtype=np.int64)
    doubles = np.zeros((len(joints), JOINT_DOUBLES))
    for k, joint in enumerate(joints):
        kind, coordinate, multiplier = _KINDS[joint.type], 0, 1.0
        driver, offset = joint.name, 0.0
        if kind in (ROTATION, TRANSLATION):
            driver, multiplier, offset = drivers[joint.name]
        if kind == ROTATION and (np.abs(joint.axis) == 1.0).any():
            kind, coordinate = ROTATION_ABOUT_COORDINATE, int(np.argmax(np.abs(joint.axis)))
        column = columns[driver] if kind != FIXED else 0
        ints[k] = kind, link_numbers[joint.parent], link_numbers[joint.child], column, coordinate
        doubles[k, X_PJ : X_PJ + 9], doubles[k, 9:12] = joint.X_PJ[:3, :3].ravel(), joint.X_PJ[:3, 3]
        doubles[k, AXIS : AXIS + 3] = joint.axis
        if kind == PLANAR:
            doubles[k, ACROSS : ACROSS + 6] = np.concatenate(_across(joint.axis))
        doubles[k, MULTIPLIER], doubles[k, OFFSET] = multiplier, offset
    return JointTable(ints, doubles, link_numbers[root], len(link_numbers), dof)


def _across(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two axes of the plane across a normal.

    The first is the coordinate axis farthest from the normal, made orthogonal to it: for normal z they are x and y
    themselves.
    """
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - (first @ normal) * normal
    first /= math.sqrt(float(first @ first))
    return first, np.cross(normal, first)


def link_poses_of(table: JointTable, q: np.ndarray, X_WR: np.ndarray) -> np.ndarray:
    """(N, links, 4, 4) poses X_WL for configurations q (N, dof), float64 and C-contiguous, of a root at X_WR (4, 4)."""
    out = np.empty((len(q), table.n_links, 4, 4))
    base = np.concatenate([X_WR[:3, :3].ravel(), X_WR[:3, 3]])
    scratch = np.empty((table.n_links, LINK_POSE))
    pose_all_links(
        address_of(table.ints), address_of(table.doubles), len(table.ints), table.root, table.n_links, address_of(base),
        address_of(q), table.dof, len(q), address_of(scratch), address_of(out),
    )
    return out


@entry("boolean(int64, int64)", nogil=False)
def are_finite(at, n):
    """Whether n doubles are numbers."""
    values = view_f64(at, n)
    for k in range(n):
        if not abs(values[k]) < math.inf:
            return False
    return True


class Joints(NamedTuple):
    """Views of a `JointTable`.   n : joints.   root : link.   base : X_WR, LINK_POSE doubles."""

    ints: Any
    doubles: Any
    n: int
    root: int
    base: Any


@kernel(inline=True)
def view_joints(ints_at, doubles_at, n, root, base_at):
    """The `Joints` at these addresses."""
    return Joints(
        view_i64(ints_at, JOINT_INTS * n), view_f64(doubles_at, JOINT_DOUBLES * n), n, root,
        view_f64(base_at, LINK_POSE),
    )


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def pose_all_links(ints_at, doubles_at, n_joints, root, n_links, base_at, q_at, dof, n, scratch_at, out_at):
    """(n, links, 4, 4) poses for n configurations of ``dof`` doubles each.

    base : LINK_POSE doubles of the root.   scratch : LINK_POSE doubles a link.
    """
    joints = view_joints(ints_at, doubles_at, n_joints, root, base_at)
    links = view_f64(scratch_at, LINK_POSE * n_links)
    q = view_f64(q_at, dof * n)
    out = view_f64(out_at, 16 * n * n_links)
    for k in range(n):
        pose_links(joints, q, dof * k, links, LINK_POSE)
        for link in range(n_links):
            at = 16 * (k * n_links + link)
            for i in range(3):
                for j in range(3):
                    out[at + 4 * i + j] = links[LINK_POSE * link + 3 * i + j]
                out[at + 4 * i + 3] = links[LINK_POSE * link + 9 + i]
                out[at + 12 + i] = 0.0
            out[at + 15] = 1.0


@kernel
def pose_links(joints, q, first, links, stride):
    """Write the poses of all links for the configuration from ``first`` on of q.

    links : a pose every ``stride`` doubles, the first LINK_POSE of them written.
    """
    for k in range(LINK_POSE):
        links[stride * joints.root + k] = joints.base[k]
    for j in range(joints.n):
        kind = joints.ints[JOINT_INTS * j + KIND]
        parent = stride * joints.ints[JOINT_INTS * j + PARENT]
        child = stride * joints.ints[JOINT_INTS * j + CHILD]
        column = first + joints.ints[JOINT_INTS * j + COLUMN]
        at = JOINT_DOUBLES * j
        _put_product(links, parent, joints.doubles, at + X_PJ, links, child)
        if kind == FIXED:
            continue
        value = q[column] * joints.doubles[at + MULTIPLIER] + joints.doubles[at + OFFSET]
        if kind == ROTATION_ABOUT_COORDINATE:
            coordinate = joints.ints[JOINT_INTS * j + COORDINATE]
            _rotate_columns(links, child, coordinate, joints.doubles[at + AXIS + coordinate], value)
        elif kind == TRANSLATION:
            _translate(links, child, joints.doubles, at + AXIS, value)
        elif kind == ROTATION:
            _rotate(links, child, joints.doubles, at + AXIS, value)
        elif kind == PLANAR:
            _translate_across(links, child, joints.doubles, at + ACROSS, q[column], q[column + 1])
            _rotate(links, child, joints.doubles, at + AXIS, q[column + 2])
        else:
            _float(links, child, q, column)


@kernel(inline=True)
def _put_product(A, a, B, b, out, to):
    """out[to] = A[a] @ B[b], poses of 12 doubles each."""
    for i in range(3):
        x = A[a + 3 * i]
        y = A[a + 3 * i + 1]
        z = A[a + 3 * i + 2]
        for j in range(3):
            out[to + 3 * i + j] = x * B[b + j] + y * B[b + 3 + j] + z * B[b + 6 + j]
        out[to + 9 + i] = x * B[b + 9] + y * B[b + 10] + z * B[b + 11] + A[a + 9 + i]


@kernel(inline=True)
def sine_cosine_of(angle):
    """`sine_cosine` of any angle [rad]. Angles beyond LARGEST_ANGLE are first reduced in doubles, whose spacing at such
    sizes makes the reduction no worse; NaN for infinite ones.
    """
    size = abs(angle)
    is_large = size > LARGEST_ANGLE
    if any_of(is_large):
        rest = size - floor_of(size / _FULL_CIRCLE) * _FULL_CIRCLE
        rest = select(rest < 0.0, 0.0, select(rest > _FULL_CIRCLE, _FULL_CIRCLE, rest))
        size = select(is_large, rest, size)
    pair = sine_cosine(size)
    return SineCosine(select(angle < 0.0, -pair.sine, pair.sine), pair.cosine)


@kernel(inline=True)
def _rotate_columns(links, at, coordinate, sign, angle):
    """Turn the pose at ``at`` about its own coordinate axis, by ``sign`` times the angle [rad]: two columns are
    mixed.
    """
    sine, cosine = sine_cosine_of(angle)
    sine *= sign
    u = (coordinate + 1) % 3
    v = (coordinate + 2) % 3
    for i in range(3):
        x = links[at + 3 * i + u]
        y = links[at + 3 * i + v]
        links[at + 3 * i + u] = x * cosine + y * sine
        links[at + 3 * i + v] = y * cosine - x * sine


@kernel(cold=True)
def _rotate(links, at, axes, axis, angle):
    """Turn the pose at ``at`` about any unit axis of its frame: Rodrigues' formula.

    The diagonal is a² + cos·(1 − a²), so that what does not turn keeps exact zeros and ones.
    """
    sine, cosine = sine_cosine_of(angle)
    t = 1.0 - cosine
    x = axes[axis]
    y = axes[axis + 1]
    z = axes[axis + 2]
    xy = x * y * t
    zx = z * x * t
    yz = y * z * t
    for i in range(3):
        a = links[at + 3 * i]
        b = links[at + 3 * i + 1]
        c = links[at + 3 * i + 2]
        links[at + 3 * i] = a * (x * x + cosine * (1.0 - x * x)) + b * (xy + z * sine) + c * (zx - y * sine)
        links[at + 3 * i + 1] = a * (xy - z * sine) + b * (y * y + cosine * (1.0 - y * y)) + c * (yz + x * sine)
        links[at + 3 * i + 2] = a * (zx + y * sine) + b * (yz - x * sine) + c * (z * z + cosine * (1.0 - z * z))


@kernel(inline=True)
def _translate(links, at, axes, axis, length):
    """Shift the pose at ``at`` along an axis of its frame."""
    x = length * axes[axis]
    y = length * axes[axis + 1]
    z = length * axes[axis + 2]
    for i in range(3):
        r = at + 3 * i
        links[at + 9 + i] = links[r] * x + links[r + 1] * y + links[r + 2] * z + links[at + 9 + i]


@kernel(cold=True)
def _translate_across(links, at, axes, across, u, v):
    """Shift the pose at ``at`` by u and v along the two axes at ``across``."""
    _translate(links, at, axes, across, u)
    _translate(links, at, axes, across + 3, v)


@kernel(cold=True)
def _float(links, at, q, column):
    """Shift the pose at ``at`` by x, y, z, then turn it by yaw, pitch and roll about its own axes, in this order.

    The same rotation as roll, pitch and yaw about fixed axes, as in URDF.
    """
    for i in range(3):
        r = at + 3 * i
        links[at + 9 + i] = (
            links[r] * q[column] + links[r + 1] * q[column + 1] + links[r + 2] * q[column + 2] + links[at + 9 + i]
        )
    for k in range(3):
        _rotate_columns(links, at, 2 - k, 1.0, q[column + 5 - k])
