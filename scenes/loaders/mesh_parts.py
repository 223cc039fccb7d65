"""The parts of a mesh file: points and facets, equal vertices joined."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from collide.mesh.convex_surface import is_own_hull
from collide.scenes.loaders.hull_levels import HullLevel
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape

#: Begins a line about a defect that stays.
NOT_REPAIRED = "not repaired: "


@dataclass
class MeshPart:
    """One mesh of a file.

    points : (n, 3) distinct vertices that faces use, in the file's world frame and units.
    fill : of hulls: volume of the mesh over the volume of its hull; NaN where it has none (open, or scipy is absent).
    closed : watertight, with consistent winding; of a mesh taken as it is: whether it is a solid.
    faces : how many triangles.
    pieces : the convex pieces as point sets, where a decomposition was asked for.
    facets : (faces, 3) rows of ``points``, as the file has them, where the mesh is taken as it is.
    own_hull : these are exactly the surface of their convex hull.   made : shapes made of it, by scale.
    repairs : the steps of its repair in words, with facet numbers; None where none was asked for.
    level : of a hull that is to have few vertices.
    """

    name: str
    points: np.ndarray
    fill: float
    closed: bool
    faces: int
    pieces: list[np.ndarray] | None = None
    facets: np.ndarray | None = None
    own_hull: bool = False
    made: dict[tuple, Shape] = field(default_factory=dict)
    repairs: list[str] | None = None
    level: HullLevel | None = None


@dataclass
class MeshFile:
    """The parts of a mesh file, and what its reader wants to say."""

    parts: list[MeshPart]
    notes: list[str]


def distinct(vertices: np.ndarray) -> np.ndarray:
    """Every point once, in the order of first appearance; −0.0 and 0.0 are one number."""
    _, first = np.unique(vertices + 0.0, axis=0, return_index=True)
    return np.ascontiguousarray(vertices[np.sort(first)] + 0.0)


def described(name: str, vertices: np.ndarray, faces: np.ndarray, repair: bool = False) -> MeshPart:
    """A part that is to be taken as it is: equal vertices joined, and looked at. Raises InvalidShape.

    repair : whether a mesh that is no solid is repaired. Facets that cross stay: no answer depends on them.
    """
    points, ids = _welded(vertices, faces)
    mesh, repairs = Mesh(points, ids), None
    if repair:
        repairs = []
        if not mesh.solid:
            made = mesh.repaired(crossings=False)
            repairs = made.report.steps() + [f"{NOT_REPAIRED}{entry}" for entry in made.report.unrepaired[:1]]
            if made.report.changed:
                mesh = Mesh(*_welded(made.mesh.vertices, made.mesh.faces))
    own_hull = mesh.solid and is_own_hull(mesh.vertices, mesh.faces)
    return MeshPart(
        name, mesh.vertices, np.nan, mesh.solid, len(mesh.faces), facets=mesh.faces, own_hull=own_hull, repairs=repairs
    )


def _welded(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices that facets use, every point once in the order of first appearance, and facets by these."""
    corners = vertices[faces.ravel()] + 0.0  # −0.0 and 0.0 are one number
    _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return np.ascontiguousarray(corners[first[order]]), rank[inverse.ravel()].reshape(-1, 3).astype(np.int32)
