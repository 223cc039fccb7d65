"""Four corners to begin a hull with, and the exact dimension of the cloud.

Each corner is the point farthest from the corners before, so that the hull need not lose this corner again. Plain
doubles choose; whether the choice spans a line, a plane, space is decided exactly, and where the farthest point fails
every other point is tried.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.numerics.orientation import orientation
from collide.numerics.vec3 import cross, dot, norm1, sub, vec3_at

#: Points written behind the cloud: the origin and one on each axis. No plane holds all four.
APICES = 4


@kernel
def first_simplex(cloud, count, corners):
    """The dimension of the cloud; ``corners`` receives dimension + 1 of its points.

    The fourth corner lies below the plane of the others, seen from where they run counter-clockwise. To a flat cloud an
    apex from behind the cloud's points is added: the hull of the cloud is the base of a pyramid.
    """
    points, originals = cloud.scaled, cloud.originals
    first_two(originals, count, corners)
    if corners[0] == corners[1]:
        return 0
    dimension = 1
    low = 0
    high = count
    sign = 0
    while dimension < 3:
        best = farthest(points, low, high, corners, dimension)
        farthest_row = -1
        for t in range(low - 1, high):
            i = best if t < low else t
            corners[dimension + 1] = i
            if dimension == 1:
                corners[3] = corners[0]
            # Off a line: in one of three projections, determinants with an axis as their last row.
            for axis in range(0 if dimension == 1 else -1, 3 if dimension == 1 else 0):
                sign = orientation(cloud, corners[0], corners[1], corners[2], corners[3], axis)
                if sign != 0:
                    farthest_row = i
                    break
            if farthest_row >= 0:
                break
        if farthest_row < 0 and dimension == 1:
            return 1
        if farthest_row < 0:
            write_apices(points, originals, count, cloud.exponent)
            low = count
            high = count + APICES
        else:
            dimension += 1
    if sign > 0:
        corners[1], corners[2] = corners[2], corners[1]
    return 2 if low > 0 else 3


@kernel
def first_two(originals, count, corners):
    """The first and the last point in the order of their coordinates, that of the widest axis first."""
    axis = 0
    widest = -1.0
    for k in range(3):
        low = originals[k]
        high = originals[k]
        for i in range(1, count):
            low = min(low, originals[3 * i + k])
            high = max(high, originals[3 * i + k])
        wide = 0.5 * high - 0.5 * low
        if wide > widest:
            widest = wide
            axis = k
    a = 0
    b = 0
    for i in range(1, count):
        if before(originals, i, a, axis):
            a = i
        if before(originals, b, i, axis):
            b = i
    corners[0] = a
    corners[1] = b


@kernel
def before(points, a, b, axis):
    """Whether point a comes before b in the order of their coordinates, that of ``axis`` first."""
    for k in range(3):
        x = points[3 * a + (axis + k) % 3]
        y = points[3 * b + (axis + k) % 3]
        if x != y:
            return x < y
    return False


@kernel
def farthest(points, low, high, corners, dimension):
    """The point, of those from ``low`` to ``high``, farthest in doubles off the line or plane of the corners."""
    a = vec3_at(points, 3 * corners[0])
    direction = sub(vec3_at(points, 3 * corners[1]), a)
    if dimension == 2:  # the normal of the plane, in place of the line's direction
        direction = cross(direction, sub(vec3_at(points, 3 * corners[2]), a))
    best = low
    size = -1.0
    for i in range(low, high):
        offset = sub(vec3_at(points, 3 * i), a)
        height = abs(dot(direction, offset)) if dimension == 2 else norm1(cross(direction, offset))
        if height > size or (height == size and before(points, best, i, 0)):
            size = height
            best = i
    return best


@kernel
def write_apices(points, originals, count, exponent):
    """The points behind the cloud. Half of the scaled unit is a double in the originals too."""
    unit = math.ldexp(0.5, int(exponent))
    for i in range(APICES):
        for k in range(3):
            points[3 * (count + i) + k] = 0.5 if k == i else 0.0
            originals[3 * (count + i) + k] = unit if k == i else 0.0
