"""The kind of a shape."""

from __future__ import annotations

from collide.curved.shape_kinds import POINTS
from collide.lowering.convex_sets import convex_set, primitive_numbers_of
from collide.lowering.kinds import OF_NUMBER, Kind
from collide.shapes.compound import Compound
from collide.shapes.primitives import Box, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import Shape, kept_with_shape

_OF_POINTS = (Kind.SPHERE, Kind.CAPSULE, Kind.POLYTOPE)
#: Classes all of whose shapes are of one kind: new shapes are told apart without making their sets.
OF_CLASS = {
    Sphere: Kind.SPHERE, Box: Kind.POLYTOPE, Cylinder: Kind.CYLINDER, Cone: Kind.CONE, Ellipsoid: Kind.ELLIPSOID,
    Halfspace: Kind.HALFSPACE,
}


def kind_of(shape: Shape) -> Kind:
    """The kind of a shape."""
    kind = OF_CLASS.get(shape.__class__)
    return _kind_by_set(shape) if kind is None else kind


@kept_with_shape("_kind")
def _kind_by_set(shape: Shape) -> Kind:
    if isinstance(shape, Compound):
        return Kind.MESH_COMPOUND if shape.meshed else Kind.COMPOUND
    if shape.is_region:
        return Kind.REGION
    if shape.is_field:
        return Kind.FIELD
    if shape.meshed:
        return Kind.MESH
    numbers = primitive_numbers_of(shape)
    if numbers is not None:
        return _kind_of_convex(numbers[0], numbers[1], 0.0)
    part = convex_set(shape)
    return _kind_of_convex(part.kind, len(part.points), part.slop)


def _kind_of_convex(kind: int, n_points: int, slop: float) -> Kind:
    if kind != POINTS:
        return OF_NUMBER[kind]
    return Kind.ROUNDED if slop != 0.0 else _OF_POINTS[min(n_points, 3) - 1]
