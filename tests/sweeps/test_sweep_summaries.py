"""What a sweep says of itself: counts, rows to look at, the least distance, and how often it looks at its scene."""

from __future__ import annotations

import json
import logging
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from slow_checker import SlowChecker

from collide import SceneError
from collide.sweeps import sweep as sweep_module
from collide.sweeps import sweep_tables
from collide.sweeps.configurations import GivenConfigurations
from collide.sweeps.sweep import SweepRun, sweep
from collide.sweeps.sweep_directory import SCHEMA, _is_manifest
from collide.sweeps.sweep_question import OneQuestion
from collide.sweeps.sweep_results import SweepResults, read_sweep

needs_pyarrow = pytest.mark.skipif(
    find_spec("pyarrow") is None, reason="pyarrow is not installed: pip install 'collide-robotics[sweep]'"
)
#: Of 1,200 rows 3 have no answer and 9 are outside; 10 of the 12 are named.
RESULTS = SweepResults(
    Path("s"), 1200, 1200, 1000, 197, 3, 9, [(k, f"note {k}") for k in range(10)], (0.25, 1100, "hand", "post")
)


def test_the_verdict_names_only_what_there_is():
    assert sweep_tables.summary(RESULTS) == [
        "1,200 rows: 1,000 in collision, 197 free, 3 without an answer, 9 outside the limits",
        "least distance 250 mm, row 1,100, hand and post",
    ]
    plain = replace(RESULTS, unanswered=0, outside=0, named=[], least=None, rows=1, colliding=0, free=1)
    assert sweep_tables.summary(plain) == ["1 row: 0 in collision, 1 free"]


@pytest.mark.parametrize(("unanswered", "outside", "named", "more"), [
    (3, 9, 10, 2), (10, 0, 10, 0), (0, 4, 4, 0), (1500, 10, 10, 1500),
])
def test_rows_to_look_at_and_how_many_more(unanswered, outside, named, more):
    results = replace(RESULTS, unanswered=unanswered, outside=outside, named=RESULTS.named[:named])
    (table,) = sweep_tables.tables(results)
    assert table.rows == [[str(k), f"note {k}"] for k in range(named)]
    assert table.notes == ([f"… and {more:,} more: rows whose note is not null"] if more else [])
    assert sweep_tables.tables(replace(RESULTS, named=[])) == []


def test_a_summary_as_plain_data():
    data = sweep_tables.to_dict(RESULTS)
    assert data == json.loads(json.dumps(data)) and data["named"][9] == {"row": 9, "note": "note 9"}
    assert data["least"] == {"distance": 0.25, "row": 1100, "a": "hand", "b": "post"}
    assert [data[key] for key in ("rows", "colliding", "free", "unanswered", "outside")] == [1200, 1000, 197, 3, 9]
    assert sweep_tables.to_dict(replace(RESULTS, least=None))["least"] is None


@needs_pyarrow
def test_ten_rows_are_named_whatever_the_chunks_those_without_an_answer_first(tmp_path):
    Q = np.zeros((40, 1))
    Q[[3, 5, 7, 21, 23, 30]] = np.nan
    Q[[1, 2, 4, 22, 31, 32, 33]] = 7.0
    named = [3, 5, 7, 21, 23, 30, 1, 2, 4, 22]
    for chunk in (1, 6, 40):
        results = sweep(SlowChecker(), Q, tmp_path / str(chunk), workers=0, chunk=chunk)
        assert [row for row, _ in results.named] == named and (results.unanswered, results.outside) == (6, 7)
        assert (results.rows, results.done, results.colliding, results.free) == (40, 40, 7, 27)
    Q[:15] = np.nan
    results = sweep(SlowChecker(), Q, tmp_path / "more", workers=0, chunk=4)
    assert [row for row, _ in results.named] == list(range(10))


@needs_pyarrow
def test_of_rows_that_are_as_near_the_first_is_the_least(tmp_path):
    Q = np.array([[np.nan], [0.0], [0.125], [0.125], [0.125], [-1.0], [0.125]])
    for chunk in (1, 2, 3, 7):
        results = sweep(SlowChecker(), Q, tmp_path / str(chunk), workers=0, distances=True, chunk=chunk)
        assert results.least == (0.125, 2, "slider", "post")
    nothing = sweep(SlowChecker(), Q[:1], tmp_path / "none", workers=0, distances=True)
    assert nothing.least is None and sweep_tables.summary(nothing)[1:] == []


@needs_pyarrow
def test_files_of_numbers_beyond_the_last_chunk_are_no_chunks(tmp_path, caplog):
    sweep(SlowChecker(), np.zeros((6, 1)), tmp_path / "s", workers=0, chunk=2)
    for name in ("chunk-00000003.parquet", "chunk-00000009.parquet", "chunk-1.parquet", "chunk-no.parquet"):
        (tmp_path / "s" / name).write_bytes(b"other")
    with caplog.at_level(logging.WARNING, "collide"):
        assert read_sweep(tmp_path / "s").done == 6
    assert not caplog.records
    (tmp_path / "s" / "chunk-00000002.parquet").write_bytes(b"torn")
    with caplog.at_level(logging.WARNING, "collide"):
        assert read_sweep(tmp_path / "s").done == 4
    assert "chunk-00000002.parquet" in caplog.text


@pytest.mark.parametrize("counts", [(0, 3, 0), (3, 0, 0), (0, 0, 0), (-3, -3, 1), (2**62, 1, 2**62)])
def test_a_manifest_counts_at_least_one_of_each(counts):
    manifest = {"schema": SCHEMA, "columns": {"distances": False, "values": True}}
    assert _is_manifest({**manifest, "rows": 1, "chunk": 1, "chunks": 1})
    assert not _is_manifest({**manifest, **dict(zip(("rows", "chunk", "chunks"), counts))})


@needs_pyarrow
@pytest.mark.parametrize(("step", "looks"), [(0.25, 2), (0.5, 3), (2.0, 10)])
def test_the_scene_is_looked_at_when_a_second_has_passed(tmp_path, monkeypatch, step, looks):
    """While ten chunks each take a step of the clock, and at the begin and at the end."""
    now, asked = [0.0], []

    class Stepping(SlowChecker):
        def collides(self, Q):
            now[0] += step
            return super().collides(Q)

    monkeypatch.setattr(sweep_module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    Q = GivenConfigurations(np.zeros((10, 1)))
    run = SweepRun(OneQuestion(Stepping()), 1, Q, tmp_path / "s", lambda final: asked.append(final) or "d", chunk=1)
    assert run.go(workers=0).done == 10
    assert asked[0] is False and asked[-1] is True and asked.count(True) == 1
    assert len(asked) == 2 + looks


@needs_pyarrow
def test_a_scene_that_changes_is_told_at_the_next_look(tmp_path, monkeypatch):
    now, digests = [0.0], iter(["a", "a", "b"])
    monkeypatch.setattr(sweep_module, "time", SimpleNamespace(monotonic=lambda: now.append(now[-1] + 0.75) or now[-1]))
    Q = GivenConfigurations(np.zeros((10, 1)))
    run = SweepRun(OneQuestion(SlowChecker()), 1, Q, tmp_path / "s", lambda final: next(digests), chunk=1)
    with pytest.raises(SceneError, match="changed while the sweep ran"):
        run.go(workers=0)
