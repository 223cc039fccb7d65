"""The gap of two cores of points to its last digit, from the feature that GJK found, for eight pairs at a time.

In double-doubles: a direction across the feature, whose least height over A ⊖ B is a lower bound of the distance, and
the heights of the feature's own points, whose greatest is an upper bound if the foot of the origin lies within
the feature (the Karush-Kuhn-Tucker conditions of the nearest point). Nearly always they are the same number.
Where they are not, doubles stopped at the wrong one of several nearly level features: that is left to integers.

The feature is its first point w₀ = R_A a₀ + p_A − R_B b₀ − p_B and the edges to its others. Other points have, as a rule,
a vertex of one body in common with the first, so that an edge is R (v − v₀) of one body: half the work of a point,
and good to its own length instead of the pair's size.

Error of an edge: v − v₀ is exact, as a double-double; a coordinate is three terms, whose lower parts are at most
4u·ΣT and rounded eight times: 32u²·ΣT, across three coordinates less than 2⁻⁹⁹ S, as |v − v₀| ≤ 2ρ. Along a
direction it is good to 2⁻¹⁰¹·2S besides. With the height of w₀, 2⁻⁹⁸ S and 2⁻¹⁰⁰ S (`precise_pair.py`), the
height of a point is off by less than `HEIGHT_ERROR`.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.kernels.lanes import select
from collide.narrowphase.gap.precise_pair import (
    FINE,
    HEIGHT_ERROR,
    SLOP_ERROR,
    across_edge,
    add_turned,
    fine_edge,
    fine_height,
    fine_length,
    larger,
    normal_of_edges,
    smaller,
)
from collide.numerics.double_double import add, bracket, divide, loose_product
from collide.numerics.error_free import two_product, two_sum

#: Rounding of a weight's numerator in doubles, of points and edges rounded once, with a dozen roundings to spare.
_WEIGHT_ERROR = 64 * 2.0**-53

# A question, one number each of eight pairs: both poses (R row by row, then p) and what composed ones are more than
# that; the first point's vertices a and b; a power of two that brings the pair to a size of about 1, the slop
# and error of the pair, both radii, 1 where the nearest point lies in the parallelogram of two segments, and two edges.
POSE_A, POSE_B, LOW_A, LOW_B, CORNER_A, CORNER_B, SCALE, SLOP, ERROR, RADIUS_A, RADIUS_B, PARALLELOGRAM, EDGES = (
    0, 12, 24, 36, 48, 51, 54, 55, 56, 57, 58, 59, 60
)  # fmt: skip
# An edge is R (head − tail) of a body, or the sum of one of A and one of B.
HEAD, TAIL, OF_A = 0, 3, 6
PART = 7
EDGE = 2 * PART
QUESTION = EDGES + 2 * EDGE

# An answer: 1 where proven, as far as the feature itself says; the core distance, the spread of the feature's heights and
# the direction's length, all scaled; the gap (double-double), its bracket and the double nearest; the unit vector
# from B to A; the cores' points; that vector in either body, and how low other vertices must not be along it.
(
    PROVEN, CORE, SPREAD, LENGTH, GAP, GAP_LOW, GAP_LOWER, GAP_NEAREST, GAP_UPPER, UNIT, POINT_A, POINT_B, ALONG_A, ALONG_B,
    LIMIT_A, LIMIT_B,
) = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 15, 18, 21, 24, 25)  # fmt: skip
ANSWER = 26

#: Numbers of a feature: the first point and two edges.
FEATURE = 3 * FINE


@kernel(inline=True)
def _within_edge(x, y, z, ex, ey, ez):
    """(whether the foot of the origin on the line along e from (x, y, z) certainly lies on e, its share of e)."""
    w = abs(x) + abs(y) + abs(z)
    e = abs(ex) + abs(ey) + abs(ez)
    square = ex * ex + ey * ey + ez * ez
    along = -(x * ex + y * ey + z * ez)
    margin = _WEIGHT_ERROR * w * e
    some = square > 0.0
    share = select(some, smaller(larger(along / select(some, square, 1.0), 0.0), 1.0), 0.0)
    return (margin < along) & (along < square - margin), share


@kernel(inline=True)
def _within_face(x, y, z, ex, ey, ez, fx, fy, fz, parallelogram):
    """(whether the foot of the origin certainly lies between edges e and f from (x, y, z), its shares of both)."""
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    square = nx * nx + ny * ny + nz * nz
    beta = -(nx * (y * fz - z * fy) + ny * (z * fx - x * fz) + nz * (x * fy - y * fx))
    gamma = -(nx * (ey * z - ez * y) + ny * (ez * x - ex * z) + nz * (ex * y - ey * x))
    w = abs(x) + abs(y) + abs(z)
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    # A product of four lengths, each as good as doubles are, and the normal off by as much of |e||f|.
    margin = _WEIGHT_ERROR * w * larger(e, f) * e * f
    farther = select(parallelogram, larger(beta, gamma), beta + gamma)
    some = square > 0.0
    divisor = select(some, square, 1.0)
    first = select(some, larger(beta / divisor, 0.0), 0.0)
    second = select(some, larger(gamma / divisor, 0.0), 0.0)
    total = select(parallelogram, 1.0, larger(first + second, 1.0))
    return (beta > margin) & (gamma > margin) & (farther < square - margin), first / total, second / total


@kernel
def weigh_foot(fine, n, parallelogram, weights):
    """Weights of n ≤ 3 points at the foot of the origin, brought among the points; whether it certainly lies there.

    Edges are taken finely and rounded once, so that weights are good to u·|w| over the feature's length, and the
    foot to a few ulps of the pair's size.
    """
    weights[0] = 1.0
    weights[1] = 0.0
    weights[2] = 0.0
    if n == 1:
        return True
    ex, _, ey, _, ez, _ = fine_edge(fine, 1, 0)
    if n == 2:
        inside, weights[1] = _within_edge(fine[0], fine[2], fine[4], ex, ey, ez)
        weights[0] = 1.0 - weights[1]
        return inside
    fx, _, fy, _, fz, _ = fine_edge(fine, 2, 0)
    inside, weights[1], weights[2] = _within_face(fine[0], fine[2], fine[4], ex, ey, ez, fx, fy, fz, parallelogram)
    weights[0] = 1.0 - weights[1] - weights[2]
    return inside


@kernel
def _set_first_point(room, feature, composed):
    """w₀ into ``feature``, scaled; good to 2⁻⁹⁸ S as points of `precise_pair.py` are."""
    for axis in range(3):
        r = POSE_A + 3 * axis
        s = POSE_B + 3 * axis
        ax = room[CORNER_A]
        ay = room[CORNER_A + 1]
        az = room[CORNER_A + 2]
        bx = room[CORNER_B]
        by = room[CORNER_B + 1]
        bz = room[CORNER_B + 2]
        total, rest = two_sum(room[POSE_A + 9 + axis], -room[POSE_B + 9 + axis])
        total, rest = add_turned(total, rest, room[r], room[r + 1], room[r + 2], ax, ay, az)
        total, rest = add_turned(total, rest, room[s], room[s + 1], room[s + 2], -bx, -by, -bz)
        if composed:
            r += LOW_A - POSE_A
            s += LOW_B - POSE_B
            rest += room[LOW_A + 9 + axis] - room[LOW_B + 9 + axis]
            rest += room[r] * ax + room[r + 1] * ay + room[r + 2] * az
            rest -= room[s] * bx + room[s + 1] * by + room[s + 2] * bz
        total, rest = two_sum(total, rest)
        feature[2 * axis] = total * room[SCALE]
        feature[2 * axis + 1] = rest * room[SCALE]


@kernel
def _set_edge(room, at, feature, to, part, composed):
    """R (head − tail) of the part of an edge that stands at ``at``, scaled; the second part of two is added."""
    of_a = room[at + OF_A] > 0.5
    x, x_low = two_sum(room[at + HEAD], -room[at + TAIL])
    y, y_low = two_sum(room[at + HEAD + 1], -room[at + TAIL + 1])
    z, z_low = two_sum(room[at + HEAD + 2], -room[at + TAIL + 2])
    for axis in range(3):
        k = 3 * axis
        rx = select(of_a, room[POSE_A + k], room[POSE_B + k])
        ry = select(of_a, room[POSE_A + k + 1], room[POSE_B + k + 1])
        rz = select(of_a, room[POSE_A + k + 2], room[POSE_B + k + 2])
        total, rest = two_product(rx, x)
        term, e = two_product(ry, y)
        total, f = two_sum(total, term)
        rest += e + f
        term, e = two_product(rz, z)
        total, f = two_sum(total, term)
        rest += (e + f) + (rx * x_low + ry * y_low + rz * z_low)
        if composed:
            rest += select(of_a, room[LOW_A + k], room[LOW_B + k]) * x
            rest += select(of_a, room[LOW_A + k + 1], room[LOW_B + k + 1]) * y
            rest += select(of_a, room[LOW_A + k + 2], room[LOW_B + k + 2]) * z
        total, rest = two_sum(total, rest)
        total *= room[SCALE]
        rest *= room[SCALE]
        if part > 0:
            total, rest = add(feature[to + 2 * axis], feature[to + 2 * axis + 1], total, rest)
        feature[to + 2 * axis] = total
        feature[to + 2 * axis + 1] = rest


@kernel(inline=True)
def unsure_of(spread, excess, length, slop, scale):
    """How far a scaled core distance may be off: level pairs of the feature's vertices, and the foot, are within the
    spread of the first point's height; and so is what lies beyond it by the excess."""
    return 3.0 * (spread + abs(excess)) / length + HEIGHT_ERROR + SLOP_ERROR * slop * scale


@kernel
def polish_gaps(room, n, parts, composed, feature, direction, answer):
    """The distances of eight pairs of cores of points that are apart, from the n ≤ 3 points nearest the origin.

    room : QUESTION numbers, each the same number of eight pairs.   parts : of an edge, 1 or 2.   composed : whether low
    parts of poses are there.   feature, direction, answer : FEATURE, FINE, ANSWER numbers, out.

    What other vertices lie as low is for the caller to see (`tied_vertices.py`).
    """
    _set_first_point(room, feature, composed)
    for k in range(1, n):
        for part in range(parts):
            _set_edge(room, EDGES + EDGE * (k - 1) + PART * part, feature, FINE * k, part, composed)
    x = feature[0]
    x_low = feature[1]
    y = feature[2]
    y_low = feature[3]
    z = feature[4]
    z_low = feature[5]
    proven = room[SCALE] > 0.0
    first = 0.0 * x
    second = first
    if n > 1:
        ex = feature[6]
        ex_low = feature[7]
        ey = feature[8]
        ey_low = feature[9]
        ez = feature[10]
        ez_low = feature[11]
        if n == 2:
            proven, first = _within_edge(x, y, z, ex, ey, ez)
            x, x_low, y, y_low, z, z_low = across_edge(x, x_low, y, y_low, z, z_low, ex, ex_low, ey, ey_low, ez, ez_low)
        else:
            fx = feature[12]
            fy = feature[14]
            fz = feature[16]
            proven, first, second = _within_face(x, y, z, ex, ey, ez, fx, fy, fz, room[PARALLELOGRAM] > 0.5)
            x, x_low, y, y_low, z, z_low = normal_of_edges(
                ex, ex_low, ey, ey_low, ez, ez_low, fx, feature[13], fy, feature[15], fz, feature[17]
            )
    # Roughly, for the sign alone: a gap between directions that doubles cannot tell apart is not proven.
    turn = select(feature[0] * x + feature[2] * y + feature[4] * z < 0.0, -1.0, 1.0)
    direction[0] = turn * x
    direction[1] = turn * x_low
    direction[2] = turn * y
    direction[3] = turn * y_low
    direction[4] = turn * z
    direction[5] = turn * z_low
    _measure(room, n, feature, direction, answer, proven)
    _set_witnesses(room, n, parts, first, second, answer)
    if parts == 1:
        _set_limits(room, n, answer)


@kernel(inline=True)
def _measure(room, n, feature, direction, answer, proven):
    """Everything of an answer that is a number along the direction."""
    length, length_low = fine_length(direction)
    height, height_low = fine_height(feature, 0, direction)
    some = length > 0.0
    length = select(some, length, 1.0)
    spread = 0.0 * length
    for k in range(1, n):
        at = FINE * k
        slope, rest = loose_product(
            feature[at], feature[at + 1], feature[at + 2], feature[at + 3], feature[at + 4], feature[at + 5],
            direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
        )  # fmt: skip
        spread = larger(spread, abs(slope + rest))
    distance, distance_low = divide(height, height_low, length, length_low)
    unsure = unsure_of(spread, 0.0, length, room[SLOP], room[SCALE])
    answer[PROVEN] = select(proven & some & (unsure < 2.0**-54 * distance), 1.0, 0.0)
    answer[CORE] = distance
    answer[SPREAD] = spread
    answer[LENGTH] = length
    over = 1.0 / room[SCALE]
    swept, swept_low = two_sum(room[RADIUS_A], room[RADIUS_B])
    gap, gap_low = add(distance * over, distance_low * over, -swept, -swept_low)
    answer[GAP] = gap
    answer[GAP_LOW] = gap_low
    answer[GAP_LOWER], answer[GAP_NEAREST], answer[GAP_UPPER] = bracket(gap, gap_low, unsure * over)
    for axis in range(3):
        answer[UNIT + axis] = direction[2 * axis] / length


@kernel(inline=True)
def _set_witnesses(room, n, parts, first, second, answer):
    """The points of both cores at the foot, at shares ``first`` and ``second`` of the edges."""
    ax = room[CORNER_A]
    ay = room[CORNER_A + 1]
    az = room[CORNER_A + 2]
    bx = room[CORNER_B]
    by = room[CORNER_B + 1]
    bz = room[CORNER_B + 2]
    for k in range(1, n):
        for part in range(parts):
            at = EDGES + EDGE * (k - 1) + PART * part
            share = select(k == 1, first, second)
            to_a = select(room[at + OF_A] > 0.5, share, 0.0)
            to_b = share - to_a
            x = room[at + HEAD] - room[at + TAIL]
            y = room[at + HEAD + 1] - room[at + TAIL + 1]
            z = room[at + HEAD + 2] - room[at + TAIL + 2]
            ax += to_a * x
            ay += to_a * y
            az += to_a * z
            bx -= to_b * x
            by -= to_b * y
            bz -= to_b * z
    for axis in range(3):
        r = POSE_A + 3 * axis
        answer[POINT_A + axis] = (room[r] * ax + room[r + 1] * ay + room[r + 2] * az) + room[POSE_A + 9 + axis]
        r = POSE_B + 3 * axis
        answer[POINT_B + axis] = (room[r] * bx + room[r + 1] * by + room[r + 2] * bz) + room[POSE_B + 9 + axis]


@kernel(inline=True)
def _set_limits(room, n, answer):
    """The direction in the frames of both bodies, and what is level with the feature's vertices along it, in doubles."""
    x = answer[UNIT]
    y = answer[UNIT + 1]
    z = answer[UNIT + 2]
    for axis in range(3):
        r = POSE_A + axis
        answer[ALONG_A + axis] = room[r] * x + room[r + 3] * y + room[r + 6] * z
        r = POSE_B + axis
        answer[ALONG_B + axis] = -(room[r] * x + room[r + 3] * y + room[r + 6] * z)
    least_a = _along(room, CORNER_A, answer, ALONG_A)
    least_b = _along(room, CORNER_B, answer, ALONG_B)
    for k in range(1, n):
        at = EDGES + EDGE * (k - 1)
        of_a = room[at + OF_A] > 0.5
        least_a = select(of_a, smaller(least_a, _along(room, at + HEAD, answer, ALONG_A)), least_a)
        least_b = select(of_a, least_b, smaller(least_b, _along(room, at + TAIL, answer, ALONG_B)))
    # The unit vector is rounded: what doubles may be wrong along it, and along any that is a little longer.
    slack = room[ERROR] * (abs(x) + abs(y) + abs(z))
    answer[LIMIT_A] = least_a + slack
    answer[LIMIT_B] = least_b + slack


@kernel(inline=True)
def _along(room, corner, answer, direction):
    return (
        room[corner] * answer[direction] + room[corner + 1] * answer[direction + 1] + room[corner + 2] * answer[direction + 2]
    )
