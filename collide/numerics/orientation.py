"""The orientation predicate: on which side of a plane a point lies, exactly for any finite doubles.

Four stages, each evaluated only where the stage before leaves the sign open: plain doubles with an error bound;
double-doubles with an error bound 2⁵¹ times smaller; expansions (Priest; Shewchuk, "Adaptive precision floating-point
arithmetic and fast robust geometric predicates", 1997), exact while nothing underflows; integers of many digits
(`numerics/digits.py`), always exact.

A point cloud comes twice (`CloudView`): ``scaled`` by a power of two so that the largest coordinate lies in [1/2, 1),
and ``originals``. Coordinates below 2⁻¹⁰²² of the largest are rounded by the scaling, so the last stage reads the
originals. ``work`` begins with two numbers about the cloud (`survey`), the rest is workspace for sums:

* threshold: 0, or the magnitude below which a nonzero original keeps its test from the expansions;
* quantum: where all scaled coordinates are multiples of 2^-k, k ≤ 33, a determinant is a multiple of 2^-3k, and so 0 if
known to be smaller: this settles the ties of points on a lattice. Else 0.

u is 2⁻⁵³, half the distance from 1 to the next double. No step may be contracted to a fused multiply-add.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.numerics import double_double as dd
from collide.numerics.digits import BITS, add_double, add_product, carry, grid_of, lowest_bit, set_zero
from collide.numerics.error_free import DD, two_product, two_sum

#: Doubles in ``work``: two numbers, nine differences in two parts, a minor (≤ 16) and a determinant (≤ 192).
WORK = 256
_DIFFERENCES = 2
_MINOR = 20
_TOTAL = 40
#: Integers in ``digits``: 14 numbers' worth of digits; a difference of two doubles has at most 84.
DIGITS = 14 * 84
#: Expansions multiply three coordinates with lowest bits ≥ 2⁻³³³: 2⁻⁹⁹⁹ does not underflow.
_SMALLEST_BIT = 280
#: A finer lattice's quantum lies below what double-doubles can tell from 0. Adding and taking away
#: 1.5·2⁵² rounds a number of so few bits to an integer.
_MAX_LATTICE_BITS = 33
_ROUNDER = 6755399441055744.0

#: Doubles: a term of the determinant is the product of three rounded differences (3 u), rounded as
#: it is multiplied (2 u), subtracted (1 u) and added (2 u): (1 + u)⁸ − 1 times the sum of the terms'
#: magnitudes, which itself is known to (1 + u)⁸. Twice that is more than enough.
_DOUBLE_ERROR = 2.0**-49
#: Double-doubles: differences are exact. A product leaves out the product of the tails and rounds
#: three times at the size of a tail, below 6 u²; a sum rounds two tails' sums, below 4 u² of the
#: magnitudes. Two products and three sums deep: 24 u². The rest covers the bound's own rounding.
_DD_ERROR = 2.0**-100
#: What underflow adds, in the scaling and in products of numbers below 4, is far below this.
UNDERFLOW = 2.0**-1000


class CloudView(NamedTuple):
    """Points in kernels.

    scaled, originals : three doubles a row; scaled = originals · 2^−exponent.
    work, digits : workspace of `orientation`.
    centres : row of centre 0 of a perturbation (`papers/hierarchies/symbolic_perturbation.py`); the others follow it.
    Where only exact tests are made, centres and exponent are not read.
    """

    scaled: Any
    originals: Any
    work: Any
    digits: Any
    centres: int
    exponent: int


@kernel
def survey(originals, points, count, work):
    """Scale the cloud into ``points`` and note threshold and quantum; returns the exponent divided by."""
    largest = 0.0
    for k in range(3 * count):
        largest = max(largest, abs(originals[k]))
    exponent = math.frexp(largest)[1]
    # In two steps, since 2^1073 is no double.
    half = -exponent // 2
    factor0 = math.ldexp(1.0, half)
    factor1 = math.ldexp(1.0, -exponent - half)
    threshold = max(math.ldexp(1.0, exponent - _SMALLEST_BIT), 5e-324)
    wide = False
    bits = 0
    steps = 1.0
    for k in range(3 * count):
        x = originals[k] * factor0 * factor1
        points[k] = x
        wide = wide or 0.0 < abs(originals[k]) < threshold
        while bits <= _MAX_LATTICE_BITS and (x * steps + _ROUNDER) - _ROUNDER != x * steps:
            bits += 1
            steps *= 2.0
    work[0] = threshold if wide else 0.0
    work[1] = math.ldexp(1.0, -3 * bits) if bits <= _MAX_LATTICE_BITS and not wide else 0.0
    return exponent


@kernel
def orientation(cloud, a, b, c, d, axis):
    """Sign of (b − a) × (c − a) · (d − a): 1 where d sees a, b, c counter-clockwise, else 0 or −1.

    axis : −1; or 0, 1, 2 for the unit vector of this axis in place of d − a, with d = a: the orientation of a
        triangle projected along the axis.

    The corner nearest to d is made the first: the terms of the determinant, and with them the margins, shrink with its
    distance from d. A cloud crowded together in one place needs this.
    """
    points, work = cloud.scaled, cloud.work
    if axis < 0:
        near_a = distance1(points, a, d)
        near_b = distance1(points, b, d)
        near_c = distance1(points, c, d)
        if near_b < near_a and near_b <= near_c:
            a, b, c = b, c, a
        elif near_c < near_a:
            a, b, c = c, a, b
    write_differences(points, work, a, b, c, d, axis)
    value, size = double_determinant(work)
    margin = _DOUBLE_ERROR * size + UNDERFLOW
    if abs(value) > margin:
        return 1 if value > 0.0 else -1
    if abs(value) + margin < work[1]:
        return 0
    if work[0] != 0.0 and too_wide(cloud.originals, work[0], a, b, c, d):
        return by_digits(cloud.originals, cloud.digits, a, b, c, d, axis)
    # From here on nothing underflows: a sum of terms 0 is truly 0.
    if size == 0.0:
        return 0
    value = dd_determinant(work)
    margin = _DD_ERROR * size
    if abs(value) > margin:
        return 1 if value > 0.0 else -1
    if abs(value) + margin < work[1]:
        return 0
    return by_expansions(work)


@kernel
def distance1(points, a, b):
    """Sum of the coordinates' differences of two points."""
    total = 0.0
    for k in range(3):
        total += abs(points[3 * a + k] - points[3 * b + k])
    return total


@kernel(inline=True)
def one_of_four(k, a, b, c, d):
    """Number k of four: kernels cannot index a tuple by a variable."""
    if k == 0:
        return a
    if k == 1:
        return b
    return c if k == 2 else d


@kernel
def too_wide(originals, threshold, a, b, c, d):
    """Whether one of the points has a coordinate too small for expansions."""
    for corner in range(4):
        point = one_of_four(corner, a, b, c, d)
        for k in range(3 * point, 3 * point + 3):
            if 0.0 < abs(originals[k]) < threshold:
                return True
    return False


@kernel
def write_differences(points, work, a, b, c, d, axis):
    """The rows b − a, c − a, d − a into ``work``, each entry as head and tail; row 3 may be a unit vector."""
    for k in range(3):
        at = _DIFFERENCES + 2 * k
        base = -points[3 * a + k]
        work[at], work[at + 1] = two_sum(points[3 * b + k], base)
        work[at + 6], work[at + 7] = two_sum(points[3 * c + k], base)
        work[at + 12], work[at + 13] = two_sum(points[3 * d + k], base)
        if axis >= 0:
            work[at + 12] = 1.0 if k == axis else 0.0
            work[at + 13] = 0.0


@kernel(inline=True)
def write_difference(points, base, tip, work, row):
    """The difference of the points that stand at two places as a row of ``work``, for `sign_of_rows`."""
    for k in range(3):
        at = _DIFFERENCES + 6 * row + 2 * k
        work[at], work[at + 1] = two_sum(points[tip + k], -points[base + k])


@kernel
def sign_of_rows(work):
    """Exact sign of the determinant of three differences, where nothing underflows: no lowest bit below 2⁻³³³."""
    value, size = double_determinant(work)
    if abs(value) > _DOUBLE_ERROR * size:
        return 1 if value > 0.0 else -1
    value = dd_determinant(work)
    if abs(value) > _DD_ERROR * size:
        return 1 if value > 0.0 else -1
    return by_expansions(work)


@kernel
def double_determinant(work):
    """The determinant of the differences' heads, and the sum of its terms' magnitudes."""
    value = 0.0
    size = 0.0
    for k in range(3):
        i = _DIFFERENCES + 2 * ((k + 1) % 3)
        j = _DIFFERENCES + 2 * ((k + 2) % 3)
        p = work[i] * work[j + 6]
        q = work[j] * work[i + 6]
        w = work[_DIFFERENCES + 12 + 2 * k]
        value += w * (p - q)
        size += abs(w) * (abs(p) + abs(q))
    return value, size


@kernel(inline=True)
def _dd_at(work, k):
    return DD(work[k], work[k + 1])


@kernel
def dd_determinant(work):
    """The determinant of the differences, rounded from double-doubles good to 24 u² of its terms' magnitudes."""
    total = DD(0.0, 0.0)
    for k in range(3):
        i = _DIFFERENCES + 2 * ((k + 1) % 3)
        j = _DIFFERENCES + 2 * ((k + 2) % 3)
        w = _DIFFERENCES + 12 + 2 * k
        p = dd.unnormalized_mul(_dd_at(work, i), _dd_at(work, j + 6))
        q = dd.unnormalized_mul(_dd_at(work, j), _dd_at(work, i + 6))
        minor = dd.sloppy_add(p, dd.neg(q))
        total = dd.sloppy_add(total, dd.unnormalized_mul(minor, _dd_at(work, w)))
    return total.high


@kernel
def add_to_expansion(work, at, n, x, y):
    """Add x·y to the expansion of n parts at ``at``; returns its new length, without parts that are 0."""
    product, part = two_product(x, y)
    for _ in range(2):
        out = at
        for k in range(at, at + n):
            part, rest = two_sum(part, work[k])
            if rest != 0.0:
                work[out] = rest
                out += 1
        if part != 0.0:
            work[out] = part
            out += 1
        n = out - at
        part = product
    return n


@kernel
def by_expansions(work):
    """Exact sign of the determinant of the differences in ``work``."""
    n = 0
    for k in range(3):
        i = _DIFFERENCES + 2 * ((k + 1) % 3)
        j = _DIFFERENCES + 2 * ((k + 2) % 3)
        m = 0
        for part in range(8):
            p = i + (part & 1)
            q = j + 6 + ((part >> 1) & 1)
            sign = 1.0
            if part >= 4:
                p += j - i
                q += i - j
                sign = -1.0
            m = add_to_expansion(work, _MINOR, m, sign * work[p], work[q])
        w = _DIFFERENCES + 12 + 2 * k
        for part in range(w, w + 2):
            if work[part] != 0.0:
                for t in range(_MINOR, _MINOR + m):
                    n = add_to_expansion(work, _TOTAL, n, work[t], work[part])
    if n == 0:
        return 0
    return 1 if work[_TOTAL + n - 1] > 0.0 else -1


@kernel
def by_digits(originals, digits, a, b, c, d, axis):
    """Exact sign of the determinant of the differences, from the originals; row 3 may be a unit vector."""
    lowest = 2000
    highest = -2000
    for corner in range(4):
        point = one_of_four(corner, a, b, c, d)
        for k in range(3 * point, 3 * point + 3):
            lowest = min(lowest, lowest_bit(originals[k]))
            if originals[k] != 0.0:
                highest = max(highest, math.frexp(originals[k])[1])
    if lowest == 2000:
        return 0
    grid = grid_of(lowest)
    n = (highest - BITS * grid) // BITS + 2
    minor = 9 * n
    total = 11 * n
    set_zero(digits, total, 3 * n)
    for cell in range(9):
        at = cell * n
        set_zero(digits, at, n)
        if cell >= 6 and axis >= 0:
            digits[at] = 1 if cell == 6 + axis else 0
        else:
            point = b if cell < 3 else (c if cell < 6 else d)
            sign = 1.0
            for _ in range(2):
                add_double(digits, at, sign * originals[3 * point + cell % 3], grid)
                point = a
                sign = -1.0
            carry(digits, at, n)
    for k in range(3):
        i = ((k + 1) % 3) * n
        j = ((k + 2) % 3) * n
        set_zero(digits, minor, 2 * n)
        add_product(digits, minor, i, n, j + 3 * n, n, 1)
        add_product(digits, minor, j, n, i + 3 * n, n, -1)
        carry(digits, minor, 2 * n)
        add_product(digits, total, (6 + k) * n, n, minor, 2 * n, 1)
    return carry(digits, total, 3 * n)
