"""`collide check` against a baseline, as JUnit, with pairs ignored; the geometry in the JSON; folded lists."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from slider_scene import slider_scene

import collide
import collide.scenes
from collide import Box, Compound, Halfspace, Mesh, Sphere, pose
from collide.cli import main as cli
from collide.reports import checking, report, terminal
from collide.reports import pair_classes as pairs
from collide.reports import scene_geometry as geometry
from collide.scenes import Scene, SceneBody


def stacked(*depths, extra=()) -> Scene:
    """Pairs of cubes of 1 m, pair k overlapping by depths[k]; a gap where that is negative."""
    cube = Box((1, 1, 1))
    bodies = [
        SceneBody(f"{which} {k}", cube, pose((5 * k, 0, z)))
        for k, depth in enumerate(depths) for which, z in (("low", 0.0), ("high", 1.0 - depth))
    ]
    return Scene("stack", [*bodies, *extra])


@pytest.fixture
def command(monkeypatch, capsys):
    """``command(scene, words...)`` runs one on a scene; gives status, out and err."""

    def run(scene, *words):
        monkeypatch.setattr(collide.scenes, "load", lambda *paths, **options: scene)
        status = cli.main([words[0], "scene.yaml", *map(str, words[1:])])
        return (status, *capsys.readouterr())

    return run


# --- baselines ----------------------------------------------------------------------------------


@pytest.mark.parametrize("written_by", ["--write-baseline", "--json"])
def test_only_new_collisions_fail(command, tmp_path, written_by):
    known = tmp_path / "known.json"
    status, _, _ = command(stacked(0.1, 0.2, -0.5), "check", written_by, known)
    assert status == (0 if written_by == "--write-baseline" else 1)
    status, out, err = command(stacked(0.1, 0.2, -0.5), "check", "--baseline", known)
    assert status == 0 and [line.split("\t")[0] for line in out.splitlines()] == ["known", "known"]
    assert "no new collision, 2 known" in err
    status, out, err = command(stacked(0.1, 0.2, 0.3), "check", "--baseline", known)
    assert status == 1 and "collision\tlow 2\thigh 2\t-0.3" in out and "1 new collision, 2 known" in err


def test_a_known_collision_that_got_deeper_is_new_and_said(command, tmp_path):
    known = tmp_path / "known.json"
    command(stacked(0.1, 0.2), "check", "--write-baseline", known)
    status, out, err = command(stacked(0.10005, 0.2), "check", "--baseline", known)
    assert status == 0, "0.05 mm is within the usual 0.1 mm"
    status, out, err = command(stacked(0.15, 0.2), "check", "--baseline", known)
    assert status == 1 and out.startswith("deeper\tlow 0\thigh 0\t-0.15")
    assert "1 known and deeper than before" in err and "low 0 and high 0: 150 mm deep, was 100 mm" in err
    assert command(stacked(0.15, 0.2), "check", "--baseline", known, "--baseline-tolerance", "6cm")[0] == 0
    assert command(stacked(0.10005, 0.2), "check", "--baseline", known, "--baseline-tolerance", "0.01mm")[0] == 1


def test_a_collision_as_deep_as_the_tolerance_allows_is_known():
    made = report.make(stacked(0.5))
    (depth,) = (-pair.distance for pair in made.colliding)
    for less, what in ((0.25, checking.KNOWN), (0.25 + 2.0**-40, checking.DEEPER)):
        entry = checking.Finding(checking.COLLISION, "low 0", "high 0", less - depth)
        known = checking.Baseline({"": {checking._key(entry): entry}})
        found = checking.check(made, "", touching_counts=False, known=known, tolerance=0.25)
        assert [finding.what for finding in found.findings] == [what]


def test_gone_collisions_are_told(command, tmp_path):
    known = tmp_path / "known.json"
    command(stacked(0.1, 0.2), "check", "--write-baseline", known)
    status, out, err = command(stacked(0.1, -0.2), "check", "--baseline", known)
    assert status == 0 and "gone\tlow 1\thigh 1\t-0.19999999999999996\n" in out and "1 known, 1 gone" in err


def test_the_order_of_a_pair_does_not_matter(command, tmp_path):
    known = tmp_path / "known.json"
    command(stacked(0.1), "check", "--write-baseline", known)
    turned = stacked(0.1)
    turned.bodies.reverse()
    assert command(turned, "check", "--baseline", known)[0] == 0


def test_touching_pairs_are_known_where_they_count(command, tmp_path):
    known = tmp_path / "known.json"
    assert command(stacked(0.0), "check", "--touching-is-collision")[0] == 1
    command(stacked(0.0), "check", "--write-baseline", known)
    assert command(stacked(0.0), "check", "--baseline", known, "--touching-is-collision")[0] == 0
    # known to touch is not known to collide
    status, out, _ = command(stacked(5e-5), "check", "--baseline", known)
    assert status == 1 and out.startswith("collision\t")


def test_baselines_are_sorted_and_one_a_line(command, tmp_path):
    known = tmp_path / "known.json"
    command(stacked(0.1, 0.3, 0.2), "check", "--write-baseline", known)
    text = known.read_text()
    data = json.loads(text)
    assert data["schema"] == checking.SCHEMA and [entry["a"] for entry in data["collisions"]] == [
        "low 0",
        "low 1",
        "low 2",
    ]
    assert len(text.splitlines()) == 8
    command(stacked(-0.1), "check", "--write-baseline", known)
    assert json.loads(known.read_text())["collisions"] == []


@pytest.mark.parametrize(
    "text, words",
    [("{", "is not JSON"), ("[]", "neither a baseline"), ('{"schema": "other/1"}', "neither a baseline"),
     ('{"schema": "collide-baseline/1"}', "damaged"),
     ('{"schema": "collide-baseline/1", "collisions": [{"a": 1}]}', "damaged"),
     ('{"schema": "collide-baseline/1", "collisions": [{"class": "x", "a": "b", "b": "c", "depth": 1}]}', "damaged"),
     ('{"schema": "collide-baseline/1", "collisions": [{"class": "collision", "a": "b", "b": "c", "depth": "deep"}]}',
      "damaged"),
     ('{"schema": "collide-report/3", "colliding": 4}', "damaged")],
)
def test_what_is_no_baseline_is_refused_before_the_work(command, tmp_path, text, words):
    (tmp_path / "b.json").write_text(text)
    status, out, err = command(None, "check", "--baseline", tmp_path / "b.json")
    assert status == 2 and out == "" and words in err and err.count("\n") == 1


def test_a_baseline_never_overwrites_a_scene(command, tmp_path):
    victim = tmp_path / "scene.json"
    victim.write_text('{"collide": 1}')
    assert command(stacked(0.1), "check", "--write-baseline", victim)[0] == 2
    assert victim.read_text() == '{"collide": 1}'
    assert command(stacked(0.1), "check", "--junit", tmp_path / "scene.yaml")[0] == 2


# --- JUnit --------------------------------------------------------------------------------------


def test_junit_has_a_case_for_every_body(command, tmp_path):
    file = tmp_path / "out.xml"
    odd = SceneBody('<a> & "b"\x1b', Sphere(0.1), pose((0, 5, 0)))
    assert command(stacked(0.1, -0.5, 0.0, extra=[odd]), "check", "--junit", file)[0] == 1
    suites = ET.parse(file).getroot()
    (suite,) = suites
    cases = suite.findall("testcase")
    assert [suites.get(k) for k in ("tests", "failures", "errors")] == ["7", "2", "0"]
    assert [suite.get(k) for k in ("name", "tests", "failures", "errors")] == ["stack", "7", "2", "0"]
    failed = {
        case.get("name"): case.find("failure").get("message") for case in cases if case.find("failure") is not None
    }
    assert failed == {"low 0": "collision with high 0: 100 mm deep", "high 0": "collision with low 0: 100 mm deep"}
    assert cases[-1].get("name") == '<a> & "b"\\x1b'
    assert "touching with high 2" in next(case for case in cases if case.get("name") == "low 2").find("system-out").text


def test_junit_passes_what_the_baseline_knows(command, tmp_path):
    known, file = tmp_path / "known.json", tmp_path / "out.xml"
    command(stacked(0.1), "check", "--write-baseline", known)
    assert command(stacked(0.1, 0.2), "check", "--baseline", known, "--junit", file)[0] == 1
    cases = {case.get("name"): case for case in ET.parse(file).getroot().iter("testcase")}
    assert {name for name, case in cases.items() if case.find("failure") is not None} == {"low 1", "high 1"}
    assert "known with high 0" in cases["low 0"].find("system-out").text


def test_junit_tells_what_is_not_known(tmp_path):
    check = checking.Check("", "s", ["a", "b", "c"], "", unanswered=[{"a": "a", "b": "b", "why": "no way"}])
    from collide.reports import junit

    root = ET.fromstring("".join(junit.text([check])))
    assert root.get("errors") == "2" and "with b is not known: no way" in root.find(".//testcase[@name='a']/error").get(
        "message"
    )


# --- ignored pairs ------------------------------------------------------------------------------


def test_ignored_pairs_are_not_tested_and_said(command):
    status, out, err = command(stacked(0.1, 0.2), "check", "--ignore", "high 0,low 0")
    assert status == 1 and "low 0" not in out and "1 ignored" in err
    status, out, err = command(stacked(0.1, 0.2), "check", "--ignore", "high 0,low 0", "--ignore", "low 1,high 1")
    assert (status, out) == (0, "") and "2 ignored" in err
    status, out, _ = command(stacked(0.1), "report", "--ignore", "low 0,high 0", "--json", "-")
    data = json.loads(out)
    assert data["query"]["ignored"] == [["low 0", "high 0"]] and data["skipped"] == [
        {"reason": "ignored", "pairs": 1, "meaning": "named by --ignore"}
    ]


@pytest.mark.parametrize("words, complaint", [("low 0", "takes two bodies"), ("low 0,hgih 0", "did you mean high 0"),
                                              ("low 0,low 0", "twice"), ("moon,sun", "no body 'moon'")])
def test_names_to_ignore_are_checked(command, words, complaint):
    status, _, err = command(stacked(0.1), "check", "--ignore", words)
    assert status == 2 and complaint in err


def test_names_may_hold_commas(command):
    scene = stacked(0.1)
    for body, name in zip(scene.bodies, ("a,b", "c,d")):
        body.name = name
    assert command(scene, "check", "--ignore", "a,b,c,d")[0] == 0


# --- the first page -----------------------------------------------------------------------------


def text_of(lines) -> list[str]:
    return ["".join(text for text, _ in line) for line in lines]


def crowded() -> Scene:
    """A hand among 22 links, all of which it meets; and two links that meet each other."""
    links = [SceneBody(f"link{k:02}", Sphere(0.1), pose((0.4 * k, 0, 0.0))) for k in range(22)]
    loose = [SceneBody(name, Box((1, 1, 1)), pose((0, 20, z))) for name, z in (("crate", 0), ("lid", 0.99))]
    return Scene("crowd", [SceneBody("hand", Box((30, 1, 1)), pose()), *links, *loose])


def test_pairs_that_share_a_body_are_one_row():
    made = report.make(crowded())
    lines = text_of(terminal.render(made, width=100))
    assert len(made.colliding) == 23
    (row,) = [line for line in lines if "hand" in line.split() and "mm" in line]
    assert "+21" in row.split() and any("+: also hand with 21 more" in line for line in lines)
    assert any("crate" in line and "10.000 mm" in line for line in lines)
    everything = text_of(terminal.render(made, everything=True, width=100))
    assert sum("hand" in line.split() for line in everything) == 22


def test_few_pairs_of_a_body_keep_a_row_each():
    scene = crowded()
    scene.bodies = scene.bodies[: 1 + 4] + scene.bodies[-2:]
    assert sum("hand" in line.split() for line in text_of(terminal.render(report.make(scene)))) == 4


@pytest.mark.parametrize("seed", range(5))
def test_folding_tells_every_pair_once(seed):
    """Against a slow account of the same rule."""
    rng = np.random.default_rng(seed)
    found = report.make(
        Scene("many", [SceneBody(f"b{k}", Sphere(1.0), pose(rng.uniform(-2.2, 2.2, 3))) for k in range(25)])
    ).colliding
    assert len(found) > 60
    folds, more = found.folded(4, 1000)
    assert more == 0 and sum(fold.size for fold in folds) == len(found)
    left, k = list(found), 0
    while left:
        first = left[0]
        counts = [sum(body in (pair.a, pair.b) for pair in left) for body in (first.a, first.b)]
        body = first.b if counts[1] > counts[0] else first.a
        told = [pair for pair in left if body in (pair.a, pair.b)] if max(counts) > 4 else [first]
        assert (folds[k].pair, folds[k].size) == (first, len(told))
        left, k = [pair for pair in left if pair not in told], k + 1
    assert found.folded(4, 3)[1] == len(found) - sum(fold.size for fold in folds[:3])


def test_contacts_meshes_and_notes_take_a_line_each():
    corners, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    extra = [
        SceneBody("solid", Mesh(corners, faces), pose((0, 50, 0))),
        SceneBody("sheet", Mesh(corners, faces[:3]), pose((0, 60, 0))),
    ]
    scene = stacked(*[0.0] * 20, extra=extra)
    scene.notes += ["joint a is outside its limits", "joint b is too"]
    lines = text_of(terminal.render(report.make(scene), width=120))
    assert any(
        line.strip().startswith("touching  ") and "20 pairs, gap or overlap at most 0.000 mm" in line for line in lines
    )
    assert any("2 as they are" in line and "sheet is a surface of 3 facets without an inside" in line for line in lines)
    notes = [k for k, line in enumerate(lines) if " ".join(line.split()) == "notes joint a is outside its limits"]
    assert len(notes) == 1 and lines[notes[0] + 1].strip() == "joint b is too"
    assert len(lines) < 13 and not any("HOW EACH" in line or line.startswith("TIME") for line in lines)


def test_never_tested_pairs_are_told_on_every_page():
    made = report.make(slider_scene())
    for shown in ({}, {"everything": True}, {"proofs": True}, {"everything": True, "proofs": True}):
        assert any("static–static" in line for line in text_of(terminal.render(made, **shown))), shown


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_page_of_a_crowd_fits(width):
    for shown in ({}, {"proofs": True}):
        assert max(map(len, text_of(terminal.render(report.make(crowded()), width=width, **shown)))) <= width


def test_a_page_looks_at_few_pairs_of_many(monkeypatch):
    """2,000 equal spheres took 75 s, nearly all of it making two million pairs readable that nobody reads."""
    made = []
    real = pairs.Pair.__init__
    monkeypatch.setattr(pairs.Pair, "__init__", lambda self, *values: (made.append(1), real(self, *values))[1])
    rng = np.random.default_rng(0)
    ball = Sphere(1.0)
    found = report.make(
        Scene("crowd", [SceneBody(f"ball {k}", ball, pose(rng.uniform(-0.4, 0.4, 3))) for k in range(150)])
    )
    terminal.render(found)
    assert len(found.colliding) == 150 * 149 // 2 and 0 < len(made) < 100


def test_pairs_are_a_sequence():
    found = report.make(stacked(0.3, 0.1, 0.2)).colliding
    assert [pair.depth for pair in found] == pytest.approx([0.3, 0.2, 0.1]) and len(found) == 3
    assert found[0] == found[:2][0] == next(iter(found)) and found[-1] == list(found)[2]
    with pytest.raises(IndexError):
        found[3]
    assert list(found.dicts())[1] == vars(found[1])


# --- geometry and files -------------------------------------------------------------------------


def test_geometry_is_enough_to_draw_every_body():
    ball = Sphere(0.25)
    corners, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    scene = Scene("things", [
        SceneBody("one", ball, pose((1, 2, 3))), SceneBody("two", ball, pose((4, 5, 6), rpy=(0.1, 0.2, 0.3))),
        SceneBody("floor", Halfspace((0, 0, 1), -2.0), pose(), static=True),
        SceneBody("part", Mesh(corners, faces), pose()),
        SceneBody("both", Compound([(ball, pose((0, 0, 1))), (Box((1, 1, 1)), pose())]), pose((9, 9, 9))),
    ])
    data = json.loads(json.dumps(geometry.of_scene(scene), allow_nan=False))
    bodies, shapes = {body["name"]: body for body in data["bodies"]}, data["shapes"]
    assert bodies["one"]["shape"] == bodies["two"]["shape"] and len(shapes) == 4
    assert bodies["two"]["X_WB"] == scene.bodies[1].X_WB.tolist()
    sphere = shapes[bodies["one"]["shape"]]
    assert (sphere["kind"], sphere["parameters"]) == ("Sphere", {"radius": 0.25}) and 0 < sphere["deviation"] <= 0.0025
    assert np.allclose(np.linalg.norm(sphere["vertices"], axis=1), 0.25)
    part = shapes[bodies["part"]["shape"]]
    assert (part["vertices"], part["faces"], part["parameters"]) == (corners, faces, {"solid": True})
    floor = shapes[bodies["floor"]["shape"]]
    assert (
        floor["parameters"] == {"normal": [0, 0, 1], "offset": -2.0} and np.ptp(np.array(floor["vertices"])[:, 0]) > 9
    )
    both = shapes[bodies["both"]["shape"]]["parameters"]["items"]
    assert [item["kind"] for item in both] == ["Sphere", "Box"] and both[0]["X_CS"][2][3] == 1


def test_geometry_belongs_to_json(command, tmp_path):
    assert command(stacked(0.1), "report", "--geometry")[0] == 2
    assert command(stacked(0.1), "report", "--geometry", "--json", tmp_path / "r.json")[0] == 0
    data = json.loads((tmp_path / "r.json").read_text())
    assert data["geometry"]["shapes"][0]["kind"] == "Box" and "geometry" not in json.loads(
        command(stacked(0.1), "report", "--json", "-")[1]
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("option", ["--json", "--junit", "--write-baseline"])
def test_a_full_disk_is_told_with_the_name_of_the_file(command, option):
    status, _, err = command(stacked(0.1), "check", option, "/dev/full")
    assert status == 2 and "/dev/full: No space left on device" in err and "bug" not in err


def test_numbers_in_errors_are_plain():
    with pytest.raises(collide.InvalidShape, match=r"size\.x must be ≥ 0, got -1\.0$"):
        Box((-1, 1, 1))


# --- what was skipped ---------------------------------------------------------------------------


def test_free_is_not_said_of_meshes_that_were_skipped(tmp_path, capsys):
    """What was left out on demand is named, in the report and its JSON too, and is an error unless allowed."""
    element = '<collision><geometry><mesh filename="gone.stl"/></geometry></collision>'
    ball = '<collision><geometry><sphere radius="1"/></geometry></collision>'
    robot = tmp_path / "r.urdf"

    def run(*words):
        status = cli.main([*map(str, words)])
        return (status, *capsys.readouterr())

    robot.write_text(f'<robot name="r"><link name="a">{element}</link></robot>')
    status, out, err = run("check", robot, "--missing-meshes", "skip")
    assert status == 2 and 'not checked: r.urdf: link "a" has no collision mesh gone.stl' in err
    assert "1 mesh missing, NOT CHECKED" in err and "--allow-missing-meshes" in err
    status, out, err = run("check", robot, "--missing-meshes", "skip", "--allow-missing-meshes", "--json", "-")
    assert status == 0 and "not checked: r.urdf" in err
    assert json.loads(out)["missing_meshes"] == [
        'r.urdf: link "a" has no collision mesh gone.stl: that link is NOT checked by it'
    ]
    status, out, err = run("report", robot, "--missing-meshes", "skip")
    assert status == 0 and "1 mesh missing, NOT CHECKED" in out and "gone.stl" in out
    robot.write_text(
        f'<robot name="r"><link name="a">{element}{ball}</link><link name="b">{ball}</link><link name="c"/>'
        '<joint name="j" type="continuous"><parent link="a"/><child link="c"/></joint>'
        '<joint name="k" type="prismatic"><parent link="c"/><child link="b"/><axis xyz="1 0 0"/>'
        '<limit lower="0" upper="9"/></joint></robot>'
    )
    assert run("check", robot, "--missing-meshes", "skip")[0] == 1, "a collision is one, whatever was skipped"
    assert run("check", robot, "--missing-meshes", "skip", "--state", "0,5")[0] == 2
    assert "--allow-missing-meshes" in run("check", "--help")[1]


# --- other files --------------------------------------------------------------------------------


def test_sarif_and_glb_of_the_command(command, tmp_path):
    log, file = tmp_path / "c.sarif", tmp_path / "c.glb"
    assert command(stacked(0.1, -0.02), "check", "--clearance", "50mm", "--sarif", log, "--glb", file)[0] == 1
    results = json.loads(log.read_text())["runs"][0]["results"]
    assert [(r["ruleId"], r["level"]) for r in results] == [("collision", "error"), ("near", "error")]
    assert file.read_bytes()[:4] == b"glTF"
    assert command(stacked(0.1), "report", "--glb", file, "--quiet")[0] == 0
    for option, place in (("--sarif", "c.json"), ("--glb", "c.gltf")):
        status, _, err = command(stacked(0.1), "check", option, tmp_path / place)
        assert status == 2 and f"{option}: " in err and "must end in" in err


@pytest.mark.parametrize(("clearance", "status"), [("10mm", 0), ("50mm", 1), ("5cm", 1), ("0.01", 0)])
def test_a_clearance_is_a_gate(command, clearance, status):
    assert command(stacked(-0.02), "check", "--clearance", clearance)[0] == status


# --- what is said first -------------------------------------------------------------------------


def test_a_robot_without_srdf_whose_links_collide_is_told_of_the_command(tmp_path):
    links = "".join(
        f'<link name="l{k}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>' for k in range(3)
    )
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for k in range(2)
    )
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    made = report.make(collide.scenes.load(tmp_path / "r.urdf"))
    (note,) = made.asks
    assert note.startswith("robot r has no SRDF, and 1 pair of its links collide") and "`collide srdf " in note
    text = "\n".join("".join(part for part, _ in line) for line in terminal.render(made, width=400))
    assert text.splitlines()[2] == f"! {note}"
    (tmp_path / "r.srdf").write_text('<robot name="r"></robot>')
    with_srdf = report.make(collide.scenes.load(tmp_path / "r.urdf"))
    assert with_srdf.collides and not with_srdf.asks


def test_units_are_asked_about_before_all_tables(tmp_path, capsys):
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 200 0 0\nv 0 200 0\nv 0 0 200\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    assert cli.main(["report", str(tmp_path / "t.obj")]) == 0
    page = " ".join(capsys.readouterr().out.split())
    assert page.startswith("no collision, no pair to test t: 1 body (0 fixed) ! ") and "is it in millimetres?" in page
    assert cli.main(["check", str(tmp_path / "t.obj")]) == 0
    assert "is it in millimetres?" in capsys.readouterr().err
    assert cli.main(["report", str(tmp_path / "t.obj"), "--scale", "mm"]) == 0
    assert "millimetres" not in capsys.readouterr().out
