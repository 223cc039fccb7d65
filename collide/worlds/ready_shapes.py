"""Trees and convex parts kept with a shape, made before a World has the shape and readers ask about it."""

from __future__ import annotations

from collide.base.lazy_modules import lazy_module
from collide.lowering.parts import bounding_parts_of
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape
from collide.shapes.swept_mesh import SweptMesh

#: Half of the engine, which scenes without meshes never load.
facet_bodies = lazy_module("collide.lowering.facet_bodies")


def make_ready(shape: Shape) -> None:
    """Have the convex parts of a shape, and the trees over points and facets, which are kept with the shape."""
    bounding_parts_of(shape)
    if isinstance(shape, PointCloud):
        _ = shape.tree
    elif isinstance(shape, SweptMesh) or (isinstance(shape, Mesh) and shape.meshed):
        facet_bodies.body_of(shape)
    elif isinstance(shape, Compound):
        for item, _ in shape.items:
            make_ready(item)
