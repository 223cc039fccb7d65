"""FCL through python-fcl: libccd's GJK and EPA or its own, signed distance, no normal with a distance.

Asked in a child process: on some inputs its signed distance throws through Cython and ends the
interpreter, and any distance to a half-space crashes it. Of half-spaces only the boolean is asked.
Meshes are BVHModels: surfaces, without an inside, and no depth where they meet.
"""

from __future__ import annotations

import math

import numpy as np

from collide.adapters.peers.answers import NO_DEPTH, Reply
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.protocol import PairwisePeer, Setting, has_radius
from collide.adapters.peers.question import corners
from collide.errors import UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere


class FclPeer(PairwisePeer):
    """python-fcl's `collide` for the boolean, its `distance` with everything enabled for the rest."""

    name, package, module = "fcl", "python-fcl", "fcl"
    isolated = True
    about = "collide for the boolean, distance with everything enabled for the rest, solver libccd"
    receives = ("doubles; hulls with faces of our own, which its Convex wants", "meshes as BVHModels")
    cannot = (
        "insides and depths of meshes", "distances to half-spaces, which crash it", "hulls with a radius, flat hulls",
        "a normal with a distance: taken from its nearest points",
    )
    settings = {
        "indep": Setting(
            "collide alone, with contacts, by FCL's own GJK and EPA", {"solver": "GST_INDEP"},
            cannot=(
                "gaps: python-fcl hands the solver of distance to FCL as rel_err, so only collide obeys it",
                "insides and depths of meshes", "hulls with a radius, flat hulls",
            ),
        )
    }

    def refuses(self, part: Shape) -> str | None:
        return "python-fcl has no hull with a radius" if has_radius(part) else None

    def build(self, part: Shape):
        import fcl

        if isinstance(part, Sphere):
            return fcl.Sphere(part.radius)
        if isinstance(part, Box):
            return fcl.Box(*part.size)
        if isinstance(part, Capsule):
            return fcl.Capsule(part.radius, part.length)
        if isinstance(part, Cylinder):
            return fcl.Cylinder(part.radius, part.length)
        if isinstance(part, Cone):
            return fcl.Cone(part.radius, part.length)
        if isinstance(part, Ellipsoid):
            return fcl.Ellipsoid(*part.radii)
        if isinstance(part, Halfspace):
            length = float(np.linalg.norm(part.normal))
            return fcl.Halfspace(part.normal / length, part.offset / length)
        if isinstance(part, Mesh):
            model = fcl.BVHModel()
            model.beginModel(len(part.vertices), len(part.faces))
            model.addSubModel(part.vertices, part.faces)
            model.endModel()
            return model
        points = corners(part)
        if points is None:
            raise UnsupportedQuery(f"python-fcl has no {type(part).__name__}")
        vertices, triangles = triangulate(points[0])
        # Flat list of faces, each led by its number of corners.
        faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
        return fcl.Convex(vertices, len(triangles), faces)

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        import fcl

        a, b = (fcl.CollisionObject(g, fcl.Transform(X[:3, :3], X[:3, 3])) for g, X in ((A, X_WA), (B, X_WB)))
        meshed = isinstance(A, fcl.BVHModel) or isinstance(B, fcl.BVHModel)
        if "solver" in self.values:
            return _by_contact(a, b, getattr(fcl.GJKSolverType, self.values["solver"]), meshed)
        # Requests and results are made anew for every call: results accumulate.
        hit = fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        if isinstance(A, fcl.Halfspace) or isinstance(B, fcl.Halfspace):
            return Reply(hit, note="boolean only: python-fcl's distance to a half-space crashes")
        if hit and meshed:
            return Reply(hit, note=NO_DEPTH)
        request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)
        result = fcl.DistanceResult()
        distance = float(fcl.distance(a, b, request, result))
        point_a, point_b = (p if p is not None else np.full(3, np.nan) for p in result.nearest_points)
        return Reply(hit, distance, _along(point_b - point_a, distance), tuple(point_a), tuple(point_b))


def _by_contact(a, b, solver, meshed: bool) -> Reply:
    """What `fcl.collide` says with contacts wanted: of an overlap the deepest contact, of a gap nothing."""
    import fcl

    result = fcl.CollisionResult()
    request = fcl.CollisionRequest(num_max_contacts=8, enable_contact=True, gjk_solver_type=solver)
    if not fcl.collide(a, b, request, result):
        return Reply(False, note="boolean only: a contact is all that is asked")
    if meshed or not result.contacts:
        return Reply(True, note=NO_DEPTH)
    # Its closed forms write depths above 0, its EPA below.
    deepest = max(result.contacts, key=lambda contact: abs(contact.penetration_depth))
    return Reply(True, -abs(float(deepest.penetration_depth)), tuple(deepest.normal))


def _along(step_AB: np.ndarray, distance: float) -> tuple:
    """The unit normal A→B implied by the witness points, NaN where they coincide."""
    length = float(np.linalg.norm(step_AB))
    return tuple(step_AB * (math.copysign(1.0, distance) / length)) if length > 0 else (math.nan,) * 3
