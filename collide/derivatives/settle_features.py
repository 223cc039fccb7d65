"""The features that a pair of cores is nearest, or deepest, between: settled to last digits by equations of patches.

With patches a(u) of A and b(v) of B, a unit vector n from A to B and the cores' signed distance d, the equations are

    ∂a/∂u · n = 0,   ∂b/∂v · n = 0,   b − a − d n = 0,   (n · n − 1) / 2 = 0.

Newton's method solves them from a row of a query, whose normal is known to seven digits where sets are curved. The same
matrix gives derivatives by the poses: of u, v, n and d (the implicit function theorem). The matrix is regular where the
features are the whole answer: also where d = 0, and in overlaps.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.derivatives.features import (
    LEVEL,
    MAX_FEATURES,
    PLACE,
    Patch,
    SupportSet,
    holds_place,
    list_features,
    move_place,
    outward,
    patch_at,
    put_feature,
    reach_of,
    size_of,
)
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, add, dot, norm, norm1, rotate, rotate_back, scale, sub, vec3_at

#: Unknowns: two parameters a patch, n, d; columns of the matrix and its right side.
UNKNOWNS, _COLUMNS = 8, 9
# Workspace of doubles: poses of both sets (R row by row, then t), places of both features, the matrix.
POSE_A, POSE_B, PLACE_A, PLACE_B = 0, 12, 24, 24 + PLACE
_MATRIX = 24 + 2 * PLACE
SETTLE_DOUBLES = _MATRIX + UNKNOWNS * _COLUMNS
#: Workspace of integers: features of A, then of B, four integers each (`list_features`).
_FEATURES_B = 4 * MAX_FEATURES
SETTLE_INTS = 2 * _FEATURES_B
#: Points of rows are off by less than this part of a reach.
_NEAR = 2.0**-14
#: Steps of Newton's method; a step so small, as a part of the size, is the last.
_STEPS, _LAST_STEP = 24, 2.0**-44


class Settled(NamedTuple):
    """The answer of a pair of cores: features, unit normal, signed distance [m].   is_answer : whether Newton's method
    settled."""

    is_answer: Any
    code_a: Any
    code_b: Any
    ids_a: Any
    ids_b: Any
    n: Any
    d: Any


@kernel(inline=True)
def _ids_at(ints, at):
    """The `SupportSet` of a listed feature."""
    return SupportSet(0, ints[at + 1], ints[at + 2], ints[at + 3])


@kernel(inline=True)
def into_frame(doubles, pose, p):
    """A point of the world in a set's frame.   pose : POSE_A or POSE_B."""
    return rotate_back(doubles, pose, sub(p, vec3_at(doubles, pose + 9)))


@kernel
def posed_patch(body, doubles, pose, code, place, n, sign):
    """The patch of a feature in the world, second derivatives along n.   sign : 1 of A, −1 of B."""
    patch = patch_at(body, code, doubles, place, rotate_back(doubles, pose, outward(n, sign)))
    p = add(rotate(doubles, pose, patch.p), vec3_at(doubles, pose + 9))
    t1, t2 = rotate(doubles, pose, patch.t1), rotate(doubles, pose, patch.t2)
    return Patch(p, t1, t2, sign * patch.c11, sign * patch.c12, sign * patch.c22)


@kernel
def settle_features(A, B, doubles, ints, n, p_a, p_b, d):
    """`Settled` features near those of a row: core points p_a and p_b, normal n, signed distance d of the cores.

    doubles, ints : workspace, poses of both sets written.
    """
    g_a, g_b = rotate_back(doubles, POSE_A, n), rotate_back(doubles, POSE_B, outward(n, -1.0))
    at_a, at_b = into_frame(doubles, POSE_A, p_a), into_frame(doubles, POSE_B, p_b)
    n_a = list_features(A, g_a, at_a, _NEAR, ints, 0)
    n_b = list_features(B, g_b, at_b, _NEAR, ints, _FEATURES_B)
    for slack in (0.0, 4.0 * LEVEL):  # of features whose border is met, the first that strictly holds the point
        for i in range(0, 4 * n_a, 4):
            for j in range(_FEATURES_B, _FEATURES_B + 4 * n_b, 4):
                ids_a, ids_b = _ids_at(ints, i), _ids_at(ints, j)
                put_feature(A, ints[i], ids_a, at_a, doubles, PLACE_A)
                put_feature(B, ints[j], ids_b, at_b, doubles, PLACE_B)
                settled = _solved(A, B, doubles, ints[i], ints[j], ids_a, ids_b, n, d, slack)
                if settled.is_answer and dot(settled.n, n) > 1.0 - _NEAR:
                    return settled
    nothing = SupportSet(0, ints[0], ints[0], ints[0])
    return Settled(False, ints[0], ints[0], nothing, nothing, n, d)


@kernel
def _solved(A, B, doubles, code_a, code_b, ids_a, ids_b, n, d, slack):
    """Newton's method for two features; an answer where both points settle within their features, as support points.

    slack : as of `holds_place`, of each reach.
    """
    size = max(reach_of(A), reach_of(B), abs(d))
    is_settled = False
    for _ in range(_STEPS):
        a = posed_patch(A, doubles, POSE_A, code_a, PLACE_A, n, 1.0)
        b = posed_patch(B, doubles, POSE_B, code_b, PLACE_B, n, -1.0)
        put_system(doubles, _MATRIX, a, b, size_of(code_a), size_of(code_b), n, d)
        if not solve(doubles, _MATRIX, _COLUMNS, 1):
            break
        u1, u2, v1, v2 = _unknown(doubles, 0), _unknown(doubles, 1), _unknown(doubles, 2), _unknown(doubles, 3)
        dn = Vec3(_unknown(doubles, 4), _unknown(doubles, 5), _unknown(doubles, 6))
        dd = _unknown(doubles, 7)
        move_place(code_a, doubles, PLACE_A, u1, u2)
        move_place(code_b, doubles, PLACE_B, v1, v2)
        n = add(n, dn)
        length = norm(n)
        n = scale(1.0 / length, n)
        d += dd
        step = norm1(dn) + (abs(dd) + abs(u1) + abs(u2) + abs(v1) + abs(v2)) / size
        if not step < 1e3:
            break
        if step <= _LAST_STEP:
            is_settled = True
            break
    if is_settled:
        g_a, g_b = rotate_back(doubles, POSE_A, n), rotate_back(doubles, POSE_B, outward(n, -1.0))
        is_settled = holds_place(A, code_a, ids_a, doubles, PLACE_A, g_a, slack * reach_of(A))
        is_settled = is_settled and holds_place(B, code_b, ids_b, doubles, PLACE_B, g_b, slack * reach_of(B))
    return Settled(is_settled, code_a, code_b, ids_a, ids_b, n, d)


@kernel(inline=True)
def _unknown(doubles, k):
    return doubles[_MATRIX + _COLUMNS * k + UNKNOWNS]


@kernel
def put_system(m, at, a, b, size_a, size_b, n, d):
    """Newton's equations J·step = −residual of two patches, a row of nine numbers each, at a place of an array."""
    for k in range(UNKNOWNS * _COLUMNS):
        m[at + k] = 0.0
    _put_patch(m, at, 0, a, size_a, n)
    _put_patch(m, at, 2, b, size_b, n)
    offset = sub(sub(b.p, a.p), scale(d, n))
    for k in range(3):
        row = at + _COLUMNS * (4 + k)
        if size_a > 0:
            m[row] = -_part(a.t1, k)
        if size_a > 1:
            m[row + 1] = -_part(a.t2, k)
        if size_b > 0:
            m[row + 2] = _part(b.t1, k)
        if size_b > 1:
            m[row + 3] = _part(b.t2, k)
        m[row + 4 + k] = -d
        m[row + 7] = -_part(n, k)
        m[row + 8] = -_part(offset, k)
        m[at + _COLUMNS * 7 + 4 + k] = _part(n, k)
    m[at + _COLUMNS * 7 + 8] = 0.5 * (1.0 - dot(n, n))


@kernel(inline=True)
def _put_patch(m, at, first, patch, size, n):
    """The rows of a patch's tangents; parameters that a patch lacks are 0."""
    for k in range(2):
        row = at + _COLUMNS * (first + k)
        if k >= size:
            m[row + first + k] = 1.0
            continue
        t = patch.t1 if k == 0 else patch.t2
        m[row + first] = patch.c11 if k == 0 else patch.c12
        if size > 1:
            m[row + first + 1] = patch.c12 if k == 0 else patch.c22
        m[row + 4] = t.x
        m[row + 5] = t.y
        m[row + 6] = t.z
        m[row + 8] = -dot(t, n)


@kernel(inline=True)
def _part(v, k):
    if k == 0:
        return v.x
    return v.y if k == 1 else v.z


@kernel
def solve(m, at, columns, right):
    """Gaussian elimination with pivots of rows: solutions stand in the last ``right`` columns. False where singular."""
    n = columns - right
    for k in range(n):
        pivot, largest = k, abs(m[at + columns * k + k])
        for i in range(k + 1, n):
            if abs(m[at + columns * i + k]) > largest:
                pivot, largest = i, abs(m[at + columns * i + k])
        if not largest > 0.0:
            return False
        for j in range(k, columns):
            m[at + columns * k + j], m[at + columns * pivot + j] = m[at + columns * pivot + j], m[at + columns * k + j]
        for i in range(n):
            if i == k:
                continue
            factor = m[at + columns * i + k] / m[at + columns * k + k]
            if factor != 0.0:
                for j in range(k, columns):
                    m[at + columns * i + j] -= factor * m[at + columns * k + j]
    for k in range(n):
        for j in range(n, columns):
            m[at + columns * k + j] /= m[at + columns * k + k]
    return True
