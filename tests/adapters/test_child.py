"""An engine that crashes, hangs or talks too much costs the pair at hand and no more.

The engines here are made for it: what happens is written into the sphere's radius.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from collide import Box, ConvexHull, Halfspace, InvalidArgument, MissingExtra, Sphere, pose
from collide.adapters.peers import protocol
from collide.adapters.peers.child import IsolatedPeer
from collide.adapters.peers.protocol import Question, engine

SHARED = Path(__file__).resolve().parents[3] / "shared"

ENGINES = '''
import os, sys, time
from collide.adapters.peers.protocol import PairwisePeer, Reply
from collide.shapes import Box


class Fake(PairwisePeer):
    name = "fake"

    def build(self, part):
        if isinstance(part, Box) and part.size[0] == 13:
            os.abort()
        return part

    def ask(self, A, X_WA, B, X_WB):
        radius = getattr(B, "radius", 1.0)
        if radius == 2:
            print("about to abort", file=sys.stderr, flush=True)
            os.abort()
        if radius == 3:
            time.sleep(60)
        if radius == 4:
            raise RuntimeError("origin\\n  outside")
        if radius == 5:
            os.write(1, b"noise" * 1000)
        if radius == 6:
            os._exit(7)
        return Reply(True, -radius, normal=(1, 0, 0))


class Broken(Fake):
    name, module, package = "broken", "json.no_such_module", "nothing"


class Absent(Fake):
    name, module, package, hint = "absent", "no_such_module_at_all", "absent-package", "for a reason"


class LateImport(Fake):
    name, module = "late", "broken_engine_module"
'''


@pytest.fixture
def fakes(tmp_path, monkeypatch):
    (tmp_path / "fake_engines.py").write_text(ENGINES)
    (tmp_path / "broken_engine_module.py").write_text("raise OSError('libfake.so is missing')")
    monkeypatch.syspath_prepend(tmp_path)


def spheres(*radii) -> Question:
    return Question.from_pairs((Sphere(1), Sphere(r), pose(), pose()) for r in radii)


def outcome(table) -> str:
    return "".join("A" if r["answered"] else "F" if r["failed"] else "U" for r in table.rows)


def test_an_abort_loses_its_pair_only(fakes):
    table = IsolatedPeer("fake_engines:Fake").answer(spheres(1, 2, 1, 2, 2, 1))
    assert outcome(table) == "AFAFFA"
    assert table.reasons[1] == "process aborted (SIGABRT): about to abort"
    assert table.rows["distance"][[0, 2, 5]].tolist() == [-1, -1, -1]
    assert np.isnan(table.rows["distance"][1])


def test_a_hang_loses_its_pair_only(fakes):
    start = time.monotonic()
    table = IsolatedPeer("fake_engines:Fake", timeout=1.0).answer(spheres(1, 3, 1))
    assert outcome(table) == "AFA"
    assert table.reasons[1] == "no answer in 1 s"
    assert time.monotonic() - start < 30


def test_an_exception_needs_no_new_process(fakes):
    table = IsolatedPeer("fake_engines:Fake", max_restarts=0).answer(spheres(1, 4, 1, 4))
    assert outcome(table) == "AFAF"
    assert table.reasons[1] == "RuntimeError: origin outside"


def test_what_an_engine_prints_does_not_mix_with_its_answers(fakes):
    table = IsolatedPeer("fake_engines:Fake").answer(spheres(1, 5, 5, 1))
    assert outcome(table) == "AAAA"


def test_a_quiet_exit_is_told_with_its_code(fakes):
    table = IsolatedPeer("fake_engines:Fake").answer(spheres(6, 1))
    assert outcome(table) == "FA"
    assert table.reasons[0] == "process ended with code 7"


def test_a_body_that_cannot_be_built_costs_one_restart_not_one_per_pair(fakes):
    pairs = Question.from_pairs((Box((13, 1, 1)), Sphere(1), pose(), pose()) for _ in range(1))
    bodies = [*pairs.bodies, pairs.bodies[1]._replace(name="c"), pairs.bodies[1]._replace(name="d")]
    question = Question(bodies, [(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)], isolated=True)
    table = IsolatedPeer("fake_engines:Fake", max_restarts=1).answer(question)
    assert outcome(table) == "FFFAA"
    assert table.reasons[2].startswith("building 'a0': process aborted (SIGABRT)")


def test_restarts_are_bounded(fakes):
    table = IsolatedPeer("fake_engines:Fake", max_restarts=2).answer(spheres(2, 1, 2, 2, 2, 1))
    assert outcome(table) == "FAFFFF"
    assert table.reasons[5].startswith("given up after 2 restarts; the last: process aborted (SIGABRT)")


def test_an_engine_that_does_not_start_says_why(fakes):
    table = IsolatedPeer("fake_engines:LateImport").answer(spheres(1, 1))
    assert outcome(table) == "FF"
    assert "libfake.so is missing" in table.reasons[0]


def test_a_missing_package_is_an_error_with_the_extra(fakes, monkeypatch):
    monkeypatch.setitem(protocol.ENGINES, "absent", "fake_engines:Absent")
    for isolated in (False, True):
        peer = engine("absent", isolated=isolated)
        assert peer.missing() == "absent-package is not installed (for a reason)"
        with pytest.raises(MissingExtra, match=r"collide-robotics\[peers\]"):
            peer.answer(spheres(1))


def test_any_engine_may_be_isolated():
    question = spheres(1, 2, 3)
    alone, apart = engine("exact").answer(question), engine("exact", isolated=True).answer(question)
    assert apart.rows["distance"].tolist() == alone.rows["distance"].tolist() == [-2, -3, -4]
    assert apart.engine == "exact" and apart.version == alone.version


def test_a_real_crash_of_fcl_costs_one_pair(monkeypatch, tmp_path):
    pytest.importorskip("fcl", reason="python-fcl is not installed")
    (tmp_path / "careless.py").write_text(
        "import fcl\n"
        "from collide.adapters.peers.fcl_peer import FclPeer\n"
        "from collide.adapters.peers.protocol import Reply\n"
        "class Careless(FclPeer):\n"
        "    def ask(self, A, X_WA, B, X_WB):\n"
        "        a, b = fcl.CollisionObject(A), fcl.CollisionObject(B, fcl.Transform(X_WB[:3, 3]))\n"
        "        return Reply(True, fcl.distance(a, b, fcl.DistanceRequest(enable_signed_distance=True)))\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    ground = Halfspace((0, 0, 1), 0)
    # spheres apart: python-fcl never comes back from concentric ones
    pairs = [(A, Sphere(1), pose(), pose((0, 0, 3))) for A in (Sphere(1), ground, Sphere(1))]
    table = IsolatedPeer("careless:Careless").answer(Question.from_pairs(pairs))
    assert outcome(table) == "AFA"
    assert table.reasons[1].startswith("process aborted (SIG")


def test_inputs_that_abort_fcl_are_survived():
    pytest.importorskip("fcl", reason="python-fcl is not installed")
    file = SHARED / "data" / "cases" / "peer_failures.json"
    if not file.exists():
        pytest.skip("../shared/data/cases/peer_failures.json is absent")
    cases = [c for c in json.loads(file.read_text()) if "fcl" in c["cfg"] and c["peer"]["crash"] is not None][:4]

    def placed(R, t):
        return pose(t, R=R)

    crashing = [
        (ConvexHull(c["P"]), ConvexHull(c["Q"]), placed(c["R1"], c["t1"]), placed(c["R2"], c["t2"])) for c in cases
    ]
    harmless = (Sphere(1), Sphere(1), pose(), pose((3, 0, 0)))
    question = Question.from_pairs(item for pair in crashing for item in (pair, harmless))
    fcl, exact = engine("fcl").answer(question), engine("exact").answer(question)
    assert exact.rows["answered"].all()
    assert outcome(fcl)[1::2] == "AAAA"
    for k in np.flatnonzero(fcl.rows["failed"]):
        assert fcl.reasons[k].startswith("process aborted (SIGABRT): ")
    assert fcl.rows["failed"].any(), "this version of python-fcl no longer aborts: say so in its peer"


def test_unknown_engine_in_the_protocol():
    with pytest.raises(InvalidArgument):
        engine("fake_engines:Fake")
