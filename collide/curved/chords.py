"""The chord of a line in a convex set, in closed form: balls, capsules, boxes, half-spaces; intersections, unions.

The chords of cylinders, cones and ellipsoids stand in the files of these kinds.

A chord is [first, last], each end inside a proven bracket. Each slab and each quadric is cut with the line, and the
intervals with each other, as E. Haines cuts the planes of a polyhedron ("Fast ray–convex polyhedron intersection",
Graphics Gems II, 1991). Quadrics are evaluated from the point of the line nearest their middle, where no large numbers
cancel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, add, cross, dot, norm, scale, sub

#: What is said of a line and a set: it misses it; meets it; doubles cannot tell.
MISSED, MET, UNCLEAR = range(3)

ROUNDING = 2.0**-49


class Line(NamedTuple):
    """{origin + t direction} in the frame of a shape.

    length : |direction|.   error : bound of the rounding of a point of the line near the shape [m].
    """

    origin: Vec3
    direction: Vec3
    length: float
    error: float


class Chord(NamedTuple):
    """The common points of a line and a convex set: t from first to last.

    state : MISSED, MET or UNCLEAR.   first_lower ≤ first ≤ first_upper, last_lower ≤ last ≤ last_upper : brackets.
    first_side, last_side : the piece of the surface at each end: 0 round the side, 1 below, 2 above.
    """

    state: int
    first_lower: float
    first: float
    first_upper: float
    last_lower: float
    last: float
    last_upper: float
    first_side: int
    last_side: int


@kernel(inline=True)
def nothing():
    return Chord(MISSED, math.inf, math.inf, math.inf, -math.inf, -math.inf, -math.inf, -1, -1)


@kernel(inline=True)
def everything(state):
    """The whole line."""
    return Chord(state, -math.inf, -math.inf, -math.inf, math.inf, math.inf, math.inf, -1, -1)


@kernel(inline=True)
def common(a, b):
    """The chord of the intersection of two sets."""
    if a.state == MISSED or b.state == MISSED:
        return nothing()
    first_lower, first_upper = max(a.first_lower, b.first_lower), max(a.first_upper, b.first_upper)
    last_lower, last_upper = min(a.last_lower, b.last_lower), min(a.last_upper, b.last_upper)
    if first_lower > last_upper:
        return nothing()
    met = first_upper <= last_lower and a.state == MET and b.state == MET
    return Chord(
        MET if met else UNCLEAR, first_lower, max(a.first, b.first), first_upper, last_lower, min(a.last, b.last),
        last_upper, a.first_side if a.first >= b.first else b.first_side,
        a.last_side if a.last <= b.last else b.last_side,
    )


@kernel(inline=True)
def together(a, b):
    """The chord of the union of two sets that is convex."""
    if a.state == MISSED:
        return b
    if b.state == MISSED:
        return a
    state = MET if a.state == MET or b.state == MET else UNCLEAR
    # What may be no chord bounds nothing inwards.
    counts_a, counts_b = a.state == MET or state == UNCLEAR, b.state == MET or state == UNCLEAR
    first_upper = min(a.first_upper if counts_a else math.inf, b.first_upper if counts_b else math.inf)
    last_lower = max(a.last_lower if counts_a else -math.inf, b.last_lower if counts_b else -math.inf)
    return Chord(
        state, min(a.first_lower, b.first_lower), min(a.first, b.first), first_upper, last_lower, max(a.last, b.last),
        max(a.last_upper, b.last_upper), a.first_side if a.first <= b.first else b.first_side,
        a.last_side if a.last >= b.last else b.last_side,
    )


@kernel
def ball_chord(m, g, radius, error, side):
    """Of |m + t g| ≤ radius; error : of a point m + t g near the chord."""
    square = dot(g, g)
    if not square > 0.0:
        return everything(UNCLEAR)
    middle = -dot(m, g) / square
    c = add(m, scale(middle, g))
    beside = dot(c, c)
    rest = radius * radius - beside
    slack = (2.0 * math.sqrt(beside) + error) * error + ROUNDING * radius * radius
    if rest < -slack:
        return nothing()
    inner = math.sqrt(max(rest - slack, 0.0) / square)
    half = math.sqrt(max(rest, 0.0) / square)
    outer = math.sqrt(max(rest + slack, 0.0) / square)
    off = 2.0 * error / math.sqrt(square) + ROUNDING * (abs(middle) + outer)
    return Chord(
        MET if rest > slack else UNCLEAR, middle - outer - off, middle - half, middle - inner + off,
        middle + inner - off, middle + half, middle + outer + off, side, side,
    )


@kernel(inline=True)
def slab_chord(origin, step, low, high, line, low_side, high_side):
    """Of low ≤ origin + t step ≤ high."""
    if abs(step) <= 2.0**-46 * line.length:
        # Along the slab: as far as the shape reaches, the step moves nothing by more than the error.
        error = line.error + abs(step) / line.length * (abs(origin) + (high - low))
        if origin < low - error or origin > high + error:
            return nothing()
        return everything(MET if low + error < origin < high - error else UNCLEAR)
    near = (low - origin) / step
    far = (high - origin) / step
    near_off = line.error / abs(step) + ROUNDING * abs(near)
    far_off = line.error / abs(step) + ROUNDING * abs(far)
    if step > 0.0:
        return Chord(
            MET, near - near_off, near, near + near_off, far - far_off, far, far + far_off, low_side, high_side
        )
    return Chord(MET, far - far_off, far, far + far_off, near - near_off, near, near + near_off, high_side, low_side)


@kernel(inline=True)
def halfspace_chord(line, normal, offset, error):
    """Of normal·x ≤ offset; error : of a point's height, in units of |normal|."""
    length = norm(normal)
    height = (dot(normal, line.origin) - offset) / length
    pace = dot(normal, line.direction) / length
    if abs(pace) <= 2.0**-46 * line.length:
        if height > error:
            return everything(UNCLEAR) if pace != 0.0 else nothing()
        return everything(MET if height < -error and pace == 0.0 else UNCLEAR)
    t = -height / pace
    off = error / abs(pace) + 2.0**-46 * line.length / abs(pace) * abs(t)
    if pace < 0.0:
        return Chord(MET, t - off, t, t + off, math.inf, math.inf, math.inf, 0, -1)
    return Chord(MET, -math.inf, -math.inf, -math.inf, t - off, t, t + off, -1, 0)


@kernel
def capsule_chord(line, start, end, radius):
    """Of the points no farther than ``radius`` from the segment between two points."""
    m = sub(line.origin, start)
    axis = sub(end, start)
    square = dot(axis, axis)
    ends = together(
        ball_chord(m, line.direction, radius, line.error, 1),
        ball_chord(sub(line.origin, end), line.direction, radius, line.error, 2),
    )
    if not square > 0.0:
        return ends
    length = math.sqrt(square)
    unit = scale(1.0 / length, axis)
    slab = slab_chord(dot(m, unit), dot(line.direction, unit), 0.0, length, line, 1, 2)
    across, step = cross(m, unit), cross(line.direction, unit)
    return together(ends, clipped_cylinder(slab, across, step, radius, line, 0))


@kernel(inline=True)
def clipped_cylinder(slab, across, step, radius, line, side):
    """A cylinder of endless length, |across + t step| ≤ radius, cut off by a slab.

    A line within the cylinder at both ends of the slab is within in between; a line outside at both ends stays outside
    where the way between the ends is too short to get in. A line along the axis needs no more than these two tests.
    """
    if slab.state == MET and slab.first > -math.inf:
        a, b = add(across, scale(slab.first, step)), add(across, scale(slab.last, step))
        off = (slab.first_upper - slab.first_lower + slab.last_upper - slab.last_lower) * norm(step)
        if max(norm(a), norm(b)) + off < radius * (1.0 - ROUNDING) - 2.0 * line.error:
            return slab
        if norm(a) - norm(sub(b, a)) - off > radius * (1.0 + ROUNDING) + 2.0 * line.error:
            return nothing()
    return common(ball_chord(across, step, radius, 2.0 * line.error, side), slab)


@kernel
def box_chord(line, half):
    """Of a box along the axes; sides 1 and 2 are those across x, 3 and 4 across y, 5 and 6 across z."""
    o, d = line.origin, line.direction
    chord = slab_chord(o.x, d.x, -half.x, half.x, line, 1, 2)
    chord = common(chord, slab_chord(o.y, d.y, -half.y, half.y, line, 3, 4))
    return common(chord, slab_chord(o.z, d.z, -half.z, half.z, line, 5, 6))
