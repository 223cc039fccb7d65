"""Sweeps: every row answered once, as it is answered alone, whoever answers and whoever is killed meanwhile."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import slow_checker
from plain_robots import arm_checker
from slow_checker import SlowChecker, diary_lines

import collide
from collide import InvalidArgument, RobotChecker, SceneError
from collide.scenes import load
from collide.sweeps import process_pool
from collide.sweeps.configurations import DrawnConfigurations
from collide.sweeps.random_configurations import random_configurations
from collide.sweeps.sweep import sweep
from collide.sweeps.sweep_results import read_sweep

pytestmark = pytest.mark.skipif(
    find_spec("pyarrow") is None, reason="pyarrow is not installed: pip install 'collide-robotics[sweep]'"
)
HERE = Path(__file__).resolve().parent


def expected(rows: int, seed: int = 3) -> np.ndarray:
    """Verdicts of `SlowChecker` by its definition."""
    return random_configurations(SlowChecker().robot, 0, rows, seed)[:, 0] >= 0.25


def until(condition, seconds: float = 120.0) -> None:
    """Wait for a condition; fail where it does not come."""
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends, "what was waited for did not come"
        time.sleep(0.01)


def chunk_files(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.glob("chunk-*.parquet"))


@pytest.mark.many(2)
@pytest.mark.parametrize("workers, chunk", [(0, None), (0, 7), (2, 130)])
def test_rows_are_those_of_the_checker(tmp_path, workers, chunk):
    results = sweep(SlowChecker(), DrawnConfigurations(1000, 3), tmp_path / "s", workers=workers, chunk=chunk,
                    values=True)
    table = results.table()
    assert table.column_names == ["row", "collides", "note", "slide"]
    assert np.array_equal(table["row"].to_numpy(), np.arange(1000))
    assert np.array_equal(results.collides(), expected(1000))
    assert np.array_equal(table["slide"].to_numpy(), random_configurations(SlowChecker().robot, 0, 1000, 3)[:, 0])
    assert results.colliding == expected(1000).sum() and results.colliding + results.free == 1000 == results.done
    assert 300 < results.colliding < 450, "both verdicts, near 3 of 8"


def test_distances_and_their_bodies(tmp_path):
    Q = np.linspace(-1, 1, 41)[:, None]
    results = sweep(SlowChecker(), Q, tmp_path / "s", workers=0, distances=True, chunk=9)
    table = results.table(["distance", "body_a", "body_b"])
    assert np.array_equal(table["distance"].to_numpy(), 0.25 - Q[:, 0])
    assert set(table["body_a"].to_pylist()) == {"slider"} and set(table["body_b"].to_pylist()) == {"post"}
    assert results.least == (-0.75, 40, "slider", "post")


def test_rows_that_are_not_numbers_and_rows_outside(tmp_path):
    Q = np.array([[0.0], [np.nan], [0.5], [7.0], [-np.inf], [1e300], [1.0 + 1e-10]])
    results = sweep(SlowChecker(), Q, tmp_path / "s", workers=0, distances=True)
    table = results.table()
    assert table["collides"].to_pylist() == [False, None, True, True, None, None, True]
    notes = table["note"].to_pylist()
    assert notes[1] == "slide is nan" and notes[4] == "slide is -inf"
    assert notes[3] == "slide 7 outside [-1, 1]" and "slider" in notes[5] and "finite and within" in notes[5]
    assert notes[0] is notes[2] is notes[6] is None
    assert (results.unanswered, results.outside, results.colliding, results.free) == (3, 1, 3, 1)
    assert [row for row, _ in results.named] == [1, 4, 5, 3], "what has no answer comes first"
    assert np.isnan(table["distance"].to_numpy()[[1, 4, 5]]).all()
    with pytest.raises(InvalidArgument, match="3 rows have no answer"):
        results.collides()


def test_robot_checker_in_processes(tmp_path):
    """A RobotChecker that was asked before travels to processes; each row is what a World of posed bodies says."""
    scene = load("workcell")
    checker = RobotChecker.from_scene(scene)
    Q = DrawnConfigurations(400, 5).of(checker.robot)
    checker.collides(Q), checker.distances(Q[:5])  # it holds workspaces now
    results = sweep(checker, Q, tmp_path / "s", workers=2, chunk=100, distances=True)
    placement, hits = scene.placements["arm"], []
    for q in Q[:60]:
        world = scene.with_state(dict(zip(placement.robot.joint_names, q))).world()
        links = {identity for identity, name in world.names.items() if name in placement.carried}
        rows = world.collisions()
        hits.append(any(a in links or b in links for a, b in zip(rows["a"].tolist(), rows["b"].tolist())))
    table = results.table().to_pydict()
    assert table["collides"][:60] == hits and 15 < sum(hits) < 45
    assert np.array_equal(results.collides(), checker.collides(Q))
    nearest = checker.distances(Q)
    assert table["distance"] == nearest.distance.tolist()
    assert list(zip(table["body_a"], table["body_b"])) == nearest.names
    checker.world.set_pose("bench", collide.pose((0, 0, 5)))
    with pytest.raises(InvalidArgument, match="the scene or the robot changed"):
        sweep(checker, Q, tmp_path / "s", workers=0, chunk=100, distances=True)


# --- going on --------------------------------------------------------------------------------------


def test_second_run_asks_what_is_missing_only(tmp_path):
    folder, diary = tmp_path / "s", tmp_path / "diary"
    sweep(SlowChecker(0, str(diary)), DrawnConfigurations(1000, 3), folder, workers=0, chunk=100)
    assert len(diary_lines(diary)) == 10
    before = {name: (folder / name).stat().st_mtime_ns for name in chunk_files(folder)}
    (folder / "chunk-00000003.parquet").unlink()
    (folder / "chunk-00000007.parquet").write_bytes(b"torn")  # by a disk
    (folder / "_partial-chunk-00000009.parquet").write_bytes(b"half")  # by a run that was killed
    results = sweep(SlowChecker(0, str(diary)), DrawnConfigurations(1000, 3), folder, workers=0, chunk=100)
    asked = random_configurations(SlowChecker().robot, 0, 1000, 3)[[300, 700], 0]
    assert [float(line[0].split("(")[-1].rstrip(")")) for line in diary_lines(diary)[10:]] == asked.tolist()
    after = {name: (folder / name).stat().st_mtime_ns for name in chunk_files(folder)}
    assert {name for name in before if before[name] != after[name]} == {
        "chunk-00000003.parquet", "chunk-00000007.parquet",
    }
    assert np.array_equal(results.collides(), expected(1000)) and not list(folder.glob("_partial*"))


@pytest.mark.parametrize(
    "change, words",
    [
        ({"checker": SlowChecker(post=0.3)}, "the scene or the robot changed"),
        ({"configurations": DrawnConfigurations(100, 4)}, "the configurations are others"),
        ({"configurations": DrawnConfigurations(101, 3)}, "the configurations are others"),
        ({"configurations": random_configurations(SlowChecker().robot, 0, 100, 3)}, "the configurations are others"),
        ({"distances": True}, "other columns"), ({"values": True}, "other columns"), ({"chunk": 11}, "another size"),
    ],
)
def test_another_question_is_refused(tmp_path, change, words):
    arguments = {"checker": SlowChecker(), "configurations": DrawnConfigurations(100, 3), "workers": 0, "chunk": 10}
    sweep(folder=tmp_path / "s", **arguments)
    files = {file: file.read_bytes() for file in (tmp_path / "s").glob("chunk-*")}
    with pytest.raises(InvalidArgument, match=words):
        sweep(folder=tmp_path / "s", **{**arguments, **change})
    assert all(file.read_bytes() == content for file, content in files.items())
    results = sweep(folder=tmp_path / "s", restart=True, **{**arguments, **change})
    assert results.done == results.rows and results.rows in (100, 101)


def test_a_sweep_among_bodies_of_other_margins_is_refused(tmp_path):
    checker, Q = arm_checker(at=(1.0, 0, 1.0)), DrawnConfigurations(100, 3)
    before = sweep(checker, Q, tmp_path / "s", workers=0).colliding
    checker.world.set_margin("ball", 0.4)
    with pytest.raises(InvalidArgument, match="the scene or the robot changed"):
        sweep(checker, Q, tmp_path / "s", workers=0)
    assert sweep(checker, Q, tmp_path / "s", workers=0, restart=True).colliding > before > 0


def test_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    for restart in (False, True):
        with pytest.raises(InvalidArgument, match=r"letter\.txt and is no folder of a sweep"):
            sweep(SlowChecker(), DrawnConfigurations(10, 3), tmp_path, workers=0, restart=restart)
    with pytest.raises(SceneError, match="no folder of a sweep"):
        read_sweep(tmp_path)


def test_two_runs_at_once_are_refused(tmp_path):
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from slow_checker import *; from collide.sweeps.configurations import DrawnConfigurations\n"
        "from collide.sweeps.sweep import sweep\n"
        "try: sweep(SlowChecker(), DrawnConfigurations(10, 3), sys.argv[2], workers=0)\n"
        "except Exception as error: print(error)"
    )
    said = []

    def second_run(label):
        if not said:
            done = subprocess.run([sys.executable, "-c", code, str(HERE), str(tmp_path / "s")], capture_output=True,
                                  text=True, check=True, timeout=300)
            said.append(done.stdout)

    results = sweep(SlowChecker(), DrawnConfigurations(10, 3), tmp_path / "s", workers=0, progress=calls(second_run))
    assert "another sweep is writing here" in said[0] and results.done == 10


def calls(function):
    """A progress that calls a function with each label."""
    from contextlib import contextmanager

    @contextmanager
    def progress(label):
        yield function

    return progress


def test_progress_says_how_far_and_how_long(tmp_path):
    labels: list[str] = []
    sweep(SlowChecker(0.01), DrawnConfigurations(1000, 3), tmp_path / "s", workers=0, chunk=100,
          progress=calls(labels.append))
    assert labels[0] == "sweeping: 0 of 1,000 rows" and len(labels) == 11
    assert labels[5].startswith("sweeping: 500 of 1,000 rows, ") and labels[5].endswith("/s, 1 s to go")
    assert labels[-1].endswith("0 s to go")


def test_scene_that_changes_while_the_sweep_runs(tmp_path):
    """Workers answer about the scene as it was; whoever moves it meanwhile is told, and what is there stays true."""
    checker = SlowChecker()

    def move(label):
        checker.post = 0.9

    with pytest.raises(SceneError, match="changed while the sweep ran"):
        sweep(checker, DrawnConfigurations(500, 3), tmp_path / "s", workers=1, chunk=100, progress=calls(move))
    there = read_sweep(tmp_path / "s").table(["row", "collides"])
    assert there.num_rows >= 100
    assert np.array_equal(there["collides"].to_numpy(), expected(500)[there["row"].to_numpy()])
    with pytest.raises(InvalidArgument, match="the scene or the robot changed"):
        sweep(checker, DrawnConfigurations(500, 3), tmp_path / "s", workers=0, chunk=100)


# --- killed ----------------------------------------------------------------------------------------


def test_worker_killed_midway(tmp_path, monkeypatch):
    """SIGKILL to a process of the pool: its chunk is asked again, the others are not."""
    diary, pools = tmp_path / "diary", []
    make = process_pool.ProcessPool.__init__
    monkeypatch.setattr(process_pool.ProcessPool, "__init__", lambda pool, *a: (pools.append(pool), make(pool, *a))[1])

    def kill():
        until(lambda: len({line[2] for line in diary_lines(diary)}) == 2)  # both are at work
        os.kill(pools[0].pids()[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    checker = SlowChecker(0.05, str(diary))
    results = sweep(checker, DrawnConfigurations(2000, 3), tmp_path / "s", workers=2, chunk=100)
    killer.join()
    assert np.array_equal(results.collides(), expected(2000))
    times = Counter(line[0] for line in diary_lines(diary))
    assert len(times) == 20 and sum(times.values()) <= 21
    assert len({line[2] for line in diary_lines(diary)}) == 3, "a third process took the place of the one killed"


class _Deadly(SlowChecker):
    """Ends every process that answers about the row 0.5."""

    def collides(self, Q):
        if (Q == 0.5).any():
            os.kill(os.getpid(), signal.SIGKILL)
        return super().collides(Q)


def test_chunk_that_kills_is_given_up_and_named(tmp_path):
    Q = np.linspace(-1, 1, 41)[:, None]
    with pytest.raises(InvalidArgument, match="chunk 3, rows 30 to 39: 3 processes ended"):
        sweep(_Deadly(), Q, tmp_path / "s", workers=1, chunk=10)
    assert chunk_files(tmp_path / "s") == [f"chunk-0000000{k}.parquet" for k in range(3)]


def test_errors_of_the_checker_arrive_as_they_are(tmp_path):
    class Broken(SlowChecker):
        def collides(self, Q):
            raise InvalidArgument("no answer today")

    slow_checker.Broken = Broken  # so that it pickles by name, though no other process has such a class
    Broken.__module__, Broken.__qualname__ = "slow_checker", "Broken"
    with pytest.raises(InvalidArgument, match="cannot read what they are asked"):
        sweep(Broken(), DrawnConfigurations(10, 3), tmp_path / "s", workers=1)
    with pytest.raises(InvalidArgument, match="no answer today"):
        sweep(Broken(), DrawnConfigurations(10, 3), tmp_path / "s", workers=0)
    with pytest.raises(InvalidArgument, match="exactly this"):
        sweep(SlowChecker(post="exactly this"), DrawnConfigurations(10, 3), tmp_path / "t", workers=1)


def test_whole_process_killed_midway(tmp_path):
    """SIGKILL to the sweep itself, then the same command: what was written stays, what is missing is asked."""
    folder, diary = tmp_path / "s", tmp_path / "diary"
    command = [sys.executable, str(HERE / "slow_checker.py"), str(folder), str(diary), "2000", "0.03"]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen(command, env=env)
    until(lambda: len(chunk_files(folder)) >= 5)
    process.kill()
    process.wait()
    there = {name: (folder / name).stat().st_mtime_ns for name in chunk_files(folder)}
    assert 5 <= len(there) < 20
    assert read_sweep(folder).done == 100 * len(there)
    until(lambda: _alone(diary), 20)
    asked_before = len(diary_lines(diary))
    subprocess.run(command, env=env, check=True, timeout=300)
    results = read_sweep(folder)
    assert np.array_equal(results.collides(), expected(2000)) and len(chunk_files(folder)) == 20
    assert all((folder / name).stat().st_mtime_ns == stamp for name, stamp in there.items()), "written twice"
    assert len(diary_lines(diary)) - asked_before == 20 - len(there), "what was there is not asked again"


def _alone(diary: Path) -> bool:
    """The workers of a killed sweep end by themselves: the diary grows no more."""
    before = len(diary_lines(diary))
    time.sleep(0.3)
    return len(diary_lines(diary)) == before


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("distributed") is None, reason="dask is not installed: pip install 'collide-robotics[sweep]'"
)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("n_killed", [1, 2])
def test_dask_worker_killed_midway(tmp_path, n_killed):
    """SIGKILL to one of two workers of a local cluster, or to both: nothing lost, nothing twice."""
    import distributed

    diary = tmp_path / "diary"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster, distributed.Client(cluster) as client:
        pids = list(client.run(os.getpid).values())

        written_before = []

        def kill():
            until(lambda: len(diary_lines(diary)) >= 4)
            for pid in pids[:n_killed]:
                os.kill(pid, signal.SIGKILL)
            written_before.append(len(chunk_files(tmp_path / "s")))

        killer = threading.Thread(target=kill)
        killer.start()
        checker = SlowChecker(0.05, str(diary))
        scheduler = client if n_killed == 1 else cluster.scheduler_address
        results = sweep(checker, DrawnConfigurations(2000, 3), tmp_path / "s", scheduler=scheduler, chunk=100)
        killer.join()
    assert np.array_equal(results.table(["row"])["row"].to_numpy(), np.arange(2000))
    assert np.array_equal(results.collides(), expected(2000)) and len(chunk_files(tmp_path / "s")) == 20
    lines = diary_lines(diary)
    assert len({line[0] for line in lines}) == 20
    assert written_before[0] < 17, "they were killed when most was done"
    if n_killed == 2:
        assert {line[2] for line in lines} - set(map(str, pids)), "workers took the place of those killed"


# --- what others did to the folder ----------------------------------------------------------------


def rewritten(file: Path, change) -> None:
    """A chunk read, changed and written back with all that it says of itself, as a person with pandas would."""
    from pyarrow import parquet

    table = parquet.read_table(file)
    parquet.write_table(change(table).replace_schema_metadata(table.schema.metadata), file)


def flipped(table):
    import pyarrow.compute

    k = table.column_names.index("collides")
    return table.set_column(k, "collides", pyarrow.compute.invert(table["collides"]))


def test_chunks_are_known_by_what_is_in_them(tmp_path):
    """Exchanged, copied, edited or damaged chunks, and those of another seed, count as missing and are made again."""
    folder, other = tmp_path / "s", tmp_path / "other"
    ask = {"workers": 0, "chunk": 100, "distances": True}
    sweep(SlowChecker(), DrawnConfigurations(1000, 3), folder, **ask)
    sweep(SlowChecker(), DrawnConfigurations(1000, 4), other, **ask)
    right = {file.name: file.read_bytes() for file in folder.glob("chunk-*")}

    def chunk(k: int, where: Path = folder) -> Path:
        return where / f"chunk-{k:08d}.parquet"

    chunk(0).write_bytes(right[chunk(1).name])  # a copy under another number
    chunk(1).write_bytes(right["chunk-00000000.parquet"])  # so that both are exchanged
    chunk(2).write_bytes(chunk(2, other).read_bytes())  # of another seed
    rewritten(chunk(3), flipped)
    rewritten(chunk(4), lambda table: table.take(list(range(99, -1, -1))))
    rewritten(chunk(5), lambda table: table.drop_columns(["note"]))
    damaged = bytearray(right[chunk(6).name])
    damaged[40] ^= 4
    chunk(6).write_bytes(bytes(damaged))
    chunk(10).write_bytes(right[chunk(9).name])  # beyond the last
    chunk(7).unlink()
    chunk(7).symlink_to(chunk(7, other))
    kept = read_sweep(folder)
    assert kept.done == 200 and len(kept.table()) == 200
    assert kept.table(["row"])["row"].to_pylist() == list(range(800, 1000))
    with pytest.raises(InvalidArgument, match="800 rows have no answer"):
        kept.collides()
    elsewhere = chunk(7, other).read_bytes()
    done = sweep(SlowChecker(), DrawnConfigurations(1000, 3), folder, **ask)
    assert done.done == 1000 and np.array_equal(done.collides(), expected(1000))
    assert all(chunk(k).read_bytes() == right[chunk(k).name] for k in range(10))
    assert chunk(7, other).read_bytes() == elsewhere, "a link is replaced, what it names stays"


BAD_MANIFESTS = ["[]", "null", '"a"', "3", "{}", "[" * 200_000, '{"rows": ' * 200_000, "\0", ""]


@pytest.mark.parametrize("text", [*BAD_MANIFESTS, "rows", "negative", "columns", "chunks", "schema", "1e400"])
def test_a_manifest_that_is_none_is_told_as_such(tmp_path, text):
    folder = tmp_path / "s"
    sweep(SlowChecker(), DrawnConfigurations(20, 3), folder, workers=0, chunk=10)
    place = folder / "_sweep.json"
    good = json.loads(place.read_text())
    changes = {"rows": {"rows": []}, "negative": {"chunk": -10}, "columns": {"columns": 7}, "chunks": {"chunks": 10**9},
               "schema": {"schema": "collide-sweep/1"}, "1e400": {"rows": 1e400}}
    place.write_text(json.dumps(good | changes[text]) if text in changes else text)
    for ask in (lambda: read_sweep(folder),
                lambda: sweep(SlowChecker(), DrawnConfigurations(20, 3), folder, workers=0, chunk=10)):
        with pytest.raises((SceneError, InvalidArgument), match=r"_sweep\.json.*(JSON|manifest)"):
            ask()
    assert sweep(SlowChecker(), DrawnConfigurations(20, 3), folder, workers=0, chunk=10, restart=True).done == 20


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_lock_that_is_a_link_is_refused(tmp_path):
    folder = tmp_path / "s"
    folder.mkdir()
    for target in ("absent", "there"):
        (tmp_path / "there").write_text("somebody's")
        (folder / "_sweep.lock").symlink_to(tmp_path / target)
        with pytest.raises(InvalidArgument, match=r"_sweep\.lock is a link or no file: remove it"):
            sweep(SlowChecker(), DrawnConfigurations(20, 3), folder, workers=0)
        assert not (tmp_path / "absent").exists() and (tmp_path / "there").read_text() == "somebody's"
        (folder / "_sweep.lock").unlink()
    os.mkfifo(folder / "_sweep.lock")
    with pytest.raises(InvalidArgument, match="link or no file"):
        sweep(SlowChecker(), DrawnConfigurations(20, 3), folder, workers=0)


@pytest.mark.parametrize(
    ("rows", "chunk", "words"),
    [(10**20, None, "more than 1,000,000 chunks of 50,000"), (10**400, None, "more than 1,000,000 chunks"),
     (10**9, 100, "more than 1,000,000 chunks of 100"), (10, 10**12, "at most 10,000,000 rows")],
)
def test_more_rows_than_can_be_listed_are_refused_at_once(tmp_path, rows, chunk, words):
    with pytest.raises(InvalidArgument, match=words):
        sweep(SlowChecker(), DrawnConfigurations(rows, 3), tmp_path / "s", workers=0, chunk=chunk)
    assert not (tmp_path / "s").exists()
