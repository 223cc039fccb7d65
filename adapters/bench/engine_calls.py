"""Prepared calls of the engines whose adapters make a model for every pair: made once here, and asked again.

Each takes a peer and two of its geometries at poses (4, 4), and gives a function without arguments. What it keeps and
what it does anew stands in `WHAT_IS_TIMED`. The peer itself is asked once before, so that it can refuse.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from collide.adapters.peers import mujoco_peer, rapier_peer
from collide.adapters.peers.cgal_peer import meets
from collide.adapters.peers.distance3d_peer import collider, flavoured
from collide.adapters.peers.drake_peer import scene_of
from collide.shapes import Mesh

Call = Callable[[], Any]
WHAT_IS_TIMED = {
    "mujoco": "mj_kinematics and mj_collision, with :distance mj_geomDistance: the model and its data are kept",
    "drake": "two poses set and one query of the pair: the SceneGraph and its context are kept",
    "trimesh": "two transforms set and min_distance_other of two managers, which are kept",
    "rapier": "two positions set and a step of its collision pipeline: the world is kept; of meshes the adapter's ask",
    "rapier:cast": "the adapter's ask: worlds made, a manifold for the direction, and the cast",
    "rapier:nonlinear": "the adapter's ask: worlds made, a manifold for the direction, and the cast",
    "distance3d": "its function alone: colliders stand where they were made",
    "newton": "one launch of the narrow phase for one pair: arrays are kept; it is made for thousands at once",
    "cgal": "do_intersect, and where that is False the side of every vertex: meshes stand where they were made",
}


def mujoco_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """Both bodies are placed by mj_kinematics at every call."""
    import mujoco

    peer.ask(A, X_WA, B, X_WB)
    model = peer.model(((A, X_WA), (B, X_WB)))
    data, fromto, limit = mujoco.MjData(model), np.zeros(6), mujoco_peer.farthest(A, X_WA, B, X_WB)
    place, collide, distance = mujoco.mj_kinematics, mujoco.mj_collision, mujoco.mj_geomDistance
    if peer.values.get("distance"):
        return lambda: (place(model, data), distance(model, data, 0, 1, limit, fromto))
    return lambda: (place(model, data), collide(model, data))


def drake_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """The poses are an input of the SceneGraph that is set anew."""

    peer.ask(A, X_WA, B, X_WB)
    scene, context, poses, frames, ids = scene_of(A, X_WA, B, X_WB)
    answer, by_depth = scene.get_query_output_port(), bool(peer.values.get("penetration"))

    def call() -> None:
        poses.FixValue(context, frames)
        query = answer.Eval(context)
        if by_depth:
            query.ComputePointPairPenetration()
        else:
            query.ComputeSignedDistancePairClosestPoints(*ids)

    return call


def trimesh_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """Managers of one mesh each."""
    from trimesh.collision import CollisionManager

    peer.ask(A, X_WA, B, X_WB)
    a, b = CollisionManager(), CollisionManager()
    a.add_object("a", A, transform=X_WA)
    b.add_object("b", B, transform=X_WB)

    def call() -> None:
        a.set_transform("a", X_WA)
        b.set_transform("b", X_WB)
        a.min_distance_other(b)

    return call


def rapier_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """A world of two colliders; casts are asked of the peer as they are."""

    peer.ask(A, X_WA, B, X_WB)
    if peer.values.get("cast") or any(isinstance(part[2], Mesh) for part in (A, B)):
        return lambda: peer.ask(A, X_WA, B, X_WB)
    X_WA, X_WB = X_WA @ A[1], X_WB @ B[1]
    places = rapier_peer.isometry(X_WA), rapier_peer.isometry(X_WB)
    world, handles = rapier_peer.world_of((A[0], places[0]), (B[0], places[1]))
    colliders, reach = [world.colliders.get(handle) for handle in handles], rapier_peer.farthest(A, X_WA, B, X_WB)

    def call() -> None:
        for placed, place in zip(colliders, places):
            placed.position = place
        rapier_peer.step(world, reach)

    return call


def distance3d_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """Its functions take colliders with their poses inside."""

    a, b, flavour = collider(A, X_WA), collider(B, X_WB), peer.values.get("flavour", "jolt")
    return lambda: flavoured(flavour, a, b)


def newton_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """The arrays of one launch."""
    peer.ask(A, X_WA, B, X_WB)
    return peer.launch_of(A, X_WA, B, X_WB)[0]


def cgal_call(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Call:
    """Meshes in world coordinates."""

    a, b = peer.placed(A, X_WA), peer.placed(B, X_WB)
    return lambda: meets(a, b)
