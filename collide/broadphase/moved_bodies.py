"""Bodies that move, many at once: a kernel stores their poses; another makes pose rows and boxes of bodies of a single
part, and gives the boxes to the leaves of a box-tree.
"""

from __future__ import annotations

import numpy as np

from collide.broadphase.bounding_boxes import put_box
from collide.broadphase.moved_leaves import take_box
from collide.broadphase.tree_in_memory import tree_in_memory
from collide.broadphase.tree_over_bodies import TreeOverBodies
from collide.kernels import address_of, entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS, ShapeTable

#: Integers that say where bodies of a single part are: addresses of the table of shapes, of the row of each body, of
#: pose rows and of boxes; the number of bodies; and, out, how many have moved.
INTS_AT, NUMBERS_AT, ROW_OF_AT, POSES_AT, BOXES_AT, N_BODIES, N_MOVED = range(7)
SINGLE_PARTS = 7
#: Bodies whose boxes are made before their leaves are looked at.
_BLOCK = 64


@kernel(inline=True)
def _put_pose(poses, X, body):
    """A pose row without a pose of a part, as of `pose_table`."""
    for axis in range(3):
        for j in range(3):
            poses[POSE * body + 3 * axis + j] = X[16 * body + 4 * axis + j]
        poses[POSE * body + 9 + axis] = X[16 * body + 4 * axis + 3]
    poses[POSE * body + POSE_SLOP] = 0.0
    poses[POSE * body + POSE_TERMS] = -1.0
    poses[POSE * body + POSE_STRETCH] = -1.0


@entry("int64(int64, int64, int64, int64, float64, int64)")
def move_single_parts(parts_at, X_WBs_at, is_moved_at, tree_at, spacing, bodies_at):
    """Take new poses of bodies of a single part without a pose of its own; flags of moved bodies are cleared.

    parts : SINGLE_PARTS integers.   X_WBs : 16 doubles a body, of all.   is_moved : a byte a body.
    tree : to be given the boxes, as by `take_boxes`, or 0.   spacing : as of `take_boxes`.
    bodies : out, one integer a body: with a tree the bodies whose leaves have changed; else all that have moved.

    Returns how many bodies are written; −1 for an unbounded box of a body with a leaf, or a bounded box of a body
    without.
    """
    header = view_i64(parts_at, SINGLE_PARTS)
    n = header[N_BODIES]
    row_of, bodies = view_i64(header[ROW_OF_AT], n), view_i64(bodies_at, n)
    X = view_f64(X_WBs_at, 16 * n)
    poses, boxes = view_f64(header[POSES_AT], POSE * n), view_f64(header[BOXES_AT], 6 * n)
    n_moved = header[N_MOVED] = _take_flags(is_moved_at, n, bodies)
    first = count = 0
    while first < n_moved:  # in two loops, so that the memory of several bodies is waited for at once
        last = min(first + _BLOCK, n_moved)
        for k in range(first, last):
            _put_pose(poses, X, bodies[k])
            put_box(header[INTS_AT], header[NUMBERS_AT], row_of[bodies[k]], poses, bodies[k], boxes)
        if tree_at != 0:
            for k in range(first, last):
                body = bodies[k]
                state = take_box(tree_in_memory(tree_at), body, boxes, 6 * body, spacing)
                if state < 0:
                    return -1
                if state > 0:
                    bodies[count] = body
                    count += 1
        first = last
    return count if tree_at != 0 else n_moved


@kernel(inline=True)
def _take_flags(flags_at, n, numbers):
    """Write the numbers of set flags, of n bytes, ascending, and clear the flags; returns their number."""
    flags, eight = view_u8(flags_at, n), view_i64(flags_at, n >> 3)
    count = k = 0
    while k < n:
        if flags[k] != 0:
            flags[k] = 0
            numbers[count] = k
            count += 1
        elif k & 7 == 0 and k + 8 <= n and eight[k >> 3] == 0:
            k += 7
        k += 1
    return count


@entry("void(int64, int64, int64, int64, int64, int64)")
def place_bodies(rows_at, k, X_new_at, n, X_WBs_at, is_moved_at):
    """Store k poses, 16 doubles each, in rows of all n poses, and set the flags of these rows, a byte each."""
    rows = view_i64(rows_at, k)
    X_new, X = view_f64(X_new_at, 16 * k), view_f64(X_WBs_at, 16 * n)
    is_moved = view_u8(is_moved_at, n)
    for i in range(k):
        for j in range(16):
            X[16 * rows[i] + j] = X_new[16 * i + j]
        is_moved[rows[i]] = 1


def store_poses(rows: np.ndarray, X_new: np.ndarray, X_WBs: np.ndarray, is_moved: np.ndarray) -> None:
    """Store poses X_new (k, 4, 4) in rows (k,) int64 of X_WBs (n, 4, 4), and set flags (n,) bool."""
    X_new = np.ascontiguousarray(X_new)
    place_bodies(
        address_of(rows), len(rows), address_of(X_new), len(X_WBs), address_of(X_WBs), address_of(is_moved)
    )


class SingleParts:
    """Bodies of a single part in memory.

    table : their shapes.   row_of : (n,) int64, the row of the table of each body.   poses : (n, POSE) rows.
    boxes : (n, 6).
    """

    def __init__(self, table: ShapeTable, row_of: np.ndarray, poses: np.ndarray, boxes: np.ndarray):
        columns = row_of, poses, boxes
        self._held = table, columns
        self._header = np.array([*table.addresses, *map(address_of, columns), len(row_of), 0])

    def move(
        self, is_moved: np.ndarray, X_WBs: np.ndarray, tree: TreeOverBodies | None
    ) -> tuple[int, np.ndarray | None]:
        """Take new poses of the bodies with flags (n,), from poses (n, 4, 4) of all bodies, and clear these flags.

        Returns (how many bodies moved, their numbers). A tree takes their boxes; then the numbers are ``None``.
        """
        bodies = np.empty(len(is_moved), dtype=np.int64)
        tree_at, spacing = (0, 0.0) if tree is None else (address_of(tree.header()), tree.spacing)
        count = move_single_parts(
            address_of(self._header), address_of(X_WBs), address_of(is_moved), tree_at, spacing, address_of(bodies)
        )
        if tree is not None:
            tree.fit_above(bodies, count)
        return int(self._header[N_MOVED]), bodies[:count] if tree is None else None
