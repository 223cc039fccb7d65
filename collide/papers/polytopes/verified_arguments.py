"""What verifiers are handed, read: arrays of finite doubles of fitting shapes, answers of the kind that is checked."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument


def as_points(caller: str, points: ArrayLike) -> np.ndarray:
    """(n, d) finite float64, n and d at least 1. Raises InvalidArgument."""
    return _finite(f"{caller}: points", points, (None, None))


def as_halfspaces(caller: str, normals: ArrayLike, offsets: ArrayLike, d: int) -> tuple[np.ndarray, np.ndarray]:
    """(m, d) and (m,) finite float64, m at least 1. Raises InvalidArgument."""
    a = _finite(f"{caller}: normals of points with {d} coordinates", normals, (None, d))
    return a, _finite(f"{caller}: offsets of normals {a.shape}", offsets, (len(a),))


def as_matrix(caller: str, name: str, X: ArrayLike | None, n: int) -> list[list[Fraction]]:
    """A matrix (n, n) in fractions, None for the identity. Raises InvalidArgument."""
    matrix = np.eye(n) if X is None else _finite(f"{caller}: {name}", X, (n, n))
    return [[Fraction(x) for x in row] for row in matrix.tolist()]


def as_answer(caller: str, name: str, answer: Any, kind: type) -> Any:
    """What the library gave, of the kind that is checked. Raises InvalidArgument."""
    return checks.instance(f"{caller}: {name}", answer, kind, f"a {kind.__name__}")


def _finite(what: str, value: ArrayLike, shape: tuple[int | None, ...]) -> np.ndarray:
    wanted = f"({', '.join('n' if size is None else str(size) for size in shape)}{',' if len(shape) == 1 else ''})"
    read = checks.array(what, value, wanted, InvalidArgument)
    fits = read.ndim == len(shape) and all(want in (None, have) for want, have in zip(shape, read.shape))
    if not fits or not read.size:
        raise InvalidArgument(f"{what} must have shape {wanted}, got {read.shape}")
    if not np.isfinite(read).all():
        raise InvalidArgument(f"{what} must be finite, got {checks.brief(read[~np.isfinite(read)][0])}")
    return read
