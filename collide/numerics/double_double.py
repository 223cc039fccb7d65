"""Double-doubles: numbers of 106 bits, the sum of two doubles, the second at most half an ulp of the first.

T. J. Dekker 1971; the algorithms and their error bounds after Joldes, Muller and Popescu, "Tight and rigorous
error bounds for basic building blocks of double-word arithmetic" (ACM TOMS 44, 2017). With u = 2⁻⁵³ a sum, a
product, a quotient or a root is good to a relative 16 u² = 2⁻¹⁰², barring overflow and underflow: operands
should lie between 2⁻⁴⁰⁰ and 2⁴⁰⁰, or be 0.

Operands are `DD`s of doubles, or of `Lanes` for eight numbers at once. Names are read with the module's:
``dd.add``, ``dd.inner``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.kernels.lanes import root_of, select
from collide.numerics.error_free import DD, two_product, two_sum
from collide.numerics.vec3 import Vec3

#: Relative error of an operation of this file.
ROUNDING = 2.0**-102
#: A little more than half an ulp, relatively: adding or taking off as much rounds to the neighbouring double.
_TO_NEIGHBOUR = 2.0**-53 * (1.0 + 2.0**-52)
#: Doubles of a stored `DDVec3`.
STRIDE = 6


@kernel(inline=True)
def quick_two_sum(a, b):
    """`two_sum` for |a| ≥ |b|."""
    total = a + b
    return DD(total, b - (total - a))


@kernel(inline=True)
def add(a, b):
    """a + b, to a relative 3u²."""
    s = two_sum(a.high, b.high)
    t = two_sum(a.low, b.low)
    s = quick_two_sum(s.high, s.low + t.high)
    return quick_two_sum(s.high, s.low + t.low)


@kernel(inline=True)
def sloppy_add(a, b):
    """a + b, off by 4u² of |a| + |b|: two thirds of the work of `add`."""
    s = two_sum(a.high, b.high)
    return quick_two_sum(s.high, s.low + (a.low + b.low))


@kernel(inline=True)
def neg(a):
    return DD(-a.high, -a.low)


@kernel(inline=True)
def sub(a, b):
    """a − b, to a relative 3u²."""
    return add(a, neg(b))


@kernel(inline=True)
def mul(a, b):
    """a·b, to a relative 8u²."""
    product = unnormalized_mul(a, b)
    return quick_two_sum(product.high, product.low)


@kernel(inline=True)
def unnormalized_mul(a, b):
    """`mul` whose low part may be a few ulps of the high one."""
    product = two_product(a.high, b.high)
    return DD(product.high, product.low + (a.high * b.low + a.low * b.high))


@kernel(inline=True)
def div(a, b):
    """a / b, to a relative 16u²: the quotient of the leading parts, and that of the remainder."""
    q = a.high / b.high
    remainder = sub(a, mul(DD(q, 0.0), b))
    return quick_two_sum(q, (remainder.high + remainder.low) / b.high)


@kernel(inline=True)
def sqrt(a):
    """√a for a ≥ 0, to a relative 8u²: one step of Newton from the root of the leading part."""
    positive = a.high > 0.0
    root = root_of(select(positive, a.high, 1.0))
    square = two_product(root, root)
    remainder = ((a.high - square.high) - square.low) + a.low
    root, low = quick_two_sum(root, remainder / (2.0 * root))
    return DD(select(positive, root, 0.0), select(positive, low, 0.0))


@kernel(inline=True)
def scale(factor, a):
    """A power of two times a."""
    return DD(a.high * factor, a.low * factor)


@kernel(inline=True)
def dd_select(condition, a, b):
    """`select` of both parts."""
    return DD(select(condition, a.high, b.high), select(condition, a.low, b.low))


@kernel(inline=True)
def less(a, b):
    return a.high < b.high or (a.high == b.high and a.low < b.low)


class Bracket(NamedTuple):
    """Doubles around a number: lower ≤ nearest ≤ upper, as close to each other as doubles allow."""

    lower: float
    nearest: float
    upper: float


@kernel(inline=True)
def bracket(a, error):
    """The `Bracket` of all numbers within ``error`` of a."""
    s, e = two_sum(a.high, a.low - error)
    lower = select(e >= 0.0, s, s - abs(s) * _TO_NEIGHBOUR)
    s, e = two_sum(a.high, a.low + error)
    upper = select(e <= 0.0, s, s + abs(s) * _TO_NEIGHBOUR)
    return Bracket(lower, a.high + a.low, upper)


# --- beyond the range of doubles ------------------------------------------------------------------


class ScaledDD(NamedTuple):
    """value · 2^exponent."""

    value: DD
    exponent: int


@kernel
def ldexp(x, exponent):
    """x·2^exponent, with exponents far out of range brought to where they still give 0 or infinity."""
    return math.ldexp(x, int(min(max(exponent, -5000), 5000)))


@kernel
def ldexp_dd(a, exponent):
    return DD(ldexp(a.high, exponent), ldexp(a.low, exponent))


@kernel
def unscaled(a):
    """A `ScaledDD` as a double-double, rounded to 0 or infinity where it is out of range."""
    return ldexp_dd(a.value, a.exponent)


@kernel
def scaled_sqrt(a):
    """√a of a `ScaledDD`: a power of four is taken out first, so that nothing tiny vanishes."""
    odd = a.exponent & 1
    return ScaledDD(sqrt(ldexp_dd(a.value, odd)), (a.exponent - odd) // 2)


@kernel
def normalized(a):
    """A double-double as a `ScaledDD` of size ½ to 1."""
    exponent = math.frexp(a.high)[1]
    return ScaledDD(ldexp_dd(a, -exponent), exponent)


@kernel
def scaled_div(a, b):
    return ScaledDD(div(a.value, b.value), a.exponent - b.exponent)


# --- vectors --------------------------------------------------------------------------------------


class DDVec3(NamedTuple):
    """A vector of three double-doubles."""

    x: DD
    y: DD
    z: DD


@kernel(inline=True)
def vec3_at(values, at):
    """Three double-doubles stored as six consecutive doubles, or Lanes: high and low parts of x, y and z in turn."""
    return DDVec3(
        DD(values[at], values[at + 1]), DD(values[at + 2], values[at + 3]), DD(values[at + 4], values[at + 5])
    )


@kernel(inline=True)
def put_vec3(values, at, a):
    values[at] = a.x.high
    values[at + 1] = a.x.low
    values[at + 2] = a.y.high
    values[at + 3] = a.y.low
    values[at + 4] = a.z.high
    values[at + 5] = a.z.low


@kernel(inline=True)
def exact_vec3(a):
    """A `Vec3` of doubles as it is."""
    return DDVec3(DD(a.x, 0.0), DD(a.y, 0.0), DD(a.z, 0.0))


@kernel(inline=True)
def leading(a):
    """The `Vec3` of leading parts."""
    return Vec3(a.x.high, a.y.high, a.z.high)


@kernel(inline=True)
def difference(a, b):
    """a − b of two `Vec3` of doubles, exactly."""
    return DDVec3(two_sum(a.x, -b.x), two_sum(a.y, -b.y), two_sum(a.z, -b.z))


@kernel(inline=True)
def neg_vec3(a):
    return DDVec3(neg(a.x), neg(a.y), neg(a.z))


@kernel(inline=True)
def scale_vec3(factor, a):
    """A power of two, or ±1, times a."""
    return DDVec3(scale(factor, a.x), scale(factor, a.y), scale(factor, a.z))


@kernel(inline=True)
def sub_vec3(a, b):
    """a − b, each component to a relative 3u²."""
    return DDVec3(sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z))


@kernel(inline=True)
def add_vec3(a, b):
    """a + b, each component to a relative 3u²."""
    return DDVec3(add(a.x, b.x), add(a.y, b.y), add(a.z, b.z))


@kernel(inline=True)
def times_vec3(s, a):
    """A double-double times a."""
    return DDVec3(mul(s, a.x), mul(s, a.y), mul(s, a.z))


@kernel(inline=True)
def select_vec3(condition, a, b):
    return DDVec3(dd_select(condition, a.x, b.x), dd_select(condition, a.y, b.y), dd_select(condition, a.z, b.z))


@kernel(inline=True)
def cross(a, b):
    """a × b, each component to 2⁻¹⁰¹·(|products|)."""
    return DDVec3(_determinant(a.y, a.z, b.y, b.z), _determinant(a.z, a.x, b.z, b.x), _determinant(a.x, a.y, b.x, b.y))


@kernel(inline=True)
def _determinant(a, b, c, d):
    """a·d − b·c, to 13u²·(|a·d| + |b·c|): lower parts are at most 4u of that, and rounded in three sums."""
    p = two_product(a.high, d.high)
    q = two_product(b.high, c.high)
    s, e = two_sum(p.high, -q.high)
    lower = (p.low + (a.high * d.low + a.low * d.high)) - (q.low + (b.high * c.low + b.low * c.high))
    return two_sum(s, e + lower)


@kernel(inline=True)
def inner(a, b):
    """a·b, to 2⁻¹⁰¹·Σ|products|."""
    total = unnormalized_inner(a, b)
    return two_sum(total.high, total.low)


@kernel(inline=True)
def inner_vec3(a, x):
    """a·x for a `Vec3` a of doubles, as `inner`."""
    total, rest = two_product(a.x, x.x.high)
    second, third = two_product(a.y, x.y.high), two_product(a.z, x.z.high)
    total, error = two_sum(total, second.high)
    rest += error + second.low
    total, error = two_sum(total, third.high)
    rest += (error + third.low) + (a.x * x.x.low + a.y * x.y.low + a.z * x.z.low)
    return two_sum(total, rest)


@kernel(inline=True)
def unnormalized_inner(a, b):
    """a·b as two doubles, the second of which may be larger than the first, to 25u²·Σ|products|.

    Errors of products and sums, and lower parts, are at most 5u·Σ|products| together; sums of them round by 24u².
    """
    x = two_product(a.x.high, b.x.high)
    y = two_product(a.y.high, b.y.high)
    z = two_product(a.z.high, b.z.high)
    total, first_error = two_sum(x.high, y.high)
    error = (x.low + y.low) + first_error
    total, second_error = two_sum(total, z.high)
    low = (
        (a.x.high * b.x.low + a.x.low * b.x.high)
        + (a.y.high * b.y.low + a.y.low * b.y.high)
        + (a.z.high * b.z.low + a.z.low * b.z.high)
    )
    return DD(total, error + ((z.low + second_error) + low))
