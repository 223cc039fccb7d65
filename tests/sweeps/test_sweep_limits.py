"""Limits of sweeps that are met exactly: rows and chunks, what is under way, what is kept, clocks that stand still."""

from __future__ import annotations

import queue
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
from plain_robots import joint, robot_of
from slow_checker import SlowChecker

from collide import Box, InvalidArgument, RobotChecker, Sphere
from collide.sweeps import content_digest
from collide.sweeps import sweep as sweep_module
from collide.sweeps.configurations import GivenConfigurations, read_configurations
from collide.sweeps.process_pool import ProcessPool
from collide.sweeps.sweep import SweepRun, _Pace, sweep
from collide.sweeps.sweep_question import OneQuestion, answer_rows
from collide.sweeps.sweep_results import read_sweep

needs_pyarrow = pytest.mark.skipif(
    find_spec("pyarrow") is None, reason="pyarrow is not installed: pip install 'collide-robotics[sweep]'"
)


def test_a_chunk_of_as_many_rows_as_memory_holds(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_module, "MAX_CHUNK_ROWS", 5)
    run = lambda chunk: SweepRun(OneQuestion(SlowChecker()), 1, GivenConfigurations(np.zeros((9, 1))), tmp_path,
                                 lambda final: "", chunk=chunk)
    assert run(5).manifest["chunks"] == 2
    with pytest.raises(InvalidArgument, match="chunk must be at most 5 rows, which are in memory, got 6"):
        run(6)


def test_a_speed_is_said_once_time_has_passed(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(sweep_module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    pace = _Pace(1000, 800)
    assert pace.after(100) == "sweeping: 300 of 1,000 rows"
    now[0] += 2.0
    assert str(pace) == "sweeping: 300 of 1,000 rows, 50/s, 14 s to go"
    assert pace.after(700) == "sweeping: 1,000 of 1,000 rows, 400/s, 0 s to go"


@pytest.mark.parametrize("workers", [1, 3])
def test_two_chunks_a_process_are_under_way(workers):
    taken = []
    pool = SimpleNamespace(n_workers=workers, _chunks=queue.SimpleQueue())
    pool._next = lambda: (pool._chunks.get(), len(taken))
    answers = list(ProcessPool.answers(pool, (taken.append(k) or k for k in range(10))))
    assert [chunk for chunk, _ in answers] == list(range(10))
    assert [n for _, n in answers] == [min(2 * workers + k, 10) for k in range(10)]


def test_as_many_shapes_as_there_may_be_are_kept(monkeypatch):
    monkeypatch.setattr(content_digest, "_SHAPES", {})
    monkeypatch.setattr(content_digest, "_MAX_SHAPES", 3)
    shapes = [Sphere(0.1 * k) for k in (1, 2, 3, 4)]
    digests, sizes = [], []
    for shape in shapes:
        digests.append(content_digest.digest(shape))
        sizes.append(len(content_digest._SHAPES))
    assert sizes == [1, 2, 3, 1] and digests == [content_digest.digest(shape) for shape in shapes]
    assert len(set(digests)) == 4 and content_digest.digest(Sphere(0.1)) == digests[0]


@needs_pyarrow
def test_a_chunk_that_is_a_link_or_a_folder_counts_as_missing(tmp_path):
    folder = tmp_path / "s"
    sweep(SlowChecker(), np.zeros((6, 1)), folder, workers=0, chunk=2)
    first, second = (folder / f"chunk-0000000{k}.parquet" for k in (0, 1))
    first.rename(tmp_path / "elsewhere.parquet")
    first.symlink_to(tmp_path / "elsewhere.parquet")
    second.unlink()
    second.mkdir()
    assert read_sweep(folder).done == 2


@pytest.mark.parametrize(("text", "rows"), [
    ("slide\n0.5\n\n0.25\n", [[0.5], [np.nan], [0.25]]), ("slide\n", []), ("slide\n \n", [[np.nan]]),
])
def test_an_empty_line_is_a_row_of_a_single_column(tmp_path, text, rows):
    file = tmp_path / "q.csv"
    file.write_text(text)
    read = read_configurations(file, SlowChecker().robot).Q
    assert np.array_equal(read, np.array(rows).reshape(-1, 1), equal_nan=True)


def test_robots_without_joints_are_answered():
    robot = robot_of(["base", "far"], [joint("weld", "fixed", "base", "far", at=(1, 0, 0))],
                     {link: (Box((0.1, 0.1, 0.1)), (0, 0, 0)) for link in ("base", "far")})
    columns = answer_rows(RobotChecker(robot), np.zeros((3, 0)), True, True)
    assert columns["collides"][0].tolist() == [False] * 3 and columns["collides"][1].all()
    assert columns["note"] == [None] * 3


@pytest.mark.parametrize("value", [0.9e6, 1e6, 1.1e6])
def test_rows_of_far_values_are_answered_where_poses_are_within_the_range(value):
    columns = answer_rows(SlowChecker(), np.array([[0.0], [value], [1e300], [-value]]), False, False)
    assert columns["collides"][1].tolist() == [True, True, False, True]
    assert [note is None for note in columns["note"]] == [True, False, False, False]
    assert "finite and within" in columns["note"][2] and "outside [-1, 1]" in columns["note"][1]
