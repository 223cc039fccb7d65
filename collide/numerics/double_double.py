"""Numbers of 106 bits: the sum of two doubles, the second at most half a unit in the last place of the first.

T. J. Dekker 1971; the algorithms and their error bounds after Joldes, Muller and Popescu, "Tight and rigorous
error bounds for basic building blocks of double-word arithmetic" (ACM TOMS 44, 2017). With u = 2⁻⁵³ a sum, a
product, a quotient or a root is good to a relative 16 u² = 2⁻¹⁰², barring overflow and underflow: what goes in
should lie between 2⁻⁴⁰⁰ and 2⁴⁰⁰, or be 0.

A number is passed as two doubles, or as two `Lanes` for eight numbers at once, and returned as a pair.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.kernels.lanes import root_of, select
from collide.numerics.error_free import two_product, two_sum

#: Relative error of an operation of this file.
ROUNDING = 2.0**-102
_TO_NEIGHBOUR = 2.0**-53 * (1.0 + 2.0**-52)


@kernel(inline=True)
def quick_sum(a, b):
    """(s, e) as `two_sum`, for |a| ≥ |b|."""
    total = a + b
    return total, b - (total - a)


@kernel(inline=True)
def add(a, a_low, b, b_low):
    """a + b, to a relative 3u²."""
    s, e = two_sum(a, b)
    t, f = two_sum(a_low, b_low)
    s, e = quick_sum(s, e + t)
    return quick_sum(s, e + f)


@kernel(inline=True)
def subtract(a, a_low, b, b_low):
    """a − b, to a relative 3u²."""
    return add(a, a_low, -b, -b_low)


@kernel(inline=True)
def multiply(a, a_low, b, b_low):
    """a·b, to a relative 8u²."""
    product, error = two_product(a, b)
    return quick_sum(product, error + (a * b_low + a_low * b))


@kernel(inline=True)
def divide(a, a_low, b, b_low):
    """a / b, to a relative 16u²: the quotient of the leading parts, and that of what it leaves."""
    q = a / b
    product, error = multiply(q, 0.0, b, b_low)
    rest, rest_low = add(a, a_low, -product, -error)
    return quick_sum(q, (rest + rest_low) / b)


@kernel(inline=True)
def square_root(a, a_low):
    """√a for a ≥ 0, to a relative 8u²: one step of Newton from the root of the leading part."""
    positive = a > 0.0
    root = root_of(select(positive, a, 1.0))
    square, error = two_product(root, root)
    rest = ((a - square) - error) + a_low
    root, rest = quick_sum(root, rest / (2.0 * root))
    return select(positive, root, 0.0), select(positive, rest, 0.0)


@kernel(inline=True)
def cross(ax, ax_low, ay, ay_low, az, az_low, bx, bx_low, by, by_low, bz, bz_low):
    """a × b, each component to 2⁻¹⁰¹·(|products|)."""
    x, x_low = _determinant(ay, ay_low, az, az_low, by, by_low, bz, bz_low)
    y, y_low = _determinant(az, az_low, ax, ax_low, bz, bz_low, bx, bx_low)
    z, z_low = _determinant(ax, ax_low, ay, ay_low, bx, bx_low, by, by_low)
    return x, x_low, y, y_low, z, z_low


@kernel(inline=True)
def _determinant(a, a_low, b, b_low, c, c_low, d, d_low):
    """a·d − b·c, to 13u²·(|a·d| + |b·c|): lower parts are at most 4u of that, and rounded in three sums."""
    p, e = two_product(a, d)
    q, f = two_product(b, c)
    s, g = two_sum(p, -q)
    return two_sum(s, g + ((e + (a * d_low + a_low * d)) - (f + (b * c_low + b_low * c))))


@kernel(inline=True)
def product_of_vectors(ax, ax_low, ay, ay_low, az, az_low, bx, bx_low, by, by_low, bz, bz_low):
    """a·b, to 2⁻¹⁰¹·Σ|products|."""
    total, rest = loose_product(ax, ax_low, ay, ay_low, az, az_low, bx, bx_low, by, by_low, bz, bz_low)
    return two_sum(total, rest)


@kernel(inline=True)
def loose_product(ax, ax_low, ay, ay_low, az, az_low, bx, bx_low, by, by_low, bz, bz_low):
    """a·b as two doubles, the second of which may be larger than the first, to 25u²·Σ|products|.

    Errors of products and sums, and lower parts, are at most 5u·Σ|products| together; sums of them round by 24u².
    """
    total, e = two_product(ax, bx)
    term, f = two_product(ay, by)
    total, g = two_sum(total, term)
    rest = (e + f) + g
    term, f = two_product(az, bz)
    total, g = two_sum(total, term)
    low = (ax * bx_low + ax_low * bx) + (ay * by_low + ay_low * by) + (az * bz_low + az_low * bz)
    return total, rest + ((f + g) + low)


@kernel(inline=True)
def bracket(a, a_low, error):
    """(lower, nearest, upper): doubles around every number within ``error`` of a; as close as doubles allow.

    Adding or taking off a little more than half a unit in the last place rounds to the neighbour.
    """
    s, e = two_sum(a, a_low - error)
    lower = select(e >= 0.0, s, s - abs(s) * _TO_NEIGHBOUR)
    s, e = two_sum(a, a_low + error)
    upper = select(e <= 0.0, s, s + abs(s) * _TO_NEIGHBOUR)
    return lower, a + a_low, upper
