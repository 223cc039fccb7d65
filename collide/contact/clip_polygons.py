"""Convex polygons in a plane clipped against each other, with the sides behind each corner of the result.

I. E. Sutherland, G. W. Hodgman, "Reentrant polygon clipping" (1974). Every side of the result lies on a side of one of
the two polygons, and carries its number: a corner between two sides of the same polygon is a corner of the polygon, a
corner between sides of both is their crossing.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel

#: Triangles, and other faces of less than this part of their length's square, are clipped at their tips, too.
_THIN = 0.25


class Tips(NamedTuple):
    """The two corners of a triangle or a thin face farthest apart, else −1, and the unit vector from second to first.

    Sides moved out by a tolerance meet far beyond a sharp tip: by the tolerance over the sine of half its angle.
    """

    first: int
    second: int
    du: float
    dv: float


class Clipped(NamedTuple):
    """A polygon in the making: view of u, v of each corner, and of the number of the side begun at the corner.

    Sides 0, 1, 2, … are A's; −1, −2, … the first, second, … of B.
    """

    points: Any
    sides: Any


@kernel(inline=True)
def corner_of_b(face, k):
    """Which corner of B's face is number k anticlockwise along the normal of A: B's is seen from behind."""
    return face.n - 1 - k


@kernel(inline=True)
def _square_between(face, i, j):
    du, dv = face.corners[3 * i] - face.corners[3 * j], face.corners[3 * i + 1] - face.corners[3 * j + 1]
    return du * du + dv * dv


@kernel(inline=True)
def _farthest_from(face, corner):
    farthest, square = corner, 0.0
    for k in range(face.n):
        away = _square_between(face, k, corner)
        if away > square:
            farthest, square = k, away
    return farthest


@kernel
def _tips_of(face):
    """The `Tips` of a face."""
    area = 0.0
    u0, v0 = face.corners[0], face.corners[1]
    for k in range(1, face.n - 1):
        u, v = face.corners[3 * k] - u0, face.corners[3 * k + 1] - v0
        area += u * (face.corners[3 * k + 4] - v0) - v * (face.corners[3 * k + 3] - u0)
    first = _farthest_from(face, 0)
    second = _farthest_from(face, first)
    square = _square_between(face, first, second)
    if square == 0.0 or (face.n > 3 and abs(area) > _THIN * square):
        return Tips(-1, -1, 0.0, 0.0)
    length = math.sqrt(square)
    return Tips(
        first, second, (face.corners[3 * first] - face.corners[3 * second]) / length,
        (face.corners[3 * first + 1] - face.corners[3 * second + 1]) / length,
    )


@kernel
def clip_polygons(face_a, face_b, tolerance, first, second):
    """The overlap of two faces seen along the normal, counter-clockwise; how many corners, and whether in ``second``.

    tolerance : corners so far outside count as inside [m].   first, second : `Clipped` with room for as many corners as
    both faces have together.
    """
    n = face_b.n
    for k in range(n):
        corner = 3 * corner_of_b(face_b, k)
        first.points[2 * k] = face_b.corners[corner]
        first.points[2 * k + 1] = face_b.corners[corner + 1]
        first.sides[k] = -1 - k
    source, target = first, second
    in_second = False
    for side in range(face_a.n):
        following = 3 * (side + 1 if side + 1 < face_a.n else 0)
        u, v = face_a.corners[3 * side], face_a.corners[3 * side + 1]
        du, dv = face_a.corners[following] - u, face_a.corners[following + 1] - v
        length = math.sqrt(du * du + dv * dv)
        if length == 0.0:
            continue
        n = _clip_side(side, u, v, du / length, dv / length, tolerance, source, n, target)
        source, target = target, source
        in_second = not in_second
        if n == 0:
            return 0, in_second
    tips = _tips_of(face_a)
    if tips.first < 0:
        return n, in_second
    for k in range(2):  # back in the buffer it is in
        tip, sense = (tips.first, 1.0) if k == 0 else (tips.second, -1.0)
        u, v = face_a.corners[3 * tip], face_a.corners[3 * tip + 1]
        n = _clip_side(tip, u, v, -sense * tips.dv, sense * tips.du, tolerance, source, n, target)
        source, target = target, source
        if n == 0:
            break
    return n, in_second


@kernel(inline=True)
def _clip_side(side, u, v, du, dv, tolerance, source, n, target):
    """Keep what lies left of a line through (u, v) along the unit vector (du, dv); how many corners that has."""
    n_out = 0
    begin = n - 1
    ahead = du * (source.points[2 * begin + 1] - v) - dv * (source.points[2 * begin] - u)
    for k in range(n):
        u0, v0, height = source.points[2 * begin], source.points[2 * begin + 1], ahead
        tag = source.sides[begin]
        u1, v1 = source.points[2 * k], source.points[2 * k + 1]
        ahead = du * (v1 - v) - dv * (u1 - u)
        was_in, is_in = height >= -tolerance, ahead >= -tolerance
        if was_in != is_in:
            # One end may lie outside by less than the tolerance: the crossing is that end then.
            t = min(max(height / (height - ahead), 0.0), 1.0)
            target.points[2 * n_out] = u0 + t * (u1 - u0)
            target.points[2 * n_out + 1] = v0 + t * (v1 - v0)
            target.sides[n_out] = side if was_in else tag
            n_out += 1
        if is_in:
            target.points[2 * n_out] = u1
            target.points[2 * n_out + 1] = v1
            target.sides[n_out] = source.sides[k]
            n_out += 1
        begin = k
    return n_out


@kernel
def clip_segment(face, is_b, u0, v0, u1, v1, tolerance):
    """Where the segment from (u0, v0) to (u1, v1) lies over a face: (least and greatest parameter, side at each end).

    Sides are −1 where the segment itself ends there. Empty where the least is above the greatest.
    M. Cyrus, J. Beck, "Generalized two- and three-dimensional clipping" (1978).
    """
    low, high = 0.0, 1.0
    low_side, high_side = -1, -1
    sense = -1.0 if is_b else 1.0  # B's corners run clockwise here
    tips = _tips_of(face)
    for k in range(face.n if tips.first < 0 else face.n + 2):
        side = k if k < face.n else tips.first if k == face.n else tips.second
        u, v = face.corners[3 * side], face.corners[3 * side + 1]
        if k < face.n:
            following = 3 * (side + 1 if side + 1 < face.n else 0)
            du, dv = sense * (face.corners[following] - u), sense * (face.corners[following + 1] - v)
        else:
            du, dv = (-tips.dv, tips.du) if k == face.n else (tips.dv, -tips.du)
        length = math.sqrt(du * du + dv * dv)
        if length == 0.0:
            continue
        begin = (du * (v0 - v) - dv * (u0 - u)) / length
        end = (du * (v1 - v) - dv * (u1 - u)) / length
        if begin < -tolerance and end < -tolerance:
            return 1.0, 0.0, -1, -1
        if begin < -tolerance:
            t = min(max(begin / (begin - end), 0.0), 1.0)
            if t > low:
                low, low_side = t, side
        elif end < -tolerance:
            t = min(max(begin / (begin - end), 0.0), 1.0)
            if t < high:
                high, high_side = t, side
    return low, high, low_side, high_side
