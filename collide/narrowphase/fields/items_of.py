"""The items of a field, by its class."""

from __future__ import annotations

from collide.narrowphase.fields.cloud_balls import Balls
from collide.narrowphase.fields.field_items import FieldItems
from collide.narrowphase.fields.occupied_cells import Cells
from collide.narrowphase.fields.swept_triangles import SweptTriangles
from collide.narrowphase.fields.terrain_columns import Columns
from collide.shapes.height_field import HeightField
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape, kept_with_shape
from collide.shapes.swept_mesh import SweptMesh
from collide.shapes.voxel_grid import VoxelGrid

_ITEMS_OF = {PointCloud: Balls, VoxelGrid: Cells, HeightField: Columns, SweptMesh: SweptTriangles}


@kept_with_shape("_items")
def items_of(field: Shape) -> FieldItems:
    """What a field is made of."""
    return next(items for cls, items in _ITEMS_OF.items() if isinstance(field, cls))(field)  # type: ignore[arg-type]
