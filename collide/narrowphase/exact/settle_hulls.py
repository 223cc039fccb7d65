"""A step of the exact stage: rows of two swept hulls, whose signs or last digits doubles leave open."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.exact.depth_requests import REQUESTS, find_request
from collide.narrowphase.exact.exact_gjk import (
    SEPARATE,
    TOUCHING,
    UNDONE,
    ExactAnswer,
    gap_of_face,
    sign_only,
    touch_exactly,
)
from collide.narrowphase.exact.face_height import face_height
from collide.narrowphase.exact.filtered_gjk import (
    APART,
    MEET,
    OUTERMOST,
    THROUGH_ORIGIN,
    is_filtered,
    search_filtered,
    side_of_facets,
)
from collide.narrowphase.exact.filtered_gjk import DOUBLES as FILTER_DOUBLES
from collide.narrowphase.exact.plane_depth import ExactDepth, depth_of_facet, nearest_plane
from collide.narrowphase.exact.settle_space import bracket_of_depth, bracket_of_gap, settle_space
from collide.narrowphase.exact.witness_points import points_miss, put_common_point, put_normal_and_points, put_points
from collide.narrowphase.gap.precise_pair import is_refinable
from collide.narrowphase.posed_pair import ordered_pair, radius_of
from collide.narrowphase.rows import (
    COUNT,
    DISTANCE,
    EXACT_ROUNDS,
    HIT,
    HOW,
    LOWER,
    ROW,
    UPPER,
    VERTICES_A,
    VERTICES_B,
    view_row,
    write_verdict,
    write_vertices,
)
from collide.numerics.double_double import DD
from collide.numerics.vec3 import divide, norm
from collide.results import EXACT, PLANE, SWEPT, UNDECIDED

#: How `settle_hulls` is called.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, boolean, boolean, float64, int64, int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def settle_hulls(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, boolean, depths, limit, rows_at, terms_at, n_terms,
    requests_at, digits_at,
):
    """Settle the undecided rows of `answer_pairs`, in place; returns how many are left to `settle_halfspaces.py`.

    Arguments as in `settle_exactly`; without depths bodies that meet get a common point.   terms, n_terms : of the
    `PoseTable`.
    requests : written by `answer_pairs`.   digits : workspace of WORKSPACE integers.
    Open stay shapes whose stored numbers are themselves rounded (slop).
    Arguments are flat: entries are called by address, from C too.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    space = settle_space(terms_at, n_terms, digits_at)
    requests = view_i64(requests_at, REQUESTS)
    n_remaining = 0
    for k in range(n_pairs):
        row_at = rows_at + ROW * k
        if view_u8(row_at, ROW)[HOW] != UNDECIDED:
            continue
        ordered = ordered_pair(ints_at, numbers_at, poses_at, shape_of_at, pairs[2 * k], pairs[2 * k + 1])
        if not ordered.exact_numbers:
            continue
        if ordered.pair.A.kind == POINTS and ordered.pair.B.kind == POINTS:
            _settle(ordered, space, requests, k, row_at, boolean, depths, limit)
        else:
            n_remaining += 1
    return n_remaining


@kernel(inline=True)
def _settle(ordered, space, requests, k, row_at, boolean, depths, limit):
    """Settle row k."""
    row = view_row(row_at)
    ids = space.simplex
    radius_a, radius_b = radius_of(ordered.pair, ordered.pair.A), radius_of(ordered.pair, ordered.pair.B)
    n = _take_simplex(ids, row, ordered.flip)
    is_in_reach = n == 3 and is_filtered(ordered)
    is_swept = radius_a != 0.0 or radius_b != 0.0
    answer = _search(ordered, space, boolean, n, radius_a, radius_b, is_in_reach)
    if answer.verdict == UNDONE:
        keep_proven_sign(row)
        return
    touching = answer.verdict == TOUCHING
    distance = row.doubles[DISTANCE]
    lower = row.doubles[LOWER]
    upper = row.doubles[UPPER]
    has_depth = False
    if answer.cores_apart:
        # Cores apart by less than the radii are as exact as a gap.
        bracket = bracket_of_gap(answer.excess)
        distance = bracket.nearest
        lower = max(lower, bracket.lower)
        upper = min(upper, bracket.upper)
    if touching:
        upper = min(upper, 0.0)
    if touching and not answer.cores_apart:
        distance = min(distance, 0.0)
        if not boolean:
            has_depth, depth = _depth(ordered, space, requests, find_request(requests, k), is_in_reach, is_swept)
            if has_depth:
                bracket = bracket_of_depth(depth, radius_a, radius_b)
                distance = bracket.nearest
                lower = max(lower, bracket.lower)
                upper = min(upper, bracket.upper)
    # The digits have done their work; their place serves as workspace of doubles.
    if answer.cores_apart:
        put_normal_and_points(row, ordered, space.terms_at, ids, answer.n, space.digits_at, answer.v, distance)
    write_verdict(row, distance, lower, upper, EXACT, math.inf if boolean else 0.0, limit)
    if has_depth and is_refinable(ordered.size) and points_miss(row, ordered.size, row.doubles[DISTANCE]):
        put_points(row, ordered, space.terms_at, ids, answer.n, space.digits_at, row.doubles[DISTANCE])
    wants_point = touching and not answer.cores_apart and not (boolean or depths)
    if wants_point and points_miss(row, ordered.size, 0.0):
        put_common_point(row, ordered, ids, answer.n, space.digits_at)
    if answer.verdict == SEPARATE:  # also where the gap is smaller than the smallest double
        row.flags[HIT] = 0
        row.flags[HOW] = EXACT
    write_vertices(row, ids, answer.n, ordered.flip)
    row.flags[EXACT_ROUNDS] = min(answer.rounds, 255)


@kernel
def _search(ordered, space, boolean, n, radius_a, radius_b, is_in_reach):
    """The `ExactAnswer` of `touch_exactly`, by double-doubles as far as these prove signs.

    is_in_reach : of the filter.
    """
    ids = space.simplex
    is_swept = radius_a != 0.0 or radius_b != 0.0
    if is_in_reach and (is_swept or not boolean):
        points = view_f64(space.doubles_at, FILTER_DOUBLES)
        search = search_filtered(ordered, ids, points)
        if search.end == MEET:
            return sign_only(TOUCHING, search.n, search.rounds)
        if search.end == APART and search.n == 3 and not is_swept:
            face = face_height(points)
            if face.proven:
                v = divide(face.direction, norm(face.direction))
                return ExactAnswer(SEPARATE, 3, True, face.distance, v, search.rounds)
            return gap_of_face(ordered, space.terms, space.digits, ids, search.rounds)
    return touch_exactly(ordered, space.terms, space.digits, boolean, ids, n, radius_a, radius_b)


@kernel
def _depth(ordered, space, requests, request_at, is_in_reach, is_swept):
    """The `ExactDepth` of `nearest_plane`, by double-doubles as far as these prove sides."""
    if is_in_reach and request_at > 0:
        points = view_f64(space.doubles_at, FILTER_DOUBLES)
        side = side_of_facets(ordered, requests, request_at, points)
        if side == THROUGH_ORIGIN:
            return ExactDepth(True, DD(0.0, 0.0))
        if side == OUTERMOST:
            face = face_height(points)
            if face.proven and not is_swept:  # a sum with the radii is rounded at another place
                return ExactDepth(True, face.distance)
            return depth_of_facet(ordered, space.terms, space.digits, requests, request_at)
    return nearest_plane(ordered, space.terms, space.digits, requests, request_at)


@kernel(inline=True)
def _take_simplex(ids, row, flip):
    """Take the vertex pairs named by a row, in the order of the bodies as worked on; returns their number."""
    ids[0] = 0  # a row decided as a boolean names no vertices (asked again only where tests distrust doubles)
    ids[1] = 0
    for j in range(row.flags[COUNT]):
        ids[2 * j] = row.words[(VERTICES_B if flip else VERTICES_A) + j]
        ids[2 * j + 1] = row.words[(VERTICES_A if flip else VERTICES_B) + j]
    return max(int(row.flags[COUNT]), 1)


@kernel(inline=True)
def keep_proven_sign(row):
    """A row for which integers have no workspace is decided if doubles have proven its sign."""
    if row.doubles[LOWER] > 0.0:
        row.flags[HOW] = PLANE
    elif row.doubles[UPPER] <= 0.0:
        row.flags[HOW] = SWEPT
