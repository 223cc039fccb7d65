"""Rows whose sign doubles leave open, settled by the exact stage.

An entry point of its own, compiled when a scene first has such a pair: most scenes have none.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, LOWEST, TERM_ROW
from collide.narrowphase.bounds import ERROR, EXACT_ERROR, SMALLEST_NORMAL, SUBNORMAL
from collide.narrowphase.epa.origin_foot import weigh_corners
from collide.narrowphase.exact.all_planes import ROOM
from collide.narrowphase.exact.depth_requests import REQUESTS, find_request
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, UNDONE, touch_exactly
from collide.narrowphase.exact.exact_halfspace import INTEGERS as PLANE_DIGITS
from collide.narrowphase.exact.exact_workspace import INTEGERS as HULL_DIGITS
from collide.narrowphase.exact.plane_depth import nearest_plane
from collide.narrowphase.gap.precise_pair import (
    FINE,
    LARGEST_FINE,
    SMALLEST_FINE,
    fine_points,
    scale_of,
    write_low_parts,
)
from collide.narrowphase.gjk.minkowski_difference import POINT, combined, place_vertices
from collide.narrowphase.gjk.simplex import weigh_enclosed
from collide.narrowphase.posed_pair import ordered_pair, radius_of, reach_of
from collide.narrowphase.rows import (
    COUNT,
    DISTANCE,
    EXACT_ROUNDS,
    HIT,
    HOW,
    LOWER,
    NORMAL,
    POINT_A,
    POINT_B,
    ROW,
    UPPER,
    VERTICES_A,
    VERTICES_B,
    write_verdict,
    write_vertices,
)
from collide.numerics.double_double import add, bracket
from collide.numerics.error_free import two_sum
from collide.numerics.vec3 import column_at
from collide.results import EXACT, PLANE, SWEPT, UNDECIDED

#: Digits of workspace; 24 integers for ids follow them, and doubles for planes.
DIGITS = max(HULL_DIGITS, PLANE_DIGITS)
WORKSPACE = DIGITS + 24 + ROOM
#: Witness points may be off by this much of the pair's size, or of their largest coordinate.
_NEAR_MISS = 2.0**-48


@kernel
def set_normal(row, pair, terms_at, ids, n, room_at, radius_a, radius_b, size, vx, vy, vz, distance, flip):
    """The normal from the exact direction, and the witness points on the feature that decided.

    Those found in doubles carry the direction of a difference of nearly equal points, which says nothing where the gap
    is below rounding, and need not lie on that feature.
    """
    sign = 1.0 if flip else -1.0
    row[NORMAL] = sign * vx + 0.0
    row[NORMAL + 1] = sign * vy + 0.0
    row[NORMAL + 2] = sign * vz + 0.0
    if SMALLEST_FINE < size < LARGEST_FINE:
        _set_points(row, pair, terms_at, ids, n, room_at, radius_a, radius_b, size, distance, flip)
        return
    for axis in range(3):
        v = row[NORMAL + axis]
        first = 0.5 * (row[POINT_A + axis] + row[POINT_B + axis]) - 0.5 * distance * v
        row[POINT_A + axis] = first
        row[POINT_B + axis] = first + distance * v


@kernel
def _set_points(row, pair, terms_at, ids, n, room_at, radius_a, radius_b, size, distance, flip):
    """The witness points where n ≤ 4 points of A ⊖ B come nearest to what the row's distance and normal say."""
    fine = view_f64(room_at, 4 * FINE)
    corners = view_f64(room_at + 8 * 4 * FINE, 4 * FINE)
    weights = view_f64(room_at + 8 * 8 * FINE, 4)
    low_at = room_at + 8 * (8 * FINE + 4)
    low = view_f64(low_at, write_low_parts(pair, terms_at, low_at))
    scale = scale_of(size)
    fine_points(pair, low, fine, ids, n, scale)
    for k in range(n):
        for axis in range(3):
            corners[FINE * k + axis] = fine[FINE * k + 2 * axis]
    own = -1.0 if flip else 1.0  # the normal is that of the pair as asked; the bodies here may be exchanged
    shift = -own * (distance + (radius_a + radius_b)) * scale
    weigh_corners(
        corners, FINE, n, weights, shift * row[NORMAL], shift * row[NORMAL + 1], shift * row[NORMAL + 2]
    )
    A, B, poses = pair.A, pair.B, pair.poses
    for axis in range(3):
        a = 0.0
        b = 0.0
        p = A.pose_at + 3 * axis
        q = B.pose_at + 3 * axis
        for k in range(n):
            u = column_at(A.coords, A.padded, ids[2 * k])
            v = column_at(B.coords, B.padded, ids[2 * k + 1])
            a += weights[k] * (poses[p] * u.x + poses[p + 1] * u.y + poses[p + 2] * u.z)
            b += weights[k] * (poses[q] * v.x + poses[q + 1] * v.y + poses[q + 2] * v.z)
        along = own * row[NORMAL + axis]
        a += poses[A.pose_at + 9 + axis] + radius_a * along
        b += poses[B.pose_at + 9 + axis] - radius_b * along
        row[POINT_A + axis] = b if flip else a
        row[POINT_B + axis] = a if flip else b


@kernel
def _set_common_point(row, pair, ids, n, room_at, flip):
    """The point of both bodies at which n ≤ 4 points of A ⊖ B, among which the origin lies, are weighed to 0.

    Those found in doubles belong to a simplex that proved nothing. Of bodies with radii it is a point of both cores.
    """
    points = view_f64(room_at, 4 * POINT)
    weights = view_f64(room_at + 8 * 4 * POINT, 4)
    for k in range(n):
        place_vertices(pair, points, ids, k, ids[2 * k], ids[2 * k + 1])
    miss, extent = weigh_enclosed(points, weights) if n == 4 else (math.inf, 0.0)
    if not miss <= _NEAR_MISS * extent:
        weigh_corners(points, POINT, n, weights, 0.0, 0.0, 0.0)
    poses = pair.poses
    for axis in range(3):
        a = combined(points, weights, n, 3 + axis) + poses[pair.A.pose_at + 9 + axis]
        b = combined(points, weights, n, 6 + axis) + poses[pair.B.pose_at + 9 + axis]
        row[POINT_A + axis] = b if flip else a
        row[POINT_B + axis] = a if flip else b


@kernel
def _points_miss(row, size, distance):
    """Whether the witness points are not what this distance and the normal say, by more than rounding."""
    miss = 0.0
    reach = size
    for axis in range(3):
        miss += abs(row[POINT_B + axis] - row[POINT_A + axis] - distance * row[NORMAL + axis])
        reach = max(reach, abs(row[POINT_A + axis]), abs(row[POINT_B + axis]))
    return miss > _NEAR_MISS * reach


@entry("int64(int64, int64, int64, int64, int64, int64, boolean, boolean, float64, int64, int64, int64, int64, int64)")
def decide_pairs(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, depths, limit, rows_at, terms_at, n_terms,
    requests_at, digits_at,
):  # fmt: skip
    """Settle the undecided rows of `answer_pairs`, in place; returns how many it leaves to `settle_halfspaces.py`.

    Arguments as there; without depths bodies that meet get a point of both; terms, n_terms : of the `PoseTable`; requests : what `answer_pairs` left; digits : int64
    workspace of WORKSPACE. What stays open: curved cores, and shapes whose stored numbers are themselves rounded (slop).
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    terms = view_f64(terms_at, TERM_ROW * n_terms)
    digits = view_i64(digits_at, DIGITS)
    ids = view_i64(digits_at + 8 * DIGITS, 16)
    requests = view_i64(requests_at, REQUESTS)
    asked_at = 1
    left = 0
    for k in range(n_pairs):
        row = view_f64(rows_at + ROW * k, 12)
        words = view_i32(rows_at + ROW * k, ROW // 4)
        marks = view_u8(rows_at + ROW * k, ROW)
        if marks[HOW] != UNDECIDED:
            continue
        pair, ints, flip, size, slop, known = ordered_pair(
            ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1]
        )
        if not known or pair.B.kind != POINTS:
            continue
        if pair.A.kind != POINTS:
            left += 1 if pair.A.kind == HALFSPACE else 0
            continue
        error = ERROR * size + slop
        count = max(int(marks[COUNT]), 1)
        ids[0] = 0  # a row decided as a boolean names no vertices (asked again only where tests distrust doubles)
        ids[1] = 0
        for j in range(marks[COUNT]):
            ids[2 * j] = words[(VERTICES_B if flip else VERTICES_A) + j]
            ids[2 * j + 1] = words[(VERTICES_A if flip else VERTICES_B) + j]
        low_a, low_b = ints[INTS * pair.A.shape + LOWEST], ints[INTS * pair.B.shape + LOWEST]
        reach_a, reach_b = reach_of(pair, pair.A), reach_of(pair, pair.B)
        radius_a, radius_b = radius_of(pair, pair.A), radius_of(pair, pair.B)
        verdict, shown, apart, excess, excess_low, vx, vy, vz, rounds = touch_exactly(
            pair, terms, digits, boolean, ids, count, low_a, low_b, reach_a, reach_b,
            radius_a, radius_b, size, error,
        )  # fmt: skip
        distance = row[DISTANCE]
        lower = row[LOWER]
        upper = row[UPPER]
        proven = False
        # Relative errors do not hold among subnormal doubles; 0 is exact.
        slack = SUBNORMAL if 0.0 < abs(excess) < SMALLEST_NORMAL else 0.0
        if verdict == UNDONE:
            if lower > 0.0 or upper <= 0.0:
                marks[HOW] = PLANE if lower > 0.0 else SWEPT
            continue
        if apart:
            # Cores apart by less than the radii are as exact as a gap.
            low, distance, high = bracket(excess, excess_low, EXACT_ERROR * abs(excess) + slack)
            lower = max(lower, low)
            upper = min(upper, high)
            if verdict == TOUCHING:
                upper = min(upper, 0.0)
        elif verdict == TOUCHING:
            distance = min(distance, 0.0)
            upper = min(upper, 0.0)
            entry_at, asked = find_request(requests, asked_at, k)
            asked_at = entry_at - 1
            if not boolean:
                proven, depth, depth_low = nearest_plane(
                    pair, terms, digits, requests, entry_at if asked else 0, low_a, low_b, reach_a, reach_b,
                    size, error,
                )  # fmt: skip
                if proven:
                    slack = SUBNORMAL if 0.0 < depth < SMALLEST_NORMAL else 0.0
                    swept, swept_low = two_sum(radius_a, radius_b)
                    total, total_low = add(depth, depth_low, swept, swept_low)
                    low, distance, high = bracket(-total, -total_low, EXACT_ERROR * total + slack)
                    lower = max(lower, low)
                    upper = min(upper, high)
        if apart:
            # The digits have done their work; their place is as good as any for doubles.
            set_normal(
                row, pair, terms_at, ids, shown, digits_at, radius_a, radius_b, size, vx, vy, vz,
                distance, flip,
            )  # fmt: skip
        width = math.inf if boolean else 0.0
        write_verdict(row, marks, distance, lower, upper, EXACT, width, limit)
        if proven and not apart and SMALLEST_FINE < size < LARGEST_FINE and _points_miss(row, size, row[DISTANCE]):
            _set_points(
                row, pair, terms_at, ids, shown, digits_at, radius_a, radius_b, size, row[DISTANCE],
                flip,
            )  # fmt: skip
        if not (boolean or depths) and verdict == TOUCHING and not apart and _points_miss(row, size, 0.0):
            _set_common_point(row, pair, ids, shown, digits_at, flip)
        if verdict == SEPARATE:  # also where the gap is smaller than the smallest double
            marks[HIT] = 0
            marks[HOW] = EXACT
        write_vertices(words, marks, ids, shown, flip)
        marks[EXACT_ROUNDS] = min(rounds, 255)
    return left
