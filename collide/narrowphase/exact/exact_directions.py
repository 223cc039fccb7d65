"""Directions of the exact stage: normals of three points, their lengths, and where points lie along them."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.exact.exact_workspace import direction_at, point_at, scratch_at
from collide.numerics import double_double as dd
from collide.numerics.digits import BITS, add_number, add_product, as_double, as_double_double, carry, negate, set_zero
from collide.numerics.double_double import ScaledDD
from collide.numerics.vec3 import Vec3


class Normal(NamedTuple):
    """A direction normal to points 0, 1, 2.

    n : digits of a component.
    side : 1 where the origin lies behind the points as they stand counter-clockwise, −1 where
    before them, 0 where in their plane.
    """

    n: int
    side: int


@kernel
def set_edge(exact, k, i, j):
    """Edge k of three in scratch 0 becomes point i − point j."""
    digits, d = exact.digits, exact.d
    for axis in range(3):
        at = edge_at(d, k, axis)
        set_zero(digits, at, d)
        add_number(digits, at, point_at(d, i, axis), d, 1)
        add_number(digits, at, point_at(d, j, axis), d, -1)
        carry(digits, at, d)


@kernel
def edge_at(d, k, axis):
    return scratch_at(d, 0) + (3 * k + axis) * d


@kernel
def set_cross(exact, out, e, f, axis):
    """A component of the cross product of edges e and f, 2·D digits."""
    digits, d = exact.digits, exact.d
    i = (axis + 1) % 3
    j = (axis + 2) % 3
    set_zero(digits, out, 2 * d)
    add_product(digits, out, edge_at(d, e, i), d, edge_at(d, f, j), d, 1)
    add_product(digits, out, edge_at(d, e, j), d, edge_at(d, f, i), d, -1)
    carry(digits, out, 2 * d)


@kernel
def set_normal(exact):
    """The normal of points 0, 1, 2, on the side that they lie on, seen from the origin, into the direction."""
    digits, d = exact.digits, exact.d
    set_edge(exact, 0, 1, 0)
    set_edge(exact, 1, 2, 0)
    height = scratch_at(d, 1)
    set_zero(digits, height, 3 * d)
    for axis in range(3):
        out = direction_at(d, axis)
        set_cross(exact, out, 0, 1, axis)
        add_product(digits, height, out, 2 * d, point_at(d, 0, axis), d, 1)
    side = carry(digits, height, 3 * d)
    if side < 0:
        reverse_direction(exact, 2 * d)
    return Normal(2 * d, side)


@kernel
def reverse_direction(exact, n):
    for axis in range(3):
        negate(exact.digits, direction_at(exact.d, axis), n)


@kernel
def direction_length(exact, n):
    """Length of the direction, whose components have n digits: a `ScaledDD`, 0 where it is 0."""
    digits, d = exact.digits, exact.d
    square = scratch_at(d, 0)
    set_zero(digits, square, 2 * n)
    for axis in range(3):
        add_product(digits, square, direction_at(d, axis), n, direction_at(d, axis), n, 1)
    carry(digits, square, 2 * n)
    return dd.scaled_sqrt(as_double_double(digits, square, 2 * n))


@kernel
def height_along(exact, n, length, k):
    """Coordinate of point k along the direction [m], a double-double.   length : `direction_length`."""
    side_of(exact, n, k)
    product = as_double_double(exact.digits, scratch_at(exact.d, 0), n + exact.d)
    height = dd.scaled_div(product, length)
    return dd.unscaled(ScaledDD(height.value, height.exponent + BITS * exact.grid))


@kernel
def direction_double(exact, n):
    """The direction as a `Vec3`, to a relative 2⁻⁵⁰ of its length, and up to a power of two."""
    digits, d = exact.digits, exact.d
    x, ex = as_double(digits, direction_at(d, 0), n)
    y, ey = as_double(digits, direction_at(d, 1), n)
    z, ez = as_double(digits, direction_at(d, 2), n)
    e = -(10**6)
    if x != 0.0:
        e = ex + math.frexp(x)[1]
    if y != 0.0:
        e = max(e, ey + math.frexp(y)[1])
    if z != 0.0:
        e = max(e, ez + math.frexp(z)[1])
    return Vec3(dd.ldexp(x, ex - e), dd.ldexp(y, ey - e), dd.ldexp(z, ez - e))


@kernel
def side_of(exact, n, k):
    """Sign of point k along the direction; the product stands in scratch 0."""
    digits, d = exact.digits, exact.d
    out = scratch_at(d, 0)
    set_zero(digits, out, n + d)
    for axis in range(3):
        add_product(digits, out, direction_at(d, axis), n, point_at(d, k, axis), d, 1)
    return carry(digits, out, n + d)
