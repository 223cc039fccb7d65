"""Normals and witness points of rows settled by the exact stage, on the deciding feature.

Witness points from doubles carry the direction of a difference of nearly equal points, meaningless where the gap is
below rounding, and need not lie on the deciding feature.

Everywhere: row : `Row`.   ordered : the `OrderedPair`.   ids : vertex pairs of n ≤ 4 points of A ⊖ B.
doubles_at, terms_at : of workspace, and of the `PoseTable`.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64
from collide.narrowphase.epa.origin_foot import weigh_corners
from collide.narrowphase.gap.precise_pair import fine_points, is_refinable, put_low_parts, unit_scale
from collide.narrowphase.gjk.minkowski_difference import POINT, POINT_OF_A, POINT_OF_B, place_vertices, weighted_sum
from collide.narrowphase.gjk.simplex import weigh_enclosed
from collide.narrowphase.posed_pair import radius_of
from collide.narrowphase.rows import NORMAL, POINT_A, POINT_B
from collide.numerics import double_double as dd
from collide.numerics.double_double import STRIDE
from collide.numerics.vec3 import Vec3, add, column_at, max_abs, norm1, put_vec3, rotate, scale, sub, vec3_at

#: Witness points may be off by this much of the pair's size, or of their largest coordinate.
_NEAR_MISS = 2.0**-48


@kernel
def put_normal_and_points(row, ordered, terms_at, ids, n, doubles_at, v, distance):
    """The normal from the exact direction, and the witness points.   v : unit vector from B to A."""
    doubles = row.doubles
    put_vec3(doubles, NORMAL, add(scale(1.0 if ordered.flip else -1.0, v), Vec3(0.0, 0.0, 0.0)))  # never −0.0
    if is_refinable(ordered.size):
        put_points(row, ordered, terms_at, ids, n, doubles_at, distance)
        return
    nhat = vec3_at(doubles, NORMAL)
    middle = scale(0.5, add(vec3_at(doubles, POINT_A), vec3_at(doubles, POINT_B)))
    p_a = sub(middle, scale(0.5 * distance, nhat))
    put_vec3(doubles, POINT_A, p_a)
    put_vec3(doubles, POINT_B, add(p_a, scale(distance, nhat)))


@kernel
def put_points(row, ordered, terms_at, ids, n, doubles_at, distance):
    """The witness points where the points of A ⊖ B come nearest to ``distance`` along the row's normal."""
    pair = ordered.pair
    fine = view_f64(doubles_at, 4 * STRIDE)
    corners = view_f64(doubles_at + 8 * 4 * STRIDE, 4 * STRIDE)
    weights = view_f64(doubles_at + 8 * 8 * STRIDE, 4)
    low_at = doubles_at + 8 * (8 * STRIDE + 4)
    low = view_f64(low_at, put_low_parts(pair, terms_at, low_at))
    unit = unit_scale(ordered.size)
    fine_points(pair, low, fine, ids, n, unit)
    for k in range(n):
        put_vec3(corners, STRIDE * k, dd.leading(dd.vec3_at(fine, STRIDE * k)))
    radius_a, radius_b = radius_of(pair, pair.A), radius_of(pair, pair.B)
    # The normal is that of the pair as asked; the bodies here may be exchanged.
    sign = -1.0 if ordered.flip else 1.0
    foot = scale(-sign * (distance + (radius_a + radius_b)) * unit, vec3_at(row.doubles, NORMAL))
    weigh_corners(corners, STRIDE, n, weights, foot)
    A, B, poses = pair.A, pair.B, pair.poses
    a = Vec3(0.0, 0.0, 0.0)
    b = Vec3(0.0, 0.0, 0.0)
    for k in range(n):
        a = add(a, scale(weights[k], rotate(poses, A.pose_at, column_at(A.coords, A.padded, ids[2 * k]))))
        b = add(b, scale(weights[k], rotate(poses, B.pose_at, column_at(B.coords, B.padded, ids[2 * k + 1]))))
    nhat = scale(sign, vec3_at(row.doubles, NORMAL))
    a = add(a, add(vec3_at(poses, A.pose_at + 9), scale(radius_a, nhat)))
    b = add(b, sub(vec3_at(poses, B.pose_at + 9), scale(radius_b, nhat)))
    _put_flipped(row, a, b, ordered.flip)


@kernel
def put_common_point(row, ordered, ids, n, doubles_at):
    """The common point of both bodies, by the weights with which the points of A ⊖ B around the origin sum to 0.

    Of bodies with radii, a common point of both cores.
    """
    pair = ordered.pair
    points = view_f64(doubles_at, 4 * POINT)
    weights = view_f64(doubles_at + 8 * 4 * POINT, 4)
    for k in range(n):
        place_vertices(pair, points, ids, k, ids[2 * k], ids[2 * k + 1])
    miss, extent = weigh_enclosed(points, weights) if n == 4 else (math.inf, 0.0)
    if not miss <= _NEAR_MISS * extent:
        weigh_corners(points, POINT, n, weights, Vec3(0.0, 0.0, 0.0))
    a = add(weighted_sum(points, weights, n, POINT_OF_A), vec3_at(pair.poses, pair.A.pose_at + 9))
    b = add(weighted_sum(points, weights, n, POINT_OF_B), vec3_at(pair.poses, pair.B.pose_at + 9))
    _put_flipped(row, a, b, ordered.flip)


@kernel(inline=True)
def _put_flipped(row, a, b, flip):
    put_vec3(row.doubles, POINT_B if flip else POINT_A, a)
    put_vec3(row.doubles, POINT_A if flip else POINT_B, b)


@kernel
def points_miss(row, size, distance):
    """Whether the witness points are not what this distance and the normal say, by more than rounding."""
    p_a = vec3_at(row.doubles, POINT_A)
    p_b = vec3_at(row.doubles, POINT_B)
    miss = norm1(sub(sub(p_b, p_a), scale(distance, vec3_at(row.doubles, NORMAL))))
    return miss > _NEAR_MISS * max(size, max_abs(p_a), max_abs(p_b))
