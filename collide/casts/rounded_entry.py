"""The entry of a line into a body swept by a ball, guessed in closed form from the features of a portal.

Where a portal's three points belong to a single pair of core vertices, the line enters a ball around their difference;
to two, a cylinder around an edge; to three, a plane. A support plane at the guess proves or refutes the guess.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.gjk.minkowski_difference import POINT, POINT_OF_B, place_vertices, point_at
from collide.numerics.vec3 import Vec3, add, cross, dot, norm, scale, sub, vec3_at


class Guess(NamedTuple):
    """A guessed entry.

    exists : False for no guess.   normal : unit normal of D at the entry.
    w : a point of D.   touching : w's point of B, in W's axes from B's origin.
    """

    exists: bool
    normal: Vec3
    w: Vec3
    touching: Vec3


@kernel(inline=True)
def _none():
    zero = Vec3(0.0, 0.0, 0.0)
    return Guess(False, zero, zero, zero)


@kernel(inline=True)
def _core(cast, slot, k):
    """Slot becomes the core point that support point k belongs to."""
    place_vertices(cast.pair, cast.points, cast.ids, slot, cast.ids[2 * k], cast.ids[2 * k + 1])


@kernel(inline=True)
def _same(ids, i, j):
    return ids[2 * i] == ids[2 * j] and ids[2 * i + 1] == ids[2 * j + 1]


@kernel
def guess_entry(cast, a, b, c):
    """The `Guess` by the core vertices of a portal; the first three slots are overwritten."""
    ids = cast.ids
    if min(ids[2 * a], ids[2 * b], ids[2 * c]) < 0 or min(ids[2 * a + 1], ids[2 * b + 1], ids[2 * c + 1]) < 0:
        return _none()
    _core(cast, 0, a)
    n = 1
    if not _same(ids, b, a):
        _core(cast, n, b)
        n += 1
    if not _same(ids, c, a) and not _same(ids, c, b):
        _core(cast, n, c)
        n += 1
    if n == 3:
        return _onto_plane(cast)
    first = point_at(cast.points, 0)
    along = Vec3(0.0, 0.0, 0.0)
    square = 1.0
    if n == 2:
        along = sub(point_at(cast.points, 1), first)
        square = dot(along, along)
        if not square > 0.0:
            return _none()
    radius = cast.radius_a + cast.radius_b
    # Across the edge: a circle in a plane, or of a vertex a sphere in space.
    e = sub(cast.e, scale(dot(cast.e, along) / square, along))
    centre = sub(first, scale(dot(first, along) / square, along))
    ee = dot(e, e)
    if not ee > 2.0**-40 * cast.length * cast.length:
        return _none()
    middle = dot(centre, e) / ee
    beside = sub(centre, scale(middle, e))
    rest = radius * radius - dot(beside, beside)
    if not rest > 0.0:
        return _none()
    t = middle - math.sqrt(rest / ee)
    p = scale(t, cast.e)
    share = dot(sub(p, first), along) / square
    if share < 0.0 or share > 1.0:
        return _none()
    foot = add(first, scale(share, along))
    v = sub(p, foot)
    return _guess(cast, scale(1.0 / norm(v), v), 1.0 - share, share, 0.0)


@kernel(inline=True)
def _onto_plane(cast):
    first, second, third = point_at(cast.points, 0), point_at(cast.points, 1), point_at(cast.points, 2)
    n = cross(sub(second, first), sub(third, first))
    length = norm(n)
    slope = dot(n, cast.e)
    if not abs(slope) > 2.0**-40 * length * cast.length:
        return _none()
    v = scale((1.0 if slope < 0.0 else -1.0) / length, n)
    t = (dot(v, first) + cast.radius_a + cast.radius_b) / dot(v, cast.e)
    foot = sub(scale(t, cast.e), scale(cast.radius_a + cast.radius_b, v))
    p, q, r = sub(first, foot), sub(second, foot), sub(third, foot)
    square = length * length
    of_first, of_second = dot(cross(q, r), n) / square, dot(cross(r, p), n) / square
    of_third = 1.0 - of_first - of_second
    if of_first < 0.0 or of_second < 0.0 or of_third < 0.0:
        return _none()
    return _guess(cast, v, of_first, of_second, of_third)


@kernel(inline=True)
def _guess(cast, v, of_first, of_second, of_third):
    points = cast.points
    w = scale(of_first, point_at(points, 0))
    touching = scale(of_first, vec3_at(points, POINT_OF_B))
    if of_second > 0.0:
        w = add(w, scale(of_second, point_at(points, 1)))
        touching = add(touching, scale(of_second, vec3_at(points, POINT + POINT_OF_B)))
    if of_third > 0.0:
        w = add(w, scale(of_third, point_at(points, 2)))
        touching = add(touching, scale(of_third, vec3_at(points, 2 * POINT + POINT_OF_B)))
    return Guess(
        True, v, add(w, scale(cast.radius_a + cast.radius_b, v)), sub(touching, scale(cast.radius_b, v))
    )
