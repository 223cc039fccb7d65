"""Johnson's subalgorithm (Gilbert, Johnson and Keerthi 1988) in integers: the part of a simplex nearest the origin."""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.exact.exact_directions import set_normal
from collide.narrowphase.exact.exact_workspace import delta_at, direction_at, gram_at, point_at, scratch_at
from collide.numerics import double_double as dd
from collide.numerics.digits import BITS, add_double, add_number, add_product, as_double_double, carry, copy, set_zero
from collide.numerics.double_double import DD, ScaledDD
from collide.numerics.error_free import two_sum


@kernel(inline=True)
def has_pair(ids, n, i, j):
    """Whether vertices i of A and j of B make a point of a simplex of n points."""
    for k in range(n):
        if ids[2 * k] == i and ids[2 * k + 1] == j:
            return True
    return False


@kernel
def set_gram(exact, k):
    """Products of point k with points 0 … k."""
    digits, d = exact.digits, exact.d
    for i in range(k + 1):
        at = gram_at(d, k, i)
        set_zero(digits, at, 2 * d)
        for axis in range(3):
            add_product(digits, at, point_at(d, k, axis), d, point_at(d, i, axis), d, 1)
        carry(digits, at, 2 * d)
        if i != k:
            set_zero(digits, gram_at(d, i, k), 2 * d)
            add_number(digits, gram_at(d, i, k), at, 2 * d, 1)


@kernel
def count_of(mask):
    """Points of a set of at most four."""
    return (mask & 1) + ((mask >> 1) & 1) + ((mask >> 2) & 1) + ((mask >> 3) & 1)


@kernel
def length_of(d, mask):
    """Digits of Δ for a set of points: one more factor of degree two for each point but the first."""
    count = count_of(mask)
    return 1 if count == 1 else 2 * d * (count - 1)


@kernel
def lowest_member(mask):
    k = 0
    while not (mask >> k) & 1:
        k += 1
    return k


@kernel
def set_delta(exact, mask, j):
    """Δ_j(X ∪ {j}) = Σ_{i ∈ X} Δ_i(X)·(y_i·y_k − y_i·y_j), k in X; returns its sign.

    mask : the set X, bit i for point i. Negative or zero for j outside X: no point of the simplex gets nearer by going
    towards y_j.
    """
    digits, d = exact.digits, exact.d
    k = lowest_member(mask)
    larger = mask | (1 << j)
    out = delta_at(d, larger, j)
    n = length_of(d, larger)
    set_zero(digits, out, n)
    if mask & (mask - 1) == 0:
        add_number(digits, out, gram_at(d, k, k), 2 * d, 1)
        add_number(digits, out, gram_at(d, k, j), 2 * d, -1)
        return carry(digits, out, n)
    difference = scratch_at(d, 0)
    for i in range(4):
        if (mask >> i) & 1:
            set_zero(digits, difference, 2 * d)
            add_number(digits, difference, gram_at(d, i, k), 2 * d, 1)
            add_number(digits, difference, gram_at(d, i, j), 2 * d, -1)
            carry(digits, difference, 2 * d)
            add_product(digits, out, delta_at(d, mask, i), length_of(d, mask), difference, 2 * d, 1)
    return carry(digits, out, n)


@kernel
def nearest_subset(exact, n, newest):
    """The subset of n ≤ 4 points with the nearest point of their hull in its relative interior.

    Only subsets with the newest point, where newest ≥ 0: without this point nothing is nearer than before. Smaller sets
    are visited first, so every Δ needed stands. Affinely dependent points are no special case: the nearest point also
    lies in an independent subset.
    """
    digits, d = exact.digits, exact.d
    for i in range(n):
        digits[delta_at(d, 1 << i, i)] = 1
    for count in range(1, n + 1):
        for mask in range(1, 1 << n):
            if count_of(mask) != count:
                continue
            positive = True
            for i in range(n):
                if (mask >> i) & 1 and count > 1 and _delta_sign(exact, mask, i) <= 0:
                    positive = False
            nearest = positive
            for j in range(n):
                if not (mask >> j) & 1 and set_delta(exact, mask, j) > 0:
                    nearest = False
            if nearest and (newest < 0 or (mask >> newest) & 1):
                return mask
    return 0


@kernel
def _delta_sign(exact, mask, i):
    """Sign of a carried Δ_i(mask)."""
    digits, d = exact.digits, exact.d
    at = delta_at(d, mask, i)
    n = length_of(d, mask)
    if digits[at + n - 1] < 0:
        return -1
    for k in range(n):
        if digits[at + k] != 0:
            return 1
    return 0


@kernel
def set_direction(exact, mask):
    """A positive multiple of the nearest point of points 0 … n − 1, into the direction.

    For one or two points the multiple is the nearest point times ΣΔ. Across three the direction is their normal, of
    degree two instead of five. Returns (digits of a component, whether the direction is zero: the origin is in the
    hull).
    """
    if mask == 7:
        n, side = set_normal(exact)
        return n, side == 0
    digits, d = exact.digits, exact.d
    n = length_of(d, mask)
    total = d if n == 1 else n + d
    zero = True
    for axis in range(3):
        at = direction_at(d, axis)
        set_zero(digits, at, 6 * d)
        for i in range(4):
            if (mask >> i) & 1:
                add_product(digits, at, delta_at(d, mask, i), n, point_at(d, i, axis), d, 1)
        if carry(digits, at, total) != 0:
            zero = False
    return total, zero


@kernel
def reduce_simplex(exact, ids, mask, n):
    """Drop all but the points of the subset, with their Gram entries, and set their Δ; returns how many remain."""
    digits, d = exact.digits, exact.d
    n_kept = 0
    for k in range(n):
        if not (mask >> k) & 1:
            continue
        if n_kept != k:
            ids[2 * n_kept] = ids[2 * k]
            ids[2 * n_kept + 1] = ids[2 * k + 1]
            copy(digits, point_at(d, n_kept, 0), point_at(d, k, 0), 3 * d)
        column = 0
        for j in range(n):
            if (mask >> j) & 1:
                copy(digits, gram_at(d, n_kept, column), gram_at(d, k, j), 2 * d)
                column += 1
        n_kept += 1
    if n_kept < n:
        for subset in range(1, 1 << n_kept):
            if subset & (subset - 1) == 0:
                digits[delta_at(d, subset, lowest_member(subset))] = 1
            for j in range(n_kept):
                if not (subset >> j) & 1:
                    set_delta(exact, subset, j)
    return n_kept


class Excess(NamedTuple):
    """Whether |v| ≤ r, and |v| − r [m], for the nearest point v of a simplex and the sum r of the radii."""

    within: bool
    excess: DD


@kernel
def within_radius(exact, mask, radius_a, radius_b):
    """The `Excess` of the subset that holds the nearest point.

    |v|² = Σ Δ_i (y_i·y_k) / ΣΔ for any k of the subset, so the test is Σ Δ_i (y_i·y_k) ≤ r² ΣΔ.
    """
    digits, d = exact.digits, exact.d
    k = lowest_member(mask)
    n = length_of(d, mask)
    total = scratch_at(d, 0)
    square = scratch_at(d, 1)
    set_zero(digits, total, n)
    set_zero(digits, square, n + 2 * d)
    for i in range(4):
        if (mask >> i) & 1:
            add_number(digits, total, delta_at(d, mask, i), n, 1)
            add_product(digits, square, delta_at(d, mask, i), n, gram_at(d, i, k), 2 * d, 1)
    carry(digits, total, n)
    sign = carry(digits, square, n + 2 * d)
    divisor = as_double_double(digits, total, n)
    distance = dd.unscaled(dd.scaled_sqrt(_over(exact, as_double_double(digits, square, n + 2 * d), divisor)))
    if radius_a == 0.0 and radius_b == 0.0:
        return Excess(sign == 0, distance)
    _subtract_square_of_radii(exact, square, total, n, radius_a, radius_b)
    sign = carry(digits, square, n + 2 * d)
    # |v| − r without cancellation, as (|v|² − r²) / (|v| + r).
    difference = _over(exact, as_double_double(digits, square, n + 2 * d), divisor)
    both = dd.add(distance, two_sum(radius_a, radius_b))
    excess = dd.unscaled(dd.scaled_div(difference, dd.normalized(both)))
    if excess.high == 0.0 and sign != 0:  # vanished, but not 0
        excess = DD(5e-324 * sign, excess.low)
    return Excess(sign <= 0, excess)


@kernel
def _over(exact, a, divisor):
    """A number of degree two over one of degree 0 more, in square metres."""
    ratio = dd.scaled_div(a, divisor)
    return ScaledDD(ratio.value, ratio.exponent + 2 * BITS * exact.grid)


@kernel
def _subtract_square_of_radii(exact, square, total, n, radius_a, radius_b):
    """square −= r² · total."""
    digits, d = exact.digits, exact.d
    radius = scratch_at(d, 2)
    set_zero(digits, radius, d)
    add_double(digits, radius, radius_a, exact.grid)
    add_double(digits, radius, radius_b, exact.grid)
    carry(digits, radius, d)
    power = scratch_at(d, 3)
    set_zero(digits, power, 2 * d)
    add_product(digits, power, radius, d, radius, d, 1)
    carry(digits, power, 2 * d)
    add_product(digits, square, power, 2 * d, total, n, -1)
