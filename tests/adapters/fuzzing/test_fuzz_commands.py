"""`collide fuzz` and `collide compare --save` as commands: files, tables, statuses."""

from __future__ import annotations

import json

import pytest

from collide import Box, Cylinder, Ellipsoid, Sphere, World, pose
from collide.adapters.fuzzing import fuzz_run
from collide.adapters.fuzzing.findings import load_finding
from collide.adapters.fuzzing.fuzz_case import pair_case
from collide.cli import main as cli
from collide.scenes import save


def run(*words) -> int:
    return cli.main([str(word) for word in words])


@pytest.fixture
def large_boxes(stubs, monkeypatch):
    """Rounds of one pair of boxes, one of them large."""
    def rounds(seed: int, number: int):
        return [pair_case(Box((1, 1, 2 + 0.1 * (seed + number + 1))), Box((1, 1, 1)), pose(), pose((0.2, 0, 0)))]

    monkeypatch.setattr(fuzz_run.fuzz, "__kwdefaults__", fuzz_run.fuzz.__kwdefaults__ | {"source": rounds})


@pytest.mark.slow
def test_fuzz_saves_and_goes_on(large_boxes, tmp_path, capsys):
    out, summary = tmp_path / "found", tmp_path / "fuzz.json"
    words = ("fuzz", "--engines", "large_boxes", "--rounds", 2, "--seed", 3, "--save", out)
    assert run(*words, "--json", summary) == 0
    text = capsys.readouterr().out
    assert "FUZZING  wrong answers to 2 pairs, seed 3, 2 rounds" in text
    assert "large-boxes-false-miss-box-box-deep.json" in text
    data = json.loads(summary.read_text())
    assert data["ours"] == 0 and data["findings"][0]["kind"] == ["large_boxes", "false miss", "Box", "Box", "deep"]
    assert run(*words) == 2
    assert "--resume" in capsys.readouterr().err
    words = ("fuzz", "--engines", "large_boxes", "--rounds", 3, "--seed", 3, "--save", out)
    assert run(*words, "--resume", "--quiet") == 0
    assert capsys.readouterr().out == "" and json.loads((out / "fuzz.json").read_text())["rounds"] == 3
    (place,) = out.glob("*deep.json")
    assert run("compare", place, "--engines", "large_boxes", "--fail-on", "peer-wrong") == 1


def test_an_answer_of_ours_that_is_wrong_sets_the_status(stubs, tmp_path, monkeypatch):
    from collide.adapters.fuzzing import disagreements

    rounds = {"source": lambda seed, number: [pair_case(Cylinder(1, 1), Box((1, 1, 1)), pose(), pose((0.2, 0, 0)))]}
    monkeypatch.setattr(fuzz_run.fuzz, "__kwdefaults__", fuzz_run.fuzz.__kwdefaults__ | rounds)
    real = disagreements.lower_bound
    monkeypatch.setattr(disagreements, "lower_bound", lambda *pair: (real(*pair)[0] + 5.0, real(*pair)[1]))
    assert run("fuzz", "--engines", "stub", "--rounds", 1, "--save", tmp_path / "x", "--quiet") == 1
    found, about = load_finding(next((tmp_path / "x").glob("collide-wrong-bracket*.json")))
    assert found.flaw.judged_by == "support functions" and " --engines exact" in about["command"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [(("--minutes", "0"), "above 0"), (("--seed", "-1"), "0 or more"), (("--engines", "odd"), "no engine 'odd'"),
     (("--rounds", "0"), "1 or more")],
)
def test_wrong_arguments(words, complaint, tmp_path, capsys):
    assert run("fuzz", "--save", tmp_path / "x", *words) == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.slow
def test_compare_saves_a_case_of_every_kind(stubs, tmp_path, capsys):
    world = World()
    for k, x in enumerate((0.0, 0.37, 0.81)):
        world.add(Box((1.31, 1.72, 2.5 + 0.2 * k)), pose((x, 0.1, 0.2)), name=f"box{k}")
    world.add(Sphere(0.25), pose((0.1, 0.2, 1.6)), name="ball")
    world.add(Ellipsoid((0.1, 0.2, 0.3)), pose((9, 9, 9)), name="far")
    save(world, tmp_path / "scene.json")
    assert run("compare", tmp_path / "scene.json", "--engines", "large_boxes", "--save", tmp_path / "out") == 0
    assert "2 written to" in capsys.readouterr().out
    found = [load_finding(place)[0] for place in sorted((tmp_path / "out").glob("*.json"))]
    assert [finding.case.kinds for finding in found] == [("Box", "Box"), ("Box", "Sphere")]
    assert [finding.times for finding in found] == [3, 3] and all(finding.is_minimal for finding in found)
    assert run("compare", tmp_path / "scene.json", "--engines", "stub", "--save", tmp_path / "none") == 0
    assert "nothing to save" in capsys.readouterr().out
    (tmp_path / "file").write_text("")
    assert run("compare", tmp_path / "scene.json", "--save", tmp_path / "file") == 2
    assert "is no folder" in capsys.readouterr().err
