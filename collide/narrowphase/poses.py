"""Two convex sets at many pairs of poses, and at one: from matrices to answers inside kernels.

Checking a pose, laying out a row and reading a boolean took numpy five times as long as a pair of boxes
takes GJK. Poses go through in blocks that stay in the cache; the narrowphase is called where it was
compiled (`_jit.native_call`), not compiled once more.
"""

from __future__ import annotations

import math

from collide._jit import address_in_kernel, entry, kernel, native_call, view_f64, view_i64, view_u8
from collide.geometry.tables import POSE, POSE_SLOP, POSE_TERMS
from collide.narrowphase.answer import SIGNATURE
from collide.narrowphase.rows import HIT, HOW, NORMAL, ROW
from collide.results import REFUSED, UNDECIDED
from collide.transforms import LARGEST, ROTATION_TOLERANCE

_answer_at = native_call(SIGNATURE)

#: Poses that go through together.
BLOCK = 64

#: What `answer_poses` says besides a count: rows of the block before it are open, or a pose is no pose.
OPEN, BAD_POSE = range(1, 3)

# Workspace, integers: addresses of everything (see `Workspace` in `run.py`).
(
    CORE, INTS_AT, NUMBERS_AT, POSES_AT, SHAPE_OF_AT, PAIRS_AT, ROWS_AT, DOUBLES_AT, INTEGERS_AT, ANSWERED,
) = range(10)  # fmt: skip
#: Integers of the header.
HEADER = 10


@kernel
def _set_pose(poses, at, X, x, check):
    """Pose row at ``at`` becomes the matrix at X[x …]; False where it is no pose (`transforms.as_poses`)."""
    good = X[x + 12] == 0.0 and X[x + 13] == 0.0 and X[x + 14] == 0.0 and X[x + 15] == 1.0
    for i in range(3):
        for j in range(3):
            value = X[x + 4 * i + j]
            good = good and abs(value) <= LARGEST
            poses[at + 3 * i + j] = value
        value = X[x + 4 * i + 3]
        good = good and abs(value) <= LARGEST
        poses[at + 9 + i] = value
    poses[at + POSE_SLOP] = 0.0
    poses[at + POSE_TERMS] = -1.0
    return good and (not check or _is_rotation(poses, at))


@kernel
def _is_rotation(R, at):
    for i in range(3):
        for j in range(i + 1):
            product = R[at + i] * R[at + j] + R[at + 3 + i] * R[at + 3 + j] + R[at + 6 + i] * R[at + 6 + j]
            if not abs(product - (1.0 if i == j else 0.0)) <= ROTATION_TOLERANCE:
                return False
    return (
        R[at] * (R[at + 4] * R[at + 8] - R[at + 5] * R[at + 7])
        + R[at + 1] * (R[at + 5] * R[at + 6] - R[at + 3] * R[at + 8])
        + R[at + 2] * (R[at + 3] * R[at + 7] - R[at + 4] * R[at + 6])
        > 0.0
    )


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, float64, boolean, int64, int64)")
def answer_poses(
    header_at, which_at, XA_at, step_a, XB_at, step_b, first, n, boolean, limit, check, axes_at, out_at
):
    """Answer poses ``first`` … n − 1 of a pair, or of n pairs; 0, OPEN or BAD_POSE.

    header : HEADER integers; [ANSWERED] becomes the number of poses answered in all. Where it stops OPEN,
        the rows of the last block are left where the block's rows stand, for the exact stage.
    which : 0, or two shape rows a pose.   XA, XB : matrices; step 16 or, for a single pose, 0.
    check : refuse matrices that are no rotation.
    axes : 0, or of booleans three doubles a pose: an axis to try first, replaced by one that parts the bodies.
    out : booleans: a byte a pose; else a row of PAIR_DTYPE a pose, zeroed, which is where rows stand.
    """
    header = view_i64(header_at, HEADER)
    poses = view_f64(header[POSES_AT], 2 * BLOCK * POSE)
    shape_of = view_i64(header[SHAPE_OF_AT], 2 * BLOCK)
    rows_at = header[ROWS_AT]
    scratch = view_i64(rows_at, BLOCK * ROW // 8)
    pairs = view_i64(header[PAIRS_AT], 2 * BLOCK)
    for k in range(BLOCK):
        pairs[2 * k] = k if step_a != 0 or which_at != 0 else 0
        pairs[2 * k + 1] = BLOCK + (k if step_b != 0 or which_at != 0 else 0)
        shape_of[k] = 0
        shape_of[BLOCK + k] = 1
    done = first
    while done < n:
        count = min(BLOCK, n - done)
        good = True
        for k in range(count):
            if which_at != 0:
                which = view_i64(which_at + 16 * (done + k), 2)
                shape_of[k] = which[0]
                shape_of[BLOCK + k] = which[1]
            # A pose that goes with all of the other's is laid out once, where shapes are.
            if pairs[2 * k] == k:
                good = _set_pose(poses, k * POSE, view_f64(XA_at + 8 * step_a * (done + k), 16), 0, check) and good
            if pairs[2 * k + 1] == BLOCK + k:
                at = (BLOCK + k) * POSE
                good = _set_pose(poses, at, view_f64(XB_at + 8 * step_b * (done + k), 16), 0, check) and good
        if not good:
            header[ANSWERED] = done
            return BAD_POSE
        if boolean:
            for k in range(count * ROW // 8):
                scratch[k] = 0
            if axes_at != 0:
                for k in range(count):
                    row = view_f64(rows_at + ROW * k, 12)
                    axis = view_f64(axes_at + 24 * (done + k), 3)
                    for j in range(3):
                        row[NORMAL + j] = axis[j]
        else:
            rows_at = out_at + ROW * done
        _answer_at(
            header[CORE],
            (
                header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], header[PAIRS_AT], count,
                boolean, False, limit, rows_at, header[DOUBLES_AT], header[INTEGERS_AT],
            ),
        )  # fmt: skip
        left_open = False
        for k in range(count):
            marks = view_u8(rows_at + ROW * k, ROW)
            left_open = left_open or marks[HOW] == UNDECIDED or marks[HOW] == REFUSED
            if boolean:
                view_u8(out_at + done + k, 1)[0] = marks[HIT]
                if axes_at != 0 and marks[HIT] == 0:
                    row = view_f64(rows_at + ROW * k, 12)
                    axis = view_f64(axes_at + 24 * (done + k), 3)
                    for j in range(3):
                        axis[j] = row[NORMAL + j]
        done += count
        header[ANSWERED] = done
        if left_open:
            return OPEN
    return 0


@kernel(inline=True)
def _is_matrix(X):
    """Whether this is a C-contiguous (4, 4) array: nobody has looked yet (`Entry.unchecked`).

    That its items are doubles shows in the last one being 1.0, which `_set_pose` asks: no integer,
    pointer, pair of floats or double of the other byte order that is a pose has that bit pattern.
    """
    return X.shape[0] == 4 and X.shape[1] == 4 and X.strides[0] == 32 and X.strides[1] == 8


@kernel
def _single(header_at, X_WA, X_WB, boolean, row_at):
    """One pair at one pair of poses: 0 apart, 1 hit, −1 where more than doubles, or an error, is called for."""
    if not (_is_matrix(X_WA) and _is_matrix(X_WB)):
        return -1
    header = view_i64(header_at, HEADER)
    poses = view_f64(header[POSES_AT], (BLOCK + 1) * POSE)
    good_a = _set_pose(poses, 0, view_f64(address_in_kernel(X_WA), 16), 0, True)
    good_b = _set_pose(poses, BLOCK * POSE, view_f64(address_in_kernel(X_WB), 16), 0, True)
    if not (good_a and good_b):
        return -1
    _answer_at(
        header[CORE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], header[PAIRS_AT], 1, boolean,
            False, 0.0 if boolean else math.inf, row_at, header[DOUBLES_AT], header[INTEGERS_AT],
        ),
    )  # fmt: skip
    marks = view_u8(row_at, ROW)
    if marks[HOW] == UNDECIDED or marks[HOW] == REFUSED:
        return -1
    return int(marks[HIT])


@entry("int64(int64, float64[:, ::1], float64[:, ::1])", nogil=False)
def collide_single(header_at, X_WA, X_WB):
    """The boolean of one pair, as `_single` says it. All threads share its workspace: it keeps Python's lock."""
    rows_at = view_i64(header_at, HEADER)[ROWS_AT]
    row = view_i64(rows_at, ROW // 8)
    for k in range(ROW // 8):
        row[k] = 0
    return _single(header_at, X_WA, X_WB, True, rows_at)


@entry("int64(int64, float64[:, ::1], float64[:, ::1], uint8[::1])", nogil=False)
def distance_single(header_at, X_WA, X_WB, row):
    """The row of one pair into ``row``, ROW zero bytes; returns as `collide_single` does."""
    return _single(header_at, X_WA, X_WB, False, address_in_kernel(row))
