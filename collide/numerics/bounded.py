"""Double-doubles with a bound of their own error, for filters: a sum of two doubles, and how far off the sum may be.

Each operation adds to the bound what the operation itself has rounded off, known from error-free transformations. So
the bound is 0 wherever nothing was rounded, and a filter made of these numbers proves zeros, too: zeros of coordinates
of few bits, and of sums whose terms vanish, as for faces across an axis of the world. Filters with bounds known
beforehand (S. Fortune, C. J. Van Wyk, "Efficient exact arithmetic for computational geometry", 1993) leave every zero
to integers.

The operations ask: no product and no part of a product may underflow, nothing may overflow. The caller sees to both by
the lowest bits and the sizes of the numbers given.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.numerics.error_free import two_product, two_sum

#: `sign` of a number whose bound reaches over 0.
UNKNOWN = 2
#: Covers the roundings of a bound itself, at most 16 sums and products of numbers that are not negative: 16u = 2⁻⁴⁹.
_INFLATED = 1.0 + 2.0**-48
#: What a product's lower part is rounded by, in units of its terms |c₁| + |c₂| + |e|: u for each of the products c₁ and
#: c₂, u for their sum, u for the sum with e.
_LOWER_ROUNDED = 2.0**-51


class Bounded(NamedTuple):
    """high + low, |low| at most half an ulp of high, which is off by ``error`` at most."""

    high: float
    low: float
    error: float


class BoundedVec3(NamedTuple):
    x: Any
    y: Any
    z: Any


@kernel(inline=True)
def exact_difference(x, y):
    """x − y of two doubles."""
    s = two_sum(x, -y)
    return Bounded(s.high, s.low, 0.0)


@kernel
def add(a, b):
    """a + b. Rounded off is what two sums of lower parts lose."""
    s = two_sum(a.high, b.high)
    t = two_sum(a.low, b.low)
    low = two_sum(s.low, t.high)
    s = two_sum(s.high, low.high)
    return Bounded(s.high, s.low, (a.error + b.error + abs(t.low) + abs(low.low)) * _INFLATED)


@kernel(inline=True)
def neg(a):
    return Bounded(-a.high, -a.low, a.error)


@kernel(inline=True)
def sub(a, b):
    return add(a, neg(b))


@kernel
def mul(a, b):
    """a·b, off by |a|·e_b + |b|·e_a + e_a·e_b, and by what is rounded: nothing where both lower parts are 0."""
    p = two_product(a.high, b.high)
    c, d = a.high * b.low, a.low * b.high
    s = two_sum(p.high, p.low + (c + d))
    size = abs(c) + abs(d)
    rounded = _LOWER_ROUNDED * (size + abs(p.low)) + abs(a.low * b.low) if size > 0.0 else 0.0
    error = abs(a.high) * b.error + abs(b.high) * a.error + a.error * b.error + rounded
    return Bounded(s.high, s.low, error * _INFLATED)


@kernel
def add_product(a, x, y):
    """a + x·y of two doubles, the lower part gathered apart: |low| may be large until `settled`."""
    p = two_product(x, y)
    s = two_sum(a.high, p.high)
    low = two_sum(a.low, p.low)
    both = two_sum(low.high, s.low)
    return Bounded(s.high, both.high, a.error + abs(low.low) + abs(both.low))


@kernel
def settled(a):
    """A sum of up to eight of `add_product`, as a `Bounded`."""
    s = two_sum(a.high, a.low)
    return Bounded(s.high, s.low, a.error * _INFLATED)


@kernel(inline=True)
def sign(a):
    """−1, 0, 1, or UNKNOWN. |low| ≤ u|high|, so that |high| > error (1 + 2u) and a little proves the sign of high."""
    if abs(a.high) > a.error * _INFLATED:
        return 1 if a.high > 0.0 else -1
    return 0 if a.error == 0.0 else UNKNOWN


# --- vectors --------------------------------------------------------------------------------------


@kernel(inline=True)
def neg_vec3(a):
    return BoundedVec3(neg(a.x), neg(a.y), neg(a.z))


@kernel
def sub_vec3(a, b):
    return BoundedVec3(sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z))


@kernel
def add_vec3(a, b):
    return BoundedVec3(add(a.x, b.x), add(a.y, b.y), add(a.z, b.z))


@kernel
def scale_vec3(factor, a):
    return BoundedVec3(mul(factor, a.x), mul(factor, a.y), mul(factor, a.z))


@kernel
def dot(a, b):
    return add(add(mul(a.x, b.x), mul(a.y, b.y)), mul(a.z, b.z))


@kernel
def sparse_dot(a, b):
    """a·b of a vector with zeros, known exactly: terms of a component 0 are left out."""
    total = Bounded(0.0, 0.0, 0.0)
    if a.x.high != 0.0:
        total = mul(a.x, b.x)
    if a.y.high != 0.0:
        total = mul(a.y, b.y) if a.x.high == 0.0 else add(total, mul(a.y, b.y))
    if a.z.high != 0.0:
        is_first = a.x.high == 0.0 and a.y.high == 0.0
        total = mul(a.z, b.z) if is_first else add(total, mul(a.z, b.z))
    return total


@kernel
def cross(a, b):
    return BoundedVec3(
        sub(mul(a.y, b.z), mul(a.z, b.y)), sub(mul(a.z, b.x), mul(a.x, b.z)), sub(mul(a.x, b.y), mul(a.y, b.x))
    )


@kernel(inline=True)
def vec3_at(values, at):
    """Nine consecutive doubles, as written by `put_vec3`."""
    return BoundedVec3(
        Bounded(values[at], values[at + 1], values[at + 2]), Bounded(values[at + 3], values[at + 4], values[at + 5]),
        Bounded(values[at + 6], values[at + 7], values[at + 8]),
    )


@kernel(inline=True)
def put(values, at, a):
    values[at] = a.high
    values[at + 1] = a.low
    values[at + 2] = a.error
