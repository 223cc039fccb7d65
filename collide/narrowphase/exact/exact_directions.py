"""Directions of the exact stage: normals of three points, their doubles, and the side a point lies on."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.exact.exact_workspace import direction_at, point_at, scratch_at
from collide.numerics.digits import add_number, add_product, as_double, carry, clear


@kernel
def set_normal(digits, d):
    """The normal of points 0, 1, 2, on the side that they lie on, seen from the origin, into the direction.

    Returns (digits it takes, side): 1 where the origin lies behind the points as they stand counter-clockwise, −1 where
    before them, 0 where in their plane.
    """
    for edge in range(2):
        for axis in range(3):
            at = scratch_at(d, 0) + (3 * edge + axis) * d
            clear(digits, at, d)
            add_number(digits, at, point_at(d, edge + 1, axis), d, 1)
            add_number(digits, at, point_at(d, 0, axis), d, -1)
            carry(digits, at, d)
    height = scratch_at(d, 1)
    clear(digits, height, 3 * d)
    for axis in range(3):
        out = direction_at(d, axis)
        e = scratch_at(d, 0)
        f = e + 3 * d
        i = (axis + 1) % 3
        j = (axis + 2) % 3
        clear(digits, out, 2 * d)
        add_product(digits, out, e + i * d, d, f + j * d, d, 1)
        add_product(digits, out, e + j * d, d, f + i * d, d, -1)
        carry(digits, out, 2 * d)
        add_product(digits, height, out, 2 * d, point_at(d, 0, axis), d, 1)
    side = carry(digits, height, 3 * d)
    if side < 0:
        for axis in range(3):
            out = direction_at(d, axis)
            for k in range(2 * d):
                digits[out + k] = -digits[out + k]
            carry(digits, out, 2 * d)
    return 2 * d, side


@kernel
def direction_double(digits, d, n):
    """The direction as doubles, to a relative 2⁻⁵⁰ of its length, and up to a power of two."""
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
    return scaled_by(x, ex - e), scaled_by(y, ey - e), scaled_by(z, ez - e)


@kernel
def scaled_by(x, e):
    """x·2^e, with exponents far out of range brought to where they still give 0 or infinity."""
    return math.ldexp(x, int(min(max(e, -5000), 5000)))


@kernel
def side_of(digits, d, length, k):
    """Sign of point k along the direction."""
    out = scratch_at(d, 0)
    clear(digits, out, length + d)
    for axis in range(3):
        add_product(digits, out, direction_at(d, axis), length, point_at(d, k, axis), d, 1)
    return carry(digits, out, length + d)


@kernel
def is_ahead(digits, d, length, k):
    """Whether point k, the last one against the direction, still lies along it: then all do."""
    return side_of(digits, d, length, k) > 0
