"""Along a direction: how far a union of convex parts has to be moved until no part of it meets a part of the other.

B moved by τ·n meets A only where τ·n lies in A ⊖ B of a pair of parts. A plane across m at the height
h(m) = max m·w + r, with w in A ⊖ B and r the sum of both radii, has no point of the swept set above, and proves the
pair apart wherever τ·(m·n) > h(m) + error. So a pair bars the way from some length on, up to a length bounded from
above by planes; the union is clear at the first length barred by no pair. Planes come from GJK, seen from the point
τ·n, which comes down along the line as planes are found (van den Bergen, "Ray casting against general convex objects
with application to continuous collision detection", 2004). However the search goes, the bounds of planes hold. A
half-space has a single plane, and bars the way without end unless the plane faces the direction.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, NUMBERS, POSE, POSE_SLOP, POSE_STRETCH, RADIUS, REACH, SLOP
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk.minkowski_difference import NEAREST_POINT, POINT, POINT_OF_A, copy_coordinates
from collide.narrowphase.gjk.simplex import across_simplex, nearest_of_all
from collide.narrowphase.halfspace_convex import plane_gap
from collide.narrowphase.posed_pair import (
    OrderedPair,
    in_order,
    posed_pair,
    radius_of,
    reach_of_both,
    size_and_slop,
)
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    dot,
    neg,
    norm,
    put_vec3,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)
from collide.support.support_mapping import settled_vertex, support

#: Doubles of workspace: four points of A ⊖ B; their weights and the nearest point.
_POINTS, _WEIGHTS = 4 * POINT, 7
CLEARING = _POINTS + _WEIGHTS

_ROUNDS = 48
#: Planes less steep than this along the direction bound nothing.
_LEAST_SLOPE = 2.0**-20
#: A search for a plane ends at a point this much farther away than the plane at most, or with the plane as far as this
#: part of the way there.
_NEAR_ENOUGH, _FAR = 1.0 + 2.0**-20, 2.0**-3
#: Points nearer to a surface than this part of the way there are seen from farther along.
_STEP = 2.0**-16
#: Points of less weight are rounding: with them the direction is across a face beside an edge that is nearest.
_LEAST_WEIGHT = 2.0**-40
#: The balls about the parts' frames are worked out in doubles.
_UP = 1 + 2.0**-40


class Length(NamedTuple):
    """A length along a direction [m]: as computed, and with its error, proven."""

    value: float
    proven: float


class Plane(NamedTuple):
    """A plane with all of A ⊖ B behind the plane, where m·y ≤ height; m is a unit vector but for rounding, the height
    [m] has no error in it, and is −∞ where no plane was met."""

    m: Vec3
    height: float


class _Simplex(NamedTuple):
    """Views of points as of `minkowski_difference`, where POINT is as seen from τ·e and POINT_OF_A as seen from 0, and
    of their weights with the nearest point."""

    points: Any
    weights: Any


class _Line(NamedTuple):
    """The line {τ·e} beside A ⊖ B of a pair of parts swept by a radius.   error : of a plane.   curved : a core is.

    has_plane : the pair's A is a half-space with this normal, which the other leaves once height < τ · slope; slope −∞
        of two of them.
    """

    e: Vec3
    radius: float
    error: float
    curved: bool
    has_plane: bool
    height: float
    slope: float
    nhat: Vec3


@kernel
def clearing_length(parts, first_a, n_a, first_b, n_b, n, start, limit, work_at):
    """The `Length` along the unit vector n that clears B of A, both numbers infinite if not less than the limit.

    parts : `PosedParts`.   first, n : the first part and the number of parts of each body.   start : a `Length` up to
    which the way is barred, by `barred_length`.   work : CLEARING doubles of workspace.

    A step goes to the greatest of the proven bounds of the pairs still barring the way: all lengths between are barred
    too, so the order of pairs has no say. O(parts of A · parts of B) comparisons of balls a step.
    """
    length = start
    simplex = _simplex_at(work_at)
    for k in range(max(n_a, n_b)):  # poses' stretches become known
        pa, pb = first_a + min(k, n_a - 1), first_b + min(k, n_b - 1)
        size_and_slop(parts.numbers, parts.poses, parts.shape_of[pa], pa, parts.shape_of[pb], pb)
    for _ in range(n_a * n_b + 1):
        farthest = length
        for pa in range(first_a, first_a + n_a):
            held = held_in(parts, pa)
            for pb in range(first_b, first_b + n_b):
                if _are_balls_apart(parts, pa, pb, n, length.proven, held):
                    continue
                pair, line = _pair_and_line(parts, pa, pb, n)
                if not _apart_at(pair, line, length.proven, simplex):
                    farthest = longer(farthest, _bounded_by_planes(pair, line, simplex))
                if not farthest.proven < limit:
                    return Length(math.inf, math.inf)
        if farthest.proven == length.proven:
            return length
        length = farthest
    return Length(math.inf, math.inf)


@kernel
def barred_length(parts, pa, pb, n, work_at):
    """The `Length` along n from which on two meeting parts are proven apart."""
    pair, line = _pair_and_line(parts, pa, pb, n)
    return _bounded_by_planes(pair, line, _simplex_at(work_at))


@kernel
def plane_beside(parts, pa, pb, n, tau, work_at):
    """A `Plane` between τ·n and A ⊖ B of two parts, across the way to τ·n from the nearest point of a near A ⊖ B.

    A point on the surface has no way from the surface: the plane is the plane of a point a little farther along n.
    """
    pair, line = _pair_and_line(parts, pa, pb, n)
    simplex = _simplex_at(work_at)
    plane, margin = _plane_beside(pair, line, tau, simplex)
    if not margin > _STEP * tau:
        beyond, margin_beyond = _plane_beside(pair, line, tau * (1.0 + 2.0 * _STEP), simplex)
        if margin_beyond > 0.0:
            plane = beyond
    return Plane(neg(plane.m) if dot(line.e, n) < 0.0 else plane.m, plane.height)


@kernel
def _plane_beside(pair, line, tau, simplex):
    """(the `Plane` as the pair stands, how far τ·e lies beyond the plane [m])."""
    x = scale(tau, line.e)
    if line.has_plane:
        return Plane(line.nhat, line.height), tau * line.slope - line.height
    m = add(x, pair.t)
    if not norm(m) > 0.0:
        m = line.e
    best, margin = Plane(m, -math.inf), -math.inf
    n_points = 0
    square = math.inf
    for _ in range(_ROUNDS):
        m = scale(1.0 / norm(m), m)
        w = _farthest(pair, m)
        height = dot(w, m) + line.radius
        if dot(x, m) - height > margin:
            best, margin = Plane(m, height), dot(x, m) - height
        n_points = _take_point(simplex, n_points, w)
        n_points, nearer = _nearest_to(simplex, n_points, x)
        if not line.radius * line.radius < nearer < square:
            break
        if margin > _FAR * tau or math.sqrt(nearer) - line.radius <= margin * _NEAR_ENOUGH:
            break
        square = nearer
        m = _direction(simplex, n_points, line.curved)
        if not norm(m) > 0.0:
            break
    return best, margin


@kernel(inline=True)
def is_out_of_reach(parts, pa, pb, length, held):
    """Whether A ⊖ B of two parts has no point within a length of 0 [m], by the balls around both, held : `held_in` of
    A's part; rounding is left out: for proposals."""
    apart = sub(vec3_at(parts.poses, POSE * pb + 9), vec3_at(parts.poses, POSE * pa + 9))
    return norm(apart) > length + held + held_in(parts, pb)


@kernel(inline=True)
def held_in(parts, part):
    """Radius [m] of a ball around a part's origin that holds the posed part, stretch and rounding included; infinite of
    a half-space."""
    shape = parts.shape_of[part]
    at, p = NUMBERS * shape, POSE * part
    held = parts.numbers[at + REACH] * parts.poses[p + POSE_STRETCH] + parts.numbers[at + RADIUS]
    held += parts.numbers[at + SLOP] + parts.poses[p + POSE_SLOP]
    return math.inf if parts.ints[INTS * shape + KIND] == HALFSPACE else held


@kernel(inline=True)
def _are_balls_apart(parts, pa, pb, n, tau, held):
    """Whether B's part moved by τ·n is clear of A's by the balls around both, seen before either is opened.

    held : `held_in` of A's part [m].   Both are apart where the distance of their origins exceeds the sum of both
    balls' radii. `_apart_at` asks the same with an error, 2⁻⁴⁶ of a size of at most the sum of both radii, τ and the
    distance of the origins: 2⁻³⁶ of the same sum is more, and a pair left out here is left out by `_apart_at`. Squares
    that underflow leave no pair out.
    """
    apart = add(scale(tau, n), sub(vec3_at(parts.poses, POSE * pb + 9), vec3_at(parts.poses, POSE * pa + 9)))
    reach = (held + held_in(parts, pb)) * (1 + 2.0**-36) + 2.0**-36 * tau
    return dot(apart, apart) > reach * reach * (1 + 2.0**-36) + 1e-290


@kernel(inline=True)
def longer(a, b):
    """The longer one of two `Length`."""
    return b if b.proven > a.proven or (b.proven == a.proven and b.value > a.value) else a


@kernel(inline=True)
def _simplex_at(work_at):
    return _Simplex(view_f64(work_at, _POINTS), view_f64(work_at + 8 * _POINTS, _WEIGHTS))


@kernel
def _pair_and_line(parts, pa, pb, n):
    """Two parts as a `PosedPair`, and the `_Line` along which the B of the `PosedPair` is moved against its A."""
    ints, numbers, poses = parts.ints, parts.numbers, parts.poses
    sa, pa, sb, pb, flip = in_order(ints, poses, parts.shape_of[pa], pa, parts.shape_of[pb], pb)
    pair = posed_pair(ints, numbers, poses, sa, pa, sb, pb)
    size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
    radius = radius_of(pair, pair.A) + radius_of(pair, pair.B)
    curved = pair.A.kind != POINTS or pair.B.kind != POINTS
    e, none = neg(n) if flip else n, Vec3(0.0, 0.0, 0.0)
    if pair.A.kind != HALFSPACE:
        return pair, _Line(e, radius, ERROR * size + slop, curved, False, 0.0, 0.0, none)
    if pair.B.kind == HALFSPACE:
        return pair, _Line(e, radius, 0.0, curved, True, 0.0, -math.inf, none)
    near = plane_gap(OrderedPair(pair, ints, flip, size, slop, False))
    return pair, _Line(e, radius, near.error, curved, True, -near.gap, dot(near.nhat, e), near.nhat)


@kernel
def _apart_at(pair, line, tau, simplex):
    """Whether a ball or a plane is found that parts τ·e from A ⊖ B."""
    if line.has_plane:
        return tau * line.slope - line.height > line.error + 2.0**-49 * tau
    x = scale(tau, line.e)
    error = line.error + 2.0**-49 * tau
    m = add(x, pair.t)
    if norm(m) > (reach_of_both(pair) + line.radius) * _UP + error:
        return True  # all of A ⊖ B lies within both reaches of −t
    if not norm(m) > 0.0:
        m = line.e
    n_points = 0
    square = math.inf
    for _ in range(_ROUNDS):
        m = scale(1.0 / norm(m), m)
        w = _farthest(pair, m)
        if dot(x, m) - (dot(w, m) + line.radius) > error:
            return True
        n_points = _take_point(simplex, n_points, w)
        n_points, nearer = _nearest_to(simplex, n_points, x)
        if not line.radius * line.radius < nearer < square:
            return False
        square = nearer
        m = _direction(simplex, n_points, line.curved)
        if not norm(m) > 0.0:
            return False
    return False


@kernel
def _bounded_by_planes(pair, line, simplex):
    """The `Length` from which on τ·e is proven to lie outside A ⊖ B."""
    best = Length(math.inf, math.inf)
    if line.has_plane:
        if not line.slope > _LEAST_SLOPE:
            return best
        bound = (line.height + line.error) / line.slope
        return Length(line.height / line.slope, bound + abs(bound) * 2.0**-49 / line.slope)
    m = line.e
    n_points = 0
    x = Vec3(0.0, 0.0, 0.0)
    square = math.inf
    for _ in range(_ROUNDS):
        m = scale(1.0 / norm(m), m)
        w = _farthest(pair, m)
        height = dot(w, m) + line.radius
        slope = dot(m, line.e)
        closer = False
        if slope > _LEAST_SLOPE:
            # The slope is off by 4u, of itself at most 4u / slope.
            bound = (height + line.error) / slope
            bound += abs(bound) * 2.0**-49 / slope
            if bound < best.proven:
                best = Length(height / slope, bound)
                x = scale(bound, line.e)
                closer = True
        n_points = _take_point(simplex, n_points, w)
        n_points, nearer = _nearest_to(simplex, n_points, x)
        if not math.sqrt(nearer) > line.radius + line.error or not (closer or nearer < square):
            break
        square = nearer
        m = _direction(simplex, n_points, line.curved)
        if not norm(m) > 0.0:
            break
    return best


@kernel
def _farthest(pair, m):
    """The point of A ⊖ B farthest along m."""
    a = _farthest_of(pair, pair.A, m)
    b = _farthest_of(pair, pair.B, neg(m))
    return sub(sub(a, b), pair.t)


@kernel
def _farthest_of(pair, body, m):
    """The point of a core farthest along m, in W's axes from its own origin; of a support tree, settled."""
    g = rotate_back(pair.poses, body.pose_at, m)
    farthest = support(body.kind, body.coords, body.padded, pair.numbers, body.params_at, body.tree, 0, -1, g)
    point = farthest.point
    if body.tree != 0:
        vertex = settled_vertex(body.coords, body.padded, body.tree, farthest.id, g)
        point = column_at(body.coords, body.padded, vertex)
    return rotate(pair.poses, body.pose_at, point)


@kernel(inline=True)
def _take_point(simplex, n_points, w):
    put_vec3(simplex.points, POINT * n_points + POINT_OF_A, w)
    return n_points + 1


@kernel
def _nearest_to(simplex, n_points, x):
    """(points that remain, squared distance) of the point nearest x in the simplex, kept as seen from x."""
    points, weights = simplex
    for k in range(n_points):
        put_vec3(points, POINT * k, sub(vec3_at(points, POINT * k + POINT_OF_A), x))
    square = nearest_of_all(points, n_points, weights, 15)
    n_kept = 0
    for k in range(n_points):
        if weights[k] > _LEAST_WEIGHT:
            if n_kept != k:
                copy_coordinates(points, k, points, n_kept)
            n_kept += 1
    return n_kept, square


@kernel(inline=True)
def _direction(simplex, n_points, curved):
    """From the simplex towards the point it is seen from; of polytopes across its edges, to full precision."""
    v = vec3_at(simplex.weights, NEAREST_POINT)
    return neg(v if curved else across_simplex(simplex.points, n_points, v))
