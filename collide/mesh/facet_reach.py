"""How far facets reach from a point: the ball around a body of facets."""

from __future__ import annotations

import math

from collide.kernels import entry, view_f64
from collide.numerics.vec3 import dot, sub, vec3_at


@entry("float64(int64, int64, int64)")
def reach_of_facets(triangles_at, n, centre_at):
    """How far the corners of n facets, nine doubles each, reach from a centre, rounded upwards [m]."""
    centre, square = vec3_at(view_f64(centre_at, 3), 0), 0.0
    for k in range(3 * n):
        out = sub(vec3_at(view_f64(triangles_at + 24 * k, 3), 0), centre)
        square = max(square, dot(out, out))
    return math.sqrt(square) * (1.0 + 1e-12)
