"""The last digits of the distance of two cores of points, from the feature that GJK found, for eight pairs at a time.

In double-doubles: a direction across the feature, whose least height over A ⊖ B is a lower bound of the distance, and
the heights of the feature's own points, whose greatest is an upper bound if the foot of the origin lies within
the feature (the Karush-Kuhn-Tucker conditions of the nearest point). Nearly always they are the same number.
Where they are not, doubles stopped at the wrong one of several nearly level features: that is left to integers.

The feature is its first point w₀ = R_A a₀ + p_A − R_B b₀ − p_B and the edges to its others. Other points have, as a
rule, a vertex of one body in common with the first, so that an edge is R (v − v₀) of one body: half the work of a
point, and good to its own length instead of the pair's size.

Error of an edge: v − v₀ is exact, as a double-double; a coordinate is three terms, whose lower parts are at most
4u·ΣT and rounded eight times: 32u²·ΣT, across three coordinates less than 2⁻⁹⁹ S, as |v − v₀| ≤ 2ρ. Along a
direction it is good to 2⁻¹⁰¹·2S besides. With the height of w₀, 2⁻⁹⁸ S and 2⁻¹⁰⁰ S (`precise_pair.py`), the
height of a point is off by less than `HEIGHT_ERROR`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.kernels.lanes import select
from collide.narrowphase.gap import gap_layout as at
from collide.narrowphase.gap.precise_pair import (
    HEIGHT_ERROR,
    SLOP_ERROR,
    PosedDifference,
    across_edge,
    direction_length,
    larger,
    normal_of_edges,
    put_difference,
    smaller,
)
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.error_free import two_product, two_sum
from collide.numerics.vec3 import (
    add,
    cross,
    divide,
    dot,
    neg,
    norm1,
    put_vec3,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)

#: Rounding of a weight's numerator in doubles, of points and edges rounded once, with a dozen roundings to spare.
_WEIGHT_ERROR = 64 * 2.0**-53


class Foot(NamedTuple):
    """The foot of the origin on a feature.

    within : whether it certainly lies within the feature.   first, second : its shares of the two edges, in [0, 1].
    """

    within: Any
    first: Any
    second: Any


@kernel(inline=True)
def _foot_on_edge(w, e):
    """Of the segment from w to w + e."""
    square = dot(e, e)
    along = -dot(w, e)
    margin = _WEIGHT_ERROR * norm1(w) * norm1(e)
    nonzero = square > 0.0
    share = select(nonzero, smaller(larger(along / select(nonzero, square, 1.0), 0.0), 1.0), 0.0)
    return Foot((margin < along) & (along < square - margin), share, 0.0 * share)


@kernel(inline=True)
def _foot_on_face(w, e, f, parallelogram):
    """Of the triangle, or parallelogram, of edges e and f from w."""
    n = cross(e, f)
    square = dot(n, n)
    beta = -dot(n, cross(w, f))
    gamma = -dot(n, cross(e, w))
    e_length = norm1(e)
    f_length = norm1(f)
    # A product of four lengths, each as good as doubles are, and the normal off by as much of |e||f|.
    margin = _WEIGHT_ERROR * norm1(w) * larger(e_length, f_length) * e_length * f_length
    farther = select(parallelogram, larger(beta, gamma), beta + gamma)
    nonzero = square > 0.0
    divisor = select(nonzero, square, 1.0)
    first = select(nonzero, larger(beta / divisor, 0.0), 0.0)
    second = select(nonzero, larger(gamma / divisor, 0.0), 0.0)
    total = select(parallelogram, 1.0, larger(first + second, 1.0))
    return Foot((beta > margin) & (gamma > margin) & (farther < square - margin), first / total, second / total)


@kernel
def _put_edge(question, edge_at, feature, k, is_second_part, composed):
    """R (head − tail) of a part of an edge into ``feature``, scaled; a second part is added to the first."""
    of_a = question[edge_at + at.OF_A] > 0.5
    e = dd.difference(vec3_at(question, edge_at + at.HEAD), vec3_at(question, edge_at + at.TAIL))
    for axis in range(3):
        row = 3 * axis
        rx = select(of_a, question[at.POSE_A + row], question[at.POSE_B + row])
        ry = select(of_a, question[at.POSE_A + row + 1], question[at.POSE_B + row + 1])
        rz = select(of_a, question[at.POSE_A + row + 2], question[at.POSE_B + row + 2])
        total, rest = two_product(rx, e.x.high)
        y = two_product(ry, e.y.high)
        total, error = two_sum(total, y.high)
        rest += y.low + error
        z = two_product(rz, e.z.high)
        total, error = two_sum(total, z.high)
        rest += (z.low + error) + (rx * e.x.low + ry * e.y.low + rz * e.z.low)
        if composed:
            rest += select(of_a, question[at.LOW_A + row], question[at.LOW_B + row]) * e.x.high
            rest += select(of_a, question[at.LOW_A + row + 1], question[at.LOW_B + row + 1]) * e.y.high
            rest += select(of_a, question[at.LOW_A + row + 2], question[at.LOW_B + row + 2]) * e.z.high
        total, rest = two_sum(total, rest)
        coordinate = DD(total * question[at.SCALE], rest * question[at.SCALE])
        if is_second_part:
            coordinate = dd.add(DD(feature[k + 2 * axis], feature[k + 2 * axis + 1]), coordinate)
        feature[k + 2 * axis] = coordinate.high
        feature[k + 2 * axis + 1] = coordinate.low


@kernel(inline=True)
def core_error(spread, excess, length, slop, scale):
    """How far a scaled core distance may be off: level pairs of the feature's vertices, and the foot, are within the
    spread of the first point's height; and so is what lies beyond it by the excess."""
    return 3.0 * (spread + abs(excess)) / length + HEIGHT_ERROR + SLOP_ERROR * slop * scale


@kernel
def refine_gaps(question, n, parts, composed, feature, direction, answer):
    """The distances of eight pairs of disjoint cores of points, from the n ≤ 3 points nearest the origin.

    question : a lane block of `gap_layout.py`, or the question of a pair as doubles.   parts : of an edge, 1 or 2.
    composed : whether the question has low parts of poses.
    feature, direction, answer : FEATURE, dd.STRIDE, ANSWER numbers, out.

    The caller looks for other vertices as low (`tied_vertices.py`).
    """
    poses = PosedDifference(question, at.POSE_A, at.POSE_B, question, at.LOW_A, at.LOW_B, composed)
    put_difference(
        feature, 0, poses, vec3_at(question, at.CORNER_A), vec3_at(question, at.CORNER_B), question[at.SCALE]
    )
    for k in range(1, n):
        for part in range(parts):
            _put_edge(
                question, at.EDGES + at.EDGE * (k - 1) + at.PART * part, feature, dd.STRIDE * k, part > 0, composed
            )
    w = dd.vec3_at(feature, 0)
    across = w
    proven = question[at.SCALE] > 0.0
    first = 0.0 * w.x.high
    second = first
    if n > 1:
        e = dd.vec3_at(feature, dd.STRIDE)
        if n == 2:
            proven, first, _ = _foot_on_edge(dd.leading(w), dd.leading(e))
            across = across_edge(w, e)
        else:
            f = dd.vec3_at(feature, 2 * dd.STRIDE)
            is_parallelogram = question[at.PARALLELOGRAM] > 0.5
            proven, first, second = _foot_on_face(dd.leading(w), dd.leading(e), dd.leading(f), is_parallelogram)
            across = normal_of_edges(e, f)
    # Roughly, for the sign alone: a gap between directions that doubles cannot tell apart is not proven.
    sign = select(dot(dd.leading(w), dd.leading(across)) < 0.0, -1.0, 1.0)
    across = dd.scale_vec3(sign, across)
    dd.put_vec3(direction, 0, across)
    _set_distance(question, n, feature, across, answer, proven)
    _set_witnesses(question, n, parts, first, second, answer)
    if parts == 1:
        _set_limits(question, n, answer)


@kernel(inline=True)
def _set_distance(question, n, feature, direction, answer, proven):
    """Everything of an answer that is a number along the direction."""
    length = direction_length(direction)
    height = dd.inner(dd.vec3_at(feature, 0), direction)
    nonzero = length.high > 0.0
    length = DD(select(nonzero, length.high, 1.0), length.low)
    spread = 0.0 * length.high
    for k in range(1, n):
        slope = dd.unnormalized_inner(dd.vec3_at(feature, dd.STRIDE * k), direction)
        spread = larger(spread, abs(slope.high + slope.low))
    distance = dd.div(height, length)
    error = core_error(spread, 0.0, length.high, question[at.SLOP], question[at.SCALE])
    answer[at.PROVEN] = select(proven & nonzero & (error < 2.0**-54 * distance.high), 1.0, 0.0)
    answer[at.CORE] = distance.high
    answer[at.SPREAD] = spread
    answer[at.LENGTH] = length.high
    over = 1.0 / question[at.SCALE]
    radii = two_sum(question[at.RADIUS_A], question[at.RADIUS_B])
    gap = dd.sub(dd.scale(over, distance), radii)
    answer[at.GAP] = gap.high
    answer[at.GAP_LOW] = gap.low
    answer[at.GAP_LOWER], answer[at.GAP_NEAREST], answer[at.GAP_UPPER] = dd.bracket(gap, error * over)
    put_vec3(answer, at.UNIT, divide(dd.leading(direction), length.high))


@kernel(inline=True)
def _set_witnesses(question, n, parts, first, second, answer):
    """The points of both cores at the foot, at shares ``first`` and ``second`` of the edges."""
    a = vec3_at(question, at.CORNER_A)
    b = vec3_at(question, at.CORNER_B)
    for k in range(1, n):
        for part in range(parts):
            edge_at = at.EDGES + at.EDGE * (k - 1) + at.PART * part
            share = select(k == 1, first, second)
            to_a = select(question[edge_at + at.OF_A] > 0.5, share, 0.0)
            e = sub(vec3_at(question, edge_at + at.HEAD), vec3_at(question, edge_at + at.TAIL))
            a = add(a, scale(to_a, e))
            b = sub(b, scale(share - to_a, e))
    put_vec3(answer, at.POINT_A, add(rotate(question, at.POSE_A, a), vec3_at(question, at.POSE_A + 9)))
    put_vec3(answer, at.POINT_B, add(rotate(question, at.POSE_B, b), vec3_at(question, at.POSE_B + 9)))


@kernel(inline=True)
def _set_limits(question, n, answer):
    """The direction in the frames of both bodies, and what is level with the feature's vertices along it, in
    doubles."""
    unit = vec3_at(answer, at.UNIT)
    along_a = rotate_back(question, at.POSE_A, unit)
    along_b = neg(rotate_back(question, at.POSE_B, unit))
    put_vec3(answer, at.ALONG_A, along_a)
    put_vec3(answer, at.ALONG_B, along_b)
    least_a = dot(vec3_at(question, at.CORNER_A), along_a)
    least_b = dot(vec3_at(question, at.CORNER_B), along_b)
    for k in range(1, n):
        edge_at = at.EDGES + at.EDGE * (k - 1)
        of_a = question[edge_at + at.OF_A] > 0.5
        least_a = select(of_a, smaller(least_a, dot(vec3_at(question, edge_at + at.HEAD), along_a)), least_a)
        least_b = select(of_a, least_b, smaller(least_b, dot(vec3_at(question, edge_at + at.TAIL), along_b)))
    # The unit vector is rounded: what doubles may be wrong along it, and along any that is a little longer.
    slack = question[at.ERROR] * norm1(unit)
    answer[at.LIMIT_A] = least_a + slack
    answer[at.LIMIT_B] = least_b + slack
