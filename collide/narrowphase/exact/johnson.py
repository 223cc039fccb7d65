"""Johnson's subalgorithm (Gilbert, Johnson and Keerthi 1988) in integers: the part of a simplex nearest the origin."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.exact.exact_directions import scaled_by, set_normal
from collide.narrowphase.exact.exact_workspace import delta_at, direction_at, gram_at, point_at, scratch_at
from collide.numerics.digits import BITS, add_double, add_number, add_product, as_double_double, carry, clear
from collide.numerics.double_double import add, divide, square_root
from collide.numerics.error_free import two_sum


@kernel
def set_gram(digits, d, k):
    """Products of point k with points 0 … k."""
    for i in range(k + 1):
        at = gram_at(d, k, i)
        clear(digits, at, 2 * d)
        for axis in range(3):
            add_product(digits, at, point_at(d, k, axis), d, point_at(d, i, axis), d, 1)
        carry(digits, at, 2 * d)
        if i != k:
            clear(digits, gram_at(d, i, k), 2 * d)
            add_number(digits, gram_at(d, i, k), at, 2 * d, 1)


@kernel
def length_of(d, mask):
    """Digits of Δ for a set of points: one more factor of degree two for each point but the first."""
    count = (mask & 1) + ((mask >> 1) & 1) + ((mask >> 2) & 1) + ((mask >> 3) & 1)
    return 1 if count == 1 else 2 * d * (count - 1)


@kernel
def lowest_member(mask):
    k = 0
    while not (mask >> k) & 1:
        k += 1
    return k


@kernel
def set_delta(digits, d, mask, j):
    """Δ_j(X ∪ {j}) = Σ_{i ∈ X} Δ_i(X)·(y_i·y_k − y_i·y_j), k in X; returns its sign.

    Negative or zero for j outside X: no point of the simplex gets nearer by going towards y_j.
    """
    k = lowest_member(mask)
    larger = mask | (1 << j)
    out = delta_at(d, larger, j)
    n = length_of(d, larger)
    clear(digits, out, n)
    if mask & (mask - 1) == 0:
        add_number(digits, out, gram_at(d, k, k), 2 * d, 1)
        add_number(digits, out, gram_at(d, k, j), 2 * d, -1)
        return carry(digits, out, n)
    difference = scratch_at(d, 0)
    for i in range(4):
        if (mask >> i) & 1:
            clear(digits, difference, 2 * d)
            add_number(digits, difference, gram_at(d, i, k), 2 * d, 1)
            add_number(digits, difference, gram_at(d, i, j), 2 * d, -1)
            carry(digits, difference, 2 * d)
            add_product(digits, out, delta_at(d, mask, i), length_of(d, mask), difference, 2 * d, 1)
    return carry(digits, out, n)


@kernel
def nearest_subset(digits, d, n, newest):
    """The subset of n ≤ 4 points that holds the nearest point of their hull in its relative interior.

    Subsets with the newest point only, where newest ≥ 0: without it there is nothing nearer than
    before. Sets are visited smaller ones first, so that every Δ needed stands. Affinely dependent
    points are no special case: the nearest point also lies in an independent subset.
    """
    everything = (1 << n) - 1
    signs = 0  # two bits a (subset, member): 1 where Δ > 0
    for i in range(n):
        digits[delta_at(d, 1 << i, i)] = 1
        signs |= 1 << i
    for count in range(1, n + 1):
        for mask in range(1, everything + 1):
            size = (mask & 1) + ((mask >> 1) & 1) + ((mask >> 2) & 1) + ((mask >> 3) & 1)
            if size != count:
                continue
            positive = True
            for i in range(n):
                if (mask >> i) & 1 and count > 1 and _delta_sign(digits, d, mask, i) <= 0:
                    positive = False
            nearest = positive
            for j in range(n):
                if not (mask >> j) & 1 and set_delta(digits, d, mask, j) > 0:
                    nearest = False
            if nearest and (newest < 0 or (mask >> newest) & 1):
                return mask
    return 0


@kernel
def _delta_sign(digits, d, mask, i):
    """Sign of a carried Δ_i(mask)."""
    at = delta_at(d, mask, i)
    n = length_of(d, mask)
    if digits[at + n - 1] < 0:
        return -1
    for k in range(n):
        if digits[at + k] != 0:
            return 1
    return 0


@kernel
def set_direction(digits, d, mask):
    """A positive multiple of the nearest point of points 0 … n − 1, into the direction.

    For one or two points it is the nearest point times ΣΔ. Across three it is their normal, of degree
    two instead of five. Returns (digits it takes, whether it is zero: the origin is in the hull).
    """
    if mask == 7:
        n, side = set_normal(digits, d)
        return n, side == 0
    n = length_of(d, mask)
    total = d if n == 1 else n + d
    zero = True
    for axis in range(3):
        at = direction_at(d, axis)
        clear(digits, at, 6 * d)
        for i in range(4):
            if (mask >> i) & 1:
                add_product(digits, at, delta_at(d, mask, i), n, point_at(d, i, axis), d, 1)
        if carry(digits, at, total) != 0:
            zero = False
    return total, zero


@kernel
def compact(digits, d, ids, mask, n):
    """Keep the points of the subset, with their Gram entries, and set their Δ; returns their number."""
    kept = 0
    for k in range(n):
        if not (mask >> k) & 1:
            continue
        if kept != k:
            ids[2 * kept] = ids[2 * k]
            ids[2 * kept + 1] = ids[2 * k + 1]
            for c in range(3 * d):
                digits[point_at(d, kept, 0) + c] = digits[point_at(d, k, 0) + c]
        column = 0
        for j in range(n):
            if (mask >> j) & 1:
                for c in range(2 * d):
                    digits[gram_at(d, kept, column) + c] = digits[gram_at(d, k, j) + c]
                column += 1
        kept += 1
    if kept < n:
        for subset in range(1, 1 << kept):
            if subset & (subset - 1) == 0:
                digits[delta_at(d, subset, lowest_member(subset))] = 1
            for j in range(kept):
                if not (subset >> j) & 1:
                    set_delta(digits, d, subset, j)
    return kept


@kernel
def within_radius(digits, d, mask, grid, radius_a, radius_b):
    """(|v| ≤ r, |v| − r, low part) for the nearest point v of the subset and the sum r of the radii.

    |v|² = Σ Δ_i (y_i·y_k) / ΣΔ for any k of the subset, so the test is Σ Δ_i (y_i·y_k) ≤ r² ΣΔ.
    """
    k = lowest_member(mask)
    n = length_of(d, mask)
    total = scratch_at(d, 0)
    square = scratch_at(d, 1)
    clear(digits, total, n)
    clear(digits, square, n + 2 * d)
    for i in range(4):
        if (mask >> i) & 1:
            add_number(digits, total, delta_at(d, mask, i), n, 1)
            add_product(digits, square, delta_at(d, mask, i), n, gram_at(d, i, k), 2 * d, 1)
    carry(digits, total, n)
    sign = carry(digits, square, n + 2 * d)
    over, over_low, over_exponent = as_double_double(digits, total, n)
    value, value_low, exponent = as_double_double(digits, square, n + 2 * d)
    scale = 2 * BITS * grid - over_exponent
    # The root before the power of two: the square of a tiny distance would vanish.
    half = (exponent + scale) // 2
    ratio, ratio_low = divide(value, value_low, over, over_low)
    rest = exponent + scale - 2 * half
    distance, distance_low = square_root(scaled_by(ratio, rest), scaled_by(ratio_low, rest))
    distance = scaled_by(distance, half)
    distance_low = scaled_by(distance_low, half)
    if radius_a == 0.0 and radius_b == 0.0:
        return sign == 0, distance, distance_low
    radius = scratch_at(d, 2)
    clear(digits, radius, d)
    add_double(digits, radius, radius_a, grid)
    add_double(digits, radius, radius_b, grid)
    carry(digits, radius, d)
    power = scratch_at(d, 3)
    clear(digits, power, 2 * d)
    add_product(digits, power, radius, d, radius, d, 1)
    carry(digits, power, 2 * d)
    add_product(digits, square, power, 2 * d, total, n, -1)
    sign = carry(digits, square, n + 2 * d)
    # |v| − r without cancellation, as (|v|² − r²) / (|v| + r).
    value, value_low, exponent = as_double_double(digits, square, n + 2 * d)
    swept, swept_low = two_sum(radius_a, radius_b)
    both, both_low = add(distance, distance_low, swept, swept_low)
    ratio, ratio_low = divide(value, value_low, over, over_low)
    shift = math.frexp(both)[1]
    ratio, ratio_low = divide(ratio, ratio_low, scaled_by(both, -shift), scaled_by(both_low, -shift))
    excess = scaled_by(ratio, exponent + scale - shift)
    if excess == 0.0 and sign != 0:  # vanished, but not 0
        excess = 5e-324 * sign
    return sign <= 0, excess, scaled_by(ratio_low, exponent + scale - shift)
