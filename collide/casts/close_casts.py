"""What rows of `cast_pairs.py` come to: contact before anything moves, motion along a plane, brackets narrow enough.

Between these kernels the caller asks pair queries, by the means of Python or of C; what is listed at the end is decided
in Python's integers.
"""

from __future__ import annotations

from collide.casts.cast_pairs import CAST_ROW, LOWER, NORMAL, QUESTION, SIZE, STATUS, TOUCHING, UPPER, VALUE
from collide.casts.portal import BEHIND, HIT, LEVEL, MISS, OPEN
from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, NUMBERS, PARAMS, POSE, POSE_SLOP, RADIUS, SLOP
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.rows import HIT as IS_HIT
from collide.narrowphase.rows import HOW, POINT_B, ROW, view_row
from collide.numerics.error_free import two_product
from collide.numerics.exact_dot_sign import sign_of_terms
from collide.numerics.vec3 import Vec3, put_vec3, vec3_at
from collide.results import UNDECIDED

#: Bytes of marks a row, as columns: the row's status is proven; the bracket is as narrow as promised, too; the bodies
#: touch before they move.
PROVEN, CERTIFIED, AT_START = range(3)
MARKS = 3
#: Doubles to work in: the pace towards a plane is the exact sum of so many.
PACE_TERMS = 144
#: Products of four doubles are exact sums of eight where no factor but 0 is smaller: their last digits are multiples
#: of 2⁻²¹² of the product, above the least double.
_LEAST_FACTOR = 2.0**-200


@kernel(inline=True)
def _row_of(rows_at, k):
    return view_f64(rows_at + 8 * CAST_ROW * k, CAST_ROW)


@entry("int64(int64, int64, int64, int64)")
def list_starts(rows_at, marks_at, n, numbers_at):
    """Begin the marks of n rows, and list rows that bodies touching at the start decide: BEHIND, or OPEN down to
    t ≤ 0. Returns how many are listed.
    """
    marks, numbers, count = view_u8(marks_at, MARKS * n), view_i64(numbers_at, n), 0
    for k in range(n):
        row = _row_of(rows_at, k)
        marks[PROVEN * n + k], marks[CERTIFIED * n + k], marks[AT_START * n + k] = 1, 1, 0
        if row[STATUS] == BEHIND or (row[STATUS] == OPEN and row[LOWER] <= 0.0):
            numbers[count] = k
            count += 1
    return count


@entry("int64(int64, int64, int64, int64, int64, int64)")
def part_starts(rows_at, marks_at, n, numbers_at, n_listed, answers_at):
    """Take booleans of the listed rows, as rows of `PAIR_DTYPE`: bodies apart become MISS where proven behind, else
    OPEN. Touching bodies stay on the list; returns how many.
    """
    marks, numbers, count = view_u8(marks_at, MARKS * n), view_i64(numbers_at, n_listed), 0
    for i in range(n_listed):
        k, answer = numbers[i], view_row(answers_at + ROW * i)
        row = _row_of(rows_at, k)
        if answer.flags[IS_HIT] != 0:
            marks[PROVEN * n + k] = 0 if answer.flags[HOW] == UNDECIDED else 1
            numbers[count] = k
            count += 1
        else:
            is_behind = row[STATUS] == BEHIND and row[UPPER] <= 0.0
            row[STATUS] = MISS if is_behind else OPEN
            row[LOWER] = max(row[LOWER], 0.0)
    return count


@entry("int64(int64, int64, int64, int64, int64, int64)")
def meet_at_start(rows_at, marks_at, n, numbers_at, n_listed, answers_at):
    """Make the listed rows HIT at t = 0, at the point of B of their rows of `PAIR_DTYPE`, without a normal."""
    marks, numbers = view_u8(marks_at, MARKS * n), view_i64(numbers_at, n_listed)
    for i in range(n_listed):
        row, answer = _row_of(rows_at, numbers[i]), view_row(answers_at + ROW * i)
        row[STATUS] = HIT
        row[LOWER] = row[VALUE] = row[UPPER] = 0.0
        put_vec3(row, NORMAL, Vec3(0.0, 0.0, 0.0))
        put_vec3(row, TOUCHING, vec3_at(answer.doubles, POINT_B))
        marks[AT_START * n + numbers[i]] = 1
    return 0


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def settle_levels(numbers_at, poses_at, shape_of_at, pairs_at, questions_at, n, rows_at, terms_at, listed_at):
    """Make LEVEL rows MISS where A exactly does not come nearer to the half-space; list the others, by number, and
    return how many these are.   terms : PACE_TERMS doubles to work in.   The rest as of `cast_pairs`.
    """
    pairs, listed, count = view_i64(pairs_at, 2 * n), view_i64(listed_at, n), 0
    terms = view_f64(terms_at, PACE_TERMS)
    for k in range(n):
        row = _row_of(rows_at, k)
        if row[STATUS] != LEVEL:
            continue
        part = pairs[2 * k + 1]
        shape = view_i64(shape_of_at, part + 1)[part]
        normal = vec3_at(view_f64(numbers_at, NUMBERS * (shape + 1)), NUMBERS * shape + PARAMS)
        pose = view_f64(poses_at + 8 * POSE * part, POSE)
        direction = vec3_at(view_f64(questions_at + 8 * QUESTION * k, QUESTION), 0)
        is_known = pose[POSE_SLOP] == 0.0 and _put_pace(pose, normal, direction, terms)
        if is_known and sign_of_terms(terms, PACE_TERMS) >= 0:
            row[STATUS] = MISS
        else:
            listed[count] = k
            count += 1
    return count


@kernel
def _put_pace(pose, m, d, terms):
    """Write doubles whose exact sum is (cof(R) m)·d, the pace away from a plane; False where underflow may break the
    equality.   pose : R, row by row.
    """
    are_exact, at = True, 0
    for i in range(3):
        for j in range(3):
            m_j = m.x if j == 0 else m.y if j == 1 else m.z
            d_i = d.x if i == 0 else d.y if i == 1 else d.z
            p, q, r, s = 3 * ((i + 1) % 3), 3 * ((i + 2) % 3), (j + 1) % 3, (j + 2) % 3
            are_exact = _put_product(pose[p + r], pose[q + s], m_j, d_i, terms, at) and are_exact
            are_exact = _put_product(-pose[p + s], pose[q + r], m_j, d_i, terms, at + 8) and are_exact
            at += 16
    return are_exact


@kernel
def _put_product(a, b, c, d, terms, at):
    """Write eight doubles whose exact sum is a·b·c·d; False where that cannot be promised."""
    first = two_product(a, b)
    for k in range(2):
        second = two_product(first.high if k == 0 else first.low, c)
        for j in range(2):
            third = two_product(second.high if j == 0 else second.low, d)
            terms[at + 4 * k + 2 * j], terms[at + 4 * k + 2 * j + 1] = third
    if a == 0.0 or b == 0.0 or c == 0.0 or d == 0.0:
        return True
    return min(abs(a), abs(b), abs(c), abs(d)) >= _LEAST_FACTOR


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def close_casts(ints_at, numbers_at, shape_of_at, pairs_at, questions_at, n, rows_at, marks_at, listed_at):
    """Judge rows of status HIT, MISS or OPEN: rows left OPEN, or bracketed too widely, are listed where exact numbers
    decide; of the others OPEN becomes HIT, not proven. Returns how many are listed. Arguments as above.
    """
    pairs, listed, count = view_i64(pairs_at, 2 * n), view_i64(listed_at, n), 0
    questions = view_f64(questions_at, QUESTION * n)
    marks = view_u8(marks_at, MARKS * n)
    for k in range(n):
        row = _row_of(rows_at, k)
        is_curved, has_exact_numbers = _kinds_of(ints_at, numbers_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1])
        is_met = row[STATUS] == HIT and marks[AT_START * n + k] == 0
        width = (PROMISE_CURVED if is_curved else PROMISE_STORED) * row[SIZE]
        is_wide = is_met and row[UPPER] - row[LOWER] > width
        if (row[STATUS] == OPEN or is_wide) and has_exact_numbers:
            listed[count] = k
            count += 1
            continue
        if row[STATUS] == OPEN:
            row[STATUS], marks[PROVEN * n + k] = HIT, 0
            limit = questions[QUESTION * k + QUESTION - 1]
            row[LOWER], row[VALUE] = min(row[LOWER], limit), min(row[VALUE], limit)
        marks[CERTIFIED * n + k] = 1 if marks[PROVEN * n + k] != 0 and not is_wide else 0
    return count


@kernel
def _kinds_of(ints_at, numbers_at, shape_of_at, part_a, part_b):
    """(whether A or B is curved, whether both are polytopes as stored, or B a half-space)."""
    shape_of, is_curved, is_exact = view_i64(shape_of_at, max(part_a, part_b) + 1), False, True
    for part in (part_a, part_b):
        shape = shape_of[part]
        kind = view_i64(ints_at + 8 * INTS * shape, INTS)[KIND]
        numbers = view_f64(numbers_at + 8 * NUMBERS * shape, NUMBERS)
        is_curved = is_curved or (kind != POINTS and kind != HALFSPACE)
        is_exact = is_exact and numbers[RADIUS] == 0.0 and numbers[SLOP] == 0.0
    kind_a = view_i64(ints_at + 8 * INTS * shape_of[part_a], INTS)[KIND]
    return is_curved, is_exact and not is_curved and kind_a == POINTS
