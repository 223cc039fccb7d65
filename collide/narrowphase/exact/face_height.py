"""How far the origin lies from a face's plane, in double-doubles, where integers would hand over the same bits.

The exact stage writes doubles around a distance, and a unit vector. Both are rounded from numbers good to more bits, so
double-doubles will do wherever their error cannot change what is rounded (A. Ziv, "Fast evaluation of elementary
mathematical functions with correctly rounded last bit", 1991): a gap of 1e-9 of the size, nearly always; a gap near
rounding where nothing was rounded off, as of boxes along the axes of the world.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import EXACT_ERROR
from collide.narrowphase.exact.filtered_gjk import face_at
from collide.numerics import bounded
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, DDVec3
from collide.numerics.vec3 import Vec3, norm1

#: A root, a product of vectors and a quotient in double-doubles, relatively, and the error of integers' own digits,
#: which is two conversions of 2⁻⁸⁰ each.
_ROUNDED = 2.0**-78
#: Directions, and heights times a direction's length, between these neither overflow nor vanish when multiplied.
_SHORTEST, _LONGEST = 2.0**-200, 2.0**200


class FaceHeight(NamedTuple):
    """proven : whether `distance` and `direction`, once rounded, have the bits of the exact numbers.

    distance : of the origin from the plane [m].   direction : normal of the face on the face's side of
        the origin, each component rounded to nearest.
    """

    proven: bool
    distance: DD
    direction: Vec3


@kernel
def face_height(points):
    """The `FaceHeight` of points 0, 1, 2.   points : of `search_filtered`, or of `side_of_facets`."""
    p, normal = face_at(points)
    height = bounded.dot(normal, p)
    if height.high < 0.0:
        normal, height = bounded.neg_vec3(normal), bounded.neg(height)
    x, y, z = normal.x, normal.y, normal.z
    direction = Vec3(x.high, y.high, z.high)
    size = norm1(direction)
    if not (_SHORTEST < size < _LONGEST and _SHORTEST * size < height.high < _LONGEST * size):
        return FaceHeight(False, DD(0.0, 0.0), direction)
    exact = DDVec3(DD(x.high, x.low), DD(y.high, y.low), DD(z.high, z.low))
    length = dd.sqrt(dd.inner(exact, exact))
    distance = dd.div(DD(height.high, height.low), length)
    # A length is off by no more than the sum of its components' errors.
    relative = 2.0 * (height.error / height.high + (x.error + y.error + z.error) / length.high) + _ROUNDED
    error, margin = relative * distance.high, EXACT_ERROR * distance.high
    # What is written is the double, and whether the number, a margin less or more, lies below or above the double.
    is_clear = abs(abs(distance.low) - margin) > error and _rounds_to(distance.high, distance.low, error + margin)
    is_rounded = _rounds_to(x.high, x.low, x.error) and _rounds_to(y.high, y.low, y.error)
    is_rounded = is_rounded and _rounds_to(z.high, z.low, z.error)
    return FaceHeight(is_clear and is_rounded, distance, direction)


@kernel(inline=True)
def _rounds_to(high, low, error):
    """Whether all numbers within twice an error of high + low round to high."""
    return high + (low - 2.0 * error) == high and high + (low + 2.0 * error) == high
