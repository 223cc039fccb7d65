"""Rapier with parry inside, in single precision: contact manifolds, or the time of impact of a shape that is cast.

Two colliders without bodies in a world of their own for every pair. The boolean is the query pipeline's; the distance
that of the deepest point of the manifolds, which are made as far as the prediction distance reaches, so that it is set
to a bound of the gap. Parry's own distance is not bound. Of meshes the boolean alone is asked: manifolds that reach far
hold a point for every pair of facets.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.mujoco_peer import plane_pose
from collide.adapters.peers.protocol import PairwisePeer, Setting
from collide.adapters.peers.pybullet_peer import quaternion_xyzw
from collide.adapters.peers.question import corners
from collide.errors import CollideError, UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

#: Rapier's cylinders and cones stand along y, ours along z.
X_ALONG_Y = np.array([(1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)], dtype=float)
_CANNOT = (
    "ellipsoids, two half-spaces, hulls of one point or on a line",
    "distances, insides and depths of meshes: manifolds that reach far hold all pairs of facets",
)
_NO_DEPTH = "depths: a cast from inside has the time 0"
_PLANES = "Rapier tests no half-space against another"


class RapierPeer(PairwisePeer):
    """The query pipeline's `intersect_shape` for the boolean, the narrow phase's manifolds for the rest."""

    name, package, module = "rapier", "rapier3d", "rapier3d"
    isolated, extra = True, "all-peers"
    about = "intersect_shape for the boolean; manifolds of CollisionPipeline.step for the rest, their deepest point"
    receives = (
        "all in single precision: sizes, corners, facets, and poses as unit quaternions",
        "hull corners, of which it takes its own hull", "meshes as TriMesh, a surface",
        "a prediction distance larger than the gap", "a PhysicsWorld made for each pair",
    )
    cannot = _CANNOT
    settings = {
        "cast": Setting(
            "cast_shape of B along its own manifold's normal: a hit starts in contact or at time 0, a gap is a time",
            {"cast": "cast_shape"}, cannot=(_NO_DEPTH, *_CANNOT),
        ),
        "nonlinear": Setting(
            "as rapier:cast, cast_shape_nonlinear of a motion without a turn",
            {"cast": "cast_shape_nonlinear"},
            cannot=(_NO_DEPTH, "half-spaces: this cast goes through them without a word", *_CANNOT),
        ),
    }

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Halfspace) and self.values.get("cast") == "cast_shape_nonlinear":
            return "Rapier's cast_shape_nonlinear goes through half-spaces without a word"
        return "Rapier has no Ellipsoid" if isinstance(part, Ellipsoid) else None

    def build(self, part: Shape) -> tuple[Any, np.ndarray, Shape]:
        """Rapier's shape, the pose (4, 4) of its frame in the part, and the part."""
        import rapier3d

        shapes, X_PS = rapier3d.SharedShape, np.eye(4)
        if isinstance(part, Sphere):
            return shapes.ball(part.radius), X_PS, part
        if isinstance(part, Box):
            return shapes.cuboid(*(part.size / 2).tolist()), X_PS, part
        if isinstance(part, Capsule):
            return shapes.capsule_z(part.length / 2, part.radius), X_PS, part
        if isinstance(part, Cylinder | Cone):
            kind = shapes.cylinder if isinstance(part, Cylinder) else shapes.cone
            return kind(part.length / 2, part.radius), X_ALONG_Y, part
        if isinstance(part, Halfspace):
            return shapes.halfspace((0.0, 0.0, 1.0)), plane_pose(part), part
        if isinstance(part, Mesh):
            return shapes.trimesh(part.vertices, part.faces), X_PS, part
        points = corners(part)
        if points is None:
            raise UnsupportedQuery(f"Rapier has no {type(part).__name__}")
        try:
            if isinstance(part, ConvexHull) and part.radius > 0:
                return shapes.round_convex_hull(points[0], part.radius), X_PS, part
            return shapes.convex_hull(points[0]), X_PS, part
        except rapier3d.MeshConversionError as error:
            raise UnsupportedQuery(f"Rapier makes no such hull: {error}") from None

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        if isinstance(A[2], Halfspace) and isinstance(B[2], Halfspace):
            raise UnsupportedQuery(_PLANES)
        try:
            return self._asked(A, X_WA @ A[1], B, X_WB @ B[1])
        except Exception:
            raise
        except BaseException as error:
            # A panic of Rust's is no Exception; it costs this pair, for the next has a world of its own.
            if type(error).__name__ != "PanicException":
                raise
            raise CollideError(f"Rapier panics: {error}") from None

    def _asked(self, A, X_WA: np.ndarray, B, X_WB: np.ndarray) -> Reply:
        places = isometry(X_WA), isometry(X_WB)
        cast = self.values.get("cast")
        if isinstance(A[2], Mesh) or isinstance(B[2], Mesh):
            hit = _starts_in_contact(cast, A, B, places) if cast else _intersect(A, B, places)
            return Reply(hit, note="boolean only: no distance of meshes is asked of Rapier")
        if cast:
            return _gap_by_cast(cast, A, B, places, farthest(A, X_WA, B, X_WB))
        hit = _intersect(A, B, places)
        deepest = _deepest(A, B, places, farthest(A, X_WA, B, X_WB))
        if deepest is None:
            return Reply(hit, math.inf)  # that is what no contact within any distance says
        distance, normal, p_Aq, p_Bq = deepest
        point_a, point_b = (X[:3, :3] @ p + X[:3, 3] for X, p in ((X_WA, p_Aq), (X_WB, p_Bq)))
        return Reply(hit, distance, unit(normal), tuple(point_a), tuple(point_b))


def isometry(X: np.ndarray):
    """Rapier's transform of a pose (4, 4)."""
    import rapier3d

    x, y, z, w = quaternion_xyzw(X[:3, :3])
    return rapier3d.Isometry3(rapier3d.Vec3(*X[:3, 3].tolist()), rapier3d.Rotation3(w, x, y, z))


def world_of(*placed):
    """A world of colliders that test each other though none can move, and their handles."""
    import rapier3d

    world, all_types = rapier3d.PhysicsWorld(), rapier3d.ActiveCollisionTypes.all()
    handles = [
        world.add_collider(rapier3d.Collider.new(shape).position(place).active_collision_types(all_types))
        for shape, place in placed
    ]
    return world, handles


def step(world, prediction: float) -> None:
    """Broad and narrow phase of a world, manifolds as far as the prediction reaches [m]."""
    world.collision_pipeline.step(
        prediction, world.islands, world.broad_phase, world.narrow_phase, world.rigid_bodies, world.colliders
    )


def _query_pipeline(A, places):
    """Queries against A alone."""
    world, _ = world_of((A[0], places[0]))
    world.detect_collisions()
    world.update_query_pipeline()
    return world, world.query_pipeline


def _intersect(A, B, places) -> bool:
    _alive, pipeline = _query_pipeline(A, places)
    hits = []

    def go_on(handle) -> bool:
        hits.append(handle)
        return True

    pipeline.intersect_shape(places[1], B[0], go_on)
    return bool(hits)


def _deepest(A, B, places, prediction: float):
    """Distance, normal A→B in the world, and the points in their own frames of the deepest contact; None for none."""
    world, (a, b) = world_of((A[0], places[0]), (B[0], places[1]))
    step(world, prediction)
    pair = world.narrow_phase.contact_pair(a, b)
    contacts = [(point, manifold) for manifold in (pair.manifolds if pair else ()) for point in manifold.points]
    if not contacts:
        return None
    point, manifold = min(contacts, key=lambda contact: contact[0].dist)
    normal = np.array(manifold.data.normal.to_tuple())
    sides = [np.array(p.to_tuple()) for p in (point.local_p1, point.local_p2)]
    return (point.dist, normal, *sides) if pair.collider1 == a else (point.dist, -normal, *sides[::-1])


def _cast(kind: str, A, B, places, velocity, reach: float):
    """(time of impact, status) of B on A; None where it meets nothing."""
    import rapier3d

    _alive, pipeline = _query_pipeline(A, places)
    options = rapier3d.ShapeCastOptions(max_time_of_impact=reach, stop_at_penetration=True)
    if kind == "cast_shape":
        impact = pipeline.cast_shape(places[1], rapier3d.Vec3(*velocity), B[0], options)
    else:
        motion = rapier3d.NonlinearRigidMotion(start=places[1], linvel=rapier3d.Vec3(*velocity))
        impact = pipeline.cast_shape_nonlinear(motion, B[0], options, 0.0, reach)
    return impact and (impact[1].time_of_impact, impact[1].status)


def _starts_in_contact(kind: str, A, B, places) -> bool:
    """Whether a cast along z starts in contact, as Rapier says it."""
    impact = _cast(kind, A, B, places, (0.0, 0.0, 1.0), 1e-30)
    return bool(impact) and _is_contact(impact)


def _is_contact(impact) -> bool:
    """Whether a cast starts in contact: Rapier says so, or it meets at the time 0."""
    import rapier3d

    return impact[0] == 0.0 or impact[1] == rapier3d.ShapeCastStatus.PENETRATING_OR_WITHIN_TARGET_DIST


def _gap_by_cast(kind: str, A, B, places, reach: float) -> Reply:
    deepest = _deepest(A, B, places, reach)
    if deepest is None:
        raise UnsupportedQuery("no manifold, so no direction to cast along")
    normal = unit(deepest[1])
    impact = _cast(kind, A, B, places, [-x for x in normal], reach)
    if impact is None:
        return Reply(False, math.inf, normal, note="cast towards each other, they never meet")
    if _is_contact(impact):
        return Reply(True, note="boolean only: the cast starts in contact")
    return Reply(False, float(impact[0]), normal)


def unit(vector) -> tuple:
    """A normal of single precision, of length 1 in double; NaN for none."""
    length = float(np.linalg.norm(vector))
    return tuple(np.asarray(vector) / length) if length > 0 else (math.nan,) * 3


def farthest(A, X_WA: np.ndarray, B, X_WB: np.ndarray) -> float:
    """A distance that the two bodies surely do not exceed [m]; a half-space is as far as its plane."""
    between = float(np.linalg.norm(X_WA[:3, 3] - X_WB[:3, 3]))
    return 1.01 * (between + sum(rapier_reach(part) for _, _, part in (A, B)))


def rapier_reach(part: Shape) -> float:
    """How far a shape reaches from its origin [m]; 0 for half-spaces."""
    if isinstance(part, Halfspace):
        return 0.0
    if isinstance(part, Cylinder | Cone):
        return part.radius + part.length / 2
    points = corners(part)
    assert points is not None  # all other shapes have corners, or were refused
    return float(np.linalg.norm(points[0], axis=1).max()) + points[1]
