"""Rows, notes and lines of a report's tables, made of pairs one by one: bounds, ranges, folds, what is left out."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from collide.reports import proofs
from collide.reports.pair_classes import Fold, Pair
from collide.reports.report_tables import (
    _approximation_line,
    _bracket_notes,
    _fold_notes,
    _measured,
    _mesh_line,
    _note_lines,
    _overlap_line,
    _pair_table,
    _place,
    _skip_line,
    _touching_line,
    _verdict,
    depth_texts,
    looked_at_first,
)


def pair(a="a", b="b", distance=-0.002, lower=-0.002, upper=-0.002, depth=0.002, certified=True, **values) -> Pair:
    values = {"how": "simplex", "approximated": [], "part_a": 0, "part_b": 0, **values}
    return Pair(a, b, distance, depth, lower, upper, [0.0, 0.0, 1.0], [1.0, 2.0, 3.0], [1.0, 2.0, 5.0],
                certified=certified, **values)


#: No depth is known but that it is at most so large; it lies between two lengths; it is not certified, and near.
BOUND = pair(upper=0.0, lower=-0.005, depth=0.005, certified=False)
RANGE = pair(upper=-0.002, lower=-0.005, depth=0.005, certified=False)
NARROW = pair(upper=-0.00499, lower=-0.005, depth=0.005, certified=False)


class Some(list):
    """Pairs as a report has them: none of them folded."""

    def folded(self, max_pairs, limit):
        return [Fold(each, each.a, 1) for each in self[:limit]], max(len(self) - limit, 0)


@pytest.mark.parametrize(("one", "text", "z"), [
    (BOUND, "≤ 5.000 mm", 4.0), (RANGE, "2.000 … 5.000 mm", 4.0), (NARROW, "5.000 mm", 3.0), (pair(), "2.000 mm", 3.0),
])
def test_depths_that_are_bounds_or_ranges(one, text, z):
    """Those are told to be in the middle of the contact."""
    assert [each.strip() for each in depth_texts([one])] == [text] and _place(one) == [1.0, 2.0, z]


def test_notes_say_which_signs_there_are():
    bound, a_range = "≤: a move that long", "…: at least so deep"
    for pairs, begins in (([BOUND], [bound]), ([RANGE], [a_range]), ([BOUND, RANGE], [bound, a_range]), ([pair()], []),
                          ([NARROW], ["a and b: depth known to"])):
        notes = _bracket_notes(pairs, "depth", False)
        assert len(notes) == len(begins) and all(note.startswith(begin) for note, begin in zip(notes, begins)), notes
    assert _bracket_notes([BOUND, NARROW], "within", False) == []


@pytest.mark.parametrize("n", [1, 3, 4, 5, 9])
def test_wide_brackets_are_listed_up_to_three_and_counted(n):
    notes = _bracket_notes([NARROW] * n, "depth", False)
    assert len(notes) == min(n, 4) and len(_bracket_notes([NARROW] * n, "depth", True)) == n
    assert (notes[-1] == f"… and {n - 3} more with a wide bracket (--all)") == (n > 3)


@pytest.mark.parametrize("n", [0, 1, 3, 4, 6])
def test_folds_are_named_up_to_three_and_counted(n):
    folds = [Fold(pair(), f"body{k}", k + 2) for k in range(n)] + [Fold(pair(), "single", 1)]
    notes = _fold_notes(folds)
    if not n:
        assert notes == []
        return
    named = ", ".join(f"body{k} with {k + 1} more" for k in range(min(n, 3)))
    rest = f", … ({n - 3} more such)" if n > 3 else ""
    assert notes == [f"+: also {named}{rest} (--all lists them)"]


def test_a_table_has_a_column_of_folds_where_there_are_any():
    def titles(pairs, everything=False, proofs=False, measure="depth"):
        return [column.title for column in _pair_table("T", "near", pairs, measure, everything, proofs).columns]

    class Folded(Some):
        def folded(self, max_pairs, limit):
            return [Fold(self[0], "a", 3), Fold(self[-1], "b", 1)], 7

    plain = ["body A", "body B", "depth", "at x y z [m]", "normal A→B"]
    assert titles(Some([pair(), pair()])) == titles(Folded([pair(), pair()]), everything=True) == plain
    table = _pair_table("T", "near", Folded([pair(), pair()]), "depth", False, False)
    assert [column.title for column in table.columns] == [*plain[:2], "and", *plain[2:]]
    assert [row[2] for row in table.rows] == ["+2", ""] and table.more == 7
    assert titles(Some([pair()]), proofs=True) == [*plain, "known to", "decided by"]
    assert titles(Some([pair(part_b=2)]), proofs=True) == [*plain, "known to", "decided by", "parts"]
    assert titles(Some([pair()]), measure="within")[2::3] == ["within", "exactly"]


def test_names_of_bodies_that_stand_for_another_shape_are_marked():
    table = _pair_table("T", "near", Some([pair(approximated=["b"])]), "depth", False, False)
    assert table.rows[0][:2] == ["a", "≈ b"]


def test_numbers_of_pairs():
    for lower, within in ((-3.0, 3.0), (-1.0, 2.0)):
        assert _measured(pair(lower=lower, upper=2.0), "within") == within
    assert _measured(pair(lower=None), "within") == _measured(pair(depth=None), "depth") == math.inf
    assert _measured(pair(distance=0.25), "distance") == 0.25
    assert _verdict(pair()) == "meet" and _verdict(pair(depth=None)) == "apart"
    assert _verdict(pair(how=proofs.UNDECIDED_NAME)) == "open"


# --- lines ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 7, 8, 9, 12])
def test_notes_are_listed_up_to_eight_lines(n):
    notes = [f"note {k}" for k in range(n)]
    lines = _note_lines(SimpleNamespace(missing_meshes=[], asks=[], notes=notes))
    assert len(lines) == min(n, 8) and [label for label, _ in lines] == ["notes", *[""] * 7][: len(lines)]
    if n > 8:
        assert lines[-1][1] == f"… and {n - 7} more (--all)" and [text for _, text in lines[:-1]] == notes[:7]
    else:
        assert [text for _, text in lines] == notes


def test_what_is_looked_at_first_stands_above_and_not_among_the_notes():
    asks = [f"mesh {k} is 120 m across: is it in millimetres?" for k in range(4)]
    repaired = [{"body": f"m{k}", "what": "repaired: turned 2 facets over"} for k in (0, 0, 1, 2, 3)]
    hull = [{"body": "h", "what": "its convex hull"}]
    made = SimpleNamespace(missing_meshes=["lost"], asks=asks, notes=[*asks, "other", "lost"],
                           approximations=[*repaired, *hull])
    assert _note_lines(made) == [("notes", "other")]
    lines = looked_at_first(made)
    assert lines[:3] == ["! NOT CHECKED: lost", f"! {asks[0]}", f"! {asks[1]}"]
    assert lines[3] == "! 2 more of this kind (--all)"
    assert lines[4:] == ["! 4 meshes repaired, answers hold for the repaired: m0, m1, m2, …"]
    nothing = SimpleNamespace(missing_meshes=[], asks=[], notes=["other"], approximations=hull)
    assert looked_at_first(nothing) == []


@pytest.mark.parametrize("n", [1, 3, 4])
def test_overlaps_are_told_the_largest_first(n):
    overlaps = [{"a": f"a{k}", "b": "b", "volume": float(k)} for k in range(n + 1)]
    line = _overlap_line(SimpleNamespace(overlaps=overlaps))
    assert line.startswith(f"{n} pair{'s' * (n > 1)} of solids") and f" of a{n} and b" in line and "a0" not in line
    assert line.endswith(", …") == (n > 3) and line.count(" and b") == min(n, 3)
    assert _overlap_line(SimpleNamespace(overlaps=overlaps[:1])) == ""


def test_meshes_in_a_line():
    solid = {"body": "s", "solid": True, "what": "solid"}
    sheets = [{"body": f"m{k}", "solid": False, "what": "surface"} for k in range(4)]
    told = lambda meshes: _mesh_line(SimpleNamespace(meshes=meshes))
    assert told([]) == "" and told([solid]) == "1 as they are, triangle by triangle; all are solid"
    assert told([solid, sheets[0]]).endswith("; m0 is a surface")
    assert told(sheets[:3]).endswith("; 3 have no inside, a surface only: m0, m1, m2")
    assert told(sheets).endswith("; 4 have no inside, a surface only: m0, m1, m2, …")


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_stand_ins_in_a_line(n):
    entries = [{"body": f"b{k}", "what": "hull"} for k in range(n)]
    line = _approximation_line(SimpleNamespace(approximations=entries))
    assert line == ("" if not n else f"≈ {n} bod{'y' if n == 1 else 'ies'}, answers hold for these: "
                    + ", ".join(f"b{k} (hull)" for k in range(min(n, 2))) + ", …" * (n > 2))


def test_pairs_that_are_never_tested_in_a_line():
    counts = {"excluded": 3, "total": 10}
    entries = [{"pairs": 2, "reason": "static–static"}, {"pairs": 1, "reason": "SRDF: Never"}]
    report = SimpleNamespace(skipped=entries, pairs=counts)
    assert _skip_line(report) == "3 of 10 pairs: 2 static–static, 1 SRDF: Never"
    assert _skip_line(SimpleNamespace(skipped=[], pairs=counts)) == ""


@pytest.mark.parametrize(("names", "often", "words"), [
    ("", [], ""), ("ab", [("a", 1), ("b", 1)], "1 pair, gap or overlap at most 2.000 µm: a and b"),
    ("abcdefgh", [(name, 1) for name in "abcdefgh"],
     "4 pairs, gap or overlap at most 2.000 µm: a and b, c and d, e and f, …"),
    ("abacadae", [("a", 4), ("b", 1), ("c", 1)], "4 pairs, gap or overlap at most 2.000 µm: 4 with a, …"),
    ("abacad", [("a", 3), ("b", 1)], "3 pairs, gap or overlap at most 2.000 µm: a and b, a and c, a and d"),
])
def test_touching_pairs_in_a_line(names, often, words):
    """Bodies that are in several of more than three pairs are named; where there is none, the first pairs are."""
    class Touching(Some):
        largest, busiest = (lambda self: 2e-6), (lambda self: often)

    touching = Touching(pair(a, b) for a, b in zip(names[::2], names[1::2]))
    assert _touching_line(SimpleNamespace(touching=touching)) == words
