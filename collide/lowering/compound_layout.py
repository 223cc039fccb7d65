"""A shape's bounding parts in the rows of the compound kernels: made when first asked for, and kept with the shape."""

from __future__ import annotations

from collide.kernels import address_of
from collide.lowering.compound_table import CENTRE, PART, Balls, LaidOut, lay_out
from collide.lowering.parts import bounding_parts_of
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape, kept_with_shape


@kept_with_shape("_laid_out")
def layout_of(shape: Shape) -> LaidOut:
    return lay_out(bounding_parts_of(shape))


def body_ball(shape: Shape) -> Balls:
    """A ball around a shape, infinite of half-spaces; the shape keeps its numbers."""
    return Balls(address_of(layout_of(shape).ball), 0, 1)


def part_balls(shape: Shape) -> Balls:
    """Balls around the convex parts of a shape, or around their bounds, by number."""
    parts = layout_of(shape).parts
    return Balls(address_of(parts) + 8 * CENTRE, PART, len(parts))


def is_flat(shape: Shape) -> bool:
    """Whether no item of a union is a union: parts of unions in unions stand at poses rounded otherwise."""
    return not isinstance(shape, Compound) or not any(isinstance(item, Compound) for item, _ in shape.items)
