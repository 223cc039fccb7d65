"""SARIF 2.1.0 of checks: what the standard requires of a log, and that every finding is in it once."""

from __future__ import annotations

import json
from urllib.parse import unquote, urlparse

import pytest

from collide import Box, pose
from collide.reports import checking, report, sarif
from collide.scenes import Scene, SceneBody

CUBE = Box((1, 1, 1))


def stacked(*depths) -> Scene:
    bodies = [
        SceneBody(f"{which} {k}", CUBE, pose((5 * k, 0, z)))
        for k, depth in enumerate(depths) for which, z in (("low", 0.0), ("high", 1.0 - depth))
    ]
    return Scene("stack", bodies, sources=["a file.yaml"])


def checked(*depths, known=None, label="", clearance=0.0):
    made = report.make(stacked(*depths), clearance=clearance)
    return checking.check(made, label, touching_counts=False, known=known, tolerance=1e-4)


def log_of(checks, sources=("a file.yaml",), missing=()):
    return json.loads(json.dumps(dict(sarif.items(checks, sources, missing)), allow_nan=False))


def validate(log: dict) -> list[dict]:
    """The results of a log; asserts what SARIF 2.1.0 requires of the properties that are used."""
    assert set(log) == {"$schema", "version", "runs"} and log["version"] == "2.1.0"  # 3.13
    (run,) = log["runs"]
    driver = run["tool"]["driver"]  # 3.18, 3.19
    assert driver["name"] and isinstance(driver["version"], str)
    rules = [rule["id"] for rule in driver["rules"]]
    assert len(set(rules)) == len(rules) and all(rule["shortDescription"]["text"] for rule in driver["rules"])  # 3.49
    assert run["columnKind"] in ("utf16CodeUnits", "unicodeCodePoints")  # 3.14
    assert all(isinstance(entry["executionSuccessful"], bool) for entry in run["invocations"])  # 3.20
    for result in run["results"]:  # 3.27
        assert rules[result["ruleIndex"]] == result["ruleId"]
        assert result["level"] in ("none", "note", "warning", "error") and result["message"]["text"]
        assert result.get("baselineState", "new") in ("new", "unchanged", "updated", "absent")
        assert all(isinstance(value, str) and value for value in result["partialFingerprints"].values())
        for location in result.get("locations", []):  # 3.28
            for place in [location["physicalLocation"]] if "physicalLocation" in location else []:
                uri = place["artifactLocation"]["uri"]
                assert " " not in uri and "\\" not in uri and urlparse(uri).scheme in ("", "file")
                assert place["region"]["startLine"] >= 1  # 3.30
            assert all(body["name"] and body["kind"] == "object" for body in location.get("logicalLocations", []))
    return run["results"]


def test_every_finding_is_a_result():
    results = validate(log_of([checked(0.1, -0.02, 0.0, -0.5, clearance=0.05)]))
    assert [(r["ruleId"], r["level"]) for r in results] == [
        ("collision", "error"), ("touching", "error"), ("near", "error"),
    ]
    assert results[0]["message"]["text"] == "low 0 and high 0: collision, 100 mm deep"
    assert results[2]["message"]["text"] == "low 1 and high 1: near, 20 mm apart"
    (location,) = results[0]["locations"]
    assert [body["name"] for body in location["logicalLocations"]] == ["low 0", "high 0"]
    assert unquote(location["physicalLocation"]["artifactLocation"]["uri"]) == "a file.yaml"
    assert validate(log_of([checked(-1.0)])) == []


def test_a_baseline_gives_states_and_identities_stay():
    entries = [checking.Finding("collision", f"low {k}", f"high {k}", -0.1) for k in (0, 1, 3)]
    known = checking.Baseline({"": {checking._key(entry): entry for entry in entries}})
    results = validate(log_of([checked(0.1, 0.2, 0.3, known=known)]))
    states = {r["partialFingerprints"]["bodies/v1"]: (r["ruleId"], r["level"], r["baselineState"]) for r in results}
    assert states == {
        "collision//high 0/low 0": ("known", "note", "unchanged"),
        "collision//high 1/low 1": ("deeper", "error", "updated"),
        "collision//high 2/low 2": ("collision", "error", "new"),
        "collision//high 3/low 3": ("gone", "note", "absent"),
    }
    assert "100 mm deep in the baseline" in next(r for r in results if r["ruleId"] == "deeper")["message"]["text"]


def test_states_missing_meshes_and_pairs_without_an_answer():
    first, second = checked(0.1, label="home"), checked(-1.0, label="goal")
    second.unanswered = [{"a": "x", "b": "y", "why": "two half-spaces"}]
    results = validate(log_of([first, second], missing=["link l: no mesh m.stl"]))
    assert [r["ruleId"] for r in results] == ["collision", "not-answered", "missing-mesh"]
    assert results[0]["message"]["text"].startswith("home: ") and results[1]["message"]["text"].startswith("goal: ")
    assert {r["level"] for r in results[1:]} == {"warning"}
    assert len({r["partialFingerprints"]["bodies/v1"] for r in results}) == 3


@pytest.mark.parametrize("inside", [True, False])
def test_places_are_relative_within_the_working_folder(tmp_path, monkeypatch, inside):
    file = tmp_path / "with blank" / "s.yaml"
    file.parent.mkdir()
    monkeypatch.chdir(tmp_path if inside else file.parent)
    source = file if inside else tmp_path / "t.yaml"
    (result,) = validate(log_of([checked(0.1)], [str(source)]))
    uri = result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert uri == ("with%20blank/s.yaml" if inside else (tmp_path / "t.yaml").as_uri())
    (result,) = validate(log_of([checked(0.1)], []))
    assert [*result["locations"][0]] == ["logicalLocations"]
