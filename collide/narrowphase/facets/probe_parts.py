"""What probes of both kinds are made of: floats, slabs, a facet in the units of its tree."""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import kernel
from collide.mesh.box_overlap import PROBE
from collide.mesh.bvh import CENTRE, EXPONENT, Box
from collide.mesh.triangle import Triangle, triangle_at
from collide.narrowphase.facets.filtered_triangles import TINY
from collide.numerics.vec3 import Vec3, add, divide, max_abs, scale, sub, vec3_at

#: Where the slab of a probe stands: its normal (3), its middle and its half width.
SLAB_AT = 12


@kernel
def triangle_in_units(tree, facet):
    """A facet's corners in its tree's units, from the tree's centre."""
    unit = math.ldexp(1.0, int(-tree.header[EXPONENT]))
    centre = vec3_at(tree.numbers, CENTRE)
    corners = triangle_at(tree.triangles, 9 * facet)
    return Triangle(
        scale(unit, sub(corners.p, centre)), scale(unit, sub(corners.q, centre)), scale(unit, sub(corners.r, centre))
    )


@kernel
def box_of_triangle(triangle):
    p, q, r = triangle
    low = Vec3(min(p.x, q.x, r.x), min(p.y, q.y, r.y), min(p.z, q.z, r.z))
    high = Vec3(max(p.x, q.x, r.x), max(p.y, q.y, r.y), max(p.z, q.z, r.z))
    return Box(scale(0.5, add(low, high)), scale(0.5, sub(high, low)))


@kernel(inline=True)
def unit_of(n):
    """n over its largest component in size; 0 where n is next to 0."""
    size = max_abs(n)
    if not size > TINY:
        return Vec3(0.0, 0.0, 0.0)
    return divide(n, size)


@kernel(inline=True)
def put_floats(floats, at, a):
    floats[at] = np.float32(a.x)
    floats[at + 1] = np.float32(a.y)
    floats[at + 2] = np.float32(a.z)


@kernel(inline=True)
def clear_slab(probe):
    for k in range(SLAB_AT, PROBE):
        probe[k] = np.float32(0.0)
