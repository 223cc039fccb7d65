"""MuJoCo: contacts of `mj_collision`, or `mj_geomDistance`, each by its own convex solver or by libccd.

A model of two bodies that never move is compiled for every pair. Hulls are given as points; MuJoCo stores them in
single precision, takes its own hull of them and moves its frame to their centre, which is its answer's error.
"""

from __future__ import annotations

import math

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer, Setting, has_radius
from collide.adapters.peers.pybullet_peer import quaternion_xyzw
from collide.adapters.peers.question import corners
from collide.errors import UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

_APART = "boolean only: bodies apart have no contact"


class MujocoPeer(PairwisePeer):
    """One contact pair without margin; its deepest contact is the depth, of bodies apart there is no number."""

    name, package, module = "mujoco", "mujoco", "mujoco"
    isolated = True
    about = "mj_collision's contacts without margin, native solver; the deepest contact is the depth"
    receives = (
        "hull corners in single precision, recentred, with MuJoCo's own hull around them",
        "poses as unit quaternions", "a model compiled for each pair, explicit contact pair, margin 0, multiccd off",
    )
    cannot = (
        "gaps: bodies apart have no contact", "cones, hulls with a radius, meshes other than as their hull",
        "flat hulls, and hulls whose volume it finds too small", "two planes",
    )
    settings = {
        "libccd": Setting("as mujoco, solver libccd", {"libccd": True}),
        "distance": Setting(
            "mj_geomDistance, native solver; a hit is a distance of 0 or less", {"distance": True},
            cannot=("a boolean of its own", *cannot[1:]),
        ),
        "distance-libccd": Setting(
            "mj_geomDistance, solver libccd; a hit is a distance of 0 or less", {"distance": True, "libccd": True},
            cannot=("a boolean of its own", *cannot[1:]),
        ),
    }

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Mesh):
            return "MuJoCo takes the hull of a mesh"
        if isinstance(part, Cone):
            return "MuJoCo has no Cone"
        return "MuJoCo has no hull with a radius" if has_radius(part) else None

    def build(self, part: Shape) -> tuple[dict, np.ndarray | None, np.ndarray]:
        """Arguments of a geom, the corners of its mesh, and the pose of the geom in the part."""
        import mujoco

        geom, X_PG = mujoco.mjtGeom, np.eye(4)
        if isinstance(part, Sphere):
            return {"type": geom.mjGEOM_SPHERE, "size": [part.radius, 0, 0]}, None, X_PG
        if isinstance(part, Box):
            return {"type": geom.mjGEOM_BOX, "size": part.size / 2}, None, X_PG
        if isinstance(part, Capsule | Cylinder):
            kind = geom.mjGEOM_CAPSULE if isinstance(part, Capsule) else geom.mjGEOM_CYLINDER
            return {"type": kind, "size": [part.radius, part.length / 2, 0]}, None, X_PG
        if isinstance(part, Ellipsoid):
            return {"type": geom.mjGEOM_ELLIPSOID, "size": part.radii}, None, X_PG
        if isinstance(part, Halfspace):
            return {"type": geom.mjGEOM_PLANE, "size": [1, 1, 1]}, None, plane_pose(part)
        points = corners(part)
        if points is None:
            raise UnsupportedQuery(f"MuJoCo has no {type(part).__name__}")
        return {"type": geom.mjGEOM_MESH}, np.unique(points[0], axis=0), X_PG

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        import mujoco

        if A[0]["type"] == B[0]["type"] == mujoco.mjtGeom.mjGEOM_PLANE:
            raise UnsupportedQuery("MuJoCo has no contact of two planes")
        model = self.model(((A, X_WA), (B, X_WB)))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        if self.values.get("distance"):
            fromto = np.zeros(6)
            distance = mujoco.mj_geomDistance(model, data, 0, 1, farthest(A, X_WA, B, X_WB), fromto)
            point_a, point_b = fromto[:3], fromto[3:]
            return Reply(distance <= 0, distance, along(point_b - point_a, distance), tuple(point_a), tuple(point_b))
        mujoco.mj_collision(model, data)
        if not data.ncon:
            return Reply(False, note=_APART)
        deepest = int(np.argmin(data.contact.dist))
        distance, normal, middle = (getattr(data.contact, name)[deepest] for name in ("dist", "frame", "pos"))
        normal = normal[:3] * (1 if data.contact.geom1[deepest] == 0 else -1)
        step_AB = normal * distance
        return Reply(True, float(distance), tuple(normal), tuple(middle - step_AB / 2), tuple(middle + step_AB / 2))

    def model(self, sides):
        """A compiled model of two bodies at rest, with one explicit pair of geoms 0 and 1."""
        import mujoco

        spec = mujoco.MjSpec()
        # Further contacts of a pair are no depths: some are deeper than the bodies overlap.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
        if self.values.get("libccd"):
            spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
        for name, ((arguments, points, X_PG), X_WP) in zip("ab", sides):
            X_WG = X_WP @ X_PG
            x, y, z, w = quaternion_xyzw(X_WG[:3, :3])
            body = spec.worldbody.add_body(name=name, pos=X_WG[:3, 3], quat=[w, x, y, z])
            if points is not None:
                mesh = spec.add_mesh(name=name)
                mesh.uservert = points.ravel()
                mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
                arguments = {**arguments, "meshname": name}
            body.add_geom(name=name, **arguments)
        spec.add_pair(geomname1="a", geomname2="b", margin=0.0, gap=0.0)
        try:
            return spec.compile()
        except ValueError as error:
            raise UnsupportedQuery(f"MuJoCo compiles no such mesh: {str(error).splitlines()[0]}") from None


def farthest(A, X_WA: np.ndarray, B, X_WB: np.ndarray) -> float:
    """A distance that the two bodies surely do not exceed [m]: libccd loses digits where it is larger."""
    reach = sum(
        float(np.sum(geom["size"]) if points is None else np.linalg.norm(points, axis=1).max())
        for geom, points, _ in (A, B)
    )
    offset = max(float(np.linalg.norm(X_PG[:3, 3])) for *_, X_PG in (A, B))
    return 1.01 * (float(np.linalg.norm(X_WA[:3, 3] - X_WB[:3, 3])) + reach + offset)


def plane_pose(part: Halfspace) -> np.ndarray:
    """The pose (4, 4) in a half-space's frame of a plane through its origin with normal z."""
    length = float(np.linalg.norm(part.normal))
    normal = part.normal / length
    least = np.eye(3)[np.argmin(np.abs(normal))]
    x = np.cross(least, normal)
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3] = np.column_stack([x, np.cross(normal, x), normal])
    X[:3, 3] = normal * part.offset / length
    return X


def along(step_AB: np.ndarray, distance: float) -> tuple:
    """The unit normal A→B implied by the witness points, NaN where they coincide."""
    length = float(np.linalg.norm(step_AB))
    return tuple(step_AB * (math.copysign(1.0, distance) / length)) if length > 0 else (math.nan,) * 3
