"""The commands solid, cells and obstacle: what they write, judged by closed forms, what they say and refuse."""

from __future__ import annotations

import json

import numpy as np
import pytest
import surfaces

import collide
from collide.cli import arguments
from collide.cli.files import MESH_SUFFIXES
from collide.cli.main import main
from collide.scenes import load
from collide.scenes.loaders.triangles import read_triangles
from collide.shapes.mesh_formats import SUFFIXES


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A cube, a post through it, a scene of both with a floor, and a cube without a lid, in the working folder."""
    monkeypatch.chdir(tmp_path)
    collide.Mesh(*surfaces.box()).save("cube.stl")
    collide.Mesh(*surfaces.box((0.25, 0.25, -1), (0.75, 0.75, 2))).save("post.obj")
    vertices, faces = surfaces.box()
    collide.Mesh(vertices, faces[:-2]).save("open.stl")
    scene = {
        "collide": 1,
        "bodies": [
            {"name": "box", "shape": {"box": {"size": [1, 1, 1]}}, "pose": {"xyz": [0.5, 0.5, 0.5]}},
            {"name": "ball", "shape": {"sphere": {"radius": 0.5}}, "pose": {"xyz": [3, 0, 0]}},
            {"name": "floor", "shape": {"halfspace": {"normal": [0, 0, 1], "offset": -1}}, "static": True},
        ],
    }
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    return tmp_path


def told(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("operation", "volume"),
    [("union", 1.5), ("intersection", 0.25), ("difference", 0.75), ("symmetric_difference", 1.25)],
)
@pytest.mark.parametrize("suffix", [".stl", ".3mf"])
def test_booleans_of_files(operation, volume, suffix, files, capsys):
    assert main(["solid", "cube.stl", operation, "post.obj", "--out", f"r{suffix}", "--json", "-"]) == 0
    answer = told(capsys)
    assert answer["volume"] == volume and answer["operation"] == operation and answer["crossing"] == 0
    ((_, vertices, faces),), _ = read_triangles(files / f"r{suffix}")
    read = collide.Mesh(vertices, faces)
    assert read.solid and read.volume == volume and len(faces) == answer["facets"]
    assert sum(answer["facets_of"].values()) == answer["facets"]


def test_b_stands_where_it_is_put(files, capsys):
    assert main(["solid", "cube.stl", "intersection", "cube.stl", "--pose", "-0.5,0,0", "--out", "r.ply"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("r.ply: cube intersection cube: 12 facets, 0.5 m³, moved by ") and said.count("\n") == 1
    assert load("r.ply").bodies[0].shape.points[:, 0].max() == 0.5
    quarter = ["--pose", "0,0,0,0,0,0.7853981633974483", "--out", "r.ply"]
    assert main(["solid", "cube.stl", "union", "cube.stl", *quarter]) == 0
    common = 0.5 - 0.5 * (2 - np.sqrt(2)) * (1 - np.sqrt(0.5))  # half a square without a corner
    assert load("r.ply").bodies[0].shape.volume == pytest.approx(2 - common)


def test_an_empty_result_is_a_finding(files, capsys):
    arguments_ = ["solid", "cube.stl", "difference", "cube.stl", "--out", "r.ply"]
    assert main(arguments_) == 1
    assert capsys.readouterr().out == "cube difference cube is empty: nothing was written\n"
    assert not (files / "r.ply").exists()
    assert main([*arguments_, "--json", "-"]) == 1 and told(capsys)["empty"] is True


def test_curved_shapes_need_a_tolerance_and_a_floor_is_left_out(files, capsys):
    line = ["solid", "scene.json", "union", "cube.stl", "--out", "r.off"]
    assert main(line) == 2
    said = capsys.readouterr().err
    assert "scene: ball: Sphere is rounded and has no facets" in said and "--tolerance 1mm" in said
    assert main([*line, "--tolerance", "1mm"]) == 2
    assert "floor" in (said := capsys.readouterr().err) and "--without leaves a body out" in said
    assert main([*line, "--tolerance", "1mm", "--without", "floor", "--json", "-"]) == 0
    ball = 4 / 3 * np.pi * 0.125
    assert 1.0 + ball - np.pi * 1e-3 < told(capsys)["volume"] < 1.0 + ball
    assert main([*line, "--without", "ceiling"]) == 2
    assert "no body has the name 'ceiling'; there are ball, box, cube, floor" in capsys.readouterr().err


def test_a_surface_is_refused_and_repaired_on_request(files, capsys):
    line = ["solid", "open.stl", "union", "post.obj", "--out", "r.ply"]
    assert main(line) == 2
    said = capsys.readouterr().err
    assert "open: open has no inside: open edges" in said and "--repair makes a solid of it where that is safe" in said
    vertices, faces = surfaces.box()
    turned = faces.copy()
    turned[3] = turned[3, ::-1]
    collide.Mesh(vertices, turned).save("turned.stl")
    assert main(["solid", "turned.stl", "union", "post.obj", "--out", "r.ply", "--repair"]) == 0


def test_cells_fill_the_solid_or_the_rest_of_the_box(files, capsys):
    main(["solid", "cube.stl", "difference", "post.obj", "--out", "ring.ply", "--quiet"])
    assert main(["cells", "ring.ply", "--out", "c.json", "--json", "-"]) == 0
    summary, graph = told(capsys), json.loads((files / "c.json").read_text())
    assert summary["cells"] == len(graph["convex_cells"]) >= 4 and summary["portals"] == len(graph["portals"]) >= 4
    assert sum(cell["volume"] for cell in graph["convex_cells"]) == pytest.approx(0.75)
    for cell in graph["convex_cells"]:
        vertices = np.array(cell["vertices"])
        middle = vertices.mean(axis=0)
        for face in cell["faces"]:  # counter-clockwise from outside: every corner is behind every face
            a, b, c = vertices[face[:3]]
            normal = np.cross(b - a, c - a)
            assert ((vertices - a) @ normal <= 1e-12).all() and (middle - a) @ normal < 0.0
    for door in graph["portals"]:
        assert door["area"] > 0.0 and door["cells"][0] < door["cells"][1] < summary["cells"]
    for suffix in MESH_SUFFIXES[:-1]:
        box = ["--free", "--box", "-1,-1,-1,2,2,2"]
        assert main(["cells", "ring.ply", *box, "--out", f"f{suffix}", "--json", "-"]) == 0
        summary = told(capsys)
        assert summary["volume"] == pytest.approx(27 - 0.75) and summary["box"] == [[-1.0] * 3, [2.0] * 3]
        parts = load(f"f{suffix}").bodies
        assert sum(body.shape.volume for body in parts) == pytest.approx(27 - 0.75)
    assert main(["cells", "ring.ply", "--free", "--out", "f.ply", "--json", "-"]) == 0
    assert told(capsys)["volume"] == pytest.approx(1.2**3 - 0.75)
    assert main(["cells", "ring.ply", "--box", "0,0,0,1,1,1", "--out", "f.ply"]) == 2
    assert "give --free too" in capsys.readouterr().err


def test_obstacles_are_minkowski_sums(files, capsys):
    to_file = ["--out", "o.ply", "--json", "-"]
    assert main(["obstacle", "cube.stl", "post.obj", *to_file]) == 0
    assert told(capsys)["volume"] == pytest.approx(1.5 * 1.5 * 4.0)
    assert main(["obstacle", "cube.stl", "post.obj", "--rpy", "0,0.7853981633974483,0", *to_file]) == 0
    # in the plane of x and z a square and a turned rectangle: areas, and half the perimeters' mixed terms
    turned = 1.0 + 1.5 + (0.5 + 3.0) * np.sqrt(2)
    assert told(capsys)["volume"] == pytest.approx(1.5 * turned)
    line = ["obstacle", "scene.json", "cube.stl", "--without", "floor", "--without", "ball", *to_file]
    assert main(line) == 0
    assert told(capsys)["volume"] == pytest.approx(8.0)
    corner = load("o.ply").bodies[0].shape.points.min(axis=0)
    assert np.allclose(corner, -1.0)


@pytest.mark.parametrize("command", [["solid", "cube.stl", "union", "post.obj"], ["cells", "cube.stl"],
                                     ["obstacle", "cube.stl", "post.obj"]])
def test_places_are_checked_before_the_work(command, files, capsys):
    for place, words in (
        ("r.step", "must end in one of .stl, .ply, .obj, .off, .3mf, .glb"), ("cube.stl", "'cube.stl' is what is read"),
        ("no/r.stl", "there is no folder"), ("", "must end in one of"),
    ):
        assert main([*command, "--out", place]) == 2
        assert words in capsys.readouterr().err, place
    assert main(command) == 2 and "--out" in capsys.readouterr().err
    assert main([*command, "--out", "r.stl", "--scale", "none"]) == 2 and "--scale" in capsys.readouterr().err
    assert main(["solid", "cube.stl", "minus", "post.obj", "--out", "r.stl"]) == 2
    assert "difference" in capsys.readouterr().err
    assert main(["solid", "cube.stl", "union", "post.obj", "--pose", "1,2", "--out", "r.stl"]) == 2
    assert "must be 3 or 6 numbers separated by commas, got '1,2'" in capsys.readouterr().err


def test_a_page_shows_the_result(files, capsys):
    assert main(["solid", "cube.stl", "union", "post.obj", "--out", "r.stl", "--html", "r.html", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    page = (files / "r.html").read_text()
    assert "<title>collide solid: cube union post</title>" in page and '"cube union post"' in page


def test_each_help_has_three_examples_that_parse():
    for command in ("solid", "cells", "obstacle"):
        (actions,) = [action for action in arguments.parser()._actions if action.dest == "command"]
        lines = [line.strip() for line in actions.choices[command].epilog.splitlines() if line.startswith("  collide")]
        assert len(lines) == 3
        for line in lines:
            assert arguments.parse(line.split()[1:]).command == command


def test_suffixes_are_those_of_meshes():
    assert set(MESH_SUFFIXES) == set(SUFFIXES)
