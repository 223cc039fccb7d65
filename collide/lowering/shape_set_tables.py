"""A `ShapeSet` as kernels read it: tables of all its shapes, made when first asked for and kept with the set."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from collide.lowering.compound_layout import layout_of
from collide.lowering.compound_table import CompoundTable
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.parts import bounding_parts_of, is_single_convex
from collide.lowering.shape_table import ShapeTable
from collide.shapes.shape_set import ShapeSet


class ShapeSetTables:
    """shapes : of the set, whose numbers are rows of everything here."""

    def __init__(self, shapes: tuple):
        self._shapes = shapes

    @cached_property
    def kinds(self) -> np.ndarray:
        """(shapes,) `Kind`."""
        return np.array([kind_of(shape) for shape in self._shapes])

    @cached_property
    def single_convex(self) -> np.ndarray:
        """(shapes,) bool: whether a shape is a single convex set in its own frame."""
        return np.array([is_single_convex(shape) for shape in self._shapes])

    @cached_property
    def convex(self) -> ShapeTable:
        """A row a shape; of a compound its first part and of a mesh its bounds, which nobody asks for."""
        return ShapeTable([bounding_parts_of(shape)[0][0] for shape in self._shapes])

    @cached_property
    def compounds(self) -> CompoundTable:
        """The same with all parts of each shape, a body a shape."""
        return CompoundTable([layout_of(shape) for shape in self._shapes])


def tables_of(shape_set: ShapeSet) -> ShapeSetTables:
    if not hasattr(shape_set, "_tables"):
        shape_set._tables = ShapeSetTables(shape_set.shapes)
    return shape_set._tables  # type: ignore[return-value]
