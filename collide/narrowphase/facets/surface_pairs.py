"""Two bodies of facets at one pair of poses or at many: from matrices to booleans and rows inside one kernel.

Bodies that balls around them part are apart. Else their surfaces are tested (`surface_collision.py`), then a point of
every part of either body against the inside of the other (`winding_numbers.py`): without radii, that decides exactly.
Bodies swept by balls, and rows, take the distance of the surfaces (`surface_distance.py`). What kernels do not settle
(depths, directions of bodies that all but touch, gaps that boxes of floats cannot measure) is told by a status, for
`body_pairs.py` to finish. The traversals are called where they were compiled (`kernels.native_call`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i32, view_i64, view_u8
from collide.mesh.bvh import CENTRE, EXPONENT, INTS, NUMBERS, NUMBERS_AT, RADIUS, REACH
from collide.narrowphase import rows
from collide.narrowphase.facets import surface_collision, surface_distance, winding_numbers
from collide.narrowphase.facets.posed_surfaces import balls_apart, deviation_from_rotation, is_swapped_order
from collide.narrowphase.facets.surface_distance import FACET_A, FACET_B, MARKS, MEETS, RESULT
from collide.narrowphase.pose_batches import is_pose
from collide.narrowphase.rows import ROW, open_row, view_row
from collide.numerics.vec3 import Vec3, add, dot, put_vec3, scale, sub, vec3_at
from collide.results import EXACT, FORMULA, UNDECIDED

_test_surfaces = native_call(surface_collision.SIGNATURE)
_test_points = native_call(winding_numbers.SIGNATURE)
_measure_surfaces = native_call(surface_distance.SIGNATURE)

#: What is known of two bodies at a pair of poses. A matrix may be no pose, or place no mesh (no inverse, or a mirror).
APART, HIT, OPEN, NO_POSE, SINGULAR = range(5)
# What a row still lacks, as bits: the depth and points of bodies whose cores meet, or that only their radii make meet
# (or may); the direction of bodies that all but touch; the gap of bodies too far apart for boxes of floats.
CORES_MEET, RADII_MEET, NEARLY_TOUCH, TOO_FAR = 1, 2, 4, 8
#: A row that is none: a matrix is no pose, or singular. Above all bits.
ROW_NO_POSE, ROW_SINGULAR = 16, 32

# Header, 64-bit words: two bodies (trees, solids, points of their parts, radii, which are doubles), how they relate,
# kernels, workspace.
(
    TREE_A, TREE_B, SOLID_A, SOLID_B, POINTS_A, POINTS_B, N_POINTS_A, N_POINTS_B, RADIUS_A, RADIUS_B,
    SAME_TREE, SAME_BODY, EXCHANGED, SURFACES_CODE, POINTS_CODE, DISTANCES_CODE, EXACT_CODE,
    STACK_AT, N_STACK, DOUBLES_AT, INTEGERS_AT, HEAP_AT, N_HEAP, SCRATCH_AT,
) = range(24)  # fmt: skip
HEADER = 24
#: Words of scratch: facet pairs (as many as a walk that stops at the first asks for), counters and marks, a result.
KEYS, COUNTERS = 128, 8
SCRATCH = KEYS + COUNTERS + RESULT + MARKS

#: Surfaces nearer than this share of the pair's size leave their direction to rounding.
NEARLY_TOUCHING = 2.0**-24
#: `certified` promises gaps in brackets no wider than this, in units of the pair's size.
PROMISE = 2.0**-43
#: Cores of bodies with radii are looked for as far as the radii, and this much farther, so that a bracket decides.
FARTHER = 1 + 1e-9
#: The largest gap that boxes of floats can measure, in units of the smaller body's boxes.
FARTHEST = 1e20


class FacetBody(NamedTuple):
    """One body: its tree, whether it is solid, one point of every part (3 doubles each), the radius of its ball [m]."""

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
def _posed_pair(header_at, XA_at, XB_at, exchanged):
    """The bodies of a header, A and B in the order of their contents; exchanged: the poses are those of B and A."""
    words = view_i64(header_at, HEADER)
    radii = view_f64(header_at + 8 * RADIUS_A, 2)
    pose_a = XB_at if exchanged else XA_at
    pose_b = XA_at if exchanged else XB_at
    return PosedPair(_body(words, radii, 0), _body(words, radii, 1), pose_a, pose_b, words[SAME_TREE] != 0)


@kernel(inline=True)
def _space(header_at):
    words = view_i64(header_at, HEADER)
    return Space(
        words[SURFACES_CODE], words[POINTS_CODE], words[DISTANCES_CODE], words[EXACT_CODE], words[STACK_AT],
        words[N_STACK], words[DOUBLES_AT], words[INTEGERS_AT], words[HEAP_AT], words[N_HEAP], words[SCRATCH_AT],
    )  # fmt: skip


@kernel(inline=True)
def _numbers(body):
    """The numbers of a body's tree: centre, reach by axis, radius of a ball around the centre."""
    return view_f64(view_i64(body.tree_at, INTS)[NUMBERS_AT], NUMBERS)


@kernel(inline=True)
def _placed(X, p):
    """X p, of a pose."""
    return Vec3(
        X[0] * p.x + X[1] * p.y + X[2] * p.z + X[3], X[4] * p.x + X[5] * p.y + X[6] * p.z + X[7],
        X[8] * p.x + X[9] * p.y + X[10] * p.z + X[11],
    )  # fmt: skip


@kernel
def _is_rigid(X_at, check):
    """Whether a matrix is a pose as `transforms.as_poses` judges; check: refuse what is no rotation."""
    X = view_f64(X_at, 16)
    return X[12] == 0.0 and X[13] == 0.0 and X[14] == 0.0 and X[15] == 1.0 and is_pose(X, check)


@kernel
def _are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
    """Whether the matrices of pose k are poses; one that goes with all of the other's is looked at first only."""
    good = (step_a == 0 and k > first) or _is_rigid(XA_at + 8 * step_a * k, check)
    return good and ((step_b == 0 and k > first) or _is_rigid(XB_at + 8 * step_b * k, check))


# --- booleans -----------------------------------------------------------------------------------


@kernel
def _may_hold(X, numbers, Y, point):
    """Whether a point posed by Y may lie in the ball around the body at X: by a margin above rounding."""
    centre = vec3_at(numbers, CENTRE)
    across = sub(_placed(Y, point), _placed(X, centre))
    size = 0.0
    for i in range(3):
        size += abs(X[4 * i + 3]) + abs(Y[4 * i + 3]) + 2.0 * (abs(numbers[CENTRE + i]) + numbers[REACH + i])
    size += 2.0 * (abs(point.x) + abs(point.y) + abs(point.z))
    reach = numbers[RADIUS] * (1.0 + deviation_from_rotation(X))
    return not math.sqrt(dot(across, across)) > 1.001 * reach + 1e-9 * size


@kernel
def _point_inside(space, body, X_at, points_at, n_points, Y_at):
    """Number of the first point, of n in a frame at Y, that lies in the body at X; −1 where none does.

    −2 where the matrix X places no mesh. A point that every segment tried leaves open counts as inside.
    """
    X = view_f64(X_at, 16)
    Y = view_f64(Y_at, 16)
    numbers = _numbers(body)
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
        )  # fmt: skip
        if words[0] == winding_numbers.SINGULAR:
            return -2
        if words[0] != winding_numbers.OUTSIDE:
            return k
    return -1


@kernel
def _test_inside(space, A, XA_at, B, XB_at, inside_at):
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
        put_vec3(view_f64(inside_at, 3), 0, _placed(view_f64(XB_at, 16), point))
    return HIT


@kernel
def _test_cores(space, pair, inside_at):
    """APART, HIT or SINGULAR: whether bodies meet without their radii, exactly.

    inside : 0, or three doubles: a point of the world that lies in both where no surfaces meet; else left as they are.
    """
    starts_at = space.scratch_at + 8 * KEYS
    words = view_i64(starts_at, COUNTERS)
    for i in range(COUNTERS):
        words[i] = 0
    done = _test_surfaces(
        space.surfaces,
        (
            pair.A.tree_at, pair.B.tree_at, pair.XA_at, 0, pair.XB_at, 0, 1, pair.same_tree, True, space.scratch_at,
            KEYS, starts_at, starts_at + 16, starts_at + 40, space.stack_at, space.n_stack, space.doubles_at,
            space.integers_at, space.exact,
        ),
    )  # fmt: skip
    if done != surface_collision.DONE:
        return SINGULAR
    if words[1] > words[0]:
        return HIT
    state = _test_inside(space, pair.A, pair.XA_at, pair.B, pair.XB_at, inside_at)
    if state == APART:
        state = _test_inside(space, pair.B, pair.XB_at, pair.A, pair.XA_at, inside_at)
    return state


@kernel(inline=True)
def _result(space):
    """The scratch's row of results of distances, and its marks."""
    result_at = space.scratch_at + 8 * (KEYS + COUNTERS)
    return view_f64(result_at, RESULT), view_i64(result_at + 8 * RESULT, MARKS)


@kernel
def _measure(space, pair, limit):
    """The surfaces' distance into the scratch, looked for within the limit; False where a matrix places no mesh."""
    result_at = space.scratch_at + 8 * (KEYS + COUNTERS)
    result, marks = _result(space)
    while True:
        for i in range(MARKS):
            marks[i] = 0
        done = _measure_surfaces(
            space.distances,
            (
                pair.A.tree_at, pair.B.tree_at, pair.XA_at, 0, pair.XB_at, 0, 1, pair.same_tree, limit, result_at,
                result_at + 8 * RESULT, space.stack_at, space.n_stack, space.heap_at, space.n_heap, space.doubles_at,
                space.integers_at, space.exact,
            ),
        )  # fmt: skip
        if done < 1:
            return False
        # Facets that rounding leaves on either side of the limit: not found within it, nor proven beyond.
        if marks[FACET_A] >= 0 or not result[surface_distance.LOWER] < limit or limit == math.inf:
            return True
        limit = math.inf


@kernel
def _test_gap(space, radius):
    """APART, HIT or OPEN: swept bodies whose cores, measured just now, do not meet."""
    result, marks = _result(space)
    meets = marks[MEETS] != 0
    if result[surface_distance.LOWER] > radius if radius > 0.0 else not meets:
        return APART
    return HIT if result[surface_distance.UPPER] <= radius or meets else OPEN


@kernel
def _test_bodies(space, pair):
    """APART, HIT, OPEN or SINGULAR."""
    radius = pair.A.radius + pair.B.radius
    state = _test_cores(space, pair, 0)
    if state != APART or radius == 0.0:
        return state
    if not _measure(space, pair, radius * FARTHER):
        return SINGULAR
    state = _test_gap(space, radius)
    if state == OPEN:  # whoever looks no farther than the radii may be left with a wider bracket
        _measure(space, pair, math.inf)
        state = _test_gap(space, radius)
    return state


@kernel
def _balls_apart(pair, margin):
    """Whether balls around the cores are certainly farther apart than a margin [m]."""
    return balls_apart(view_f64(pair.XA_at, 16), _numbers(pair.A), view_f64(pair.XB_at, 16), _numbers(pair.B), margin)


@entry(prepared.BOOLEAN, nogil=False)
def meet_single(header_at, XA_at, XB_at):
    """Whether the bodies meet, 0 or 1; −1 where the long way answers, or says what is wrong.

    All threads share the workspace: this keeps Python's lock.
    """
    if not (_is_rigid(XA_at, True) and _is_rigid(XB_at, True)):
        return -1
    pair = _posed_pair(header_at, XA_at, XB_at, view_i64(header_at, HEADER)[EXCHANGED] != 0)
    if _balls_apart(pair, pair.A.radius + pair.B.radius):
        return APART
    state = _test_bodies(_space(header_at), pair)
    return state if state <= HIT else -1


@entry("int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, int64, int64)")
def meet_poses(header_at, XA_at, step_a, XB_at, step_b, first, n, check, cores, inside_at, states_at):
    """States of bodies at poses ``first`` … n − 1; returns how many are done: the next is NO_POSE or SINGULAR.

    XA, XB : matrices; step 16 or, for a single pose, 0.   check : refuse matrices that are no rotation.
    cores : leave radii out.   inside : 0, or three doubles a pose: a point of the world in both bodies, where a part of
    one lies inside the other; else left as they are.   states : a byte a pose.
    """
    space = _space(header_at)
    exchanged = view_i64(header_at, HEADER)[EXCHANGED] != 0
    states = view_u8(states_at, n)
    for k in range(first, n):
        if not _are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
            states[k] = NO_POSE
            return k
        pair = _posed_pair(header_at, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k, exchanged)
        if _balls_apart(pair, 0.0 if cores else pair.A.radius + pair.B.radius):
            state = APART
        elif cores:
            state = _test_cores(space, pair, inside_at + 24 * k if inside_at != 0 else 0)
        else:
            state = _test_bodies(space, pair)
        states[k] = state
        if state == SINGULAR:
            return k
    return n


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, float64, int64)")
def cull_poses(numbers_a_at, XA_at, step_a, numbers_b_at, XB_at, step_b, first, n, check, margin, states_at):
    """States of any two bodies by balls around them: APART where these are farther apart than a margin [m], else OPEN.

    numbers_a, numbers_b : as of a tree, NUMBERS doubles: centre, reach by axis, radius of a ball around the centre.
    XA, XB, first, n, check, states : as of `meet_poses`; returns how many are done: the next is NO_POSE.
    """
    numbers_a = view_f64(numbers_a_at, NUMBERS)
    numbers_b = view_f64(numbers_b_at, NUMBERS)
    states = view_u8(states_at, n)
    for k in range(first, n):
        if not _are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
            states[k] = NO_POSE
            return k
        XA = view_f64(XA_at + 8 * step_a * k, 16)
        XB = view_f64(XB_at + 8 * step_b * k, 16)
        states[k] = APART if balls_apart(XA, numbers_a, XB, numbers_b, margin) else OPEN
    return n


# --- rows ---------------------------------------------------------------------------------------


@kernel(inline=True)
def _step(row_at, field, up):
    """Make a number of a row, if it is positive, the next double above it or below it; make it 0 where it is not."""
    value = view_f64(row_at + 8 * field, 1)
    bits = view_i64(row_at + 8 * field, 1)
    if value[0] > 0.0:
        if value[0] < math.inf:
            bits[0] += 1 if up else -1
    elif up and value[0] == 0.0:
        bits[0] = 1
    else:
        value[0] = 0.0


@kernel(inline=True)
def _unit_or_z(v):
    """A vector of length 1; the z axis where there is no direction."""
    length = math.sqrt(dot(v, v))
    return Vec3(v.x / length, v.y / length, v.z / length) if length > 0.0 else Vec3(0.0, 0.0, 1.0)


@kernel(inline=True)
def _reach(numbers, radius):
    """How far a body reaches from its frame's origin [m]."""
    reach = vec3_at(numbers, REACH)
    return math.sqrt(dot(reach, reach)) + radius


@kernel
def _size(pair):
    """S of docs/conventions.md: reaches of both bodies from their frames' origins, and how far these are apart [m]."""
    XA = view_f64(pair.XA_at, 16)
    XB = view_f64(pair.XB_at, 16)
    across = Vec3(XB[3] - XA[3], XB[7] - XA[7], XB[11] - XA[11])
    reaches = _reach(_numbers(pair.A), pair.A.radius) + _reach(_numbers(pair.B), pair.B.radius)
    return reaches + math.sqrt(dot(across, across))


@kernel(inline=True)
def _set_bracket(row_at, result, radius):
    """Lower and upper bound and distance of bodies, from those of their cores."""
    row = view_f64(row_at, 12)
    row[rows.LOWER] = result[surface_distance.LOWER] - radius
    row[rows.UPPER] = result[surface_distance.UPPER] - radius
    if radius > 0.0:
        _step(row_at, rows.LOWER, False)
        _step(row_at, rows.UPPER, True)
    row[rows.DISTANCE] = min(max(result[surface_distance.DISTANCE] - radius, row[rows.LOWER]), row[rows.UPPER])
    if row[rows.DISTANCE] == 0.0:  # apart, and nearer than the bracket is wide: 0 would say that they touch
        row[rows.DISTANCE] = row[rows.UPPER]


@kernel
def _write_gap(space, pair, limit, hull_at, exchanged, row_at):
    """The row of bodies whose cores are apart, from their distance in the scratch; returns what it lacks.

    hull : 0, or the row of the bodies' hulls, A and B as they are asked about.   exchanged : these are worked on in the
    other order. Of facets that all but touch rounding leaves many directions, and the pair found may be one around the
    corner of two faces that lie on each other: hulls as far apart, as far as is proven, know the bodies' direction.
    """
    result, marks = _result(space)
    row, words, flags = open_row(row_at)
    radius = pair.A.radius + pair.B.radius
    unseen = marks[FACET_A] < 0
    middle_a = _placed(view_f64(pair.XA_at, 16), vec3_at(_numbers(pair.A), CENTRE))
    middle_b = _placed(view_f64(pair.XB_at, 16), vec3_at(_numbers(pair.B), CENTRE))
    normal = vec3_at(result, surface_distance.NORMAL)
    if unseen or (normal.x == 0.0 and normal.y == 0.0 and normal.z == 0.0):
        normal = _unit_or_z(sub(middle_b, middle_a))
    size = _size(pair)
    _set_bracket(row_at, result, radius)
    lacks = 0
    turned = False
    if not unseen and result[surface_distance.DISTANCE] <= NEARLY_TOUCHING * size:
        if hull_at == 0:
            lacks = NEARLY_TOUCH
        else:
            hull = view_f64(hull_at, 12)
            turned = hull[rows.UPPER] + pair.A.radius + pair.B.radius >= result[surface_distance.LOWER]
            if turned:
                normal = vec3_at(hull, rows.NORMAL)
                if exchanged:
                    normal = sub(Vec3(0.0, 0.0, 0.0), normal)
    point_a = add(vec3_at(result, surface_distance.POINT_A), scale(pair.A.radius, normal))
    point_b = sub(vec3_at(result, surface_distance.POINT_B), scale(pair.B.radius, normal))
    if turned:  # lay the points as far apart, about their middle
        missing = scale(0.5, sub(scale(row[rows.DISTANCE], normal), sub(point_b, point_a)))
        point_a = sub(point_a, missing)
        point_b = add(point_b, missing)
    beyond = unseen or row[rows.LOWER] > limit
    narrow = row[rows.UPPER] <= row[rows.LOWER] + PROMISE * size
    flags[rows.CERTIFIED] = 1 if (narrow or beyond) and (row[rows.LOWER] > 0.0 or radius == 0.0) else 0
    flags[rows.BEYOND] = 1 if beyond else 0
    if unseen:  # beyond the limit; without one, `body_pairs.py` writes this row
        row[rows.LOWER] = limit if limit < math.inf else 0.0
        if limit < math.inf:
            _step(row_at, rows.LOWER, True)
        middle = scale(0.5, add(middle_a, middle_b))
        half = scale(0.5 * row[rows.LOWER], normal)
        point_a = sub(middle, half)
        point_b = add(middle, half)
    if beyond:
        row[rows.DISTANCE] = row[rows.LOWER]
        row[rows.UPPER] = math.inf
    put_vec3(row, rows.NORMAL, add(normal, Vec3(0.0, 0.0, 0.0)))  # never −0.0
    put_vec3(row, rows.POINT_A, point_a)
    put_vec3(row, rows.POINT_B, point_b)
    words[rows.PART_A] = max(marks[FACET_A], 0)
    words[rows.PART_B] = max(marks[FACET_B], 0)
    flags[rows.EXACT_ROUNDS] = min(marks[surface_distance.EXACT], 255)
    exponent = min(view_i64(pair.A.tree_at, INTS)[EXPONENT], view_i64(pair.B.tree_at, INTS)[EXPONENT])
    if unseen and limit > FARTHEST * math.ldexp(1.0, int(exponent)):
        lacks |= TOO_FAR
    return lacks


@kernel
def _write_row(space, pair, limit, reach, hull_at, exchanged, row_at):
    """The row of two bodies, A and B as worked on; returns what it lacks.

    reach : how far cores are looked for, above the limit and the radii [m].   hull, exchanged : as of `_write_gap`.
    """
    result, marks = _result(space)
    _, _, flags = open_row(row_at)
    radius = pair.A.radius + pair.B.radius
    if _balls_apart(pair, reach):
        for i in range(RESULT):
            result[i] = 0.0
        for i in range(MARKS):
            marks[i] = 0
        marks[FACET_A] = marks[FACET_B] = -1
        result[surface_distance.DISTANCE] = result[surface_distance.LOWER] = reach
        result[surface_distance.UPPER] = math.inf
    else:
        inside = view_f64(row_at + 8 * rows.POINT_A, 3)
        inside[0] = math.nan
        state = _test_cores(space, pair, row_at + 8 * rows.POINT_A)
        if state == SINGULAR or (state == APART and not _measure(space, pair, reach)):
            return ROW_SINGULAR
        if state == HIT:
            flags[rows.HIT] = 1
            flags[rows.HOW] = EXACT
            put_vec3(view_f64(row_at, 12), rows.POINT_B, vec3_at(inside, 0))
            return CORES_MEET
    lacks = _write_gap(space, pair, limit, hull_at, exchanged, row_at)
    state = _test_gap(space, radius)
    if state == OPEN:  # a search no farther than the radii may have a bracket that is narrow enough
        _measure(space, pair, radius * FARTHER)
        state = APART if _test_gap(space, radius) == APART else OPEN
    if state != APART:
        lacks |= RADII_MEET
        flags[rows.HIT] = 1
    flags[rows.HOW] = UNDECIDED if state == OPEN else FORMULA
    return lacks


@kernel
def _exchange(row_at):
    """Make a row that of the same bodies in the other order (`results.flipped`)."""
    row, words, _ = view_row(row_at)
    normal = vec3_at(row, rows.NORMAL)
    point = vec3_at(row, rows.POINT_A)
    part = words[rows.PART_A]
    put_vec3(row, rows.NORMAL, sub(Vec3(0.0, 0.0, 0.0), normal))
    put_vec3(row, rows.POINT_A, vec3_at(row, rows.POINT_B))
    put_vec3(row, rows.POINT_B, point)
    words[rows.PART_A] = words[rows.PART_B]
    words[rows.PART_B] = part


@kernel
def _row_at_poses(header_at, space, XA_at, XB_at, limit, reach, hull_at, row_at):
    """A row of the bodies as they are asked about; returns what it lacks.

    Bodies are worked on in the order of their contents, equal ones in the order of their poses, so that swapped questions
    give the same numbers.
    """
    words = view_i64(header_at, HEADER)
    exchanged = words[EXCHANGED] != 0
    pair = _posed_pair(header_at, XA_at, XB_at, exchanged)
    if words[SAME_BODY] != 0 and is_swapped_order(view_f64(pair.XA_at, 12), view_f64(pair.XB_at, 12)):
        pair = PosedPair(pair.B, pair.A, pair.XB_at, pair.XA_at, pair.same_tree)
        exchanged = not exchanged
    lacks = _write_row(space, pair, limit, reach, hull_at, exchanged, row_at)
    if exchanged and lacks != ROW_SINGULAR:
        _exchange(row_at)
    return lacks


@entry(prepared.ROW, nogil=False)
def gap_single(header_at, XA_at, XB_at, row_at, _depths):
    """1 where bodies are apart, with their row of PAIR_DTYPE, zeroed before; −1 where the long way is to be taken."""
    if not (_is_rigid(XA_at, True) and _is_rigid(XB_at, True)):
        return -1
    view_i32(row_at, ROW // 4)[rows.BODY_B] = 1
    lacks = _row_at_poses(header_at, _space(header_at), XA_at, XB_at, math.inf, math.inf, 0, row_at)
    return -1 if lacks != 0 else 1


@entry("int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, float64, int64, int64, int64)")
def gap_poses(header_at, XA_at, step_a, XB_at, step_b, first, n, check, limit, reach, hulls_at, rows_at, lacks_at):
    """Rows of bodies at poses ``first`` … n − 1; returns how many are done: of one that is not, ``lacks`` says why.

    XA, XB, check : as of `meet_poses`.   limit : beyond it only a lower bound is wanted [m].   reach : how far cores
    are looked for: next above the limit and the radii [m].   hulls : 0, or rows of the bodies' hulls, for directions.
    rows : of PAIR_DTYPE, zeroed; of cores that meet both points become a point inside both, NaN where surfaces meet.
    lacks : a byte a pose, bits of what a row lacks; or ROW_NO_POSE, ROW_SINGULAR.
    """
    space = _space(header_at)
    lacks = view_u8(lacks_at, n)
    for k in range(first, n):
        if not _are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
            lacks[k] = ROW_NO_POSE
            return k
        hull_at = hulls_at + ROW * k if hulls_at != 0 else 0
        lacks[k] = _row_at_poses(
            header_at, space, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k, limit, reach, hull_at, rows_at + ROW * k
        )
        if lacks[k] == ROW_SINGULAR:
            return k
    return n
