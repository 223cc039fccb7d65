"""Casts of convex sets against convex sets, one row a question: doubles with proven bounds.

A translation of A meets B where a ray meets their Minkowski difference. What doubles leave open is said by the row's
status, and settled by `convex_casts.py`.
"""

from __future__ import annotations

from collide.casts.cast_onto_plane import cast_onto_plane
from collide.casts.portal import cast_line
from collide.casts.silhouette import open_cast
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.posed_pair import posed_pair, radius_of, size_and_slop
from collide.numerics.vec3 import add, norm, put_vec3, vec3_at

#: Doubles of a question: the direction of A's motion, and the largest t that counts.
QUESTION = 4
_LIMIT = 3
#: Doubles of a row: the status of `portal.py`, t from below, t, t from above, unit normal from A to B, a point of B,
#: the size of the pair in units of t.
CAST_ROW = 11
STATUS, LOWER, VALUE, UPPER, NORMAL, TOUCHING, SIZE = 0, 1, 2, 3, 4, 7, 10


@kernel
def cast_pair(pair, size, slop, question, row, doubles_at, integers_at):
    """Write the row of one question.   question, row : views of QUESTION and CAST_ROW doubles."""
    direction = vec3_at(question, 0)
    if pair.B.kind == HALFSPACE:
        met = cast_onto_plane(pair, direction, size, slop, question[_LIMIT])
    else:
        cast = open_cast(
            pair, direction, radius_of(pair, pair.A), radius_of(pair, pair.B), ERROR * size + slop, size, doubles_at,
            integers_at,
        )
        met = cast_line(cast, question[_LIMIT], False)
    row[STATUS] = met.status
    row[LOWER] = met.lower
    row[VALUE] = met.value
    row[UPPER] = met.upper
    row[SIZE] = size / norm(direction)
    put_vec3(row, NORMAL, met.normal)
    put_vec3(row, TOUCHING, add(met.point, vec3_at(pair.poses, pair.B.pose_at + 9)))


SIGNATURE = "void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def cast_pairs(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, questions_at, n, rows_at, doubles_at, integers_at
):
    """Answer n casts of posed convex parts.

    ints, numbers : a `ShapeTable`, its trees built.   poses : POSE doubles a part.   shape_of : a shape row a part.
    pairs : two part numbers a question, of A, which moves and is bounded, and of B.   questions : QUESTION doubles.
    rows : out, CAST_ROW doubles.   doubles, integers : workspace (`silhouette.CAST_DOUBLES`, CAST_INTEGERS).
    """
    pairs = view_i64(pairs_at, 2 * n)
    for k in range(n):
        pa = pairs[2 * k]
        pb = pairs[2 * k + 1]
        shape_of = view_i64(shape_of_at, max(pa, pb) + 1)
        sa = shape_of[pa]
        sb = shape_of[pb]
        ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
        numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
        poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
        pair = posed_pair(ints, numbers, poses, sa, pa, sb, pb)
        size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
        cast_pair(
            pair, size, slop, view_f64(questions_at + 8 * QUESTION * k, QUESTION),
            view_f64(rows_at + 8 * CAST_ROW * k, CAST_ROW), doubles_at, integers_at,
        )
