"""The command line: exit statuses, error lines, what is written where, and what is not imported.

Most tests call `main` in this process with stand-ins for the loaders; those that need a process of
their own (imports, pipes, signals) start one each.
"""

from __future__ import annotations

import csv
import json
import os
import re
import shlex
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import collide.scenes
from collide.cli import arguments
from collide.cli import main as cli
from collide.errors import MissingExtra, SceneError
from collide.results import HOW, PAIR_DTYPE, PLANE, SIMPLEX, UNDECIDED, WorldResult
from collide.shapes import Sphere


def fake_scene(*rows):
    """A scene of bodies a, b, c whose World answers with (a, b, distance, how) rows."""
    names = {0: "a", 1: "b", 2: "c"}
    answers = np.zeros(len(rows), PAIR_DTYPE)
    for row, (a, b, distance, how) in zip(answers, rows):
        row["a"], row["b"], row["distance"], row["how"] = a, b, distance, how
        row["lower"], row["upper"] = distance - 1e-17, distance + 1e-17
        row["hit"], row["certified"], row["normal"] = distance <= 0, how != UNDECIDED, (0, 0, 1)
    stats = {
        "bodies": 3, "static": 0, "pairs": 3, "skipped": {"broadphase": 3 - len(rows)}, "narrowphase": len(rows),
        "convex_pairs": len(rows), "hits": 0, "undecided": 0, "how": {HOW[PLANE]: len(rows)},
        "gjk_iterations": 0, "epa_iterations": 0, "seconds": {"narrowphase": 0.0},
    }
    world = SimpleNamespace(
        distances=lambda max_distance, depth: WorldResult(
            answers[answers["hit"] | (answers["distance"] <= max_distance)],
            {k: SimpleNamespace(name=name) for k, name in names.items()},
            collide.certify,
        ),
        stats=stats, names=dict(names),
    )
    bodies = [
        SimpleNamespace(name=n, shape=Sphere(0.1), X_WB=np.eye(4), static=False, source="", approximation=None)
        for n in names.values()
    ]
    return SimpleNamespace(
        name="fake", bodies=bodies, notes=[], sources=[], robots={}, placements={}, seconds={"read": 0.0},
        world=lambda: world,
    )


@pytest.fixture
def scene(monkeypatch):
    """``scene(rows...)`` makes every path load that stand-in; ``scene.given`` keeps the last options."""

    def answer_with(*rows):
        made = fake_scene(*rows)

        def load(*paths, **options):
            answer_with.given = (paths, options)
            return made

        monkeypatch.setattr(collide.scenes, "load", load, raising=False)

    return answer_with


HIT, TOUCH, NEAR = (0, 1, -0.01, SIMPLEX), (0, 2, 0.0, UNDECIDED), (1, 2, 0.02, PLANE)


# --- exit statuses ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rows, options, status",
    [
        ([], [], 0), ([NEAR], [], 0), ([HIT], [], 1), ([HIT, TOUCH], [], 1), ([TOUCH], [], 0),
        ([TOUCH], ["--touching-is-collision"], 1), ([HIT], ["--min-depth", "20mm"], 0),
        ([HIT], ["--min-depth", "5mm"], 1),
    ],
)
def test_check_tells_scripts_whether_the_scene_is_free(scene, capsys, rows, options, status):
    scene(*rows)
    assert cli.main(["check", "x.yaml", *options]) == status


def test_check_prints_one_line_a_pair(scene, capsys):
    scene(HIT, TOUCH)
    cli.main(["check", "x.yaml"])
    out, err = capsys.readouterr()
    assert out == "collision\ta\tb\t-0.01\ntouching\ta\tc\t0.0\n"
    assert err == "collide: 1 collision, 1 touching, all 3 pairs answered\n"


def test_report_writes_every_pair_as_a_line(scene, tmp_path):
    scene(HIT, TOUCH, NEAR)
    table = tmp_path / "pairs.csv"
    assert cli.main(["report", "x.yaml", "--clearance", "50mm", "--csv", str(table), "--quiet"]) == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [(row["class"], row["a"], row["b"], float(row["distance"])) for row in rows] == [
        ("colliding", "a", "b", -0.01), ("touching", "a", "c", 0.0), ("near", "b", "c", 0.02),
    ]
    assert len(rows[0]) == 18 and {row["state"] for row in rows} == {""}
    assert cli.main(["report", "x.yaml", "--csv", str(tmp_path / "pairs.txt")]) == 2


def test_quiet_says_nothing(scene, capsys):
    scene(HIT)
    assert cli.main(["check", "x.yaml", "--quiet"]) == 1
    assert cli.main(["report", "x.yaml", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_report_passes_its_options_on(scene, capsys):
    scene()
    arguments = "report a.stl b.obj --state goal --meshes pieces --missing-meshes skip --package-path p --scale mm"
    assert cli.main(arguments.split()) == 0
    paths, options = scene.given
    assert paths == ("a.stl", "b.obj")
    assert options["state"] == "goal" and options["meshes"] == "pieces" and options["missing_meshes"] == "skip"
    assert options["scale"] == 1e-3 and options["package_path"] == ["p"]
    assert "robot" not in options and "srdf" not in options  # what is not given stays the loader's choice


# --- JSON ---------------------------------------------------------------------------------------


def test_json_never_overwrites_a_scene_written_in_json(scene, capsys, tmp_path):
    scene()
    victim = tmp_path / "cell.json"
    victim.write_text('{"collide": 1}')
    assert cli.main(["check", "x.yaml", "--json", str(victim)]) == 2
    assert victim.read_text() == '{"collide": 1}' and "is a scene" in capsys.readouterr().err
    victim.write_text("{}")
    assert cli.main(["check", "x.yaml", "--json", str(victim)]) == 0


@pytest.mark.parametrize("command", ["report", "check"])
def test_json_alone_on_standard_output(scene, capsys, command):
    scene(HIT)
    cli.main([command, "x.yaml", "--json", "-"])
    data = json.loads(capsys.readouterr().out)
    assert data["schema"] == "collide-report/4" and data["colliding"][0]["depth"] == 0.01


def test_json_beside_the_table(scene, capsys, tmp_path):
    scene(HIT)
    assert cli.main(["report", "x.yaml", "--json", str(tmp_path / "r.json")]) == 0
    assert capsys.readouterr().out.startswith("1 collision")
    assert json.loads((tmp_path / "r.json").read_text())["verdict"]["collides"] is True


def test_json_never_overwrites_a_scene(scene, capsys, tmp_path):
    scene()
    victim = tmp_path / "scene.yaml"
    victim.write_text("bodies: []")
    assert cli.main(["report", "x.yaml", "--json", str(victim)]) == 2
    assert victim.read_text() == "bodies: []" and "must end in .json" in capsys.readouterr().err


# --- errors -------------------------------------------------------------------------------------


BUG = "(COLLIDE_TRACEBACK=1 shows where; please report it)"


def failing(monkeypatch, error):
    def load(*paths, **options):
        raise error

    monkeypatch.setattr(collide.scenes, "load", load, raising=False)


@pytest.mark.parametrize(
    "error, line",
    [
        (SceneError("no such file", path="x.yaml"), "collide: error: x.yaml: no such file"),
        (SceneError("two\nlines\x1b[2J", path="x"), "collide: error: x: two lines\\x1b[2J"),
        (MissingExtra("pyyaml", extra="robots", purpose="read YAML"),
         "collide: error: pyyaml is needed to read YAML: pip install 'collide-robotics[robots]'"),
        (FileNotFoundError(2, "No such file or directory", "m.stl"),
         "collide: error: m.stl: No such file or directory"),
        (ZeroDivisionError("oh"), f"collide: error: this is a bug in collide: ZeroDivisionError: oh {BUG}"),
    ],
    ids=["scene", "multi-line", "extra", "file", "bug"],
)
@pytest.mark.parametrize("command", ["report", "check", "compare"])
def test_every_error_is_one_line_and_status_two(monkeypatch, capsys, command, error, line):
    monkeypatch.delenv("COLLIDE_TRACEBACK", raising=False)
    failing(monkeypatch, error)
    assert cli.main([command, "x.yaml"]) == 2
    assert capsys.readouterr() == ("", line + "\n")


def test_a_traceback_can_be_had(monkeypatch, capsys):
    monkeypatch.setenv("COLLIDE_TRACEBACK", "1")
    failing(monkeypatch, SceneError("bad"))
    assert cli.main(["report", "x"]) == 2
    err = capsys.readouterr().err
    assert "Traceback" in err and err.endswith("collide: error: bad\n")


def test_ctrl_c_is_one_line(monkeypatch, capsys):
    failing(monkeypatch, KeyboardInterrupt())
    assert cli.main(["report", "x"]) == 130
    assert capsys.readouterr().err == "collide: interrupted\n"


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["report"], "required: SCENE"),
        (["nonsense"], "invalid choice"),
        (["report", "x", "--clearance", "-1"], "negative"),
        (["report", "x", "--scale", "parsec"], "units"),
        (["report", "x", "--clearance", "5parsec"], "units"),
        (["check", "x", "--min-dep", "1"], "--min-dep"),
        (["report", "x", "--meshes", "voxels"], "voxels"),
        (["report", "x", "--scale", "nan"], "--scale: must be a finite"),
        (["report", "x", "--scale", "0"], "other than 0"),
        (["compare", "x", "--engines", ""], "names no engine"),
        (["compare", "x", "--engines", " , "], "names no engine"),
        (["compare", "x", "--tolerance", "-1"], "not negative"),
        (["report", "x", "--resolution", "0"], "above 0"),
        (["compare", "x", "--fail-on", "luck"], "luck"),
    ],
)
def test_usage_errors_are_one_line_too(capsys, arguments, words):
    assert cli.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("collide: error: ") and words in err


# --- help, scenes -------------------------------------------------------------------------------


def test_no_command_shows_help(capsys):
    assert cli.main([]) == 0
    assert "examples:" in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    ["report", "check", "compare", "locality", "papers", "scenes", "doctor", "config", "export", "solid", "cells",
     "obstacle"],
)
def test_every_command_teaches_itself(capsys, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert ("examples:" in out or "exit status:" in out) and max(map(len, out.splitlines())) <= 80


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"collide {collide.__version__}\n"


def test_scenes_are_listed_with_a_line_each(capsys):
    assert cli.main(["scenes"]) == 0
    out = capsys.readouterr().out
    for name in collide.scenes.shipped():
        line = next(line for line in out.splitlines() if line.strip().startswith(name))
        assert len(line.split()) > 3, line


def test_a_scene_is_copied_once(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = need_shipped("workcell")
    assert cli.main(["scenes", "--copy", name]) == 0
    copy = tmp_path / capsys.readouterr().out.strip()
    assert copy.read_bytes() == collide.scenes.path(name).read_bytes()
    assert cli.main(["scenes", "--copy", name]) == 2
    assert "--force" in capsys.readouterr().err
    assert cli.main(["scenes", "--copy", name, "--force"]) == 0
    assert cli.main(["scenes", "--copy", name, str(tmp_path / "other.yaml")]) == 0
    assert cli.main(["scenes", "--copy", "no_such_scene"]) == 2
    assert cli.main(["scenes", "--copy", name, "x", "y"]) == 2


# --- processes ----------------------------------------------------------------------------------


def run(*arguments, code=None, **options):
    command = [sys.executable, "-c", code] if code else [sys.executable, "-m", "collide", *arguments]
    options.setdefault("env", {**os.environ, "NO_COLOR": "1"})
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)


@pytest.mark.parametrize("command", sorted(cli._COMMANDS))
def test_help_teaches_by_three_examples_that_parse(command, capsys):
    assert cli.main([command, "--help"]) == 0
    examples = capsys.readouterr().out.split("examples:\n")[1].split("\n\n")[0].splitlines()
    calls = [re.split(r"\s{2,}|[|#)]|&&", part)[0] for line in examples for part in re.findall(r"collide .*", line)[:1]]
    commands = [arguments.parse(shlex.split(call)[1:]).command for call in calls]
    assert commands.count(command) >= 3, calls


def test_help_and_version_import_neither_numpy_nor_numba():
    code = """
import sys
from collide.cli.main import main
for arguments in (["--help"], ["--version"], ["report", "--help"], ["compare", "--help"], []):
    assert main(arguments) == 0, arguments
heavy = {"numpy", "numba", "rich", "yaml"} & set(sys.modules)
assert not heavy, heavy
"""
    done = run(code=code)
    assert done.returncode == 0, done.stderr


def test_a_closed_pipe_ends_quietly():
    code = """
import os, sys
from collide.cli import main as cli
reader, writer = os.pipe()
os.dup2(writer, 1)
os.close(reader)
sys.exit(cli.main(["scenes"]))
"""
    done = run(code=code)
    assert (done.returncode, done.stderr) == (cli.PIPE_CLOSED, "")


def test_the_module_is_the_command(tmp_path):
    done = run("report", str(tmp_path / "absent.yaml"))
    assert done.returncode == 2 and done.stdout == ""
    told = [line for line in done.stderr.splitlines() if not line.startswith("collide: reading")]  # a slow start
    assert len(told) == 1 and told[0].startswith("collide: error: ")


# --- the shipped scenes -------------------------------------------------------------------------


def need_shipped(name):
    if name not in collide.scenes.shipped():
        pytest.skip(f"{name} is not among the shipped scenes")
    return name


@pytest.mark.parametrize("name", ["workcell", "panda_workbench"])
def test_shipped_scenes_report(name, capsys):
    need_shipped(name)
    try:
        scene = collide.scenes.load(name)
    except MissingExtra as missing:
        pytest.skip(str(missing))
    status = cli.main(["report", name, "--clearance", "50mm", "--json", "-"])
    out, err = capsys.readouterr()
    assert status == 0, err
    data = json.loads(out)
    assert data["pairs"]["total"] == len(scene.bodies) * (len(scene.bodies) - 1) // 2
    assert data["pairs"]["total"] == sum(data["pairs"][k] for k in ("excluded", "apart_by_boxes", "tested"))
    assert cli.main(["check", name]) == (1 if data["colliding"] else 0)
    validate(data)


def validate(data):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is in the dev extra")
    from importlib import resources

    schema = json.loads(resources.files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)


# --- export -------------------------------------------------------------------------------------


def test_a_robot_of_a_scene_is_exported(tmp_path, capsys):
    """The file is that of a checker of the same scene."""
    need_shipped("workcell")
    place = tmp_path / "arm.collide"
    assert cli.main(["export", "workcell", "--meshes", "hull", "--padding", "5mm", "--out", str(place)]) == 0
    said = capsys.readouterr().out
    checker = collide.RobotChecker.from_scene(collide.scenes.load("workcell", meshes="hull"), padding=0.005)
    assert f"{len(checker.bodies)} bodies among {len(checker.around)}, {checker.n_pairs} pairs tested" in said
    checker.save(tmp_path / "again.collide")
    assert place.read_bytes() == (tmp_path / "again.collide").read_bytes()


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["{}/part.stl", "--out", "{}/a.collide"], "no robot to export"),
        (["workcell", "--out", "{}/a.txt"], "must end in .collide"),
        (["workcell"], "--out"),
        (["workcell", "--name", "nobody", "--out", "{}/a.collide"], "nobody"),
    ],
)
def test_what_cannot_be_exported_is_said(tmp_path, capsys, arguments, words):
    collide.Mesh(np.eye(4, 3), [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]).save(tmp_path / "part.stl")
    assert cli.main(["export", *(word.format(tmp_path) for word in arguments)]) == 2
    assert words in capsys.readouterr().err and [file.name for file in tmp_path.iterdir()] == ["part.stl"]
