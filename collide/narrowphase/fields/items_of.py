"""The items of a field, by its class."""

from __future__ import annotations

from collide.narrowphase.fields.balls import Balls
from collide.narrowphase.fields.cells import Cells
from collide.narrowphase.fields.field_items import FieldItems
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape, kept_with_shape


@kept_with_shape("_items")
def items_of(field: Shape) -> FieldItems:
    """What a field is made of."""
    return Balls(field) if isinstance(field, PointCloud) else Cells(field)  # type: ignore[arg-type]
