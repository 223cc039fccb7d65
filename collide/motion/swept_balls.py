"""Balls about the origins of two bodies in motion: the time in which these are near enough for a contact."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.motion.moving_pair import origin_error
from collide.numerics.vec3 import add, dot, norm, scale


@kernel
def time_of_balls(d0, v, farthest, reach, begin, end):
    """(begin, end), bounds of the time from ``begin`` to ``end`` when the origins are within a reach of each other,
    rounded outwards; begin > end where they never are.

    d0, v : from A's origin to B's at time 0, and its change in unit time.   farthest : bound of its length.

    The distance is a convex function of time: where larger than the reach and growing, no contact follows; where larger
    and falling, no contact was before.
    """
    reach = (reach + origin_error(farthest)) * (1.0 + 2.0**-40)
    along, square = dot(d0, v), dot(v, v)
    if not square > 0.0:
        return (1.0, 0.0) if norm(d0) > reach else (begin, end)
    middle = -along / square
    nearest = _distance(d0, v, min(max(middle, begin), end))
    if nearest > reach + 2.0**-40 * farthest:  # rounding of the middle moves the distance by less than this
        return 1.0, 0.0
    discriminant = along * along - square * (dot(d0, d0) - reach * reach)
    half = math.sqrt(max(discriminant, 0.0)) / square * (1.0 + 2.0**-30) + 2.0**-40 * abs(middle)
    before, after = middle - half, middle + half
    rounding = 2.0**-40 * farthest * norm(v)
    last = end
    if begin < before < end and _distance(d0, v, before) > reach and _growth(d0, v, before) < -rounding:
        begin = before
    if begin < after < end and _distance(d0, v, after) > reach and _growth(d0, v, after) > rounding:
        last = after
    return begin, last


@kernel(inline=True)
def _distance(d0, v, time):
    return norm(add(d0, scale(time, v)))


@kernel(inline=True)
def _growth(d0, v, time):
    """Half the derivative of the distance squared."""
    return dot(add(d0, scale(time, v)), v)
