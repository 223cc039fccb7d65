"""Two convex sets at many pairs of poses: from matrices to answers inside kernels.

Checking a pose, laying out a row and reading a boolean took numpy five times as long as a pair of boxes
takes GJK. Poses go through in blocks that stay in the cache; the narrowphase is called where it was
compiled (`kernels.native_call`), not compiled once more.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, native_call, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS
from collide.narrowphase.convex_pairs import SIGNATURE
from collide.narrowphase.posed_pair import stretch_of
from collide.narrowphase.rows import HIT, HOW, NORMAL, ROW
from collide.results import REFUSED, UNDECIDED
from collide.transforms import LARGEST, ROTATION_TOLERANCE

answer_at = native_call(SIGNATURE)

#: Poses that go through together.
BLOCK = 64

#: What `answer_poses` says besides a count: rows of the block before it are open, or a pose is no pose.
OPEN, BAD_POSE = range(1, 3)

# Workspace, integers: addresses of everything (see `Workspace` in `convex_queries.py`).
(
    CORE, INTS_AT, NUMBERS_AT, POSES_AT, SHAPE_OF_AT, PAIRS_AT, ROWS_AT, DOUBLES_AT, INTEGERS_AT, ANSWERED,
) = range(10)  # fmt: skip
#: Integers of the header.
HEADER = 10


@kernel(inline=True)
def set_pose(R, at, X, check):
    """Pose row at ``at`` becomes the matrix X; False where it is no pose (`transforms.as_poses`)."""
    R[at] = X[0]
    R[at + 1] = X[1]
    R[at + 2] = X[2]
    R[at + 3] = X[4]
    R[at + 4] = X[5]
    R[at + 5] = X[6]
    R[at + 6] = X[8]
    R[at + 7] = X[9]
    R[at + 8] = X[10]
    R[at + 9] = X[3]
    R[at + 10] = X[7]
    R[at + 11] = X[11]
    R[at + POSE_SLOP] = 0.0
    R[at + POSE_TERMS] = -1.0
    if not (X[12] == 0.0 and X[13] == 0.0 and X[14] == 0.0 and X[15] == 1.0):
        return False
    # Six products instead of nine comparisons; what is no number fails them too.
    xx = X[0] * X[0] + X[4] * X[4] + X[8] * X[8]
    yy = X[1] * X[1] + X[5] * X[5] + X[9] * X[9]
    zz = X[2] * X[2] + X[6] * X[6] + X[10] * X[10]
    xy = X[0] * X[1] + X[4] * X[5] + X[8] * X[9]
    yz = X[1] * X[2] + X[5] * X[6] + X[9] * X[10]
    zx = X[2] * X[0] + X[6] * X[4] + X[10] * X[8]
    R[at + POSE_STRETCH] = stretch_of(xx, yy, zz, xy, yz, zx)
    xx -= 1.0
    yy -= 1.0
    zz -= 1.0
    off = xx * xx + yy * yy + zz * zz + xy * xy + yz * yz + zx * zx
    shift = abs(X[3]) + abs(X[7]) + abs(X[11])
    if off <= ROTATION_TOLERANCE * ROTATION_TOLERANCE and shift <= LARGEST:
        return _determinant(X) > 0.0 or not check
    return is_pose(X, check)


@kernel(inline=True)
def _determinant(X):
    return (
        X[0] * (X[5] * X[10] - X[6] * X[9]) + X[1] * (X[6] * X[8] - X[4] * X[10]) + X[2] * (X[4] * X[9] - X[5] * X[8])
    )


@kernel
def is_pose(X, check):
    """The same entry by entry, for poses on the brink and for any matrix where ``check`` is off."""
    for i in range(12):
        if not abs(X[i]) <= LARGEST:
            return False
    if not check:
        return True
    for i in range(3):
        for j in range(i + 1):
            product = X[i] * X[j] + X[4 + i] * X[4 + j] + X[8 + i] * X[8 + j]
            if not abs(product - (1.0 if i == j else 0.0)) <= ROTATION_TOLERANCE:
                return False
    return _determinant(X) > 0.0


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, boolean, float64, boolean, int64, int64)")
def answer_poses(
    header_at, which_at, XA_at, step_a, XB_at, step_b, first, n, boolean, depths, limit, check, axes_at, out_at
):
    """Answer poses ``first`` … n − 1 of a pair, or of n pairs; 0, OPEN or BAD_POSE.

    header : HEADER integers; [ANSWERED] becomes the number of poses answered in all. Where it stops OPEN,
        the rows of the last block are left where the block's rows stand, for the exact stage.
    which : 0, or two shape rows a pose.   XA, XB : matrices; step 16 or, for a single pose, 0.
    depths : as in `answer_pairs`.   check : refuse matrices that are no rotation.
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
                good = set_pose(poses, k * POSE, view_f64(XA_at + 8 * step_a * (done + k), 16), check) and good
            if pairs[2 * k + 1] == BLOCK + k:
                at = (BLOCK + k) * POSE
                good = set_pose(poses, at, view_f64(XB_at + 8 * step_b * (done + k), 16), check) and good
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
        answer_at(
            header[CORE],
            (
                header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], 0, header[SHAPE_OF_AT], header[PAIRS_AT], count,
                boolean, depths, False, limit, rows_at, header[DOUBLES_AT], header[INTEGERS_AT],
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


@entry("int64(int64, int64, int64, int64, boolean, int64)")
def first_bad_pose(X_at, step, first, n, check, room_at):
    """The number of the first matrix from ``first`` on, of n, that is no pose as `answer_poses` judges; n where all are.

    step : 16, or 0.   room : POSE doubles.
    """
    room = view_f64(room_at, POSE)
    for k in range(first, n):
        if not set_pose(room, 0, view_f64(X_at + 8 * step * k, 16), check):
            return k
    return n
