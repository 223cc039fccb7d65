"""Bullet through pybullet: `getClosestPoints` of two bodies, their margins set to 0 or as they come.

pybullet has no boolean of its own for posed bodies: a hit is a closest distance ≤ 0. Hull corners
are snapped to a grid by Bullet, up to 1e-4 of the hull's size; that error is Bullet's answer.
Meshes are static concave triangle meshes, which Bullet tests against convex shapes only, facet by facet.
Asked in a child process, since it prints when it is imported.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from collide.adapters.peers.answers import NO_DEPTH, Event, Reply
from collide.adapters.peers.protocol import PairwisePeer, Question, Setting
from collide.adapters.peers.question import corners
from collide.errors import CollideError, UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

#: Of the arrays that createCollisionShape takes.
_MAX_VERTICES, _MAX_INDICES = 131_072, 524_288


_RECEIVES = (
    "doubles; hull corners, which Bullet snaps to a grid of up to 1e-4 of the hull's size",
    "meshes as static concave triangle meshes",
)


class PybulletPeer(PairwisePeer):
    """A client without a window, open while a question is answered."""

    name, package, module = "pybullet", "pybullet", "pybullet"
    isolated = True
    hint = "it has wheels up to Python 3.11 only"
    about = "getClosestPoints; a hit is a distance of 0 or less"
    receives = ("collision margins set to 0", *_RECEIVES)
    cannot = (
        "a boolean of its own for posed bodies", "cones, ellipsoids, hulls with a radius", "two planes",
        "meshes against meshes or planes, depths of meshes",
    )
    settings = {
        "margins": Setting(
            "getClosestPoints as it comes; a hit is a distance of 0 or less",
            {"margins": True},
            ("collision margins as Bullet sets them", *_RECEIVES),
        )
    }
    _client = -1

    def stream(self, question: Question, wanted: Iterable[int]) -> Iterator[Event]:
        import pybullet

        self._client = pybullet.connect(pybullet.DIRECT)
        try:
            yield from super().stream(question, wanted)
        finally:
            pybullet.disconnect(self._client)

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Cone | Ellipsoid):
            return f"pybullet has no {type(part).__name__}"
        points = corners(part)
        if points is not None and points[1] > 0 and not isinstance(part, Sphere | Capsule):
            return "pybullet has no hull with a radius"
        return None

    def build(self, part: Shape) -> tuple[int, np.ndarray, float, Shape]:
        """A body without mass, the pose of its frame in the part, its reach [m], and the part."""
        import pybullet

        X_PB = np.eye(4)
        if isinstance(part, Halfspace):
            # Bullet's plane goes through its own origin; it is shifted there.
            normal = part.normal / np.linalg.norm(part.normal)
            X_PB[:3, 3] = normal * part.offset / np.linalg.norm(part.normal)
            kind, reach = {"shapeType": pybullet.GEOM_PLANE, "planeNormal": normal.tolist()}, np.inf
        else:
            kind, reach = collision_shape(pybullet, part)
        shape = pybullet.createCollisionShape(**kind, physicsClientId=self._client)
        if shape < 0:
            raise CollideError(f"pybullet made no collision shape of {part!r}")
        body = pybullet.createMultiBody(0, shape, physicsClientId=self._client)
        if not self.values.get("margins"):
            pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=self._client)
        return body, X_PB, reach, part

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        import pybullet

        if isinstance(A[3], Halfspace) and isinstance(B[3], Halfspace):
            raise UnsupportedQuery("pybullet gives no distance between two planes")
        meshes = isinstance(A[3], Mesh) + isinstance(B[3], Mesh)
        if meshes and (meshes == 2 or isinstance(A[3], Halfspace) or isinstance(B[3], Halfspace)):
            raise UnsupportedQuery("pybullet tests concave meshes against convex shapes only")
        for (body, X_PB, _, _), X_WP in ((A, X_WA), (B, X_WB)):
            X_WB_ = X_WP @ X_PB
            pybullet.resetBasePositionAndOrientation(
                body, X_WB_[:3, 3].tolist(), quaternion_xyzw(X_WB_[:3, :3]), physicsClientId=self._client
            )
        limit = _farthest(A, X_WA @ A[1], B, X_WB @ B[1])
        contacts = pybullet.getClosestPoints(A[0], B[0], limit, physicsClientId=self._client)
        if not contacts:
            raise CollideError(f"pybullet returned no closest points within {limit:g} m")
        nearest = min(contacts, key=lambda contact: contact[8])
        # Its normal stands on B and points towards A.
        if meshes and nearest[8] <= 0:
            return Reply(True, note=NO_DEPTH)
        normal = tuple(-x for x in nearest[7])
        return Reply(nearest[8] <= 0, nearest[8], normal, nearest[5], nearest[6])


def collision_shape(pybullet, part: Shape) -> tuple[dict, float]:
    """Arguments of createCollisionShape, and how far the part reaches from its origin [m]."""
    if isinstance(part, Sphere):
        return {"shapeType": pybullet.GEOM_SPHERE, "radius": part.radius}, part.radius
    if isinstance(part, Box):
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": (part.size / 2).tolist()}, float(part.size.sum())
    if isinstance(part, Capsule | Cylinder):
        kind = pybullet.GEOM_CAPSULE if isinstance(part, Capsule) else pybullet.GEOM_CYLINDER
        return {"shapeType": kind, "radius": part.radius, "height": part.length}, part.radius + part.length
    if isinstance(part, Mesh):
        if len(part.vertices) > _MAX_VERTICES or 3 * len(part.faces) > _MAX_INDICES:
            raise UnsupportedQuery(
                f"pybullet takes meshes of {_MAX_VERTICES} vertices and {_MAX_INDICES} indices at most"
            )
        return {
            "shapeType": pybullet.GEOM_MESH, "vertices": part.vertices.tolist(), "indices": part.faces.ravel().tolist(),
            "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        }, float(np.sqrt(np.square(part.vertices).sum(axis=1)).max())
    points = corners(part)
    if points is None:
        raise UnsupportedQuery(f"pybullet has no {type(part).__name__}")
    reach = float(np.linalg.norm(points[0], axis=1).max())
    return {"shapeType": pybullet.GEOM_MESH, "vertices": points[0].tolist()}, reach


def _farthest(A, X_WA: np.ndarray, B, X_WB: np.ndarray) -> float:
    """A distance that the two bodies surely do not exceed, for Bullet to search within [m]."""
    between = float(np.linalg.norm(X_WA[:3, 3] - X_WB[:3, 3]))
    return 1.01 * (between + sum(reach for _, _, reach, _ in (A, B) if np.isfinite(reach)))


def quaternion_xyzw(R: np.ndarray) -> list[float]:
    """The unit quaternion, scalar last, nearest to a rotation (3, 3).

    The eigenvector of the largest eigenvalue of Bar-Itzhack's symmetric matrix (New method for
    extracting the quaternion from a rotation matrix, 2000): no case distinction, no loss of digits.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    K = [
        [xx - yy - zz, yx + xy, zx + xz, zy - yz],
        [yx + xy, yy - xx - zz, zy + yz, xz - zx],
        [zx + xz, zy + yz, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    return np.linalg.eigh(np.array(K))[1][:, -1].tolist()
