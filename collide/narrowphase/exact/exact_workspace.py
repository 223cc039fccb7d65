"""A pair of posed hulls in integers: place and length of its numbers in the workspace, and the loading of vertices.

All coordinates of a pair share a grid and a length of D digits; other numbers have a few times as many, by their
degree.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.lowering.shape_table import INTS, LOWEST, POSE_TERMS, TERM_ROW, TERMS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.posed_pair import PosedPair, reach_of
from collide.numerics.digits import (
    LONGEST_FACTOR,
    add_double,
    add_number,
    add_product,
    carry,
    grid_of,
    lowest_bit,
    set_zero,
)

#: Most digits of one coordinate: 2^1664 between the largest and the smallest bit of a pair, which is
#: every double there is as long as the bodies are smaller than 2^500 m. The shorter factor of any
#: product has at most two coordinates' digits.
LONGEST = 64
assert 2 * LONGEST <= LONGEST_FACTOR

# Layout of the workspace in units of D digits: both rotations 18, p_WB − p_WA 3, five points 15, Gram matrix 50,
# Johnson's Δ 384, direction 18, scratch 60.
_ROTATION_B, _SHIFT, _POINTS, _GRAM, _DELTA, _DIRECTION, _SCRATCH, _END = 9, 18, 21, 36, 86, 470, 488, 548
#: Integers of workspace.
INTEGERS = _END * LONGEST + 64

#: `lowest_bit` of 0, and what stands for it where a grid is chosen.
_NO_BIT, _FAR_BIT = 2000, 1000


class ExactPose(NamedTuple):
    """Entry j of a pose is exactly the sum of ``stride`` doubles: numbers[at + stride·j …]."""

    numbers: Any
    at: int
    stride: int


class Span(NamedTuple):
    """A grid, and how many digits above it hold some numbers."""

    grid: int
    n: int


class ExactBody(NamedTuple):
    """One body: its pose, where its rotation stands in units of D, and the spans of rotation and vertices.

    core : 0 digits where the core is its frame's origin alone.
    """

    pose: ExactPose
    rotation_at: int
    rotation: Span
    core: Span


class ExactPair(NamedTuple):
    """A pair in integers.

    pair : in doubles.   error : of a support value in doubles [m].   digits : view of the workspace.
    d : digits of a coordinate.   grid : that of coordinates.
    """

    pair: PosedPair
    error: float
    digits: Any
    d: int
    grid: int
    A: ExactBody
    B: ExactBody


# --- layout ---------------------------------------------------------------------------------------


@kernel
def point_at(d, k, axis):
    """Of five points, D digits a coordinate."""
    return (_POINTS + 3 * k + axis) * d


@kernel
def gram_at(d, i, j):
    """Of the products of two points, 2·D digits each."""
    return (_GRAM + 2 * (5 * i + j)) * d


@kernel
def delta_at(d, mask, i):
    """Of Johnson's Δ_i of a set of points, 6·D digits."""
    return (_DELTA + 6 * (4 * mask + i)) * d


@kernel
def direction_at(d, axis):
    """Of a component of the direction, 6·D digits."""
    return (_DIRECTION + 6 * axis) * d


@kernel
def scratch_at(d, k):
    """Scratch k of 4, 15·D each: for a coordinate and for numbers of up to 14 degrees."""
    return (_SCRATCH + 15 * k) * d


# --- spans ----------------------------------------------------------------------------------------


@kernel
def span_of(numbers, at, n, extra_bits):
    """The `Span` that holds each of n doubles, and sums of up to 2^extra_bits of them; (0, 1) where all are 0."""
    lowest, largest = lowest_and_largest(numbers, at, n)
    if lowest == _NO_BIT:
        return Span(0, 1)
    largest += extra_bits
    return Span(grid_of(lowest), grid_of(largest - 1) - grid_of(lowest) + 1)


@kernel
def lowest_and_largest(numbers, at, n):
    """Exponents of the lowest bit and of the largest magnitude among n doubles."""
    lowest = _NO_BIT
    largest = -_NO_BIT
    for k in range(at, at + n):
        if numbers[k] != 0.0:
            exponent = math.frexp(numbers[k])[1]
            largest = max(largest, exponent)
            if exponent - 53 < lowest:  # no bit of a double is lower
                lowest = min(lowest, lowest_bit(numbers[k]))
    return lowest, largest


@kernel
def exact_pose(poses, p, terms):
    """The pose at row p: as given, or the terms of a product (`PoseTable.terms`)."""
    if poses[p + POSE_TERMS] < 0.0:
        return ExactPose(poses, p, 1)
    return ExactPose(terms, TERM_ROW * int(poses[p + POSE_TERMS]), TERMS)


@kernel
def span_of_entries(pose, first, count):
    """The `Span` of ``count`` entries of an exact pose; entries are sums of up to seven."""
    return span_of(pose.numbers, pose.at + pose.stride * first, pose.stride * count, 3 if pose.stride > 1 else 0)


@kernel
def core_span(lowest, reach):
    """The `Span` of the coordinates of a core, by their lowest bit and their largest magnitude; 0 digits where all are
    0."""
    grid = grid_of(min(lowest, _FAR_BIT))
    if lowest >= _NO_BIT:
        return Span(grid, 0)
    return Span(grid, max(grid_of(math.frexp(reach)[1] - 1) - grid + 1, 1))


@kernel
def add_entry(digits, at, pose, j, grid, sign):
    """Add or subtract entry j of an exact pose."""
    for i in range(pose.stride):
        add_double(digits, at, sign * pose.numbers[pose.at + pose.stride * j + i], grid)


# --- pairs ----------------------------------------------------------------------------------------


@kernel
def exact_pair(ordered, terms, digits, radius_a, radius_b):
    """The `ExactPair` of an `OrderedPair`: spans only, `load_poses` fills the workspace.

    terms : of the `PoseTable`.   digits : workspace of INTEGERS.
    radius_a, radius_b : that are to have a place on the grid.
    """
    pair = ordered.pair
    A = _exact_body(ordered, pair.A, 0, terms)
    B = _exact_body(ordered, pair.B, _ROTATION_B, terms)
    low_a, high_a = lowest_and_largest(A.pose.numbers, A.pose.at + 9 * A.pose.stride, 3 * A.pose.stride)
    low_b, high_b = lowest_and_largest(B.pose.numbers, B.pose.at + 9 * B.pose.stride, 3 * B.pose.stride)
    grid = grid_of(min(low_a, low_b, lowest_bit(radius_a), lowest_bit(radius_b), _FAR_BIT))
    if A.core.n > 0:
        grid = min(grid, A.rotation.grid + A.core.grid)
    if B.core.n > 0:
        grid = min(grid, B.rotation.grid + B.core.grid)
    # Digits from the lowest bit to the highest: |x| < 2^e reaches up to bit e − 1. A coordinate is less than 2·size;
    # the highest digit is signed and may be as large as a factor.
    d = grid_of(math.frexp(ordered.size)[1]) - grid + 1
    d = max(d, grid_of(max(high_a, high_b, -_FAR_BIT)) - grid + 1)
    if A.core.n > 0:
        d = max(d, A.rotation.n + A.core.n - 1 + A.rotation.grid + A.core.grid - grid)
    if B.core.n > 0:
        d = max(d, B.rotation.n + B.core.n - 1 + B.rotation.grid + B.core.grid - grid)
    return ExactPair(pair, ERROR * ordered.size + ordered.slop, digits, d, grid, A, B)


@kernel
def _exact_body(ordered, body, rotation_at, terms):
    lowest = ordered.ints[INTS * body.shape + LOWEST]
    pose = exact_pose(ordered.pair.poses, body.pose_at, terms)
    # A core at its frame's origin alone is not turned: its rotation takes no digits, and must have no say in D.
    rotation = span_of_entries(pose, 0, 9 if lowest < _NO_BIT else 0)
    return ExactBody(pose, rotation_at, rotation, core_span(lowest, reach_of(ordered.pair, body)))


@kernel
def fits(exact):
    """Whether the workspace holds the pair: its magnitudes may span too many bits."""
    return exact.d <= LONGEST


@kernel
def load_poses(exact):
    """Rotations and the shift p_WB − p_WA into the workspace."""
    digits, d = exact.digits, exact.d
    set_zero(digits, 0, _POINTS * d)
    _load_rotation(digits, d, exact.A)
    _load_rotation(digits, d, exact.B)
    for k in range(3):
        at = (_SHIFT + k) * d
        add_entry(digits, at, exact.B.pose, 9 + k, exact.grid, 1.0)
        add_entry(digits, at, exact.A.pose, 9 + k, exact.grid, -1.0)
        carry(digits, at, d)


@kernel
def _load_rotation(digits, d, body):
    if body.core.n > 0:
        for k in range(9):
            at = (body.rotation_at + k) * d
            add_entry(digits, at, body.pose, k, body.rotation.grid, 1.0)
            carry(digits, at, body.rotation.n)


@kernel
def set_point(exact, k, i, j):
    """Point k of the workspace becomes the difference of vertex i of A and vertex j of B."""
    digits, d = exact.digits, exact.d
    out = point_at(d, k, 0)
    set_zero(digits, out, 3 * d)
    if exact.A.core.n > 0:
        _add_vertex(exact, exact.A, exact.pair.A, i, out, 1)
    if exact.B.core.n > 0:
        _add_vertex(exact, exact.B, exact.pair.B, j, out, -1)
    for axis in range(3):
        add_number(digits, out + axis * d, (_SHIFT + axis) * d, d, -1)
        carry(digits, out + axis * d, d)


@kernel
def _add_vertex(exact, body, hull, vertex, out, sign):
    """Add sign · R v to three coordinates at out, out + D, out + 2D."""
    digits, d = exact.digits, exact.d
    at = scratch_at(d, 3)
    offset = body.rotation.grid + body.core.grid - exact.grid
    set_zero(digits, at, 3 * body.core.n)
    for j in range(3):
        add_double(digits, at + j * body.core.n, hull.coords[j * hull.padded + vertex], body.core.grid)
    for axis in range(3):
        for j in range(3):
            rotation = (body.rotation_at + 3 * axis + j) * d
            add_product(
                digits, out + axis * d + offset, rotation, body.rotation.n, at + j * body.core.n, body.core.n, sign
            )
