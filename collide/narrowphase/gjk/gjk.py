"""GJK: the point of A ⊖ B nearest the origin, with a lower bound from every support plane.

Gilbert, Johnson and Keerthi 1988; the duality-gap stop after van den Bergen 1999. It stops on a
repeated vertex, on a gap below rounding, or when the distance no longer decreases: thin shapes
would otherwise spin to the cap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.gjk.gjk_start import APART, ENCLOSED, MEETING, NEAREST, Limits, begin, first_simplex
from collide.narrowphase.gjk.grown_simplex import INSIDE, NOT_FOUND, nearest_with_newest, select
from collide.narrowphase.gjk.minkowski_difference import (
    AXIS,
    NEAREST_POINT,
    Places,
    bring_to_front,
    difference_point,
    drop_unused,
    has_trees,
    height,
    inlined_difference_point,
    is_repeated,
    point_at,
    settle_point,
)
from collide.narrowphase.gjk.simplex import across_simplex, faces_in_sight, nearest_of_all
from collide.numerics.vec3 import Vec3, divide, dot, neg, norm, put_vec3, scale, vec3_at

#: Directions ask the same lists of support trees of n vertices that are within an angle whose sine squared is this / n.
_SAME_LISTS = 64.0


class GjkResult(NamedTuple):
    """status : NEAREST, MEETING, ENCLOSED or APART.   n_points : of the simplex, which stands first.

    lower : best lower bound of the cores' distance, before ``error``.
    clearance : of the origin in the tetrahedron, where
    ENCLOSED.   iterations : support points asked for.
    """

    status: int
    n_points: int
    lower: float
    clearance: float
    iterations: int


@kernel(inline=True)
def gjk(pair, points, ids, weights, n_start, boolean, axis_from, radius, limit, error, max_iterations):
    """Run GJK on the cores of a pair; returns a `GjkResult`.

    points, ids : workspace for five difference points; the simplex found stands first.
    n_start : 3 if the last three ids name vertices to begin with, else 0.
    weights : 10 doubles. In, at AXIS: a direction from A to B to begin with, or zeros. Out: weights of the simplex, its
        nearest point v, and the unit axis (along v, from the simplex's own edges where v is too short to have a
        direction).
    boolean : stop as soon as an overlap is proven.
    axis_from : the axis is that of the plane that proves ``lower``, where that is more than this part of |v|.
    radius : sum of the swept radii.   limit : stop once proven farther apart than this.
    error : absolute error of a bound, from `bounds.py`.
    """
    limits = Limits(boolean, radius, limit, error, max_iterations)
    start = begin(pair, points, ids, weights, limits)
    if start.status == APART:
        return GjkResult(APART, start.n_points, start.lower, 0.0, 0)
    run = _search(pair, points, ids, weights, n_start, start, axis_from, limits)
    if run.status == ENCLOSED or run.status == APART:
        return run
    v = vec3_at(weights, NEAREST_POINT)
    length = norm(v)
    lower = run.lower
    overlap_proven = boolean and length + error <= radius
    if length - lower > 0.5 * error and not overlap_proven:
        d = across_simplex(points, run.n_points, v)
        along = norm(d)
        if along > 0.0:
            difference_point(pair, points, ids, 4, neg(d))
            if has_trees(pair):
                settle_point(pair, points, ids, 4, neg(d))
            refined = height(points, 4, d) / along
            if refined > lower:
                lower = refined
                put_vec3(weights, AXIS, divide(d, along))
    # Where no plane separates, the run is open whatever made it stop.
    status = NEAREST if lower > error or overlap_proven else MEETING
    return GjkResult(status, run.n_points, lower, run.clearance, run.iterations)


@kernel(inline=True)
def _search(pair, points, ids, weights, n_start, start, axis_from, limits):
    """The iterations of GJK, from what `begin` found; see `gjk` for arguments and results."""
    error, max_iterations, lower = limits.error, limits.max_iterations, start.lower
    axis = scale(-1.0 / start.length, start.d)  # of the plane that proves ``lower``
    n, coarse = first_simplex(pair, points, ids, weights, n_start, start)
    # The simplex: points A, B, C in registers, of which n are there, and where they stand in memory.
    # It is loaded so once more, below: through a kernel for both, gaps at n = 512 took 2 to 4 % longer.
    places = Places(n, 0, 1, 2, 3)
    A, B, C = point_at(points, 0), point_at(points, 1), point_at(points, 2)
    wa, wb, wc = weights[0], weights[1], weights[2]
    v = vec3_at(weights, NEAREST_POINT)
    square = dot(v, v)
    status = NEAREST
    clearance = 0.0
    asked = _Asked(coarse, False, start.list_a, start.list_b, neg(start.d))
    used = 0
    while used < max_iterations:
        used += 1
        length = math.sqrt(square)
        if length <= error or (limits.boolean and length + error <= limits.radius):
            status = MEETING if length <= error else NEAREST
            break
        new = _next_point(pair, points, ids, places, v, square, asked, limits, used == max_iterations)
        asked = new.asked
        if new.proven > lower:
            lower = new.proven
            axis = scale(1.0 / length, v)
        if lower - error - limits.radius > limits.limit:
            status = APART
            break
        if length - new.bound <= 0.125 * error or new.repeated:
            break
        D = point_at(points, places.d)
        nearest, closer = nearest_with_newest(places.n, A, B, C, D, error, 0.125 * error * length)
        if nearest.n_kept == INSIDE:
            status = ENCLOSED
            clearance = nearest.w0
            break
        if nearest.n_kept == NOT_FOUND:
            places = bring_to_front(points, ids, places)
            faces, clearance = faces_in_sight(points, error) if places.n == 3 else (15, 0.0)
            if faces == 0:
                status = ENCLOSED
                break
            closer = nearest_of_all(points, places.n + 1, weights, faces)
            if closer < square:
                places = Places(drop_unused(points, ids, weights, places.n + 1), 0, 1, 2, 3)
                A, B, C = point_at(points, 0), point_at(points, 1), point_at(points, 2)
                wa, wb, wc = weights[0], weights[1], weights[2]
                v = vec3_at(weights, NEAREST_POINT)
        elif closer < square:
            A, B, C = D, select(nearest.rotation, A, B, C), select(nearest.rotation, B, C, A)
            places = _with_newest(places, nearest)
            wa, wb, wc = nearest.w0, nearest.w1, nearest.w2
            v = nearest.v
        if not closer < square:
            if asked.partial and used < max_iterations:
                # The next is asked of the whole bodies.
                asked = _Asked(False, False, asked.list_a, asked.list_b, Vec3(0.0, 0.0, 0.0))
                continue
            if has_trees(pair):
                settle_point(pair, points, ids, places.d, neg(v))
                settled = height(points, places.d, v) / length
                if settled > lower:
                    lower = settled
                    axis = scale(1.0 / length, v)
            break
        square = closer
    if status == ENCLOSED:
        return GjkResult(ENCLOSED, 4, lower, clearance, used)
    if not (limits.boolean and status == APART):  # of a miss nothing else is wanted
        bring_to_front(points, ids, places)
    _put_nearest(weights, places.n, wa, wb, wc, v)
    if -math.inf < lower and lower > axis_from * norm(v):
        put_vec3(weights, AXIS, axis)
    return GjkResult(status, places.n, lower, 0.0, used)


@kernel(inline=True)
def _with_newest(places, nearest):
    """Where the points stand once D has become point A of the face that is kept."""
    b = select(nearest.rotation, places.a, places.b, places.c)
    c = select(nearest.rotation, places.b, places.c, places.a)
    return Places(nearest.n_kept, places.d, b, c, 6 - places.d - b - c)


@kernel(inline=True)
def _put_nearest(weights, n, wa, wb, wc, v):
    """Weights of a simplex of n points, its nearest point and the unit axis along that."""
    weights[0] = wa
    weights[1] = wb if n > 1 else 0.0
    weights[2] = wc if n > 2 else 0.0
    weights[3] = 0.0
    put_vec3(weights, NEAREST_POINT, v)
    length = norm(v)
    put_vec3(weights, AXIS, scale(1.0 / length if length > 0.0 else 0.0, v))


class _Asked(NamedTuple):
    """How support points are searched.

    coarse : on the coarse hulls.   partial : the last search was on coarse hulls or single lists: perhaps not the
    farthest.
    list_a, list_b : the lists of the support trees with the last vertices; −1 for a walk from above.
    u : direction against which the trees were last walked from above. Within an angle of u only the lists are searched.
    """

    coarse: bool
    partial: bool
    list_a: int
    list_b: int
    u: Vec3


class _NextPoint(NamedTuple):
    """bound : value of the plane through point D across v.   proven : the same where proven, else −∞.

    repeated : whether D equals another point.
    """

    asked: _Asked
    bound: float
    proven: float
    repeated: bool


@kernel(inline=True)
def _next_point(pair, points, ids, places, v, square, asked, limits, is_last):
    """Point D becomes the farthest one against v; coarse hulls and single lists are asked first, if they may do.

    square : |v|².   is_last : no iteration follows.
    """
    coarse, list_a, list_b, u = asked.coarse, asked.list_a, asked.list_b, asked.u
    error, limit = limits.error, limits.limit
    trees = has_trees(pair)
    length = math.sqrt(square)
    if trees and not coarse:
        along = dot(u, v)
        if along <= 0.0 or along * along < _same_lists_cosine(pair) * square * dot(u, u):
            list_a = list_b = -1
            u = v
    partial = coarse or list_a >= 0 or list_b >= 0
    list_a, list_b = inlined_difference_point(pair, points, ids, places.d, neg(v), coarse, list_a, list_b)
    bound = height(points, places.d, v) / length
    repeated = is_repeated(ids, places)
    if partial and _needs_farthest(coarse, length, bound, repeated, limits):
        partial = coarse = False
        u = v
        list_a, list_b = difference_point(pair, points, ids, places.d, neg(v))
        bound = height(points, places.d, v) / length
        repeated = is_repeated(ids, places)
    proven = -math.inf
    if trees and (bound - error - limits.radius > limit or length - bound <= 0.125 * error or repeated or is_last):
        settle_point(pair, points, ids, places.d, neg(v))
        bound = height(points, places.d, v) / length
        repeated = is_repeated(ids, places)
        proven = bound
    elif not trees and not coarse:
        proven = bound
    return _NextPoint(_Asked(coarse, partial, list_a, list_b, u), bound, proven, repeated)


@kernel(inline=True)
def _same_lists_cosine(pair):
    """The squared cosine of the angle within which lists are searched again; beside a curved core 2, out of reach of
    any angle.

    A curved core never repeats a point. GJK would converge to the best point of a list, then of the next list, and some
    runs used up their iterations.
    """
    if pair.A.kind != POINTS or pair.B.kind != POINTS:
        return 2.0
    n = max(pair.A.n if pair.A.tree != 0 else 64, pair.B.n if pair.B.tree != 0 else 64)
    return 1.0 - _SAME_LISTS / n


@kernel(inline=True)
def _needs_farthest(coarse, length, bound, repeated, limits):
    """Whether a point of coarse hulls, or of lists alone, makes no progress: the farthest of all is to be asked for."""
    if repeated:
        return True
    if coarse:
        return bound > 0.0
    return bound - limits.error - limits.radius > limits.limit or length - bound <= 0.125 * limits.error


