"""The walk over many poses: from two prepared bodies to proven booleans, counted.

L. Barba and S. Langerman, section 5: P is brought into the frame of R, whose polar Q = ρ0(R) was prepared once. The
inverse of R's matrix is its adjugate over its determinant, since poses are taken as given.
"""

from __future__ import annotations

import numpy as np

from collide.hierarchies.packed_hierarchy import height_of, ladder_at
from collide.hierarchies.walk_proof import BALL, CENTRE_AT, in_ball, planes_apart, shares_point
from collide.hierarchies.walk_steps import (
    AT_P,
    AT_Q,
    GAMES,
    INVERSE,
    LEVEL_P,
    LEVEL_Q,
    MARKS,
    NEITHER,
    P_STAR,
    PIVOTS,
    Q_STAR,
    ROUNDS,
    SEPARATED,
    TESTS,
    X_STAR,
    Z_STAR,
    M,
    T,
    X,
    Z,
    begin,
    polar_round,
    primal_round,
)
from collide.hierarchies.walk_steps import DOUBLES as STEP_DOUBLES
from collide.hierarchies.walk_steps import INTEGERS as STEP_INTEGERS
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.narrowphase.posed_pair import posed_pair, size_and_slop

#: What a row says. LOST: an invariant was lost, or a star is too large. OPEN_…: the walk's answer is not proven clear
#: of rounding. APART, MEETING: proven.
LOST, OPEN_APART, OPEN_MEETING, APART, MEETING = range(5)

WALK_DTYPE = np.dtype(
    [
        ("said", "i8"),
        ("rounds", "i8"),   # steps down in either hierarchy, plus one for the base case
        ("tests", "i8"),    # constant-size tests: scalar products of a point with a plane
        ("games", "i8"),    # small linear programs
        ("pivots", "i8"),   # of all of them
        ("level_p", "i8"),  # levels reached: 0 is the body itself
        ("level_q", "i8"),
        ("vertex_p", "i8"), # vertices where the last planes were tangent, rows of the hierarchies' points
        ("vertex_q", "i8"),
        ("corners", "i8", 3),  # vertices of R named by the proof of a common point
        ("axis", "f8", 3),  # from P to R in the world, for APART
        ("point", "f8", 3), # of P in its own frame, for MEETING
    ]
)  # fmt: skip
_ROW = WALK_DTYPE.itemsize
_SAID, _ROUNDS, _TESTS, _GAMES, _PIVOTS, _LEVEL_P, _LEVEL_Q, _VERTEX_P, _VERTEX_Q, _CORNERS = range(10)
_AXIS, _POINT = 12, 15

#: Doubles of one round of a trace: 0 primal or 1 polar, how it ended, levels, vertices, p*, q*, z, x (in P's frame),
#: z_φ, x_γ.
TRACE = 20
#: Rounds a trace has room for.
TRACED_ROUNDS = 512

#: Workspace of one thread: that of the steps, a difference point and its ids.
DOUBLES, INTEGERS = STEP_DOUBLES + POINT, STEP_INTEGERS + 4


@kernel
def _set_relative_pose(state, poses, p, q, cx, cy, cz):
    """y = M p + t takes P's points into R's frame, from the centre c; (what takes z to the world) is left in place."""
    a = poses[q]
    b = poses[q + 1]
    c = poses[q + 2]
    d = poses[q + 3]
    e = poses[q + 4]
    f = poses[q + 5]
    g = poses[q + 6]
    h = poses[q + 7]
    i = poses[q + 8]
    determinant = a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)
    if not abs(determinant) > 1e-300:
        return False, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    inverse = (
        (e * i - f * h) / determinant, (c * h - b * i) / determinant, (b * f - c * e) / determinant,
        (f * g - d * i) / determinant, (a * i - c * g) / determinant, (c * d - a * f) / determinant,
        (d * h - e * g) / determinant, (b * g - a * h) / determinant, (a * e - b * d) / determinant,
    )  # fmt: skip
    tx = poses[p + 9] - poses[q + 9]
    ty = poses[p + 10] - poses[q + 10]
    tz = poses[p + 11] - poses[q + 11]
    for r in range(3):
        x = inverse[3 * r]
        y = inverse[3 * r + 1]
        z = inverse[3 * r + 2]
        for k in range(3):
            state[M + 3 * r + k] = x * poses[p + k] + y * poses[p + 3 + k] + z * poses[p + 6 + k]
        state[T + r] = (x * tx + y * ty + z * tz) - (cx if r == 0 else (cy if r == 1 else cz))
    return True, inverse


@kernel
def _trace(trace, marks, state, space, said):
    at = TRACE * min(marks[ROUNDS], TRACED_ROUNDS - 1)
    trace[at] = space
    trace[at + 1] = said
    trace[at + 2] = marks[LEVEL_P]
    trace[at + 3] = marks[LEVEL_Q]
    trace[at + 4] = marks[AT_P]
    trace[at + 5] = marks[AT_Q]
    trace[at + 6] = marks[P_STAR]
    trace[at + 7] = marks[Q_STAR]
    for k in range(3):
        trace[at + 8 + k] = state[Z + k]
        trace[at + 11 + k] = state[X + k]
        trace[at + 14 + k] = state[Z_STAR + k]
        trace[at + 17 + k] = state[X_STAR + k]


@kernel
def _plane_in_world(state, inverse):
    """The direction across the plane of z, from P towards R: the inverse's transpose takes it to the world."""
    x = -state[Z]
    y = -state[Z + 1]
    z = -state[Z + 2]
    return (
        inverse[0] * x + inverse[3] * y + inverse[6] * z,
        inverse[1] * x + inverse[4] * y + inverse[7] * z,
        inverse[2] * x + inverse[5] * y + inverse[8] * z,
    )


@kernel
def _walk_down(P, Q, doubles_at, integers_at, trace_at, early, pair, inverse, ball_at, points, ids, error):
    """(SEPARATED, INVERSE or NEITHER; whether it is proven): round after round to the bottom of one hierarchy.

    early : every new plane is tried against the whole bodies at once, every new point against the ball in R, and
        ends the walk where that proves it.
    """
    marks = view_i64(integers_at, MARKS)
    state = view_f64(doubles_at, 24)
    trace = view_f64(trace_at, TRACE * TRACED_ROUNDS if trace_at != 0 else 0)
    said = begin(P, Q, doubles_at, integers_at)
    if trace_at != 0:
        _trace(trace, marks, state, 0, said)
    tried = 0
    while said != NEITHER:
        primal = said == SEPARATED
        if early and marks[GAMES] != tried:
            tried = marks[GAMES]
            if primal:
                dx, dy, dz = _plane_in_world(state, inverse)
                if planes_apart(pair, points, ids, dx, dy, dz, error):
                    return said, True
            elif in_ball(pair, ball_at, state[X], state[X + 1], state[X + 2], error * (2.0 + marks[ROUNDS])):
                return said, True
        if (marks[LEVEL_P] if primal else marks[LEVEL_Q]) == 0:
            break
        if primal:
            said = primal_round(P, Q, doubles_at, integers_at)
        else:
            said = polar_round(P, Q, doubles_at, integers_at)
        if trace_at != 0:
            _trace(trace, marks, state, 0 if primal else 1, said)
    return said, False


@entry("void(int64, int64, int64, int64, int64, int64, int64, boolean, int64, int64, int64, int64)")
def walk_poses(
    ladder_p, ladder_q, ball_at, ints_at, numbers_at, poses_at, n, early, rows_at, trace_at, doubles_at, integers_at
):  # fmt: skip
    """Walk at n pairs of poses.

    ladder_p, ladder_q : of P's hierarchy and of that of Q = ρ0(R).   ball : see `walk_proof.py`.
    ints, numbers : a `ShapeTable` of P and R, in this order.   poses : for each pair P's row and R's, POSE doubles each.
    early : see `_walk_down`; the walk as published does not.   rows : WALK_DTYPE.   trace : 0, or room for a trace of the last pair.   doubles, integers : workspace.
    """
    P = ladder_at(ladder_p)
    Q = ladder_at(ladder_q)
    ints = view_i64(ints_at, 2 * INTS)
    numbers = view_f64(numbers_at, 2 * NUMBERS)
    poses = view_f64(poses_at, 2 * n * POSE)
    ball = view_i64(ball_at, BALL)
    centre = view_f64(ball[CENTRE_AT], 4)
    state = view_f64(doubles_at, 24)
    marks = view_i64(integers_at, MARKS)
    points = view_f64(doubles_at + 8 * STEP_DOUBLES, POINT)
    ids = view_i64(integers_at + 8 * STEP_INTEGERS, 4)
    for k in range(n):
        pair = posed_pair(ints, numbers, poses, 0, 2 * k, 1, 2 * k + 1)
        size, slop, _ = size_and_slop(numbers, poses, 0, 2 * k, 1, 2 * k + 1)
        counts = view_i64(rows_at + _ROW * k, _ROW // 8)
        row = view_f64(rows_at + _ROW * k, _ROW // 8)
        good, inverse = _set_relative_pose(
            state, poses, 2 * k * POSE, (2 * k + 1) * POSE, centre[0], centre[1], centre[2]
        )
        error = ERROR * size + slop
        said, proven = NEITHER, False
        if good:
            said, proven = _walk_down(
                P, Q, doubles_at, integers_at, trace_at, early, pair, inverse, ball_at, points, ids, error
            )
        answer = LOST
        if said == SEPARATED:
            dx, dy, dz = _plane_in_world(state, inverse)
            row[_AXIS] = dx
            row[_AXIS + 1] = dy
            row[_AXIS + 2] = dz
            proven = proven or planes_apart(pair, points, ids, dx, dy, dz, error)
            answer = APART if proven else OPEN_APART
        elif said == INVERSE:
            x = state[X]
            y = state[X + 1]
            z = state[X + 2]
            row[_POINT] = x
            row[_POINT + 1] = y
            row[_POINT + 2] = z
            facet = marks[AT_Q]
            # x is a convex combination, rounded once more in every round.
            error += ERROR * size * (1.0 + marks[ROUNDS])
            proven = proven or shares_point(
                Q, pair, ball_at, ids, facet, Q[0][3 * facet], Q[0][3 * facet + 1], Q[0][3 * facet + 2], x, y, z,
                height_of(state, 0, x, y, z) + state[T], height_of(state, 1, x, y, z) + state[T + 1],
                height_of(state, 2, x, y, z) + state[T + 2], error,
            )  # fmt: skip
            for j in range(3):
                counts[_CORNERS + j] = ids[j]
            answer = MEETING if proven else OPEN_MEETING
        counts[_SAID] = answer
        counts[_ROUNDS] = marks[ROUNDS] + 1
        counts[_TESTS] = marks[TESTS]
        counts[_GAMES] = marks[GAMES]
        counts[_PIVOTS] = marks[PIVOTS]
        counts[_LEVEL_P] = marks[LEVEL_P]
        counts[_LEVEL_Q] = marks[LEVEL_Q]
        counts[_VERTEX_P] = marks[AT_P]
        counts[_VERTEX_Q] = marks[AT_Q]
