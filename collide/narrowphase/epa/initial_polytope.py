"""Start of EPA: four points of A ⊖ B of ample volume, or the finding that A ⊖ B is flat.

Never the last simplex of GJK where thin: from simplices as thin as GJK leaves them at touching bodies, a prototype took
27 wrong depths in 9,264 lattice poses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import EPA_VERTICES
from collide.narrowphase.gjk.minkowski_difference import copy_point, difference_point, point_at
from collide.narrowphase.gjk.simplex import signed_volume
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, neg, norm, scale, sub, unit_orthogonal

#: Centres as near as this, in units of S, have no direction from one to the other.
_CENTRED = 2.0**-20
#: Cosine of directions that count as the same.
_SAME_DIRECTION = 0.9
#: How far around the direction of least penetration three points are looked for: sines.
_NARROWEST, _WIDEST = 0.35, 0.9
_HALF_ROOT = math.sqrt(0.75)
#: Least volume of four points to begin with, times six, in units of S³.
_LEAST_VOLUME = 2.0**-16


class Extremes(NamedTuple):
    """rank : dimension of what points 0 … 3 span, as far as rounding can tell.   nhat : where less than 3, across
    it."""

    rank: int
    nhat: Vec3


@kernel
def extremal_tetrahedron(pair, points, ids, error, start):
    """Points 0..3 become an extremal tetrahedron; returns `Extremes`.

    start : 0 for the axes of the world, else other ones, so that another tetrahedron is found.
    """
    spare = EPA_VERTICES
    if _farthest_pair(pair, points, ids, 0.375 * start) <= 8.0 * error:
        return Extremes(0, Vec3(0.0, 0.0, 1.0))
    e = sub(point_at(points, 1), point_at(points, 0))
    u = unit_orthogonal(e)
    e = divide(e, norm(e))
    farthest = -1.0
    n = u
    for step in range(4):
        if step > 0:  # a quarter turn about the edge, from u to e × u and on to their opposites
            u = cross(e, u)
        difference_point(pair, points, ids, spare, u)
        across = cross(e, sub(point_at(points, spare), point_at(points, 0)))
        distance = norm(across)
        if distance > farthest:
            farthest = distance
            copy_point(points, ids, spare, 2)
            n = across
    if farthest <= 8.0 * error:
        return Extremes(1, unit_orthogonal(e))
    n = divide(n, farthest)
    difference_point(pair, points, ids, 3, n)
    difference_point(pair, points, ids, spare, neg(n))
    above = _height(points, 3, n)
    below = -_height(points, spare, n)
    if below > above:
        copy_point(points, ids, spare, 3)
    if above <= 8.0 * error and below <= 8.0 * error:
        return Extremes(2, n)
    return Extremes(3, n)


@kernel
def _farthest_pair(pair, points, ids, askew):
    """Points 0 and 1 become the extremes along the axis of greatest width, of three; returns that width.

    askew : component of each axis along the other two axes of the world.
    """
    spare = EPA_VERTICES
    widest = -math.inf
    for axis in range(3):
        d = Vec3(1.0 if axis == 0 else askew, 1.0 if axis == 1 else askew, 1.0 if axis == 2 else askew)
        difference_point(pair, points, ids, spare, d)
        difference_point(pair, points, ids, spare + 1, neg(d))
        width = dot(d, sub(point_at(points, spare), point_at(points, spare + 1)))
        if width > widest:
            widest = width
            copy_point(points, ids, spare, 0)
            copy_point(points, ids, spare + 1, 1)
    return widest


@kernel
def capped_tetrahedron(pair, points, ids, size):
    """Points 0..3 become three points about the likely direction of least penetration and the opposite extreme; whether
    their volume suffices.

    The likely direction leads from the middle of A ⊖ B to the origin: along the line of the frames' origins where these
    are the bodies' centres. The three lie far enough around this direction for the other sides to be farther from the
    origin than the cap.

    With many vertices this saves a quarter to a third of the iterations: 12.6 became 8.6 on hulls of 128 on a sphere.
    With long thin bodies nothing is saved. More iterations than from GJK's own tetrahedron were needed with a corner on
    the likely direction, and with three corners 60° around. The normal of the tetrahedron's nearest facet is a worse
    guess.
    """
    spare = EPA_VERTICES
    length = norm(pair.t)
    if not length > _CENTRED * size:
        return False
    u = divide(pair.t, length)
    depth = 0.0
    width = 0.0
    for step in range(2):
        difference_point(pair, points, ids, spare, neg(u))
        difference_point(pair, points, ids, spare + 1, u)
        near, far = point_at(points, spare), point_at(points, spare + 1)
        depth = dot(far, u)
        width = depth - dot(near, u)
        middle = add(near, far)
        length = norm(middle)
        if step == 1 or not -dot(middle, u) < _SAME_DIRECTION * length:
            break
        u = divide(neg(middle), length)
    if not width > 0.0:
        return False
    sine = min(max(4.0 * depth / width, _NARROWEST), _WIDEST)
    cosine = math.sqrt(1.0 - sine * sine)
    e = unit_orthogonal(u)
    f = cross(u, e)
    for k in range(3):
        along = sine if k == 0 else -0.5 * sine
        beside = 0.0 if k == 0 else (_HALF_ROOT * sine if k == 1 else -_HALF_ROOT * sine)
        d = add(add(scale(cosine, u), scale(along, e)), scale(beside, f))
        difference_point(pair, points, ids, spare + 1 + k, d)
    if not abs(signed_volume(points, spare)) > _LEAST_VOLUME * size * size * size:
        return False
    for k in range(4):
        copy_point(points, ids, spare + k, k)
    return True


@kernel
def _height(points, k, n):
    """Height of point k over point 0."""
    return dot(sub(point_at(points, k), point_at(points, 0)), n)
