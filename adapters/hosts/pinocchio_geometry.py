"""Geometries of a Pinocchio model, read through coal's Python interface, as geometries of `coal_api`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from collide.adapters.hosts import coal_geometry as shapes
from collide.adapters.hosts.coal_geometry import CollisionGeometry
from collide.adapters.hosts.coal_meshes import BVHModelOBB, BVHModelOBBRSS, Convex
from collide.adapters.hosts.coal_terrain import HeightFieldAABB, HeightFieldOBBRSS, OcTree
from collide.errors import CollideError, InvalidArgument, InvalidShape, UnsupportedQuery


def _convex(g) -> CollisionGeometry:
    if g.num_points == 0:
        raise InvalidArgument("it has no points")
    return Convex(np.array(g.points()), ())


def _model(kind: type) -> Callable[[Any], CollisionGeometry]:
    def build(g) -> CollisionGeometry:
        """The same triangles, a surface."""
        if g.num_tris == 0:
            raise InvalidArgument("it has no triangles: beginModel, addVertices, addTriangles, endModel")
        triangles = [g.tri_indices(k) for k in range(g.num_tris)]
        model = kind()
        model.beginModel()
        model.addVertices(np.array(g.vertices()))
        model.addTriangles(np.array([[t[0], t[1], t[2]] for t in triangles]))
        model.endModel()
        return model

    return build


def _field(kind: type) -> Callable[[Any], CollisionGeometry]:
    return lambda g: kind(g.getXDim(), g.getYDim(), np.array(g.getHeights()), g.getMinHeight())


def _octree(g) -> CollisionGeometry:
    return OcTree(g.getResolution(), [(np.array(box[:3]), float(box[3])) for box in g.toBoxes()])


#: What is made of a geometry, by the name of its class in coal; of derived classes the first of their bases.
_BUILDERS: dict[str, Callable[[Any], CollisionGeometry]] = {
    "Box": lambda g: shapes.Box(2.0 * np.array(g.halfSide)),
    "Sphere": lambda g: shapes.Sphere(g.radius),
    "Ellipsoid": lambda g: shapes.Ellipsoid(np.array(g.radii)),
    "Capsule": lambda g: shapes.Capsule(g.radius, 2.0 * g.halfLength),
    "Cone": lambda g: shapes.Cone(g.radius, 2.0 * g.halfLength),
    "Cylinder": lambda g: shapes.Cylinder(g.radius, 2.0 * g.halfLength),
    "Halfspace": lambda g: shapes.Halfspace(np.array(g.n), g.d),
    "Plane": lambda g: shapes.Plane(np.array(g.n), g.d),
    "ConvexBase": _convex,
    "BVHModelOBBRSS": _model(BVHModelOBBRSS),
    "BVHModelOBB": _model(BVHModelOBB),
    "HeightFieldAABB": _field(HeightFieldAABB),
    "HeightFieldOBBRSS": _field(HeightFieldOBBRSS),
    "OcTree": _octree,
}
#: Numbers that programs change in place, by the name of the class.
_FIELDS = {
    "Box": ("halfSide",), "Sphere": ("radius",), "Ellipsoid": ("radii",), "Capsule": ("radius", "halfLength"),
    "Cone": ("radius", "halfLength"), "Cylinder": ("radius", "halfLength"), "Halfspace": ("n", "d"),
    "Plane": ("n", "d"), "ConvexBase": ("num_points",),
    "BVHModelOBBRSS": ("num_tris", "num_vertices"), "BVHModelOBB": ("num_tris", "num_vertices"),
}


def class_name(geometry) -> str | None:
    """The name in coal of the class that is known here; None of others, and of nothing."""
    return next((kind.__name__ for kind in type(geometry).__mro__ if kind.__name__ in _BUILDERS), None)


def numbers_of(geometry) -> tuple:
    """What tells whether a geometry was changed: its address, and those of its numbers that are quickly read."""
    name = class_name(geometry)
    if name is None:
        return ()
    values = tuple(np.asarray(getattr(geometry, field)).tobytes() for field in _FIELDS.get(name, ()))
    radius = geometry.getSweptSphereRadius() if hasattr(geometry, "getSweptSphereRadius") else 0.0
    if hasattr(geometry, "id"):
        return (geometry.id(), radius, *values)
    data = geometry.points() if name == "ConvexBase" else list(geometry.toBoxes())
    return (name, np.asarray(data).tobytes(), radius)


def geometry_of(geometry_object) -> CollisionGeometry:
    """A geometry object's geometry.

    geometry_object : Pinocchio's. Raises InvalidShape, naming it, where it has no data or numbers that make no shape;
    UnsupportedQuery for geometries that are not known.
    """
    geometry = geometry_object.geometry
    name = class_name(geometry)
    if name is None:
        raise UnsupportedQuery(
            f"geometry {geometry_object.name!r} is a {type(geometry).__name__}, which is not known here; known are "
            f"{', '.join(_BUILDERS)}"
        )
    try:
        made = _BUILDERS[name](geometry)
        radius = geometry.getSweptSphereRadius() if hasattr(geometry, "getSweptSphereRadius") else 0.0
        if radius and isinstance(made, shapes.ShapeBase):
            made.setSweptSphereRadius(radius)
    except CollideError as error:
        raise InvalidShape(f"geometry {geometry_object.name!r}, a {type(geometry).__name__}: {error}") from None
    return made
