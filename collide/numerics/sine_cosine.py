"""Sine and cosine in kernels: the same bits on every processor, as the C library does not promise.

Reduction to within π/4 in three parts, then fdlibm's polynomials (Sun Microsystems 1993; Cody and Waite 1980). Absolute
error ≤ 2 u, u = 2⁻⁵³, for 0 ≤ angle ≤ LARGEST_ANGLE; tests compare with fractions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.kernels.lanes import select

#: Angles up to this [rad]: a quarter quadrant's first part, of 33 bits, times their number of quarter turns is exact.
LARGEST_ANGLE = 1e6

#: A quarter quadrant in two parts: 33 bits, and the rest to 2⁻⁸⁶.
_QUARTER, _QUARTER_REST = 1.57079632673412561417, 6.07710050650619224932e-11
_PER_QUARTER = 0.636619772367581382433
#: Doubles from here on are integers.
_INTEGERS = 2.0**52


class SineCosine(NamedTuple):
    sine: float
    cosine: float


@kernel(inline=True)
def floor_of(y):
    """The integer at or below y ≥ 0: sums with 2⁵² are rounded to integers. Larger numbers are integers."""
    nearest = (y + _INTEGERS) - _INTEGERS
    below = select(nearest > y, nearest - 1.0, nearest)
    return select(y < _INTEGERS, below, y)


@kernel(inline=True)
def sine_cosine(angle):
    """The `SineCosine` of an angle [rad], 0 ≤ angle ≤ LARGEST_ANGLE, or of `Lanes` of them: the same bits."""
    quarters = floor_of(angle * _PER_QUARTER + 0.5)
    head = angle - quarters * _QUARTER
    rest = quarters * _QUARTER_REST
    x = head - rest
    low = (head - x) - rest
    z = x * x
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * (
        -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))
    sine = x - ((z * (0.5 * low - z * x * r) - low) + z * x * 1.66666666666666324348e-01)
    r = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * (
        2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
    r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * r))
    half = 0.5 * z
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * r - x * low))
    quadrant = quarters - 4.0 * floor_of(0.25 * quarters)
    is_odd = (quadrant == 1.0) | (quadrant == 3.0)
    up = select(is_odd, cosine, sine)
    along = select(is_odd, sine, cosine)
    return SineCosine(
        select(quadrant > 1.5, -up, up), select((quadrant == 1.0) | (quadrant == 2.0), -along, along)
    )


@kernel
def angle_of(sine, cosine):
    """The angle in 0 … π whose sine ≥ 0 and cosine are in this ratio [rad].

    A first guess by a short series, then x + sin(angle − x), whose error is a sixth of the guess's error cubed.
    """
    length = math.sqrt(sine * sine + cosine * cosine)
    if length == 0.0:
        return 0.0
    sine, cosine = sine / length, cosine / length
    small, large = min(sine, abs(cosine)), max(sine, abs(cosine))
    t = small / large
    guess = t * (0.999 + t * t * (-0.2886 + t * t * 0.0793))
    if sine > abs(cosine):
        guess = 1.5707963267948966 - guess
    if cosine < 0.0:
        guess = 3.141592653589793 - guess
    for _ in range(2):
        at = sine_cosine(guess)
        guess = min(max(guess + (sine * at.cosine - cosine * at.sine), 0.0), 3.141592653589793)
    return guess
