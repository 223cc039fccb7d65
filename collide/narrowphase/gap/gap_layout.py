"""Places of the numbers of a gap to be refined: the question and the answer of a pair, eight pairs side by side.

A lane block is an array of `Lanes`, number k of eight pairs in element k. The numbers of a single pair are a `Lane` of
the block: every eighth double. Read as ``at.POSE_A``, with this module imported as ``at``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64
from collide.kernels.lanes import LANES
from collide.numerics import double_double as dd
from collide.numerics.vec3 import Vec3

# A question: both poses (R row by row, then p) and what composed ones are more than that (low parts); the first point's
# vertices a and b; a power of two that brings the pair to a size of about 1, slop and error of the pair [m], both radii
# [m], 1 where the nearest point lies in the parallelogram of two segments; two edges.
POSE_A, POSE_B, LOW_A, LOW_B, CORNER_A, CORNER_B, SCALE, SLOP, ERROR, RADIUS_A, RADIUS_B, PARALLELOGRAM, EDGES = (
    0, 12, 24, 36, 48, 51, 54, 55, 56, 57, 58, 59, 60
)
# An edge is the sum of at most two parts, each R (head − tail) of one body: whether of A, else of B.
HEAD, TAIL, OF_A = 0, 3, 6
PART = 7
EDGE = 2 * PART
QUESTION = EDGES + 2 * EDGE

# An answer: 1 where proven, as far as the feature itself says; the core distance, the spread of the feature's heights
# and the direction's length, all scaled; the gap (double-double) and its bracket [m]; the unit vector from B to A; the
# cores' points; that vector in either body's frame, and how low other vertices must not be along it.
(
    PROVEN, CORE, SPREAD, LENGTH, GAP, GAP_LOW, GAP_LOWER, GAP_NEAREST, GAP_UPPER, UNIT, POINT_A, POINT_B, ALONG_A,
    ALONG_B,
    LIMIT_A, LIMIT_B,
) = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 15, 18, 21, 24, 25)
ANSWER = 26

#: Numbers of a feature: its first point and two edges, three `DDVec3`.
FEATURE = 3 * dd.STRIDE


class Lane(NamedTuple):
    """One pair's numbers in a lane block."""

    values: Any


@kernel(inline=True)
def lane_of(block_at, n, lane):
    """Lane 0 … 7 of a block of n numbers at an address."""
    return Lane(view_f64(block_at + 8 * lane, LANES * n - lane))


@kernel(inline=True)
def get(lane, k):
    return lane.values[LANES * k]


@kernel(inline=True)
def put(lane, k, value):
    lane.values[LANES * k] = value


@kernel(inline=True)
def get_vec3(lane, k):
    return Vec3(get(lane, k), get(lane, k + 1), get(lane, k + 2))


@kernel(inline=True)
def put_vec3(lane, k, value):
    put(lane, k, value.x)
    put(lane, k + 1, value.y)
    put(lane, k + 2, value.z)
