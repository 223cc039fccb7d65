"""ShapeSet: many shapes, picked from by number, for batches that ask about a different pair at every pose."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, InvalidShape, brief
from collide.shapes.shape import Shape


class ShapeSet:
    """Shapes laid out once, however often queries ask about them.

        library = collide.ShapeSet(shapes)
        collide.collide(library[i], library[j], X_WA, X_WB)     # i, j: (N,) numbers of shapes

    Parameters
    ----------
    shapes : sequence of Shape
        At least one. Indexing by an integer gives the shape, by an integer array (N,) or a slice a `Picked`, a sequence
        that queries accept as N shapes.

    Raises
    ------
    InvalidShape
        Where ``shapes`` is empty or holds what is no shape.
    """

    #: What the engine makes of the shapes, once asked for (`lowering/shape_set_tables.py`).
    _tables: object

    def __init__(self, shapes: Sequence[Shape]):
        try:
            self.shapes = tuple(shapes)
        except TypeError:
            raise InvalidShape(f"ShapeSet: shapes must be a sequence of shapes, got {brief(shapes)}") from None
        for k, shape in enumerate(self.shapes):
            if not isinstance(shape, Shape):
                raise InvalidShape(f"ShapeSet: shapes[{k}] must be a shape, got {brief(shape)}")
        if not self.shapes:
            raise InvalidShape(f"ShapeSet: shapes is empty, {brief(shapes)}; at least one is needed")

    @cached_property
    def flags(self) -> frozenset[str]:
        """"is_region" and "is_field", where such a shape is among the set's."""
        return frozenset(flag for flag in ("is_region", "is_field") if any(getattr(S, flag) for S in self.shapes))

    def __len__(self) -> int:
        return len(self.shapes)

    def __getitem__(self, rows):
        if checks.is_integer(rows):
            if not -len(self) <= rows < len(self):
                raise IndexError(f"ShapeSet: there are shapes 0 … {len(self) - 1}, not {rows}")
            return self.shapes[rows]
        rows = np.arange(len(self))[rows] if isinstance(rows, slice) else rows
        numbers = checks.plain_array("ShapeSet: numbers", rows, "(N,)", InvalidArgument)
        if numbers.size == 0 and numbers.ndim == 1:
            numbers = numbers.astype(np.int64)
        if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
            raise InvalidArgument(f"ShapeSet: pick by integers (N,), got {numbers.dtype} {numbers.shape}")
        if len(numbers) and not (0 <= numbers.min() and numbers.max() < len(self)):
            raise InvalidArgument(
                f"ShapeSet: there are shapes 0 … {len(self) - 1}, not {numbers.min()} … {numbers.max()}"
            )
        return Picked(self, numbers.astype(np.int64))


class Picked(Sequence):
    """Shapes of a set, by their numbers: a sequence of shapes."""

    def __init__(self, shape_set: ShapeSet, rows: np.ndarray):
        self.shape_set, self.rows = shape_set, rows

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, k):
        if isinstance(k, (slice, np.ndarray)):
            return Picked(self.shape_set, self.rows[k])
        return self.shape_set.shapes[self.rows[k]]


def have_any(shapes, flag: str) -> bool:
    """Whether a shape, or a shape of a sequence, has a flag of `ShapeSet.flags`."""
    if isinstance(shapes, Picked):
        return flag in shapes.shape_set.flags
    return getattr(shapes, flag) if isinstance(shapes, Shape) else any(getattr(shape, flag) for shape in shapes)
