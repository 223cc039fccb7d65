"""Answers of their own kind: exceptions, aborts, hangs, NaN and lengths that are none are counted by kind.

The engine is made for it: what happens is the sphere's radius.
"""

from __future__ import annotations

import math

import pytest

from collide import Sphere, pose
from collide.adapters.peers import protocol, stress
from collide.adapters.peers.answers import ABORTED, HUNG, MISHAPS, NO_LENGTH, NOT_A_NUMBER, RAISED, Reply, nearest
from collide.adapters.peers.compare import compare
from collide.adapters.peers.protocol import Question, engine
from collide.adapters.peers.stress import run

ENGINE = '''
import math, os, time
from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer, Setting
from collide.shapes import Sphere


class Wild(PairwisePeer):
    name, isolated, about = "wild", True, "whatever happens"
    receives, cannot = ("radii in metres",), ("anything reliable",)
    settings = {"calm": Setting("never hangs", {"calm": True}, receives=("radii, calmly",))}

    def build(self, part):
        return part

    def ask(self, A, X_WA, B, X_WB):
        radius = B.radius if isinstance(B, Sphere) else len(B.points) if hasattr(B, "points") else 1
        if radius == 2:
            raise ValueError("no")
        if radius == 3:
            os.abort()
        if radius == 4 and not self.values.get("calm"):
            time.sleep(60)
        distance = {5: math.nan, 6: -1.7976931348623157e308, 7: math.inf, 8: None}.get(radius, -1.0)
        return Reply(True, distance)


class Silent(Wild):
    name = "silent"

    def ask(self, A, X_WA, B, X_WB):
        return Reply(True, math.nan)
'''
EXPECTED = {1: "", 2: RAISED, 3: ABORTED, 4: HUNG, 5: NOT_A_NUMBER, 6: NO_LENGTH, 7: NO_LENGTH, 8: ""}


@pytest.fixture
def wild(tmp_path, monkeypatch):
    (tmp_path / "wild_engines.py").write_text(ENGINE)
    monkeypatch.syspath_prepend(tmp_path)
    for name, spec in (("wild", "Wild"), ("wild:calm", "Wild:calm"), ("silent", "Silent")):
        monkeypatch.setitem(protocol.ENGINES, name, f"wild_engines:{spec}")


def pairs():
    return [(Sphere(1), Sphere(float(radius)), pose(), pose()) for radius in EXPECTED]


def test_each_kind_stands_in_its_row(wild):
    table = engine("wild", timeout=1.0).answer(Question.from_pairs(pairs()))
    assert table.mishaps == list(EXPECTED.values())
    assert set(table.mishaps) == {"", *MISHAPS}
    failed = [kind in (RAISED, ABORTED, HUNG) for kind in table.mishaps]
    assert table.rows["failed"].tolist() == failed and (table.rows["answered"] != table.rows["failed"]).all()
    assert table.rows["has_distance"].tolist() == [True, *[False] * 7]
    assert table.reasons[3] == "no answer in 1 s" and table.reasons[5] == "the distance -1.79769e+308 is no length"


def test_a_comparison_counts_them_and_says_what_the_engine_received(wild):
    comparison = compare(pairs(), ("wild", "wild:calm"), timeout=1.0)
    counts = {RAISED: 1, ABORTED: 1, HUNG: 1, NOT_A_NUMBER: 1, NO_LENGTH: 2}
    rough, calm = comparison.summary("wild"), comparison.summary("wild:calm")
    assert rough.mishaps == counts and calm.mishaps == {kind: n for kind, n in counts.items() if kind != HUNG}
    assert sorted(lost["mishap"] for lost in rough.failed) == sorted([RAISED, ABORTED, HUNG])
    assert (rough.receives, calm.receives, rough.cannot) == (["radii in metres"], ["radii, calmly"], calm.cannot)
    headers, rows = comparison.table()
    assert rows[1][headers.index("mishaps")] == "1 exception, 1 abort, 1 hang, 1 NaN, 2 no length"
    assert rows[0][headers.index("mishaps")] == "0" and comparison.summaries[0].mishaps == {}
    told = comparison.to_dict()["summaries"][1]
    assert told["mishaps"] == counts and told["about"] == "whatever happens"


def test_the_hard_families_count_them_too(wild):
    table = run(["rand_pen"], n=6, seed=1, engine="silent")
    assert table.families[0].mishaps == {NOT_A_NUMBER: 6} == table.total().mishaps
    headers, rows = table.table()
    assert rows[0][headers.index("mishaps")] == "6 NaN"
    assert run(["rand_pen"], n=2, seed=1).families[0].mishaps == {}


def test_the_hard_families_start_an_engine_once(wild, monkeypatch):
    """Not once a family, for most engines take longer to start than to answer; it has ended afterwards."""
    peer = engine("silent")
    monkeypatch.setattr(stress, "engine", lambda name, *, timeout: peer)
    run(["rand_pen", "rand_sep", "near_pen"], n=2, seed=1, engine="silent")
    assert peer.starts == 1 and peer._child is None
    peer.answer(Question.from_pairs(pairs()[:1]))
    assert peer.starts == 2 and peer._child is None  # a question by itself has a child of its own


def test_a_union_passes_on_what_its_parts_do_not_give():
    none, number, nan = Reply(False), Reply(True, -1.0), Reply(False, math.nan)
    assert nearest([number, Reply(False, 2.0)]) == number
    assert nearest([number, none]) == Reply(True)
    merged = nearest([number, nan])
    assert merged.hit and merged.distance is not None and math.isnan(merged.distance)


def test_the_commands_list_engines_with_what_they_receive(wild, capsys):
    from collide.cli.engines import engines, listing, one_engine

    for ask in (engines, one_engine):
        with pytest.raises(SystemExit) as end:
            ask("help")
        assert end.value.code == 0
        text = capsys.readouterr().out
        assert "wild:calm" in text and "receives: radii, calmly" in text and "cannot answer: anything reliable" in text
    assert {"wild", "silent"} <= set(engines("all")) and "collide" not in engines("all")
    assert engines("fcl, coal") == ["fcl", "coal"] and one_engine("coal:tight") == "coal:tight"
    assert max(map(len, listing())) <= 110
