"""Which of a node's boxes a facet of the other tree misses, in doubles: for bodies so much smaller than the facet's
body that floats of the larger size cannot tell their boxes apart.

Axes are the axes of a triangle and a box (T. Akenine-Möller, "Fast 3D triangle-box overlap testing", 2001): the box's
own, the triangle's normal and the box's axes across the triangle's edges. With E the error of a corner or of a side of
the box, u = 2⁻⁵³ and D the largest component of a difference of two points of triangle or box: the normal's heights
are off by `sign_error`, heights across an edge by 16 (D + E)(E + 2uD): edges and differences are off by 2E + uD each.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.mesh.bvh import CENTRE, EXPONENT, REACH, WIDTH, Box, box_at
from collide.mesh.triangle import Triangle, normal_of, triangle_at
from collide.narrowphase.facets.filtered_triangles import TINY, sign_error
from collide.narrowphase.facets.posed_surfaces import ERROR, N_ERROR, SHIFT, M, N
from collide.numerics.vec3 import absolute, add, component, dot, max_abs, neg, rotate, scale, sub, vec3_at

_U = 2.0**-53
#: Boxes smaller than this share of the other tree's unit are lost in floats of that: they are off by 2⁻¹⁶ of it.
_SMALL = 2.0**-13
#: What rounding leaves out of a box, of its tree's reach.
_BOX_ERROR = 2.0**-48


class _Facet(NamedTuple):
    """A facet in the frame of the other tree's boxes, and the error E."""

    triangle: Triangle
    error: float


@kernel(inline=True)
def is_small(size, unit):
    """Whether floats cannot tell a box from its neighbours.   size : of the box; unit : of the facet's tree, in that of
    the box's."""
    return size < _SMALL * unit


@kernel
def without_missed(placing, which, tree, facet, nodes, node, mask):
    """A mask of eight boxes of a node without the boxes certainly missed by a facet.

    placing : of `posed_surfaces.py`.   which : 0 for a facet of A and boxes of B, 1 for the reverse.
    """
    placed = _placed(placing, which, tree, facet, nodes)
    centre = vec3_at(nodes.numbers, CENTRE)
    unit = math.ldexp(1.0, int(nodes.header[EXPONENT]))
    remaining = mask
    for slot in range(WIDTH):
        if (mask >> slot) & 1:
            box = box_at(nodes, WIDTH * node + slot)
            if _misses(placed, Box(add(centre, scale(unit, box.centre)), scale(unit, box.half))):
                remaining -= 1 << slot
    return remaining


@kernel
def _placed(placing, which, tree, facet, nodes):
    matrix = N if which == 0 else M
    shift = vec3_at(placing, matrix + SHIFT)
    corners = triangle_at(tree.triangles, 9 * facet)
    triangle = Triangle(
        add(rotate(placing, matrix, corners.p), shift), add(rotate(placing, matrix, corners.q), shift),
        add(rotate(placing, matrix, corners.r), shift),
    )
    error = placing[N_ERROR if which == 0 else ERROR] + _BOX_ERROR * max_abs(vec3_at(nodes.numbers, REACH))
    return _Facet(triangle, error)


@kernel
def _misses(facet, box):
    """Whether an axis certainly parts the triangle from the box, all seen from the first corner."""
    p, q, r = facet.triangle
    u = sub(q, p)
    v = sub(r, p)
    w = sub(box.centre, p)
    error = facet.error
    reach = max(max_abs(u), max_abs(v), max_abs(w) + max_abs(box.half))
    across = 16.0 * (reach + error) * (error + 2.0 * _U * reach) + TINY
    for axis in range(3):
        x, y, at = component(u, axis), component(v, axis), component(w, axis)
        slack = component(box.half, axis) + 4.0 * (error + _U * reach)
        if at - slack > max(0.0, x, y) or at + slack < min(0.0, x, y):
            return True
    n = normal_of(facet.triangle)
    if abs(dot(n, w)) - dot(absolute(n), box.half) > sign_error(reach, error):
        return True
    return (
        _parted_across(u, v, w, box.half, across)
        or _parted_across(v, u, w, box.half, across)
        or _parted_across(sub(v, u), neg(u), sub(w, u), box.half, across)
    )


@kernel(inline=True)
def _parted_across(edge, third, w, half, error):
    """Whether one of the box's axes across an edge parts them.   third, w : the third corner and the box's middle as
    the edge's first corner sees them."""
    return (
        _parted(edge.y * third.z - edge.z * third.y, edge.y * w.z - edge.z * w.y,
                abs(edge.y) * half.z + abs(edge.z) * half.y + error)
        or _parted(edge.z * third.x - edge.x * third.z, edge.z * w.x - edge.x * w.z,
                   abs(edge.z) * half.x + abs(edge.x) * half.z + error)
        or _parted(edge.x * third.y - edge.y * third.x, edge.x * w.y - edge.y * w.x,
                   abs(edge.x) * half.y + abs(edge.y) * half.x + error)
    )


@kernel(inline=True)
def _parted(corner, middle, reach):
    """Whether [middle − reach, middle + reach] leaves out 0 and the corner, and all between them."""
    return middle - reach > max(0.0, corner) or middle + reach < min(0.0, corner)
