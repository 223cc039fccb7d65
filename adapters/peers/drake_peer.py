"""Drake's SceneGraph: `HasCollisions` with signed distances of a pair, or its point-pair penetration.

A SceneGraph of two frames is made for every pair. Hulls are given as points, of which Drake takes its own hull, the one
its proximity engine uses. A pair of shapes that Drake has no distance for is refused by Drake itself, by name.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.mujoco_peer import plane_pose
from collide.adapters.peers.protocol import PairwisePeer, Setting, has_radius
from collide.adapters.peers.question import corners
from collide.errors import CollideError, UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere


class DrakePeer(PairwisePeer):
    """`HasCollisions` for the boolean, `ComputeSignedDistancePairClosestPoints` for the rest."""

    name, package, module = "drake", "drake", "pydrake"
    isolated, extra = True, "all-peers"
    about = "HasCollisions for the boolean, ComputeSignedDistancePairClosestPoints for the rest"
    receives = (
        "doubles; hull corners, of which Drake takes its own hull", "a SceneGraph made for each pair",
        "rotations projected where it refuses them",
    )
    cannot = (
        "cones, hulls with a radius, meshes other than as their hull", "flat hulls",
        "pairs of shapes that its tables leave out, most of those with half-spaces",
    )
    settings = {
        "penetration": Setting(
            "ComputePointPairPenetration: a hit where it lists a pair, its depth the distance", {"penetration": True},
            cannot=("gaps: bodies apart have no penetration", *cannot),
        )
    }

    def prepare(self) -> None:
        import pydrake.geometry  # noqa: F401 - the work is in this one

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Mesh):
            return "Drake takes the hull of a mesh"
        if isinstance(part, Cone):
            return "Drake has no Cone"
        return "Drake has no hull with a radius" if has_radius(part) else None

    def build(self, part: Shape) -> tuple:
        """Drake's shape, and the pose (4, 4) of its frame in the part."""
        from pydrake import geometry

        if isinstance(part, Sphere):
            return geometry.Sphere(part.radius), np.eye(4)
        if isinstance(part, Box):
            return geometry.Box(*part.size), np.eye(4)
        if isinstance(part, Capsule | Cylinder):
            kind = geometry.Capsule if isinstance(part, Capsule) else geometry.Cylinder
            return kind(part.radius, part.length), np.eye(4)
        if isinstance(part, Ellipsoid):
            return geometry.Ellipsoid(*part.radii), np.eye(4)
        if isinstance(part, Halfspace):
            return geometry.HalfSpace(), plane_pose(part)
        points = corners(part)
        if points is None:
            raise UnsupportedQuery(f"Drake has no {type(part).__name__}")
        return geometry.Convex(points=points[0].T, label="hull"), np.eye(4)

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        try:
            return self._asked(A, X_WA, B, X_WB)
        except RuntimeError as error:
            text = " ".join(str(error).split())
            if "not supported" in text or "are supported" in text or "MakeConvexHull" in text:
                raise UnsupportedQuery(f"Drake refuses: {text[:160]}") from None
            raise

    def _asked(self, A, X_WA, B, X_WB) -> Reply:
        scene, context, _poses, _frames, ids = scene_of(A, X_WA, B, X_WB)
        query = scene.get_query_output_port().Eval(context)
        if self.values.get("penetration"):
            pairs = query.ComputePointPairPenetration()
            if not pairs:
                return Reply(False, note="boolean only: bodies apart have no penetration")
            (pair,) = pairs
            sign = 1.0 if pair.id_A == ids[0] else -1.0
            point_a, point_b = (pair.p_WCa, pair.p_WCb)[:: int(sign)]
            # Its normal points from B into A.
            return Reply(True, -pair.depth, tuple(-sign * pair.nhat_BA_W), tuple(point_a), tuple(point_b))
        hit = query.HasCollisions()
        pair = query.ComputeSignedDistancePairClosestPoints(*ids)
        if (pair.id_A, pair.id_B) != ids:
            raise CollideError("Drake answered for another pair")
        X_WA, X_WB = (query.GetPoseInWorld(i) for i in ids)
        point_a, point_b = tuple(X_WA.multiply(pair.p_ACa)), tuple(X_WB.multiply(pair.p_BCb))
        return Reply(hit, pair.distance, tuple(-pair.nhat_BA_W), point_a, point_b)


def scene_of(A, X_WA: np.ndarray, B, X_WB: np.ndarray):
    """A SceneGraph of two geometries, its context, the port that takes their poses, the poses, and their ids."""
    from pydrake import geometry

    scene = geometry.SceneGraph()
    source = scene.RegisterSource("pair")
    ids, frames = [], geometry.FramePoseVector()
    for name, ((shape, X_PG), X_WP) in zip("ab", ((A, X_WA), (B, X_WB))):
        frame = scene.RegisterFrame(source, geometry.GeometryFrame(name))
        X_WG = rigid_transform(X_WP @ X_PG)
        instance = geometry.GeometryInstance(rigid_transform(np.eye(4)), shape, name)
        instance.set_proximity_properties(geometry.ProximityProperties())
        ids.append(scene.RegisterGeometry(source, frame, instance))
        frames.set_value(frame, X_WG)
    context = scene.CreateDefaultContext()
    poses = scene.get_source_pose_port(source)
    poses.FixValue(context, frames)
    return scene, context, poses, frames, tuple(ids)


def rigid_transform(X: Any):
    """Drake's transform of a pose (4, 4); a rotation that it finds no rotation is projected."""
    from pydrake.math import RigidTransform, RotationMatrix

    try:
        return RigidTransform(RotationMatrix(X[:3, :3]), X[:3, 3])
    except RuntimeError:
        return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3])
