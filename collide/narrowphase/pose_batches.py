"""Two convex sets at many pairs of poses: from matrices to answers inside kernels.

Checking a pose, laying out a row and reading a boolean took numpy five times as long as GJK takes for a pair of boxes.
Poses go through in blocks small enough for the cache; the narrowphase is called where compiled (`kernels.native_call`),
not compiled once more.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import entry, kernel, native_call, view_f64, view_i64, view_u8
from collide.lowering.shape_table import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.posed_pair import stretch_of
from collide.narrowphase.rows import HIT, NORMAL, ROW, is_undecided_or_refused, view_row
from collide.numerics.vec3 import Vec3, cross, dot, norm1, put_vec3, vec3_at
from collide.transforms import LARGEST, ROTATION_TOLERANCE

_answer_pairs_at = native_call(SIGNATURE)

#: Poses that go through together.
BLOCK = 64

#: How `answer_poses` ends, besides 0: rows of the block before are open, or a matrix is no pose.
OPEN, BAD_POSE = range(1, 3)

# Header: 64-bit integers, the address of `answer_pairs` and of everything that it works on (`BlockWorkspace` in
# `convex_kernel_calls.py` and C write them); the same of `settle_exactly`, for single calls; then how many poses are
# answered.
(
    CORE, INTS_AT, NUMBERS_AT, POSES_AT, SHAPE_OF_AT, PAIRS_AT, ROWS_AT, DOUBLES_AT, INTEGERS_AT,
    SETTLE, STEPS_AT, DIGITS_AT, ANSWERED,
) = range(13)
#: Integers of the header.
HEADER = 13


class PoseBlock(NamedTuple):
    """Views of what one call of the narrowphase reads: BLOCK poses of A, then as many of B.

    header : of HEADER integers.   poses : POSE doubles each.   shape_of : their shape rows.
    pairs : two numbers of poses a pair.
    """

    header: Any
    poses: Any
    shape_of: Any
    pairs: Any


@kernel(inline=True)
def block_of(header_at):
    """The `PoseBlock` whose addresses a header holds."""
    header = view_i64(header_at, HEADER)
    return PoseBlock(
        header, view_f64(header[POSES_AT], 2 * BLOCK * POSE), view_i64(header[SHAPE_OF_AT], 2 * BLOCK),
        view_i64(header[PAIRS_AT], 2 * BLOCK),
    )


@kernel(inline=True)
def answer_block(header, n, boolean, depths, limit, rows_at):
    """`answer_pairs` of the first n pairs of the block."""
    _answer_pairs_at(
        header[CORE],
        (
            header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], 0, header[SHAPE_OF_AT], header[PAIRS_AT], n, boolean,
            depths, False, limit, rows_at, header[DOUBLES_AT], header[INTEGERS_AT],
        ),
    )


@kernel(inline=True)
def set_pose(R, at, X, check):
    """Pose row at ``at`` becomes the matrix X, 16 doubles; False where it is no pose (`transforms.as_poses`)."""
    p = Vec3(X[3], X[7], X[11])
    for i in range(3):
        put_vec3(R, at + 3 * i, vec3_at(X, 4 * i))
    put_vec3(R, at + 9, p)
    R[at + POSE_SLOP] = 0.0
    R[at + POSE_TERMS] = -1.0
    if not (X[12] == 0.0 and X[13] == 0.0 and X[14] == 0.0 and X[15] == 1.0):
        return False
    # Six products of columns instead of nine comparisons; what is no number fails them too.
    x, y, z = Vec3(X[0], X[4], X[8]), Vec3(X[1], X[5], X[9]), Vec3(X[2], X[6], X[10])
    xx, yy, zz, xy, yz, zx = dot(x, x), dot(y, y), dot(z, z), dot(x, y), dot(y, z), dot(z, x)
    R[at + POSE_STRETCH] = stretch_of(xx, yy, zz, xy, yz, zx)
    xx -= 1.0
    yy -= 1.0
    zz -= 1.0
    off = xx * xx + yy * yy + zz * zz + xy * xy + yz * yz + zx * zx
    if off <= ROTATION_TOLERANCE * ROTATION_TOLERANCE and norm1(p) <= LARGEST:
        return _determinant(X) > 0.0 or not check
    return is_pose(X, check)


@kernel(inline=True)
def _determinant(X):
    return dot(vec3_at(X, 0), cross(vec3_at(X, 4), vec3_at(X, 8)))


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


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, boolean, float64, boolean, int64, "
"int64)")
def answer_poses(
    header_at, which_at, XA_at, step_a, XB_at, step_b, first, n, boolean, depths, limit, check, axes_at, out_at
):
    """Answer poses ``first`` … n − 1 of a pair, or of n pairs; 0, OPEN or BAD_POSE.

    header : HEADER integers; [ANSWERED] becomes the total number of poses answered. After OPEN, the rows of the last
        block stay in the block's own memory, for the exact stage.
    which : 0, or two shape rows a pose.   XA, XB : matrices; step 16 or, for a single pose, 0.
    depths : as in `answer_pairs`.   check : refuse matrices other than rotations.
    axes : 0, or of booleans three doubles a pose: an axis to try first, replaced by a separating axis.
    out : booleans: a byte a pose; else a row of PAIR_DTYPE a pose, zeroed, and written in place.

    Fourteen arguments: Python and C call this entry, with integers, doubles and booleans alone.
    """
    block = block_of(header_at)
    header = block.header
    rows_at = header[ROWS_AT]
    _begin_block(block, step_a != 0 or which_at != 0, step_b != 0 or which_at != 0)
    done = first
    while done < n:
        count = min(BLOCK, n - done)
        if not _put_poses(block, which_at, XA_at, step_a, XB_at, step_b, done, count, check):
            header[ANSWERED] = done
            return BAD_POSE
        if boolean:
            clear_rows(rows_at, count)
            for k in range(count if axes_at != 0 else 0):
                put_vec3(
                    view_row(rows_at + ROW * k).doubles, NORMAL, vec3_at(view_f64(axes_at + 24 * (done + k), 3), 0)
                )
        else:
            rows_at = out_at + ROW * done
        answer_block(header, count, boolean, depths, limit, rows_at)
        some_open = False
        for k in range(count):
            row = view_row(rows_at + ROW * k)
            some_open = some_open or is_undecided_or_refused(row)
            if boolean:
                view_u8(out_at + done + k, 1)[0] = row.flags[HIT]
                if axes_at != 0 and row.flags[HIT] == 0:
                    put_vec3(view_f64(axes_at + 24 * (done + k), 3), 0, vec3_at(row.doubles, NORMAL))
        done += count
        header[ANSWERED] = done
        if some_open:
            return OPEN
    return 0


@kernel(inline=True)
def _begin_block(block, is_batch_a, is_batch_b):
    """Pair pose k of A with pose k of B; a body with a single pose has its pose paired with all."""
    for k in range(BLOCK):
        block.pairs[2 * k] = k if is_batch_a else 0
        block.pairs[2 * k + 1] = BLOCK + (k if is_batch_b else 0)
        block.shape_of[k] = 0
        block.shape_of[BLOCK + k] = 1


@kernel(inline=True)
def _put_poses(block, which_at, XA_at, step_a, XB_at, step_b, first, count, check):
    """Matrices from ``first`` on become the block's poses; whether all of them are poses. Arguments as in
    `answer_poses`."""
    good = True
    for k in range(count):
        if which_at != 0:
            which = view_i64(which_at + 16 * (first + k), 2)
            block.shape_of[k] = which[0]
            block.shape_of[BLOCK + k] = which[1]
        # A pose that goes with all of the other body's is written once, where shapes are.
        if block.pairs[2 * k] == k:
            good = set_pose(block.poses, k * POSE, view_f64(XA_at + 8 * step_a * (first + k), 16), check) and good
        if block.pairs[2 * k + 1] == BLOCK + k:
            at = (BLOCK + k) * POSE
            good = set_pose(block.poses, at, view_f64(XB_at + 8 * step_b * (first + k), 16), check) and good
    return good


@kernel(inline=True)
def clear_rows(rows_at, n):
    """Zero n rows."""
    words = view_i64(rows_at, n * ROW // 8)
    for k in range(n * ROW // 8):
        words[k] = 0


@entry("int64(int64, int64, int64, int64, boolean, int64)")
def first_bad_pose(X_at, step, first, n, check, pose_at):
    """The number of the first matrix from ``first`` on, of n, that is no pose as `answer_poses` judges; n where all
    are.

    step : 16, or 0.   pose : workspace of POSE doubles.
    """
    pose = view_f64(pose_at, POSE)
    for k in range(first, n):
        if not set_pose(pose, 0, view_f64(X_at + 8 * step * k, 16), check):
            return k
    return n
