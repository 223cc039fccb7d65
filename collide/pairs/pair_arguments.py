"""What a pair query is asked, checked: two shapes or sequences of them, and one pose or many for each."""

from __future__ import annotations

import numpy as np

from collide.base import argument_checks as checks
from collide.shapes.shape import Shape, checked_shape
from collide.shapes.shape_set import Picked
from collide.transforms import unchecked_poses


def asked_poses(A, B, X_WA, X_WB) -> tuple[np.ndarray, np.ndarray, bool]:
    """Shapes checked; poses as batches (n, 4, 4) or (1, 4, 4), entries not yet checked; whether it is a single pair."""
    X_WA, single_a = pose_batch(X_WA, "X_WA")
    X_WB, single_b = pose_batch(X_WB, "X_WB")
    _, single = matched_counts(A, B, {"X_WA": len(X_WA), "X_WB": len(X_WB)})
    return X_WA, X_WB, single_a and single_b and single


def matched_counts(A, B, counts: dict[str, int]) -> tuple[int, bool]:
    """(the length of a batch, whether A and B are two shapes), of checked shapes and arguments of these lengths.

    counts : by name; single arguments, of length 1, go with all of the others.   A, B : ``None`` without shapes.
    Raises InvalidArgument where lengths do not match, whatever arguments have them.
    """
    single = True
    for name, side in (("A", A), ("B", B)):
        if _is_sequence(side):
            counts[name] = len(side)
            single = False
        elif not isinstance(side, Shape) and not (A is None and B is None):
            checked_shape(name, side)
    return checks.matched_count("", **counts), single


def _is_sequence(side) -> bool:
    """Whether a side is a sequence of shapes, a shape for each pose."""
    return isinstance(side, Picked) or (
        isinstance(side, (list, tuple)) and all(isinstance(shape, Shape) for shape in side)
    )


def pose_batch(X, name: str) -> tuple[np.ndarray, bool]:
    """(poses (n, 4, 4), whether a single one was given)."""
    if type(X) is np.ndarray and X.dtype == np.float64 and X.ndim in (2, 3) and X.shape[-2:] == (4, 4):
        return np.ascontiguousarray(X).reshape(-1, 4, 4), X.ndim == 2
    return unchecked_poses(X, name)


def shape_at(shapes, k: int) -> Shape:
    """The shape of pair k."""
    return shapes if isinstance(shapes, Shape) else shapes[k]


def pose_at(X: np.ndarray, k: int) -> np.ndarray:
    """The pose (4, 4) of pair k, of a batch or a single one."""
    return X[k if len(X) > 1 else 0]
