"""``--html`` of the commands: the page holds what ``--json`` writes, errors come before work."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from parsed_page import Page, small_viewer

from collide.cli import main as cli
from collide.errors import SceneError
from collide.pages import page_file
from collide.scenes import load

TWO_BALLS = """collide: 1
name: two balls
bodies:
  - {name: %s, shape: {sphere: {radius: 1}}}
  - {name: %s, shape: {sphere: {radius: 1}}, pose: {xyz: [1.5, 0, 0]}}
  - {name: far, shape: {sphere: {radius: 1}}, pose: {xyz: [9, 0, 0]}}
"""


@pytest.fixture(autouse=True)
def viewer(monkeypatch, tmp_path):
    monkeypatch.setattr(page_file, "VIEWER", small_viewer(tmp_path / "viewer"))


@pytest.fixture
def scene(tmp_path):
    place = tmp_path / "balls.yaml"
    place.write_text(TWO_BALLS % ("ball", '"</script><b>"'), encoding="utf-8")
    return str(place)


def page(place) -> Page:
    return Page(place.read_bytes().decode())


def timeless(report: dict) -> dict:
    return {key: value for key, value in report.items() if key != "seconds"}


def test_report_is_the_data(scene, tmp_path):
    html, text = tmp_path / "page.html", tmp_path / "page.json"
    assert cli.main(["report", scene, "--clearance", "1", "--quiet", "--html", str(html), "--json", str(text)]) == 0
    made = page(html)
    assert made.data("report") == json.loads(text.read_text(encoding="utf-8"))
    assert made.elements["b"] == 0 and made.texts["title", ""] == "collide report: two balls"
    drawing = made.data("drawing")
    assert drawing["kind"] == "report"
    assert {body["name"]: body["verdict"] for body in drawing["bodies"]} == {
        "ball": "colliding", "</script><b>": "colliding", "far": "free",
    }


def test_check_adds_its_findings(scene, tmp_path, capsys):
    html = tmp_path / "page.html"
    assert cli.main(["check", scene, "--html", str(html)]) == 1
    assert capsys.readouterr().out.startswith("collision\t")
    made = page(html)
    (check,) = made.data("report")["check"]
    assert check["fails"] and not check["against_baseline"] and made.data("drawing")["kind"] == "check"
    (finding,) = check["findings"]
    assert (finding["what"], {finding["a"], finding["b"]}) == ("collision", {"ball", "</script><b>"})
    assert finding["distance"] == pytest.approx(-0.5) and check["verdict"].startswith("1 collision")


def test_comparison_is_the_data(scene, tmp_path):
    pytest.importorskip("fcl", reason="compare asks python-fcl: pip install python-fcl")
    html, text = tmp_path / "page.html", tmp_path / "page.json"
    command = ["compare", scene, "--engines", "fcl", "--quiet", "--html", str(html), "--json", str(text)]
    assert cli.main(command) == 0
    made = page(html)
    assert made.data("report") == json.loads(text.read_text(encoding="utf-8"))
    assert made.data("ours")["verdict"]["collides"] and made.data("drawing")["kind"] == "compare"
    assert made.data("drawing")["bodies"][0]["verdict"] == "colliding"


def test_several_states(tmp_path):
    from slider_scene import slider_scene

    from collide.pages.report_page import report_blocks
    from collide.reports import report
    from collide.reports.state_reports import Stated

    scene = slider_scene()
    made = [Stated(name, (stated := scene.with_state(name)), report.make(stated)) for name in ("home", "hit")]
    read = Page("".join(page_file.page_pieces("t", report_blocks(made, {}))))
    assert [state["name"] for state in read.data("report")["states"]] == ["home", "hit"]


def test_standard_output(scene, capfdbinary):
    assert cli.main(["report", scene, "--html", "-"]) == 0
    out, err = capfdbinary.readouterr()
    assert Page(out.decode()).data("report")["verdict"]["collides"] and not err
    assert cli.main(["report", scene, "--html", "-", "--json", "-"]) == 2
    assert b"standard output" in capfdbinary.readouterr().err


@pytest.mark.parametrize(
    ("place", "complaint"),
    [("", "is a folder"), ("page.txt", "must end in .html"), ("none/page.html", "no folder"), ("balls.yaml", ".html")],
)
def test_places_are_refused_before_the_work(scene, tmp_path, capsys, place, complaint):
    assert cli.main(["report", "no such scene", "--html", str(tmp_path / place)]) == 2
    told = capsys.readouterr().err
    assert complaint in told and told.count("\n") == 1, "one line, and not about the scene"


def test_places_that_cannot_be_written(scene, tmp_path, capsys):
    folder = tmp_path / "closed"
    folder.mkdir()
    place = folder / ("x" * 251 + ".html")
    assert cli.main(["report", scene, "--quiet", "--html", str(place)]) == 2
    assert "too long" in capsys.readouterr().err and not any(folder.iterdir())


def test_pages_are_loaded_where_they_are_asked_for():
    code = (
        "import sys; from collide.cli import main as cli; cli.main(['report', 'workcell', '--quiet'])\n"
        "assert 'collide.reports.report' in sys.modules\n"
        "print([name for name in sys.modules if name.startswith('collide.pages') or 'visual_shapes' in name])"
    )
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert made.stdout.strip() == "[]"


def test_panda_looks_like_itself(tmp_path):
    """Visual meshes stand around their collision meshes, and the page is no larger than it may be."""
    try:
        load("panda_workbench")
    except SceneError as error:
        if "[demo]" in str(error):
            pytest.skip("example-robot-data is not installed")
        raise
    pytest.importorskip("collada", reason="visual meshes of the panda are COLLADA: pip install pycollada")
    from test_drawing import world_points

    html = tmp_path / "page.html"
    assert cli.main(["report", "panda_workbench", "--meshes", "hull", "--quiet", "--html", str(html)]) == 0
    data = page(html).data("drawing")
    links = [k for k, body in enumerate(data["bodies"]) if body["owner"] == "panda"]
    assert len(links) == 11 and not any("drawn as tested" in note for note in data["notes"])
    for k in links:
        assert data["bodies"][k]["tested"] is not None, data["bodies"][k]["name"]
        shown, tested = world_points(data, k), world_points(data, k, "tested")
        for end in (np.min, np.max):
            assert end(shown, axis=0) == pytest.approx(end(tested, axis=0), abs=0.03), data["bodies"][k]["name"]
    assert sum(shape["triangle_count"] for shape in data["shapes"]) <= 120_000 + 20_000
    assert html.stat().st_size < 3_500_000, "the viewer may take 1.5 MB of the 5"


HOSTILE = [
    "<script>alert(1)</script>", "</script><script>alert(1)</script>", "<!--<script>", 'a"b\'c', "a\nb\r\nc", "\x1b[2J",
    "\u202egnp.exe\u202c", "a\u2028b", "\ud800", "&lt;", "x" * 10_000, "</title><b>", '"}]</script>',
]


def test_names_in_scene_files_stay_text(tmp_path):
    """A scene file whose every text is an attack: bodies, robots, links, joints, states, reasons, its own name."""
    bodies = [
        {"name": name, "about": name, "shape": {"sphere": {"radius": 1.0}}, "pose": {"xyz": [1.9 * k, 0, 0]}}
        for k, name in enumerate(HOSTILE)
    ]
    robot = {
        "name": HOSTILE[1],
        "links": [{"name": "base"}, {"name": HOSTILE[0] * 2, "collision": [{"shape": {"box": {"size": [1, 1, 1]}}}]}],
        "joints": [{
            "name": HOSTILE[2], "type": "revolute", "parent": "base", "child": HOSTILE[0] * 2, "limits": [-1, 1],
        }],
        "states": {HOSTILE[3]: {HOSTILE[2]: 0.5}},
    }
    scene = tmp_path / "hostile.json"
    allow = [[HOSTILE[0], HOSTILE[1], HOSTILE[2]]]
    whole = {"collide": 1, "name": HOSTILE[1], "bodies": bodies, "robots": [{"robot": robot}], "allow": allow}
    scene.write_text(json.dumps(whole), encoding="utf-8")
    plain, html = tmp_path / "plain.html", tmp_path / "page.html"
    assert cli.main(["report", "workcell", "--quiet", "--html", str(plain)]) == 0
    for options in (["--clearance", "1"], ["--state", HOSTILE[3]]):
        assert cli.main(["report", str(scene), "--quiet", "--html", str(html), *options]) == 0
        made = page(html)
        assert made.elements == page(plain).elements and made.comments == []
        names = [body["name"] for body in made.data("drawing")["bodies"]]
        assert set(names) == {*HOSTILE, HOSTILE[0] * 2}
        report = made.data("report")
        assert report["scene"]["name"] == HOSTILE[1] and report["scene"]["robots"] == [HOSTILE[1]]
        assert {pair[side] for pair in report["colliding"] for side in "ab"} <= set(names)
        assert len(report["colliding"]) >= 10, "balls overlap"
        assert HOSTILE[2] in {entry["reason"] for entry in report["skipped"]}
        assert {entry[side] for entry in made.data("contacts") for side in "ab"} <= set(names)
