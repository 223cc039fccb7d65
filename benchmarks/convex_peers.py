"""coal and python-fcl as `benchmarks/convex.py` asks them: Python loops over poses that are ready to be used.

Geometries, transforms and requests are made beforehand; a loop makes or clears the result and asks. Both are
asked the same three questions: the boolean without contacts, the signed distance, the unsigned one. coal can be
asked with tolerances of one's own.
"""

from __future__ import annotations

import math
import multiprocessing
import time
from collections.abc import Callable

import numpy as np

QUESTIONS = ("boolean", "signed", "unsigned")
#: Most iterations of coal where a tolerance is asked for; its default is too few for tight ones.
MAX_ITERATIONS = 1000
#: How long python-fcl may take over one loop before it counts as hung [s].
TIMEOUT = 300.0


class Coal:
    """coal with its default settings unless a tolerance is given, contacts off for the boolean."""

    name = "coal"

    def __init__(self, solids: list, which: np.ndarray, X_WBs: np.ndarray):
        import coal

        used = np.unique(which)
        geometry = {k: _coal_hull(solids[k].points, solids[k].faces) for k in used.tolist()}
        self._origin = coal.Transform3s(np.eye(3), np.zeros(3))
        self._pairs = [
            (geometry[a], geometry[b], coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3])))
            for (a, b), X in zip(which.tolist(), X_WBs)
        ]

    def loop(self, question: str, tolerance: float | None = None) -> Callable[[], None]:
        """The loop to be timed; it keeps no answers."""
        ask, request, result, origin = *self._asked(question, tolerance), self._origin

        def run():
            for a, b, T in self._pairs:
                result.clear()
                ask(a, origin, b, T, request, result)

        return run

    def answers(self, question: str, tolerance: float | None = None) -> np.ndarray:
        ask, request, result, origin = *self._asked(question, tolerance), self._origin
        answers = []
        for a, b, T in self._pairs:
            result.clear()  # a distance result that is not cleared keeps its answer
            answers.append(ask(a, origin, b, T, request, result))
        return np.array(answers, dtype=float)

    @staticmethod
    def _asked(question: str, tolerance: float | None) -> tuple:
        import coal

        if question == "boolean":
            request = coal.CollisionRequest()
            request.enable_contact = False
            return coal.collide, request, coal.CollisionResult()
        request = coal.DistanceRequest()
        request.enable_signed_distance = question == "signed"
        set_tolerance(request, tolerance)
        return coal.distance, request, coal.DistanceResult()


def set_tolerance(request, tolerance: float | None) -> None:
    """coal's GJK and EPA told to stop there; None leaves a request as it is."""
    if tolerance is not None:
        request.gjk_tolerance = request.epa_tolerance = tolerance
        request.gjk_max_iterations = request.epa_max_iterations = MAX_ITERATIONS


def _coal_hull(points: np.ndarray, faces: np.ndarray):
    import coal

    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points:
        corners.append(point)
    for face in faces.tolist():
        triangles.append(coal.Triangle(*face))
    return coal.Convex(corners, triangles)


class Fcl:
    """python-fcl in a child process: on some inputs it ends the interpreter, which costs one question of one cell."""

    name = "fcl"

    def __init__(self, solids: list, which: np.ndarray, X_WBs: np.ndarray):
        used = np.unique(which)
        hulls = {k: (solids[k].points, solids[k].faces) for k in used.tolist()}
        self._job = hulls, which, X_WBs
        self._dead: set[str] = set()
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, child_end = context.Pipe()
        self._process = context.Process(target=_fcl_child, args=(child_end,), daemon=True)
        self._process.start()
        child_end.close()  # or the death of the child would not close the pipe
        try:
            self._pipe.send(self._job)
        except OSError:
            pass  # dead already, which the next question will find

    def seconds(self, question: str) -> float:
        """Of one loop; NaN where python-fcl has crashed or hung on it."""
        return self._asked(question)[0]

    def answers(self, question: str) -> np.ndarray:
        """What one loop finds; NaN where python-fcl has crashed or hung on it."""
        return self._asked(question)[1]

    def _asked(self, question: str) -> tuple[float, np.ndarray]:
        nothing = math.nan, np.full(len(self._job[1]), math.nan)
        if question in self._dead:
            return nothing
        try:
            self._pipe.send(question)
            if self._pipe.poll(TIMEOUT):
                return self._pipe.recv()
        except (EOFError, OSError):
            pass
        self._dead.add(question)
        self.close()
        self._start()
        return nothing

    def close(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _fcl_child(pipe) -> None:
    """Times one loop for every question that comes down the pipe, and tells what it found."""
    import fcl

    hulls, which, X_WBs = pipe.recv()
    geometry = {
        k: fcl.Convex(points, len(faces), np.column_stack([np.full(len(faces), 3), faces]).ravel())
        for k, (points, faces) in hulls.items()
    }
    still = {k: fcl.CollisionObject(g, fcl.Transform()) for k, g in geometry.items()}
    pairs = [
        (still[a], fcl.CollisionObject(geometry[b], fcl.Transform(np.array(X[:3, :3]), np.array(X[:3, 3]))))
        for (a, b), X in zip(which.tolist(), X_WBs)
    ]
    while True:
        try:
            question = pipe.recv()
        except EOFError:
            return
        if question == "boolean":
            ask, request, result = fcl.collide, fcl.CollisionRequest(), fcl.CollisionResult
        else:
            signed = question == "signed"
            request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=signed)
            ask, result = fcl.distance, fcl.DistanceResult
        started = time.perf_counter()
        results = [ask(a, b, request, result()) for a, b in pairs]  # results accumulate, so each pair gets its own
        pipe.send((time.perf_counter() - started, np.array(results, dtype=float)))
