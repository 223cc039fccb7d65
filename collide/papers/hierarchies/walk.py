"""The walk over many poses: from two prepared bodies to proven booleans, counted.

L. Barba and S. Langerman, section 5: P is brought into the frame of R, whose polar Q = ρ0(R) was prepared once. The
inverse of R's matrix is its adjugate over its determinant, since poses are taken as given.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, POSE
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.narrowphase.posed_pair import posed_pair, size_and_slop
from collide.numerics.vec3 import cross, divide, dot, neg, put_vec3, rotate, rotate_back, sub, vec3_at
from collide.papers.hierarchies.packed_hierarchy import levels_at
from collide.papers.hierarchies.walk_proof import Proof, ball_at, in_ball, planes_apart, shares_point
from collide.papers.hierarchies.walk_steps import (
    AT_P,
    AT_Q,
    GAMES,
    INVERSE,
    INVERSE_OF_R,
    LEVEL_P,
    LEVEL_Q,
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
    in_frame_of_r,
    polar_round,
    primal_round,
    walk_at,
)
from collide.papers.hierarchies.walk_steps import DOUBLES as STEP_DOUBLES
from collide.papers.hierarchies.walk_steps import INTEGERS as STEP_INTEGERS

#: Status of a row. LOST: an invariant was lost, or a star is too large. OPEN_…: the walk's answer is not proven in
#: spite of rounding. APART, MEETING: proven.
LOST, OPEN_APART, OPEN_MEETING, APART, MEETING = range(5)

WALK_DTYPE = np.dtype(
    [
        ("status", "i8"),
        ("rounds", "i8"),   # steps down in either hierarchy, plus one for the base case
        ("tests", "i8"),    # constant-size tests: scalar products of a point with a plane
        ("games", "i8"),    # small linear programs
        ("pivots", "i8"),   # of all of them
        ("level_p", "i8"),  # levels reached: 0 is the body itself
        ("level_q", "i8"),
        ("vertex_p", "i8"), # vertices where the last planes were tangent, rows of the hierarchies' points
        ("vertex_q", "i8"),
        ("corners", "i8", 3),  # vertices of R in the proof of a common point
        ("axis", "f8", 3),  # from P to R in the world, for APART
        ("point", "f8", 3), # of P in its own frame, for MEETING
    ]
)
_ROW = WALK_DTYPE.itemsize
_STATUS, _ROUNDS, _TESTS, _GAMES, _PIVOTS, _LEVEL_P, _LEVEL_Q, _VERTEX_P, _VERTEX_Q, _CORNERS = range(10)
_AXIS, _POINT = 12, 15

#: Doubles of one round of a trace: 0 primal or 1 polar, how it ended, levels, vertices, p*, q*, z, x (in P's frame),
#: z_φ, x_γ.
TRACE = 20
#: Rounds a trace has room for.
TRACED_ROUNDS = 512

#: Workspace of a thread: workspace of the steps, a difference point and its ids.
DOUBLES, INTEGERS = STEP_DOUBLES + POINT, STEP_INTEGERS + 4


@kernel
def _set_relative_pose(state, poses, p, q, centre):
    """y = M x + t takes P's points into R's frame, from the centre; False where R's matrix has no inverse.

    p, q : where the poses of P and R stand. The inverse of R's matrix is kept in the state, too.
    """
    a, b, c = vec3_at(poses, q), vec3_at(poses, q + 3), vec3_at(poses, q + 6)
    determinant = dot(a, cross(b, c))
    if not abs(determinant) > 1e-300:
        return False
    u, v, w = divide(cross(b, c), determinant), divide(cross(c, a), determinant), divide(cross(a, b), determinant)
    for k in range(3):
        state[INVERSE_OF_R + 3 * k] = u.x if k == 0 else (u.y if k == 1 else u.z)
        state[INVERSE_OF_R + 3 * k + 1] = v.x if k == 0 else (v.y if k == 1 else v.z)
        state[INVERSE_OF_R + 3 * k + 2] = w.x if k == 0 else (w.y if k == 1 else w.z)
        put_vec3(state, M + 3 * k, rotate_back(poses, p, vec3_at(state, INVERSE_OF_R + 3 * k)))
    t = sub(vec3_at(poses, p + 9), vec3_at(poses, q + 9))
    put_vec3(state, T, sub(rotate(state, INVERSE_OF_R, t), centre))
    return True


@kernel
def _write_trace(trace, walk, space, outcome):
    """One round of a trace. space : 0 primal, 1 polar."""
    state, marks = walk.state, walk.marks
    at = TRACE * min(marks[ROUNDS], TRACED_ROUNDS - 1)
    trace[at] = space
    trace[at + 1] = outcome
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
def _plane_in_world(state):
    """The direction across the plane of z, from P towards R: the inverse's transpose takes it to the world."""
    return rotate_back(state, INVERSE_OF_R, neg(vec3_at(state, Z)))


@kernel
def _walk_down(walk, proof, trace, early, error):
    """(SEPARATED, INVERSE or NEITHER; whether proven): round after round to the bottom of a hierarchy.

    trace : doubles of a trace, or an empty array.
    early : every new plane is tried against the whole bodies at once, every new point
        against the ball in R, and a proof ends the walk.
    """
    marks, state = walk.marks, walk.state
    outcome = begin(walk)
    if len(trace) > 0:
        _write_trace(trace, walk, 0, outcome)
    tried = 0
    while outcome != NEITHER:
        primal = outcome == SEPARATED
        if early and marks[GAMES] != tried:
            tried = marks[GAMES]
            if primal:
                if planes_apart(proof, _plane_in_world(state), error):
                    return outcome, True
            elif in_ball(proof, vec3_at(state, X), error * (2.0 + marks[ROUNDS])):
                return outcome, True
        if (marks[LEVEL_P] if primal else marks[LEVEL_Q]) == 0:
            break
        outcome = primal_round(walk) if primal else polar_round(walk)
        if len(trace) > 0:
            _write_trace(trace, walk, 0 if primal else 1, outcome)
    return outcome, False


@kernel
def _answer(walk, proof, outcome, proven, size, error, row, counts):
    """Status of an ended walk; the proving plane or point is written into the row.

    row, counts : doubles and integers of the row.
    """
    state = walk.state
    if outcome == SEPARATED:
        d = _plane_in_world(state)
        put_vec3(row, _AXIS, d)
        return APART if proven or planes_apart(proof, d, error) else OPEN_APART
    if outcome == INVERSE:
        x = vec3_at(state, X)
        put_vec3(row, _POINT, x)
        # x is a convex combination, rounded once more in every round.
        error += ERROR * size * (1.0 + walk.marks[ROUNDS])
        proven = proven or shares_point(walk.Q, proof, walk.marks[AT_Q], x, in_frame_of_r(state, x), error)
        for k in range(3):
            counts[_CORNERS + k] = proof.ids[k]
        return MEETING if proven else OPEN_MEETING
    return LOST


@entry("void(int64, int64, int64, int64, int64, int64, int64, boolean, int64, int64, int64, int64)")
def walk_poses(
    p_at, q_at, ball_address, ints_at, numbers_at, poses_at, n, early, rows_at, trace_at, doubles_at, integers_at
):
    """Walk at n pairs of poses.

    p, q : packed hierarchies, of P and of Q = ρ0(R).   ball : see `walk_proof.ball_at`.
    ints, numbers : a `ShapeTable` of P and R, in this order.
    poses : for each pair P's row and R's, POSE doubles each.
    early : see `_walk_down`; the walk as published does not.   rows : WALK_DTYPE.
    trace : 0, or TRACED_ROUNDS rounds for a trace of the last pair.   doubles, integers : workspace.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    walk = walk_at(levels_at(p_at), levels_at(q_at), doubles_at, integers_at)
    ball = ball_at(ball_address)
    ints = view_i64(ints_at, 2 * INTS)
    numbers = view_f64(numbers_at, 2 * NUMBERS)
    poses = view_f64(poses_at, 2 * n * POSE)
    trace = view_f64(trace_at, TRACE * TRACED_ROUNDS if trace_at != 0 else 0)
    points = view_f64(doubles_at + 8 * STEP_DOUBLES, POINT)
    ids = view_i64(integers_at + 8 * STEP_INTEGERS, 4)
    for k in range(n):
        pair = posed_pair(ints, numbers, poses, 0, 2 * k, 1, 2 * k + 1)
        proof = Proof(pair, ball, points, ids)
        size, slop, _ = size_and_slop(numbers, poses, 0, 2 * k, 1, 2 * k + 1)
        error = ERROR * size + slop
        outcome, proven = NEITHER, False
        if _set_relative_pose(walk.state, poses, 2 * k * POSE, (2 * k + 1) * POSE, vec3_at(ball.numbers, 0)):
            outcome, proven = _walk_down(walk, proof, trace, early, error)
        counts = view_i64(rows_at + _ROW * k, _ROW // 8)
        row = view_f64(rows_at + _ROW * k, _ROW // 8)
        marks = walk.marks
        counts[_STATUS] = _answer(walk, proof, outcome, proven, size, error, row, counts)
        counts[_ROUNDS] = marks[ROUNDS] + 1
        counts[_TESTS] = marks[TESTS]
        counts[_GAMES] = marks[GAMES]
        counts[_PIVOTS] = marks[PIVOTS]
        counts[_LEVEL_P] = marks[LEVEL_P]
        counts[_LEVEL_Q] = marks[LEVEL_Q]
        counts[_VERTEX_P] = marks[AT_P]
        counts[_VERTEX_Q] = marks[AT_Q]
