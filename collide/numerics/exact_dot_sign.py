"""The exact sign of (a − b)·g for points a, b and a direction g, all of doubles.

A bound on the rounding error decides almost always. Otherwise the product is written as a sum of
doubles without any error, by Knuth's sum and Dekker's product (T. J. Dekker, "A floating-point
technique for extending the available precision", 1971), and the sum is distilled until its sign
shows. Ties are common, since directions are often facet normals: this stage has to be fast, too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.double_double import difference
from collide.numerics.error_free import two_product, two_sum
from collide.numerics.vec3 import Vec3

#: Each term goes through four roundings of relative size 2⁻⁵³: a difference, a product, two sums. Seven cover
#: those of the bound itself, too, and the last summand products below the smallest normal double.
_ROUNDING = 7.0 * 2.0**-53
_TINY = 2.0**-1060
#: Doubles that a product of vectors of double-doubles is the exact sum of.
PRODUCT_TERMS = 24
#: The error of a larger product is a double.
_SMALLEST_PRODUCT = 2.0**-900


@kernel
def product_and_bound(a, b, g):
    """(value, bound): (a − b)·g in doubles, and a bound of its error. Not finite where that overflows."""
    x = (a.x - b.x) * g.x
    y = (a.y - b.y) * g.y
    z = (a.z - b.z) * g.z
    return x + y + z, (abs(x) + abs(y) + abs(z)) * _ROUNDING + _TINY


@kernel
def _sign_of_sum(x, y, z):
    """Sign of the exact sum of three double-doubles.

    Each sweep adds from the left and leaves the errors behind: the sum stays, the rest shrinks by 2⁴⁸.
    """
    a, b, c, d, e, f = x.high, y.high, z.high, x.low, y.low, z.low
    while True:
        s, a = two_sum(a, b)
        s, b = two_sum(s, c)
        s, c = two_sum(s, d)
        s, d = two_sum(s, e)
        s, e = two_sum(s, f)
        rest = abs(a) + abs(b) + abs(c) + abs(d) + abs(e)
        if abs(s) > 2.0 * rest or rest == 0.0:
            return 1 if s > 0.0 else (-1 if s < 0.0 else 0)
        f = s


@kernel
def _sign_of_long_sum(x, y, z, u, v, w):
    """The same for six."""
    a, b, c, d, e, f = x.high, y.high, z.high, x.low, y.low, z.low
    g, h, i, j, k, m = u.high, v.high, w.high, u.low, v.low, w.low
    while True:
        s, a = two_sum(a, b)
        s, b = two_sum(s, c)
        s, c = two_sum(s, d)
        s, d = two_sum(s, e)
        s, e = two_sum(s, f)
        s, f = two_sum(s, g)
        s, g = two_sum(s, h)
        s, h = two_sum(s, i)
        s, i = two_sum(s, j)
        s, j = two_sum(s, k)
        s, k = two_sum(s, m)
        rest = abs(a) + abs(b) + abs(c) + abs(d) + abs(e) + abs(f) + abs(g) + abs(h) + abs(i) + abs(j) + abs(k)
        if abs(s) > 2.0 * rest or rest == 0.0:
            return 1 if s > 0.0 else (-1 if s < 0.0 else 0)
        m = s


@kernel
def exact_sign(a, b, g):
    """Sign of (a − b)·g. The direction must lie in the range of `tree_layout.write_range`."""
    d = difference(a, b)
    x = two_product(d.x.high, g.x)
    y = two_product(d.y.high, g.y)
    z = two_product(d.z.high, g.z)
    if d.x.low == 0.0 and d.y.low == 0.0 and d.z.low == 0.0:
        return _sign_of_sum(x, y, z)
    u = two_product(d.x.low, g.x)
    v = two_product(d.y.low, g.y)
    w = two_product(d.z.low, g.z)
    return _sign_of_long_sum(x, y, z, u, v, w)


@kernel
def exact_sign_of_dot(a, g, terms):
    """(certain, sign) of a·g, for two `DDVec3`. Not certain where products are too small to be exact.

    terms : workspace of PRODUCT_TERMS doubles.
    """
    certain = _put_products(a.x, g.x, terms, 0)
    certain = _put_products(a.y, g.y, terms, 8) and certain
    certain = _put_products(a.z, g.z, terms, 16) and certain
    return certain, sign_of_terms(terms, PRODUCT_TERMS) if certain else 0


@kernel
def _put_products(a, g, terms, at):
    """Write eight doubles at ``at``, whose exact sum is a·g; False where underflow may break the equality."""
    certain = True
    for k in range(4):
        p = a.high if k < 2 else a.low
        q = g.high if k % 2 == 0 else g.low
        terms[at + 2 * k], terms[at + 2 * k + 1] = two_product(p, q)
        certain = certain and (p == 0.0 or q == 0.0 or abs(terms[at + 2 * k]) > _SMALLEST_PRODUCT)
    return certain


@kernel
def sign_of_terms(terms, n):
    """Sign of the exact sum of n doubles, at most 2¹⁰; they are changed."""
    while True:
        total = terms[0]
        rest = 0.0
        for k in range(1, n):
            total, terms[k - 1] = two_sum(total, terms[k])
            rest += abs(terms[k - 1])
        if abs(total) > 2.0 * rest or rest == 0.0:
            return 1 if total > 0.0 else (-1 if total < 0.0 else 0)
        terms[n - 1] = total


class ScaledDirection(NamedTuple):
    """exact : whether `exact_sign` is exact for g."""

    exact: bool
    g: Vec3


@kernel
def scaled_into_range(least, largest_allowed, target, g):
    """The direction times a power of two, its components in [least, largest_allowed] where some power allows.

    target : exponent of the largest component afterwards.
    """
    x = abs(g.x)
    y = abs(g.y)
    z = abs(g.z)
    largest = max(x, y, z)
    smallest = min(x if x > 0.0 else largest, y if y > 0.0 else largest, z if z > 0.0 else largest)
    if not (x < math.inf and y < math.inf and z < math.inf):
        return ScaledDirection(False, g)
    if largest == 0.0 or (smallest >= least and largest <= largest_allowed):
        return ScaledDirection(True, g)
    shift = int(target) - math.frexp(largest)[1]
    # Smaller components may be lost on the way down: then they are below range, too.
    exact = math.ldexp(smallest, shift) >= least
    return ScaledDirection(exact, Vec3(math.ldexp(g.x, shift), math.ldexp(g.y, shift), math.ldexp(g.z, shift)))
