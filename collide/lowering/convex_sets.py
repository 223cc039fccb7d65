"""What a shape is, as convex sets of numbers: one function a class. `parts.py` packs the sets for kernels.

No kernel is imported: certificates read these sets. Shapes of a few numbers are told by eight (`PRIMITIVE_NUMBERS`),
whose core points are corners of a box: `corners_of` here, and `lower_numbers.py` for kernels, by the same signs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.errors import UnsupportedQuery
from collide.lowering.primitive_numbers import PrimitiveNumbers
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.hpolytope import HPolytope
from collide.shapes.mesh import Mesh
from collide.shapes.octree import OcTree
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import IDENTITY, Shape
from collide.shapes.swept_mesh import SweptMesh
from collide.shapes.voxel_grid import VoxelGrid

__all__ = [
    "CONE", "CYLINDER", "ELLIPSOID", "HALFSPACE", "POINTS", "ConvexSet", "PlacedSet", "convex_set", "moved", "sets_of",
]

#: Corners of an `HPolytope` from which it gets a support tree: no shape made of few planes has as many.
_CORNERS_WITH_TREE = 2000


class ConvexSet(NamedTuple):
    """One convex set in its own frame; fields as `packed_convex.PackedConvex` has them.

    curved_reach : reach of a cylinder, cone or ellipsoid [m]; the reach of points is measured where they are packed.
    with_tree : whether many points get a support tree at the first query in need.
    planes : (normals, offsets) of a polytope kept by half-spaces.
    """

    kind: int
    points: np.ndarray
    radius: float = 0.0
    params: tuple[float, ...] = ()
    slop: float = 0.0
    curved_reach: float = 0.0
    with_tree: bool = False
    planes: tuple[np.ndarray, np.ndarray] | None = None


#: A convex set and its (4, 4) pose in the shape's frame.
PlacedSet = tuple[ConvexSet, np.ndarray]


def sets_of(shape: Shape) -> list[PlacedSet]:
    """The convex sets whose union a shape is, each with its pose in the shape's frame. O(size of the shape).

    Raises UnsupportedQuery for meshes and regions.
    """
    if isinstance(shape, Compound):
        return [(part, moved(X_CS, X_SP)) for item, X_CS in shape.items for part, X_SP in sets_of(item)]
    return [(convex_set(shape), IDENTITY)]


def convex_set(shape: Shape) -> ConvexSet:
    """The convex set of a shape other than a Compound. Raises UnsupportedQuery for meshes and regions, TypeError for
    classes not derived from the library's."""
    for cls in type(shape).__mro__:
        if cls in PRIMITIVE_NUMBERS:
            return _of_numbers(*PRIMITIVE_NUMBERS[cls](shape))
        if cls in _RULES:
            return _RULES[cls](shape)
    raise TypeError(f"{type(shape).__name__} cannot be asked about: derive it from one of collide's shapes")


def moved(X_CS: np.ndarray, X_SP: np.ndarray) -> np.ndarray:
    """The pose of a part in a compound's frame, from that in its item's."""
    return X_CS if X_SP is IDENTITY or np.array_equal(X_SP, IDENTITY) else X_CS @ X_SP


def corners_of(n: int, half_x: float, half_y: float, half_z: float) -> np.ndarray:
    """(n, 3) read-only corners of a box, of its edge along z, or its centre, for n = 8, 2 or 1.

    Bits of a corner's number are the signs along x, y, z, z being the lowest bit; 0 − 0 is 0 where −1·0 is not.
    """
    half_sizes = np.array((half_x, half_y, half_z))
    corners = np.where(_IS_POSITIVE[:n], half_sizes, 0.0 - half_sizes)
    corners.setflags(write=False)
    return corners


_IS_POSITIVE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=bool)
_NO_POINTS = np.zeros((0, 3))
_NO_POINTS.flags.writeable = False


def _sphere(shape: Sphere) -> PrimitiveNumbers:
    return POINTS, 1, shape.radius, 0.0, 0.0, 0.0, 0.0, 0.0


def _box(shape: Box) -> PrimitiveNumbers:
    x, y, z = shape.size.tolist()
    return POINTS, 8, 0.0, 0.0, 0.5 * x, 0.5 * y, 0.5 * z, 0.0


def _capsule(shape: Capsule) -> PrimitiveNumbers:
    half = 0.5 * shape.length
    return POINTS, 2 if half else 1, shape.radius, 0.0, 0.0, 0.0, half, 0.0


def _cylinder(shape: Cylinder) -> PrimitiveNumbers:
    radius, half = shape.radius, 0.5 * shape.length
    return CYLINDER, 0, 0.0, math.hypot(radius, half) * _UPWARDS, radius, half, 0.0, 0.0


def _cone(shape: Cone) -> PrimitiveNumbers:
    radius, half = shape.radius, 0.5 * shape.length
    return CONE, 0, 0.0, math.hypot(radius, half) * _UPWARDS, radius, half, 0.0, 0.0


def _ellipsoid(shape: Ellipsoid) -> PrimitiveNumbers:
    x, y, z = shape.radii.tolist()
    return ELLIPSOID, 0, 0.0, max(x, y, z) * _UPWARDS, x, y, z, 0.0


def _halfspace(shape: Halfspace) -> PrimitiveNumbers:
    x, y, z = shape.normal.tolist()
    return HALFSPACE, 0, 0.0, 0.0, x, y, z, shape.offset


#: Rounds a reach upwards.
_UPWARDS = 1 + 1e-15
PRIMITIVE_NUMBERS: dict[type, Callable[..., PrimitiveNumbers]] = {
    Sphere: _sphere, Box: _box, Capsule: _capsule, Cylinder: _cylinder, Cone: _cone, Ellipsoid: _ellipsoid,
    Halfspace: _halfspace,
}


def primitive_numbers_of(shape: Shape) -> PrimitiveNumbers | None:
    """The eight numbers of a shape; ``None`` of shapes of others."""
    numbers_of = PRIMITIVE_NUMBERS.get(shape.__class__)
    return None if numbers_of is None else numbers_of(shape)


def _of_numbers(kind: int, n: int, radius: float, reach: float, *numbers: float) -> ConvexSet:
    if kind != POINTS:
        return ConvexSet(kind, _NO_POINTS, params=numbers, curved_reach=reach)
    return ConvexSet(POINTS, corners_of(n, *numbers[:3]), radius, numbers if n == 8 else ())


def _convex_hull(shape: ConvexHull) -> ConvexSet:
    return ConvexSet(POINTS, shape.points, shape.radius, with_tree=True)


def _hpolytope(shape: HPolytope) -> ConvexSet:
    if shape.is_region:
        raise UnsupportedQuery(
            "HPolytope(bounded=False): a region has no corners, which this query needs; with bounded=True, closed by "
            "half-spaces far away, it has"
        )
    planes = (shape.normals, shape.offsets) if shape.is_closed else None
    with_tree = len(shape.vertices) > _CORNERS_WITH_TREE
    return ConvexSet(POINTS, shape.vertices, slop=shape.slop, with_tree=with_tree, planes=planes)


def _mesh(shape: Mesh) -> ConvexSet:
    raise UnsupportedQuery(
        "Mesh: a mesh is no union of convex parts, which this query needs. collide() and distance() of one mesh and "
        "another shape, and World, take it as it is; elsewhere ConvexHull(mesh.vertices) may do instead"
    )


def _field(shape: Shape) -> ConvexSet:
    name, remedy = type(shape).__name__, _INSTEAD[type(shape)]
    raise UnsupportedQuery(
        f"{name}: a field is asked as a whole, and this query needs convex parts. collide(), distance(), contacts() "
        f"and World take it; elsewhere a Compound of {remedy} may do instead"
    )


#: What may do instead of a field, where convex parts are needed.
_INSTEAD: dict[type, str] = {
    PointCloud: "Spheres at its points", VoxelGrid: "Boxes", OcTree: "Boxes",
    SweptMesh: "ConvexHulls of its triangles, with its radius,",
}
_RULES: dict[type, Callable[..., ConvexSet]] = {
    ConvexHull: _convex_hull,
    HPolytope: _hpolytope,
    Mesh: _mesh,
    PointCloud: _field,
    SweptMesh: _field,
    VoxelGrid: _field,
}
