"""Numbers as programs for hosts hand them over: what is none is refused by name, as the host's own bindings do.

`TypeError` is what bindings raise for an argument of another type; numbers that cannot be used are `InvalidArgument`,
which is a `ValueError`. A number too large for a double is infinite, and refused where it must be finite.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument


def real(name: str, value: Any) -> float:
    """A real number as a double. Raises TypeError."""
    if value.__class__ is float:
        return value
    read = checks.number(value)
    if read is None:
        raise TypeError(f"{name} must be a number, got {checks.brief(value)}")
    return read


def whole(name: str, value: Any) -> int:
    """An integer of 64 bits; the part before the point of what has one. Raises TypeError, InvalidArgument."""
    read = real(name, value)
    if math.isnan(read) or abs(read) >= 2.0**63:
        raise InvalidArgument(f"{name} must be an integer below 2**63, got {checks.brief(value)}")
    return int(value)


def row(name: str, value: Any, count: int) -> int:
    """The number of one of ``count`` things. Raises TypeError, InvalidArgument."""
    k = whole(name, value)
    if not 0 <= k < count:
        raise InvalidArgument(f"{name} must be one of 0 … {count - 1}, {count} in all, got {k}")
    return k


def shaped(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Numbers of this shape, float64: the very array where it is one already. Raises InvalidArgument."""
    if value.__class__ is np.ndarray and value.shape == shape and value.dtype == np.float64:
        return value
    array = checks.array(name, value, str(shape), InvalidArgument)
    if array.shape != shape:
        raise InvalidArgument(f"{name} must have shape {shape}, got {array.shape}")
    return array


def rows_of_three(name: str, value: Any) -> np.ndarray:
    """Points (n, 3), at least one, float64, a copy. Raises InvalidArgument."""
    array = np.array(checks.array(name, value, "(n, 3)", InvalidArgument))
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise InvalidArgument(f"{name} must be points (n, 3), at least one, got shape {array.shape}")
    return array


def of_kind(name: str, value: Any, kind: type) -> Any:
    """An object of the host's. Raises TypeError."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be a {kind.__name__}, got {checks.brief(value)}")
    return value
