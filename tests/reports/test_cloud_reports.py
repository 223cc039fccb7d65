"""Every command on a scene with a cloud: pairs name the row of the point, and what has no answer says why."""

from __future__ import annotations

import json
import re
from importlib.resources import files

import numpy as np
import pytest

import collide
from collide.adapters.peers.compare import compare
from collide.adapters.peers.question import Question
from collide.cli.main import main
from collide.errors import UnsupportedQuery
from collide.scenes import load
from collide.sweeps.link_bodies import link_bodies

RADIUS, BALL, CENTRE = 0.01, 0.1, np.array([1.2, 0.0, 0.0])
POINTS = np.random.default_rng(5).uniform(-1, 1, (4000, 3))
#: An arm whose hand is a ball, moved along x into the cloud.
ARM = {
    "name": "arm",
    "links": [{"name": "base"}, {"name": "hand", "collision": [{"shape": {"sphere": {"radius": BALL}}}]}],
    "joints": [{
        "name": "slide", "type": "prismatic", "parent": "base", "child": "hand", "axis": [1, 0, 0], "limits": [-1, 1],
    }],
    "states": {"home": {"slide": 0}, "inside": {"slide": -0.5}},
}


@pytest.fixture
def place(tmp_path):
    collide.PointCloud(POINTS, RADIUS).save(tmp_path / "scan.npz")
    bodies = [
        {"name": "scan", "shape": {"cloud": {"file": "scan.npz"}}},
        {"name": "floor", "shape": {"halfspace": {"normal": [0, 0, 1], "offset": -1.5}}, "static": True},
    ]
    robots = [{"robot": ARM, "pose": {"xyz": CENTRE.tolist()}}]
    (tmp_path / "s.json").write_text(json.dumps({"collide": 1, "robots": robots, "bodies": bodies}))
    return tmp_path / "s.json"


def test_a_report_names_the_point(place, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    jsonschema = pytest.importorskip("jsonschema")
    out, page = place.with_name("out.json"), place.with_name("page.html")
    options = ["--clearance", "0.9", "--all", "--proofs", "--geometry", "--json", str(out), "--html", str(page)]
    assert main(["report", str(place), *options]) == 0
    data = json.loads(out.read_text())
    jsonschema.validate(data, json.loads(files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8")))
    near = next(row for row in data["near"] if {row["a"], row["b"]} == {"hand", "scan"})
    away = np.linalg.norm(POINTS - CENTRE, axis=1)
    side = "a" if near["a"] == "scan" else "b"
    assert near[f"part_{side}"] == away.argmin(), "the nearest point, by brute force"
    assert near["lower"] <= away.min() - RADIUS - BALL + 1e-12 and near["upper"] >= away.min() - RADIUS - BALL - 1e-12
    assert f"{near['part_a']}, {near['part_b']}" in capsys.readouterr().out, "the terminal's column of parts"
    shape = next(shape for shape in data["geometry"]["shapes"] if shape["kind"] == "PointCloud")
    assert shape["parameters"]["points"] == POINTS.tolist() and shape["parameters"]["radius"] == RADIUS
    assert shape["deviation"] is None and not shape["faces"]
    drawing = json.loads(re.search(r'id="drawing">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)[1])
    assert next(body["kind"] for body in drawing["bodies"] if body["name"] == "scan") == "PointCloud"


def test_collisions_states_checks_and_paths(place, capsys):
    out, plan = place.with_name("out.json"), place.with_name("plan.csv")
    plan.write_text("slide\n0\n-0.5\n")
    assert main(["report", str(place), "--state", "home,inside", "--json", str(out)]) == 0
    home, inside = json.loads(out.read_text())["states"]
    assert not home["report"]["colliding"] and len(inside["report"]["colliding"]) == 1
    hit, at = inside["report"]["colliding"][0], CENTRE - (0.5, 0, 0)
    met = np.flatnonzero(np.linalg.norm(POINTS - at, axis=1) < RADIUS + BALL)
    assert len(met) and hit["part_a" if hit["a"] == "scan" else "part_b"] in met
    assert inside["report"]["overlaps"] == [], "balls are curved"
    assert main(["check", str(place)]) == 0
    assert main(["check", str(place), "--state", "inside"]) == 1
    assert main(["report", str(place), "--trajectory", str(plan), "--html", str(place.with_name("path.html"))]) == 0
    assert "COLLIDING ALONG THE PATH" in capsys.readouterr().out


def test_engines_without_clouds_say_so(place, capsys):
    scene = load(place)
    question = Question.from_scene(scene)
    assert len(question.pairs) == 3, "the box around all balls decides who is near"
    comparison = compare(scene, engines=("exact",))
    ours, exact = comparison.summaries
    assert ours.answered == 3 and exact.unsupported["not judged: PointCloud has no exact form here"] == 2
    assert main(["compare", str(place), "--engines", "exact"]) == 0
    assert "exact was not asked about 3 pairs: not judged: PointCloud has no exact form" in capsys.readouterr().out


def test_what_has_no_triangles_says_so():
    cloud, box = collide.PointCloud(POINTS, RADIUS), collide.Box((1, 1, 1))
    with pytest.raises(UnsupportedQuery, match="PointCloud has no triangles: it is balls around points"):
        collide.tessellate(cloud)
    with pytest.raises(UnsupportedQuery, match=r"overlap_volume: B: a PointCloud is no solid with facets$"):
        collide.overlap_volume(box, cloud, np.eye(4), np.eye(4))


def test_a_link_may_be_a_cloud(place):
    robot = load(place).placements["arm"].robot
    links = [*ARM["links"], {"name": "scanned", "collision": [{"shape": {"cloud": {"points": POINTS.tolist()}}}]}]
    document = {"collide": 1, "robots": [{"robot": {**ARM, "links": links, "joints": [
        *ARM["joints"], {"name": "weld", "type": "fixed", "parent": "hand", "child": "scanned"}]}}]}
    place.write_text(json.dumps(document))
    scanned = load(place).placements["arm"].robot
    hand, cloud = link_bodies(scanned)
    assert hand.shape == link_bodies(robot)[0].shape and cloud.shape == collide.PointCloud(POINTS)
    hull = cloud.hull
    assert isinstance(hull, collide.ConvexHull) and np.array_equal(hull.points, POINTS) and hull.radius == 0.0
