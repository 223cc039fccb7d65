"""Reports at their ends: classes of brackets that just belong, lists that are just full, what is missing or unknown."""

from __future__ import annotations

import io
import json
import math
import platform
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from slider_scene import slider_scene

import collide
from collide.adapters import hosts
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.kernels import library, mode
from collide.reports import (
    checking,
    classes,
    comparing,
    doctor,
    junit,
    locality_report,
    mesh_notes,
    overlap_volumes,
    progress,
    proofs,
    report,
    state_reports,
    terminal,
    trajectory_report,
)
from collide.reports.pair_classes import Pair
from collide.reports.report_tables import _is_bound, _is_range, depth_texts
from collide.reports.tables import Column, Table, lay_out
from collide.results import HOW, PAIR_DTYPE, SIMPLEX
from collide.scenes import SceneBody
from collide.scenes.loaders.trajectories import Trajectory

# --- classes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("lower", "upper", "name"), [
    (-0.25, -0.25, "shallow"), (-0.5, -0.5, "colliding"), (-0.125, -0.125, "touching"), (0.125, 0.125, "touching"),
    (-0.125, 0.0, "touching"), (-0.25, 0.125, "touching"), (0.0, 0.25, "near"), (0.25, 0.5, "near"), (1.0, 1.0, "near"),
    (1.0, 9.0, "near"), (1.0 + 2.0**-40, 9.0, ""),
])
def test_ends_of_classes_belong_to_the_class(lower, upper, name):
    """Rounding 1/8, clearance 1, collisions of less than 1/2 are shallow [m]."""
    row = np.zeros(1, dtype=PAIR_DTYPE)
    row["how"], row["lower"], row["upper"], row["hit"] = SIMPLEX, lower, upper, upper <= 0
    row["distance"] = 0.5 * (lower + upper)
    found = classes.classify(row, 0.125, clearance=1.0, min_depth=0.5)
    assert [one for one, indices in found.items() if len(indices)] == ([name] if name else [])
    assert bool(classes.is_touching(lower, upper, 0.125)) == (name == "touching")


def test_a_row_that_is_beyond_the_limit_is_in_no_class():
    row = np.zeros(1, dtype=PAIR_DTYPE)
    row["beyond"], row["how"] = True, SIMPLEX
    assert not any(map(len, classes.classify(row, 0.125, clearance=1.0, min_depth=0.0).values()))


@pytest.mark.parametrize(("shape", "reach"), [
    (collide.Sphere(0.5), 0.5), (collide.Capsule(0.25, 2.0), 1.25), (collide.Box((6.0, 8.0, 24.0)), 13.0),
    (collide.Compound([(collide.Sphere(0.5), collide.pose((0, 3, 4))), (collide.Sphere(1.0), collide.pose())]), 5.5),
])
def test_a_body_reaches_from_its_place_as_far_as_its_shape(shape, reach):
    bodies = [SceneBody("a", shape, collide.pose((1, -7, 2))), SceneBody("b", shape, collide.pose())]
    assert classes.body_sizes(bodies) == pytest.approx([7.0 + reach, reach])


# --- pairs ----------------------------------------------------------------------------------------


def pair(lower: float, upper: float | None, depth: float | None, certified: bool = False) -> Pair:
    return Pair("a", "b", lower, depth, lower, upper, [0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3, 0, 0, "simplex", certified,
                [])


@pytest.mark.parametrize(("one", "bound", "text"), [
    (pair(-0.5, 0.0, 0.5), True, "≤ 500.000 mm"), (pair(0.0, 0.0, 0.0), False, "0.000 mm"),
    (pair(-0.5, -0.0, 0.5), True, "≤ 500.000 mm"), (pair(0.5, 0.5, None), False, "unbounded"),
])
def test_depths_known_from_above_alone(one, bound, text):
    assert _is_bound(one) == bound and not _is_range(one) and depth_texts([one])[0].strip() == text


def test_a_depth_lies_between_two_lengths_where_they_differ_by_more_than_a_tenth():
    depth = 10.0
    assert not _is_range(pair(-depth, -9.0, depth)) and _is_range(pair(-depth, -8.999, depth))
    assert not _is_range(pair(-depth, -5.0, depth, certified=True)) and not _is_range(pair(-depth, None, depth))


def test_names_of_arguments_that_are_not_known():
    assert [proofs.name_of(k) for k in range(len(HOW))] == list(HOW)
    assert proofs.name_of(len(HOW)) == f"argument {len(HOW)}"


# --- the page -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("title", "width", "line"), [
    ("STATE a", 20, "── STATE a ─────────"), ("STATE a", 10, "── STATE a "), ("STATE abc", 5, "── STATE abc "),
    ("S", 500, "── S ".ljust(terminal.PIPE_WIDTH, "─")),
])
def test_a_rule_is_as_wide_as_the_page_and_has_its_whole_title(title, width, line):
    assert terminal.rule(title, width) == line


def test_a_title_has_the_style_of_its_table_and_nothing_else_has():
    assert [terminal._role(role, style) for role in ("title", "text") for style in ("plain", "near")] == [
        "title", "near", "text", "text",
    ]


@pytest.mark.parametrize(("colliding", "shallow", "touching", "style"), [
    (1, 1, 1, "colliding"), (0, 1, 0, "touching"), (0, 0, 1, "touching"), (0, 0, 0, "free"),
])
def test_the_style_of_the_verdict_is_that_of_the_worst(monkeypatch, colliding, shallow, touching, style):
    made = SimpleNamespace(colliding=[0] * colliding, shallow=[0] * shallow, touching=[0] * touching, notes=[],
                           missing_meshes=[], asks=[], approximations=[],
                           verdict=lambda: "verdict", scene={"name": "s", "bodies": 1, "static": 0, "robots": []})
    monkeypatch.setattr(terminal, "tables", lambda *arguments: [])
    assert terminal.render(made)[0] == [("verdict", style)]


def test_a_table_is_shown_on_the_stream(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    table, stream = Table("T", [Column("", "label")], [["cell"]]), io.StringIO()
    terminal.show_table(table, stream)
    assert stream.getvalue() == "T\n  cell\n" and capsys.readouterr().out == ""
    terminal.show_table(table)
    assert capsys.readouterr().out == "T\n  cell\n"


@pytest.mark.parametrize(("encoding", "colours", "is_used"), [
    ("utf-8", "truecolor", True), ("latin-1", "truecolor", False), ("utf-8", None, False), (None, "truecolor", False),
])
def test_rich_draws_on_terminals_of_colours_that_know_the_letters(monkeypatch, encoding, colours, is_used):
    console = pytest.importorskip("rich.console", reason="rich is in the robots extra")
    made = SimpleNamespace(color_system=colours, encoding=encoding)
    monkeypatch.setattr(console, "Console", lambda **options: made)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert terminal._rich_console(SimpleNamespace(isatty=lambda: True)) is (made if is_used else None)


def test_stages_are_listed_from_a_twentieth_of_a_millisecond():
    spent = {"read": 5e-5, "pack": 4.9e-5, "other": 0.0, "total": 1.0}
    first, second = terminal._times(SimpleNamespace(seconds=spent, versions={"machine": None}))
    assert "read 0.1 ms" in first and "pack" not in first and second.endswith("unknown machine")


def test_names_that_just_fit_at_twenty_cells_are_not_cut_further():
    table = Table("T", [Column("a", "name"), Column("b", "name")], [["x" * 24, "y" * 40]])
    assert lay_out(table, 2 + 20 + 2 + 20).widths == [20, 20]


def test_paths_are_listed_with_their_begin_where_they_collide():
    at = lambda share: {"share": share, "time": None}
    event = {"a": "x", "distance": -0.5, "at": at(0.5), "from": at(0.25), "samples": 3}
    pairs = [{**event, "b": f"y{k}"} for k in range(3)]
    depths = state_reports._motion_table("T", pairs, "depth", 2)
    assert [column.title for column in depths.columns] == ["body A", "body B", "from", "depth", "at", "samples"]
    assert depths.rows == [["x", f"y{k}", "25 %", "500.000 mm", "50 %", "3"] for k in range(2)] and depths.more == 1
    near = state_reports._motion_table("T", [{**pairs[0], "distance": None}], "distance", None)
    assert [column.title for column in near.columns] == ["body A", "body B", "distance", "at", "samples"]
    assert [cell.strip() for cell in near.rows[0]] == ["x", "y0", "unbounded", "50 %", "3"] and near.more == 0


# --- trajectories ---------------------------------------------------------------------------------


def test_of_samples_that_are_as_near_the_first_is_told():
    path = Trajectory("test", [{"slide": slide} for slide in (0.0, 0.25, 0.0, 0.25)])
    found = trajectory_report.follow(slider_scene(), path, resolution=0.25, clearance=0.25)
    assert found["samples"] == 4 and found["least"]["at"]["sample"] == 1
    of_post = next(pair for pair in found["near"] if "post" in (pair["a"], pair["b"]))
    assert of_post["samples"] == 2 and of_post["from"]["sample"] == of_post["at"]["sample"] == 1


def test_as_many_samples_as_there_may_be(monkeypatch):
    monkeypatch.setattr(trajectory_report, "MAX_SAMPLES", 4)
    path = Trajectory("test", [{"slide": 0.0}, {"slide": 1.0}])
    assert len(trajectory_report.sample(slider_scene(), path, 0.25).share) == 5
    with pytest.raises(InvalidArgument, match="more than 4 samples of 0"):
        trajectory_report.sample(slider_scene(), path, 0.2)


@pytest.mark.parametrize("is_known", [True, False])
def test_pairs_without_an_answer_are_noted_once_and_left_out(monkeypatch, is_known):
    """A World that refuses as long as the slider and the lamp are tested, and may say which pair it refuses."""
    scene = slider_scene()
    real = collide.World.distances

    def refusing(world, max_distance, **asked):
        if not world.allowed:
            raise UnsupportedQuery("no way")
        return real(world, max_distance, **asked)

    def refused(world, max_distance):
        ids = {name: identity for identity, name in world.names.items()}
        return [(ids["lamp"], ids["slider"], "no way")] if is_known else []

    monkeypatch.setattr(collide.World, "distances", refusing)
    monkeypatch.setattr(collide.World, "unanswerable", refused)
    path = Trajectory("test", [{"slide": slide} for slide in (0.0, 0.25)])
    if not is_known:
        with pytest.raises(UnsupportedQuery, match="no way"):
            trajectory_report.follow(scene, path)
        with pytest.raises(UnsupportedQuery, match="no way"):
            report.make(scene)
        return
    made = report.make(scene, clearance=9.0)
    assert made.unanswered == [{"a": "lamp", "b": "slider", "why": "no way"}] and len(made.near) == 7
    found = trajectory_report.follow(scene, path, clearance=9.0)
    assert found["unanswered"] == [{"a": "lamp", "b": "slider", "why": "no way"}]
    assert {name for pair in found["near"] for name in (pair["a"], pair["b"])} == {"slider", "post", "crate", "floor"}


# --- checks ---------------------------------------------------------------------------------------


def test_baselines_are_read_from_reports_with_trajectories():
    none = {"colliding": [], "shallow": [], "touching": []}
    entry = lambda name, **values: {"a": "x", "b": name, **values}
    met = [("p", -0.5), ("q", None), ("r", 0.1)]
    data = {"schema": "collide-report/1", **none, "shallow": [entry("s", depth=0.125)],
            "touching": [entry("t", depth=None)],
            "trajectory": {"colliding": [entry(name, distance=distance) for name, distance in met]}}
    known = checking._states(data, data["schema"])[""]
    depths = {tuple(sorted(pair - {"x"})): (what, finding.depth) for (what, pair), finding in known.items()}
    assert depths == {("s",): ("collision", 0.125), ("t",): ("touching", 0.0), ("p",): ("collision", 0.5),
                      ("q",): ("collision", math.inf), ("r",): ("collision", 0.0)}


def test_depths_that_were_not_known_are_unbounded():
    assert [checking._length(depth) for depth in (None, math.inf, 0.25)] == ["unbounded", "unbounded", "250 mm"]


@pytest.mark.parametrize(("n", "words"), [(1, ""), (2, " and 1 more"), (4, " and 3 more")])
def test_messages_of_junit_count_the_findings_after_the_first(n, words):
    findings = [checking.Finding(checking.COLLISION, "a", "b", -0.25)] * n
    assert junit._message("a", findings) == f"collision with b: 250 mm deep{words}"


# --- comparisons ----------------------------------------------------------------------------------


def dispute(**values) -> dict:
    return {"engine": "peer", "kind": "distance", "a": "a", "b": "b", "reference_hit": False, "reference_distance": 1.0,
            "hit": False, "distance": 1.5, "exact_hit": None, "exact_distance": None, "touching": False,
            "not_judged": "", "judged_by": "exact arithmetic", "off": None, "wrong": ["peer"], **values}


@pytest.mark.parametrize(("values", "off"), [
    ({}, 0.5), ({"exact_distance": 1.25}, 0.25), ({"exact_distance": 2.0}, 0.5), ({"off": 0.0}, 0.0),
    ({"off": 4.0, "distance": None}, 4.0), ({"distance": None}, 0.0), ({"reference_distance": None}, 0.0),
])
def test_how_far_a_distance_is_off(values, off):
    assert comparing._off(dispute(**values)) == off


def test_disputes_are_listed_by_blame_then_by_how_far_they_are_off():
    disputes = [dispute(a="open", wrong=[], not_judged="not judged: why"), dispute(a="none", wrong=[]),
                dispute(a="little", off=0.25), dispute(a="much", off=0.5, judged_by="the proven bracket")]
    table = comparing._dispute_table("T", disputes, "ours", None)
    assert [row[1] for row in table.rows] == ["much", "little", "none", "open"] and table.more == 0
    assert [column.title for column in table.columns] == [
        "engine", "body A", "body B", "it says", "ours says", "exact", "off by", "wrong",
    ]
    assert [row[-1] for row in table.rows] == ["peer (by bracket)", "peer", "none", "not judged"]
    assert [note.split(":")[0] for note in table.notes] == ["not judged", "by bracket"]
    short = comparing._dispute_table("T", disputes, "ours", 3)
    assert short.more == 1 and len(short.rows) == 3 and [note.split(":")[0] for note in short.notes] == ["by bracket"]
    plain = comparing._dispute_table("T", [dispute(kind="hit")], "ours", None)
    assert plain.notes == [] and "off by" not in [column.title for column in plain.columns]


def test_engines_stand_beside_each_other_where_they_just_fit():
    data = {"summaries": []}
    rows = [["one", "111"], ["two", "22"], ["six", "6"]]
    width = 2 + len("engine") + 3 * (2 + 3)
    for cells, groups in ((width, [3]), (width - 1, [2, 1])):
        tables = comparing._engine_tables(data, ["engine", "n"], rows, cells)
        assert [len(table.columns) - 1 for table in tables] == groups
        assert all(max(map(len, table.rows[0])) <= 3 and not table.notes for table in tables)


# --- doctor ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 3, 4])
def test_broken_parts_are_named_up_to_three(n):
    checks = [doctor.Check(f"p{k}", "", False) for k in range(n)]
    told = doctor.Examination(checks, [doctor.Check("q", "", None)]).verdict()
    words = "sound" if not n else f"BROKEN: {n} finding{'s' * (n > 1)}: " + ", ".join(f"p{k}" for k in range(min(n, 3)))
    assert told == words + ", …" * (n > 3)


@pytest.mark.parametrize(("numpy", "cores", "processors"), [("2.0", 1, "1 processor"), (None, None, "1 processor"),
                                                            ("2.0", 8, "8 processors")])
def test_what_is_installed(monkeypatch, numpy, cores, processors):
    monkeypatch.setattr(doctor, "versions", lambda: {"collide": "1", "numpy": numpy, "machine": "box"})
    monkeypatch.setattr(doctor.os, "cpu_count", lambda: cores)
    found = {check.what: check for check in doctor._installed()}
    assert found["numpy"].answer == (numpy or "missing") and found["numpy"].passed == (numpy is not None)
    assert found["machine"].answer == f"{platform.system()} box, {processors}"
    assert found["Python"].passed and sys.executable in found["Python"].answer


@pytest.mark.parametrize(("how", "words"), [
    (mode.JUST_IN_TIME, "(numba 9.9, kept on disk)"), (mode.PLAIN_PYTHON, ", very slow"),
])
@pytest.mark.parametrize("about", [{}, {"path": "p", "compiler": "c", "sources": "s", "level": "v3", "levels": "v3"}])
def test_kernels_that_are_not_compiled_ahead_are_a_remark(monkeypatch, how, words, about):
    monkeypatch.setattr(mode, "MODE", how)
    monkeypatch.setattr(mode, "WHY", "why")
    monkeypatch.setattr(library, "about", lambda: about)
    monkeypatch.setattr(doctor, "package_version", lambda package: "9.9")
    kernels, *others = doctor._kernels()
    assert kernels.passed is None and words in kernels.answer and kernels.answer.endswith(": why")
    assert kernels.answer.startswith("FALLING BACK" if about else "NO COMPILED KERNELS")
    assert [check.what for check in others] == (["library", "built by"] if about else [])


@pytest.mark.parametrize(("version", "is_needed", "state"), [
    ("3.1", True, "engine 3.1"), (None, True, "engine absent"), (None, False, "engine not installed, and not needed"),
])
def test_hosts_are_told_with_their_versions(monkeypatch, version, is_needed, state):
    host = SimpleNamespace(name="host", package="engine", module="m", usage="usage", is_needed=is_needed)
    finding = SimpleNamespace(version=version, answer="fine", passed=True)
    monkeypatch.setattr(hosts, "HOSTS", [host])
    module = doctor.import_module("collide.adapters.hosts.host_checks")
    monkeypatch.setattr(module, "check_hosts", lambda asked: [finding for _ in asked])
    (check,) = doctor._hosts()
    assert (check.what, check.passed, check.answer) == ("host", True, f"m: fine; usage ({state})")


# --- meshes ---------------------------------------------------------------------------------------


def test_defects_and_facets_are_named_up_to_three():
    def mesh(n_defects: int, n_facets: int):
        defects = [SimpleNamespace(name=f"d{k}", facets=np.arange(n_facets), spoils=True) for k in range(n_defects)]
        harmless = SimpleNamespace(name="harmless", facets=np.arange(1), spoils=False)
        made = SimpleNamespace(defects=[*defects, harmless], why="w")
        return SimpleNamespace(solid=False, faces=[0] * 9, report=made)

    assert mesh_notes.describe(mesh(0, 1)) == "surface of 9 facets without an inside (w)"
    assert mesh_notes.describe(mesh(1, 1)) == "surface of 9 facets without an inside (d0: facet 0)"
    three = mesh_notes.describe(mesh(3, 3))
    assert three.endswith("; d2: facets 0, 1, 2)") and three.count("facets 0, 1, 2") == 3
    assert mesh_notes.describe(mesh(5, 4)).endswith("; d2: facets 0, 1, 2, … 4 in all; 2 more)")


def test_which_shapes_are_meshed():
    vertices, faces = collide.tessellate(collide.Box((1, 1, 1)), tolerance=1e-3)[:2]
    mesh, box = collide.Mesh(vertices, faces), collide.Box((1, 1, 1))
    assert mesh_notes.is_meshed(mesh) and mesh_notes.is_meshed(collide.Compound([(mesh, collide.pose())]))
    assert not mesh_notes.is_meshed(box) and not mesh_notes.is_meshed(collide.Compound([(box, collide.pose())]))
    assert mesh_notes.describe(mesh) == f"solid of {len(faces)} facets"


def test_centroids_of_overlaps_have_no_negative_zero(monkeypatch):
    values = dict.fromkeys(overlap_volumes._NUMBERS, 1.0)
    overlap = SimpleNamespace(centroid=np.array([-0.0, 0.0, -2.0]), **values)
    monkeypatch.setattr(overlap_volumes, "overlap_volume", lambda *bodies: overlap)
    body = SimpleNamespace(shape=None, X_WB=None)
    assert json.dumps(overlap_volumes.of_bodies(body, body)["centroid"]) == "[0.0, 0.0, -2.0]"


@pytest.mark.parametrize(("value", "text"), [
    (99999.0, "99999.000"), (1e5, "100000"), (123456.7, "123457"), (1.0, "1.000"),
])
def test_stretches_have_three_digits_up_to_a_hundred_thousand(value, text):
    assert locality_report._figure(value) == text


def test_tables_of_locality_name_their_orders():
    stretches = np.arange(1.0, 11.0)
    locality = SimpleNamespace(distinct=7, global_stretch=9.0, local_stretches=stretches, depth_bound=4,
                               quantiles=lambda shares: np.array([stretches * share for share in shares]),
                               means=stretches / 2, worst=np.arange(10))
    item = SimpleNamespace(name="m", locality=locality)
    spread = locality_report._distribution([item])
    assert [row[1:3] for row in spread.rows] == [["σ", "0.500"], ["σ10", "5.000"]]
    assert [row[-2:] for row in spread.rows] == [["1.000", "0"], ["10.000", "9"]]
    assert [row[3] for row in spread.rows] == ["0.500", "5.000"]
    names = ["facets", "nodes", "depth", "graded_size", "node_bound", "graded_depth", "graded_level", "level_bound"]
    item.trees = SimpleNamespace(**dict(zip(names, range(2, 10))), outlier_share=0.125, max_outliers=1)
    table, _, trees = locality_report.tables([item])
    assert [(c.title, c.optional) for c in table.columns[3:]] == [
        ("σ", 0), ("σ2", 2), ("σ3", 3), ("σ4", 4), ("σ6", 6), ("σ8", 8), ("σ10", 0), ("depth", 11),
    ]
    assert table.rows == [["m", "7", "9.000", *(f"{k}.000" for k in (1, 2, 3, 4, 6, 8, 10)), "4"]]
    assert trees.rows == [["m", *map(str, range(2, 10)), "12.5 %", "1"]]


# --- around the pairs -----------------------------------------------------------------------------


def test_times_of_a_report_add_up(monkeypatch):
    """Started 8 s ago, or not known to have been: then reading the scene counts besides."""
    monkeypatch.setattr(report, "time", SimpleNamespace(perf_counter=lambda: 108.0))
    scene, stats = SimpleNamespace(seconds={"read": 0.5, "pack": 0.25}), {"seconds": {"pack": 0.25, "narrowphase": 1.0}}
    assert report._seconds(scene, stats, 104.0, 106.0, 100.0) == {
        "read": 0.5, "pack": 0.5, "narrowphase": 1.0, "report": 2.0, "other": 4.0, "total": 8.0,
    }
    found = report._seconds(scene, stats, 104.0, 106.0, None)
    assert (found["total"], found["other"]) == (4.75, 0.75)
    assert report._seconds(scene, stats, 107.75, 106.0, None)["other"] == 0.0


def test_counts_that_the_engine_keeps(monkeypatch):
    stats = {"convex_pairs": 3.0, "epa_iterations": 0, "other": 5}
    assert report._work(stats) == {"convex_pairs": 3, "epa_iterations": 0}
    monkeypatch.setattr(platform, "machine", lambda: "")
    assert report.versions()["machine"] is None
    monkeypatch.setattr(platform, "machine", lambda: "box")
    assert report.versions()["machine"] == "box"


@pytest.mark.parametrize(("is_terminal", "delay"), [(True, progress._TERMINAL_DELAY), (False, 2.0)])
def test_a_stage_is_shown_from_its_delay_on(monkeypatch, is_terminal, delay):
    now = [0.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    stream = io.StringIO()
    shown = progress.Progress(stream)
    shown.terminal = is_terminal
    stage = progress._Stage("reading")
    for moment, is_shown in ((0.0, False), (math.nextafter(delay, 0.0), False), (delay, True)):
        now[0] = moment
        shown._show(stage)
        assert bool(stream.getvalue()) == is_shown
