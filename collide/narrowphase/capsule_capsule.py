"""Sphere and capsule pairs in closed form: the nearest points of two segments.

A sphere is a capsule whose segment is a point, so one formula answers the three pairs.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.gjk.minkowski_difference import POINT


@kernel
def _square(points, s, t, weights, best):
    """Keep segment parameters s, t if a(s) − b(t) is nearer the origin than the best so far."""
    w00 = (1.0 - s) * (1.0 - t)
    w10 = s * (1.0 - t)
    w01 = (1.0 - s) * t
    w11 = s * t
    x = w00 * points[0] + w10 * points[POINT] + w01 * points[2 * POINT] + w11 * points[3 * POINT]
    y = w00 * points[1] + w10 * points[POINT + 1] + w01 * points[2 * POINT + 1] + w11 * points[3 * POINT + 1]
    z = w00 * points[2] + w10 * points[POINT + 2] + w01 * points[2 * POINT + 2] + w11 * points[3 * POINT + 2]
    square = x * x + y * y + z * z
    if square < best:
        weights[0] = w00
        weights[1] = w10
        weights[2] = w01
        weights[3] = w11
        weights[4] = x
        weights[5] = y
        weights[6] = z
        return square
    return best


@kernel
def _clamp(value, square):
    """value / square within [0, 1]; 0 where the segment is a point."""
    if not value > 0.0:
        return 0.0
    return 1.0 if value >= square else value / square


@kernel
def nearest_of_segments(points, weights):
    """Distance of two segments, from the four differences of their ends.

    points : difference points A0 − B0, A1 − B0, A0 − B1, A1 − B1 (equal ones for a point).
    weights : 10 doubles out: weights of the four, the nearest point of their parallelogram, and the
        unit axis that separates best.

    Returns (distance, lower bound of it from the plane through the nearest point).

    The minimum lies inside both segments or at an end of one of them: all five candidates are
    compared, so parallel and degenerate segments are no special cases.
    """
    ux = points[POINT] - points[0]
    uy = points[POINT + 1] - points[1]
    uz = points[POINT + 2] - points[2]
    vx = points[2 * POINT] - points[0]
    vy = points[2 * POINT + 1] - points[1]
    vz = points[2 * POINT + 2] - points[2]
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    pu = -(points[0] * ux + points[1] * uy + points[2] * uz)
    pv = -(points[0] * vx + points[1] * vy + points[2] * vz)
    best = math.inf
    best = _square(points, _clamp(pu, uu), 0.0, weights, best)
    best = _square(points, _clamp(pu - uv, uu), 1.0, weights, best)
    best = _square(points, 0.0, _clamp(pv, vv), weights, best)
    best = _square(points, 1.0, _clamp(pv - uv, vv), weights, best)
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if square > 0.0:
        # p + s u + t v is nearest the origin where it is along n: the two triple products.
        x = points[0]
        y = points[1]
        z = points[2]
        s = (nx * (z * vy - y * vz) + ny * (x * vz - z * vx) + nz * (y * vx - x * vy)) / square
        t = (nx * (y * uz - z * uy) + ny * (z * ux - x * uz) + nz * (x * uy - y * ux)) / square
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            best = _square(points, s, t, weights, best)
    lower = _bound(points, weights, -math.inf, weights[4], weights[5], weights[6])
    # The same direction to full precision, where the gap is tiny beside the segments: from the
    # segments themselves (see `simplex.across_simplex`).
    if nx * weights[4] + ny * weights[5] + nz * weights[6] < 0.0:
        nx = -nx
        ny = -ny
        nz = -nz
    lower = _bound(points, weights, lower, nx, ny, nz)
    for turn in range(2):
        ex = ux if turn == 0 else vx
        ey = uy if turn == 0 else vy
        ez = uz if turn == 0 else vz
        square = uu if turn == 0 else vv
        if square > 0.0:
            dx = weights[4]
            dy = weights[5]
            dz = weights[6]
            for _ in range(2):
                along = (dx * ex + dy * ey + dz * ez) / square
                dx -= along * ex
                dy -= along * ey
                dz -= along * ez
            lower = _bound(points, weights, lower, dx, dy, dz)
    return math.sqrt(best), lower


@kernel
def _bound(points, weights, lower, dx, dy, dz):
    """The lower bound, raised by the least value of the four differences along d, and its axis with it."""
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length == 0.0:
        return lower
    least = math.inf
    for k in range(4):
        at = POINT * k
        least = min(least, dx * points[at] + dy * points[at + 1] + dz * points[at + 2])
    if not least / length > lower:
        return lower
    weights[7] = dx / length
    weights[8] = dy / length
    weights[9] = dz / length
    return least / length


@kernel
def across_segments(points):
    """A unit vector orthogonal to both segments: the way out where their cores meet."""
    ux = points[POINT] - points[0]
    uy = points[POINT + 1] - points[1]
    uz = points[POINT + 2] - points[2]
    vx = points[2 * POINT] - points[0]
    vy = points[2 * POINT + 1] - points[1]
    vz = points[2 * POINT + 2] - points[2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    square = nx * nx + ny * ny + nz * nz
    if square > 1e-24 * uu * vv:
        length = math.sqrt(square)
        return nx / length, ny / length, nz / length
    if uu < vv:
        ux = vx
        uy = vy
        uz = vz
        uu = vv
    if uu == 0.0:
        return 0.0, 0.0, 1.0
    # Parallel: across the longer one, in the plane of its two largest coordinates.
    if abs(ux) <= abs(uy) and abs(ux) <= abs(uz):
        length = math.sqrt(uy * uy + uz * uz)
        return 0.0, -uz / length, uy / length
    if abs(uy) <= abs(uz):
        length = math.sqrt(ux * ux + uz * uz)
        return uz / length, 0.0, -ux / length
    length = math.sqrt(ux * ux + uy * uy)
    return -uy / length, ux / length, 0.0
