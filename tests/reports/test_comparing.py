"""How a comparison of engines reads: a column per engine, every dispute with its verdict."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from collide.reports import comparing

HEADERS = ["engine", "version", "answered", "agree", "differ", "wrong"]
ROWS = [["collide", "0.1.0", "30 of 30", "", "", "0"], ["coal", "3.0", "30 of 30", "28", "2", "1"],
        ["pybullet", "skipped: absent", "", "", "", ""]]


def dispute(kind="hit", **changes):
    return {
        "engine": "coal",
        "kind": kind,
        "a": "table",
        "b": "panda_hand",
        "size": 1.0,
        "reference_hit": False,
        "reference_distance": 2e-5,
        "hit": True,
        "distance": -1e-9,
        "exact_hit": False,
        "exact_distance": 2e-5,
        "touching": False,
        "not_judged": "",
        "judged_by": "exact arithmetic",
        "off": None,
        "wrong": ["coal"],
        "proven": ["collide"],
        "note": "",
        **changes,
    }


def summary(engine, **changes):
    return {
        "engine": engine, "skipped": "absent" if engine == "pybullet" else "", "wrong": 0, "wrong_distances": 0,
        "contradictions": 0, "failed": [], "unsupported": {}, "furthest_off": {"difference": 0.0}, **changes,
    }


def comparison(disputes=(), ours_wrong=0):
    data = {
        "reference": "collide", "bodies": 9, "pairs": 30, "max_distance": 0.05, "tolerance": 1e-6,
        "summaries": [summary(row[0]) for row in ROWS],
        "disagreements": list(disputes), "ours_wrong": ours_wrong,
    }
    return SimpleNamespace(to_dict=lambda: data, table=lambda: (HEADERS, ROWS), ours_wrong=ours_wrong)


def text_of(lines):
    return ["".join(text for text, _ in line) for line in lines]


def test_the_verdict_comes_first_and_each_engine_has_a_column():
    lines = text_of(comparing.render(comparison(), width=100))
    assert lines[0] == "no answer of collide proven wrong; 30 pairs asked of collide, coal; no disagreement"
    heading = next(line for line in lines if "engine" in line.split())
    assert heading.split() == ["engine", "collide", "coal"]
    assert any(line.split() == ["agree", "-", "28"] for line in lines)
    assert "  pybullet was not asked: absent" in lines


def test_every_dispute_carries_its_verdict():
    disputes = [dispute(), dispute(not_judged="cylinders", wrong=[], exact_hit=None, exact_distance=None),
                dispute("distance", distance=0.3)]
    lines = text_of(comparing.render(comparison(disputes, 1), width=120))
    assert lines[0].startswith("1 answer of collide proven wrong; ") and "1 disagreement not judged" in lines[0]
    assert "  not judged: cylinders" in lines
    row = next(line for line in lines if "panda_hand" in line and "not judged" not in line)
    assert "20.000 µm" in row and "-1.00e-09 m" in row and row.endswith("coal")


def test_what_a_peer_got_wrong_is_in_the_first_line_with_the_amount():
    asked = comparison()
    asked.to_dict()["summaries"][1].update(wrong=1, wrong_distances=18, furthest_off={"difference": 0.912195})
    line = " ".join(text_of(comparing.render(asked, width=200))[:1])
    assert "coal: 1 wrong boolean, 18 wrong distances (912.195 mm off at worst)" in line


def test_what_an_engine_was_not_asked_about_is_told_with_its_reasons():
    asked = comparison()
    asked.to_dict()["summaries"][1]["unsupported"] = {"no cone": 2, "no cloud": 7, "no plane": 1, "odd": 1, "odder": 1}
    lines = text_of(comparing.render(asked, width=200))
    told = "no cloud (7); no cone (2); no plane (1); 2 other reasons, in the JSON"
    assert f"  coal was not asked about 12 pairs: {told}" in lines


def test_wrong_distances_come_worst_first_and_say_who_judged():
    disputes = [
        dispute("distance", distance=0.3, off=0.1),
        dispute("distance", a="shelf", distance=-0.9, off=0.9, judged_by="the proven bracket"),
    ]
    lines = text_of(comparing.render(comparison(disputes), width=120))
    shelf, table = (next(k for k, line in enumerate(lines) if name in line.split()) for name in ("shelf", "table"))
    assert shelf < table and "900.000 mm" in lines[shelf] and lines[shelf].endswith("coal (by bracket)")
    assert any(line.startswith("  by bracket: ") for line in lines)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_no_line_is_wider_than_the_terminal(width):
    disputes = [dispute(), dispute("left out", hit=None, distance=None)]
    lines = text_of(comparing.render(comparison(disputes), width=width))
    assert max(map(len, lines)) <= width, max(lines, key=len)


def test_many_engines_stand_in_several_tables():
    names = [f"engine{k}:setting" for k in range(9)]
    rows = [["collide", "0.1.0", "30 of 30", "", "", "0"]]
    rows += [[name, "1.0", "30 of 30", "28", "2", "1"] for name in names]
    data = comparison().to_dict() | {"summaries": [summary(row[0]) for row in rows]}
    asked = SimpleNamespace(to_dict=lambda: data, table=lambda: (HEADERS, rows), ours_wrong=0)
    lines = text_of(comparing.render(asked, width=80))
    assert max(map(len, lines)) <= 80, max(lines, key=len)
    assert sum(line.startswith("ENGINES") for line in lines) >= 3
    heads = [word for line in lines if line.startswith("  engine  ") for word in line.split()[1:]]
    assert heads == ["collide", *names], "each once, in the order asked"
