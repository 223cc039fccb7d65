"""Boxes around points cell by cell: what bounds of clouds and meshes are made of, in two passes over the points."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64
from collide.numerics.vec3 import Vec3, put_vec3, vec3_at

#: Cells a side, and words of a box: least and largest corner.
CELLS = 6
BOX = 6


@entry("void(int64, int64, int64)")
def boxes_of_cells(points_at, n, boxes_at):
    """Write the box around the points in each of CELLS³ cells of their own box; infinite, and empty, without a point.

    points : (n, 3).   boxes : (CELLS³, 2, 3) corners.
    """
    points, boxes = view_f64(points_at, 3 * n), view_f64(boxes_at, BOX * CELLS**3)
    nowhere, low, high = Vec3(math.inf, math.inf, math.inf), vec3_at(points, 0), vec3_at(points, 0)
    for cell in range(CELLS**3):
        put_vec3(boxes, BOX * cell, nowhere)
        put_vec3(boxes, BOX * cell + 3, Vec3(-math.inf, -math.inf, -math.inf))
    for i in range(n):
        p = vec3_at(points, 3 * i)
        low = Vec3(min(low.x, p.x), min(low.y, p.y), min(low.z, p.z))
        high = Vec3(max(high.x, p.x), max(high.y, p.y), max(high.z, p.z))
    for i in range(n):
        p = vec3_at(points, 3 * i)
        x, y, z = _cell(p.x, low.x, high.x), _cell(p.y, low.y, high.y), _cell(p.z, low.z, high.z)
        at = BOX * ((x * CELLS + y) * CELLS + z)
        for k in range(at, at + 3):
            coordinate = points[3 * i + k - at]
            boxes[k], boxes[k + 3] = min(boxes[k], coordinate), max(boxes[k + 3], coordinate)


@kernel(inline=True)
def _cell(x, low, high):
    """The number of a coordinate's cell between two; halves, as the difference of two numbers may be infinite."""
    side = 0.5 * high - 0.5 * low
    share = (0.5 * x - 0.5 * low) / (side if side > 0.0 else 1.0)
    return int(min(share * CELLS, CELLS - 1.0))
