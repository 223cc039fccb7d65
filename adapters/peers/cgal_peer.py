"""CGAL's Python wheel: whether polytopes and closed meshes meet, by exact predicates on doubles.

The wheel binds `do_intersect` of two meshes' surfaces and the side of a mesh that a point lies on, which together are
the boolean. It has no distance of two bodies, and no hull hierarchy.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer
from collide.adapters.peers.question import corners
from collide.errors import UnsupportedQuery
from collide.shapes import Capsule, Mesh, Shape, Sphere

_NO_DISTANCE = "boolean only: the wheel has no distance of two bodies"


class CgalPeer(PairwisePeer):
    """`do_intersect` of two surfaces, and `Side_of_triangle_mesh` for one body inside another."""

    name, package, module = "cgal", "cgal", "CGAL"
    isolated, extra, hint = True, "all-peers", "it has wheels up to Python 3.12"
    about = "do_intersect of two surfaces, else whether a vertex of one is not outside the other"
    receives = (
        "corners rounded to doubles in world coordinates; its predicates are exact",
        "hull corners, of which it takes its own hull",
    )
    cannot = (
        "gaps and depths: the wheel has none", "half-spaces and whatever is round", "flat hulls",
        "meshes that bound no solid",
    )

    def prepare(self) -> None:
        from CGAL import CGAL_Convex_hull_3, CGAL_Polygon_mesh_processing  # noqa: F401 - the work is in these

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Mesh):
            return None if part.solid else "CGAL has an inside for closed meshes alone"
        points = None if isinstance(part, Sphere | Capsule) else corners(part)
        return f"CGAL has polytopes and meshes, no such {type(part).__name__}" if points is None or points[1] else None

    def build(self, part: Shape) -> tuple[np.ndarray, np.ndarray | None]:
        """Corners (n, 3) in the part's frame, and the facets of a mesh."""
        if isinstance(part, Mesh):
            return part.vertices, part.faces
        points = corners(part)
        assert points is not None  # others were refused
        polyhedron(points[0], None)
        return points[0], None

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        return Reply(meets(self.placed(A, X_WA), self.placed(B, X_WB)), note=_NO_DISTANCE)

    def placed(self, body, X_WB: np.ndarray) -> Any:
        """CGAL's mesh of a body at a pose (4, 4)."""
        points, facets = body
        return polyhedron(points @ X_WB[:3, :3].T + X_WB[:3, 3], facets)


def polyhedron(points: np.ndarray, facets: np.ndarray | None) -> Any:
    """CGAL's mesh of facets, or of the hull of points where there are none."""
    from CGAL.CGAL_Convex_hull_3 import convex_hull_3
    from CGAL.CGAL_Kernel import Point_3
    from CGAL.CGAL_Polygon_mesh_processing import (
        Int_Vector,
        Point_3_Vector,
        Polygon_Vector,
        polygon_soup_to_polygon_mesh,
    )
    from CGAL.CGAL_Polyhedron_3 import Polyhedron_3

    made, places = Polyhedron_3(), [Point_3(*point) for point in points.tolist()]
    if facets is None:
        convex_hull_3(places, made)
        if not made.is_closed() or made.size_of_facets() < 4:
            raise UnsupportedQuery("CGAL makes no solid of a flat hull")
        return made
    soup, polygons = Point_3_Vector(), Polygon_Vector()
    for place in places:
        soup.append(place)
    for facet in facets.tolist():
        polygon = Int_Vector()
        for vertex in facet:
            polygon.append(vertex)
        polygons.append(polygon)
    polygon_soup_to_polygon_mesh(soup, polygons, made)
    return made


def meets(A: Any, B: Any) -> bool:
    """Whether the solids that two closed meshes bound have a point in common."""
    from CGAL.CGAL_Polygon_mesh_processing import do_intersect

    return bool(do_intersect(A, B)) or _has_vertex_in(A, B) or _has_vertex_in(B, A)


def _has_vertex_in(outer: Any, inner: Any) -> bool:
    """Every vertex is asked: a mesh may have several shells."""
    from CGAL.CGAL_Kernel import ON_UNBOUNDED_SIDE
    from CGAL.CGAL_Polygon_mesh_processing import Side_of_triangle_mesh

    side = Side_of_triangle_mesh(outer)
    return any(side.bounded_side(vertex.point()) != ON_UNBOUNDED_SIDE for vertex in inner.vertices())
