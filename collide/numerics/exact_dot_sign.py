"""The exact sign of (a − b)·g for points a, b and a direction g, all of doubles.

A bound on the rounding error decides almost always. Otherwise the product is written as a sum of
doubles without any error, by Knuth's sum and Dekker's product (T. J. Dekker, "A floating-point
technique for extending the available precision", 1971), and the sum is distilled until its sign
shows. Ties are common, since directions are often facet normals: this stage has to be fast, too.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.numerics.error_free import two_product, two_sum

#: Each term goes through four roundings of relative size 2⁻⁵³: a difference, a product, two sums. Seven cover
#: those of the bound itself, too, and the last summand products below the smallest normal double.
_ROUNDING = 7.0 * 2.0**-53
_TINY = 2.0**-1060
#: Doubles that a product of vectors of double-doubles is the exact sum of.
PRODUCT_TERMS = 24
#: The error of a larger product is a double.
_SMALLEST_PRODUCT = 2.0**-900


@kernel
def product_and_bound(ax, ay, az, bx, by, bz, gx, gy, gz):
    """(value, bound): (a − b)·g in doubles, and a bound of its error. Not finite where that overflows."""
    x = (ax - bx) * gx
    y = (ay - by) * gy
    z = (az - bz) * gz
    return x + y + z, (abs(x) + abs(y) + abs(z)) * _ROUNDING + _TINY


@kernel
def _sign_of_sum(a, b, c, d, e, f):
    """Sign of the exact sum of six doubles.

    Each sweep adds from the left and leaves the errors behind: the sum stays, the rest shrinks by 2⁴⁸.
    """
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
def _sign_of_long_sum(a, b, c, d, e, f, g, h, i, j, k, m):
    """The same for twelve."""
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
def exact_sign(ax, ay, az, bx, by, bz, gx, gy, gz):
    """Sign of (a − b)·g. The direction must lie in the range that `layout.exact_range` tells."""
    dx, ex = two_sum(ax, -bx)
    dy, ey = two_sum(ay, -by)
    dz, ez = two_sum(az, -bz)
    x, x_low = two_product(dx, gx)
    y, y_low = two_product(dy, gy)
    z, z_low = two_product(dz, gz)
    if ex == 0.0 and ey == 0.0 and ez == 0.0:
        return _sign_of_sum(x, y, z, x_low, y_low, z_low)
    u, u_low = two_product(ex, gx)
    v, v_low = two_product(ey, gy)
    w, w_low = two_product(ez, gz)
    return _sign_of_long_sum(x, y, z, x_low, y_low, z_low, u, v, w, u_low, v_low, w_low)


@kernel
def exact_sign_of_pairs(ax, ax_low, ay, ay_low, az, az_low, gx, gx_low, gy, gy_low, gz, gz_low, terms):
    """(certain, sign) of a·g, for two vectors of double-doubles. Not certain where products are too small to be exact.

    terms : PRODUCT_TERMS doubles to work in.
    """
    certain = _set_products(ax, ax_low, gx, gx_low, terms, 0)
    certain = _set_products(ay, ay_low, gy, gy_low, terms, 8) and certain
    certain = _set_products(az, az_low, gz, gz_low, terms, 16) and certain
    return certain, sign_of_terms(terms, PRODUCT_TERMS) if certain else 0


@kernel
def _set_products(a, a_low, g, g_low, terms, at):
    """Put the eight doubles whose sum is a·g at ``at``; whether it is that exactly."""
    certain = True
    for k in range(4):
        p = a if k < 2 else a_low
        q = g if k % 2 == 0 else g_low
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


@kernel
def scaled_into_range(least, most, target, gx, gy, gz):
    """(certain, gx, gy, gz): the direction times a power of two, and whether `exact_sign` is exact for it."""
    x = abs(gx)
    y = abs(gy)
    z = abs(gz)
    largest = max(x, y, z)
    smallest = min(x if x > 0.0 else largest, y if y > 0.0 else largest, z if z > 0.0 else largest)
    if not (x < math.inf and y < math.inf and z < math.inf):
        return False, gx, gy, gz
    if largest == 0.0 or (smallest >= least and largest <= most):
        return True, gx, gy, gz
    shift = int(target) - math.frexp(largest)[1]
    # Smaller components may be lost on the way down: then they are below range, too.
    certain = math.ldexp(smallest, shift) >= least
    return certain, math.ldexp(gx, shift), math.ldexp(gy, shift), math.ldexp(gz, shift)
