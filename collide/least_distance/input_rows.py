"""What `meets` is asked, read and checked: doubles scaled by powers of two, their exact integers beside them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collide.base.argument_checks import array
from collide.errors import InvalidArgument, brief
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers

#: Dimensions answered: what integers do grows with d³, and the numbers of digits with d.
MAX_DIMENSION = 8
#: Magnitudes of coordinates, normals, offsets, and of offsets over normals.
LARGEST, SMALLEST_NORMAL = 1e150, 1e-150
#: Where sizes are within 2^±_EASY no number is scaled.
_EASY = 60


class InputRows(NamedTuple):
    """What was asked, in units of 2^exponent.

    points, halfspaces : each row with its exact integers.   exponent : of the unit.
    normals : (m, d) float64, as they were given.
    """

    points: HomogeneousRows
    halfspaces: HomogeneousRows
    exponent: int
    normals: np.ndarray


def input_rows(points: ArrayLike, normals: ArrayLike, offsets: ArrayLike) -> InputRows:
    """The rows of a question, checked, in units for which products of doubles stay in range.

    Parameters
    ----------
    points, normals, offsets : array_like
        As `meets` takes them.

    Raises
    ------
    InvalidArgument
        Naming the argument, its fault and the row.
    """
    p, size = read_points(points)
    a, b, sizes = read_halfspaces(normals, offsets, p.shape[1])
    exponent = math.frexp(size or float((np.abs(b) / sizes).max()) or 1.0)[1]
    exponent = 0 if abs(exponent) <= _EASY else max(min(exponent, 500), -500)
    point_values, values, last = p, a, b
    if exponent:
        point_values, last = np.ldexp(p, -exponent), np.ldexp(b, -exponent)
    if not (sizes.min() >= 0.25 and sizes.max() <= 4.0):
        exponents = np.frexp(sizes)[1]
        values, last = np.ldexp(a, -exponents[:, None]), np.ldexp(last, -exponents)
    up, down = 1 << max(exponent, 0), 1 << max(-exponent, 0)

    def integers_of_point(row: int) -> list[int]:
        numerators, denominator = as_integers(p[row].tolist())
        return [number * down for number in numerators] + [denominator * up]

    def integers_of_halfspace(row: int) -> list[int]:
        numerators, _ = as_integers([*a[row].tolist(), float(b[row])])
        return [number * up for number in numerators[:-1]] + [numerators[-1] * down]

    return InputRows(
        HomogeneousRows(point_values, 1.0, integers_of_point, magnitude=math.ldexp(size, -exponent)),
        HomogeneousRows(values, last, integers_of_halfspace), exponent, a,
    )


def read_points(points: ArrayLike) -> tuple[np.ndarray, float]:
    """((n, d) float64, the largest magnitude)."""
    read = array("meets: points", points, "(n, d)", InvalidArgument)
    if read.ndim != 2 or not 1 <= read.shape[1] <= MAX_DIMENSION:
        raise InvalidArgument(
            f"meets: points must be (n, d) with 1 ≤ d ≤ {MAX_DIMENSION}, got {read.shape}: project what has more"
        )
    if not len(read):
        raise InvalidArgument(f"meets: points is empty, {read.shape}: CH of nothing is empty; hand in at least one")
    return np.ascontiguousarray(read), _largest("points", read)


def read_halfspaces(normals: ArrayLike, offsets: ArrayLike, d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((m, d), (m,) float64, the largest magnitude in each normal)."""
    a = array("meets: normals", normals, "(m, d)", InvalidArgument)
    b = array("meets: offsets", offsets, "(m,)", InvalidArgument)
    if a.ndim != 2 or not len(a):
        raise InvalidArgument(
            f"meets: normals must be (m, d) with m ≥ 1, got {a.shape}: without half-spaces every point is inside"
        )
    if a.shape[1] != d:
        raise InvalidArgument(f"meets: points are (n, {d}), but normals {a.shape}: give both as many columns")
    if b.shape != (len(a),):
        raise InvalidArgument(f"meets: offsets must be ({len(a)},), one a row of normals {a.shape}, got {b.shape}")
    _largest("normals", a)
    _largest("offsets", b)
    sizes, offset_sizes = np.abs(a[:, 0]), np.abs(b)
    for axis in range(1, d):  # many times faster than max(axis=1)
        np.maximum(sizes, np.abs(a[:, axis]), out=sizes)
    k = int(sizes.argmin())
    if sizes[k] < SMALLEST_NORMAL:
        complaint = "is zero and names no half-space" if sizes[k] == 0.0 else f"is shorter than {SMALLEST_NORMAL:g}"
        raise InvalidArgument(f"meets: normals[{k}] {complaint}, got {brief(a[k].tolist())}")
    far = offset_sizes > LARGEST * np.minimum(sizes, 1.0)
    if far.any():
        k = int(np.argmax(far))
        raise InvalidArgument(
            f"meets: half-space {k} is farther than {LARGEST:g} from the origin: offset {b[k]:g}, normal "
            f"{brief(a[k].tolist())}"
        )
    return np.ascontiguousarray(a), np.ascontiguousarray(b), sizes


def _largest(name: str, values: np.ndarray) -> float:
    """The largest magnitude. Raises InvalidArgument where it is out of range."""
    largest = max(float(values.max()), -float(values.min()))
    if largest <= LARGEST:  # NaN fails
        return largest
    bad = ~(np.abs(values) <= LARGEST)
    k = int(np.flatnonzero(bad.ravel())[0])
    place = list(map(int, np.unravel_index(k, values.shape)))
    raise InvalidArgument(f"meets: {name}{place} must be a number within ±{LARGEST:g}, got {values.ravel()[k]}")
