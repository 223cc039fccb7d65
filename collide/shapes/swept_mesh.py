"""SweptMesh: the triangles of a mesh swept by a ball, and the inside of a solid."""

from __future__ import annotations

from typing import TYPE_CHECKING

from collide.base import argument_checks as checks
from collide.errors import InvalidShape
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape, equal_but_for_signs, positive

if TYPE_CHECKING:
    import numpy as np



class SweptMesh(Shape):
    """A mesh with thickness: all points within a radius of its triangles, and the inside of a solid.

    Parameters
    ----------
    mesh : Mesh
        A surface, such as sheet metal or cloth, or a solid to be padded.
    radius : float
        Of the ball swept over the triangles [m], > 0.

    Raises
    ------
    InvalidShape
        For anything but a mesh, and where the radius is not a finite number above 0.

    Notes
    -----
    Queries answer for the union of the triangles, each swept by the ball, and the solid. ``part`` numbers of results
    are rows of ``mesh.faces``, or the number of all triangles for the inside of a solid. Booleans and distances with
    spheres, capsules, polytopes and meshes walk the box-tree of the mesh, as queries of meshes do; all other questions
    take the triangles nearby as a `Compound`, up to all triangles where the other body is large: milliseconds for a
    hundred triangles.
    """

    __slots__ = ("mesh", "radius")
    _fields = ("mesh", "radius")
    convex = False
    is_field = True
    mesh: Mesh
    radius: float

    def __init__(self, mesh: Mesh, radius: float):
        mesh = checks.instance("SweptMesh: mesh", mesh, Mesh, "a collide.Mesh", InvalidShape)
        self._store(mesh=mesh, radius=positive("SweptMesh", "radius", radius))

    def __len__(self) -> int:
        return len(self.mesh.faces) + self.mesh.solid

    @property
    def convex_hull(self) -> ConvexHull:
        """The hull of the triangles, swept by the ball."""
        return ConvexHull(self.mesh.convex_hull.points, radius=self.radius)

    def _scaled(self, s: np.ndarray) -> SweptMesh:
        factor = equal_but_for_signs(s, "the ball swept over it would be no ball")
        return SweptMesh(self.mesh.scaled(s), self.radius * factor)
