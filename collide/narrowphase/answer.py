"""The narrowphase over a list of pairs: dispatch, bracket, witness points, one row a pair.

One entry point for booleans, distances and batches, because every further one compiles the whole
narrowphase again. The half of the pair matrix below the diagonal is answered by exchanging the
bodies and flipping the row.
"""

from __future__ import annotations

import math
from threading import local

import numpy as np

from collide._jit import address_of, entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.geometry.packing import HALFSPACE, POINTS
from collide.geometry.supports import support
from collide.geometry.tables import (
    ADDRESS,
    COUNT,
    INTS,
    KIND,
    LOWEST,
    NUMBERS,
    PADDED,
    PARAMS,
    POSE,
    RADIUS,
    RANK,
    REACH,
    SLOP,
    ShapeTable,
)
from collide.narrowphase.bounds import ERROR, EXACT_ERROR, GJK_ROUNDS, PROMISE_CURVED, PROMISE_POINTS
from collide.narrowphase.capsule_capsule import across_segments, nearest_of_segments
from collide.narrowphase.epa import DOUBLES, FLAT, INTEGERS, epa, workspace
from collide.narrowphase.exact import INTEGERS as EXACT_INTEGERS
from collide.narrowphase.exact import SEPARATE, TOUCHING, touch_exactly
from collide.narrowphase.gjk import APART, ENCLOSED, NEAREST, gjk
from collide.narrowphase.halfspace_convex import gap_of_halfspaces, plane_in_world
from collide.narrowphase.matrix import CAPSULES, HALFSPACE_CONVEX, HALFSPACES, method
from collide.narrowphase.minkowski import POINT
from collide.narrowphase.simplex import face_weights
from collide.results import EXACT, FORMULA, PAIR_DTYPE, PLANE, SIMPLEX, SWEPT, UNDECIDED


def _at(field: str, unit: int) -> int:
    assert PAIR_DTYPE.fields is not None
    return PAIR_DTYPE.fields[field][1] // unit


_ROW = PAIR_DTYPE.itemsize
_DISTANCE, _LOWER, _UPPER = _at("distance", 8), _at("lower", 8), _at("upper", 8)
_NORMAL, _POINT_A, _POINT_B = _at("normal", 8), _at("point_a", 8), _at("point_b", 8)
_VERTICES_A, _VERTICES_B, _ITERATIONS = _at("vertices_a", 4), _at("vertices_b", 4), _at("iterations", 4)
_COUNT, _HOW, _EXACT, _HIT = _at("count", 1), _at("how", 1), _at("exact", 1), _at("hit", 1)
_CERTIFIED, _BEYOND = _at("certified", 1), _at("beyond", 1)

# Workspace ahead of what EPA needs: five difference points and their ids, weights.
_WEIGHTS = 5 * POINT
_OWN_DOUBLES, _OWN_INTEGERS = 64, 16


@kernel
def _longest_row(poses, p):
    longest = 0.0
    for k in range(3):
        x = poses[p + 3 * k]
        y = poses[p + 3 * k + 1]
        z = poses[p + 3 * k + 2]
        longest = max(longest, x * x + y * y + z * z)
    return math.sqrt(longest)


@kernel
def _exchange(ints, poses, sa, pa, sb, pb):
    """Whether to work on (B, A): by content of the shapes, then by the numbers of the poses."""
    rank_a = ints[INTS * sa + RANK]
    rank_b = ints[INTS * sb + RANK]
    if rank_a != rank_b:
        return rank_a > rank_b
    for k in range(12):
        if poses[POSE * pa + k] != poses[POSE * pb + k]:
            return poses[POSE * pa + k] > poses[POSE * pb + k]
    return False


@kernel
def _write_vectors(row, nx, ny, nz, ax, ay, az, bx, by, bz, flip):
    """Normal and witness points of the pair as asked, from those of the pair as worked on."""
    sign = -1.0 if flip else 1.0
    row[_NORMAL] = sign * nx + 0.0
    row[_NORMAL + 1] = sign * ny + 0.0
    row[_NORMAL + 2] = sign * nz + 0.0
    first = _POINT_B if flip else _POINT_A
    second = _POINT_A if flip else _POINT_B
    row[first] = ax
    row[first + 1] = ay
    row[first + 2] = az
    row[second] = bx
    row[second + 1] = by
    row[second + 2] = bz


@kernel
def _write_vertices(words, marks, ids, n, flip):
    first = _VERTICES_B if flip else _VERTICES_A
    second = _VERTICES_A if flip else _VERTICES_B
    marks[_COUNT] = n
    for k in range(n):
        words[first + k] = ids[2 * k]
        words[second + k] = ids[2 * k + 1]


@kernel
def _write_verdict(row, marks, distance, lower, upper, how, width, limit):
    """The numbers and flags of a row; rounding must not put the distance outside its own bracket."""
    row[_LOWER] = lower
    row[_UPPER] = upper
    row[_DISTANCE] = min(max(distance, lower), upper) + 0.0  # never −0.0
    decided = lower > 0.0 or upper <= 0.0
    marks[_HOW] = how if decided else UNDECIDED
    marks[_HIT] = 0 if lower > 0.0 else 1
    marks[_CERTIFIED] = 1 if decided and upper - lower <= width else 0
    marks[_BEYOND] = 1 if lower > limit else 0
    if lower > limit:
        row[_DISTANCE] = lower
        row[_UPPER] = math.inf
        marks[_CERTIFIED] = 1


@kernel
def _segment_differences(pair, points, ids):
    """The four differences of two cores of at most two points, each core's ends in order."""
    (coords_a, n_a, m_a, _, _, p, coords_b, n_b, m_b, _, _, q, _, poses, tx, ty, tz) = pair
    for k in range(4):
        i = min(k & 1, n_a - 1)
        j = min(k >> 1, n_b - 1)
        for axis in range(3):
            r = p + 3 * axis
            a = poses[r] * coords_a[i] + poses[r + 1] * coords_a[m_a + i] + poses[r + 2] * coords_a[2 * m_a + i]
            r = q + 3 * axis
            b = poses[r] * coords_b[j] + poses[r + 1] * coords_b[m_b + j] + poses[r + 2] * coords_b[2 * m_b + j]
            t = tx if axis == 0 else (ty if axis == 1 else tz)
            points[POINT * k + axis] = (a - b) - t
            points[POINT * k + 3 + axis] = a
            points[POINT * k + 6 + axis] = b
        ids[2 * k] = i
        ids[2 * k + 1] = j


@kernel
def _segments(pair, points, ids, weights, error):
    """Sphere and capsule cores: (depth, bound, core, 4, nx, ny, nz) as `_apart` and `_overlap` have them."""
    _segment_differences(pair, points, ids)
    core, bound = nearest_of_segments(points, weights)
    if core > error:
        return -core, bound, core, -weights[4] / core, -weights[5] / core, -weights[6] / core
    nx, ny, nz = across_segments(points)
    depth = -math.inf
    for k in range(4):
        depth = max(depth, nx * points[POINT * k] + ny * points[POINT * k + 1] + nz * points[POINT * k + 2])
    return depth, -depth, core, nx, ny, nz


@kernel
def _load_facet(doubles_at, integers_at, facet, points, ids, weights, with_ids):
    """The corners of EPA's facet become points 0..2, weighted for the origin's foot on its plane."""
    source, _, source_ids, facets, _, _, _ = workspace(doubles_at, integers_at)
    for k in range(3):
        v = facets[7 * facet + k]
        for j in range(POINT):
            points[POINT * k + j] = source[POINT * v + j]
        if with_ids:
            ids[2 * k] = source_ids[2 * v]
            ids[2 * k + 1] = source_ids[2 * v + 1]
    w0, w1, w2 = face_weights(points, 0, POINT, 2 * POINT)
    w0 = max(w0, 0.0)
    w1 = max(w1, 0.0)
    w2 = max(w2, 0.0)
    total = w0 + w1 + w2
    if total > 0.0:
        weights[0] = w0 / total
        weights[1] = w1 / total
        weights[2] = w2 / total
    else:
        weights[0] = 1.0
        weights[1] = 0.0
        weights[2] = 0.0


@kernel
def _cores(pair, doubles_at, integers_at, boolean, radius, limit, size, error, curved):
    """Two convex cores by GJK, and by EPA where they overlap.

    Returns
    -------
    depth : of the cores; minus their distance where they are apart.
    bound : lower bound of the core distance before ``error``, negative for overlap.
    above : upper bound of the signed core distance before ``error``.
    nx, ny, nz : from A towards B.
    n, vertices : points of the deciding feature in the workspace, and how many of its ids to show.
    rounds : of GJK, plus 65536 times those of EPA.
    """
    points = view_f64(doubles_at, 5 * POINT)
    weights = view_f64(doubles_at + 8 * _WEIGHTS, 7)
    ids = view_i64(integers_at, 10)
    status, n, bound, clearance, rounds = gjk(pair, points, ids, weights, boolean, radius, limit, error, GJK_ROUNDS)
    core = math.sqrt(weights[4] * weights[4] + weights[5] * weights[5] + weights[6] * weights[6])
    if status == NEAREST or status == APART:
        return -core, bound, core, -weights[4] / core, -weights[5] / core, -weights[6] / core, n, n, rounds
    above = -clearance if status == ENCLOSED else core
    if boolean and above + error < radius:
        return -above, -math.inf, above, 0.0, 0.0, 1.0, n, n, rounds
    tolerance = 0.125 * PROMISE_CURVED * size if curved else 0.25 * error
    outcome, depth, surface, nx, ny, nz, facet, added = epa(
        pair, doubles_at + 8 * _OWN_DOUBLES, integers_at + 8 * _OWN_INTEGERS, boolean, error, tolerance
    )
    if outcome != FLAT:
        _load_facet(
            doubles_at + 8 * _OWN_DOUBLES, integers_at + 8 * _OWN_INTEGERS, facet, points, ids, weights,
            status != ENCLOSED,
        )  # fmt: skip
    if surface > error:
        above = min(above, -surface)
    shown = 4 if status == ENCLOSED else (n if outcome == FLAT else 3)
    return depth, -depth, above, nx, ny, nz, n if outcome == FLAT else 3, shown, rounds + 65536 * added


@kernel
def _swept(
    pair, ints, shape_a, shape_b, row, words, marks, doubles_at, integers_at, boolean, limit, size, error, exactly, flip
):
    """Two convex cores, each swept by a ball: the cores' answer, moved by the sum of the radii."""
    (_, n_a, _, kind_a, _, p, _, n_b, _, kind_b, _, q, numbers, poses, _, _, _) = pair
    radius_a = numbers[NUMBERS * shape_a + RADIUS]
    radius_b = numbers[NUMBERS * shape_b + RADIUS]
    radius = radius_a + radius_b
    points = view_f64(doubles_at, 5 * POINT)
    weights = view_f64(doubles_at + 8 * _WEIGHTS, 7)
    ids = view_i64(integers_at, 10)
    curved = kind_a != POINTS or kind_b != POINTS
    closed_form = method(kind_a, n_a, kind_b, n_b) == CAPSULES
    if closed_form:
        depth, bound, above, nx, ny, nz = _segments(pair, points, ids, weights, error)
        n, vertices, rounds = 4, 4, 0
    else:
        depth, bound, above, nx, ny, nz, n, vertices, rounds = _cores(
            pair, doubles_at, integers_at, boolean, radius, limit, size, error, curved
        )
    lower = bound - error - radius
    upper = above + error - radius
    how = FORMULA if closed_form else (PLANE if lower > 0.0 else (SIMPLEX if above < 0.0 or radius == 0.0 else SWEPT))
    words[_ITERATIONS] = rounds
    width = math.inf if boolean else (PROMISE_CURVED if curved else PROMISE_POINTS) * size
    distance = -depth - radius
    if lower <= 0.0 < upper and exactly and not curved:
        distance, lower, upper, vertices, spent = _decide(
            pair, ints, shape_a, shape_b, integers_at, distance, lower, upper, vertices, size
        )
        how = EXACT if spent > 0 else how
        marks[_EXACT] = min(spent, 255)
    _write_verdict(row, marks, distance, lower, upper, how, width, limit)
    ax = _combine(points, weights, n, 3)
    ay = _combine(points, weights, n, 4)
    az = _combine(points, weights, n, 5)
    bx = _combine(points, weights, n, 6)
    by = _combine(points, weights, n, 7)
    bz = _combine(points, weights, n, 8)
    # On curved cores the last facet still has a width: what the two points miss of depth·n is shared
    # between them. For polytopes this is rounding.
    missing = 0.0 if boolean else 0.5
    ox = missing * (ax - bx - pair[14] - depth * nx)
    oy = missing * (ay - by - pair[15] - depth * ny)
    oz = missing * (az - bz - pair[16] - depth * nz)
    _write_vectors(
        row, nx, ny, nz,
        (ax - ox + radius_a * nx) + poses[p + 9],
        (ay - oy + radius_a * ny) + poses[p + 10],
        (az - oz + radius_a * nz) + poses[p + 11],
        (bx + ox - radius_b * nx) + poses[q + 9],
        (by + oy - radius_b * ny) + poses[q + 10],
        (bz + oz - radius_b * nz) + poses[q + 11],
        flip,
    )  # fmt: skip
    _write_vertices(words, marks, ids, vertices, flip)


@kernel
def _decide(pair, ints, shape_a, shape_b, integers_at, distance, lower, upper, vertices, size):
    """Settle a sign that doubles leave open: (distance, lower, upper, vertices shown, rounds).

    0 rounds: the magnitudes span too many bits, and the sign stays open.
    """
    numbers = pair[12]
    at_a = NUMBERS * shape_a
    at_b = NUMBERS * shape_b
    verdict, shown, _, excess, rounds = touch_exactly(
        pair, view_i64(integers_at + 8 * (_OWN_INTEGERS + INTEGERS), EXACT_INTEGERS), view_i64(integers_at, 10),
        vertices, ints[INTS * shape_a + LOWEST], ints[INTS * shape_b + LOWEST], numbers[at_a + REACH],
        numbers[at_b + REACH], numbers[at_a + RADIUS], numbers[at_b + RADIUS], size,
    )  # fmt: skip
    if verdict == SEPARATE:
        return excess, max(lower, (1.0 - EXACT_ERROR) * excess), min(upper, (1.0 + EXACT_ERROR) * excess), shown, rounds
    if verdict == TOUCHING:
        return min(distance, 0.0), lower, 0.0, shown, rounds
    return distance, lower, upper, vertices, 0


@kernel
def _combine(points, weights, n, j):
    """Coordinate j of the weighted sum of n stored points."""
    total = 0.0
    for k in range(n):
        total += weights[k] * points[POINT * k + j]
    return total


@kernel
def _half(pair, shape_b, row, words, marks, doubles_at, integers_at, limit, size, error, flip):
    """A half-space A and a convex B: the point of B deepest behind the plane."""
    (_, _, _, _, at_a, p, coords_b, n_b, m_b, kind_b, at_b, q, numbers, poses, tx, ty, tz) = pair
    ids = view_i64(integers_at, 10)
    nx, ny, nz, offset, length = plane_in_world(numbers, at_a, poses, p)
    nx /= length
    ny /= length
    nz /= length
    k, x, y, z = support(
        kind_b, coords_b, n_b, m_b, numbers, at_b,
        -(poses[q] * nx + poses[q + 3] * ny + poses[q + 6] * nz),
        -(poses[q + 1] * nx + poses[q + 4] * ny + poses[q + 7] * nz),
        -(poses[q + 2] * nx + poses[q + 5] * ny + poses[q + 8] * nz),
    )  # fmt: skip
    bx = poses[q] * x + poses[q + 1] * y + poses[q + 2] * z
    by = poses[q + 3] * x + poses[q + 4] * y + poses[q + 5] * z
    bz = poses[q + 6] * x + poses[q + 7] * y + poses[q + 8] * z
    radius = numbers[NUMBERS * shape_b + RADIUS]
    gap = ((bx + tx) * nx + (by + ty) * ny + (bz + tz) * nz) - offset / length - radius
    _write_verdict(row, marks, gap, gap - error, gap + error, FORMULA, math.inf, limit)
    bx += poses[q + 9] - radius * nx
    by += poses[q + 10] - radius * ny
    bz += poses[q + 11] - radius * nz
    _write_vectors(row, nx, ny, nz, bx - gap * nx, by - gap * ny, bz - gap * nz, bx, by, bz, flip)
    ids[0] = -1
    ids[1] = k
    _write_vertices(words, marks, ids, 1, flip)


@kernel
def _halves(pair, row, marks, limit, flip):
    """Two half-spaces: apart only with exactly opposite normals; overlap has no end, depth −inf."""
    (_, _, _, _, at_a, p, _, _, _, _, at_b, q, numbers, poses, tx, ty, tz) = pair
    opposite, gap, error, nx, ny, nz = gap_of_halfspaces(numbers, at_a, p, at_b, q, poses, tx, ty, tz)
    if opposite and gap > error:
        # Opposite within rounding: a tilt below rounding would let them meet, very far away.
        _write_verdict(row, marks, gap, gap - error, gap + error, FORMULA, math.inf, limit)
        marks[_CERTIFIED] = 0
    else:
        row[_LOWER] = -math.inf
        row[_DISTANCE] = -math.inf
        row[_UPPER] = 0.0
        marks[_HIT] = 1
        marks[_HOW] = FORMULA
        marks[_CERTIFIED] = 0 if opposite and abs(gap) <= error else 1
    foot = 0.5 * gap
    ax = poses[p + 9] + 0.5 * tx
    ay = poses[p + 10] + 0.5 * ty
    az = poses[p + 11] + 0.5 * tz
    _write_vectors(
        row, nx, ny, nz, ax - foot * nx, ay - foot * ny, az - foot * nz, ax + foot * nx, ay + foot * ny,
        az + foot * nz, flip,
    )  # fmt: skip


@entry("int64(int64, int64, int64, int64, int64, int64, boolean, boolean, float64, int64, int64, int64)")
def answer_pairs(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, stop_at_hit, limit, rows_at, doubles_at,
    integers_at,
):  # fmt: skip
    """Answer pairs of posed convex sets, one row each; returns how many were answered.

    ints, numbers : a `ShapeTable`.   poses : POSE doubles a part.   shape_of : a shape row a part.
    pairs : two part numbers a pair.   boolean : only hit, certified and how are wanted.
    stop_at_hit : stop after the first hit.   limit : farther apart than this is not looked at.
    rows : PAIR_DTYPE, zeroed.   doubles, integers : workspace, see `workspace_of_thread`.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    for k in range(n_pairs):
        row = view_f64(rows_at + _ROW * k, 12)
        words = view_i32(rows_at + _ROW * k, _ROW // 4)
        marks = view_u8(rows_at + _ROW * k, _ROW)
        pa = pairs[2 * k]
        pb = pairs[2 * k + 1]
        _answer(
            ints_at, numbers_at, poses_at, shape_of_at, pa, pb, boolean, limit, row, words, marks, doubles_at, integers_at
        )
        if stop_at_hit and marks[_HIT] == 1:
            return k + 1
    return n_pairs


@kernel
def _answer(
    ints_at, numbers_at, poses_at, shape_of_at, pa, pb, boolean, limit, row, words, marks, doubles_at, integers_at
):
    shape_of = view_i64(shape_of_at, max(pa, pb) + 1)
    sa = shape_of[pa]
    sb = shape_of[pb]
    ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
    numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
    poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
    for k in range(4):
        words[_VERTICES_A + k] = -1
        words[_VERTICES_B + k] = -1
    flip = _exchange(ints, poses, sa, pa, sb, pb)
    if ints[INTS * sb + KIND] == HALFSPACE and ints[INTS * sa + KIND] != HALFSPACE:
        flip = True
    elif ints[INTS * sa + KIND] == HALFSPACE and ints[INTS * sb + KIND] != HALFSPACE:
        flip = False
    if flip:
        sa, sb = sb, sa
        pa, pb = pb, pa
    kind_a = ints[INTS * sa + KIND]
    kind_b = ints[INTS * sb + KIND]
    n_a = ints[INTS * sa + COUNT]
    n_b = ints[INTS * sb + COUNT]
    m_a = ints[INTS * sa + PADDED]
    m_b = ints[INTS * sb + PADDED]
    p = POSE * pa
    q = POSE * pb
    tx = poses[q + 9] - poses[p + 9]
    ty = poses[q + 10] - poses[p + 10]
    tz = poses[q + 11] - poses[p + 11]
    at_a = NUMBERS * sa
    at_b = NUMBERS * sb
    pair = (
        view_f64(ints[INTS * sa + ADDRESS], 3 * m_a), n_a, m_a, kind_a, at_a + PARAMS, p,
        view_f64(ints[INTS * sb + ADDRESS], 3 * m_b), n_b, m_b, kind_b, at_b + PARAMS, q,
        numbers, poses, tx, ty, tz,
    )  # fmt: skip
    size = numbers[at_a + REACH] * _longest_row(poses, p) + numbers[at_b + REACH] * _longest_row(poses, q)
    size += math.sqrt(tx * tx + ty * ty + tz * tz) + numbers[at_a + RADIUS] + numbers[at_b + RADIUS]
    slop = numbers[at_a + SLOP] + numbers[at_b + SLOP] + poses[p + 12] + poses[q + 12]
    how = method(kind_a, n_a, kind_b, n_b)
    if how == HALFSPACES:
        _halves(pair, row, marks, limit, flip)
    elif how == HALFSPACE_CONVEX:
        m0 = numbers[at_a + PARAMS]
        m1 = numbers[at_a + PARAMS + 1]
        m2 = numbers[at_a + PARAMS + 2]
        size += abs(numbers[at_a + PARAMS + 3]) / math.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        _half(pair, sb, row, words, marks, doubles_at, integers_at, limit, size, ERROR * size + slop, flip)
    else:
        _swept(
            pair, ints, sa, sb, row, words, marks, doubles_at, integers_at, boolean, limit, size, ERROR * size + slop,
            slop == 0.0, flip,
        )  # fmt: skip


def run_pairs(
    table: ShapeTable,
    poses: np.ndarray,
    shape_of: np.ndarray,
    pairs: np.ndarray,
    *,
    boolean: bool,
    limit: float,
    stop_at_hit: bool = False,
) -> np.ndarray:
    """Rows of `PAIR_DTYPE` for pairs (k, 2) of posed parts; fewer than k where a hit stopped it.

    poses : (parts, POSE).   shape_of : (parts,) int64, rows of ``table``.
    Fields a, b and part_a, part_b are left 0: the caller knows the bodies.
    """
    rows = np.zeros(len(pairs), dtype=PAIR_DTYPE)
    pairs = np.ascontiguousarray(pairs, dtype=np.int64)
    answered = answer_pairs(
        address_of(table.ints), address_of(table.numbers), address_of(poses), address_of(shape_of),
        address_of(pairs), len(pairs), boolean, stop_at_hit, limit, address_of(rows), *workspace_of_thread.addresses,
    )  # fmt: skip
    return rows[:answered]


class _Workspace(local):
    """Scratch memory of one thread, made when the thread first asks."""

    def __init__(self):
        self.doubles = np.zeros(_OWN_DOUBLES + DOUBLES)
        self.integers = np.zeros(_OWN_INTEGERS + INTEGERS + EXACT_INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


workspace_of_thread = _Workspace()
