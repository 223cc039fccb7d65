"""Reports: classes, order, JSON against its schema, and how the tables read at several widths.

The scene and the World are stand-ins with rows of every class, so that each rule is tested alone;
`test_cli.py` runs the shipped scenes.
"""

from __future__ import annotations

import io
import json
from importlib import resources
from types import SimpleNamespace

import numpy as np
import pytest

import collide
from collide.errors import InvalidArgument
from collide.reports import number_format as units
from collide.reports import report, tables, terminal
from collide.reports.progress import Progress
from collide.results import FORMULA, HOW, PAIR_DTYPE, PLANE, SIMPLEX, UNDECIDED, WorldResult
from collide.shapes import Sphere


def row(a, b, distance, how, width=1e-16, certified=True, parts=(0, 0)):
    """One result row with its bracket centred on the distance."""
    r = np.zeros((), PAIR_DTYPE)
    r["a"], r["b"], r["part_a"], r["part_b"] = a, b, *parts
    r["distance"], r["lower"], r["upper"] = distance, distance - width / 2, distance + width / 2
    r["normal"] = (0.0, 0.6, -0.8)
    r["point_a"] = (0.5, -0.25, 1.0)
    r["point_b"] = r["point_a"] + np.clip(distance, -1e3, 1e3) * r["normal"]
    r["how"], r["certified"] = how, certified
    r["hit"] = distance <= 0 or how == UNDECIDED
    return r


NAMES = {0: "table", 1: "panda/panda_leftfinger", 2: "panda/panda_hand", 3: "a_shelf_with_a_very_long_name_indeed",
         4: "mug", 5: "bowl"}
ROWS = [
    row(0, 1, -0.0123456, SIMPLEX),
    row(0, 2, -0.2, SIMPLEX, parts=(0, 3)),
    row(0, 3, -4e-6, SIMPLEX, width=1e-7, certified=False),
    row(0, 4, 3e-17, UNDECIDED, certified=False),
    row(0, 5, -1e-17, UNDECIDED, certified=False),
    row(1, 2, 0.049, PLANE),
    row(1, 3, 0.002, FORMULA),
]


def body(name, approximation=None, static=False):
    return SimpleNamespace(name=name, shape=Sphere(0.1), X_WB=np.eye(4), static=static, source=f"scene.yaml: {name}",
                           approximation=approximation, owner=None)


def make_scene(rows=ROWS, names=NAMES):
    """A stand-in scene whose World answers with the rows given."""
    n = len(names)
    pairs = n * (n - 1) // 2
    stats = {
        "bodies": n, "static": 1, "pairs": pairs,
        "skipped": {"static–static": 0, "adjacent links": 2, "allowed": 1, "broadphase": pairs - 3 - len(rows)},
        "narrowphase": len(rows), "convex_pairs": 11, "hits": sum(bool(r["hit"]) for r in rows), "undecided": 2,
        "how": {HOW[PLANE]: 4, HOW[SIMPLEX]: 3, HOW[UNDECIDED]: 2},
        "gjk_iterations": 40, "epa_iterations": 9,
        "seconds": {"pack": 1e-4, "broadphase": 2e-4, "narrowphase": 3e-4},
    }
    stacked = np.array(rows, PAIR_DTYPE) if rows else np.zeros(0, PAIR_DTYPE)
    world = SimpleNamespace(
        distances=lambda max_distance, depth: WorldResult(
            stacked[stacked["hit"] | (stacked["distance"] <= max_distance)],
            {k: SimpleNamespace(name=name) for k, name in names.items()},
            collide.certify,
        ),
        stats=stats,
        names=dict(names),
    )
    bodies = [body(name, "convex hull of 152 mesh vertices" if "panda" in name else None, name == "table")
              for name in names.values()]
    return SimpleNamespace(
        name="fake", bodies=bodies, allowed=[], notes=["joint panda_joint4 is at 0.1, outside [-3.07, -0.07]"],
        sources=["scene.yaml"], robots={"panda": SimpleNamespace(missing_meshes=[])}, states={}, placements={},
        seconds={"read": 0.01, "meshes": 0.2},
        world=lambda: world,
    )


def text_of(lines) -> list[str]:
    return ["".join(text for text, _ in line) for line in lines]


# --- classes ------------------------------------------------------------------------------------


def test_every_row_is_in_the_class_its_proof_gives_it():
    r = report.make(make_scene(), clearance=0.05)
    assert [p.depth for p in r.colliding] == [0.2, 0.0123456, 4e-6]  # deepest first
    assert [(p.a, p.b) for p in r.touching] == [("table", "bowl"), ("table", "mug")]
    assert [p.distance for p in r.near] == [0.002, 0.049]  # nearest first
    assert not r.shallow and r.collides


def test_depths_are_ranked_and_told_by_what_is_proven_of_them():
    """A way out that happens to be long ranks nothing first: 0.2 m for certain, then 0.15 … 2.15 m, then ≤ 0.9 m."""
    between, at_most = row(1, 3, -2.15, SIMPLEX, certified=False), row(1, 4, -0.9, SIMPLEX, certified=False)
    between["upper"], at_most["upper"] = -0.15, 0.0
    between["point_a"], between["point_b"] = (0.5, 0.0, 2.0), (0.5, 0.0, -0.15)
    r = report.make(make_scene([between, at_most, row(0, 2, -0.2, SIMPLEX)]))
    assert [p.depth for p in r.colliding] == [0.2, 2.15, 0.9]
    page = text_of(terminal.render(r, everything=False, proofs=False, width=120, whole_names=True))
    first = next(k for k, line in enumerate(page) if line.startswith("COLLIDING"))
    rows = [" ".join(line.split()) for line in page[first:] if "panda/" in line][:3]
    assert "200.000 mm" in rows[0] and "150.000 … 2150.000 mm" in rows[1] and "≤ 900.000 mm" in rows[2], page
    assert "0.500 0.000 0.925" in rows[1], "the middle of the contact, not a metre beside it"
    assert any("at least so deep, at most so deep, both proven" in line for line in page), page


def test_an_l_and_a_ball_in_its_foot_are_five_centimetres_deep_in_a_report():
    world = collide.World()
    angle = collide.Compound(
        [(collide.Box((4, 1, 0.3)), np.eye(4)), (collide.Box((0.3, 1, 2)), collide.pose((-1.85, 0, 1.15)))]
    )
    world.add(angle, name="angle")
    world.add(Sphere(0.1), collide.pose((1.0, 0.0, 0.2)), name="ball")
    world.add(collide.Box((1, 1, 0.1)), collide.pose((1.0, 0.0, -0.13)), name="plate")
    scene = make_scene([], dict(enumerate(("angle", "ball", "plate"))))
    scene.world = lambda: world
    r = report.make(scene)
    told = [(p.a, p.b, round(p.depth, 12), p.certified) for p in r.colliding]
    assert told == [("angle", "plate", 0.07, True), ("angle", "ball", 0.05, True)]


def test_shallow_needs_proof():
    """A collision is set aside only where even the deep end of its bracket is below the limit."""
    scene = make_scene([row(0, 1, -0.001, SIMPLEX), row(0, 2, -0.001, SIMPLEX, width=0.0018)])
    r = report.make(scene, min_depth=0.0015)
    assert [p.b for p in r.shallow] == ["panda/panda_leftfinger"]
    assert [p.b for p in r.colliding] == ["panda/panda_hand"]


def test_counts_add_up():
    r = report.make(make_scene(), clearance=0.05)
    p = r.pairs
    assert p["total"] == p["excluded"] + p["apart_by_boxes"] + p["tested"]
    assert p["excluded"] == sum(entry["pairs"] for entry in r.skipped) == 3
    assert [entry["pairs"] for entry in r.proofs] == sorted((e["pairs"] for e in r.proofs), reverse=True)
    assert all(entry["sentence"] != entry["how"] for entry in r.proofs)


def test_every_argument_has_a_sentence():
    from collide.reports.proofs import SENTENCES

    assert set(HOW) <= set(SENTENCES)


def test_stages_and_other_add_up_to_the_total():
    s = report.make(make_scene()).seconds
    assert s["other"] >= 0 and list(s)[-1] == "total"
    assert s["total"] >= s["read"] + s["meshes"]


@pytest.mark.parametrize("bad", [-1.0, float("nan"), float("inf"), "far"])
def test_refuses_a_clearance_that_is_no_length(bad):
    with pytest.raises(InvalidArgument, match="clearance"):
        report.make(make_scene(), clearance=bad)


# --- JSON ---------------------------------------------------------------------------------------


def validate(data):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is in the dev extra")
    schema = json.loads(resources.files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(data)


@pytest.mark.parametrize("rows", [ROWS, [], [row(0, 1, -np.inf, SIMPLEX, width=0)]], ids=["all", "none", "unbounded"])
def test_json_keeps_its_schema_and_its_digits(rows):
    data = report.make(make_scene(rows), clearance=0.05, min_depth=1e-5).to_dict()
    written = json.dumps(data, allow_nan=False)
    validate(json.loads(written))
    assert json.loads(written) == data


def test_document_names_every_field():
    schema = json.loads(resources.files("collide.reports").joinpath("schema.json").read_text(encoding="utf-8"))
    page = report_page()
    for name in [*schema["properties"], *schema["$defs"]["pair"]["properties"]]:
        assert f"`{name}`" in page, name


def report_page() -> str:
    from pathlib import Path

    page = Path(__file__).parents[2] / "docs" / "report-schema.md"
    if not page.is_file():
        pytest.skip("docs are not beside the tests")
    return page.read_text(encoding="utf-8")


# --- terminal -----------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [40, 60, 80, 100, 120, 160])
def test_no_line_is_wider_than_the_terminal(width):
    lines = text_of(terminal.render(report.make(make_scene(), clearance=0.05), width=width))
    assert max(map(len, lines)) <= width, max(lines, key=len)
    for number in ("200.000 mm", "12.346 mm", "0.00400 mm", "2.000 mm", "49.000 mm"):
        assert any(number in line for line in lines), number


def test_the_verdict_comes_first():
    first = text_of(terminal.render(report.make(make_scene(), clearance=0.05), width=120))[0]
    assert first == "3 collisions, 2 touching, 2 within 50 mm, 3 of 15 pairs never tested"


@pytest.mark.parametrize("names, end", [({0: "a"}, "no pair to test"), ({0: "a", 1: "b"}, "1 pair answered")])
def test_small_scenes_have_verdicts_too(names, end):
    scene = make_scene([], names)
    scene.world().stats["skipped"] = {}
    assert report.make(scene).verdict() == f"no collision, {end}"


def test_sections_come_in_order_and_empty_ones_not_at_all():
    lines = text_of(terminal.render(report.make(make_scene(), clearance=0.05)))
    titles = [line.split("  ")[0] for line in lines if line[:2].isupper()]
    assert titles == ["COLLIDING", "NEAR", "BESIDES"]
    everything = text_of(terminal.render(report.make(make_scene(), clearance=0.05), everything=True, proofs=True))
    titles = [line.split("  ")[0] for line in everything if line[:2].isupper()]
    assert titles == ["COLLIDING", "NEAR", "TOUCHING", "APPROXIMATED", "NEVER TESTED", "HOW EACH ANSWER IS KNOWN",
                      "NOTES", "TIME"]
    free = text_of(terminal.render(report.make(make_scene([]))))
    assert free[0].startswith("no collision, ") and not any("COLLIDING" in line for line in free)


def test_what_is_left_out_is_said_once():
    made = report.make(make_scene(), clearance=0.05)
    narrow, wide = (text_of(terminal.render(made, proofs=True, width=w)) for w in (80, 160))
    assert sum("No room" in line for line in narrow) == 1 and "decided by" in " ".join(narrow[-2:])
    assert not any("No room" in line for line in wide)


def test_a_wide_bracket_is_written_out():
    lines = text_of(terminal.render(report.make(make_scene()), width=120))
    assert any("depth known to 0.100 µm only" in line for line in lines)


def test_names_give_way_before_numbers_and_keep_both_ends():
    lines = text_of(terminal.render(report.make(make_scene(), clearance=0.05), width=60))
    shortened = next(line for line in lines if "…" in line)
    assert "a_she" in shortened and "indeed" in shortened
    whole = text_of(terminal.render(report.make(make_scene(), clearance=0.05), width=60, whole_names=True))
    assert any("a_shelf_with_a_very_long_name_indeed" in line for line in whole)


def test_long_lists_are_shortened_unless_all_is_asked_for():
    names = {k: f"body{k:02}" for k in range(80)}
    rows = [row(2 * k, 2 * k + 1, -0.01 * (k + 1), SIMPLEX) for k in range(40)]
    r = report.make(make_scene(rows, names))
    lines = text_of(terminal.render(r))
    assert "  … and 28 more (--all)" in lines and not any("body55" in line for line in lines)
    assert any("body00" in line for line in text_of(terminal.render(r, everything=True)))


def test_a_name_cannot_command_the_terminal():
    names = {**NAMES, 1: "evil\x1b[2J\nname", 2: "[red]panda[/red]"}
    lines = text_of(terminal.render(report.make(make_scene(names=names), clearance=0.05), width=160))
    assert not any("\x1b" in line or "\n" in line for line in lines)
    assert any("[red]panda[/red]" in line for line in lines)


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    encoding = "utf-8"

    def isatty(self):
        return True


def test_colours_only_on_a_terminal_that_wants_them(monkeypatch):
    pytest.importorskip("rich", reason="rich is in the robots extra")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    lines = terminal.render(report.make(make_scene(), clearance=0.05), width=80)
    streams = coloured, piped = Terminal(), io.StringIO()
    for stream in streams:
        terminal.write(lines, stream)
    assert "\x1b[" in coloured.getvalue() and "\x1b" not in piped.getvalue()
    monkeypatch.setenv("NO_COLOR", "1")
    quiet = Terminal()
    terminal.write(lines, quiet)
    assert quiet.getvalue() == piped.getvalue()


def test_rich_and_plain_say_the_same(monkeypatch):
    pytest.importorskip("rich", reason="rich is in the robots extra")
    import re

    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    lines = terminal.render(report.make(make_scene(), clearance=0.05), width=80)
    coloured, piped = Terminal(), io.StringIO()
    terminal.write(lines, coloured)
    terminal.write(lines, piped)
    stripped = re.sub(r"\x1b\[[0-9;]*m", "", coloured.getvalue())
    assert [s.rstrip() for s in stripped.splitlines()] == piped.getvalue().splitlines()


def test_without_rich_a_terminal_gets_plain_text(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "rich.console", None)
    lines = terminal.render(report.make(make_scene()), width=80)
    shown, piped = Terminal(), io.StringIO()
    terminal.write(lines, shown)
    terminal.write(lines, piped)
    assert shown.getvalue() == piped.getvalue()


def test_ascii_terminals_are_served():
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    terminal.write(terminal.render(report.make(make_scene(), clearance=0.05)), stream)
    stream.flush()
    assert b"COLLIDING" in raw.getvalue() and b"um" in raw.getvalue()


# --- tables and units ---------------------------------------------------------------------------


def test_columns_are_given_up_in_order_and_said():
    table = tables.Table("T", [tables.Column("name", "name"), tables.Column("one"), tables.Column("two", "label", 1),
                               tables.Column("three", "label", 2)], [["n" * 10, "1" * 8, "2" * 10, "3" * 10]])
    assert not tables.lay_out(table, 60).dropped
    assert tables.lay_out(table, 40).dropped == ["three"]
    assert tables.lay_out(table, 26).dropped == ["two", "three"]


@pytest.mark.parametrize("text, width", [("short", 10), ("a_long_name", 9), ("日本語の名前です", 9), ("abc", 1)])
def test_shorten_never_exceeds(text, width):
    assert tables.width_of(tables.shorten(text, width)) <= width


@pytest.mark.parametrize(
    "metres, text",
    [(0.0, "0.000 mm"), (0.0123456, "12.346 mm"), (1.5, "1500.000 mm"), (4e-6, "4.000 µm"), (12.0, "12.000 m"),
     (3.2e-13, "3.20e-13 m"), (2e7, "2.00e+07 m"), (-0.05, "-50.000 mm"), (float("inf"), "unbounded ")],
)
def test_lengths_keep_three_digits_and_a_unit(metres, text):
    assert units.lengths([metres]) == [text]


def test_lengths_of_a_column_have_one_unit_and_one_width():
    column = units.lengths([0.2, 4e-6, 0.0123456])
    assert len({len(text) for text in column}) == len({text.split()[1] for text in column}) == 1


@pytest.mark.parametrize(
    "text, metres",
    [("0.05", 0.05), ("50mm", 0.05), ("5 cm", 0.05), ("1e-3m", 1e-3), ("20um", 2e-5), ("20 µm", 2e-5), ("0", 0.0)],
)
def test_lengths_parse_with_units(text, metres):
    assert units.parse_length(text) == pytest.approx(metres, rel=1e-15)


@pytest.mark.parametrize("text", ["", "mm", "5 parsec", "-1mm", "nan", "inf", "1e999", "1,5"])
def test_what_is_no_length_is_refused_with_its_text(text):
    with pytest.raises(InvalidArgument, match="length"):
        units.parse_length(text)


def test_coordinates_choose_a_unit_that_shows_digits():
    assert units.coordinates([(1e-6, 0.0, 0.0)])[0] == "µm"
    assert units.coordinates([(0.5, 0.0, 0.0)]) == ("m", ["0.500 0.000 0.000"])
    assert units.coordinates([])[0] == "m"


# --- progress -----------------------------------------------------------------------------------


def test_progress_is_silent_about_short_work_and_names_long_work():
    stream = io.StringIO()
    with Progress(stream, delay=60.0)("short"):
        pass
    assert stream.getvalue() == ""
    progress = Progress(stream, delay=0.0)
    with progress("long"):
        wait_until(lambda: stream.getvalue())
    assert stream.getvalue().startswith("collide: long ...\ncollide: long: done in ")


def test_progress_on_a_terminal_leaves_no_trace(monkeypatch):
    monkeypatch.setattr("collide.reports.progress._TERMINAL_DELAY", 0.0)
    stream = Terminal()
    progress = Progress(stream)
    with progress("outer"), progress("inner"):
        wait_until(lambda: "inner" in stream.getvalue())
    assert stream.getvalue().endswith("\r\x1b[2K") and "outer" not in stream.getvalue()


def wait_until(condition, seconds=5.0):
    import time

    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing was written"
        time.sleep(0.01)
