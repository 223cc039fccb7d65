"""How GJK begins: a plane that separates the bodies at once, or a first simplex."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.gjk.minkowski_difference import (
    AXIS,
    NEAREST_POINT,
    Places,
    difference_point,
    drop_unused,
    has_trees,
    height,
    inlined_difference_point,
    is_repeated,
    listed_difference_point,
    place_vertices,
    point_at,
    settle_point,
)
from collide.narrowphase.gjk.simplex import nearest_of_all
from collide.narrowphase.posed_pair import reach_of_both
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, max_abs, norm, put_vec3, scale, sub, vec3_at

#: How a run ends. NEAREST: the nearest point is known and clear of rounding. MEETING: nearer than
#: rounding can tell, or no plane separates and no tetrahedron encloses provably. ENCLOSED: the origin lies in a
#: tetrahedron of A ⊖ B, clear of rounding. APART: proven farther apart than the limit.
NEAREST, MEETING, ENCLOSED, APART = range(4)

#: Bodies whose frames are nearer than this share of their reaches probably overlap.
_OVERLAP_RATIO = 0.9
#: Of bodies with more than `_MIN_VERTICES_TO_SURROUND`, n of them, the vertex found first is surrounded by others in
#: directions `_SURROUND_TANGENT` / √n from it: far enough on a ball to meet its neighbours. It pays where the first
#: direction is a good one: its plane nearly separates the bodies (`_MAX_PLANE_RATIO`), the point is not much farther
#: off than the plane (`_MAX_HEIGHT_RATIO`), and those directions reach as far aside as the origin lies.
_MIN_VERTICES_TO_SURROUND = 32
_SURROUND_TANGENT = 3.0
_MAX_PLANE_RATIO = 0.5
_MAX_HEIGHT_RATIO = 0.9


class Limits(NamedTuple):
    """What `gjk.gjk` is asked for: its arguments of these names."""

    boolean: bool
    radius: float
    limit: float
    error: float
    max_iterations: int


class _FirstDirection(NamedTuple):
    """d : where to look first.   factor : times d is the direction given.   between_origins : d is p_WB − p_WA."""

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


class Start(NamedTuple):
    """Outcome of the first point.

    status : APART, or NEAREST where the search goes on.   lower : bound of the distance.   d, length : first direction.
    coarse : points are searched on the coarse hulls.   began_coarse : point 0, too, was.
    list_a, list_b : the lists of the support trees with the vertices of point 0; −1 for a walk from above.
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
def begin(pair, points, ids, weights, limits):
    """Point 0, or a separating plane already: enough for most pairs farther apart than the limit."""
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
            return Start(APART, 0, lower, d, length, coarse, False, -1, -1)
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
    return Start(status, 1, lower, d, length, coarse, begins_coarse, list_a, list_b)


@kernel(inline=True)
def first_simplex(pair, points, ids, weights, n_start, start):
    """(number of points, whether to go on with coarse points): point 0, the vertices to begin with, or those around
    point 0."""
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
    """Begin with the vertices named by the last three ids; returns the number of points kept.

    In GJK this comes after the first point, not needed then: a branch around the first point made the iterations of all
    other pairs 5 % slower.
    """
    for k in range(3):
        place_vertices(pair, points, ids, k, ids[2 * k + 4], ids[2 * k + 5])
    nearest_of_all(points, 3, weights, 15)
    return drop_unused(points, ids, weights, 3)


@kernel(inline=True)
def _surround_tangent(pair):
    """Tangent of the tilt at which a direction meets vertices around the last vertex; 0 for curved cores and few
    vertices."""
    n = min(pair.A.n, pair.B.n)
    polytopes = pair.A.kind == POINTS and pair.B.kind == POINTS
    return _SURROUND_TANGENT / math.sqrt(n) if n > _MIN_VERTICES_TO_SURROUND and polytopes else 0.0


@kernel(cold=True)
def _surround(pair, points, ids, weights, d, plane, tangent, list_a, list_b):
    """Add two points on either side of the origin's foot beside point 0; returns the number of points kept.

    Between bodies that nearly touch, the direction from a vertex of one body to a vertex of the other is hardly more
    than chance, and the next vertices found lie far off; half of all iterations went into coming back. A triangle of
    vertices around the origin's foot has the right direction at once: on balls 5 iterations remain of 11 at n = 512.

    d : the unit direction of point 0's support.   plane : height of the plane across d.   list_a, list_b : the lists
        of support trees to search.   weights : the simplex kept, and its point nearest the origin.
    """
    u = add(point_at(points, 0), scale(plane, d))
    length = norm(u)
    u = scale(tangent / length if length > 0.0 else 0.0, u)
    sideways = scale(0.75**0.5, cross(d, u))
    d = sub(d, scale(0.5, u))
    listed_difference_point(pair, points, ids, 1, add(d, sideways), list_a, list_b)
    n = 1 if is_repeated(ids, Places(1, 0, 0, 0, 1)) else 2
    listed_difference_point(pair, points, ids, n, sub(d, sideways), list_a, list_b)
    if not is_repeated(ids, Places(n, 0, 1, 1, n)):
        n += 1
    nearest_of_all(points, n, weights, 15)
    return drop_unused(points, ids, weights, n)
