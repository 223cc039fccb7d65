"""The search: what it keeps, that kinds are counted once, that it goes on after being killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from collide import Box, InvalidArgument, MissingExtra, Sphere, distance, pose
from collide.adapters.fuzzing import fuzz_run
from collide.adapters.fuzzing.findings import load_finding, save_finding, simpler_of
from collide.adapters.fuzzing.fuzz_case import Case, isolated, pair_case
from collide.adapters.fuzzing.fuzz_run import STATE, FuzzRun, fuzz
from collide.adapters.fuzzing.invented_scenes import SOURCES, invent
from collide.adapters.fuzzing.simpler_cases import complexity, fingerprint
from collide.adapters.peers import protocol
from collide.errors import SceneError
from collide.scenes import load

HERE = Path(__file__).parent


def boxes_and_spheres(seed: int, number: int):
    """Large boxes, small ones, and spheres apart: one kind of error, met often."""
    rng = np.random.default_rng([seed, number])
    sizes = rng.uniform(0.5, 4.0, (6, 3))
    return [pair_case(Box(size), Box(size[::-1]), pose(), pose(rng.uniform(-0.2, 0.2, 3))) for size in sizes] + [
        pair_case(Sphere(1), Sphere(1), pose(), pose((3, 0, 0)))
    ]


def contents(folder: Path) -> dict[str, str]:
    """File → text, seconds left out."""
    made = {file.name: file.read_text() for file in sorted(folder.iterdir())}
    state = json.loads(made[STATE])
    return made | {STATE: json.dumps({key: value for key, value in state.items() if key != "seconds"})}


def test_one_kind_is_kept_once_and_counted(stubs, tmp_path):
    run = fuzz(["large_boxes"], tmp_path / "found", rounds=3, seed=4, source=boxes_and_spheres)
    assert run.rounds == 3 and run.pairs == 21 and run.ours == 0
    (found,) = run.findings()
    assert found.kind == ("large_boxes", "false miss", "Box", "Box", "deep") and found.is_minimal
    assert run.counts()["large_boxes"]["false miss"] > 6, "met in every round"
    assert run.counts()["collide"].total() == 0
    sizes = sorted(np.concatenate([body.shape.size for body in found.case.bodies]).tolist())
    assert sizes[:5] == [1] * 5 and sizes[5] in (3, 4), "one digit above 2"
    names = sorted(file.name for file in (tmp_path / "found").iterdir())
    assert names == [STATE, f"{found.stem}.json", f"{found.stem}.md"], "a stub has no calls to write a snippet in"


def test_a_finding_is_a_scene_and_reads_back(stubs, tmp_path):
    fuzz(["large_boxes"], tmp_path, rounds=1, seed=4, source=boxes_and_spheres)
    (place,) = tmp_path.glob("large*.json")
    found, about = load_finding(place)
    assert [body.name for body in load(place).bodies] == ["A", "B"]
    assert about["exact"]["hit"] is True and about["exact"]["certificate"]["vertices"]
    assert about["command"] == f"collide compare {place.name} --engines large_boxes"
    assert {"numpy", "python", "collide-robotics"} <= about["versions"].keys()
    before = contents(tmp_path)
    again = save_finding(found, tmp_path)
    assert again == place and contents(tmp_path) == before
    text = place.with_suffix(".md").read_text()
    assert text.startswith("# False miss: Box and Box, overlapping") and "no collision" in text
    place.write_text('{"collide": 1, "bodies": []}')
    with pytest.raises(SceneError, match="no finding"):
        load_finding(place)


def test_the_simpler_of_two_is_kept(stubs, tmp_path):
    fuzz(["large_boxes"], tmp_path, rounds=1, seed=4, source=boxes_and_spheres)
    found, _ = load_finding(next(tmp_path.glob("large*.json")))
    worse = found._replace(case=found.case.replaced(0, X_WB=pose((0.123, 0, 0))), times=5)
    assert complexity(worse.case) > complexity(found.case)
    for pair in ((found, worse), (worse, found)):
        kept = simpler_of(*pair)
        assert fingerprint(kept.case) == fingerprint(found.case) and kept.times == 6


@pytest.mark.slow
def test_going_on_gives_what_one_run_gives(stubs, tmp_path):
    fuzz(["large_boxes"], tmp_path / "whole", rounds=3, seed=1, source=boxes_and_spheres)
    for rounds in (1, 3):
        run = fuzz(["large_boxes"], tmp_path / "parts", rounds=rounds, seed=1, resume=True, source=boxes_and_spheres)
    assert run.rounds == 3
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")


KILLED = """
import sys
sys.path.insert(0, {here!r})
from collide.adapters.peers import protocol
protocol.ENGINES["large_boxes"] = "stub_engines:LargeBoxes"
from test_fuzz_run import boxes_and_spheres
from collide.adapters.fuzzing.fuzz_run import fuzz
fuzz(["large_boxes"], {folder!r}, seed=1, source=boxes_and_spheres)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX's")
def test_a_killed_run_goes_on_and_loses_one_round_at_most(stubs, tmp_path):
    folder = tmp_path / "killed"
    program = KILLED.format(here=str(HERE), folder=str(folder))
    process = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and _rounds(folder) < 2:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = _rounds(folder)
    assert done >= 2
    run = fuzz(["large_boxes"], folder, rounds=done + 1, seed=1, resume=True, source=boxes_and_spheres)
    assert run.rounds == done + 1
    fuzz(["large_boxes"], tmp_path / "whole", rounds=done + 1, seed=1, source=boxes_and_spheres)
    assert contents(folder) == contents(tmp_path / "whole"), "no half files, and nothing counted twice"


def _rounds(folder: Path) -> int:
    return json.loads((folder / STATE).read_text())["rounds"] if (folder / STATE).exists() else 0


def test_time_that_runs_out_keeps_what_was_shrunk(stubs, tmp_path):
    run = fuzz(["large_boxes"], tmp_path, minutes=1e-6, rounds=1, seed=4, source=boxes_and_spheres)
    assert run.rounds == 0
    run = fuzz(["large_boxes"], tmp_path, rounds=1, seed=4, resume=True, source=boxes_and_spheres)
    assert run.rounds == 1 and len(run.findings()) == 1


def test_what_a_folder_must_be(stubs, tmp_path):
    fuzz(["large_boxes"], tmp_path, rounds=0, seed=1)
    for options, complaint in (
        ({"seed": 1}, "--resume"), ({"seed": 2, "resume": True}, "seed 1 of large_boxes"),
    ):
        with pytest.raises(InvalidArgument, match=complaint):
            fuzz(["large_boxes"], tmp_path, rounds=0, **options)
    (tmp_path / STATE).write_text("[]")
    with pytest.raises(InvalidArgument, match="no state of a search"):
        fuzz(["large_boxes"], tmp_path, rounds=0, resume=True)
    (tmp_path / STATE).write_text(json.dumps(FuzzRun("", 1, []).to_dict() | {"format": 0}))
    with pytest.raises(InvalidArgument, match="another version"):
        fuzz(["large_boxes"], tmp_path, rounds=0, resume=True)


def test_unknown_and_absent_engines(tmp_path, monkeypatch):
    with pytest.raises(InvalidArgument, match="no engine 'odd'"):
        fuzz(["odd"], tmp_path / "a")
    monkeypatch.setitem(protocol.ENGINES, "absent", f"{__name__}:Absent")
    monkeypatch.setattr(protocol, "load_engine", lambda spec: _Absent())
    with pytest.raises(MissingExtra):
        fuzz(["absent"], tmp_path / "b")
    assert not (tmp_path / "a").exists() and not (tmp_path / "b").exists()


class _Absent(protocol.Peer):
    name, package, module = "absent", "absent-package", "no_such_module_at_all"


def test_invented_scenes_are_the_same_for_the_same_seed():
    a, b, c = (list(map(fingerprint, invent(seed, 2, 30))) for seed in (5, 5, 6))
    assert a == b and a != c


@pytest.fixture(scope="module")
def invented() -> list[Case]:
    return [case for number in range(5) for case in invent(5, number)]


def test_every_kind_of_scene_is_invented(invented):
    by_source = Counter(case.source for case in invented)
    assert by_source.keys() == SOURCES.keys(), "each has its share of 300 pairs"
    assert min(by_source.values()) >= 2 and by_source["near touching"] >= 20 and by_source["resting"] >= 10
    kinds = Counter(kind for case in invented for kind in case.kinds)
    assert kinds.keys() == {
        "Sphere", "Box", "Capsule", "Cylinder", "Cone", "Ellipsoid", "ConvexHull", "HPolytope", "Mesh", "HeightField",
        "Compound", "Halfspace",
    }
    assert min(kinds.values()) >= 5, kinds
    worlds = [case for case in invented if case.world]
    assert worlds and max(len(case.bodies) for case in worlds) > 5


def test_near_and_resting_pairs_are_near_and_resting(invented):
    near = [case for case in invented if case.source in ("near touching", "resting")]
    sizes = isolated(near).sizes()
    gaps = np.array([abs(_signed_distance(case)) / size for case, size in zip(near, sizes)])
    for below, least in ((0.2, 0.9), (1e-3, 0.5), (1e-8, 0.2)):
        assert np.mean(gaps <= below) >= least, (below, sorted(gaps))
    hits = np.mean([_signed_distance(case) <= 0 for case in near])
    assert 0.2 < hits < 0.8, "on both sides of touching"


def _signed_distance(case: Case) -> float:
    r = distance(*case.pair())
    return float(r.distance if np.isfinite(r.distance) else r.upper if np.isfinite(r.upper) else 0.0)


def test_what_was_invented_is_counted_and_told(stubs, tmp_path):
    labels: list[str] = []
    run = fuzz([], tmp_path, rounds=2, seed=3, progress=_told(labels), source=lambda seed, k: invent(seed, k, 10))
    sources = {name: n for name, n in run.invented.items() if not name.startswith("shape ")}
    assert sum(sources.values()) == run.pairs and sources.keys() <= SOURCES.keys()
    first = json.loads((tmp_path / STATE).read_text())
    assert first["invented"] == run.invented and run.invented["shape Box"] > 0
    assert any("pairs, 0 kinds of wrong answers (" in label and "random" in label for label in labels), labels


def _told(labels: list[str]):
    @contextmanager
    def progress(label: str):
        yield labels.append

    return progress


@pytest.mark.slow
def test_what_is_not_shrunk_waits(stubs, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz_run, "SHRINK_AT_LEAST", -1000)
    run = fuzz(["large_boxes"], tmp_path, rounds=2, seed=4, source=boxes_and_spheres)
    assert run.shrunk == {} and list(run.waiting) == ["large_boxes | false miss | Box | Box | deep"]
    assert run.counts()["large_boxes"]["false miss"] > 4, "counted all the same"
    number, at = run.waiting["large_boxes | false miss | Box | Box | deep"]
    assert boxes_and_spheres(4, number)[at].kinds == ("Box", "Box")
    monkeypatch.setattr(fuzz_run, "SHRINK_AT_LEAST", 5000)
    run = fuzz(["large_boxes"], tmp_path, rounds=3, seed=4, resume=True, source=boxes_and_spheres)
    assert run.waiting == {} and len(run.findings()) == 1 and run.tried > 0
    (found,) = run.findings()
    assert found.is_minimal


@pytest.mark.parametrize("seed", [11])
def test_collide_is_right_about_invented_scenes(seed, tmp_path):
    run = fuzz([], tmp_path, rounds=2, seed=seed)
    assert run.pairs >= 120
    assert run.findings() == [], [found.case.document() for found in run.findings()]
