"""`collide bench`: engines that are wrong, slow, crash or say little stand where they belong, in CSV and picture.

No time is asserted but that of an engine that burns milliseconds on purpose, against one that does nothing.
"""

from __future__ import annotations

import csv
import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from collide.adapters.bench import benchmark_scripts, pareto, scaling
from collide.adapters.bench.bench_classes import CLASSES, BenchClass, cases_of
from collide.adapters.bench.engine_timer import EngineTimer
from collide.adapters.bench.machine_stamp import machine_stamp, write_csv
from collide.adapters.peers import protocol
from collide.adapters.peers.stress_truth import truth
from collide.cli.main import main
from collide.errors import CollideError, InvalidArgument
from collide.scenes.families.case import Body, pair

HERE = Path(__file__).parent
STUBS = ("right", "wrong", "slow", "crashing", "fragile", "silent")
#: Gaps of unit cubes along x [m]: the second is touching, the third is missed by what the wrong engine is off.
GAPS = (0.5, 0.0, -0.0005, -0.25)
needs_plots = pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="needs the extra plots")


def cubes(random, index):
    """Two unit cubes a gap apart, in halves and quarters but for one: exact."""
    cube = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * 1.0
    step = np.array([1.0 + GAPS[index % len(GAPS)], 0.0, 0.0])
    return pair(Body(cube, np.eye(3), np.zeros(3)), Body(cube, np.eye(3), step))


@pytest.fixture(scope="module")
def points():
    """Every stub and collide on one class of four pairs."""
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(HERE))
    patch.setitem(CLASSES, "cubes", BenchClass("unit cubes in a row", make=cubes))
    for name in STUBS:
        patch.setitem(protocol.ENGINES, name, f"stub_engines:{name.capitalize()}")
    try:
        made = pareto.measure(["collide", pareto.BATCH, *STUBS], ["cubes"], minutes=0.001, n=4)
    finally:
        patch.undo()
        sys.modules.pop("stub_engines", None)
    return {point.engine: point for point in made}


@pytest.mark.slow
def test_errors_are_parts_of_the_size(points):
    np.testing.assert_allclose(points["wrong"].error, 1e-3 / math.sqrt(3), rtol=1e-9)
    assert points["right"].error.max() < 1e-15 and points["collide"].error.max() < 1e-15


@pytest.mark.slow
def test_wrong_booleans_are_counted_with_and_without_touching_pairs(points):
    wrong = points["wrong"]
    assert (wrong.pairs, wrong.apart, wrong.wrong, wrong.wrong_apart) == (4, 3, 2, 1)
    assert not points["right"].wrong and not points["collide"].wrong


def test_slow_is_slower_and_crashing_has_no_time(points):
    assert points["slow"].us.min() > 1000 and points["slow"].ratio > 1
    assert points["crashing"].mishaps == {"abort": 4} and points["crashing"].answered == 0
    assert np.isnan(points["crashing"].us).all() and not points["crashing"].rounds
    assert points["collide"].ratio == 1 and points["collide"].rounds >= pareto.MIN_ROUNDS


def test_dying_while_timed_costs_its_own_times_alone(points):
    fragile = points["fragile"]
    assert fragile.answered == 4 and fragile.mishaps == {"abort": 1} and "timed" in fragile.reason
    assert np.isnan(fragile.us).all() and np.isfinite(fragile.error).all()
    assert np.isfinite(points["silent"].us).all()


def test_a_timer_starts_again_behind_a_death(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    pairs = [cubes(None, k).shapes() for k in range(4)]
    groups = [pairs, pairs[:2]]  # of one pair, a slow machine asks four times alone
    timer = EngineTimer("fragile", "stub_engines:Fragile", groups, 20.0)
    try:
        assert np.isnan(timer.seconds(0)).all() and np.isnan(timer.seconds(0)).all()
        assert timer.failures == {0: "abort"}
        assert np.isnan(timer.seconds(1)).all() and timer.failures == {0: "abort", 1: "abort"}
    finally:
        timer.close()


def test_booleans_alone_have_no_error(points):
    assert points["silent"].answered == 4 and not points["silent"].with_distance
    assert np.isnan(points["silent"].error).all() and np.isfinite(points["silent"].us).all()


def test_csv_has_a_row_a_point_and_the_machine(points, tmp_path):
    place = tmp_path / "pareto.csv"
    write_csv(place, [point.row() for point in points.values()], machine_stamp())
    with place.open(encoding="utf-8") as file:
        rows = {row["engine"]: row for row in csv.DictReader(file)}
    assert list(rows) == list(points)
    assert {"class", "ratio", "median_us", "p99_us", "median_error", "max_error", "wrong", "wrong_apart", "mishaps",
            "timed", "cpu", "cores", "load", "python", "numpy", "collide"} <= rows["wrong"].keys()
    assert rows["crashing"]["median_us"] == "" and rows["crashing"]["mishaps"] == "4 abort"
    assert rows["wrong"]["wrong"] == "2" and float(rows["wrong"]["median_error"]) == pytest.approx(5.774e-4)


@needs_plots
def test_marks_stand_where_they_belong(points, tmp_path):
    from collide.adapters.bench import pareto_picture as picture

    places = [tmp_path / "a.png", tmp_path / "a.svg"]
    marks = {mark["engine"]: mark for mark in picture.draw(list(points.values()), places, machine_stamp())}
    assert all(place.stat().st_size > 10_000 for place in places)
    assert marks["right"]["y"] < 1e-15 < marks["wrong"]["y"] == pytest.approx(1e-3 / math.sqrt(3))
    assert marks["silent"]["y"] == picture.NO_ERROR
    assert marks["slow"]["x"] > marks["right"]["x"] and math.isnan(marks["crashing"]["x"])
    assert "2 wrong, 1 apart" in marks["wrong"]["text"] and "4 failed" in marks["crashing"]["text"]
    assert "crashing · 4 failed" in places[1].read_text(encoding="utf-8") or places[1].read_text().count("<path") > 50


@needs_plots
def test_labels_do_not_overlap():
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    from collide.adapters.bench import pareto_picture as picture

    points = []
    for k in range(9):  # all in one place, which is the worst for labels
        made = pareto.Point("near", f"engine{k}", "1", 3, np.full(3, 2.0 + 0.01 * k), np.full(3, 1e-16))
        points.append(made)
    figure = Figure(figsize=(5.4, 4.6))
    canvas = FigureCanvasAgg(figure)
    panel = figure.subplots()
    picture._panel(panel, points, picture.styles_of([point.engine for point in points]))
    canvas.draw()
    boxes = [Text.get_window_extent(text) for text in panel.texts if text.get_text().startswith("engine")]
    assert len(boxes) == 9
    assert not [(i, j) for i in range(9) for j in range(i) if boxes[i].overlaps(boxes[j])]


@pytest.mark.many(2)
@pytest.mark.parametrize("name", CLASSES)
def test_classes_are_seeded_and_judged(name):
    cases, again = cases_of(name, 3, 5), cases_of(name, 3, 5)
    assert [c.to_dict() for c in cases] == [c.to_dict() for c in again]
    assert cases[0].to_dict() != cases_of(name, 3, 6)[0].to_dict()
    hits = {truth(case).hit for case in cases_of(name, 6, 5)}
    assert hits == {True, False} or name == "flush"


def test_ratios_are_medians_over_rounds_of_medians_over_pairs():
    ours = [np.array([1.0, 2.0, np.nan]), np.array([1.0, 1.0, 1.0]), np.array([1.0, 1.0, 1.0])]
    theirs = [np.array([2.0, 8.0, 5.0]), np.array([7.0, 5.0, 6.0]), np.array([9.0, 1.0, 4.0])]
    assert pareto.median_ratio(theirs, ours) == 4.0


@pytest.mark.parametrize("power", [0.0, 0.5, 1.0, 2.0])
def test_slopes_of_powers(power):
    sizes = [8, 32, 128, 512, 2048]
    assert scaling.fitted_slope(sizes, [3.0 * n**power for n in sizes]) == pytest.approx(power, abs=1e-9)
    assert math.isnan(scaling.fitted_slope(sizes, [math.nan] * 4 + [1.0]))


@pytest.mark.slow
def test_scaling_counts_operations_and_times_engines():
    grown = {g.name: g for g in scaling.measure(["collide"], (8, 64), minutes=0.001)}
    assert 8 <= grown[scaling.OPERATIONS].values[0] <= grown[scaling.OPERATIONS].values[1]
    assert grown[scaling.OPERATIONS].values == [scaling.operations(n, 0) for n in (8, 64)]
    assert all(value > 0 for value in grown["collide"].values)
    assert [row["n"] for row in grown["collide"].rows()] == [8, 64]


def test_list_explains_every_script(capsys):
    listed = benchmark_scripts.scripts()
    files = {file.stem for file in (HERE.parents[2] / "benchmarks").glob("*.py")}
    assert {script.name for script in listed} == files and len(files) > 40
    assert not [script.name for script in listed if len(script.about) < 20], "give it a docstring"
    assert main(["bench", "list"]) == 0
    printed = capsys.readouterr().out
    assert not [name for name in files | set(benchmark_scripts.PACKAGED) if name not in printed]


def test_run_gives_arguments_and_status_on(tmp_path):
    (tmp_path / "three.py").write_text("import sys\nif __name__ == '__main__':\n    sys.exit(len(sys.argv))\n")
    assert benchmark_scripts.run_script("three", ["--a", "b"], tmp_path) == 3
    with pytest.raises(InvalidArgument, match="three"):
        benchmark_scripts.run_script("four", [], tmp_path)
    with pytest.raises(CollideError, match=r"bench run four: .*repository"):
        benchmark_scripts.run_script("four", [], tmp_path / "none")


def test_unknown_names_are_told(capsys, tmp_path):
    for words, message in ((["--classes", "nears"], "no class 'nears'"), (["--engines", "coall"], "no engine 'coall'")):
        assert main(["bench", "pareto", "--csv-only", "--quiet", "--out", str(tmp_path), *words]) == 2
        assert message in capsys.readouterr().err


def test_a_picture_without_matplotlib_names_the_extra(capsys, tmp_path, monkeypatch):
    for name in ("matplotlib", "matplotlib.backends", "matplotlib.backends.backend_agg"):
        monkeypatch.setitem(sys.modules, name, None)
    assert main(["bench", "pareto", "--quick", "--quiet", "--out", str(tmp_path / "out")]) == 2
    assert "collide-robotics[plots]" in capsys.readouterr().err and not (tmp_path / "out").exists()
