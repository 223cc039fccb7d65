"""The harness of benchmarks/: turns, rows, bars, files, fits; and that every script there can start and is short."""

from __future__ import annotations

import argparse
import ast
import csv
import importlib
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from collide.adapters.bench import claims, growth
from collide.adapters.bench.benchmark_scripts import FOLDER, scripts
from collide.adapters.bench.child_contestant import InChild
from collide.adapters.bench.claims import Claim, Race, grid
from collide.adapters.bench.machine_stamp import machine_stamp
from collide.adapters.bench.turns import Seconds, race, turns
from collide.errors import InvalidArgument

#: Lines of a script, and of a part that scripts import.
MAX_SCRIPT, MAX_PART = 215, 280
QUICK = argparse.Namespace(quick=True, repeats=None, only={}, no_csv=False)


def test_contestants_take_turns_and_another_one_begins_each_time():
    order = [list(turn) for turn in turns("abc", 3, 5, math.inf)]
    assert order == [["a", "b", "c"], ["b", "c", "a"], ["c", "a", "b"], ["a", "b", "c"], ["b", "c", "a"]]
    assert len(list(turns("ab", 2, 9, -1.0))) == 2 and not list(turns("", 2, 9, 1.0))


def test_a_race_measures_calls_and_believes_tasks_that_measured_themselves():
    asked = []
    taken = race({"ours": lambda: asked.append("ours"), "child": lambda: Seconds(0.25)}, max_turns=4)
    assert taken["child"] == [0.25] * 4 and len(taken["ours"]) == 4 and len(asked) > 5
    assert all(0 <= seconds < 1e-3 for seconds in taken["ours"])


def test_rows_have_ratios_bars_and_what_stands_beside():
    asked = Race(
        {"collide": lambda: Seconds(2.0), "peer": lambda: Seconds(8.0), "half": lambda: Seconds(4.0)},
        {"collide": 1.0, "peer": 1.0, "half": 2.0}, {"hits": 3}, {"peer": {"differ": 1}}, {"peer": 4.5},
    )
    claim = Claim("c", "a claim", lambda o: [{"n": 8}], lambda o, n: asked, unit="ms")
    rows, keys = claims.measured(claim, QUICK)
    assert keys == ["n"] and [row["engine"] for row in rows] == ["collide", "peer", "half"]
    assert [row["median_ms"] for row in rows] == [2000.0, 8000.0, 2000.0]
    assert [row["ratio"] for row in rows] == [1.0, 4.0, 1.0] and {row["hits"] for row in rows} == {3}
    assert rows[1]["differ"] == 1 and [row["verdict"] for row in rows] == ["", "missed", ""]
    below = claim._replace(bar="median", measure=lambda o, n: asked._replace(bars={"collide": 2000.0}))
    assert claims.measured(below, QUICK)[0][0]["verdict"] == "met"


def test_a_race_is_closed_whatever_happens():
    closed = []

    def fails():
        raise ValueError

    claim = Claim("c", "", lambda o: [{}], lambda o: Race({"a": fails}, close=lambda: closed.append(1)))
    with pytest.raises(ValueError):
        claims.measured(claim, QUICK)
    assert closed == [1]


def run(tmp_path, monkeypatch, *arguments, value=1.5, **more):
    monkeypatch.setattr(claims, "RESULTS", tmp_path / "benchmarks" / "results")
    monkeypatch.setattr(claims, "FOLDER", tmp_path / "benchmarks")
    (tmp_path / "benchmarks").mkdir(exist_ok=True)
    counted = Claim("counted", "what is counted", lambda o: grid(kind="ab", n=(1, 2)),
                    lambda o, kind, n: [{"value": value * n}], everywhere=True, **more)
    claims.main("Counts.", [counted], arguments=list(arguments))
    return tmp_path / "benchmarks" / "results" / "counted.csv"


def read(place: Path) -> list[dict]:
    with place.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_partial_run_keeps_the_rows_of_other_cases(tmp_path, monkeypatch, capsys):
    place = run(tmp_path, monkeypatch)
    assert [(r["kind"], r["n"], r["value"]) for r in read(place)] == [
        ("a", "1", "1.5"), ("a", "2", "3"), ("b", "1", "1.5"), ("b", "2", "3"),
    ]
    assert machine_stamp().keys() <= read(place)[0].keys() and "COUNTED" in capsys.readouterr().out
    run(tmp_path, monkeypatch, "--only", "kind=b", "--only", "n=2", value=7.0)
    assert sorted((r["kind"], r["n"], r["value"]) for r in read(place)) == [
        ("a", "1", "1.5"), ("a", "2", "3"), ("b", "1", "1.5"), ("b", "2", "14"),
    ]


def test_a_look_writes_no_file(tmp_path, monkeypatch):
    assert not run(tmp_path, monkeypatch, "--quick").exists()
    assert not run(tmp_path, monkeypatch, "--no-csv").exists()


@pytest.mark.parametrize("arguments", [["--only", "kind"], ["--repeats", "0"], ["--table", "another"]])
def test_what_cannot_be_asked_for_is_refused(tmp_path, monkeypatch, arguments):
    with pytest.raises(SystemExit) as refused:
        run(tmp_path, monkeypatch, *arguments)
    assert refused.value.code == 2


def test_wrong_answers_are_not_timed(tmp_path, monkeypatch):
    with pytest.raises(InvalidArgument, match="wrong answers are not timed: 3 bodies"):
        claims.check(False, "3 bodies")
    failing = Claim("c", "", lambda o: [{}], lambda o: claims.check(False, "x"))
    with pytest.raises(SystemExit, match="error: wrong answers"):
        claims.main("", [failing], arguments=["--no-csv"])


def test_tables_fit_their_width_and_say_what_had_no_room(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    wide = Claim("wide", "many columns", lambda o: grid(n=(1, 2, 3)),
                 lambda o, n: [{f"a long name {k}": n + k / 3 for k in range(12)}])
    claims.main("", [wide], arguments=["--no-csv"])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines[1:])) <= 80 and any("in the CSV alone" in line for line in lines)


def test_a_child_that_dies_costs_its_question_and_no_other():
    child = InChild(importlib.import_module, "os")
    try:
        assert isinstance(child.call("getpid"), int)
        assert child.call("_exit", 3) is None and child.failures == {("_exit", (3,)): "abort"}
        assert isinstance(child.call("getpid"), int) and child.call("_exit", 3) is None
    finally:
        child.close()


def test_fits_of_lines_and_powers():
    x = np.array([2.0, 4.0, 8.0, 16.0])
    fit = growth.line_fit(x, 3 * x + 1)
    assert (fit.slope, fit.start, fit.off) == pytest.approx((3.0, 1.0, 0.0), abs=1e-9)
    assert growth.line_fit([0, 1, 2], [0, 3, 0]).above == pytest.approx(3.0)
    assert growth.power_of(x, 5 * x**1.5) == pytest.approx(1.5)
    rows = [{"kind": k, "n": 2**i, "depth": 2 * i + 1} for k in "ab" for i in range(4)]
    lines = list(growth.log2_lines(rows, ("kind",), ("depth",)))
    assert len(lines) == 2 and "a: depth = 1.0 + 2.00·log2 n, at most 0.0 off" in lines[0]


def test_pictures_are_written_whole(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra plots")
    rows = [{"kind": k, "n": n, "value": n + 1} for k in "ab" for n in (1, 10, 100)]
    panels = tuple(growth.Panel(f"panel {k}", "n", "value", "kind", "xy", dashed="n") for k in range(5))
    growth.draw(rows, panels, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000 and len(list(tmp_path.iterdir())) == 1
    with pytest.raises(InvalidArgument, match="picture"):
        growth.draw(rows, panels, tmp_path / "picture.nothing")


# --- the scripts --------------------------------------------------------------------------------

SCRIPTS = {script.name: script.runs for script in scripts()}


@pytest.mark.skipif(not SCRIPTS, reason="benchmarks/ are in a clone alone")
def test_scripts_are_short_and_have_claims():
    lines = {name: (FOLDER / f"{name}.py").read_text(encoding="utf-8") for name in SCRIPTS}
    long = {name: text.count("\n") for name, text in lines.items()
            if text.count("\n") > (MAX_SCRIPT if SCRIPTS[name] else MAX_PART)}
    assert not long
    own = [name for name, runs in SCRIPTS.items() if runs and "main(__doc__, CLAIMS" not in lines[name]]
    assert not own, f"{own} have command lines of their own"
    assert len(SCRIPTS) > 40


def test_what_scripts_import_is_there():
    """A name that a part no longer has would end a script when it starts: parts and the package are looked up."""
    for name in SCRIPTS:
        for node in ast.walk(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or node.module == "__future__":
                continue
            if node.module in SCRIPTS:
                part = ast.parse((FOLDER / f"{node.module}.py").read_text(encoding="utf-8"))
                there = {n.name for n in part.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
                there |= {n.id for top in part.body for n in ast.walk(top)
                          if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
            elif node.module.split(".")[0] == "collide" and "hosts" not in node.module:
                module = importlib.import_module(node.module)
                there = {alias.name for alias in node.names if hasattr(module, alias.name)}
                there |= {a.name for a in node.names if (Path(module.__file__).parent / f"{a.name}.py").is_file()}
            else:
                continue
            missing = {alias.name for alias in node.names} - there
            assert not missing, f"benchmarks/{name}.py imports {missing} from {node.module}"


def test_folders_of_tests_that_scripts_use_are_there():
    calls = [
        ast.literal_eval(argument)
        for name in SCRIPTS
        for node in ast.walk(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "use_tests"
        for argument in node.args
    ]
    assert len(calls) > 10
    for folder in calls:
        assert (FOLDER.parent / "tests" / folder).is_dir(), folder


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, runs in SCRIPTS.items() if runs])
def test_scripts_explain_themselves(name):
    command = [sys.executable, FOLDER / f"{name}.py", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "ModuleNotFoundError" in done.stderr:
        pytest.skip(done.stderr.splitlines()[-1])
    assert done.returncode == 0 and "usage:" in done.stdout, done.stderr
