"""coal and python-fcl asked about many posed pairs: loops of Python over what is ready, each engine at its best.

Geometries, transforms and requests are made beforehand; a loop makes or clears the result and asks. Questions: the
boolean and all pairs of facets without contacts, `break_distance` 0 (coal's own is an absolute 1e-3: small meshes take
it seconds, and large ones are answered sooner and wrongly); signed and unsigned distances. python-fcl has a process of
its own, since it ends the interpreter on some inputs, which costs one question.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from collide.adapters.bench.child_contestant import InChild
from collide.adapters.bench.claims import installed
from collide.adapters.bench.turns import Seconds
from collide.adapters.peers.coal_peer import CoalPeer
from collide.adapters.peers.fcl_peer import FclPeer
from collide.shapes import Mesh, Shape

#: Pairs of facets asked for.
MAX_PAIRS = 10_000_000
#: Most iterations of coal where a tolerance is asked for; its default is too few for tight ones.
MAX_ITERATIONS = 1000


def built(build: Callable[[Shape], object], shapes: Sequence[Shape]) -> list:
    """What an engine makes of shapes, each made once."""
    made = {id(shape): shape for shape in shapes}
    geometry = {key: build(shape) for key, shape in made.items()}
    return [geometry[id(shape)] for shape in shapes]


class CoalLoop:
    """Pair k is As[k] at X_WAs[k] and Bs[k] at X_WBs[k].   build : a shape's geometry, the peer's by default."""

    def __init__(self, As: Sequence, Bs: Sequence, X_WAs, X_WBs, build: Callable | None = None):
        import coal

        build = build or CoalPeer().build
        places = ([coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3])) for X in Xs] for Xs in (X_WAs, X_WBs))
        self._pairs = list(zip(built(build, As), next(places), built(build, Bs), next(places)))

    @staticmethod
    def _asked(question: str, tolerance: float | None, margin: float) -> tuple:
        import coal

        if question in ("boolean", "all pairs"):
            request = coal.CollisionRequest()
            request.enable_contact, request.break_distance, request.security_margin = False, 0.0, margin
            request.num_max_contacts = 1 if question == "boolean" else MAX_PAIRS
            return coal.collide, request, coal.CollisionResult()
        request = coal.DistanceRequest()
        request.enable_signed_distance = question == "signed"
        if tolerance is not None:
            request.gjk_tolerance = request.epa_tolerance = tolerance
            request.gjk_max_iterations = request.epa_max_iterations = MAX_ITERATIONS
        return coal.distance, request, coal.DistanceResult()

    def loop(self, question: str, tolerance: float | None = None, margin: float = 0.0) -> Callable[[], None]:
        """The loop to be timed; it keeps no answers."""
        ask, request, result = self._asked(question, tolerance, margin)

        def run() -> None:
            for a, X, b, Y in self._pairs:
                result.clear()  # a distance result that is not cleared keeps its answer
                ask(a, X, b, Y, request, result)

        return run

    def answers(self, question: str, tolerance: float | None = None, margin: float = 0.0) -> np.ndarray:
        """(N,) numbers of contacts, or distances [m]."""
        ask, request, result = self._asked(question, tolerance, margin)
        values = []
        for a, X, b, Y in self._pairs:
            result.clear()
            values.append(ask(a, X, b, Y, request, result))
        return np.array(values, dtype=float)


def coal_model(kind: str) -> Callable[[Mesh], object]:
    """Builds a mesh with bounding volumes of a kind, "OBB" or "OBBRSS"."""

    def build(mesh: Mesh):
        import coal

        model = getattr(coal, f"BVHModel{kind}")()
        model.beginModel(len(mesh.faces), len(mesh.vertices))
        model.addVertices(mesh.vertices)
        model.addTriangles(mesh.faces)
        model.endModel()
        return model

    return build


class FclLoop:
    """python-fcl in a child process; NaN where it died."""

    def __init__(self, As: Sequence, Bs: Sequence, X_WAs, X_WBs):
        self._child, self._n = InChild(_FclLoop, list(As), list(Bs), np.array(X_WAs), np.array(X_WBs)), len(X_WBs)
        self.close = self._child.close

    def loop(self, question: str) -> Callable[[], Seconds]:
        """Measured in the child."""
        return lambda: Seconds((self._child.call("ask", question) or (math.nan,))[0])

    def answers(self, question: str) -> np.ndarray:
        """(N,) as `CoalLoop.answers`."""
        return (self._child.call("ask", question) or (0.0, np.full(self._n, math.nan)))[1]


class _FclLoop:
    def __init__(self, As: list, Bs: list, X_WAs: np.ndarray, X_WBs: np.ndarray):
        import fcl

        self._shapes, self._peer = [As[0], Bs[0]], FclPeer()
        bodies = [
            [fcl.CollisionObject(g, fcl.Transform(np.array(X[:3, :3]), np.array(X[:3, 3]))) for g, X in zip(some, Xs)]
            for some, Xs in ((built(self._peer.build, As), X_WAs), (built(self._peer.build, Bs), X_WBs))
        ]
        self._pairs = list(zip(*bodies))

    def ask(self, question: str) -> tuple[float, np.ndarray]:
        """(seconds of the processor, what was answered)."""
        import fcl

        if question == "build":
            started = time.process_time()
            for shape in self._shapes:
                self._peer.build(shape)
            return time.process_time() - started, np.empty(0)
        if question in ("boolean", "all pairs"):
            max_contacts = 1 if question == "boolean" else MAX_PAIRS
            ask, request, result = fcl.collide, fcl.CollisionRequest(max_contacts, False), fcl.CollisionResult
        else:
            request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=question == "signed")
            ask, result = fcl.distance, fcl.DistanceResult
        started = time.process_time()
        values = [ask(a, b, request, result()) for a, b in self._pairs]  # results accumulate: each pair has its own
        return time.process_time() - started, np.array(values, dtype=float)


def mesh_loops(question: str, asked: tuple, kinds=("OBBRSS", "OBB")) -> tuple[dict, dict]:
    """(loops, engines) by name of what is installed, about (A, B, X_WAs, X_WBs), surfaces; fcl is to be closed."""
    A, B, Xs, Ys = asked
    engines: dict = {}
    for name in installed(coal="coal", fcl="fcl"):
        lists = [A] * len(Xs), [B] * len(Xs), Xs, Ys
        if name == "coal":
            engines |= {f"coal {kind}": CoalLoop(*lists, coal_model(kind)) for kind in kinds
                        if not (kind == "OBB" and question == "distance")}
        else:
            engines[name] = FclLoop(*lists)
    return {name: engine.loop(question) for name, engine in engines.items()}, engines
