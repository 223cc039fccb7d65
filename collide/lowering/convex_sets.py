"""What a shape is, as convex sets of numbers: one function a class. `parts.py` packs the sets for kernels.

No kernel is imported: certificates read these sets.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from struct import Struct
from typing import NamedTuple

import numpy as np

from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.errors import UnsupportedQuery
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.hpolytope import HPolytope
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Sphere
from collide.shapes.shape import IDENTITY, Shape

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
        if cls in _RULES:
            return _RULES[cls](shape)
    raise TypeError(f"{type(shape).__name__} cannot be asked about: derive it from one of collide's shapes")


def moved(X_CS: np.ndarray, X_SP: np.ndarray) -> np.ndarray:
    """The pose of a part in a compound's frame, from that in its item's."""
    return X_CS if X_SP is IDENTITY or np.array_equal(X_SP, IDENTITY) else X_CS @ X_SP


_NO_POINTS = np.zeros((0, 3))
_NO_POINTS.flags.writeable = False
_ORIGIN = np.zeros((1, 3))  # read-only once packed
#: Of a box: an array of these takes half the time that numpy's product takes.
_CORNERS = Struct("=24d")


def _sphere(shape: Sphere) -> ConvexSet:
    return ConvexSet(POINTS, _ORIGIN, shape.radius)


def _box(shape: Box) -> ConvexSet:
    x, y, z = half_sizes = tuple([0.5 * length for length in shape.size.tolist()])
    corners = _CORNERS.pack(
        -x, -y, -z, -x, -y, z, -x, y, -z, -x, y, z, x, -y, -z, x, -y, z, x, y, -z, x, y, z,
    )
    return ConvexSet(POINTS, np.frombuffer(corners).reshape(8, 3), params=half_sizes)


def _capsule(shape: Capsule) -> ConvexSet:
    half = 0.5 * shape.length
    return ConvexSet(POINTS, np.array([(0.0, 0.0, -half), (0.0, 0.0, half)])[: 2 if half else 1], shape.radius)


def _cylinder(shape: Cylinder) -> ConvexSet:
    half = 0.5 * shape.length
    return ConvexSet(CYLINDER, _NO_POINTS, params=(shape.radius, half), curved_reach=math.hypot(shape.radius, half))


def _cone(shape: Cone) -> ConvexSet:
    half = 0.5 * shape.length
    return ConvexSet(CONE, _NO_POINTS, params=(shape.radius, half), curved_reach=math.hypot(shape.radius, half))


def _ellipsoid(shape: Ellipsoid) -> ConvexSet:
    radii = shape.radii.tolist()
    return ConvexSet(ELLIPSOID, _NO_POINTS, params=tuple(radii), curved_reach=max(radii))


def _halfspace(shape: Halfspace) -> ConvexSet:
    return ConvexSet(HALFSPACE, _NO_POINTS, params=(*shape.normal.tolist(), shape.offset))


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


_RULES: dict[type, Callable[..., ConvexSet]] = {
    Sphere: _sphere,
    Box: _box,
    Capsule: _capsule,
    Cylinder: _cylinder,
    Cone: _cone,
    Ellipsoid: _ellipsoid,
    Halfspace: _halfspace,
    ConvexHull: _convex_hull,
    HPolytope: _hpolytope,
    Mesh: _mesh,
}
