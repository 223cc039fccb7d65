"""Integers of any length in kernels: runs of signed digits in an int64 workspace.

A number is n consecutive digits in base 2²⁶, lowest first: value = Σ d_k 2^(26 k), times a power of two
(its *grid*, an exponent in units of BITS) that its user keeps track of. Digits may leave their range while terms
are summed (2¹⁰ products of two of them fit in 63 bits); `carry` brings them back, after which all but the highest
lie in [0, 2²⁶) and the number's sign is that of its highest digit.

Polynomials of doubles are exact this way, since a double is an integer times a power of two. Expansions of doubles
(Priest, Shewchuk) would take seven components for a coordinate of a posed vertex, and thousands for a determinant
of such coordinates.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.numerics.double_double import ScaledDD
from collide.numerics.error_free import DD, two_sum

#: Bits of a digit.
BITS = 26
_MASK = (1 << BITS) - 1
#: The shorter factor of a product may have this many digits: sums of 8 such products stay below 2⁶³.
LONGEST_FACTOR = 128


@kernel
def lowest_bit(x):
    """Exponent of the lowest set bit of a double: x is an odd integer times 2 to it; 2000 for 0."""
    if x == 0.0:
        return 2000
    fraction, exponent = math.frexp(x)
    mantissa = int(fraction * 9007199254740992.0)  # 2⁵³
    low = mantissa & -mantissa
    return exponent - 53 + (math.frexp(float(low))[1] - 1)


@kernel
def grid_of(exponent):
    """Index of the digit that holds the bit of this exponent: floor(exponent / BITS)."""
    return exponent // BITS


@kernel
def set_zero(digits, at, n):
    for k in range(n):
        digits[at + k] = 0


@kernel
def add_double(digits, at, x, grid):
    """Add x to a number whose digit 0 stands for 2^(BITS·grid); x must have no lower bit."""
    if x == 0.0:
        return
    fraction, exponent = math.frexp(x)
    mantissa = int(abs(fraction) * 9007199254740992.0)
    sign = 1 if x > 0.0 else -1
    shift = exponent - 53 - BITS * grid
    while shift < 0:  # trailing zero bits of the mantissa, by the caller's promise
        drop = min(-shift, BITS)
        mantissa >>= drop
        shift += drop
    k = at + shift // BITS
    within = shift % BITS
    digits[k] += sign * ((mantissa & ((1 << (BITS - within)) - 1)) << within)
    mantissa >>= BITS - within
    while mantissa > 0:
        k += 1
        digits[k] += sign * (mantissa & _MASK)
        mantissa >>= BITS


@kernel
def add_product(digits, out, a, na, b, nb, sign):
    """digits[out:] += sign · (number a) · (number b); both carried."""
    for i in range(na):
        factor = sign * digits[a + i]
        if factor != 0:
            for j in range(nb):
                digits[out + i + j] += factor * digits[b + j]


@kernel
def add_number(digits, out, a, n, sign):
    """digits[out:] += sign · (number a)."""
    for k in range(n):
        digits[out + k] += sign * digits[a + k]


@kernel
def carry(digits, at, n):
    """Bring digits into range; returns the sign of the number: −1, 0 or 1."""
    over = 0
    lower_digits = 0
    for k in range(at, at + n - 1):
        value = digits[k] + over
        over = value >> BITS
        digits[k] = value & _MASK
        lower_digits |= digits[k]
    digits[at + n - 1] += over
    highest = digits[at + n - 1]
    if highest < 0:
        return -1
    return 1 if (highest > 0 or lower_digits != 0) else 0


@kernel
def as_double(digits, at, n):
    """(x, e): the carried number is x·2^e, x rounded to nearest, so a power of two changes e alone.

    From the top into 61 bits. The leading −1 of a negative number and the full digits behind it cancel
    exactly; of lower digits only the last bit says whether there are any.
    """
    value = 0
    k = n - 1
    while k >= 0 and abs(value) < 1 << 35:
        value = (value << BITS) + digits[at + k]
        k -= 1
    exponent = BITS * (k + 1)
    if k < 0:
        return float(value), exponent
    shift = 0
    while abs(value) << shift < 1 << 60:
        shift += 1
    value = (value << shift) + (digits[at + k] >> (BITS - shift))
    rest = digits[at + k] & ((1 << (BITS - shift)) - 1)
    for j in range(k):
        rest |= digits[at + j]
    if rest != 0:
        value |= 1
    return float(value), exponent - shift


@kernel
def as_double_double(digits, at, n):
    """The carried number as a `ScaledDD`, to a relative 2⁻⁸⁰.

    From the top, without rounding, until 80 bits of it are there; 26 more at most fit in 106.
    """
    high = 0.0
    low = 0.0
    k = n - 1
    while k >= 0 and abs(high) < 1.2e24:  # 2⁸⁰
        high, error = two_sum(high * 67108864.0, low * 67108864.0)  # 2²⁶
        high, low = two_sum(high, float(digits[at + k]))
        high, low = two_sum(high, low + error)
        k -= 1
    return ScaledDD(DD(high, low), BITS * (k + 1))


@kernel
def negate(digits, at, n):
    """The carried number becomes its negative, carried."""
    for k in range(at, at + n):
        digits[k] = -digits[k]
    carry(digits, at, n)


@kernel
def copy(digits, out, a, n):
    for k in range(n):
        digits[out + k] = digits[a + k]
