"""trimesh's CollisionManager: FCL with trimesh's choice of geometry, convex solids or surfaces.

What has corners is handed over as a mesh with faces of our own; trimesh makes a convex solid of it where it finds the
mesh convex, and a BVH of facets where not.
"""

from __future__ import annotations

import numpy as np

from collide.adapters.peers.answers import NO_DEPTH, Reply
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.protocol import PairwisePeer, has_radius
from collide.adapters.peers.question import corners
from collide.errors import UnsupportedQuery
from collide.shapes import Capsule, Mesh, Shape, Sphere


class TrimeshPeer(PairwisePeer):
    """Two managers of one object each: `in_collision_other` and `min_distance_other`."""

    name, package, module = "trimesh", "trimesh", "trimesh"
    isolated = True  # FCL is inside
    about = "CollisionManager.in_collision_other for the boolean, min_distance_other for the rest"
    receives = (
        "meshes of triangles, boxes and hulls too, with faces of our own",
        "a convex solid where trimesh finds the mesh convex, else a BVH of facets",
        "poses in single precision, as its managers store them",
    )
    cannot = (
        "spheres, capsules, cylinders, cones, ellipsoids, half-spaces", "hulls with a radius, flat hulls",
        "insides and depths of meshes that are not convex", "a normal with a distance",
    )

    def missing(self) -> str | None:
        from importlib.util import find_spec

        without = None if find_spec("fcl") else "python-fcl is not installed, which trimesh's managers need"
        return super().missing() or without

    def refuses(self, part: Shape) -> str | None:
        if has_radius(part):
            return "trimesh has no hull with a radius"
        if not isinstance(part, Mesh) and (corners(part) is None or isinstance(part, Sphere | Capsule)):
            return f"trimesh's managers hold meshes only, and no {type(part).__name__}"
        return None

    def build(self, part: Shape):
        import trimesh

        if isinstance(part, Mesh):
            mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
            if mesh.is_convex and not part.solid:
                raise UnsupportedQuery("trimesh takes a convex surface for a solid")
            return mesh
        points = corners(part)
        if points is None:
            raise UnsupportedQuery(str(self.refuses(part)))
        return trimesh.Trimesh(*triangulate(points[0]), process=False)

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        from trimesh.collision import CollisionManager

        managers = CollisionManager(), CollisionManager()
        for name, manager, mesh, X in zip("ab", managers, (A, B), (X_WA, X_WB)):
            manager.add_object(name, mesh, transform=X)
        hit = bool(managers[0].in_collision_other(managers[1]))
        if hit and not (A.is_convex and B.is_convex):
            return Reply(hit, note=NO_DEPTH)
        distance, data = managers[0].min_distance_other(managers[1], return_data=True)
        return Reply(hit, float(distance), point_a=_point(data, "a"), point_b=_point(data, "b"))


def _point(data, name: str) -> tuple:
    """Where trimesh says the nearest point on a body is, in the world."""
    return tuple(np.asarray(data.point(name), dtype=float))
