"""Two spheres in closed form: the distance of two points."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.core_distance import CoreDistance
from collide.narrowphase.gjk.minkowski_difference import place_vertices, point_at
from collide.numerics.vec3 import Vec3, divide, dot, neg, norm


@kernel
def point_cores(pair, work, error):
    """The `CoreDistance` of two points, along z where the points coincide and every direction is as good.

    p·p / |p| is the offset of the plane across p = a − b: both bounds are |p| but for rounding (`bounds.py`).
    """
    place_vertices(pair, work.points, work.ids, 0, 0, 0)
    for k in range(1, 4):  # a row names four pairs of vertices, as of two segments
        work.ids[2 * k] = work.ids[2 * k + 1] = 0
        work.weights[k] = 0.0
    work.weights[0] = 1.0
    p = point_at(work.points, 0)
    distance = norm(p)
    if distance > error:
        nhat = neg(divide(p, distance))
        return CoreDistance(-distance, dot(p, p) / distance, distance, -math.inf, math.inf, nhat, 1, 4, 0)
    return CoreDistance(p.z, -p.z, distance, -math.inf, math.inf, Vec3(0.0, 0.0, 1.0), 1, 4, 0)
