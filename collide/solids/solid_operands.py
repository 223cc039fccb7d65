"""Arguments of questions about solids, checked: shapes that are facets and what they enclose, and their poses."""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lowering.facet_bodies import body_of, facet_body
from collide.narrowphase.facets.facet_geometry import FacetCorners
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape, kept_with_shape
from collide.solids.placed_facets import Operand
from collide.transforms import as_pose


def solid_operand(caller: str, name: str, shape, X, check: bool, pose_name: str | None = None) -> Operand:
    """A shape and its pose as the arrangement takes them.   name : "A"; its pose's is "X_WA" by default.

    Raises InvalidArgument for surfaces and flat hulls, with the facets to blame; InvalidPose; UnsupportedQuery for
    curved shapes, unions and half-spaces, by name.
    """
    try:
        body = facet_body(shape, f"{caller}: {name}")
    except UnsupportedQuery as error:
        if shape.is_field:
            raise UnsupportedQuery(f"{caller}: {name}: a {type(shape).__name__} is no solid with facets") from None
        raise UnsupportedQuery(f"{error}; Mesh(*collide.tessellate(shape, tolerance)[:2]) is one") from None
    if not body.solid:
        raise InvalidArgument(f"{caller}: {name} has no inside: {_why_not(shape)}")
    pose_name = pose_name or f"X_W{name}"
    X = as_pose(X, f"{caller}: {pose_name}", check=check)
    mesh = _unscaled(shape) if isinstance(shape, Mesh) else _as_mesh(shape)
    return Operand(body_of(mesh), mesh, X)


def _why_not(shape: Shape) -> str:
    if isinstance(shape, Mesh):
        spoilt = [str(defect) for defect in shape.report.defects if defect.spoils]
        return "; ".join(spoilt) or "it was made with solid=False"
    return f"the points of this {type(shape).__name__} lie in one plane"


def _unscaled(mesh: Mesh) -> Mesh:
    """The mesh itself; for a scaled copy a mesh of its own vertices, since facets of zero area may differ from the
    base's.
    """
    return mesh if mesh.base is mesh else _copied(mesh)


@kept_with_shape("_as_solid")
def _copied(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces, solid=True)


@kept_with_shape("_as_solid")
def _as_mesh(shape: Shape) -> Mesh:
    """A convex shape as the triangles of its hull, numbered as they are everywhere."""
    tree = body_of(shape).tree
    corners = FacetCorners(tree)[np.arange(len(tree.ids))].reshape(-1, 3)
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    return Mesh(vertices, faces.reshape(-1, 3), solid=True)
