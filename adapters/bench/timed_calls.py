"""One signed distance of one prepared pair, as each engine's interface asks for it with the least around it.

Geometry, transforms, requests and results are made beforehand where the interface lets them be kept. What is left in
the time is the engine's own call, its binding, and what has to be done anew for each call: `WHAT_IS_TIMED`. An engine
without an entry is timed through its adapter's `ask`, which says so: such times hold Python's work too.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import collide
from collide.adapters.bench import engine_calls
from collide.adapters.peers.protocol import Peer
from collide.adapters.peers.pybullet_peer import quaternion_xyzw
from collide.errors import CollideError, UnsupportedQuery
from collide.shapes import Shape

#: One pair: two shapes and their poses (4, 4).
Pair = tuple[Shape, Shape, np.ndarray, np.ndarray]
#: What is in the time, by engine (without its setting), for tables and CSV.
WHAT_IS_TIMED = {
    "collide": "collide.distance(A, B, X_WA, X_WB), poses and shapes as a user holds them: with its result",
    "collide:batch": "one collide.distance of all pairs of the class, up to 2,000 rows of a ShapeSet: a mean",
    "coal": "result.clear() and coal.distance: geometry, transforms, request and result are kept",
    "fcl": "fcl.distance and its result, which cannot be cleared: objects and request are kept",
    "fcl:indep": "fcl.collide with contacts and its result: objects and request are kept",
    "pybullet": "two poses set and getClosestPoints: bodies are kept, all else is handed over at each call",
    **engine_calls.WHAT_IS_TIMED,
}
ADAPTER = "the adapter's ask: the engine's call with Python's work around it"


def has_prepared_call(name: str) -> bool:
    """Whether an engine or setting is timed without its adapter around it."""
    return name.partition(":")[0] in ("collide", *_CALLS)


def timed_call(peer: Peer, pair: Pair) -> Callable[[], Any]:
    """A function without arguments that asks an engine about one pair.

    Raises UnsupportedQuery where the engine does not have the shapes, and whatever its binding raises.
    """
    base = peer.name.partition(":")[0]
    if base == "collide":
        return partial(collide.distance, *pair)
    build, parts = getattr(peer, "build", None), []
    if build is None:
        raise CollideError(f"{peer.name}: an engine without build and ask cannot be timed pair by pair")
    for shape in pair[:2]:
        reason = peer.supports(shape)
        if reason:
            raise UnsupportedQuery(reason)
        parts.append(build(shape))
    return _CALLS.get(base, _ask)(peer, parts[0], pair[2], parts[1], pair[3])


def batch_call(pairs: list[Pair], copies: int = 1) -> Callable[[], Any]:
    """One call of `collide.distance` for all pairs, so many times over."""
    As, Bs, X_WAs, X_WBs = zip(*pairs)
    rows = np.tile(np.arange(len(pairs)), copies)
    A, B = (collide.ShapeSet(list(shapes))[rows] for shapes in (As, Bs))
    return partial(collide.distance, A, B, np.array(X_WAs)[rows], np.array(X_WBs)[rows])


def what_is_timed(name: str) -> str:
    """One line about the times of an engine:setting."""
    base = name.partition(":")[0]
    return WHAT_IS_TIMED.get(name) or WHAT_IS_TIMED.get(base, ADAPTER)


def _ask(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Callable[[], Any]:
    return partial(peer.ask, A, X_WA, B, X_WB)


def _coal(peer: Peer, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Callable[[], Any]:
    import coal

    T_WA, T_WB = (coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3])) for X in (X_WA, X_WB))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for name, value in peer.values.items():
        setattr(request, name, getattr(coal.GJKVariant, value) if name == "gjk_variant" else value)
    ask, reset = coal.distance, result.clear

    def call() -> None:
        reset()  # a result that is not cleared keeps its answer
        ask(A, T_WA, B, T_WB, request, result)

    return call


def _fcl(peer: Peer, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Callable[[], Any]:
    import fcl

    a, b = (fcl.CollisionObject(g, fcl.Transform(X[:3, :3], X[:3, 3])) for g, X in ((A, X_WA), (B, X_WB)))
    if "solver" in peer.values:
        solver = getattr(fcl.GJKSolverType, peer.values["solver"])
        contacts = fcl.CollisionRequest(num_max_contacts=8, enable_contact=True, gjk_solver_type=solver)
        return lambda: fcl.collide(a, b, contacts, fcl.CollisionResult())
    request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)
    return lambda: fcl.distance(a, b, request, fcl.DistanceResult())


def _pybullet(peer: Any, A: Any, X_WA: np.ndarray, B: Any, X_WB: np.ndarray) -> Callable[[], Any]:
    """Bodies stand where they were put; both are put there again, as any query of moving bodies has to."""
    import pybullet

    peer.ask(A, X_WA, B, X_WB)  # refuses what it cannot answer
    places = [(X @ part[1], part[0]) for part, X in ((A, X_WA), (B, X_WB))]
    (p_A, q_A, a), (p_B, q_B, b) = ((X[:3, 3].tolist(), quaternion_xyzw(X[:3, :3]), body) for X, body in places)
    finite = [part[2] for part in (A, B) if np.isfinite(part[2])]
    limit = 1.01 * (float(np.sqrt(np.square(places[0][0][:3, 3] - places[1][0][:3, 3]).sum())) + sum(finite))
    put, ask = pybullet.resetBasePositionAndOrientation, pybullet.getClosestPoints

    def call() -> None:
        put(a, p_A, q_A)
        put(b, p_B, q_B)
        ask(a, b, limit)

    return call


_CALLS: dict[str, Callable[..., Callable[[], Any]]] = {
    "coal": _coal, "fcl": _fcl, "pybullet": _pybullet,
    "mujoco": engine_calls.mujoco_call, "drake": engine_calls.drake_call, "trimesh": engine_calls.trimesh_call,
    "rapier": engine_calls.rapier_call, "distance3d": engine_calls.distance3d_call,
    "newton": engine_calls.newton_call, "cgal": engine_calls.cgal_call,
}
