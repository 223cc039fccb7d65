"""One round of the walk: one level down in the hierarchy of P (primal space) or of Q (polar space).

L. Barba and S. Langerman, section 5. Points stand for planes. The invariants, for the level P_i and Q_j reached:

separation          z ∈ Q_j and ⟨p, z⟩ > 1 for all p ∈ P_i: ρ(z) parts P_i from ρ0(Q_j)
inverse separation  x ∈ P_i and ⟨x, q⟩ ≤ 1 for all q ∈ Q_j: ρ(x) parts Q_j from ρ∞(P_i)
star, primal        z_φ ∈ Q_j, and ⟨p, z_φ⟩ > 1 for all p ∈ P_i but p*
star, polar         x_γ ∈ P_i, and ⟨x_γ, q⟩ ≤ 1 for all q ∈ Q_j but q*

Three things differ from the text, each explained in docs/barba-langerman.md: > and ≤ instead of "separates", so that
touching is a hit; Case 1 already where the next level is beyond φ, not only where it is beyond π; and P_i* and Q_j*
without ρ(γ) and ρ(φ), which the steps do not need once the invariants ask for z ∈ Q_j and x ∈ P_i.

Doubles throughout. What the walk says in the end is proven by `walk_proof.py`; here a lost invariant only ends the walk.
"""

from __future__ import annotations

from collide.hierarchies.matrix_game import LABELS, LOST, MEET, MOST, PART, TABLEAU, solve_game
from collide.hierarchies.packed_hierarchy import lowest_at, lowest_of_level, one_level_finer
from collide.kernels import kernel, view_f64, view_i64

# Doubles of the state: the pose of P in R's frame (y = M p + t), then the points of the invariants.
M, T, Z, Z_STAR, X, X_STAR = 0, 9, 12, 15, 18, 21  # Z in the polar space; X in P's own frame
_STATE = 24
# Workspace after the state: points of P* in P's frame and in R's, of Q*, weights, tableau.
_P_OWN, _P, _Q = _STATE, _STATE + 3 * MOST, _STATE + 6 * MOST
_X_WEIGHTS, _Z_WEIGHTS = _STATE + 9 * MOST, _STATE + 10 * MOST
_TABLE = _STATE + 11 * MOST
#: Doubles of workspace.
DOUBLES = _TABLE + TABLEAU

# Integers of the state: levels reached (0 the body itself), vertices where the plane is tangent, p* and q* (−1: all
# of the coarsest level), the rows that are loaded as P* and Q*, whether those are too large to be loaded whole, and
# counts.
LEVEL_P, LEVEL_Q, AT_P, AT_Q, P_STAR, Q_STAR, LOADED_P, LOADED_Q, N_P, N_Q, LARGE_P, LARGE_Q = range(12)
ROUNDS, TESTS, GAMES, PIVOTS = range(12, 16)
#: Integers of the state.
MARKS = 16
#: Integers of workspace.
INTEGERS = MARKS + LABELS

#: Points that a star too large begins with.
_SEEDS = 8

#: How a round ends: with the separation or the inverse separation, or with neither.
SEPARATED, INVERSE, NEITHER = range(3)

#: An invariant is lost when it fails by more than this; by less is for the proof to judge.
_LOST_BY = 1e-6


@kernel
def begin(P, Q, doubles_at, integers_at):
    """The base case i = k, j = l: two tetrahedra. Returns SEPARATED, INVERSE or NEITHER."""
    marks = view_i64(integers_at, MARKS)
    for k in range(MARKS):
        marks[k] = 0
    marks[LEVEL_P] = P[10] - 1
    marks[LEVEL_Q] = Q[10] - 1
    marks[P_STAR] = -1
    marks[Q_STAR] = -1
    marks[LOADED_P] = -2
    marks[LOADED_Q] = -2
    said = _play(P, Q, doubles_at, integers_at)
    if said == PART:
        _set_z(doubles_at, marks[N_Q], 1.0)
        return _tangent_to_all_of_p(P, doubles_at, marks)
    if said == MEET:
        _set_x(doubles_at, marks[N_P], 1.0)
        return _tangent_to_all_of_q(Q, doubles_at, marks)
    return NEITHER


@kernel
def primal_round(P, Q, doubles_at, integers_at):
    """"A walk in the primal space": from P_i to P_{i−1}, the separation invariant holding."""
    state = view_f64(doubles_at, _STATE)
    marks = view_i64(integers_at, MARKS)
    dx, dy, dz, shift = _in_frame_of_p(state, state[Z], state[Z + 1], state[Z + 2])
    v, height, tests = one_level_finer(P, marks[LEVEL_P], marks[AT_P], dx, dy, dz)
    marks[LEVEL_P] -= 1
    marks[ROUNDS] += 1
    marks[TESTS] += tests
    marks[AT_P] = v
    marks[P_STAR] = v
    for k in range(3):
        state[Z_STAR + k] = state[Z + k]
    if height + shift > 1.0:
        return SEPARATED  # Case 1
    said = _play(P, Q, doubles_at, integers_at)
    if said == PART:  # Case 2.1
        return _plane_at_p_star(doubles_at, marks)
    if said == MEET:  # Case 2.2
        return _plane_at_q_star(Q, doubles_at, marks)
    return NEITHER


@kernel
def polar_round(P, Q, doubles_at, integers_at):
    """"A walk in the polar space": from Q_j to Q_{j−1}, the inverse separation invariant holding."""
    state = view_f64(doubles_at, _STATE)
    marks = view_i64(integers_at, MARKS)
    x, y, z = _in_frame_of_r(state, state[X], state[X + 1], state[X + 2])
    v, height, tests = one_level_finer(Q, marks[LEVEL_Q], marks[AT_Q], -x, -y, -z)
    marks[LEVEL_Q] -= 1
    marks[ROUNDS] += 1
    marks[TESTS] += tests
    marks[AT_Q] = v
    marks[Q_STAR] = v
    for k in range(3):
        state[X_STAR + k] = state[X + k]
    if -height <= 1.0:
        return INVERSE  # Case 1
    said = _play(P, Q, doubles_at, integers_at)
    if said == MEET:  # Case 2.1
        return _plane_at_q_star(Q, doubles_at, marks)
    if said == PART:  # Case 2.2
        return _plane_at_p_star_or_all(P, doubles_at, marks)
    return NEITHER


# --- what the rounds are made of ----------------------------------------------------------------


@kernel
def _play(P, Q, doubles_at, integers_at):
    """The game of P_i* and Q_j*, its weights in the workspace.

    A star too large to be loaded is one of P or R itself, an apex or a facet with thousands of neighbours: no bound
    holds there. It is played with few of its points, and whichever vertex of the whole level contradicts the answer
    is found along the hierarchy and joins them, until none does.
    """
    marks = view_i64(integers_at, MARKS)
    _load(P, marks, doubles_at, True)
    _load(Q, marks, doubles_at, False)
    said = _solve(doubles_at, integers_at)
    if marks[LARGE_P] == 0 and marks[LARGE_Q] == 0:
        return said
    while True:
        if said == PART and marks[LARGE_P] != 0:
            x, y, z = _best_z(doubles_at, marks[N_Q])
            dx, dy, dz, shift = _in_frame_of_p(view_f64(doubles_at, _STATE), x, y, z)
            v, height, tests = lowest_at(P, marks[LEVEL_P], dx, dy, dz)
            enough = height + shift > 1.0
            known = v == marks[AT_P] and marks[N_P] > _SEEDS
            marks[AT_P] = v
        elif said == MEET and marks[LARGE_Q] != 0:
            x, y, z = _best_x(doubles_at, marks[N_P])
            x, y, z = _in_frame_of_r(view_f64(doubles_at, _STATE), x, y, z)
            v, height, tests = lowest_at(Q, marks[LEVEL_Q], -x, -y, -z)
            enough = -height <= 1.0
            known = v == marks[AT_Q] and marks[N_Q] > _SEEDS
            marks[AT_Q] = v
        else:
            return said
        marks[TESTS] += tests
        if enough:
            return said
        if known or max(marks[N_P], marks[N_Q]) >= MOST:
            return LOST
        _add_point(P if said == PART else Q, marks, doubles_at, said == PART, v)
        said = _solve(doubles_at, integers_at)


@kernel
def _solve(doubles_at, integers_at):
    marks = view_i64(integers_at, MARKS)
    said, pivots, tests = solve_game(
        view_f64(doubles_at + 8 * _P, 3 * MOST), marks[N_P], view_f64(doubles_at + 8 * _Q, 3 * MOST), marks[N_Q],
        view_f64(doubles_at + 8 * _TABLE, TABLEAU), view_i64(integers_at + 8 * MARKS, LABELS),
        view_f64(doubles_at + 8 * _X_WEIGHTS, MOST), view_f64(doubles_at + 8 * _Z_WEIGHTS, MOST),
    )  # fmt: skip
    marks[GAMES] += 1
    marks[PIVOTS] += pivots
    marks[TESTS] += tests
    return said


@kernel
def _load(ladder, marks, doubles_at, primal):
    """P_i* (or Q_j*) into the workspace: the star's vertex and its neighbours, or a few of too many."""
    _, birth, _, row, starts, neighbours, _, _, level_start, level_vertices, depth = ladder
    star = marks[P_STAR] if primal else marks[Q_STAR]
    level = marks[LEVEL_P] if primal else marks[LEVEL_Q]
    own_row = -1 if star < 0 else row[star] + level - birth[star]
    if own_row == (marks[LOADED_P] if primal else marks[LOADED_Q]):
        return
    start = level_start[depth - 1] if star < 0 else starts[own_row]
    end = level_start[depth] if star < 0 else starts[own_row + 1]
    large = end - start >= MOST
    marks[N_P if primal else N_Q] = 0
    if star >= 0:
        _add_point(ladder, marks, doubles_at, primal, star)
    step = (end - start) // (_SEEDS - 1) + 1 if large else 1
    for k in range(start, end, step):
        _add_point(ladder, marks, doubles_at, primal, level_vertices[k] if star < 0 else neighbours[k])
    marks[LOADED_P if primal else LOADED_Q] = -2 if large else own_row
    marks[LARGE_P if primal else LARGE_Q] = 1 if large else 0


@kernel
def _add_point(ladder, marks, doubles_at, primal, v):
    """One more point of P_i* (in both frames) or of Q_j*."""
    points = ladder[0]
    k = 3 * marks[N_P if primal else N_Q]
    own = view_f64(doubles_at + 8 * (_P_OWN if primal else _Q), 3 * MOST)
    own[k] = points[3 * v]
    own[k + 1] = points[3 * v + 1]
    own[k + 2] = points[3 * v + 2]
    if primal:
        moved = view_f64(doubles_at + 8 * _P, 3 * MOST)
        x, y, z = _in_frame_of_r(view_f64(doubles_at, _STATE), own[k], own[k + 1], own[k + 2])
        moved[k] = x
        moved[k + 1] = y
        moved[k + 2] = z
    marks[N_P if primal else N_Q] += 1


@kernel(inline=True)
def _in_frame_of_r(state, x, y, z):
    """M p + t."""
    return (
        state[0] * x + state[1] * y + state[2] * z + state[T],
        state[3] * x + state[4] * y + state[5] * z + state[T + 1],
        state[6] * x + state[7] * y + state[8] * z + state[T + 2],
    )


@kernel(inline=True)
def _in_frame_of_p(state, x, y, z):
    """(Mᵀz, t·z): ⟨M p + t, z⟩ = ⟨p, Mᵀz⟩ + t·z."""
    return (
        state[0] * x + state[3] * y + state[6] * z,
        state[1] * x + state[4] * y + state[7] * z,
        state[2] * x + state[5] * y + state[8] * z,
        state[T] * x + state[T + 1] * y + state[T + 2] * z,
    )


@kernel
def _best_z(doubles_at, n):
    """Σ μ_b q_b."""
    points = view_f64(doubles_at + 8 * _Q, 3 * MOST)
    weights = view_f64(doubles_at + 8 * _Z_WEIGHTS, MOST)
    return _sum(points, weights, n)


@kernel
def _best_x(doubles_at, n):
    """Σ λ_a p_a, in P's own frame."""
    points = view_f64(doubles_at + 8 * _P_OWN, 3 * MOST)
    weights = view_f64(doubles_at + 8 * _X_WEIGHTS, MOST)
    return _sum(points, weights, n)


@kernel(inline=True)
def _sum(points, weights, n):
    x = 0.0
    y = 0.0
    z = 0.0
    for k in range(n):
        w = weights[k]
        if w > 0.0:
            x += w * points[3 * k]
            y += w * points[3 * k + 1]
            z += w * points[3 * k + 2]
    return x, y, z


@kernel
def _set_z(doubles_at, n, t):
    """z becomes the point z_φ + t (best z − z_φ)."""
    state = view_f64(doubles_at, _STATE)
    x, y, z = _best_z(doubles_at, n)
    if t == 1.0:
        state[Z] = x
        state[Z + 1] = y
        state[Z + 2] = z
    else:
        state[Z] = state[Z_STAR] + t * (x - state[Z_STAR])
        state[Z + 1] = state[Z_STAR + 1] + t * (y - state[Z_STAR + 1])
        state[Z + 2] = state[Z_STAR + 2] + t * (z - state[Z_STAR + 2])


@kernel
def _set_x(doubles_at, n, t):
    """x becomes the point x_γ + t (best x − x_γ)."""
    state = view_f64(doubles_at, _STATE)
    x, y, z = _best_x(doubles_at, n)
    if t == 1.0:
        state[X] = x
        state[X + 1] = y
        state[X + 2] = z
    else:
        state[X] = state[X_STAR] + t * (x - state[X_STAR])
        state[X + 1] = state[X_STAR + 1] + t * (y - state[X_STAR + 1])
        state[X + 2] = state[X_STAR + 2] + t * (z - state[X_STAR + 2])


@kernel
def _across(points, n, ax, ay, az, bx, by, bz):
    """How far to go from a to b while points[0] stays the lowest of all points: the t ≤ 1 where it meets the next.

    This is the plane tangent to the cone κ at its apex. At a the apex is the lowest, being the one point beyond the
    plane before; at b the heights are right. The least height of the others is concave on the way, so it keeps what
    it has at both ends, and where the apex meets it the apex has it too.
    """
    apex_a = points[0] * ax + points[1] * ay + points[2] * az
    apex_b = points[0] * bx + points[1] * by + points[2] * bz
    t = 1.0
    for k in range(1, n):
        after = points[3 * k] * bx + points[3 * k + 1] * by + points[3 * k + 2] * bz - apex_b
        if after < 0.0:
            before = max(points[3 * k] * ax + points[3 * k + 1] * ay + points[3 * k + 2] * az - apex_a, 0.0)
            t = min(t, before / (before - after))
    return t


@kernel
def _plane_at_p_star(doubles_at, marks):
    """The separation invariant with a plane tangent to κ_{p*}(P_i) at p*."""
    state = view_f64(doubles_at, _STATE)
    points = view_f64(doubles_at + 8 * _P, 3 * MOST)
    x, y, z = _best_z(doubles_at, marks[N_Q])
    if marks[LARGE_P] != 0:  # the best plane is tangent to all of P_i, where _play says
        _set_z(doubles_at, marks[N_Q], 1.0)
        return SEPARATED
    t = _across(points, marks[N_P], state[Z_STAR], state[Z_STAR + 1], state[Z_STAR + 2], x, y, z)
    marks[TESTS] += marks[N_P]
    _set_z(doubles_at, marks[N_Q], t)
    marks[AT_P] = marks[P_STAR]
    height = points[0] * state[Z] + points[1] * state[Z + 1] + points[2] * state[Z + 2]
    return SEPARATED if height > 1.0 - _LOST_BY else NEITHER


@kernel
def _plane_at_p_star_or_all(P, doubles_at, marks):
    if marks[P_STAR] >= 0:
        return _plane_at_p_star(doubles_at, marks)
    _set_z(doubles_at, marks[N_Q], 1.0)
    return _tangent_to_all_of_p(P, doubles_at, marks)


@kernel
def _plane_at_q_star(Q, doubles_at, marks):
    """The inverse separation invariant with a plane tangent to κ_{q*}(Q_j) at q*."""
    if marks[Q_STAR] < 0:
        _set_x(doubles_at, marks[N_P], 1.0)
        return _tangent_to_all_of_q(Q, doubles_at, marks)
    if marks[LARGE_Q] != 0:  # as in `_plane_at_p_star`
        _set_x(doubles_at, marks[N_P], 1.0)
        return INVERSE
    state = view_f64(doubles_at, _STATE)
    points = view_f64(doubles_at + 8 * _Q, 3 * MOST)
    x, y, z = _best_x(doubles_at, marks[N_P])
    bx, by, bz = _in_frame_of_r(state, x, y, z)
    ax, ay, az = _in_frame_of_r(state, state[X_STAR], state[X_STAR + 1], state[X_STAR + 2])
    t = _across(points, marks[N_Q], -ax, -ay, -az, -bx, -by, -bz)
    marks[TESTS] += marks[N_Q]
    _set_x(doubles_at, marks[N_P], t)
    marks[AT_Q] = marks[Q_STAR]
    x, y, z = _in_frame_of_r(state, state[X], state[X + 1], state[X + 2])
    height = points[0] * x + points[1] * y + points[2] * z
    return INVERSE if height < 1.0 + _LOST_BY else NEITHER


@kernel
def _tangent_to_all_of_p(P, doubles_at, marks):
    state = view_f64(doubles_at, _STATE)
    dx, dy, dz, shift = _in_frame_of_p(state, state[Z], state[Z + 1], state[Z + 2])
    v, height, tests = lowest_of_level(P, P[10] - 1, dx, dy, dz)
    marks[AT_P] = v
    marks[TESTS] += tests
    return SEPARATED if height + shift > 1.0 - _LOST_BY else NEITHER


@kernel
def _tangent_to_all_of_q(Q, doubles_at, marks):
    state = view_f64(doubles_at, _STATE)
    x, y, z = _in_frame_of_r(state, state[X], state[X + 1], state[X + 2])
    v, height, tests = lowest_of_level(Q, Q[10] - 1, -x, -y, -z)
    marks[AT_Q] = v
    marks[TESTS] += tests
    return INVERSE if -height < 1.0 + _LOST_BY else NEITHER
