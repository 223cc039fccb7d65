"""The length of a vector, rounded once: what `math.hypot` gives, for C, whose own need not be."""

from __future__ import annotations

import math

from collide.kernels import entry
from collide.numerics import double_double as dd
from collide.numerics.error_free import two_product


@entry("float64(float64, float64, float64)")
def root_of_squares(x, y, z):
    """The root of x² + y² + z² in twice the precision, rounded to nearest."""
    exponent = math.frexp(max(abs(x), abs(y), abs(z)))[1]
    x, y, z = math.ldexp(x, -exponent), math.ldexp(y, -exponent), math.ldexp(z, -exponent)
    square = dd.add(dd.add(two_product(x, x), two_product(y, y)), two_product(z, z))
    return math.ldexp(dd.sqrt(square).high, exponent)
