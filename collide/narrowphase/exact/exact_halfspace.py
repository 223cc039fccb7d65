"""The exact stage for a half-space against a swept hull: the sign of one polynomial a vertex.

The half-space at its pose is {x : n·(x − p_WA) ≤ b·det R} with n = cof(R) m (`halfspace_convex.py`).
A vertex q of B with radius r reaches it iff s ≤ r|n|, s = n·(R_B q + p_WB − p_WA) − b·det R: a sign
where r = 0, else s ≤ 0 or s² ≤ r²|n|². Everything is an integer in `geometry.digits`.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, UNDONE
from collide.narrowphase.exact.exact_workspace import add_entry, exact_pose, lowest_and_largest, span_of_entries
from collide.narrowphase.halfspace_convex import plane_in_world
from collide.numerics.digits import (
    BITS,
    add_double,
    add_product,
    as_double_double,
    carry,
    clear,
    grid_of,
    lowest_bit,
)
from collide.numerics.double_double import add, divide, square_root

#: Most digits of any number that is multiplied once more.
_LONGEST = 64
#: Integers of workspace: rotation, normal, cofactors, vertex and sums, each at most this long.
INTEGERS = 40 * 2 * _LONGEST


@kernel
def _span(numbers, at, n):
    """(grid, digits) that hold n doubles; (0, 1) where all are 0."""
    lowest, largest = lowest_and_largest(numbers, at, n)
    if lowest == 2000:
        return 0, 1
    return grid_of(lowest), grid_of(largest - 1) - grid_of(lowest) + 1


@kernel
def _slot(k):
    return k * 2 * _LONGEST


@kernel
def _set_plane(digits, pose, numbers, at, rot, n_rot, low_m, n_m):
    """Slots 12 … 14 become n = cof(R) m, slot 15 becomes det R; slots 0 … 11 are R and m."""
    clear(digits, 0, _slot(19))
    for k in range(9):
        add_entry(digits, _slot(k), pose, k, rot, 1.0)
        carry(digits, _slot(k), n_rot)
    for k in range(3):
        add_double(digits, _slot(9 + k), numbers[at + k], low_m)
    length = 2 * n_rot + n_m + 1
    for i in range(3):
        for j in range(3):
            # One cofactor in slot 16, then its product with m_j.
            cofactor = _slot(16)
            clear(digits, cofactor, 2 * n_rot + 1)
            r1 = 3 * ((i + 1) % 3)
            r2 = 3 * ((i + 2) % 3)
            c1 = (j + 1) % 3
            c2 = (j + 2) % 3
            add_product(digits, cofactor, _slot(r1 + c1), n_rot, _slot(r2 + c2), n_rot, 1)
            add_product(digits, cofactor, _slot(r1 + c2), n_rot, _slot(r2 + c1), n_rot, -1)
            carry(digits, cofactor, 2 * n_rot + 1)
            add_product(digits, _slot(12 + i), cofactor, 2 * n_rot + 1, _slot(9 + j), n_m, 1)
            if i == 0:
                add_product(digits, _slot(15), cofactor, 2 * n_rot + 1, _slot(j), n_rot, 1)
        carry(digits, _slot(12 + i), length)
    carry(digits, _slot(15), 3 * n_rot + 2)
    return length


@kernel
def reach_plane_exactly(pair, terms, digits, lowest_b, reach_b, radius, size, error):
    """(verdict, vertex of B, excess, low part): whether a swept hull B reaches the half-space A of the pair.

    Arguments as in `exact.touch_exactly`. The vertex is the deepest, the excess its signed distance minus the
    radius, to EXACT_ERROR.
    """
    A, B, numbers, poses = pair.A, pair.B, pair.numbers, pair.poses
    p, q = A.pose_at, B.pose_at
    t = pair.t
    pose_a = exact_pose(poses, p, terms)
    pose_b = exact_pose(poses, q, terms)
    rot, n_rot = span_of_entries(pose_a, 0, 9)
    low_m, n_m = _span(numbers, A.params_at, 3)
    low_b, n_b = _span(numbers, A.params_at + 3, 1)
    rot_b, n_rot_b = span_of_entries(pose_b, 0, 9)
    low_s, n_s = span_of_entries(pose_a, 9, 3)
    low_t, n_t = span_of_entries(pose_b, 9, 3)
    core = grid_of(min(lowest_b, 1000))
    n_core = max(grid_of(math.frexp(reach_b)[1] - 1) - core + 1, 1) if lowest_b < 2000 else 0
    grid = min(low_s, low_t)
    if lowest_b < 2000:
        grid = min(grid, rot_b + core)
    d = grid_of(math.frexp(size)[1]) - grid + 1
    d = max(d, low_s + n_s - grid + 1, low_t + n_t - grid + 1)
    if lowest_b < 2000:
        d = max(d, n_rot_b + n_core - 1 + rot_b + core - grid)
    # Two terms of different degree meet in s: their digits are brought to the lower grid of both.
    low_first = 2 * rot + low_m + grid
    low_second = 3 * rot + low_b
    low = min(low_first, low_second)
    n_plane = 2 * n_rot + n_m + 1
    n_sum = max(n_plane + d + low_first - low, 3 * n_rot + 2 + n_b + low_second - low) + 1
    if n_sum > _LONGEST or d > _LONGEST // 2:
        return UNDONE, 0, 0.0, 0.0
    _set_plane(digits, pose_a, numbers, A.params_at, rot, n_rot, low_m, n_m)
    # The part of s that no vertex changes, in slot 17: −b·det R.
    add_double(digits, _slot(18), numbers[A.params_at + 3], low_b)
    constant = _slot(17)
    clear(digits, constant, n_sum)
    add_product(digits, constant + low_second - low, _slot(15), 3 * n_rot + 2, _slot(18), n_b, -1)
    carry(digits, constant, n_sum)
    nx, ny, nz, offset, length = plane_in_world(numbers, A.params_at, poses, p)
    lowest = math.inf
    for k in range(B.n):
        lowest = min(lowest, _height(B.coords, B.padded, k, poses, q, t.x, t.y, t.z, nx, ny, nz, offset))
    # Only vertices that may be the lowest are looked at exactly: usually one.
    threshold = lowest + 2.0 * error * length
    best = 0
    least = math.inf
    least_low = 0.0
    decided = SEPARATE
    clear(digits, _slot(20), 9 * 2 * _LONGEST)
    for k in range(9):
        add_entry(digits, _slot(20 + k), pose_b, k, rot_b, 1.0)
        carry(digits, _slot(20 + k), n_rot_b)
    for k in range(B.n):
        if _height(B.coords, B.padded, k, poses, q, t.x, t.y, t.z, nx, ny, nz, offset) > threshold:
            continue
        verdict, excess, excess_low = _reaches(
            digits, pose_a, pose_b, B.coords, B.padded, k, n_rot_b, core, n_core, rot_b + core - grid, grid, d, n_plane,
            low_first - low, n_sum, low, 2 * rot + low_m, radius,
        )  # fmt: skip
        if verdict == UNDONE:
            return UNDONE, k, 0.0, 0.0
        if excess < least or (excess == least and excess_low < least_low):
            least = excess
            least_low = excess_low
            best = k
            decided = verdict
    return decided, best, least, least_low


@kernel
def _height(coords, m, k, poses, q, tx, ty, tz, nx, ny, nz, offset):
    """s of vertex k in doubles."""
    x = coords[k]
    y = coords[m + k]
    z = coords[2 * m + k]
    along_x = nx * (poses[q] * x + poses[q + 1] * y + poses[q + 2] * z + tx)
    along_y = ny * (poses[q + 3] * x + poses[q + 4] * y + poses[q + 5] * z + ty)
    along_z = nz * (poses[q + 6] * x + poses[q + 7] * y + poses[q + 8] * z + tz)
    return along_x + along_y + along_z - offset


@kernel
def _reaches(
    digits, pose_a, pose_b, coords, m, k, n_rot_b, core, n_core, at_product, grid, d, n_plane, at_first, n_sum, low,
    low_plane, radius,
):  # fmt: skip
    """(verdict, excess, low part) of vertex k of B: whether it lies within the radius of the half-space, exactly."""
    total = _slot(30)
    clear(digits, total, n_sum)
    for c in range(n_sum):
        digits[total + c] = digits[_slot(17) + c]
    for axis in range(3):
        y = _slot(31)
        clear(digits, y, d)
        for j in range(3):
            if n_core > 0:
                vertex = _slot(32)
                clear(digits, vertex, n_core)
                add_double(digits, vertex, coords[j * m + k], core)
                add_product(digits, y + at_product, _slot(20 + 3 * axis + j), n_rot_b, vertex, n_core, 1)
        add_entry(digits, y, pose_b, 9 + axis, grid, 1.0)
        add_entry(digits, y, pose_a, 9 + axis, grid, -1.0)
        carry(digits, y, d)
        add_product(digits, total + at_first, _slot(12 + axis), n_plane, y, d, 1)
    sign = carry(digits, total, n_sum)
    nn = _slot(37)
    clear(digits, nn, 2 * n_plane + 1)
    for axis in range(3):
        add_product(digits, nn, _slot(12 + axis), n_plane, _slot(12 + axis), n_plane, 1)
    carry(digits, nn, 2 * n_plane + 1)
    square, square_low, exponent = as_double_double(digits, nn, 2 * n_plane + 1)
    exponent += 2 * BITS * low_plane
    odd = exponent & 1
    length, length_low = square_root(math.ldexp(square, odd), math.ldexp(square_low, odd))
    half = (exponent - odd) // 2  # |n| is the length times 2 to this
    value, value_low, exponent = as_double_double(digits, total, n_sum)
    height, height_low = divide(value, value_low, length, length_low)
    shift = int(exponent + BITS * low - half)
    height = math.ldexp(height, shift)
    height_low = math.ldexp(height_low, shift)
    if radius == 0.0 or sign <= 0:
        if height == 0.0 and sign != 0:  # vanished, but not 0
            height = 5e-324 * sign
        height, height_low = add(height, height_low, -radius, 0.0)
        return TOUCHING if sign <= 0 else SEPARATE, height, height_low
    # s² ≤ r² |n|², each side on its own grid: 2·low, and 2·low_plane + 2·(grid of r).
    low_r = grid_of(lowest_bit(radius))
    n_r = grid_of(math.frexp(radius)[1] - 1) - low_r + 1
    left = _slot(33)
    clear(digits, left, 2 * _slot(1))
    clear(digits, _slot(35), 2 * _slot(1))
    right = _slot(35)
    shift_left = 2 * low - min(2 * low, 2 * low_plane + 2 * low_r)
    shift_right = 2 * low_plane + 2 * low_r - min(2 * low, 2 * low_plane + 2 * low_r)
    r = _slot(31)
    rr = _slot(32)
    clear(digits, r, n_r)
    clear(digits, rr, 2 * n_r + 1)
    add_double(digits, r, radius, low_r)
    add_product(digits, rr, r, n_r, r, n_r, 1)
    carry(digits, rr, 2 * n_r + 1)
    n_left = 2 * n_sum + shift_left + 1
    n_right = 2 * n_plane + 1 + 2 * n_r + 1 + shift_right
    n = max(n_left, n_right) + 1
    if n > 2 * _slot(1):
        return UNDONE, 0.0, 0.0
    add_product(digits, left + shift_left, total, n_sum, total, n_sum, 1)
    add_product(digits, right + shift_right, nn, 2 * n_plane + 1, rr, 2 * n_r + 1, 1)
    carry(digits, right, n)
    for c in range(n):
        digits[left + c] -= digits[right + c]
    sign = carry(digits, left, n)
    # (s² − r²|n|²) / |n|² over s/|n| + r, which is s/|n| − r without cancellation.
    value, value_low, exponent = as_double_double(digits, left, n)
    value, value_low = divide(value, value_low, square, square_low)
    sum_of_both, sum_low = add(height, height_low, radius, 0.0)
    down = math.frexp(sum_of_both)[1]
    value, value_low = divide(value, value_low, math.ldexp(sum_of_both, -down), math.ldexp(sum_low, -down))
    shift = int(exponent + BITS * min(2 * low, 2 * low_plane + 2 * low_r) - 2 * half - odd - down)
    excess = math.ldexp(value, shift)
    if excess == 0.0 and sign != 0:
        excess = 5e-324 * sign
    return TOUCHING if sign <= 0 else SEPARATE, excess, math.ldexp(value_low, shift)
