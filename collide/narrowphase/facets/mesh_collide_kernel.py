"""Two bodies of facets at one pair of poses or at many: from matrices to booleans inside one kernel.

Bodies whose balls are apart are apart. Else their surfaces are tested (`surface_collision.py`), then a point of every
part of either body against the inside of the other (`winding_numbers.py`): without radii, both tests decide exactly.
Bodies swept by balls take the distance of the surfaces (`surface_distance.py`). The traversals are called where they
were compiled (`kernels.native_call`). Rows are written by `mesh_distance_kernel.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i64, view_u8
from collide.mesh.bvh import CENTRE, INTS, NUMBERS, NUMBERS_AT, RADIUS, REACH
from collide.narrowphase.facets import surface_collision, surface_distance, winding_numbers
from collide.narrowphase.facets.posed_surfaces import balls_apart, deviation_from_rotation
from collide.narrowphase.facets.surface_distance import FACET_A, MARKS, MEETS, RESULT
from collide.narrowphase.pose_batches import is_pose
from collide.numerics.vec3 import Vec3, dot, put_vec3, sub, vec3_at

_test_surfaces = native_call(surface_collision.SIGNATURE)
_test_points = native_call(winding_numbers.SIGNATURE)
_measure_surfaces = native_call(surface_distance.SIGNATURE)

#: What is known of two bodies at a pair of poses. A matrix may be no pose, or place no mesh (no inverse, or a mirror).
APART, HIT, OPEN, NO_POSE, SINGULAR = range(5)
# Header, 64-bit words: two bodies (trees, solids, points of their parts, radii, which are doubles), how they relate,
# kernels, workspace.
(
    TREE_A, TREE_B, SOLID_A, SOLID_B, POINTS_A, POINTS_B, N_POINTS_A, N_POINTS_B, RADIUS_A, RADIUS_B,
    SAME_TREE, SAME_BODY, EXCHANGED, SURFACES_CODE, POINTS_CODE, DISTANCES_CODE, EXACT_CODE,
    STACK_AT, N_STACK, DOUBLES_AT, INTEGERS_AT, HEAP_AT, N_HEAP, SCRATCH_AT,
) = range(24)
HEADER = 24
#: Words of scratch: facet pairs (as many as a walk that stops at the first asks for), counters and marks (of a walk two
#: starts, its counters, its progress), a result.
KEYS, COUNTERS = 128, 2 + surface_collision.COUNTERS + surface_collision.PROGRESS
_PROGRESS = 2 + surface_collision.COUNTERS
SCRATCH = KEYS + COUNTERS + RESULT + MARKS

#: Cores of bodies with radii are looked for as far as the radii, and this much farther, so that a bracket decides.
FARTHER = 1 + 1e-9


class FacetBody(NamedTuple):
    """A body: its tree, whether the body is solid, a point of every part (3 doubles each), the swept ball's radius
    [m]."""

    tree_at: int
    solid: int
    points_at: int
    n_points: int
    radius: float


class Space(NamedTuple):
    """Addresses of the kernels called and of the workspace, as the traversals take them."""

    surfaces: int
    points: int
    distances: int
    exact: int
    stack_at: int
    n_stack: int
    doubles_at: int
    integers_at: int
    heap_at: int
    n_heap: int
    scratch_at: int


class PosedPair(NamedTuple):
    """Two bodies at their poses (addresses of 16 doubles)."""

    A: FacetBody
    B: FacetBody
    XA_at: int
    XB_at: int
    same_tree: bool


@kernel(inline=True)
def _body(words, radii, side):
    points_at, n_points = words[POINTS_A + side], words[N_POINTS_A + side]
    return FacetBody(words[TREE_A + side], words[SOLID_A + side], points_at, n_points, radii[side])


@kernel(inline=True)
def open_pair(header_at, XA_at, XB_at, exchanged):
    """The bodies of a header, A and B in the order of their contents; exchanged: the poses are those of B and A."""
    words = view_i64(header_at, HEADER)
    radii = view_f64(header_at + 8 * RADIUS_A, 2)
    pose_a = XB_at if exchanged else XA_at
    pose_b = XA_at if exchanged else XB_at
    return PosedPair(_body(words, radii, 0), _body(words, radii, 1), pose_a, pose_b, words[SAME_TREE] != 0)


@kernel(inline=True)
def open_space(header_at):
    words = view_i64(header_at, HEADER)
    return Space(
        words[SURFACES_CODE], words[POINTS_CODE], words[DISTANCES_CODE], words[EXACT_CODE], words[STACK_AT],
        words[N_STACK], words[DOUBLES_AT], words[INTEGERS_AT], words[HEAP_AT], words[N_HEAP], words[SCRATCH_AT],
    )


@kernel(inline=True)
def numbers_of(body):
    """The numbers of a body's tree: centre, reach by axis, radius of a ball around the centre."""
    return view_f64(view_i64(body.tree_at, INTS)[NUMBERS_AT], NUMBERS)


@kernel(inline=True)
def placed(X, p):
    """X p, of a pose."""
    return Vec3(
        X[0] * p.x + X[1] * p.y + X[2] * p.z + X[3], X[4] * p.x + X[5] * p.y + X[6] * p.z + X[7],
        X[8] * p.x + X[9] * p.y + X[10] * p.z + X[11],
    )


@kernel
def is_rigid(X_at, check):
    """Whether a matrix is a pose as `transforms.as_poses` judges; check: refuse what is no rotation."""
    X = view_f64(X_at, 16)
    return X[12] == 0.0 and X[13] == 0.0 and X[14] == 0.0 and X[15] == 1.0 and is_pose(X, check)


@kernel
def are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
    """Whether the matrices of pose k are poses; a matrix shared by all poses is looked at first only."""
    good = (step_a == 0 and k > first) or is_rigid(XA_at + 8 * step_a * k, check)
    return good and ((step_b == 0 and k > first) or is_rigid(XB_at + 8 * step_b * k, check))


# --- booleans -----------------------------------------------------------------------------------


@kernel
def _may_hold(X, numbers, Y, point):
    """Whether a point posed by Y may lie in the ball around the body at X: by a margin above rounding."""
    centre = vec3_at(numbers, CENTRE)
    across = sub(placed(Y, point), placed(X, centre))
    size = 0.0
    for i in range(3):
        size += abs(X[4 * i + 3]) + abs(Y[4 * i + 3]) + 2.0 * (abs(numbers[CENTRE + i]) + numbers[REACH + i])
    size += 2.0 * (abs(point.x) + abs(point.y) + abs(point.z))
    reach = numbers[RADIUS] * (1.0 + deviation_from_rotation(X))
    return not math.sqrt(dot(across, across)) > 1.001 * reach + 1e-9 * size


@kernel
def _point_inside(space, body, X_at, points_at, n_points, Y_at):
    """Number of the first of n points, in a frame at Y, inside the body at X; −1 where no point is inside.

    −2 where the matrix X is singular, or nearly so. A point left open by every segment tried counts as inside.
    """
    X = view_f64(X_at, 16)
    Y = view_f64(Y_at, 16)
    numbers = numbers_of(body)
    answer_at = space.scratch_at + 8 * KEYS
    words = view_i64(answer_at, COUNTERS)
    for k in range(n_points):
        point_at = points_at + 24 * k
        if not _may_hold(X, numbers, Y, vec3_at(view_f64(point_at, 3), 0)):
            continue
        for i in range(COUNTERS):
            words[i] = 0
        _test_points(
            space.points,
            (
                body.tree_at, X_at, 0, Y_at, 0, point_at, 0, 1, answer_at, answer_at + 8, space.stack_at, space.n_stack,
                space.doubles_at, space.integers_at, space.exact,
            ),
        )
        if words[0] == winding_numbers.SINGULAR:
            return -2
        if words[0] != winding_numbers.OUTSIDE:
            return k
    return -1


@kernel
def inside_state(space, A, XA_at, B, XB_at, inside_at):
    """HIT where a point of a part of B lies in A; else APART or SINGULAR.

    inside : 0, or three doubles that become the point in the world.
    """
    if A.solid == 0:
        return APART
    k = _point_inside(space, A, XA_at, B.points_at, B.n_points, XB_at)
    if k < 0:
        return APART if k == -1 else SINGULAR
    if inside_at != 0:
        point = vec3_at(view_f64(B.points_at + 24 * k, 3), 0)
        put_vec3(view_f64(inside_at, 3), 0, placed(view_f64(XB_at, 16), point))
    return HIT


@kernel
def cores_state(space, pair, inside_at):
    """APART, HIT or SINGULAR: whether bodies meet without their radii, exactly.

    inside : 0, or three doubles: becomes a point of the world in both bodies where a part of either lies inside the
    other, and stays unchanged otherwise.
    """
    starts_at = space.scratch_at + 8 * KEYS
    words = view_i64(starts_at, COUNTERS)
    for i in range(COUNTERS):
        words[i] = 0
    done = _test_surfaces(
        space.surfaces,
        (
            pair.A.tree_at, pair.B.tree_at, pair.XA_at, 0, pair.XB_at, 0, 1, pair.same_tree, True, space.scratch_at,
            KEYS, starts_at, starts_at + 16, starts_at + 8 * _PROGRESS, space.stack_at, space.n_stack, space.doubles_at,
            space.integers_at, space.exact,
        ),
    )
    if done != surface_collision.DONE:
        return SINGULAR
    if words[1] > words[0]:
        return HIT
    state = inside_state(space, pair.A, pair.XA_at, pair.B, pair.XB_at, inside_at)
    if state == APART:
        state = inside_state(space, pair.B, pair.XB_at, pair.A, pair.XA_at, inside_at)
    return state


@kernel(inline=True)
def crossing_of(space):
    """Where the triangles of surfaces that meet, as `cores_state` saw just now, stand in the trees: of A, and of B."""
    word = view_i64(space.scratch_at + 8 * KEYS, COUNTERS)[_PROGRESS + surface_collision.LAST]
    return word >> 32, word & 0xFFFFFFFF


@kernel(inline=True)
def result_of(space):
    """The scratch's row of results of distances, and its marks."""
    result_at = space.scratch_at + 8 * (KEYS + COUNTERS)
    return view_f64(result_at, RESULT), view_i64(result_at + 8 * RESULT, MARKS)


@kernel
def measure(space, pair, limit, enough):
    """The surfaces' distance into the scratch; False where a matrix places no mesh.

    limit, enough : as of `near_surfaces`.
    """
    result_at = space.scratch_at + 8 * (KEYS + COUNTERS)
    result, marks = result_of(space)
    while True:
        for i in range(MARKS):
            marks[i] = 0
        done = _measure_surfaces(
            space.distances,
            (
                pair.A.tree_at, pair.B.tree_at, pair.XA_at, 0, pair.XB_at, 0, 1, pair.same_tree, limit, enough,
                result_at, result_at + 8 * RESULT, space.stack_at, space.n_stack, space.heap_at, space.n_heap,
                space.doubles_at, space.integers_at, space.exact,
            ),
        )
        if done < 1:
            return False
        # Facets that rounding leaves on either side of the limit: not found within it, nor proven beyond.
        if marks[FACET_A] >= 0 or not result[surface_distance.LOWER] < limit or limit == math.inf:
            return True
        limit = math.inf


@kernel
def gap_state(space, radius):
    """APART, HIT or OPEN: swept bodies whose cores, measured just now, do not meet. Touching is a hit."""
    result, marks = result_of(space)
    meets = marks[MEETS] != 0
    if result[surface_distance.LOWER] > radius if radius > 0.0 else not meets:
        return APART
    return HIT if result[surface_distance.UPPER] <= radius or meets else OPEN


@kernel
def _bodies_state(space, pair):
    """APART, HIT, OPEN or SINGULAR."""
    radius = pair.A.radius + pair.B.radius
    state = cores_state(space, pair, 0)
    if state != APART or radius == 0.0:
        return state
    # Two facets as near as the radii are enough.
    if not measure(space, pair, radius * FARTHER, radius):
        return SINGULAR
    state = gap_state(space, radius)
    if state == OPEN:  # whoever looks no farther than the radii may be left with a wider bracket
        measure(space, pair, math.inf, radius)
        state = gap_state(space, radius)
    return state


@kernel
def balls_farther_than(pair, margin):
    """Whether balls around the cores are certainly farther apart than a margin [m]."""
    return balls_apart(
        view_f64(pair.XA_at, 16), numbers_of(pair.A), view_f64(pair.XB_at, 16), numbers_of(pair.B), margin
    )


@entry(prepared.BOOLEAN, nogil=False)
def meet_single(header_at, XA_at, XB_at):
    """Whether the bodies meet, 0 or 1; −1 where the long way answers, or says what is wrong.

    All threads share the workspace: this keeps Python's lock.
    """
    if not (is_rigid(XA_at, True) and is_rigid(XB_at, True)):
        return -1
    pair = open_pair(header_at, XA_at, XB_at, view_i64(header_at, HEADER)[EXCHANGED] != 0)
    if balls_farther_than(pair, pair.A.radius + pair.B.radius):
        return APART
    state = _bodies_state(open_space(header_at), pair)
    return state if state <= HIT else -1


@entry("int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, int64, int64)")
def meet_poses(header_at, XA_at, step_a, XB_at, step_b, first, n, check, cores, inside_at, states_at):
    """States of bodies at poses ``first`` … n − 1; returns how many are done: the next is NO_POSE or SINGULAR.

    XA, XB : matrices; step 16 or, for a single pose, 0.   check : refuse matrices that are no rotation.
    cores : leave radii out.   inside : 0, or three doubles a pose: a point of the world in both bodies, where a part of
    one lies inside the other; else left as they are.   states : n + 1 bytes, zeroed; the last becomes OPEN where some
    are.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    space = open_space(header_at)
    exchanged = view_i64(header_at, HEADER)[EXCHANGED] != 0
    states = view_u8(states_at, n + 1)
    for k in range(first, n):
        if not are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
            states[k] = NO_POSE
            return k
        pair = open_pair(header_at, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k, exchanged)
        if balls_farther_than(pair, 0.0 if cores else pair.A.radius + pair.B.radius):
            state = APART
        elif cores:
            state = cores_state(space, pair, inside_at + 24 * k if inside_at != 0 else 0)
        else:
            state = _bodies_state(space, pair)
        states[k] = state
        if state == SINGULAR:
            return k
        if state == OPEN:
            states[n] = OPEN
    return n


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, float64, int64)")
def cull_poses(numbers_a_at, XA_at, step_a, numbers_b_at, XB_at, step_b, first, n, check, margin, states_at):
    """States of any two bodies by balls around them: APART where these are farther apart than a margin [m], else OPEN.

    numbers_a, numbers_b : as of a tree, NUMBERS doubles: centre, reach by axis, radius of a ball around the centre.
    XA, XB, first, n, check, states : as of `meet_poses`, and flat as there; returns how many are done: the next is
    NO_POSE.
    """
    numbers_a = view_f64(numbers_a_at, NUMBERS)
    numbers_b = view_f64(numbers_b_at, NUMBERS)
    states = view_u8(states_at, n)
    for k in range(first, n):
        if not are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
            states[k] = NO_POSE
            return k
        XA = view_f64(XA_at + 8 * step_a * k, 16)
        XB = view_f64(XB_at + 8 * step_b * k, 16)
        states[k] = APART if balls_apart(XA, numbers_a, XB, numbers_b, margin) else OPEN
    return n
