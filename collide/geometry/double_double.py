"""Numbers of 106 bits: the sum of two doubles, the second at most half a unit in the last place of the first.

T. J. Dekker 1971; the algorithms and their error bounds after Joldes, Muller and Popescu, "Tight and rigorous
error bounds for basic building blocks of double-word arithmetic" (ACM TOMS 44, 2017). With u = 2⁻⁵³ a sum, a
product, a quotient or a root is good to a relative 16 u² = 2⁻¹⁰², barring overflow and underflow: what goes in
should lie between 2⁻⁴⁰⁰ and 2⁴⁰⁰, or be 0.

A number is passed as two doubles and returned as a pair.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.geometry.error_free import two_product, two_sum

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
    if a <= 0.0:
        return 0.0, 0.0
    root = math.sqrt(a)
    square, error = two_product(root, root)
    rest = ((a - square) - error) + a_low
    return quick_sum(root, rest / (2.0 * root))


@kernel(inline=True)
def cross(ax, ax_low, ay, ay_low, az, az_low, bx, bx_low, by, by_low, bz, bz_low):
    """a × b, each component to 2⁻¹⁰¹·(|products|)."""
    p, p_low = multiply(ay, ay_low, bz, bz_low)
    q, q_low = multiply(az, az_low, by, by_low)
    x, x_low = subtract(p, p_low, q, q_low)
    p, p_low = multiply(az, az_low, bx, bx_low)
    q, q_low = multiply(ax, ax_low, bz, bz_low)
    y, y_low = subtract(p, p_low, q, q_low)
    p, p_low = multiply(ax, ax_low, by, by_low)
    q, q_low = multiply(ay, ay_low, bx, bx_low)
    z, z_low = subtract(p, p_low, q, q_low)
    return x, x_low, y, y_low, z, z_low


@kernel(inline=True)
def product_of_vectors(ax, ax_low, ay, ay_low, az, az_low, bx, bx_low, by, by_low, bz, bz_low):
    """a·b, to 2⁻¹⁰⁰·Σ|products|."""
    x, x_low = multiply(ax, ax_low, bx, bx_low)
    y, y_low = multiply(ay, ay_low, by, by_low)
    z, z_low = multiply(az, az_low, bz, bz_low)
    x, x_low = add(x, x_low, y, y_low)
    return add(x, x_low, z, z_low)


@kernel(inline=True)
def bracket(a, a_low, error):
    """(lower, nearest, upper): doubles around every number within ``error`` of a; as close as doubles allow.

    Adding or taking off a little more than half a unit in the last place rounds to the neighbour.
    """
    s, e = two_sum(a, a_low - error)
    lower = s if e >= 0.0 else s - abs(s) * _TO_NEIGHBOUR
    s, e = two_sum(a, a_low + error)
    upper = s if e <= 0.0 else s + abs(s) * _TO_NEIGHBOUR
    return lower, a + a_low, upper
