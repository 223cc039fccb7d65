"""What kind of body a shape is to the narrowphase: the row and the column of `narrowphase/dispatch.py`."""

from __future__ import annotations

from enum import IntEnum

from collide.curved.shape_kinds import HALFSPACE, NUMBERS, POINTS
from collide.lowering.convex_sets import convex_set, set_numbers_of
from collide.shapes.compound import Compound
from collide.shapes.primitives import Box, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import Shape, kept_with_shape


class Kind(IntEnum):
    """SPHERE, CAPSULE and POLYTOPE are one, two, or more points swept by a ball, whatever class they come from."""

    SPHERE = 0
    CAPSULE = 1
    POLYTOPE = 2
    ROUNDED = 3
    CYLINDER = 4
    CONE = 5
    ELLIPSOID = 6
    HALFSPACE = 7
    MESH = 8
    COMPOUND = 9
    MESH_COMPOUND = 10
    REGION = 11


#: Kinds whose surface is that of a hull of doubles swept by a ball, or a mesh: `facet_bodies.body_of` serves them.
WITH_FACETS = frozenset((Kind.SPHERE, Kind.CAPSULE, Kind.POLYTOPE, Kind.MESH))
#: Kinds that are no points, by the numbers that kernels know them by.
_OF_NUMBER = {number: Kind[name] for name, number in NUMBERS.items() if number != POINTS}
#: Kinds of curved sets: `curved/curved_kinds.py` has the same.
CURVED_KINDS = frozenset(kind for number, kind in _OF_NUMBER.items() if number != HALFSPACE)
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
    if shape.meshed:
        return Kind.MESH
    numbers = set_numbers_of(shape)
    if numbers is not None:
        return _kind_of_convex(numbers[0], numbers[1], 0.0)
    part = convex_set(shape)
    return _kind_of_convex(part.kind, len(part.points), part.slop)


def _kind_of_convex(kind: int, n_points: int, slop: float) -> Kind:
    if kind != POINTS:
        return _OF_NUMBER[kind]
    return Kind.ROUNDED if slop != 0.0 else _OF_POINTS[min(n_points, 3) - 1]
