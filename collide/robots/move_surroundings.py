"""Moved bodies around a robot: poses and boxes of their parts in a thread's workspace, and the tree over the boxes.

The tree keeps its form: the box of a node becomes the box around its children, so that a walk meets every part with a
near box. Poses and boxes have the bytes of poses and boxes made anew.
"""

from __future__ import annotations

from collide.broadphase.bounding_boxes import put_box
from collide.broadphase.graded_boxes import BODY
from collide.broadphase.graded_boxes import LINK as NODE_LINK
from collide.broadphase.moved_leaves import fit_nodes
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import (
    NUMBERS,
    POSE,
    POSE_SLOP,
    POSE_STRETCH,
    POSE_TERMS,
    PRODUCT_SLOP,
    REACH,
)
from collide.narrowphase.posed_pair import stretch_of_pose
from collide.robots.check_scene import (
    INTS_AT,
    N_LINK_PARTS,
    N_NODES,
    N_PARTS,
    NODE_LINKS_AT,
    NODES_AT,
    NUMBERS_AT,
    PART_POSES_AT,
    POSES_AT,
    ROUNDINGS_OF_ROTATIONS,
    SHAPE_OF_AT,
    WALKS_AT,
    skew_of,
)

#: A pose of a body, and of a part in its body: (4, 4).
_MATRIX = 16
#: What `move_surroundings` says besides the number of parts that have moved: a matrix is not a rotation, so that boxes
#: of robots need other slack; a field has moved, whose question is to be made anew.
SKEWED, FIELD_MOVED = -1, -2


@entry("int64(int64, int64, int64, int64, int64)")
def move_surroundings(header_at, X_WBs_at, before_at, rows_at, boxes_at):
    """Bring parts around to the poses of their bodies; returns the number of parts moved, or FIELD_MOVED; or
    SKEWED, and nothing is moved.

    X_WBs, before : (n, 4, 4) poses of a World's bodies as they stand, and as the parts stand now.   rows : (parts,)
        int64 row of each part's body.   boxes : (parts, 6) of the parts in the world, written like poses and nodes.
    """
    words = view_i64(header_at, WALKS_AT + 1)
    n_link_parts = words[N_LINK_PARTS]
    n = words[N_PARTS] - n_link_parts
    rows = view_i64(rows_at, n)
    shape_of = view_i64(words[SHAPE_OF_AT], words[N_PARTS])
    walks = view_i64(words[WALKS_AT], n + 1)  # behind a 0
    poses = view_f64(words[POSES_AT] + 8 * POSE * n_link_parts, POSE * n)
    boxes = view_f64(boxes_at, 6 * n)
    for k in range(n):
        now = view_f64(X_WBs_at + 8 * _MATRIX * rows[k], _MATRIX)
        if not _is_same(now, view_f64(before_at + 8 * _MATRIX * rows[k], _MATRIX)) and _is_skewed(now):
            return SKEWED
    n_moved = 0
    has_field = False
    for k in range(n):
        now = view_f64(X_WBs_at + 8 * _MATRIX * rows[k], _MATRIX)
        if _is_same(now, view_f64(before_at + 8 * _MATRIX * rows[k], _MATRIX)):
            continue
        has_field = has_field or walks[k + 1] != 0
        shape = shape_of[n_link_parts + k]
        numbers = view_f64(words[NUMBERS_AT] + 8 * NUMBERS * shape, NUMBERS)
        _put_pose(poses, POSE * k, now, view_f64(words[PART_POSES_AT] + 8 * _MATRIX * k, _MATRIX), numbers[REACH])
        put_box(words[INTS_AT], words[NUMBERS_AT], shape, poses, k, boxes)
        n_moved += 1
    if n_moved > 0:
        _fit_nodes(words, boxes)
    return FIELD_MOVED if has_field else n_moved


@kernel(inline=True)
def _is_same(A, B):
    for k in range(_MATRIX):
        if A[k] != B[k]:
            return False
    return True


@kernel(inline=True)
def _is_skewed(X):
    """Whether the matrix of a pose is farther from a rotation than roundings are."""
    return not skew_of(X) < ROUNDINGS_OF_ROTATIONS


@kernel(inline=True)
def _is_identity(X):
    for i in range(4):
        for j in range(4):
            if X[4 * i + j] != (1.0 if i == j else 0.0):
                return False
    return True


@kernel
def _put_pose(poses, to, X_WB, X_BP, reach):
    """A row of poses, number by number as `shape_table.pose_table` has it."""
    alone = _is_identity(X_BP)
    at_origin = _is_identity(X_WB)
    stretch = 1.0
    parts = 0.0
    shift = 0.0
    for i in range(3):
        x = X_WB[4 * i]
        y = X_WB[4 * i + 1]
        z = X_WB[4 * i + 2]
        for j in range(3):
            if alone:
                poses[to + 3 * i + j] = X_WB[4 * i + j]
            elif at_origin:
                poses[to + 3 * i + j] = X_BP[4 * i + j]
            else:
                poses[to + 3 * i + j] = x * X_BP[j] + y * X_BP[4 + j] + z * X_BP[8 + j]
        if alone:
            poses[to + 9 + i] = X_WB[4 * i + 3]
        elif at_origin:
            poses[to + 9 + i] = X_BP[4 * i + 3]
        else:
            poses[to + 9 + i] = x * X_BP[3] + y * X_BP[7] + z * X_BP[11] + X_WB[4 * i + 3]
        stretch = max(stretch, abs(x) + abs(y) + abs(z))
        parts += abs(X_BP[4 * i + 3])
        shift = max(shift, abs(X_WB[4 * i + 3]))
    is_product = not (alone or at_origin)
    poses[to + POSE_SLOP] = PRODUCT_SLOP * (stretch * (reach + parts) + shift) if is_product else 0.0
    poses[to + POSE_TERMS] = -1.0
    poses[to + POSE_STRETCH] = stretch_of_pose(poses, to)


@kernel(inline=True)
def _fit_nodes(words, boxes):
    """Leaves get the boxes of their parts, and inner nodes the boxes around their children."""
    n = words[N_NODES]
    nodes = view_f64(words[NODES_AT], 6 * n)
    links = view_i64(words[NODE_LINKS_AT], NODE_LINK * n)
    for node in range(n):
        part = links[NODE_LINK * node + BODY]
        if part >= 0:
            for k in range(6):
                nodes[6 * node + k] = boxes[6 * part + k]
    fit_nodes(links, nodes, 0, n)
