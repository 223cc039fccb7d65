"""A shape's bounding parts in the rows that kernels of compounds read: made when first asked for, and kept with it."""

from __future__ import annotations

from collide.lowering.compound_table import LaidOut, lay_out
from collide.lowering.parts import bounding_parts_of
from collide.shapes.shape import Shape


def layout_of(shape: Shape) -> LaidOut:
    try:
        return shape._laid_out
    except AttributeError:
        shape._store(_laid_out=lay_out(bounding_parts_of(shape)))
        return shape._laid_out
