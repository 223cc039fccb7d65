"""Trajectories proven between their samples: what is proven, where a path collides, and what a check says of it."""

from __future__ import annotations

import csv
import json
from importlib import resources

import numpy as np
import pytest
from slider_scene import MEETS, slider_scene

import collide
import collide.scenes
from collide.cli import main as cli
from collide.reports.trajectory_proof import prove
from collide.reports.trajectory_report import at_start, sample
from collide.scenes import SceneBody
from collide.scenes.loaders.trajectories import Trajectory


def proof_of(*slides, scene=None, clearance=0.0, lift=None, resolution=0.5, times=None) -> dict:
    lift = [0.0] * len(slides) if lift is None else lift
    trajectory = Trajectory("test", [{"slide": s, "lift": z} for s, z in zip(slides, lift)], times)
    scene = at_start(scene or slider_scene(), trajectory)
    return prove(scene, sample(scene, trajectory, resolution), clearance)


def test_a_path_beside_the_post_is_proven_and_one_into_it_names_the_place():
    free = proof_of(0.0, 0.3, 0.1)
    assert free["free"] and free["share"] == 1.0 and free["proven"] == [[0.0, 1.0]] and free["open"] == []
    assert free["text"] == "all of the path is proven free" and free["robot"] == "rail" and free["why"] is None
    hit = proof_of(0.0, 0.25, 1.0)
    first = hit["first_collision"]
    assert not hit["free"] and {first["a"], first["b"]} == {"slider", "post"} and first["distance"] <= 0.0
    assert 0.0 <= first["share"] - MEETS < 2e-3 and first["time"] is None
    assert hit["proven"][0][0] == 0.0 and 0.0 <= MEETS - hit["proven"][-1][1] < 5e-3
    assert "slider and post collide" in hit["text"] or "post and slider collide" in hit["text"]
    assert proof_of(0.0, 1.0, times=[3.0, 5.0])["first_collision"]["time"] == pytest.approx(3.0 + 2.0 * MEETS, abs=5e-3)


def test_what_samples_miss_is_met():
    """A wire of 2 mm across the way, between two samples half a metre apart."""
    scene = slider_scene()
    scene.bodies.append(SceneBody("wire", collide.Capsule(0.001, 1.0), collide.pose((-0.35, 0, 0.5)), static=True))
    lift = [0.5, 0.5]
    path = sample(scene, Trajectory("t", [{"slide": 0.0, "lift": 0.5}, {"slide": -0.8, "lift": 0.5}], None), 0.8)
    assert len(path.share) == 2
    found = proof_of(0.0, -0.8, scene=scene, lift=lift, resolution=0.8)
    first = found["first_collision"]
    assert {first["a"], first["b"]} == {"slider", "wire"} and abs(first["share"] - 0.249 / 0.8) < 2e-3


@pytest.mark.parametrize(("clearance", "is_free"), [(0.05, True), (0.095, True), (0.101, False), (0.18, False)])
def test_a_clearance_is_proven_or_the_place_is_named(clearance, is_free):
    """The slider comes as near as 0.1 m to the crate at 0.35 m."""
    proof = proof_of(0.0, 0.35, clearance=clearance)
    assert proof["free"] == is_free and proof["clearance"] == clearance
    first = proof["first_collision"]
    if is_free:
        assert first is None and f"{1000 * clearance:g} mm and more" in proof["text"]
    else:
        assert {first["a"], first["b"]} == {"slider", "crate"} and 0.0 < first["distance"] <= clearance + 1e-9


def test_one_waypoint_and_standing_still_are_proven_and_a_graze_stays_open():
    assert proof_of(0.2)["free"] and proof_of(0.2, 0.2)["free"]
    graze = proof_of(0.0, MEETS - 1e-13)
    assert not graze["free"] and graze["open"] and graze["first_collision"] is None
    assert {graze["open"][0]["a"], graze["open"][0]["b"]} == {"slider", "post"}
    assert graze["open"][-1]["end"] == 1.0 and "stays open" in graze["text"] and 0.9 < graze["share"] < 1.0


def test_two_robots_at_once_are_not_proven_and_it_is_said():
    scene = slider_scene()
    scene.place_robot(next(iter(scene.placements.values())).robot.renamed("b_"), collide.pose((0, 2, 0)))
    waypoints = [{"slide": 0.0, "b_slide": 0.0}, {"slide": 0.1, "b_slide": 0.1}]
    proof = prove(scene, sample(scene, Trajectory("t", waypoints, None), 0.1))
    assert not proof["free"] and "2 robots move at once" in proof["why"] and proof["text"].startswith("not proven")


# --- the command line -----------------------------------------------------------------------------


@pytest.fixture
def check(monkeypatch, capsys, tmp_path):
    """``check(slides, words...)`` checks a path of the slider; gives status, out and err."""
    monkeypatch.setattr(collide.scenes, "load", lambda *paths, **options: slider_scene())

    def run(slides, *words):
        plan = tmp_path / "plan.csv"
        plan.write_text("\n".join(["slide", *map(str, slides)]) + "\n")
        given = ["--trajectory", str(plan)] if slides else []
        status = cli.main(["check", "rail.yaml", *given, "--ignore", "floor,crate", *words])
        return (status, *capsys.readouterr())

    return run


def test_status_says_whether_the_path_is_proven(check):
    status, out, err = check([0.0, 0.3], "--certify")
    assert (status, out) == (0, "") and "all of the path is proven free" in err
    status, out, _ = check([0.0, 1.0], "--certify")
    assert status == 1 and out.startswith("collision\t")
    status, out, err = check([0.0, MEETS - 1e-13], "--certify")
    assert status == 1 and "unproven\t" in out and "stay" in err
    status, out, err = check([0.0, 0.3], "--certify", "--clearance", "50mm")
    assert status == 0 and out == "" and "50 mm and more" in err
    status, out, err = check([0.0, 0.35], "--certify", "--clearance", "15cm")
    assert status == 1 and any(line.startswith("near\t") for line in out.splitlines())


def test_a_clearance_counts_for_robots_alone(check):
    """Post and crate are 0.18 m from each other, the slider is 0.18 m from the crate, too."""
    status, out, _ = check([], "--clearance", "0.19")
    lines = [line.split("\t")[:3] for line in out.splitlines()]
    assert status == 1 and ["near", "crate", "slider"] in [[w, *sorted(p)] for w, *p in lines]
    status, out, _ = check([], "--clearance", "0.17")
    assert status == 0 and out == ""


@pytest.mark.parametrize(
    ("slides", "words", "complaint"),
    [((), ("--certify",), "give --trajectory"), ((0.0, 0.1), ("--certify", "--min-depth", "1mm"), "leave out")],
)
def test_what_proves_nothing_is_refused(check, slides, words, complaint):
    status, _, err = check(slides, *words)
    assert status == 2 and complaint in err


def test_tables_and_json_hold_the_proof(check, tmp_path):
    table, data = tmp_path / "found.csv", tmp_path / "found.json"
    status, out, _ = check([0.0, 1.0], "--certify", "--csv", str(table), "--json", str(data))
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert status == 1 and [row["what"] for row in rows] == [line.split("\t")[0] for line in out.splitlines()]
    assert {rows[0]["a"], rows[0]["b"]} == {"post", "slider"} and float(rows[0]["distance"]) < 0.0
    read = json.loads(data.read_text())
    proof = read["trajectory"]["proof"]
    assert read["trajectory"]["certified"] is False and proof["robot"] == "rail" and proof["checked"] >= 1
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is in the dev extra")
    schema = json.loads(resources.files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(read)
    check([0.0, 0.3], "--certify", "--json", str(data))
    read = json.loads(data.read_text())
    assert read["trajectory"]["certified"] is True and np.isclose(read["trajectory"]["proof"]["share"], 1.0)
