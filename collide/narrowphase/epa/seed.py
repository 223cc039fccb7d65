"""Where EPA begins: four points of A ⊖ B that span it well, or the news that it is flat.

Never the last simplex of GJK where that is thin: from a simplex as thin as touching bodies leave it, a prototype
took 27 wrong depths in 9,264 lattice poses.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.narrowphase.bounds import EPA_VERTICES
from collide.narrowphase.minkowski import POINT, copy_point, difference_point


@kernel
def extremal_tetrahedron(pair, points, ids, error):
    """Points 0..3 become an extremal tetrahedron; returns (rank found, n) with n across what is flat."""
    spare = EPA_VERTICES
    least = math.inf
    most = -math.inf
    # The farthest pair among extremes of the axes, by the axis of greatest width.
    for axis in range(3):
        d0 = 1.0 if axis == 0 else 0.0
        d1 = 1.0 if axis == 1 else 0.0
        d2 = 1.0 if axis == 2 else 0.0
        difference_point(pair, points, ids, spare, d0, d1, d2)
        difference_point(pair, points, ids, spare + 1, -d0, -d1, -d2)
        width = points[POINT * spare + axis] - points[POINT * (spare + 1) + axis]
        if width > most:
            most = width
            copy_point(points, ids, spare, 0)
            copy_point(points, ids, spare + 1, 1)
        least = min(least, width)
    if most <= 8.0 * error:
        return 0, 0.0, 0.0, 1.0
    ex = points[POINT] - points[0]
    ey = points[POINT + 1] - points[1]
    ez = points[POINT + 2] - points[2]
    ux, uy, uz = _across(ex, ey, ez)
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex /= length
    ey /= length
    ez /= length
    farthest = -1.0
    nx = ux
    ny = uy
    nz = uz
    for turn in range(4):
        if turn > 0:  # a quarter turn about the edge, from u to e × u and on to their opposites
            ux, uy, uz = ey * uz - ez * uy, ez * ux - ex * uz, ex * uy - ey * ux
        difference_point(pair, points, ids, spare, ux, uy, uz)
        qx = points[POINT * spare] - points[0]
        qy = points[POINT * spare + 1] - points[1]
        qz = points[POINT * spare + 2] - points[2]
        cx = ey * qz - ez * qy
        cy = ez * qx - ex * qz
        cz = ex * qy - ey * qx
        height = math.sqrt(cx * cx + cy * cy + cz * cz)
        if height > farthest:
            farthest = height
            copy_point(points, ids, spare, 2)
            nx = cx
            ny = cy
            nz = cz
    if farthest <= 8.0 * error:
        ux, uy, uz = _across(ex, ey, ez)
        return 1, ux, uy, uz
    nx /= farthest
    ny /= farthest
    nz /= farthest
    difference_point(pair, points, ids, 3, nx, ny, nz)
    difference_point(pair, points, ids, spare, -nx, -ny, -nz)
    above = _height(points, 3, nx, ny, nz)
    below = -_height(points, spare, nx, ny, nz)
    if below > above:
        copy_point(points, ids, spare, 3)
    if above <= 8.0 * error and below <= 8.0 * error:
        return 2, nx, ny, nz
    return 3, nx, ny, nz


@kernel
def _height(points, k, nx, ny, nz):
    at = POINT * k
    return (points[at] - points[0]) * nx + (points[at + 1] - points[1]) * ny + (points[at + 2] - points[2]) * nz


@kernel
def _across(x, y, z):
    """A unit vector orthogonal to (x, y, z), made from its two largest coordinates."""
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        length = math.sqrt(y * y + z * z)
        return 0.0, -z / length, y / length
    if abs(y) <= abs(z):
        length = math.sqrt(x * x + z * z)
        return z / length, 0.0, -x / length
    length = math.sqrt(x * x + y * y)
    return -y / length, x / length, 0.0
