"""Integers of any length in kernels: runs of signed digits in an int64 workspace.

A number is n consecutive digits in base 2²⁶, lowest first: value = Σ d_k 2^(26 k), times a power of two (its *grid*, an
exponent in units of BITS, known to its user). Digits may leave their range while terms are summed (2¹⁰ products of two
digits fit in 63 bits); `carry` brings them back, after which all but the highest lie in [0, 2²⁶) and the number's sign
is the sign of its highest digit.

Polynomials of doubles are exact this way, since a double is an integer times a power of two. Expansions of doubles
(Priest, Shewchuk) would take seven components for a coordinate of a posed vertex, and thousands for a determinant of
posed vertices.
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

    From the top into 61 bits. The leading −1 of a negative number and the full digits behind it cancel exactly; if a
    bit further down is not 0, the last bit kept is set, so the rounding to 53 bits sees a tie broken.
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

    Digits are added from the top, without rounding, until their sum has 80 bits; the last digit adds at most 26, and a
    double-double holds 106.
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


@kernel
def add_determinant(digits, u, v, w, n, minor, total):
    """Add the determinant of three vectors of n digits a component to a number of 3 n digits and more.

    minor : 2 n digits of workspace.   All are carried, the sum is not.
    """
    for k in range(3):
        i, j = ((k + 1) % 3) * n, ((k + 2) % 3) * n
        set_zero(digits, minor, 2 * n)
        add_product(digits, minor, v + i, n, w + j, n, 1)
        add_product(digits, minor, v + j, n, w + i, n, -1)
        carry(digits, minor, 2 * n)
        add_product(digits, total, u + k * n, n, minor, 2 * n, 1)


# --- quotients ------------------------------------------------------------------------------------

#: Digits of workspace of a quotient, beside twice those of the longer number.
QUOTIENT_WORKSPACE = 23


@kernel
def quotient(digits, a, na, b, nb, exponent, work):
    """(the double nearest to (number a)·2^exponent / (number b), ties to even; whether both are equal).

    Both numbers are carried, b is not 0.   work : twice the longer number's digits and QUOTIENT_WORKSPACE.
    Infinite where the quotient rounds to infinity. Long division by estimates in doubles, each good to 50 bits of the
    remainder: O(na + nb) four times.
    """
    x, x_exponent = as_double(digits, a, na)
    y, y_exponent = as_double(digits, b, nb)
    if x == 0.0:
        return 0.0, True
    # a·2^shift / b has 59 to 61 bits: five more, at least, than a double.
    shift = 60 - math.frexp(x)[1] - x_exponent + math.frexp(y)[1] + y_exponent
    n = max(na, nb) + 10
    rest, divisor, step = work, work + n, work + 2 * n
    sign = _put_size(digits, rest, n, a, na, max(shift, 0)) * _put_size(digits, divisor, n, b, nb, max(-shift, 0))
    y, y_exponent = as_double(digits, divisor, n)
    q = 0
    remaining = 1
    for _ in range(3):  # what remains is at most 2⁶¹, then 2¹², then one divisor
        x, x_exponent = as_double(digits, rest, n)
        estimate = math.floor(math.ldexp(x / y, int(x_exponent - y_exponent)) + 0.5)
        set_zero(digits, step, 3)
        add_double(digits, step, float(estimate), 0)
        carry(digits, step, 3)
        add_product(digits, rest, step, 3, divisor, n - 3, -1)
        remaining = carry(digits, rest, n)
        q += int(estimate)
    if remaining < 0:
        q -= 1
    size, is_exact = _nearest_double(q, remaining != 0, exponent - shift)
    return sign * size, is_exact


@kernel
def _put_size(digits, out, n, a, na, bits):
    """Write |number a|·2^bits into n digits, enough to hold the product; returns the number's sign."""
    set_zero(digits, out, n)
    copy(digits, out, a, na)
    sign = carry(digits, out, n)
    if sign < 0:
        negate(digits, out, n)
    places, within = bits // BITS, bits % BITS
    for k in range(n - 1, -1, -1):
        digit = digits[out + k]
        digits[out + k] = 0
        if digit != 0:
            digits[out + k + places] = digit << within
    carry(digits, out, n)
    return sign


@kernel
def _nearest_double(q, has_more, exponent):
    """(the double nearest to (q + r)·2^exponent, whether they are equal); q of 58 to 62 bits, 0 < r < 1 if has_more,
    else r = 0."""
    last = max(math.frexp(float(q))[1] + exponent - 53, -1074)  # exponent of the double's last bit
    drop = last - exponent
    if drop > 62:
        return 0.0, False
    rest, half = q & ((1 << drop) - 1), 1 << (drop - 1)
    is_exact = rest == 0 and not has_more
    q >>= drop
    if rest > half or (rest == half and (has_more or q & 1 == 1)):
        q += 1
    if math.frexp(float(q))[1] + last > 1024:
        return math.inf, False
    return math.ldexp(float(q), int(last)), is_exact
