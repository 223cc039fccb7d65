"""Engines as `benchmarks/accuracy.py` asks them the hard families: one answer a case, plain data.

collide is asked in this process, with its bracket, its path and its time. coal is asked through the peers' own
geometry, with default settings or a tolerance. python-fcl and pybullet answer in child processes, which a crash costs
one case.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

from convex_peers import set_tolerance

from collide.adapters.peers.coal_peer import CoalPeer
from collide.adapters.peers.protocol import Question, Reply, engine
from collide.results import FORMULA, UNDECIDED
from collide.scenes.families import Case

#: name → (engine of the peers' protocol, coal's tolerance).
ENGINES: dict[str, tuple[str, float | None]] = {
    "collide": ("collide", None), "coal": ("coal", None), "coal_t9": ("coal", 1e-9), "fcl": ("fcl", None),
    "pybullet": ("pybullet", None),
}  # fmt: skip
#: What can settle an answer of collide.
PATHS = ("doubles", "closed form", "exact", "undecided")
#: A distance that is no length.
_UNBOUNDED = 1e300
#: Calls of one question, whose fastest counts.
_CALLS = 5


class Answer(NamedTuple):
    """distance, lower, upper [m]; NaN where there is none.   normal : (3,), from A to B.   us : of one Python call.

    path : of `PATHS` (collide only).   failed : why there is no answer, or "".
    """

    distance: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    normal: tuple = (math.nan,) * 3
    certified: bool = False
    path: str = ""
    us: float = math.nan
    failed: str = ""


class ToleratedCoal(CoalPeer):
    """coal's distance alone, timed, with a tolerance."""

    def __init__(self, tolerance: float | None):
        self._tolerance = tolerance

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        import coal

        T_WA, T_WB = (coal.Transform3s(X[:3, :3], X[:3, 3]) for X in (X_WA, X_WB))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        set_tolerance(request, self._tolerance)
        taken = math.inf
        for _ in range(_CALLS):
            started = time.perf_counter()
            result.clear()
            distance = float(coal.distance(A, T_WA, B, T_WB, request, result))
            taken = min(taken, time.perf_counter() - started)
        points = tuple(result.getNearestPoint1()), tuple(result.getNearestPoint2())
        return Reply(distance <= 0.0, distance, tuple(result.normal), *points, note=repr(taken * 1e6))


def missing(name: str) -> str | None:
    """Why an engine cannot be asked here, or None."""
    return engine(ENGINES[name][0]).missing()


def ask(name: str, cases: list[Case]) -> list[Answer]:
    """Answers of one engine, in order."""
    if name == "collide":
        return [_ask_collide(case) for case in cases]
    kind, tolerance = ENGINES[name]
    peer = ToleratedCoal(tolerance) if kind == "coal" else engine(kind)
    table = peer.answer(Question.from_pairs([case.shapes() for case in cases]))
    return [_of_peer(row, reason, kind) for row, reason in zip(table.rows, table.reasons)]


def _of_peer(row, reason: str, kind: str) -> Answer:
    if not row["answered"]:
        return Answer(failed=reason or "no answer")
    distance = float(row["distance"])
    if not abs(distance) < _UNBOUNDED:
        return Answer(failed=f"no length: {distance}")
    return Answer(distance, normal=tuple(row["normal"].tolist()), us=float(reason) if kind == "coal" else math.nan)


def _ask_collide(case: Case) -> Answer:
    from collide import distance

    question = case.shapes()
    taken = math.inf
    for _ in range(_CALLS + 1):
        started = time.perf_counter()
        row = distance(*question).rows[0]
        taken = min(taken, time.perf_counter() - started)
    path = "undecided" if row["how"] == UNDECIDED else "exact" if row["exact"] else "doubles"
    if row["how"] == FORMULA and path == "doubles":
        path = "closed form"
    return Answer(
        float(row["distance"]), float(row["lower"]), float(row["upper"]), tuple(row["normal"].tolist()),
        bool(row["certified"]), path, taken * 1e6,
    )  # fmt: skip
