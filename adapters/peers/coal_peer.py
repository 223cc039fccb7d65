"""Coal: GJK and EPA, signed distance, normal from A to B; plain, with tight tolerances, or accelerated.

Hulls are handed over with faces of our own: coal's own hull builder ends the interpreter on thin
boxes. Its separate boolean (no contact wanted) is asked too, since its tolerances differ.
Meshes are BVHModelOBBRSS: surfaces, without an inside, and no depth where they meet. For pairs with one
`break_distance`, by default an absolute 1e-3, is 0: no pair of facets is left out for being nearly apart.
"""

from __future__ import annotations

import numpy as np

from collide.adapters.peers.answers import NO_DEPTH, Reply
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.protocol import PairwisePeer, Setting
from collide.adapters.peers.question import corners
from collide.errors import UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere


class CoalPeer(PairwisePeer):
    """coal's `collide` with contacts off for the boolean, its `distance` for the rest."""

    name, package, module = "coal", "coal", "coal"
    about = "collide with contacts off for the boolean, distance for the rest, default tolerances of 1e-6"
    receives = (
        "doubles; hulls with faces of our own, since its hull builder ends the interpreter on thin boxes",
        "meshes as BVHModelOBBRSS, break_distance 0 instead of 1e-3",
    )
    cannot = ("insides and depths of meshes", "hulls that are flat, or with a vertex of 255 or more neighbours")
    settings = {
        "tight": Setting(
            "as coal, with tolerances of 1e-12 and 1,000 iterations at most",
            {"gjk_tolerance": 1e-12, "epa_tolerance": 1e-12, "gjk_max_iterations": 1000, "epa_max_iterations": 1000},
        ),
        "nesterov": Setting("as coal, GJK with Nesterov's acceleration", {"gjk_variant": "NesterovAcceleration"}),
        "polyak": Setting("as coal, GJK with Polyak's acceleration", {"gjk_variant": "PolyakAcceleration"}),
    }

    def _request(self, request):
        """A request with the setting's values."""
        import coal

        for name, value in self.values.items():
            setattr(request, name, getattr(coal.GJKVariant, value) if name == "gjk_variant" else value)
        return request

    def build(self, part: Shape):
        import coal

        if isinstance(part, Sphere):
            return coal.Sphere(part.radius)
        if isinstance(part, Box):
            return coal.Box(np.array(part.size))
        if isinstance(part, Capsule):
            return coal.Capsule(part.radius, part.length)
        if isinstance(part, Cylinder):
            return coal.Cylinder(part.radius, part.length)
        if isinstance(part, Cone):
            return coal.Cone(part.radius, part.length)
        if isinstance(part, Ellipsoid):
            return coal.Ellipsoid(*map(float, part.radii))
        if isinstance(part, Halfspace):
            length = float(np.linalg.norm(part.normal))
            return coal.Halfspace(part.normal / length, part.offset / length)
        if isinstance(part, Mesh):
            return self._mesh(part)
        return self._hull(part)

    def _mesh(self, part: Mesh):
        import coal

        model = coal.BVHModelOBBRSS()
        model.beginModel(len(part.faces), len(part.vertices))
        model.addVertices(part.vertices)
        model.addTriangles(part.faces)
        model.endModel()
        return model

    def _hull(self, part: Shape):
        import coal

        points = corners(part)
        if points is None:
            raise UnsupportedQuery(f"coal has no {type(part).__name__}")
        corner_list, triangle_list = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        vertices, triangles = triangulate(points[0])
        for vertex in vertices:
            corner_list.append(vertex)
        for triangle in triangles:
            triangle_list.append(coal.Triangle(*map(int, triangle)))
        try:
            hull = coal.Convex(corner_list, triangle_list)
        except RuntimeError as error:
            if "Too many neighbors" in str(error):
                raise UnsupportedQuery("coal refuses hulls with a vertex of 255 or more neighbours") from None
            raise
        if isinstance(part, ConvexHull):
            hull.setSweptSphereRadius(part.radius)
        return hull

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        import coal

        T_WA, T_WB = (coal.Transform3s(X[:3, :3], X[:3, 3]) for X in (X_WA, X_WB))
        request = self._request(coal.CollisionRequest())
        request.enable_contact = False
        meshed = isinstance(A, coal.BVHModelBase) or isinstance(B, coal.BVHModelBase)
        if meshed:
            request.break_distance = 0.0
        if meshed and any(isinstance(g, coal.ShapeBase) and g.getSweptSphereRadius() for g in (A, B)):
            raise UnsupportedQuery("coal has no hull with a radius against meshes")
        hit = coal.collide(A, T_WA, B, T_WB, request, coal.CollisionResult()) > 0
        if hit and meshed:
            return Reply(hit, note=NO_DEPTH)
        result = coal.DistanceResult()  # a fresh one each time: an old one keeps its answer
        distance = float(coal.distance(A, T_WA, B, T_WB, self._request(coal.DistanceRequest()), result))
        point_a, point_b = tuple(result.getNearestPoint1()), tuple(result.getNearestPoint2())
        return Reply(hit, distance, tuple(result.normal), point_a, point_b)
