"""coal and python-fcl as `benchmarks/meshes.py` asks them: triangle meshes as they are, poses ready to be used.

coal is asked with ``break_distance`` 0: its default of 1e-3 is absolute, and makes it spend seconds on meshes of that
size and answer sooner, and wrongly, on large ones. python-fcl runs in a child process, where it may abort.
"""

from __future__ import annotations

import math
import multiprocessing
import time

import numpy as np

#: What is timed: building, the boolean, all pairs of facets (without contact points), the distance with points.
QUESTIONS = ("build", "boolean", "all pairs", "distance")
#: Pairs of facets asked for.
MAX_PAIRS = 10_000_000
TIMEOUT = 120.0


#: A run repeats short loops for as long as this, and counts the fastest: other processes come in between.
RUN = 0.01


def warm(once) -> float:
    """Seconds of the fastest of several turns of a loop that times itself."""
    least = once()
    spent = least
    while spent < RUN and not math.isnan(least):
        taken = once()
        spent += taken
        least = min(least, taken)
    return least


class Coal:
    """coal with one kind of bounding volume."""

    def __init__(self, kind: str, meshes: list, X_WAs: np.ndarray, X_WBs: np.ndarray):
        import coal

        self.name = f"coal {kind}"
        self._kind, self._meshes, self._coal = kind, meshes, coal
        self._models = [self._model(*mesh) for mesh in meshes]
        self._poses = [
            tuple(coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3])) for X in pair) for pair in zip(X_WAs, X_WBs)
        ]

    def _model(self, vertices, faces):
        coal = self._coal
        model = {"OBBRSS": coal.BVHModelOBBRSS, "OBB": coal.BVHModelOBB}[self._kind]()
        model.beginModel(len(faces), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(faces)
        model.endModel()
        return model

    def seconds(self, question: str) -> float:
        """Of all poses, or of building both models, warm; NaN for what it does not offer."""
        return warm(lambda: self._once(question))

    def _once(self, question: str) -> float:
        coal, (a, b) = self._coal, self._models
        if question == "build":
            started = time.perf_counter()
            for mesh in self._meshes:
                self._model(*mesh)
            return time.perf_counter() - started
        if question == "distance" and self._kind == "OBB":
            return math.nan
        if question == "distance":
            request, ask, result = coal.DistanceRequest(), coal.distance, coal.DistanceResult
        else:
            request, ask, result = coal.CollisionRequest(), coal.collide, coal.CollisionResult
            request.break_distance = 0.0
            request.enable_contact = False
            request.num_max_contacts = 1 if question == "boolean" else MAX_PAIRS
        started = time.perf_counter()
        for X_WA, X_WB in self._poses:
            ask(a, X_WA, b, X_WB, request, result())
        return time.perf_counter() - started

    def answers(self) -> np.ndarray:
        """The booleans."""
        coal, (a, b) = self._coal, self._models
        request = coal.CollisionRequest()
        request.break_distance, request.enable_contact, request.num_max_contacts = 0.0, False, 1
        return np.array([coal.collide(a, X, b, Y, request, coal.CollisionResult()) > 0 for X, Y in self._poses])

    def close(self) -> None:
        """Nothing to end."""


class Fcl:
    """python-fcl, which has OBBRSS only, in a child process."""

    name = "fcl"

    def __init__(self, meshes: list, X_WAs: np.ndarray, X_WBs: np.ndarray):
        context = multiprocessing.get_context("spawn")
        self._pipe, child_end = context.Pipe()
        self._process = context.Process(target=_child, args=(child_end,), daemon=True)
        self._process.start()
        child_end.close()
        self._pipe.send((meshes, X_WAs, X_WBs))

    def seconds(self, question: str) -> float:
        """As `Coal.seconds`; NaN once the child has died or hung."""
        try:
            self._pipe.send(question)
            if self._pipe.poll(TIMEOUT):
                return self._pipe.recv()
        except (EOFError, OSError):
            pass
        self.close()
        return math.nan

    def answers(self) -> np.ndarray | None:
        """The booleans; None where the child is dead."""
        try:
            self._pipe.send("answers")
            return self._pipe.recv() if self._pipe.poll(TIMEOUT) else None
        except (EOFError, OSError):
            return None

    def close(self) -> None:
        self._process.kill()
        self._process.join()


def _child(pipe) -> None:
    import fcl

    meshes, X_WAs, X_WBs = pipe.recv()
    models = [_fcl_model(fcl, *mesh) for mesh in meshes]
    poses = [
        tuple(
            fcl.CollisionObject(model, fcl.Transform(np.array(X[:3, :3]), np.array(X[:3, 3])))
            for model, X in zip(models, pair)
        )
        for pair in zip(X_WAs, X_WBs)
    ]
    while True:
        try:
            question = pipe.recv()
        except EOFError:
            return
        if question == "answers":
            request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
            pipe.send(np.array([fcl.collide(a, b, request, fcl.CollisionResult()) > 0 for a, b in poses]))
        else:
            pipe.send(warm(lambda asked=question: _fcl_once(fcl, asked, meshes, poses)))


def _fcl_once(fcl, question: str, meshes, poses) -> float:
    started = time.perf_counter()
    if question == "build":
        for mesh in meshes:
            _fcl_model(fcl, *mesh)
    elif question == "distance":
        request = fcl.DistanceRequest(enable_nearest_points=True)
        for a, b in poses:
            fcl.distance(a, b, request, fcl.DistanceResult())
    else:
        request = fcl.CollisionRequest(num_max_contacts=1 if question == "boolean" else MAX_PAIRS, enable_contact=False)
        for a, b in poses:
            fcl.collide(a, b, request, fcl.CollisionResult())
    return time.perf_counter() - started


def _fcl_model(fcl, vertices, faces):
    model = fcl.BVHModel()
    model.beginModel(len(faces), len(vertices))
    model.addSubModel(vertices, faces)
    model.endModel()
    return model
