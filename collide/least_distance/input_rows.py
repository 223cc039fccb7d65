"""What `meets` is asked, read and checked: doubles scaled by powers of two, their exact integers beside them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collide.argument_checks import array, describe
from collide.errors import InvalidArgument
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers

#: Dimensions answered: what integers do grows with d³, and the numbers of digits with d.
MAX_DIMENSION = 8
#: Magnitudes of coordinates, normals, offsets, and of offsets over normals.
LARGEST, SMALLEST_NORMAL = 1e150, 1e-150
#: Where sizes are within 2^±_EASY no number is scaled.
_EASY = 60


class InputRows(NamedTuple):
    """points, halfspaces : in units of 2^exponent.   scale : 2^exponent."""

    points: HomogeneousRows
    halfspaces: HomogeneousRows
    exponent: int


def read_points(points: ArrayLike) -> np.ndarray:
    """(n, d) finite float64. Raises InvalidArgument."""
    read = array("meets: points", points, "(n, d)", InvalidArgument)
    if read.ndim != 2 or not 1 <= read.shape[1] <= MAX_DIMENSION:
        raise InvalidArgument(
            f"meets: points must be (n, d) with 1 ≤ d ≤ {MAX_DIMENSION}, got {read.shape}: project what has more"
        )
    if not len(read):
        raise InvalidArgument("meets: no points: CH of nothing is empty; hand in at least one")
    _refuse_large("points", read)
    return np.ascontiguousarray(read)


def read_halfspaces(normals: ArrayLike, offsets: ArrayLike, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """((m, d), (m,)) finite float64, no normal zero. Raises InvalidArgument."""
    a = array("meets: normals", normals, "(m, d)", InvalidArgument)
    b = array("meets: offsets", offsets, "(m,)", InvalidArgument)
    if a.ndim != 2 or not len(a):
        raise InvalidArgument(
            f"meets: normals must be (m, d) with m ≥ 1, got {a.shape}: without half-spaces every point is inside"
        )
    if a.shape[1] != dimension:
        raise InvalidArgument(f"meets: points have {dimension} coordinates, normals {a.shape[1]}: give both the same")
    if b.shape != (len(a),):
        raise InvalidArgument(f"meets: offsets must be ({len(a)},), one a normal, got {b.shape}")
    _refuse_large("normals", a)
    _refuse_large("offsets", b)
    sizes = np.abs(a).max(axis=1)
    small = sizes < SMALLEST_NORMAL
    if small.any():
        k = int(np.argmax(small))
        complaint = "is zero and names no half-space" if sizes[k] == 0.0 else f"is shorter than {SMALLEST_NORMAL:g}"
        raise InvalidArgument(f"meets: normals[{k}] {complaint}, got {describe(a[k].tolist())}")
    far = np.abs(b) > LARGEST * np.minimum(sizes, 1.0)
    if far.any():
        k = int(np.argmax(far))
        raise InvalidArgument(
            f"meets: half-space {k} is farther than {LARGEST:g} from the origin: offset {b[k]:g}, normal "
            f"{describe(a[k].tolist())}"
        )
    return np.ascontiguousarray(a), np.ascontiguousarray(b)


def _refuse_large(name: str, values: np.ndarray) -> None:
    largest, least = values.max(), values.min()
    if largest <= LARGEST and least >= -LARGEST:  # NaN fails both
        return
    bad = ~(np.abs(values) <= LARGEST)
    k = int(np.flatnonzero(bad.ravel())[0])
    place = list(map(int, np.unravel_index(k, values.shape)))
    raise InvalidArgument(f"meets: {name}{place} must be a number within ±{LARGEST:g}, got {values.ravel()[k]}")


def input_rows(points: np.ndarray, normals: np.ndarray, offsets: np.ndarray) -> InputRows:
    """The rows of what was read, in units that keep products of doubles within their range."""
    sizes = np.abs(normals).max(axis=1)
    size = max(float(points.max()), -float(points.min())) or float((np.abs(offsets) / sizes).max()) or 1.0
    exponent = math.frexp(size)[1]
    exponent = 0 if abs(exponent) <= _EASY else max(min(exponent, 500), -500)
    point_values = np.ldexp(points, -exponent) if exponent else points
    a, b = normals, np.ldexp(offsets, -exponent) if exponent else offsets
    if not (sizes.min() >= 0.25 and sizes.max() <= 4.0):
        exponents = np.frexp(sizes)[1]
        a, b = np.ldexp(normals, -exponents[:, None]), np.ldexp(b, -exponents)
    up, down = 1 << max(exponent, 0), 1 << max(-exponent, 0)

    def integers_of_point(row: int) -> list[int]:
        numerators, denominator = as_integers(points[row].tolist())
        return [number * down for number in numerators] + [denominator * up]

    def integers_of_halfspace(row: int) -> list[int]:
        numerators, _ = as_integers([*normals[row].tolist(), float(offsets[row])])
        return [number * up for number in numerators[:-1]] + [numerators[-1] * down]

    return InputRows(
        HomogeneousRows(point_values, 1.0, integers_of_point), HomogeneousRows(a, b, integers_of_halfspace), exponent
    )
