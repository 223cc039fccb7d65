"""Shapes as meshes meet them: facets under a box-tree, a ball swept over them, and whether they enclose an inside.

A convex polytope is the surface of its hull and what is inside; a sphere is a facet without area and a radius, a
capsule a segment and a radius. A cylinder, cone or ellipsoid has no facets: see `enclosures.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.hull.exact_hull import convex_hull
from collide.kernels import address_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import WITH_FACETS
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import convex_set_of, is_single_convex
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import REACH, MeshTree
from collide.mesh.facet_reach import reach_of_facets
from collide.mesh.mesh_survey import one_of_each_part
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Sphere
from collide.shapes.shape import Shape, checked_shape, held_by, kept_with_shape
from collide.shapes.swept_mesh import SweptMesh

_ORIGIN = Sphere(1.0)


class Body(NamedTuple):
    """A set in its own frame: facets, the points they enclose where solid, and a ball swept over all.

    of : the shape, held weakly because the shape keeps the body.
    tree : the facets.   points : (k, 3), a point of every connected part.
    centre, reach : of a ball around the facets, the reach rounded upwards [m].
    """

    of: Callable[[], Any]
    tree: MeshTree
    solid: bool
    radius: float
    points: np.ndarray
    centre: np.ndarray
    reach: float

    @property
    def shape(self) -> Any:
        """The shape, for as long as somebody holds it."""
        return self.of()

    @property
    def key(self) -> tuple:
        """Orders the bodies of a pair, so that swapped questions are worked out on the same numbers."""
        return self.tree.content, self.radius, self.solid


class PosesWithSlop(NamedTuple):
    """Poses of one body.

    X : (n, 4, 4) matrices.   slop : (n,) how far a point of the body may really be from its place by the matrix [m].
    """

    X: np.ndarray
    slop: np.ndarray

    def of(self, some) -> PosesWithSlop:
        """Those of the given numbers, or where a mask says so."""
        return PosesWithSlop(self.X[some], self.slop[some])


def as_given(X: np.ndarray) -> PosesWithSlop:
    """Poses that are exact as they were given."""
    return PosesWithSlop(X, np.zeros(len(X)))


def is_halfspace(shape: Shape) -> bool:
    """Half-spaces have no facets: the hull of a mesh answers for it."""
    return not shape.meshed and is_single_convex(shape) and convex_set_of(shape).kind == HALFSPACE


def has_facets(shape: Shape) -> bool:
    """Whether a shape is a mesh, or the hull of doubles with a ball swept over it: `body_of` then serves the shape."""
    return kind_of(shape) in WITH_FACETS


@kept_with_shape("_surface")
def body_of(shape: Shape) -> Body:
    """The body of a mesh, a swept mesh or a convex shape that `has_facets`, made when first asked for and kept with the
    shape.
    """
    if isinstance(shape, SweptMesh):
        return _of_mesh(shape.mesh)._replace(of=held_by(shape, shape), radius=shape.radius)
    return _of_mesh(shape) if isinstance(shape, Mesh) else _of_convex(shape)


@cache
def origin_body() -> Body:
    """The origin as a body: one facet without area."""
    return body_of(_ORIGIN)


def facet_body(shape, what: str) -> Body:
    """The body of a shape that is facets and no more, for a question about facets. what : "overlay: A", for messages.

    Raises InvalidArgument for what is no shape, UnsupportedQuery for curved shapes, unions and half-spaces, by name.
    """
    name = type(checked_shape(what, shape)).__name__
    if is_halfspace(shape):
        raise UnsupportedQuery(f"{what}: {name} has no facets; a large Box can stand in")
    if isinstance(shape, Compound):
        raise UnsupportedQuery(f"{what}: {name} is a union; ask for each of its items")
    if not has_facets(shape):
        raise UnsupportedQuery(
            f"{what}: {name} has no facets of doubles: its surface is curved, or its corners are rounded; "
            "a ConvexHull around it, or a Mesh, can stand in"
        )
    body = body_of(shape)
    if body.radius > 0.0:
        raise UnsupportedQuery(
            f"{what}: {name} is rounded and has no facets; a Mesh or ConvexHull near it can stand in"
        )
    return body


def hull_of(body: Body) -> Shape:
    """The hull of a mesh, without points inside; a convex shape itself."""
    shape = body.shape
    return shape.convex_hull if isinstance(shape, (Mesh, SweptMesh)) else shape


def reach_of(body: Body) -> float:
    """How far the body reaches from its frame's origin [m]: never less than any of its points."""
    x, y, z = body.tree.numbers[REACH : REACH + 3].tolist()
    return math.sqrt(x * x + y * y + z * z) + body.radius


def _of_mesh(mesh: Mesh) -> Body:
    return made_body(mesh, mesh.tree, mesh.solid, 0.0, mesh.vertices[_one_of_each_part(mesh)])


def _one_of_each_part(mesh: Mesh) -> np.ndarray:
    """Vertex ids: a vertex of every shell, and the vertices of collapsed facets alone."""
    corners, shells, n = mesh.survey.corners, mesh.survey.shells, len(mesh.vertices)
    ids = np.empty(n + len(shells), dtype=np.int32)
    return ids[: one_of_each_part(address_of(corners), address_of(shells), len(shells), n, address_of(ids))]


def _of_convex(shape: Shape) -> Body:
    packed = convex_set_of(shape)
    hull = convex_hull(packed.points)
    tree = build_mesh_tree(packed.points, _facets(packed.points, hull))
    return made_body(shape, tree, hull.dimension == 3, packed.radius, packed.points[hull.vertices[:1]])


def _facets(points: np.ndarray, hull) -> np.ndarray:
    if hull.dimension == 3:
        return hull.facets
    if hull.dimension == 2:
        return hull.facets[: len(hull.facets) // 2]
    order = hull.vertices[np.lexsort(points[hull.vertices].T)]  # along a line its ends come first and last
    return np.array([[order[0], order[-1], order[-1]]])


def made_body(shape: Shape, tree: MeshTree, solid: bool, radius: float, points: np.ndarray) -> Body:
    """A body over the facets of a tree; parameters as of `Body`."""
    reach = reach_of_facets(address_of(tree.triangles), len(tree.triangles), address_of(tree.numbers))
    return Body(held_by(shape, shape), tree, solid, radius, np.ascontiguousarray(points), tree.centre, reach)
