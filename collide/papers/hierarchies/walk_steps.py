"""One round of the walk: one level down in the hierarchy of P (primal space) or of Q (polar space).

L. Barba and S. Langerman, section 5. Points stand for planes. The invariants, for the level P_i and Q_j reached:

separation          z ∈ Q_j and ⟨p, z⟩ > 1 for all p ∈ P_i: ρ(z) separates P_i from ρ0(Q_j)
inverse separation  x ∈ P_i and ⟨x, q⟩ ≤ 1 for all q ∈ Q_j: ρ(x) separates Q_j from ρ∞(P_i)
star, primal        z_φ ∈ Q_j, and ⟨p, z_φ⟩ > 1 for all p ∈ P_i but p*
star, polar         x_γ ∈ P_i, and ⟨x_γ, q⟩ ≤ 1 for all q ∈ Q_j but q*

Three things differ from the text, each explained in docs/barba-langerman.md: > and ≤ instead of "separates", so that
touching is a hit; Case 1 already where the next level is beyond φ, not only where it is beyond π; and P_i* and Q_j*
without ρ(γ) and ρ(φ), which the steps do not need once the invariants ask for z ∈ Q_j and x ∈ P_i.

Doubles throughout. The answer of the walk is proven by `walk_proof.py`; here a lost invariant only ends the walk.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.numerics.vec3 import Vec3, add, dot, neg, put_vec3, rotate, rotate_back, scale, sub, vec3_at
from collide.papers.hierarchies.matrix_game import APART, LABELS, MAX_POINTS, MEET, TABLEAU, UNSOLVED, solve_game
from collide.papers.hierarchies.packed_hierarchy import height_of, lowest_at, lowest_of_level, one_level_finer, row_at

# Doubles of the state: the pose of P in R's frame (y = M p + t), the points of the invariants, and the inverse of R's
# matrix.
M, T, Z, Z_STAR, X, X_STAR, INVERSE_OF_R = 0, 9, 12, 15, 18, 21, 24  # Z in the polar space; X in P's own frame
_STATE = 33
#: Doubles of workspace: the state, points of P* in both frames and of Q*, weights of both, the tableau.
DOUBLES = _STATE + 11 * MAX_POINTS + TABLEAU

# Integers of the state: levels reached (0 the body itself), vertices where the plane is tangent, p* and q* (−1: all
# of the coarsest level), the rows that are loaded as P* and Q*, how many points these have, whether they are too large
# to be loaded whole, and counts.
LEVEL_P, LEVEL_Q, AT_P, AT_Q, P_STAR, Q_STAR, LOADED_P, LOADED_Q, N_P, N_Q, LARGE_P, LARGE_Q = range(12)
ROUNDS, TESTS, GAMES, PIVOTS = range(12, 16)
_MARKS = 16
#: Integers of workspace: those of the state, and the labels of the tableau.
INTEGERS = _MARKS + LABELS
#: What is loaded of a star that is too large: not the same another time.
_NOT_LOADED = -2

#: Points that a star too large begins with.
_SEEDS = 8

#: How a round ends: with the separation or the inverse separation, or with neither.
SEPARATED, INVERSE, NEITHER = range(3)

#: An invariant is lost when it fails by more than this; by less is for the proof to judge.
_LOST_BY = 1e-6


class Walk(NamedTuple):
    """A walk under way.

    P, Q : `Levels` of both hierarchies.   state, marks : doubles and integers of the state, as named above.
    p_own, p_moved, q_points : MAX_POINTS points each: P* in P's frame and in R's, Q*.
    x_weights, z_weights : of P* and Q*.
    table, labels : workspace of `solve_game`.
    """

    P: Any
    Q: Any
    state: Any
    marks: Any
    p_own: Any
    p_moved: Any
    q_points: Any
    x_weights: Any
    z_weights: Any
    table: Any
    labels: Any


@kernel
def walk_at(P, Q, doubles_at, integers_at):
    """A `Walk` in DOUBLES doubles and INTEGERS integers of workspace."""
    points_at = doubles_at + 8 * _STATE
    weights_at = points_at + 8 * 9 * MAX_POINTS
    return Walk(
        P, Q, view_f64(doubles_at, _STATE), view_i64(integers_at, _MARKS),
        view_f64(points_at, 3 * MAX_POINTS), view_f64(points_at + 8 * 3 * MAX_POINTS, 3 * MAX_POINTS),
        view_f64(points_at + 8 * 6 * MAX_POINTS, 3 * MAX_POINTS),
        view_f64(weights_at, MAX_POINTS), view_f64(weights_at + 8 * MAX_POINTS, MAX_POINTS),
        view_f64(weights_at + 16 * MAX_POINTS, TABLEAU), view_i64(integers_at + 8 * _MARKS, LABELS),
    )


@kernel
def begin(walk):
    """The base case i = k, j = l: two tetrahedra. Returns SEPARATED, INVERSE or NEITHER."""
    marks = walk.marks
    for k in range(_MARKS):
        marks[k] = 0
    marks[LEVEL_P] = walk.P.depth - 1
    marks[LEVEL_Q] = walk.Q.depth - 1
    marks[P_STAR] = -1
    marks[Q_STAR] = -1
    marks[LOADED_P] = _NOT_LOADED
    marks[LOADED_Q] = _NOT_LOADED
    outcome = _play(walk)
    if outcome == APART:
        return _tangent_to_all_of_p(walk)
    if outcome == MEET:
        return _tangent_to_all_of_q(walk)
    return NEITHER


@kernel
def primal_round(walk):
    """"A walk in the primal space": from P_i to P_{i−1}, the separation invariant holding."""
    state, marks = walk.state, walk.marks
    z = vec3_at(state, Z)
    shift = dot(vec3_at(state, T), z)
    v, height, tests = one_level_finer(walk.P, marks[LEVEL_P], marks[AT_P], in_frame_of_p(state, z))
    marks[LEVEL_P] -= 1
    marks[ROUNDS] += 1
    marks[TESTS] += tests
    marks[AT_P] = v
    marks[P_STAR] = v
    put_vec3(state, Z_STAR, z)
    if height + shift > 1.0:
        return SEPARATED  # Case 1
    outcome = _play(walk)
    if outcome == APART:  # Case 2.1
        return _plane_at_p_star(walk)
    if outcome == MEET:  # Case 2.2
        return _plane_at_q_star(walk)
    return NEITHER


@kernel
def polar_round(walk):
    """"A walk in the polar space": from Q_j to Q_{j−1}, the inverse separation invariant holding."""
    state, marks = walk.state, walk.marks
    x = vec3_at(state, X)
    v, height, tests = one_level_finer(walk.Q, marks[LEVEL_Q], marks[AT_Q], neg(in_frame_of_r(state, x)))
    marks[LEVEL_Q] -= 1
    marks[ROUNDS] += 1
    marks[TESTS] += tests
    marks[AT_Q] = v
    marks[Q_STAR] = v
    put_vec3(state, X_STAR, x)
    if -height <= 1.0:
        return INVERSE  # Case 1
    outcome = _play(walk)
    if outcome == MEET:  # Case 2.1
        return _plane_at_q_star(walk)
    if outcome == APART:  # Case 2.2
        return _plane_at_p_star(walk)
    return NEITHER


# --- what the rounds are made of ----------------------------------------------------------------


@kernel
def _play(walk):
    """The game of P_i* and Q_j*, its weights in the workspace.

    A star too large to be loaded belongs to P or R itself, an apex or a facet with thousands of neighbours, beyond
    any bound of degrees. The game is played with few of its points, and a vertex of the whole level contradicting the
    answer is looked up along the hierarchy and added, until no vertex contradicts.
    """
    state, marks = walk.state, walk.marks
    _load(walk, True)
    _load(walk, False)
    outcome = _solve(walk)
    if marks[LARGE_P] == 0 and marks[LARGE_Q] == 0:
        return outcome
    while True:
        if outcome == APART and marks[LARGE_P] != 0:
            z = _best_z(walk)
            v, height, tests = lowest_at(walk.P, marks[LEVEL_P], in_frame_of_p(state, z))
            enough = height + dot(vec3_at(state, T), z) > 1.0
            known = v == marks[AT_P] and marks[N_P] > _SEEDS
            marks[AT_P] = v
        elif outcome == MEET and marks[LARGE_Q] != 0:
            v, height, tests = lowest_at(walk.Q, marks[LEVEL_Q], neg(in_frame_of_r(state, _best_x(walk))))
            enough = -height <= 1.0
            known = v == marks[AT_Q] and marks[N_Q] > _SEEDS
            marks[AT_Q] = v
        else:
            return outcome
        marks[TESTS] += tests
        if enough:
            return outcome
        if known or max(marks[N_P], marks[N_Q]) >= MAX_POINTS:
            return UNSOLVED
        _add_point(walk, outcome == APART, v)
        outcome = _solve(walk)


@kernel
def _solve(walk):
    """One small linear program, counted."""
    marks = walk.marks
    outcome, pivots, tests = solve_game(
        walk.p_moved, marks[N_P], walk.q_points, marks[N_Q], walk.table, walk.labels, walk.x_weights, walk.z_weights
    )
    marks[GAMES] += 1
    marks[PIVOTS] += pivots
    marks[TESTS] += tests
    return outcome


@kernel
def _load(walk, primal):
    """P_i* (or Q_j*) into the workspace: the star's vertex and its neighbours, or a few of too many."""
    marks = walk.marks
    levels = walk.P if primal else walk.Q
    star = marks[P_STAR] if primal else marks[Q_STAR]
    level = marks[LEVEL_P] if primal else marks[LEVEL_Q]
    row = -1 if star < 0 else row_at(levels, star, level)
    if row == (marks[LOADED_P] if primal else marks[LOADED_Q]):
        return
    start = levels.level_start[levels.depth - 1] if star < 0 else levels.neighbour_start[row]
    end = levels.level_start[levels.depth] if star < 0 else levels.neighbour_start[row + 1]
    large = end - start >= MAX_POINTS
    marks[N_P if primal else N_Q] = 0
    if star >= 0:
        _add_point(walk, primal, star)
    step = (end - start) // (_SEEDS - 1) + 1 if large else 1
    for k in range(start, end, step):
        _add_point(walk, primal, levels.level_vertices[k] if star < 0 else levels.neighbours[k])
    marks[LOADED_P if primal else LOADED_Q] = _NOT_LOADED if large else row
    marks[LARGE_P if primal else LARGE_Q] = 1 if large else 0


@kernel
def _add_point(walk, primal, v):
    """One more point of P_i* (in both frames) or of Q_j*."""
    marks = walk.marks
    if primal:
        p = vec3_at(walk.P.points, 3 * v)
        put_vec3(walk.p_own, 3 * marks[N_P], p)
        put_vec3(walk.p_moved, 3 * marks[N_P], in_frame_of_r(walk.state, p))
        marks[N_P] += 1
    else:
        put_vec3(walk.q_points, 3 * marks[N_Q], vec3_at(walk.Q.points, 3 * v))
        marks[N_Q] += 1


@kernel(inline=True)
def in_frame_of_r(state, p):
    """M p + t."""
    return add(rotate(state, M, p), vec3_at(state, T))


@kernel(inline=True)
def in_frame_of_p(state, z):
    """Mᵀz: ⟨M p + t, z⟩ = ⟨p, Mᵀz⟩ + ⟨t, z⟩."""
    return rotate_back(state, M, z)


@kernel
def _best_z(walk):
    """Σ μ_b q_b."""
    return _weighted_sum(walk.q_points, walk.z_weights, walk.marks[N_Q])


@kernel
def _best_x(walk):
    """Σ λ_a p_a, in P's own frame."""
    return _weighted_sum(walk.p_own, walk.x_weights, walk.marks[N_P])


@kernel(inline=True)
def _weighted_sum(points, weights, n):
    total = Vec3(0.0, 0.0, 0.0)
    for k in range(n):
        if weights[k] > 0.0:
            total = add(total, scale(weights[k], vec3_at(points, 3 * k)))
    return total


@kernel(inline=True)
def _between(state, at_star, best, t):
    """The point t of the way from a point of the star invariant to the best one."""
    star = vec3_at(state, at_star)
    return best if t == 1.0 else add(star, scale(t, sub(best, star)))


@kernel
def _across(points, n, a, b):
    """The largest t ≤ 1 with points[0] the lowest of all points from a up to a + t (b − a).

    The direction at t is the normal of a plane tangent to the cone κ at its apex. At a the apex is lowest, as the only
    point beyond the plane before; at b the heights are as required. The least height of the others is concave along the
    way, so at least its bound at both ends, and where the apex meets the least height the apex has the bound, too.
    """
    apex_a = height_of(points, 0, a)
    apex_b = height_of(points, 0, b)
    t = 1.0
    for k in range(1, n):
        after = height_of(points, k, b) - apex_b
        if after < 0.0:
            before = max(height_of(points, k, a) - apex_a, 0.0)
            t = min(t, before / (before - after))
    return t


@kernel
def _plane_at_p_star(walk):
    """The separation invariant with a plane tangent to κ_{p*}(P_i) at p*, at the coarsest level to all of P_i."""
    state, marks = walk.state, walk.marks
    if marks[P_STAR] < 0:
        return _tangent_to_all_of_p(walk)
    best = _best_z(walk)
    if marks[LARGE_P] != 0:  # the best plane is tangent to all of P_i, at the vertex that `_play` left
        put_vec3(state, Z, best)
        return SEPARATED
    t = _across(walk.p_moved, marks[N_P], vec3_at(state, Z_STAR), best)
    marks[TESTS] += marks[N_P]
    z = _between(state, Z_STAR, best, t)
    put_vec3(state, Z, z)
    marks[AT_P] = marks[P_STAR]
    return SEPARATED if height_of(walk.p_moved, 0, z) > 1.0 - _LOST_BY else NEITHER


@kernel
def _plane_at_q_star(walk):
    """The inverse separation invariant with a plane tangent to κ_{q*}(Q_j) at q*, at the coarsest level to Q_j."""
    state, marks = walk.state, walk.marks
    if marks[Q_STAR] < 0:
        return _tangent_to_all_of_q(walk)
    best = _best_x(walk)
    if marks[LARGE_Q] != 0:  # as in `_plane_at_p_star`
        put_vec3(state, X, best)
        return INVERSE
    star = in_frame_of_r(state, vec3_at(state, X_STAR))
    t = _across(walk.q_points, marks[N_Q], neg(star), neg(in_frame_of_r(state, best)))
    marks[TESTS] += marks[N_Q]
    x = _between(state, X_STAR, best, t)
    put_vec3(state, X, x)
    marks[AT_Q] = marks[Q_STAR]
    return INVERSE if height_of(walk.q_points, 0, in_frame_of_r(state, x)) < 1.0 + _LOST_BY else NEITHER


@kernel
def _tangent_to_all_of_p(walk):
    """The separation invariant at the coarsest level, with the best plane."""
    state, marks = walk.state, walk.marks
    z = _best_z(walk)
    put_vec3(state, Z, z)
    v, height, tests = lowest_of_level(walk.P, walk.P.depth - 1, in_frame_of_p(state, z))
    marks[AT_P] = v
    marks[TESTS] += tests
    return SEPARATED if height + dot(vec3_at(state, T), z) > 1.0 - _LOST_BY else NEITHER


@kernel
def _tangent_to_all_of_q(walk):
    """The inverse separation invariant at the coarsest level, with the best point."""
    state, marks = walk.state, walk.marks
    x = _best_x(walk)
    put_vec3(state, X, x)
    v, height, tests = lowest_of_level(walk.Q, walk.Q.depth - 1, neg(in_frame_of_r(state, x)))
    marks[AT_Q] = v
    marks[TESTS] += tests
    return INVERSE if -height < 1.0 + _LOST_BY else NEITHER
