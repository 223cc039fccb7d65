"""A hull on its way: its facets, their neighbours, and the lists of points that stand above them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.hull.first_simplex import before
from collide.kernels import kernel
from collide.numerics.orientation import UNDERFLOW, orientation
from collide.numerics.vec3 import Vec3, dot, norm1, put_vec3, sub, vec3_at

#: Integers of a facet: three corners, counter-clockwise from outside; the facet across each edge
#: (corner k to k + 1); the first point of its list; its neighbours in the queue; the round
#: in which it was last tested, negative where it was not visible.
FACET = 10
ACROSS, POINT, BEFORE, AFTER, ROUND = 3, 6, 7, 8, 9
#: Doubles of a facet: normal, a corner, how far its plane's doubles may be off, its farthest point's distance.
PLANE = 8
_CORNER, _ERROR, _FARTHEST = 3, 6, 7
#: As `orientation`'s, for differences up to 2: 8 u times the terms' magnitudes, doubled, times 2.
_PLANE_ERROR = 2.0**-48

#: Integers of the state: free facets as a chain, facets ever used, first and last of the queue of
#: facets with points, the round, tests of a point against a plane, facets made, how far the shuffled order
#: was followed (−1: not begun), four corners to begin with.
STATE = 12
FREE, USED, FIRST, LAST, NOW, TESTS, MADE, CURSOR, CORNERS = 0, 1, 2, 3, 4, 5, 6, 7, 8


class GrowingHull(NamedTuple):
    """A hull on its way: views of all memory read and written by its steps.

    cloud : a `CloudView`.   facets, planes : FACET integers and PLANE doubles a facet.   state : STATE integers.
    following : by point, the next point of its list.   owner : by point, the facet of its list, or −1.
    orphans : points from the lists of removed facets.   region : facets being removed.
    rim : two integers an edge of the region's rim, see `visible_region`.   fan : facets put in the region's place.
    starting : by point, the facet of the fan with its base beginning at this point, or −1.   order : the points
    shuffled (`next_corner`).
    """

    cloud: Any
    facets: Any
    planes: Any
    state: Any
    following: Any
    owner: Any
    orphans: Any
    region: Any
    rim: Any
    fan: Any
    starting: Any
    order: Any


@kernel
def make_facet(hull, a, b, c):
    """Number of a new facet with no neighbours and no points."""
    points, facets, planes, state = hull.cloud.scaled, hull.facets, hull.planes, hull.state
    f = state[FREE]
    if f >= 0:
        state[FREE] = facets[FACET * f + AFTER]
    else:
        f = state[USED]
        state[USED] += 1
    state[MADE] += 1
    at = FACET * f
    facets[at] = a
    facets[at + 1] = b
    facets[at + 2] = c
    facets[at + POINT] = -1
    facets[at + ROUND] = 0
    corner = vec3_at(points, 3 * a)
    u, v = sub(vec3_at(points, 3 * b), corner), sub(vec3_at(points, 3 * c), corner)
    terms, subtracted = Vec3(u.y * v.z, u.z * v.x, u.x * v.y), Vec3(u.z * v.y, u.x * v.z, u.y * v.x)
    at = PLANE * f
    put_vec3(planes, at, sub(terms, subtracted))
    put_vec3(planes, at + _CORNER, corner)
    planes[at + _ERROR] = _PLANE_ERROR * (norm1(terms) + norm1(subtracted)) + UNDERFLOW
    planes[at + _FARTHEST] = -1.0
    return f


@kernel
def free_facet(hull, f):
    """Take facet f out of the queue, if it has points; its number may be used again."""
    facets, state = hull.facets, hull.state
    at = FACET * f
    if facets[at + POINT] >= 0:
        previous = facets[at + BEFORE]
        following_one = facets[at + AFTER]
        if previous >= 0:
            facets[FACET * previous + AFTER] = following_one
        else:
            state[FIRST] = following_one
        if following_one >= 0:
            facets[FACET * following_one + BEFORE] = previous
        else:
            state[LAST] = previous
    facets[at] = -1
    facets[at + AFTER] = state[FREE]
    state[FREE] = f


@kernel
def above(hull, f, i):
    """(whether point i lies strictly above facet f, its distance in some unit of the facet's)."""
    cloud, facets, planes = hull.cloud, hull.facets, hull.planes
    at = PLANE * f
    value = dot(vec3_at(planes, at), sub(vec3_at(cloud.scaled, 3 * i), vec3_at(planes, at + _CORNER)))
    margin = planes[at + _ERROR]
    if value > margin:
        return True, value
    if value < -margin or abs(value) + margin < cloud.work[1]:
        return False, value
    at = FACET * f
    a, b, c = np.int64(facets[at]), np.int64(facets[at + 1]), np.int64(facets[at + 2])
    return orientation(cloud, a, b, c, i, -1) > 0, value


@kernel
def put(hull, f, i, distance):
    """Put point i into the list of facet f: at the head if farthest from the facet, else second."""
    facets, planes, following, state = hull.facets, hull.planes, hull.following, hull.state
    at = FACET * f
    head = np.int64(facets[at + POINT])
    if head < 0:
        last = state[LAST]
        facets[at + BEFORE] = last
        facets[at + AFTER] = -1
        if last >= 0:
            facets[FACET * last + AFTER] = f
        else:
            state[FIRST] = f
        state[LAST] = f
    # Of points equally far, one that is extreme in another direction: a corner of a flat side, not a point on it.
    far = planes[PLANE * f + _FARTHEST]
    if head < 0 or distance > far or (distance == far and before(hull.cloud.scaled, head, i, 0)):
        following[i] = head
        facets[at + POINT] = i
        planes[PLANE * f + _FARTHEST] = distance
    else:
        following[i] = following[head]
        following[head] = i
