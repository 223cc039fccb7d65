"""A sphere and a capsule in closed form: the point of a segment nearest to a point."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.capsule_capsule import across, clamped_share, core_of_ends, raised_bound
from collide.narrowphase.gjk.minkowski_difference import NEAREST_POINT, copy_point, place_vertices, point_at
from collide.numerics.vec3 import add, dot, norm, put_vec3, scale, sub


@kernel
def point_segment_cores(pair, work, error):
    """The `CoreDistance` of two cores, a point and a segment in either order, by four points as of two segments."""
    points, weights, ids = work.points, work.weights, work.ids
    far = 1 if pair.A.n == 2 else 2  # where the difference with the segment's other end stands
    place_vertices(pair, points, ids, 0, 0, 0)
    place_vertices(pair, points, ids, far, pair.A.n - 1, pair.B.n - 1)
    copy_point(points, ids, 0, 3 - far)
    copy_point(points, ids, far, 3)
    p = point_at(points, 0)
    e = sub(point_at(points, far), p)
    share = clamped_share(-dot(p, e), dot(e, e))
    weights[3] = weights[3 - far] = 0.0
    weights[0] = 1.0 - share
    weights[far] = share
    nearest = add(scale(1.0 - share, p), scale(share, point_at(points, far)))
    put_vec3(weights, NEAREST_POINT, nearest)
    # Planes across the nearest point, and across its part off the segment: precise where the gap is tiny.
    lower = raised_bound(points, weights, -math.inf, nearest)
    if dot(e, e) > 0.0:
        lower = raised_bound(points, weights, lower, across(nearest, e))
    return core_of_ends(points, weights, norm(nearest), lower, error)
