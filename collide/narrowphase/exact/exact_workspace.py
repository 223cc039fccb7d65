"""The workspace of the exact stage: where its numbers stand, how long they are, how a pair gets into it."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.lowering.shape_table import POSE_TERMS, TERM_ROW, TERMS
from collide.numerics.digits import (
    LONGEST_FACTOR,
    add_double,
    add_number,
    add_product,
    carry,
    clear,
    grid_of,
    lowest_bit,
)

#: Most digits of one coordinate: 2^1664 between the largest and the smallest bit of a pair, which is
#: every double there is as long as the bodies are smaller than 2^500 m. The shorter factor of any
#: product has at most two coordinates' digits.
LONGEST = 64
assert 2 * LONGEST <= LONGEST_FACTOR

# --- the workspace, in units of the coordinate length D (digits) --------------------------------
# rotations 18·D and shift 3·D; then points 5·3·D, Gram 25·2D, Δ 16·4·6D, direction 3·6D, scratch.

#: Integers of workspace.
INTEGERS = 21 * LONGEST + 15 * LONGEST + 50 * LONGEST + 384 * LONGEST + 18 * LONGEST + 60 * LONGEST + 64


@kernel
def shift_at(d):
    return 18 * d


@kernel
def point_at(d, k, axis):
    return (21 + 3 * k + axis) * d


@kernel
def gram_at(d, i, j):
    return (36 + 2 * (5 * i + j)) * d


@kernel
def delta_at(d, mask, i):
    return (86 + 6 * (4 * mask + i)) * d


@kernel
def direction_at(d, axis):
    return (470 + 6 * axis) * d


@kernel
def scratch_at(d, k):
    """Scratch k of 4, 15·D each: room for a coordinate and for numbers of up to 14 degrees."""
    return (488 + 15 * k) * d


@kernel
def lowest_and_largest(numbers, at, n):
    """Exponents of the lowest bit and of the largest magnitude among n doubles."""
    lowest = 2000
    largest = -2000
    for k in range(at, at + n):
        if numbers[k] != 0.0:
            lowest = min(lowest, lowest_bit(numbers[k]))
            largest = max(largest, math.frexp(numbers[k])[1])
    return lowest, largest


@kernel
def exact_pose(poses, p, terms):
    """(numbers, where, k): entry j of the pose is exactly the sum of numbers[where + k·j …], k of them."""
    if poses[p + POSE_TERMS] < 0.0:
        return poses, p, 1
    return terms, TERM_ROW * int(poses[p + POSE_TERMS]), TERMS


@kernel
def span_of_entries(pose, first, count):
    """(grid, digits) that hold each of ``count`` entries of an exact pose; (0, 1) where all are 0."""
    numbers, at, k = pose
    lowest, largest = lowest_and_largest(numbers, at + k * first, k * count)
    if lowest == 2000:
        return 0, 1
    if k > 1:
        largest += 3  # a sum of up to seven
    return grid_of(lowest), grid_of(largest - 1) - grid_of(lowest) + 1


@kernel
def add_entry(digits, at, pose, j, grid, sign):
    """Add or subtract entry j of an exact pose."""
    numbers, start, k = pose
    for i in range(k):
        add_double(digits, at, sign * numbers[start + k * j + i], grid)


@kernel
def scale_of(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, radius_a, radius_b, size):
    """(D, grid of coordinates, grid and digits of R_A, grid and digits of a's coordinates, same of B).

    A grid is the exponent of a number's digit 0 over BITS; all of a pair's coordinates share one.
    """
    # A core at its frame's origin alone is not turned: its rotation takes no digits, and must have no say in D.
    rot_a, digits_rot_a = span_of_entries(pose_a, 0, 9 if lowest_a < 2000 else 0)
    rot_b, digits_rot_b = span_of_entries(pose_b, 0, 9 if lowest_b < 2000 else 0)
    core_a = grid_of(min(lowest_a, 1000))
    core_b = grid_of(min(lowest_b, 1000))
    low_s, high_s = lowest_and_largest(pose_a[0], pose_a[1] + 9 * pose_a[2], 3 * pose_a[2])
    low_t, high_t = lowest_and_largest(pose_b[0], pose_b[1] + 9 * pose_b[2], 3 * pose_b[2])
    grid = grid_of(min(low_s, low_t, lowest_bit(radius_a), lowest_bit(radius_b), 1000))
    if lowest_a < 2000:
        grid = min(grid, rot_a + core_a)
    if lowest_b < 2000:
        grid = min(grid, rot_b + core_b)
    # Digits from the lowest bit to the highest: |x| < 2^e reaches up to bit e − 1.
    digits_a = max(grid_of(math.frexp(reach_a)[1] - 1) - core_a + 1, 1) if lowest_a < 2000 else 0
    digits_b = max(grid_of(math.frexp(reach_b)[1] - 1) - core_b + 1, 1) if lowest_b < 2000 else 0
    # A coordinate is less than 2·size; the highest digit is signed and may be as large as a factor.
    d = grid_of(math.frexp(size)[1]) - grid + 1
    d = max(d, grid_of(max(high_s, high_t, -1000)) - grid + 1)
    if lowest_a < 2000:
        d = max(d, digits_rot_a + digits_a - 1 + rot_a + core_a - grid)
    if lowest_b < 2000:
        d = max(d, digits_rot_b + digits_b - 1 + rot_b + core_b - grid)
    return d, grid, rot_a, digits_rot_a, core_a, digits_a, rot_b, digits_rot_b, core_b, digits_b


@kernel
def load_poses(digits, scale, pose_a, pose_b):
    """Rotations and the shift p_WB − p_WA into the workspace."""
    d, grid, rot_a, digits_rot_a, _, digits_a, rot_b, digits_rot_b, _, digits_b = scale
    clear(digits, 0, 21 * d)
    for k in range(9):
        if digits_a > 0:
            add_entry(digits, k * d, pose_a, k, rot_a, 1.0)
            carry(digits, k * d, digits_rot_a)
        if digits_b > 0:
            add_entry(digits, (9 + k) * d, pose_b, k, rot_b, 1.0)
            carry(digits, (9 + k) * d, digits_rot_b)
    for k in range(3):
        at = shift_at(d) + k * d
        add_entry(digits, at, pose_b, 9 + k, grid, 1.0)
        add_entry(digits, at, pose_a, 9 + k, grid, -1.0)
        carry(digits, at, d)


@kernel
def _add_vertex(digits, d, out, rotation, digits_rot, coordinates, m, vertex, core, digits_core, offset, sign):
    """Add sign · R v to three coordinates at out, out + D, out + 2D."""
    at = scratch_at(d, 3)
    clear(digits, at, 3 * digits_core)
    for j in range(3):
        add_double(digits, at + j * digits_core, coordinates[j * m + vertex], core)
    for axis in range(3):
        for j in range(3):
            add_product(
                digits, out + axis * d + offset, (rotation + 3 * axis + j) * d, digits_rot, at + j * digits_core,
                digits_core, sign,
            )  # fmt: skip


@kernel
def set_point(digits, scale, pair, k, i, j):
    """Point k of the workspace becomes the difference of vertex i of A and vertex j of B."""
    d, grid, rot_a, digits_rot_a, core_a, digits_a, rot_b, digits_rot_b, core_b, digits_b = scale
    out = point_at(d, k, 0)
    clear(digits, out, 3 * d)
    if digits_a > 0:
        _add_vertex(
            digits, d, out, 0, digits_rot_a, pair.A.coords, pair.A.padded, i, core_a, digits_a, rot_a + core_a - grid, 1
        )
    if digits_b > 0:
        _add_vertex(
            digits, d, out, 9, digits_rot_b, pair.B.coords, pair.B.padded, j, core_b, digits_b, rot_b + core_b - grid, -1
        )
    for axis in range(3):
        add_number(digits, out + axis * d, shift_at(d) + axis * d, d, -1)
        carry(digits, out + axis * d, d)
