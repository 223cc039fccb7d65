"""Derivatives of certified rows, row by row: the kernel behind `differentiate.py`.

The signed distance of two convex sets is the largest, over all unit vectors n, of the separation min n·b − max n·a: of
gaps and of depths. At its only maximum n, with its only pair of witness points a and b, it changes by n · (ḃ − ȧ), the
velocities of the sets there (Danskin). With a set turning by ω about its origin o and moving by v, ȧ = v + ω × (a − o).
"""

from __future__ import annotations

import math

from collide.derivatives.features import (
    EDGE,
    FLAT,
    LEVEL,
    VERTEX,
    convex_body_at,
    flat_size,
    is_inside,
    put_feature,
    radius_of,
    reach_of,
    size_of,
    support_set,
    vertex_of,
)
from collide.derivatives.settle_features import (
    PLACE_A,
    PLACE_B,
    POSE_A,
    POSE_B,
    SETTLE_DOUBLES,
    SETTLE_INTS,
    into_frame,
    posed_patch,
    settle_features,
)
from collide.derivatives.zonotope_directions import ZONOTOPE_DOUBLES, has_single_direction, is_zonotope
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.narrowphase.rows import BEYOND, CERTIFIED, DISTANCE, LOWER, NORMAL, POINT_A, POINT_B, ROW, UPPER, view_row
from collide.numerics.vec3 import Vec3, add, cross, neg, norm, put_vec3, rotate, rotate_back, scale, sub, vec3_at

# Doubles of a derivative: the gradient by the poses of A and of B, angular then linear each; unit normal, signed
# distance of the cores, and of either core its witness point, tangents and second derivatives along the normal.
GRADIENT, UNIT_NORMAL, CORE_DISTANCE = 0, 12, 15
CORE_A, TANGENTS_A, BENDING_A = 16, 19, 25
CORE_B, TANGENTS_B, BENDING_B = 28, 31, 37
DERIVATIVE = 40
# Integers of a derivative: its state, how many parameters either feature has, codes of both features, whether the
# features stay the same at poses nearby.
STATE, SIZE_A, SIZE_B, CODE_A, CODE_B, IS_FIXED = range(6)
DERIVATIVE_INTS = 6
#: States, as of `uniqueness.Uniqueness`; DIRECTION_OPEN: unique unless another direction is as short.
(
    UNIQUE, UNCERTAIN, TOO_FAR, NO_DEPTH, SEVERAL_POINTS, SEVERAL_DIRECTIONS, SEVERAL_PARTS, NOT_CONVEX, NOT_SETTLED,
    DIRECTION_OPEN,
) = range(10)
#: Edges that cross at an angle whose sine is less are parallel.
_PARALLEL = 2.0**-30
#: Where features do not settle, heights that differ by less than this part of the reach are taken for equal.
_NEARLY_LEVEL = 2.0**-20


# Header: rows; tables of convex sets (`set_rows.py`); (n,) rows of these tables, of A and of B; poses (n, 4, 4) of the
# sets and of the bodies, and 16 or, of a single pose, 0; what is written; workspace.
(
    ROWS_AT, INTS_AT, NUMBERS_AT, SETS_A_AT, SETS_B_AT, PARTS_A_AT, PART_STEP_A, PARTS_B_AT, PART_STEP_B, BODIES_A_AT,
    BODY_STEP_A, BODIES_B_AT, BODY_STEP_B, OUT_AT, OUT_INTS_AT, WORK_DOUBLES_AT, WORK_INTS_AT,
) = range(17)
GRADIENT_HEADER, GRADIENT_DOUBLES = 17, SETTLE_DOUBLES + ZONOTOPE_DOUBLES


@entry("void(int64, int64)")
def differentiate_rows(header_at, n):
    """Derivatives of n rows of `PAIR_DTYPE`: (n, DERIVATIVE) and (n, DERIVATIVE_INTS) are written. O(vertices) each."""
    words = view_i64(header_at, GRADIENT_HEADER)
    sets_a, sets_b = view_i64(words[SETS_A_AT], n), view_i64(words[SETS_B_AT], n)
    doubles, ints = view_f64(words[WORK_DOUBLES_AT], GRADIENT_DOUBLES), view_i64(words[WORK_INTS_AT], SETTLE_INTS)
    for k in range(n):
        row = view_row(words[ROWS_AT] + ROW * k)
        out = view_f64(words[OUT_AT] + 8 * DERIVATIVE * k, DERIVATIVE)
        kinds = view_i64(words[OUT_INTS_AT] + 8 * DERIVATIVE_INTS * k, DERIVATIVE_INTS)
        for j in range(DERIVATIVE):
            out[j] = math.nan
        kinds[SIZE_A], kinds[SIZE_B], kinds[CODE_A], kinds[CODE_B], kinds[IS_FIXED] = 0, 0, -1, -1, 0
        state = _state_before(row)
        if state == UNIQUE:
            _put_pose(doubles, POSE_A, view_f64(words[PARTS_A_AT] + 8 * words[PART_STEP_A] * k, 16))
            _put_pose(doubles, POSE_B, view_f64(words[PARTS_B_AT] + 8 * words[PART_STEP_B] * k, 16))
            A = convex_body_at(words[INTS_AT], words[NUMBERS_AT], sets_a[k])
            B = convex_body_at(words[INTS_AT], words[NUMBERS_AT], sets_b[k])
            if _are_points_apart(A, B, row):
                state = _points_apart(A, B, row, doubles, out, kinds)
            elif _is_flat(A) and _is_flat(B):
                state = _flat_pair(A, B, row, doubles, out, kinds)
            else:
                state = _curved_pair(A, B, row, doubles, ints, out, kinds)
            if state != NOT_SETTLED:
                X_WA = view_f64(words[BODIES_A_AT] + 8 * words[BODY_STEP_A] * k, 16)
                X_WB = view_f64(words[BODIES_B_AT] + 8 * words[BODY_STEP_B] * k, 16)
                _put_gradient(out, _origin(X_WA), _origin(X_WB))
        kinds[STATE] = state


@kernel(inline=True)
def _is_flat(body):
    return body.kind == POINTS or body.kind == HALFSPACE


@kernel(inline=True)
def _state_before(row):
    """What a row's flags say."""
    if row.flags[BEYOND] != 0:
        return TOO_FAR
    if row.flags[CERTIFIED] == 0:
        return UNCERTAIN
    if row.doubles[NORMAL] == 0.0 and row.doubles[NORMAL + 1] == 0.0 and row.doubles[NORMAL + 2] == 0.0:
        return NO_DEPTH
    return UNIQUE


@kernel(inline=True)
def _put_pose(doubles, at, X):
    """R row by row, then t, of a matrix (4, 4)."""
    for i in range(3):
        for j in range(3):
            doubles[at + 3 * i + j] = X[4 * i + j]
        doubles[at + 9 + i] = X[4 * i + 3]


@kernel(inline=True)
def _are_points_apart(A, B, row):
    """Whether both sets are balls, their centres apart."""
    if not (A.kind == POINTS and B.kind == POINTS and A.count == 1 and B.count == 1):
        return False
    d = row.doubles[DISTANCE] + radius_of(A) + radius_of(B)
    return d > LEVEL * max(reach_of(A), reach_of(B))


@kernel
def _points_apart(A, B, row, doubles, out, kinds):
    """Of two balls: no other point of a core can be the nearest."""
    put_vec3(out, UNIT_NORMAL, vec3_at(row.doubles, NORMAL))
    out[CORE_DISTANCE] = row.doubles[DISTANCE] + radius_of(A) + radius_of(B)
    for k in range(3, 12):
        out[CORE_A + k] = out[CORE_B + k] = 0.0
    put_vec3(out, CORE_A, add(rotate(doubles, POSE_A, vertex_of(A, 0)), vec3_at(doubles, POSE_A + 9)))
    put_vec3(out, CORE_B, add(rotate(doubles, POSE_B, vertex_of(B, 0)), vec3_at(doubles, POSE_B + 9)))
    kinds[CODE_A], kinds[CODE_B], kinds[IS_FIXED] = VERTEX, VERTEX, 1
    return UNIQUE


@kernel
def _flat_pair(A, B, row, doubles, out, kinds):
    """Of cores of points and half-spaces, whose normals and points are exact to last digits."""
    n = vec3_at(row.doubles, NORMAL)
    d = row.doubles[DISTANCE] + radius_of(A) + radius_of(B)
    g_a, g_b = rotate_back(doubles, POSE_A, n), rotate_back(doubles, POSE_B, neg(n))
    at_a, at_b = support_set(A, g_a, LEVEL), support_set(B, g_b, LEVEL)
    p_a = into_frame(doubles, POSE_A, sub(vec3_at(row.doubles, POINT_A), scale(radius_of(A), n)))
    p_b = into_frame(doubles, POSE_B, add(vec3_at(row.doubles, POINT_B), scale(radius_of(B), n)))
    code_a, code_b = _flat_code(at_a.dimension), _flat_code(at_b.dimension)
    put_feature(A, code_a, at_a, p_a, doubles, PLACE_A)
    put_feature(B, code_b, at_b, p_b, doubles, PLACE_B)
    is_inside_a = is_inside(A, code_a, at_a, doubles, PLACE_A, g_a)
    kinds[IS_FIXED] = is_inside_a and is_inside(B, code_b, at_b, doubles, PLACE_B, g_b)
    return _written(A, B, doubles, out, kinds, code_a, code_b, at_a.dimension, at_b.dimension, n, d)


@kernel(inline=True)
def _flat_code(dimension):
    if dimension == 0:
        return VERTEX
    return EDGE if dimension == 1 else FLAT


@kernel
def _curved_pair(A, B, row, doubles, ints, out, kinds):
    """Of a curved core and another: normal and points settled by Newton's method, within the row's bracket."""
    n = vec3_at(row.doubles, NORMAL)
    radii = radius_of(A) + radius_of(B)
    p_a = sub(vec3_at(row.doubles, POINT_A), scale(radius_of(A), n))
    p_b = add(vec3_at(row.doubles, POINT_B), scale(radius_of(B), n))
    settled = settle_features(A, B, doubles, ints, n, p_a, p_b, row.doubles[DISTANCE] + radii)
    off = LEVEL * (reach_of(A) + reach_of(B) + abs(settled.d) + radii)
    lower, upper = row.doubles[LOWER] + radii - off, row.doubles[UPPER] + radii + off
    if not settled.is_answer or settled.d < lower or settled.d > upper:
        at_a = support_set(A, rotate_back(doubles, POSE_A, n), _NEARLY_LEVEL)
        at_b = support_set(B, rotate_back(doubles, POSE_B, neg(n)), _NEARLY_LEVEL)
        return SEVERAL_POINTS if at_a.dimension > 0 and at_b.dimension > 0 else NOT_SETTLED
    n = settled.n
    g_a, g_b = rotate_back(doubles, POSE_A, n), rotate_back(doubles, POSE_B, neg(n))
    at_a, at_b = support_set(A, g_a, LEVEL), support_set(B, g_b, LEVEL)
    kinds[IS_FIXED] = (
        at_a.dimension == flat_size(settled.code_a)
        and at_b.dimension == flat_size(settled.code_b)
        and is_inside(A, settled.code_a, settled.ids_a, doubles, PLACE_A, g_a)
        and is_inside(B, settled.code_b, settled.ids_b, doubles, PLACE_B, g_b)
    )
    return _written(
        A, B, doubles, out, kinds, settled.code_a, settled.code_b, at_a.dimension, at_b.dimension, n, settled.d
    )


@kernel
def _written(A, B, doubles, out, kinds, code_a, code_b, dimension_a, dimension_b, n, d):
    """Write features, points, normal; the state of the pair."""
    a = posed_patch(A, doubles, POSE_A, code_a, PLACE_A, n, 1.0)
    b = posed_patch(B, doubles, POSE_B, code_b, PLACE_B, n, -1.0)
    kinds[SIZE_A], kinds[SIZE_B] = size_of(code_a), size_of(code_b)
    kinds[CODE_A], kinds[CODE_B] = code_a, code_b
    put_vec3(out, UNIT_NORMAL, n)
    out[CORE_DISTANCE] = d
    _put_core(out, CORE_A, a)
    _put_core(out, CORE_B, b)
    is_crossing = dimension_a == 1 and dimension_b == 1
    is_crossing = is_crossing and norm(cross(_line(a, code_a), _line(b, code_b))) > _PARALLEL
    if dimension_a > 0 and dimension_b > 0 and not is_crossing:
        return SEVERAL_POINTS
    if A.kind == HALFSPACE or B.kind == HALFSPACE or d > LEVEL * max(reach_of(A), reach_of(B)):
        return UNIQUE
    if is_zonotope(A) and is_zonotope(B):
        answer = has_single_direction(A, B, doubles, POSE_A, POSE_B, SETTLE_DOUBLES, n, d)
        if answer >= 0:
            return UNIQUE if answer > 0 else SEVERAL_DIRECTIONS
    return DIRECTION_OPEN


@kernel(inline=True)
def _line(patch, code):
    """The direction of the segment of a support set."""
    return patch.t1 if code == EDGE else patch.t2


@kernel(inline=True)
def _put_core(out, at, patch):
    put_vec3(out, at, patch.p)
    put_vec3(out, at + 3, patch.t1)
    put_vec3(out, at + 6, patch.t2)
    out[at + 9], out[at + 10], out[at + 11] = patch.c11, patch.c12, patch.c22


@kernel(inline=True)
def _put_gradient(out, o_a, o_b):
    """−(a − o_A) × n and −n, (b − o_B) × n and n: points of cores have the arms of witness points, but for n."""
    n = vec3_at(out, UNIT_NORMAL)
    a, b = vec3_at(out, CORE_A), vec3_at(out, CORE_B)
    put_vec3(out, GRADIENT, cross(n, sub(a, o_a)))
    put_vec3(out, GRADIENT + 3, neg(n))
    put_vec3(out, GRADIENT + 6, cross(sub(b, o_b), n))
    put_vec3(out, GRADIENT + 9, n)


@kernel(inline=True)
def _origin(X):
    """Of a pose (4, 4)."""
    return Vec3(X[3], X[7], X[11])
