"""Texts of reports at their ends: JSON in chunks, a page's lines, what a doctor says, shares of a comparison."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from collide.reports import json_text, terminal
from collide.reports.checking import COLLISION, DEEPER, GONE, KNOWN, Check, Finding
from collide.reports.comparing import _engine_tables, _wrong_of
from collide.reports.comparing import verdict as comparison_verdict
from collide.reports.doctor import _ask, _cache, _known_pairs
from collide.reports.pair_classes import Pairs
from collide.reports.report import _skipped
from collide.reports.tables import Column, Table, lay_out
from collide.reports.terminal import _prose, _scene_line
from collide.results import PAIR_DTYPE


def pairs_of(n: int) -> Pairs:
    rows = np.zeros(n, dtype=PAIR_DTYPE)
    rows["b"], rows["distance"] = 1, np.arange(n)
    return Pairs(rows, np.arange(n), {0: "a", 1: "b"}, frozenset())


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4, 6, 7])
def test_json_of_pairs_is_whole_whatever_the_chunks(monkeypatch, n):
    """None, part of a chunk, whole chunks and one more; a line each, handed out a chunk at a time."""
    monkeypatch.setattr(json_text, "_CHUNK", 3)
    texts = list(json_text.pieces([("x", 1), ("pairs", pairs_of(n)), ("y", {"z": ["é", None]})]))
    read = json.loads("".join(texts))
    assert [pair["distance"] for pair in read["pairs"]] == list(range(n)) and read["y"] == {"z": ["é", None]}
    assert max(text.count('"distance"') for text in texts) == min(n, 3)
    assert "".join(texts).count("\n    {") == n and ("pairs\": []" in "".join(texts)) == (n == 0)


@pytest.mark.parametrize(("robots", "end"), [((), ""), (("arm",), ", robot arm"), (("a", "b"), ", robots a, b")])
@pytest.mark.parametrize(("bodies", "words"), [(1, "1 body"), (2, "2 bodies")])
def test_the_line_about_the_scene(robots, end, bodies, words):
    scene = {"name": "cell", "bodies": bodies, "static": 1, "robots": robots}
    assert _scene_line(SimpleNamespace(scene=scene)) == f"cell: {words} (1 fixed){end}"


def test_prose_has_a_title_where_there_is_any():
    assert _prose("NOTES", [], 60) == []
    assert _prose("NOTES", ["one", "two"], 60) == [[], [("NOTES", "title")], [("  one", "text")], [("  two", "text")]]


def test_reasons_of_pairs_never_tested_most_first_then_by_name():
    skipped = _skipped({"skipped": {"b": 2, "a": 2, "none": 0, "c": 5}})
    assert [(entry["reason"], entry["pairs"]) for entry in skipped] == [("c", 5), ("a", 2), ("b", 2)]


def test_columns_are_given_up_where_they_do_not_fit_and_not_where_they_just_do():
    table = Table("T", [Column("name", "label"), Column("more", "label", 1)], [["x" * 10, "y" * 10]])
    # two cells before the first column, two between both
    assert lay_out(table, 24).widths == [10, 10] and lay_out(table, 23).dropped == ["more"]
    assert lay_out(table, 24).dropped == [] and lay_out(table, 25).widths == [10, 10]


@pytest.mark.parametrize(("known", "deeper", "gone", "new", "words"), [
    (0, 0, 0, 0, "no new collision"), (0, 0, 0, 1, "1 new collision"),
    (2, 0, 1, 2, "2 new collisions, 2 known, 1 gone"),
    (0, 1, 0, 2, "2 new collisions, 1 known and deeper than before; a and b: 2 mm deep, was 1 mm"),
    (1, 2, 0, 0, "no new collision, 2 known and deeper than before, 1 known; a and b: 2 mm deep, was 1 mm"),
])
def test_a_check_against_a_baseline_counts_what_is_new(known, deeper, gone, new, words):
    made = {what: [Finding(what, "a", "b", -0.002, before=0.001) for _ in range(n)]
            for what, n in ((KNOWN, known), (DEEPER, deeper), (GONE, gone), (COLLISION, new))}
    findings = [finding for some in made.values() for finding in some]
    check = Check("", "cell", ["a", "b"], "summary", findings, [*made[DEEPER], *made[COLLISION]], against_baseline=True)
    assert check.verdict() == f"{words} (summary)" and check.fails == bool(deeper + new)
    told = Check("up", "cell", [], "summary", [Finding(COLLISION, "a", "b", None), *made[KNOWN]])
    assert told.verdict() == "up: summary" and told.findings[0].depth == np.inf
    assert next(told.lines(True)).split("\t")[1:] == ["a", "b", "unbounded", "up"]
    assert next(told.lines(False)).split("\t")[1:] == ["a", "b", "unbounded"]


# --- doctor ---------------------------------------------------------------------------------------


def test_known_pairs_have_the_distances_that_are_told():
    """Also that of a hull whose nearest corner is told; brackets are as narrow as is said."""
    for what, A, B, x, truth in _known_pairs():
        check = _ask(what, A, B, x, truth)
        assert check.passed and check.what == what and check.answer.startswith(f"{truth:.12g} m, known to "), check
        width = float(check.answer.split("known to ")[1].split()[0].replace("exact", "0"))
        assert width <= 1e-9, check
        wrong = _ask(what, A, B, x, truth + 0.125)
        assert wrong.passed is False and wrong.answer.endswith(f"should hold {truth + 0.125!r}")


def test_caches_that_are_there_and_that_are_not_yet(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "one").write_bytes(b"x" * 1_500_000)
    assert _cache("kernels", tmp_path).answer == f"{tmp_path} (1 file, 1.5 MB)"
    missing = tmp_path / "not" / "yet"
    assert _cache("kernels", missing).answer == f"{missing} (0 files, 0.0 MB)" and not missing.exists()
    (tmp_path / "file").write_text("")
    assert _cache("kernels", tmp_path / "file" / "below").passed is None


# --- comparing ------------------------------------------------------------------------------------


def summary(engine: str, **values) -> dict:
    counts = {"skipped": None, "wrong": 0, "wrong_distances": 0, "contradictions": 0, "failed": [], "unsupported": {}}
    return {"engine": engine, **counts, **values}


def test_engines_that_do_not_fit_stand_below_and_those_not_asked_are_told_once():
    data = {"summaries": [summary("one"), summary("two"), summary("gone", skipped="it is not installed")]}
    rows = [["one", "11111"], ["two", ""], ["three", "3"], ["gone", "0"]]
    for width, n in ((80, 1), (24, 2)):
        tables = _engine_tables(data, ["engine", "pairs"], rows, width)
        assert len(tables) >= n and [t.notes for t in tables[:-1]] == [[]] * (len(tables) - 1)
        assert tables[-1].notes == ["gone was not asked: it is not installed"]
        assert [c.title for t in tables for c in t.columns[1:]] == ["one", "two", "three"]
        assert [cell for t in tables for cell in t.rows[0][1:]] == ["11111", "-", "3"]


def test_a_comparison_in_one_line():
    data = {"summaries": [summary("ours"), summary("peer", wrong=2, failed=["x"])], "reference": "ours", "pairs": 1,
            "ours_wrong": 0, "disagreements": []}
    assert comparison_verdict(data) == (
        "no answer of ours proven wrong; 1 pair asked of ours, peer; peer: 2 wrong booleans, 1 failure; no disagreement"
    )
    inside, open_ = {"kind": "inside", "not_judged": ""}, {"kind": "hit", "not_judged": "why"}
    for disputes, end in (([open_], "; 1 disagreement not judged"), ([inside, open_], (
            "; 1 disagreement not judged; 1 answer about insides of solids, which others do not see")),
            ([inside] * 2, "; no disagreement; 2 answers about insides of solids, which others do not see"),
    ):
        assert comparison_verdict({**data, "disagreements": disputes}).endswith(f"1 failure{end}")
    assert _wrong_of(summary("peer")) == ""


def test_lines_are_as_wide_as_the_terminal_or_columns_says(monkeypatch):
    """A terminal has its width, COLUMNS counts for any stream, and a pipe gets a page and whole names."""
    pipe, window = SimpleNamespace(isatty=lambda: False), SimpleNamespace(isatty=lambda: True)
    monkeypatch.setenv("COLUMNS", "97")
    assert terminal.output_width(pipe) == (97, False) == terminal.output_width(window)
    monkeypatch.setenv("COLUMNS", "7")
    assert terminal.output_width(pipe) == (30, False)
    monkeypatch.delenv("COLUMNS")
    assert terminal.output_width(pipe) == (terminal.PIPE_WIDTH, True) and not terminal.output_width(window)[1]


def test_stages_of_a_report_come_in_the_order_they_run_and_others_after_them():
    spent = {"pack": 0.5, "own stage": 0.25, "read": 0.125, "other": 1.0, "total": 1.875, "meshes": 0.0}
    report = SimpleNamespace(seconds=spent, versions={"machine": "box", "collide": "1.0", "numba": None})
    first, second = terminal._times(report)
    assert first == "1.88 s in all: read 125 ms, pack 500 ms, own stage 250 ms, imports and the rest 1.00 s"
    assert second == "collide 1.0, box"
