"""Whose nearest points are local minima of the distance: no contacts at internal edges."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.contact.contact_facets import posed_corner
from collide.kernels import kernel
from collide.narrowphase.facets.facets_within import FACET_A, INTS_OF_PAIR, NUMBERS_OF_PAIR, POINT_A, POINT_B
from collide.numerics.vec3 import Vec3, add, cross, dot, neg, norm, scale, sub, vec3_at

#: Sines of angles that count as none.
FLAT = 2.0**-30
#: Nearest points this near to a corner or an edge, in lengths of the longest edge, are on it.
_ON = 2.0**-30


@kernel
def is_local_minimum(pairs, k, A, B):
    """Whether the line between a pair's nearest points leaves A, and enters B, at right angles.

    That is: no facet around either point comes nearer, and of solids the line lies outside. Elsewhere the points are
    nearest within these two facets only, and a neighbour has nearer ones.
    """
    u = vec3_at(pairs.directions, 3 * k)
    slack = pairs.slacks[k]
    point_a = vec3_at(pairs.near, NUMBERS_OF_PAIR * k + POINT_A)
    point_b = vec3_at(pairs.near, NUMBERS_OF_PAIR * k + POINT_B)
    return _leaves(pairs, k, 0, A, point_a, u, slack) and _leaves(pairs, k, 1, B, point_b, neg(u), slack)


@kernel
def _leaves(pairs, k, side, body, point, u, slack):
    """Whether u leaves a body from a point of a pair's facet at right angles."""
    corners_at = 18 * k + 9 * side
    ids_at = 6 * k + 3 * side
    first, second = _feature(pairs.corners, corners_at, point)
    if first < 0:  # within the facet: no neighbour is as near
        facet = pairs.facets[INTS_OF_PAIR * k + FACET_A + side]
        rises, outward = _facet_at(body, facet, point, u, slack, False)
        return not rises and _is_outside(body, outward, u, slack)
    corner = pairs.ids[ids_at + first]
    end = pairs.ids[ids_at + second] if second >= 0 else -1
    return fan_allows(body, corner, end, point, u, slack)


@kernel
def fan_allows(body, corner, end, point, u, slack):
    """Whether u leaves a body at right angles from a point at a corner, or on the edge from the corner to the corner
    ``end`` (−1: no edge).
    """
    outward = Vec3(0.0, 0.0, 0.0)
    for at in range(int(body.fan_starts[corner]), int(body.fan_starts[corner + 1])):
        facet = int(body.fans[at])
        if end >= 0 and not _has_corner(body, facet, end):
            continue
        rises, normal = _facet_at(body, facet, point, u, slack, end < 0)
        if rises:
            return False
        outward = add(outward, normal)
    return _is_outside(body, outward, u, slack)


class EdgeSlopes(NamedTuple):
    """How steeply a surface falls off from an edge, seen along a direction supported by the edge.

    supports : no facet at the edge rises from the edge.
    left_slope, right_slope : the least tangent of the facets on the side of edge × direction, and on the other; ∞
    without a facet.
    """

    supports: bool
    left_slope: float
    right_slope: float


@kernel
def edge_slopes(body, corner, end, p, q, u, slack):
    """The `EdgeSlopes` of the edge from a corner at p to the corner ``end`` at q, for the unit vector u."""
    e = sub(q, p)
    square = dot(e, e)
    side = cross(e, u)
    width = norm(side)
    left_slope, right_slope = math.inf, math.inf
    if not (square > 0.0 and width > 0.0):
        return EdgeSlopes(False, left_slope, right_slope)
    side = scale(1.0 / width, side)
    up = sub(u, scale(dot(u, e) / square, e))
    up = scale(1.0 / norm(up), up)
    for at in range(int(body.fan_starts[corner]), int(body.fan_starts[corner + 1])):
        facet = int(body.fans[at])
        if not _has_corner(body, facet, end):
            continue
        for k in range(3):
            third = int(body.corners[3 * facet + k])
            if third == corner or third == end:
                continue
            w = sub(posed_corner(body, int(body.places[facet]), k), p)
            fall, aside = -dot(w, up), dot(w, side)
            if fall < -slack * (abs(fall) + abs(aside)):
                return EdgeSlopes(False, left_slope, right_slope)
            slope = max(fall, 0.0) / abs(aside) if aside != 0.0 else math.inf
            if aside > 0.0:
                left_slope = min(left_slope, slope)
            else:
                right_slope = min(right_slope, slope)
    return EdgeSlopes(True, left_slope, right_slope)


@kernel(inline=True)
def _has_corner(body, facet, corner):
    return (
        int(body.corners[3 * facet]) == corner
        or int(body.corners[3 * facet + 1]) == corner
        or int(body.corners[3 * facet + 2]) == corner
    )


@kernel(inline=True)
def _is_outside(body, outward, u, slack):
    return not body.solid or body.is_convex or dot(outward, u) >= -slack * max(norm(outward), FLAT)


@kernel
def _facet_at(body, facet, point, u, slack, at_corner):
    """(whether a facet around a point comes nearer along u, its normal).

    at_corner : the normal is weighted with the facet's angle there.
    J. A. Bærentzen, H. Aanæs, "Signed distance computation using the angle weighted pseudonormal" (2005).
    """
    place = int(body.places[facet])
    p, q, r = posed_corner(body, place, 0), posed_corner(body, place, 1), posed_corner(body, place, 2)
    least = _ON * norm(sub(q, p))
    a, b, c = sub(p, point), sub(q, point), sub(r, point)
    zero = Vec3(0.0, 0.0, 0.0)
    if _rises(a, u, slack, least) or _rises(b, u, slack, least) or _rises(c, u, slack, least):
        return True, zero
    if not body.solid or body.is_convex:
        return False, zero
    n = cross(sub(q, p), sub(r, p))
    length = norm(n)
    if length == 0.0:
        return False, zero
    weight = 1.0 / length
    if at_corner:
        square_a, square_b, square_c = dot(a, a), dot(b, b), dot(c, c)
        if square_a <= square_b and square_a <= square_c:
            e, f = sub(q, p), sub(r, p)
        elif square_b <= square_c:
            e, f = sub(r, q), sub(p, q)
        else:
            e, f = sub(p, r), sub(q, r)
        weight *= _angle(e, f)
    return False, scale(weight, n)


@kernel(inline=True)
def _rises(away, u, slack, least):
    """Whether a corner is farther along u than what may be rounding."""
    rise = dot(away, u)
    return rise > least and rise > slack * norm(away) + least


@kernel
def _angle(e, f):
    """The angle between two vectors, to 1e-5: kernels have roots, and no functions of angles."""
    product = norm(e) * norm(f)
    cosine = min(max(dot(e, f) / product, -1.0), 1.0) if product > 0.0 else 1.0
    for _ in range(3):
        cosine = math.sqrt(0.5 * (1.0 + cosine))  # of half the angle
    sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
    square = sine * sine
    return 8.0 * sine * (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (15.0 / 336.0))))


@kernel
def _feature(corners, at, point):
    """Feature of a triangle under a point on its surface: (a corner, −1), both ends of an edge, or (−1, −1)."""
    p, q, r = vec3_at(corners, at), vec3_at(corners, at + 3), vec3_at(corners, at + 6)
    limit = _ON * max(norm(sub(q, p)), norm(sub(r, q)), norm(sub(p, r)))
    if norm(sub(point, p)) <= limit:
        return 0, -1
    if norm(sub(point, q)) <= limit:
        return 1, -1
    if norm(sub(point, r)) <= limit:
        return 2, -1
    if _off_segment(p, q, point) <= limit:
        return 0, 1
    if _off_segment(q, r, point) <= limit:
        return 1, 2
    if _off_segment(r, p, point) <= limit:
        return 2, 0
    return -1, -1


@kernel(inline=True)
def _off_segment(p, q, point):
    """How far a point is from a segment."""
    e, w = sub(q, p), sub(point, p)
    square = dot(e, e)
    t = min(max(dot(w, e) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return norm(sub(w, scale(t, e)))


@kernel
def snapped(pairs, k):
    """The normal of a facet of pair k, or the cross product of two of its edges, where its direction is that but for
    rounding; else the direction.
    """
    u = vec3_at(pairs.directions, 3 * k)
    best, normal = pairs.slacks[k], u
    is_face = False
    for side in range(2):
        n = vec3_at(pairs.normals, 6 * k + 3 * side)
        off = norm(cross(n, u))
        if dot(n, n) > 0.0 and off <= best:
            best, normal, is_face = off, n, True
    if not is_face:  # faces first
        for i in range(9):
            n = _cross_of_edges(pairs, k, i)
            off = norm(cross(n, u))
            if dot(n, n) > 0.0 and off <= best:
                best, normal = off, n
    return normal if dot(normal, u) > 0.0 else neg(normal)


@kernel
def _cross_of_edges(pairs, k, i):
    """The unit vector across edge i // 3 of A's facet and edge i % 3 of B's; 0 where they are parallel."""
    return cross_of_edges(pairs.corners, 18 * k, i // 3, i % 3)


@kernel
def cross_of_edges(corners, at, i, j):
    """The unit vector across edge i of a triangle and edge j of the next triangle; 0 for parallel edges."""
    e = sub(vec3_at(corners, at + 3 * ((i + 1) % 3)), vec3_at(corners, at + 3 * i))
    f = sub(vec3_at(corners, at + 9 + 3 * ((j + 1) % 3)), vec3_at(corners, at + 9 + 3 * j))
    n = cross(e, f)
    length = norm(n)
    if not length > FLAT * (norm(e) * norm(f)):
        return Vec3(0.0, 0.0, 0.0)
    return scale(1.0 / length, n)
