"""Two capsules in closed form: the nearest points of two segments."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.core_distance import CoreDistance
from collide.narrowphase.gjk.minkowski_difference import AXIS, NEAREST_POINT, height, place_vertices, point_at
from collide.numerics.vec3 import (
    Vec3,
    add,
    cross,
    divide,
    dot,
    neg,
    norm,
    put_vec3,
    scale,
    sub,
    unit_orthogonal,
    vec3_at,
)

#: Segments are parallel where the sine of their angle is at most 1e-12.
_PARALLEL = 1e-24


@kernel
def segment_cores(pair, work, error):
    """The `CoreDistance` of two cores that are segments."""
    points, weights = work.points, work.weights
    for k in range(4):  # A0 − B0, A1 − B0, A0 − B1, A1 − B1
        place_vertices(pair, points, work.ids, k, k & 1, k >> 1)
    distance, lower = nearest_of_segments(points, weights)
    return core_of_ends(points, weights, distance, lower, error)


@kernel(inline=True)
def core_of_ends(points, weights, distance, lower, error):
    """The `CoreDistance` of two segments, from the four differences of their ends: of cores that meet, across both."""
    if distance > error:
        nhat = neg(vec3_at(weights, AXIS))
        return CoreDistance(-distance, lower, distance, -math.inf, math.inf, nhat, 4, 4, 0)
    nhat = _across_segments(points)
    depth = -math.inf
    for k in range(4):
        depth = max(depth, height(points, k, nhat))
    return CoreDistance(depth, -depth, distance, -math.inf, math.inf, nhat, 4, 4, 0)


@kernel
def _keep_nearer(points, s, t, weights, best):
    """Keep segment parameters s, t if a(s) − b(t) is nearer the origin than the best square so far, which is
    returned."""
    w00 = (1.0 - s) * (1.0 - t)
    w10 = s * (1.0 - t)
    w01 = (1.0 - s) * t
    w11 = s * t
    v = add(scale(w00, point_at(points, 0)), scale(w10, point_at(points, 1)))
    v = add(add(v, scale(w01, point_at(points, 2))), scale(w11, point_at(points, 3)))
    square = dot(v, v)
    if square < best:
        weights[0] = w00
        weights[1] = w10
        weights[2] = w01
        weights[3] = w11
        put_vec3(weights, NEAREST_POINT, v)
        return square
    return best


@kernel
def clamped_share(value, square):
    """value / square within [0, 1]; 0 where the segment is a point."""
    if not value > 0.0:
        return 0.0
    return 1.0 if value >= square else value / square


@kernel
def nearest_of_segments(points, weights):
    """Distance of two segments, from the four differences of their ends.

    points : difference points A0 − B0, A1 − B0, A0 − B1, A1 − B1 (equal points for a segment of length 0).
    weights : 10 doubles out: weights of the four, the nearest point of their parallelogram, and the
        unit axis that separates best.

    Returns (distance, its lower bound from the plane through the nearest point).

    The minimum lies inside both segments or at an end of either: all five candidates are compared, so parallel and
    degenerate segments are no special cases (Ericson 2005, 5.1.9).
    """
    p = point_at(points, 0)
    u = sub(point_at(points, 1), p)
    v = sub(point_at(points, 2), p)
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    pu, pv = -dot(p, u), -dot(p, v)
    best = math.inf
    best = _keep_nearer(points, clamped_share(pu, uu), 0.0, weights, best)
    best = _keep_nearer(points, clamped_share(pu - uv, uu), 1.0, weights, best)
    best = _keep_nearer(points, 0.0, clamped_share(pv, vv), weights, best)
    best = _keep_nearer(points, 1.0, clamped_share(pv - uv, vv), weights, best)
    n = cross(u, v)
    square = dot(n, n)
    if square > 0.0:
        # p + s u + t v is nearest the origin where it is along n: the two triple products.
        s = dot(n, cross(v, p)) / square
        t = dot(n, cross(p, u)) / square
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            best = _keep_nearer(points, s, t, weights, best)
    return math.sqrt(best), _best_bound(points, weights, u, v, n)


@kernel
def _best_bound(points, weights, u, v, n):
    """The greatest lower bound of the distance from planes across the nearest point, n = u × v, and u and v."""
    nearest = vec3_at(weights, NEAREST_POINT)
    lower = raised_bound(points, weights, -math.inf, nearest)
    # The same direction to full precision, where the gap is tiny beside the segments: from the
    # segments themselves (see `simplex.across_simplex`).
    lower = raised_bound(points, weights, lower, neg(n) if dot(n, nearest) < 0.0 else n)
    for k in range(2):
        e = u if k == 0 else v
        square = dot(e, e)
        if square > 0.0:
            lower = raised_bound(points, weights, lower, across(nearest, e))
    return lower


@kernel(inline=True)
def across(v, e):
    """The part of v across e; the second round takes what the first left along e."""
    for _ in range(2):
        v = sub(v, scale(dot(v, e) / dot(e, e), e))
    return v


@kernel
def raised_bound(points, weights, lower, d):
    """The lower bound, raised by the least value of the four differences along d, and its axis with it."""
    length = norm(d)
    if length == 0.0:
        return lower
    least = math.inf
    for k in range(4):
        least = min(least, height(points, k, d))
    if not least / length > lower:
        return lower
    put_vec3(weights, AXIS, divide(d, length))
    return least / length


@kernel
def _across_segments(points):
    """A unit vector orthogonal to both segments: the direction of least penetration where their cores meet."""
    u = sub(point_at(points, 1), point_at(points, 0))
    v = sub(point_at(points, 2), point_at(points, 0))
    n = cross(u, v)
    uu, vv, square = dot(u, u), dot(v, v), dot(n, n)
    if square > _PARALLEL * uu * vv:
        return divide(n, math.sqrt(square))
    if uu == 0.0 and vv == 0.0:
        return Vec3(0.0, 0.0, 1.0)
    return unit_orthogonal(v if uu < vv else u)  # parallel: across the longer one
