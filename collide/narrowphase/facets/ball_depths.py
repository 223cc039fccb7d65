"""How deep a ball, or a point, is in a body of facets: from the distance of its centre to the surface.

A centre inside a solid, d from the surface, has to pass the surface: a translation that takes the ball of radius r out
is d + r long or longer, since the way to the surface is d at least, and the rest of the way r. A centre outside, nearer
than r, has to go r − d at least. Both bounds are met where the ball, moved so far towards the nearest point or off, is
clear of the rest of the body, as the exact test says; a narrow pocket holds the ball longer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body, reach_of
from collide.narrowphase.facets.facet_queries import points_in_solid, surface_distances
from collide.narrowphase.facets.winding_numbers import INSIDE, OUTSIDE

#: How much farther than the bound a ball is moved, as a part of the pair's size, to be proven clear.
_CLEARANCE = 2.0**-41


class BallDepth(NamedTuple):
    """least : proven lower bound of the length of a separating translation [m].   length : as computed.
    step : (3,) the translation of B to be tried, a little longer."""

    least: float
    length: float
    step: np.ndarray


def ball_depth(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> BallDepth | None:
    """The `BallDepth` of two meeting bodies at poses (4, 4); ``None`` where neither is a ball or a point, or where the
    centre is on the surface. O(log n) as a rule in the facets of the other body."""
    if not is_ball(B):
        if not is_ball(A):
            return None
        swapped = ball_depth(B, A, X_WB, X_WA)
        return swapped and swapped._replace(step=-swapped.step)
    near = surface_distances(A.tree, B.tree, X_WA, X_WB)
    if near.meets[0] or not near.lower[0] > 0.0:
        return None
    side = points_in_solid(A.tree, X_WA, B.points[0], X_WB)[0] if A.solid else OUTSIDE
    if side not in (INSIDE, OUTSIDE):
        return None
    radius, is_inside = A.radius + B.radius, side == INSIDE
    sign = 1.0 if is_inside else -1.0
    bound = radius + sign * float(near.lower[0] if is_inside else near.upper[0])
    length = radius + sign * float(near.distance[0])
    size = reach_of(A) + reach_of(B) + float(np.sqrt(np.square(X_WB[:3, 3] - X_WA[:3, 3]).sum()))
    if not bound > 0.0:
        return None
    least = bound * (1.0 - 2.0**-50)
    step = (length + _CLEARANCE * size) * (-sign) * near.normal[0]
    return BallDepth(least, max(length, least), step)


def is_ball(body: Body) -> bool:
    """Whether a body is a point with a radius, or without."""
    corners = body.tree.triangles.reshape(-1, 3)
    return len(corners) == 3 and bool((corners == corners[0]).all()) and math.isfinite(body.radius)
