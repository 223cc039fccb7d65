"""A ray as a segment of a line: its way through boxes, and a bracket of where it meets a facet."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.mesh.bvh import CENTRE, EXPONENT
from collide.mesh.triangle import normal_of, triangle_at
from collide.narrowphase.facets.filtered_triangles import (
    AMBIGUOUS,
    APART,
    MEETING,
    TINY,
    opposed,
    same_side,
    sign_error,
)
from collide.narrowphase.facets.posed_surfaces import ERROR, M
from collide.narrowphase.facets.probe_parts import clear_slab, put_floats
from collide.numerics.vec3 import (
    Vec3,
    absolute,
    add,
    cross,
    divide,
    dot,
    max_abs,
    put_vec3,
    rotate,
    scale,
    sub,
    vec3_at,
)

#: Where a bracket of t (3) stands among what changes on the way; the least upper bound so far stands before it.
BRACKET = 1

_U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: Boxes of a tree stay within this, in its units, and some.
_EXTENT = 1.01


class RayLine(NamedTuple):
    """A ray's segment from its origin to T times its direction.

    direction : in A's frame, as long as the segment.   error : bound of the error of a coordinate in A's frame.
    In units of the boxes, from the tree's centre:
    start, to_end : origin, and from the origin to the end.   box_error : bound of the error of a point's coordinate.
    size : the largest component of to_end.   first, last : t between which boxes may be met.
    """

    direction: Vec3
    error: float
    start: Vec3
    to_end: Vec3
    box_error: float
    size: float
    first: float
    last: float


@kernel
def line_of(segment):
    """The ray's segment; ``last`` is below ``first`` where it clearly misses all boxes."""
    tree, placing = segment.tree, segment.placing
    unit = math.ldexp(1.0, int(-tree.header[EXPONENT]))
    centre = vec3_at(tree.numbers, CENTRE)
    direction = rotate(placing, M, vec3_at(segment.ends, 3))
    start = scale(unit, sub(vec3_at(segment.corners, 9), centre))
    to_end = scale(unit, direction)
    size = max_abs(to_end)
    error = 8.0 * unit * placing[ERROR] + 2.0**-46 * (max(max_abs(start), max_abs(scale(unit, centre))) + size)
    half = _EXTENT + error
    first, last = _clip(start.x, to_end.x, half, size, 0.0, 1.0)
    first, last = _clip(start.y, to_end.y, half, size, first, last)
    first, last = _clip(start.z, to_end.z, half, size, first, last)
    if not size > 0.0:
        last = -1.0
    return RayLine(direction, placing[ERROR], start, to_end, error, size, first, last)


@kernel(inline=True)
def _clip(start, step, half, size, first, last):
    """(first, last) t of a line within −half … half along an axis and within the given bounds; last is −1 for no t."""
    if abs(step) > 2.0**-60 * size:
        near = (-half - start) / step
        far = (half - start) / step
        if step < 0.0:
            near, far = far, near
        # A quotient is off by its rounding only: far less than what ``half`` is too wide.
        return max(first, near), min(last, far)
    return first, (-1.0 if abs(start) > half + abs(step) else last)


@kernel
def set_line_probe(line, frame, probe):
    """The axes across the line, and its box, as the probe of the tree's boxes."""
    along = divide(line.to_end, line.size)
    put_floats(frame, 0, Vec3(0.0, -along.z, along.y))
    put_floats(frame, 3, Vec3(along.z, 0.0, -along.x))
    put_floats(frame, 6, Vec3(-along.y, along.x, 0.0))
    centre = add(line.start, scale(0.5 * (line.first + line.last), line.to_end))
    put_floats(probe, 6, cross(centre, along))
    # Floats: 2^-24 of terms, at most 8 of them; the line is off by its error along each of two axes.
    reach = 2.0 * line.box_error + _FLOAT_ERROR * (2.0 + 2.0 * max_abs(centre)) + 2.0**-110
    put_floats(probe, 9, Vec3(reach, reach, reach))
    clear_slab(probe)
    set_ends(line, line.last, probe)


@kernel(inline=True)
def set_ends(line, last, probe):
    """The box around the line from where it may begin to meet boxes to t = ``last``, as the probe's."""
    centre = add(line.start, scale(0.5 * (line.first + last), line.to_end))
    half = absolute(scale(0.5 * (last - line.first), line.to_end))
    put_floats(probe, 0, centre)
    put_floats(
        probe, 3,
        Vec3(_enlarged(line, centre.x, half.x), _enlarged(line, centre.y, half.y), _enlarged(line, centre.z, half.z)),
    )


@kernel(inline=True)
def _enlarged(line, centre, half):
    return half + line.box_error + _FLOAT_ERROR * (abs(centre) + half + 1.0) + 2.0**-110


@kernel
def bracket(triangles, a, corners, line, out):
    """Bracket of t of the crossing of a facet's plane, in out[BRACKET …]; False where doubles cannot tell.

    Bounds as in `filtered_triangles.py`: with edges up to L, sides of points at distance w: L² (8E + 64 u w).
    """
    triangle = triangle_at(triangles, a)
    n = normal_of(triangle)
    w = sub(triangle.p, vec3_at(corners, 9))
    side = dot(n, w)
    slope = dot(n, line.direction)
    edge = max(max_abs(sub(triangle.q, triangle.p)), max_abs(sub(triangle.r, triangle.p)))
    square = edge * edge
    side_error = square * (8.0 * line.error + 64.0 * _U * max_abs(w)) + TINY
    slope_error = square * (8.0 * line.error + 64.0 * _U * max_abs(line.direction)) + TINY
    if not abs(slope) > 2.0 * slope_error:
        return False
    t = side / slope
    # |side'/slope' − side/slope| ≤ (δside + |t| δslope) / (|slope| − δslope), and some for the rounding here.
    error = (side_error + abs(t) * slope_error) / (abs(slope) - slope_error) * (1.0 + 2.0**-40) + abs(t) * 2.0**-50
    put_vec3(out, BRACKET, Vec3(t - error, t, t + error))
    return True


@kernel
def meets_facet(triangles, a, corners, line, out):
    """APART, MEETING or AMBIGUOUS by doubles, for the ray and one facet; where MEETING, out is the bracket of t."""
    origin = vec3_at(corners, 9)
    p = sub(vec3_at(triangles, a), origin)
    q = sub(vec3_at(triangles, a + 3), origin)
    r = sub(vec3_at(triangles, a + 6), origin)
    d = line.direction
    limit = sign_error(max(max_abs(p), max_abs(q), max_abs(r), max_abs(d)), line.error)
    x = dot(cross(p, q), d)
    y = dot(cross(q, r), d)
    if opposed(x, y, limit):
        return APART
    z = dot(cross(r, p), d)
    if opposed(x, z, limit) or opposed(y, z, limit):
        return APART
    if not bracket(triangles, a, corners, line, out):
        return AMBIGUOUS
    if out[BRACKET + 2] < 0.0 or out[BRACKET] > 1.0:
        return APART
    certain = same_side(Vec3(x, y, z), limit) and out[BRACKET] > 0.0 and out[BRACKET + 2] < 1.0
    return MEETING if certain else AMBIGUOUS


@kernel
def bracket_by_corners(triangles, a, corners, line, out):
    """Bracket of t by the facet's corners, projected onto the ray: for facets known to be met."""
    square = dot(line.direction, line.direction)
    size = max_abs(line.direction)
    low = math.inf
    high = -math.inf
    far = 0.0
    for k in range(a, a + 9, 3):
        w = sub(vec3_at(triangles, k), vec3_at(corners, 9))
        low = min(low, dot(w, line.direction))
        high = max(high, dot(w, line.direction))
        far = max(far, max_abs(w))
    # Corners are off by E + u far, the direction by E: far more than enough for both, and the square.
    error = (8.0 * line.error + 64.0 * _U * (far + size)) * (size + far) * (1.0 + (far + size) / size)
    lower = (low - error) / square * (1.0 - math.copysign(2.0**-40, low - error))
    upper = (high + error) / square * (1.0 + math.copysign(2.0**-40, high + error))
    put_vec3(out, BRACKET, Vec3(lower, 0.5 * lower + 0.5 * upper, upper))
