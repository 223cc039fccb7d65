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
from collide.narrowphase.gjk.grown_simplex import INSIDE, NOT_FOUND, nearest_with_newest, select
from collide.narrowphase.gjk.minkowski_difference import (
    AXIS,
    NEAREST_POINT,
    POINT,
    copy_point,
    difference_point,
    has_trees,
    height,
    inlined_difference_point,
    listed_difference_point,
    place_vertices,
    point_at,
    settle_point,
)
from collide.narrowphase.gjk.simplex import across_simplex, faces_in_sight, nearest_of_all
from collide.narrowphase.posed_pair import reach_of_both
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, max_abs, neg, norm, put_vec3, scale, sub, vec3_at

#: How a run ends. NEAREST: the nearest point is known and clear of rounding. MEETING: nearer than
#: rounding can tell, or no plane separates and no tetrahedron encloses provably. ENCLOSED: the origin lies in a
#: tetrahedron of A ⊖ B, clear of rounding. APART: proven farther apart than the limit.
NEAREST, MEETING, ENCLOSED, APART = range(4)

#: Bodies whose frames are nearer than this share of their reaches probably overlap.
_OVERLAP_RATIO = 0.9
#: Directions ask the same lists of support trees of n vertices that are within an angle whose sine squared is this / n.
_SAME_LISTS = 64.0
#: Of bodies with more than `_MIN_VERTICES_TO_SURROUND`, n of them, the vertex found first is surrounded by others in
#: directions `_SURROUND_TANGENT` / √n from it: far enough on a ball to meet its neighbours. It pays where the first
#: direction is a good one: its plane nearly separates the bodies (`_MAX_PLANE_RATIO`), the point is not much farther off than
#: the plane (`_MAX_HEIGHT_RATIO`), and those directions reach as far aside as the origin lies.
_MIN_VERTICES_TO_SURROUND = 32
_SURROUND_TANGENT = 3.0
_MAX_PLANE_RATIO = 0.5
_MAX_HEIGHT_RATIO = 0.9


class GjkResult(NamedTuple):
    """status : NEAREST, MEETING, ENCLOSED or APART.   n_points : of the simplex, which stands first.

    lower : best lower bound of the cores' distance, before ``error``.   clearance : of the origin in the tetrahedron, where
    ENCLOSED.   iterations : support points asked for.
    """

    status: int
    n_points: int
    lower: float
    clearance: float
    iterations: int


class _Limits(NamedTuple):
    """What `gjk` is asked for: its arguments of these names."""

    boolean: bool
    radius: float
    limit: float
    error: float
    max_iterations: int


@kernel(inline=True)
def gjk(pair, points, ids, weights, n_start, boolean, radius, limit, error, max_iterations):
    """Run GJK on the cores of a pair; returns a `GjkResult`.

    points, ids : workspace for five difference points; the simplex found stands first.
    n_start : 3 if the last three ids name vertices to begin with, else 0.
    weights : 10 doubles. In, at AXIS: a direction from A to B to begin with, or zeros. Out: weights of the simplex, its
        nearest point v, and the unit axis (along v, from the simplex's own edges where v is too short to have a direction).
    boolean : stop as soon as an overlap is proven.
    radius : sum of the swept radii.   limit : stop once proven farther apart than this.
    error : absolute error of a bound, from `bounds.py`.
    """
    limits = _Limits(boolean, radius, limit, error, max_iterations)
    found = _search(pair, points, ids, weights, n_start, limits)
    if found.status == ENCLOSED or found.status == APART:
        return found
    v = vec3_at(weights, NEAREST_POINT)
    length = norm(v)
    lower = found.lower
    overlap_proven = boolean and length + error <= radius
    if length - lower > 0.5 * error and not overlap_proven:
        d = across_simplex(points, found.n_points, v)
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
    return GjkResult(status, found.n_points, lower, found.clearance, found.iterations)


class _FirstDirection(NamedTuple):
    """d : where to look first.   factor : times d is the direction as it came.   between_origins : it is p_WB − p_WA."""

    d: Vec3
    factor: float
    between_origins: bool


@kernel(inline=True)
def _first_direction(pair, weights):
    """The axis to begin with, or else the line between the frames' origins, as a `_FirstDirection`."""
    t = pair.t
    d = vec3_at(weights, AXIS)
    if d.x == 0.0 and d.y == 0.0 and d.z == 0.0:
        d = t
    largest = max_abs(d)
    between = largest > 0.0 and d.x == t.x and d.y == t.y and d.z == t.z
    if largest == 0.0:
        return _FirstDirection(Vec3(1.0, d.y, d.z), largest, False)
    if 2.0**-400 < largest < 2.0**400:
        return _FirstDirection(d, 1.0, between)
    return _FirstDirection(divide(d, largest), largest, between)  # squares would vanish or overflow


@kernel(inline=True)
def _set_separating_axis(weights, d, length, lower):
    """The unit axis against a direction d of this length, and the nearest point, as far as a plane across it tells."""
    axis = scale(-1.0 / length, d)
    put_vec3(weights, AXIS, axis)
    put_vec3(weights, NEAREST_POINT, Vec3(axis.x * lower, axis.y * lower, axis.z * lower))


class _Start(NamedTuple):
    """What the first point tells.

    status : APART, or NEAREST where the search goes on.   lower : bound of the distance.   d, length : first direction.
    coarse : points are asked of the coarse hulls.   began_coarse : so was the first one.
    list_a, list_b : the lists of the support trees in which it was found; −1 for a walk from above.
    """

    status: int
    n_points: int
    lower: float
    d: Vec3
    length: float
    coarse: bool
    began_coarse: bool
    list_a: int
    list_b: int


@kernel(inline=True)
def _begin(pair, points, ids, weights, limits):
    """Point 0, or a plane that already separates the bodies: most pairs that are farther apart than asked about."""
    first = _first_direction(pair, weights)
    d, error, radius, limit = first.d, limits.error, limits.radius, limits.limit
    length = norm(d)
    # Coarse hulls that overlap are a proof, at a tenth of the price.
    coarse = pair.A.coarse_at != 0 or pair.B.coarse_at != 0
    begins_coarse = False
    if first.between_origins:
        # Balls about the origins of the bodies' frames: no support is asked.
        reach = reach_of_both(pair)
        lower = first.factor * length - reach
        if limits.boolean and lower - error - radius > limit:
            _set_separating_axis(weights, d, length, lower)
            return _Start(APART, 0, lower, d, length, coarse, False, -1, -1)
        begins_coarse = coarse and first.factor * length < _OVERLAP_RATIO * reach
    list_a, list_b = inlined_difference_point(pair, points, ids, 0, d, begins_coarse, -1, -1)
    coarse = coarse and (begins_coarse or limits.boolean)
    if begins_coarse and height(points, 0, d) < 0.0:
        coarse = begins_coarse = False
        list_a, list_b = difference_point(pair, points, ids, 0, d)
    lower = -height(points, 0, d) / length
    if begins_coarse:
        lower = -math.inf  # coarse points bound nothing that lies beyond them
    elif has_trees(pair):
        if lower - error - radius > limit:
            settle_point(pair, points, ids, 0, d)
            lower = -height(points, 0, d) / length
        else:
            lower = -math.inf  # not proven
    weights[0] = 1.0
    status = NEAREST
    if lower - error - radius > limit:
        _set_separating_axis(weights, d, length, lower)
        status = APART
    return _Start(status, 1, lower, d, length, coarse, begins_coarse, list_a, list_b)


@kernel(inline=True)
def _search(pair, points, ids, weights, n_start, limits):
    """The iterations of GJK; see `gjk` for arguments and results."""
    boolean, radius, limit = limits.boolean, limits.radius, limits.limit
    error, max_iterations = limits.error, limits.max_iterations
    start = _begin(pair, points, ids, weights, limits)
    lower, coarse, list_a, list_b = start.lower, start.coarse, start.list_a, start.list_b
    if start.status == APART:
        return GjkResult(APART, start.n_points, lower, 0.0, 0)
    trees = has_trees(pair)
    n, coarse = _first_simplex(pair, points, ids, weights, n_start, start)
    # The simplex: points A, B, C in registers, of which n are there, and where they stand in memory.
    # It is loaded so once more, below: through a kernel for both, gaps at n = 512 took 2 to 4 % longer.
    at_a, at_b, at_c, at_d = 0, 1, 2, 3
    A, B, C = point_at(points, 0), point_at(points, 1), point_at(points, 2)
    wa, wb, wc = weights[0], weights[1], weights[2]
    v = vec3_at(weights, NEAREST_POINT)
    square = dot(v, v)
    status = NEAREST
    clearance = 0.0
    # Against u support trees were last walked from above. Within an angle of it only the lists are asked where that ended.
    u = neg(start.d)
    squared_cosine = _of_same_lists(pair)
    used = 0
    while used < max_iterations:
        used += 1
        length = math.sqrt(square)
        if length <= error:
            status = MEETING
            break
        if boolean and length + error <= radius:
            break
        if trees and not coarse:
            along = dot(u, v)
            if along <= 0.0 or along * along < squared_cosine * square * dot(u, u):
                list_a = list_b = -1
                u = v
        partial = coarse or list_a >= 0 or list_b >= 0
        list_a, list_b = inlined_difference_point(pair, points, ids, at_d, neg(v), coarse, list_a, list_b)
        bound = height(points, at_d, v) / length
        repeated = _repeated(ids, n, at_a, at_b, at_c, at_d)
        if partial and _needs_farthest(coarse, length, bound, repeated, limits):
            partial = coarse = False
            u = v
            list_a, list_b = difference_point(pair, points, ids, at_d, neg(v))
            bound = height(points, at_d, v) / length
            repeated = _repeated(ids, n, at_a, at_b, at_c, at_d)
        if trees and (
            bound - error - radius > limit or length - bound <= 0.125 * error or repeated or used == max_iterations
        ):
            settle_point(pair, points, ids, at_d, neg(v))
            bound = height(points, at_d, v) / length
            repeated = _repeated(ids, n, at_a, at_b, at_c, at_d)
            lower = max(lower, bound)
        elif not trees and not coarse:
            lower = max(lower, bound)
        if lower - error - radius > limit:
            status = APART
            break
        if length - bound <= 0.125 * error or repeated:
            break
        D = point_at(points, at_d)
        nearest, closer = nearest_with_newest(n, A, B, C, D, error, 0.125 * error * length)
        if nearest.n_kept == INSIDE:
            status = ENCLOSED
            clearance = nearest.w0
            break
        if nearest.n_kept == NOT_FOUND:
            at_a, at_b, at_c, at_d = _bring_to_front(points, ids, n, at_a, at_b, at_c, at_d)
            faces = 15
            if n == 3:
                faces, clearance = faces_in_sight(points, error)
                if faces == 0:
                    status = ENCLOSED
                    break
            closer = nearest_of_all(points, n + 1, weights, faces)
            if closer < square:
                n = _drop_unused(points, ids, weights, n + 1)
                at_a, at_b, at_c, at_d = 0, 1, 2, 3
                A, B, C = point_at(points, 0), point_at(points, 1), point_at(points, 2)
                wa, wb, wc = weights[0], weights[1], weights[2]
                v = vec3_at(weights, NEAREST_POINT)
        elif closer < square:
            n = nearest.n_kept
            rotation = nearest.rotation
            A, B, C = D, select(rotation, A, B, C), select(rotation, B, C, A)
            at_first, at_second = select(rotation, at_a, at_b, at_c), select(rotation, at_b, at_c, at_a)
            at_a, at_b, at_c, at_d = at_d, at_first, at_second, 6 - at_d - at_first - at_second
            wa, wb, wc = nearest.w0, nearest.w1, nearest.w2
            v = nearest.v
        if not closer < square:
            if partial and used < max_iterations:
                coarse = False
                u = Vec3(0.0, 0.0, 0.0)  # the next is asked of the whole bodies
                continue
            if trees:
                settle_point(pair, points, ids, at_d, neg(v))
                lower = max(lower, height(points, at_d, v) / length)
            break
        square = closer
    if status == ENCLOSED:
        return GjkResult(ENCLOSED, 4, lower, clearance, used)
    if not (boolean and status == APART):  # of a miss nothing else is wanted
        _bring_to_front(points, ids, n, at_a, at_b, at_c, at_d)
    weights[0] = wa
    weights[1] = wb if n > 1 else 0.0
    weights[2] = wc if n > 2 else 0.0
    weights[3] = 0.0
    put_vec3(weights, NEAREST_POINT, v)
    length = norm(v)
    put_vec3(weights, AXIS, scale(1.0 / length if length > 0.0 else 0.0, v))
    return GjkResult(status, n, lower, 0.0, used)


@kernel(inline=True)
def _first_simplex(pair, points, ids, weights, n_start, start):
    """(number of points, whether to go on with coarse points): point 0, the vertices to begin with, or those around point 0."""
    n = 1
    put_vec3(weights, NEAREST_POINT, point_at(points, 0))
    if n_start > 0:
        n = _start_from_vertices(pair, points, ids, weights)
    tangent = _surround_tangent(pair)
    if tangent > 0.0 and not start.began_coarse:
        w = point_at(points, 0)
        plane = -dot(w, start.d) / start.length  # height of the plane through point 0 across d
        square = dot(w, w)
        shift = tangent * reach_of_both(pair)
        if (
            -_MAX_PLANE_RATIO * tangent * shift < plane < _MAX_HEIGHT_RATIO * math.sqrt(square)
            and square - plane * plane < shift * shift
        ):
            direction = divide(start.d, start.length)
            n = _surround(pair, points, ids, weights, direction, plane, tangent, start.list_a, start.list_b)
            return n, False
    return n, start.coarse


@kernel(cold=True)
def _start_from_vertices(pair, points, ids, weights):
    """Begin with the vertices that the last three ids name; returns how many of the points are kept.

    In `_search` it comes after the first point, which is not needed then: a way around that made the iterations of all other
    pairs 5 % slower.
    """
    for k in range(3):
        place_vertices(pair, points, ids, k, ids[2 * k + 4], ids[2 * k + 5])
    nearest_of_all(points, 3, weights, 15)
    return _drop_unused(points, ids, weights, 3)


@kernel(inline=True)
def _surround_tangent(pair):
    """How far to tilt a direction so that vertices around the one found are met; 0 for curved cores and few vertices."""
    n = min(pair.A.n, pair.B.n)
    polytopes = pair.A.kind == POINTS and pair.B.kind == POINTS
    return _SURROUND_TANGENT / math.sqrt(n) if n > _MIN_VERTICES_TO_SURROUND and polytopes else 0.0


@kernel(cold=True)
def _surround(pair, points, ids, weights, d, plane, tangent, list_a, list_b):
    """Add two points on either side of where the origin lies beside point 0; returns how many are kept.

    Between bodies that nearly touch, the direction from a vertex of one to a vertex of the other is hardly more than
    chance, and the next vertices found lie far off; half of all iterations went into coming back. A triangle of vertices
    around the origin's foot has the right direction at once: on balls 5 iterations remain of 11 at n = 512.

    d : the unit direction point 0 was found in.   plane : height of the plane across it.   list_a, list_b : the lists
        of support trees to look in.   weights : the simplex that is kept, and its point nearest the origin.
    """
    u = add(point_at(points, 0), scale(plane, d))
    length = norm(u)
    u = scale(tangent / length if length > 0.0 else 0.0, u)
    sideways = scale(0.75**0.5, cross(d, u))
    d = sub(d, scale(0.5, u))
    listed_difference_point(pair, points, ids, 1, add(d, sideways), list_a, list_b)
    n = 1 if _repeated(ids, 1, 0, 0, 0, 1) else 2
    listed_difference_point(pair, points, ids, n, sub(d, sideways), list_a, list_b)
    if not _repeated(ids, n, 0, 1, 1, n):
        n += 1
    nearest_of_all(points, n, weights, 15)
    return _drop_unused(points, ids, weights, n)


@kernel(inline=True)
def _of_same_lists(pair):
    """The squared cosine of that angle for a pair's support trees; 2, so that there is none, beside a curved core.

    A curved core never repeats a point. Runs would converge towards what lies in one list, and again in the next: some
    came to the last iteration.
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


@kernel(inline=True)
def _repeated(ids, n, at_a, at_b, at_c, at_d):
    """Whether point D is one of the n others (curved cores have no ids and never repeat)."""
    i = ids[2 * at_d]
    j = ids[2 * at_d + 1]
    if i < 0 or j < 0:
        return False
    if ids[2 * at_a] == i and ids[2 * at_a + 1] == j:
        return True
    if n > 1 and ids[2 * at_b] == i and ids[2 * at_b + 1] == j:
        return True
    return n > 2 and ids[2 * at_c] == i and ids[2 * at_c + 1] == j


@kernel(cold=True)
def _bring_to_front(points, ids, n, at_a, at_b, at_c, at_d):
    """Bring the n points A, B, C to the front, and D behind them; returns where all of them stand then."""
    if at_a != 0:
        _exchange_points(points, ids, 0, at_a)
        at_b = at_a if at_b == 0 else at_b
        at_c = at_a if at_c == 0 else at_c
        at_d = at_a if at_d == 0 else at_d
    if n > 1 and at_b != 1:
        _exchange_points(points, ids, 1, at_b)
        at_c = at_b if at_c == 1 else at_c
        at_d = at_b if at_d == 1 else at_d
    if n > 2 and at_c != 2:
        _exchange_points(points, ids, 2, at_c)
        at_d = at_c if at_d == 2 else at_d
    if at_d != n:
        _exchange_points(points, ids, n, at_d)
    return 0, 1 if n > 1 else 2, 2 if n > 2 else 3, n


@kernel(inline=True)
def _exchange_points(points, ids, k, j):
    for i in range(POINT):
        points[POINT * k + i], points[POINT * j + i] = points[POINT * j + i], points[POINT * k + i]
    for i in range(2):
        ids[2 * k + i], ids[2 * j + i] = ids[2 * j + i], ids[2 * k + i]


@kernel(inline=True)
def _drop_unused(points, ids, weights, n):
    """Keep the points with a positive weight; returns their number."""
    n_kept = 0
    for k in range(n):
        if weights[k] > 0.0:
            if n_kept != k:
                copy_point(points, ids, k, n_kept)
                weights[n_kept] = weights[k]
            n_kept += 1
    for k in range(n_kept, 4):
        weights[k] = 0.0
    return n_kept
