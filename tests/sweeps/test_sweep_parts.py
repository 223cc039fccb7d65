"""What a sweep is made of, asked alone and without Parquet: chunks, questions, configurations, folders, processes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from plain_robots import joint, robot_of
from slow_checker import SlowChecker

from collide import InvalidArgument, SceneError, Sphere
from collide.sweeps import configurations, pair_tables, sweep, sweep_question
from collide.sweeps.configurations import (
    DrawnConfigurations,
    GivenConfigurations,
    as_configurations,
    read_configurations,
)
from collide.sweeps.pair_proposal import ADJACENT, ALWAYS, DEFAULT, NEVER
from collide.sweeps.process_pool import ProcessPool
from collide.sweeps.sweep import MAX_CHUNKS, SweepRun, _duration, _Pace
from collide.sweeps.sweep_directory import MANIFEST, SCHEMA, SweepDirectory, _is_manifest, _number_of
from collide.sweeps.sweep_question import Chunk, OneQuestion, ScenesQuestion, answer_rows


def arm():
    """Two joints, x and y."""
    joints = [joint("x", "prismatic", "base", "a", lower=-1.0, upper=1.0),
              joint("y", "prismatic", "a", "b", axis=(0, 1, 0), lower=0.0, upper=2.0)]
    return robot_of(["base", "a", "b"], joints, {"b": (Sphere(0.1), (0, 0, 0))})


def run_of(tmp_path, n_scenes: int, rows: int | None, chunk: int | None, question=None) -> SweepRun:
    Q = None if rows is None else GivenConfigurations(np.linspace(-1.0, 1.0, rows)[:, None])
    question = question or OneQuestion(SlowChecker())
    return SweepRun(question, n_scenes, Q, tmp_path / "s", lambda final: "digest", chunk=chunk)


# --- chunks ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n_scenes", "rows", "chunk"), [
    (1, 1, 1), (1, 10, 3), (1, 9, 3), (3, 5, 4), (3, 5, 5), (3, 5, 7), (4, 1, 3), (2, 5, 100),
])
def test_chunks_are_all_rows_once_scene_after_scene(tmp_path, n_scenes, rows, chunk):
    run = run_of(tmp_path, n_scenes, rows, chunk)
    chunks = [run._chunk_of(number) for number in range(run.manifest["chunks"])]
    assert run.rows == run.manifest["rows"] == n_scenes * rows and run.manifest["chunk"] == chunk
    told = []
    for number, one in enumerate(chunks):
        assert (one.number, one.start) == (number, chunk * number) and one.stop == min(one.start + chunk, run.rows)
        asked = [(scene, value) for scene, block in one.blocks for value in block.of(run.question.robot)[:, 0].tolist()]
        assert len(asked) == one.stop - one.start == run._rows_of([number])
        told += asked
    values = np.linspace(-1.0, 1.0, rows).tolist()
    assert told == [(scene, value) for scene in range(n_scenes) for value in values]
    assert run._rows_of(list(range(len(chunks)))) == run.rows


def test_scenes_with_a_configuration_of_their_own_have_a_row_each(tmp_path):
    run = run_of(tmp_path, 5, None, 2)
    assert run.rows == 5 and [run._chunk_of(k).blocks for k in range(3)] == [
        [(0, None), (1, None)], [(2, None), (3, None)], [(4, None)],
    ]
    assert run.manifest["configurations"] is None
    assert str(run._chunk_of(1)) == "chunk 1, rows 2 to 3"


@pytest.mark.parametrize(("rows", "chunk", "words"), [
    (0, None, "there are no configurations to ask about"), (5, 0, "chunk"), (5, 1.5, "chunk"),
    (5, 10**9, "chunk must be at most .* rows, which are in memory, got 1000000000"),
])
def test_chunks_that_are_none_are_refused(tmp_path, rows, chunk, words):
    with pytest.raises(InvalidArgument, match=words):
        run_of(tmp_path, 1, rows, chunk)


def test_as_many_chunks_as_can_be_listed_may_be_asked(tmp_path):
    question = OneQuestion(SlowChecker())
    most = SweepRun(question, 1, DrawnConfigurations(MAX_CHUNKS), tmp_path, lambda final: "", chunk=1)
    assert most.manifest["chunks"] == MAX_CHUNKS
    with pytest.raises(InvalidArgument, match=r"rows are more than .* chunks of 1: ask fewer, or take larger"):
        SweepRun(question, 1, DrawnConfigurations(MAX_CHUNKS + 1), tmp_path, lambda final: "", chunk=1)


def test_how_far_and_how_long():
    assert str(_Pace(1200, 1000)) == "sweeping: 200 of 1,200 rows"
    pace = _Pace(1200, 1000)
    pace._started -= 9.5
    assert re.fullmatch(r"sweeping: 700 of 1,200 rows, 5\d/s, 10 s to go", pace.after(500))
    for seconds, words in ((0.0, "0 s"), (99.0, "99 s"), (99.5, "1 min"), (5999.0, "99 min"), (5999.5, "1 h 40 min"),
                           (7260.0, "2 h 1 min")):
        assert _duration(seconds) == words


# --- questions ------------------------------------------------------------------------------------


def test_answers_of_a_chunk():
    Q = GivenConfigurations(np.array([[0.0], [0.25], [np.nan], [2.0], [-1.0 - 5e-10]]))
    columns = OneQuestion(SlowChecker(), True, True).answer(Chunk(3, 40, 45, [(0, Q.block(0, 5))]))
    assert list(columns) == ["row", "collides", "distance", "body_a", "body_b", "note", "slide"]
    assert columns["row"].tolist() == [40, 41, 42, 43, 44]
    collides, answered = columns["collides"]
    assert answered.tolist() == [True, True, False, True, True]
    assert collides.tolist() == [False, True, False, True, False]
    assert columns["distance"][[0, 1, 3]].tolist() == [0.25, 0.0, -1.75] and np.isnan(columns["distance"][2])
    assert columns["body_a"] == ["slider", "slider", None, "slider", "slider"] and columns["body_b"][2] is None
    assert columns["note"] == [None, None, "slide is nan", "slide 2 outside [-1, 1]", None]
    plain = OneQuestion(SlowChecker()).answer(Chunk(0, 0, 2, [(0, Q.block(1, 3))]))
    assert list(plain) == ["row", "collides", "note"] and plain["note"] == [None, "slide is nan"]
    assert len(answer_rows(SlowChecker(), np.zeros((0, 1)), True, False)["distance"]) == 0


def scenes(tmp_path, n: int, robots=lambda k: SlowChecker(post=0.1 * k), **options) -> ScenesQuestion:
    for k in range(n):
        (tmp_path / f"scene{k}").write_text(str(k))
    asked = []

    def make(place, given):
        asked.append(int(Path(place).read_text()))
        return robots(asked[-1]), np.array([0.15])

    question = ScenesQuestion([str(tmp_path / f"scene{k}") for k in range(n)], {}, make, **options)
    question.asked = asked
    return question


def test_scenes_are_answered_one_after_the_other(tmp_path):
    question = scenes(tmp_path, 3, distances=True)
    block = GivenConfigurations(np.array([[0.0], [0.1], [0.2]])).block(0, 3)
    columns = question.answer(Chunk(0, 7, 11, [(0, block), (2, None)]))
    assert columns["row"].tolist() == [7, 8, 9, 10] and question.asked == [0, 2]
    assert [Path(place).name for place in columns["scene"]] == ["scene0"] * 3 + ["scene2"]
    assert columns["collides"][0].tolist() == [True, True, True, False] and columns["collides"][1].all()
    assert np.allclose(columns["distance"], (0.0, -0.1, -0.2, 0.05)) and columns["body_b"] == ["post"] * 4


def test_few_scenes_stay_loaded_the_last_asked_longest(tmp_path):
    question = scenes(tmp_path, 6)
    for k in (0, 1, 2, 3, 0, 4, 0, 1, 5, 0):
        question.checker(k)
    assert question.asked == [0, 1, 2, 3, 4, 1, 5]
    (tmp_path / "scene2").write_text("7")
    with pytest.raises(SceneError, match="changed while the sweep ran"):
        question.checker(2)


def test_scenes_of_different_robots_have_different_columns(tmp_path):
    class Other(SlowChecker):
        def __init__(self):
            super().__init__()
            self.robot = robot_of(["base", "a"], [joint("x", "prismatic", "base", "a")], {})

    question = scenes(tmp_path, 2, lambda k: Other() if k else SlowChecker(), values=True)
    with pytest.raises(InvalidArgument, match="scene0 and others are of different robots: no column slide"):
        question.answer(Chunk(0, 0, 2, [(0, None), (1, None)]))
    assert question.answer(Chunk(0, 0, 1, [(1, None)]))["x"].tolist() == [0.15]


# --- configurations -------------------------------------------------------------------------------


def written(tmp_path, text: str, suffix: str = ".csv") -> Path:
    file = tmp_path / f"q{suffix}"
    file.write_text(text, encoding="utf-8")
    return file


def test_columns_of_csv_in_any_order_with_empty_cells(tmp_path):
    robot = arm()
    given = read_configurations(written(tmp_path, '\ufeff"y", x\n1,2\n , nan\n\n3e-1,-4\n'), robot)
    assert np.array_equal(given.Q, [[2.0, 1.0], [np.nan, np.nan], [-4.0, 0.3]], equal_nan=True)
    assert given.rows == 3 and given.source.endswith("q.csv")
    assert read_configurations(written(tmp_path, "x,y\n"), robot).Q.shape == (0, 2)


@pytest.mark.parametrize(("text", "words"), [
    ("x\n1\n", "lacks columns for y; robot plain has x, y"),
    ("x,y,z,w\n", "has columns that are no joints: z, w; robot plain has x, y"),
    ("x,y,x\n1,2,3\n", "names columns twice: x; robot plain"),
    ("x,y\n1,2\n3\n", "line 3: has 1 values, the header 2 columns"),
    ("x,y\n1,\n\nnan,far\n", "line 4: must be numbers, got 'far'"),
    ("y,x\n ,near\n", "line 2: must be numbers, got 'near'"),
])
def test_csv_that_is_wrong_is_told_with_its_place(tmp_path, text, words):
    with pytest.raises(SceneError) as raised:
        read_configurations(written(tmp_path, text), arm())
    assert words in str(raised.value) and "q.csv" in str(raised.value)


def test_arrays_and_files_of_arrays(tmp_path):
    robot, Q = arm(), np.arange(6).reshape(3, 2)
    np.save(tmp_path / "q.npy", Q)
    given = as_configurations(str(tmp_path / "q.npy"), robot)
    assert given.block(1, 3).of(robot).tolist() == [[2.0, 3.0], [4.0, 5.0]]
    assert given.about() == as_configurations(Q, robot).about() and given.about()["rows"] == 3
    assert given.about()["digest"] not in (None, GivenConfigurations(Q + 1.0).about()["digest"])
    assert as_configurations(given, robot) is given
    for wrong in (Q[:, :1], Q[0]):
        with pytest.raises(InvalidArgument, match=r"must have shape \(N, 2\), one column for each of x, y"):
            as_configurations(wrong, robot)
    for array in (np.array(["a", "b"]), Q.astype(complex), Q > 0):
        np.save(tmp_path / "w.npy", array)
        with pytest.raises(SceneError, match="must hold real numbers, got"):
            read_configurations(tmp_path / "w.npy", robot)
    with pytest.raises(SceneError, match="is no array of numbers"):
        read_configurations(written(tmp_path, "text", ".npy"), robot)
    with pytest.raises(SceneError, match="there is no such file"):
        read_configurations(tmp_path / "none.csv", robot)
    with pytest.raises(SceneError, match=r"configurations are read from .npy, .csv, .parquet"):
        read_configurations(written(tmp_path, "x,y\n", ".txt"), robot)


# --- folders --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stem", "number"), [
    ("chunk-00000000", 0), ("chunk-00000012", 12), ("chunk-", None), ("chunk--1", None), ("chunk-1a", None),
    ("chunk-٣", None), ("chunk-" + "9" * 18, 10**18 - 1), ("chunk-" + "9" * 19, None),
])
def test_numbers_of_chunk_files(stem, number):
    assert _number_of(Path(f"{stem}.parquet")) == number


def test_a_manifest_has_counts_that_agree(tmp_path):
    good = {"schema": SCHEMA, "rows": 10, "chunk": 3, "chunks": 4, "columns": {"distances": False, "values": True}}
    assert _is_manifest(good) and _is_manifest({**good, "rows": 9, "chunks": 3}) and _is_manifest({**good, "more": 1})
    wrong = (
        {"schema": "other"}, {"rows": 0}, {"rows": -1}, {"rows": True}, {"rows": 10.0}, {"rows": 2**62}, {"chunks": 3},
        {"rows": 2**62, "chunk": 2**62, "chunks": 1},
        {"chunks": 5}, {"chunk": None}, {"columns": None}, {"columns": {"distances": False}},
        {"columns": {"distances": 0, "values": True}}, {"columns": {"distances": False, "values": True, "more": 1}},
    )
    for change in wrong:
        assert not _is_manifest({**good, **change}), change
    assert not _is_manifest([good]) and not _is_manifest(None)
    folder = SweepDirectory(tmp_path)
    with pytest.raises(SceneError, match="is no folder of a sweep: it has no manifest"):
        folder.manifest()
    (tmp_path / MANIFEST).write_text(json.dumps(good))
    assert folder.manifest() == good
    for text, words in (("{", "is not JSON"), ("[]", "is no manifest of a sweep in the form")):
        (tmp_path / MANIFEST).write_text(text)
        with pytest.raises(SceneError, match=words):
            folder.manifest()


# --- processes ------------------------------------------------------------------------------------


def test_processes_answer_every_chunk_and_end():
    pool = ProcessPool(OneQuestion(SlowChecker()), 1)
    Q = GivenConfigurations(np.linspace(-1.0, 1.0, 9)[:, None])
    chunks = [Chunk(k, 3 * k, 3 * k + 3, [(0, Q.block(3 * k, 3 * k + 3))]) for k in range(3)]
    answers = {chunk.number: answer for chunk, answer in pool.answers(iter(chunks))}
    assert sorted(answers) == [0, 1, 2] and len(pool.pids()) == 1
    hits = np.concatenate([answers[k]["collides"][0] for k in range(3)])
    assert hits.tolist() == (Q.Q[:, 0] >= 0.25).tolist()
    pool.close()
    assert pool.pids() == [] and not any(thread.is_alive() for thread in pool._threads)


def test_pairs_of_links_are_counted_by_reason(monkeypatch):
    reasons = [ADJACENT, NEVER, None, ADJACENT, NEVER, NEVER, None]
    proposal = SimpleNamespace(pairs=[SimpleNamespace(reason=reason) for reason in reasons])
    monkeypatch.setattr(pair_tables, "never_words", lambda proposal: ())
    counts = {row[0]: row[1] for row in pair_tables._by_reason(proposal).rows}
    assert counts == {ADJACENT: "2", DEFAULT: "0", ALWAYS: "0", NEVER: "3", "tested": "2"}


def test_a_joint_value_is_outside_where_it_passes_its_limit_by_more_than_the_slack():
    robot, slack = SlowChecker().robot, sweep_question._SLACK
    just = 1.0
    for _ in range(5):  # where the slack of the value itself ends
        just = 1.0 + slack * max(1.0, just)
    values = np.array([[just], [-just], [np.nextafter(just, 2.0)], [np.nextafter(-just, -2.0)]])
    assert [note is None for note in sweep_question._notes(robot, values)] == [True, True, False, False]


def test_as_many_drawn_rows_as_memory_holds_may_be_had_at_once(monkeypatch):
    monkeypatch.setattr(configurations, "_MAX_DRAWN", 12)
    assert DrawnConfigurations(6).of(arm()).shape == (6, 2)
    with pytest.raises(InvalidArgument, match="7 rows are too many for memory"):
        DrawnConfigurations(7).of(arm())


def test_as_many_workers_as_there_may_be(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    monkeypatch.setattr(sweep, "MAX_WORKERS", 0)
    assert run_of(tmp_path, 1, 3, None).go(workers=0).done == 3
    with pytest.raises(InvalidArgument, match="workers must be at most 0 processes, got 1"):
        run_of(tmp_path, 1, 3, None).go(workers=1)


def test_hidden_pairs_collide_in_part_of_the_sample_and_are_disabled():
    link = lambda name, reason, hits: SimpleNamespace(
        a="base", b=name, reason=reason, hits=hits, samples=9, fixed=False, share_bounds=(0.0, 1.0), searched=False,
        nearest=None,
    )
    hits = [("p", DEFAULT, 4), ("q", DEFAULT, 9), ("r", ALWAYS, 8), ("s", NEVER, 0), ("t", None, 3)]
    pairs = [link(*one) for one in hits]
    proposal = SimpleNamespace(
        pairs=pairs, disabled=[pair for pair in pairs if pair.reason is not None], samples=9, nearest=None,
    )
    tables = {table.title.split()[0]: table for table in pair_tables.proposal_tables(proposal)}
    assert [row[1] for row in tables["HIDDEN"].rows] == ["p", "r"]
