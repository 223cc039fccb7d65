"""A shape's bounding parts in the rows of the compound kernels: made when first asked for, and kept with the shape."""

from __future__ import annotations

from collide.lowering.compound_table import LaidOut, lay_out
from collide.lowering.parts import bounding_parts_of
from collide.shapes.shape import Shape, kept_with_shape


@kept_with_shape("_laid_out")
def layout_of(shape: Shape) -> LaidOut:
    return lay_out(bounding_parts_of(shape))
