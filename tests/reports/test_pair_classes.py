"""Sequences of pairs: their order, the largest bracket, the busiest body, folds, and fields as plain numbers."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from collide.reports import pair_classes
from collide.reports.pair_classes import FIELDS, Fold, Pairs
from collide.results import PAIR_DTYPE, SIMPLEX, UNDECIDED

NAMES = {0: "d", 1: "c", 3: "b", 4: "a"}


def rows_of(*ends, **columns) -> np.ndarray:
    """Rows of (a, b, distance, lower, upper)."""
    rows = np.zeros(len(ends), dtype=PAIR_DTYPE)
    rows["how"] = SIMPLEX
    if ends:
        for name, values in zip(("a", "b", "distance", "lower", "upper"), zip(*ends)):
            rows[name] = values
    rows["hit"] = rows["distance"] <= 0
    for name, values in columns.items():
        rows[name] = values
    return rows


def pairs_of(*ends, approximated=(), **columns) -> Pairs:
    rows = rows_of(*ends, **columns)
    return Pairs(rows, np.arange(len(rows)), NAMES, frozenset(approximated))


def names_of(pairs) -> list[str]:
    return [pair.a + pair.b for pair in pairs]


@pytest.mark.parametrize(("ends", "largest"), [
    ([], 0.0), ([(0.5, 0.5)], 0.5), ([(-0.5, -0.5)], 0.5), ([(-0.25, 0.125)], 0.25), ([(-0.125, 0.25)], 0.25),
    ([(-0.5, -0.25), (0.0, 0.375)], 0.5),
])
def test_the_largest_gap_or_depth_that_brackets_leave_room_for(ends, largest):
    assert pairs_of(*[(0, 1, lower, lower, upper) for lower, upper in ends]).largest() == largest


def test_pairs_are_sorted_by_what_is_proven_then_by_distance_then_by_name():
    rows = rows_of((0, 1, 0.5, 0.5, 0.5), (3, 4, 0.25, 0.25, 0.25), (1, 4, 0.25, 0.25, 0.25), (1, 3, 0.25, 0.25, 0.25),
                   (0, 3, 9.0, 9.0, 9.0))
    result = SimpleNamespace(rows=rows)
    pairs = Pairs.of(result, np.array([0, 1, 2, 3]), NAMES, frozenset())
    assert names_of(pairs) == ["ba", "ca", "cb", "dc"] and len(pairs) == 4
    assert names_of(pairs.by_name()) == ["ba", "ca", "cb", "dc"]
    assert names_of(Pairs.of(result, np.array([4, 0, 3]), NAMES, frozenset()).by_name()) == ["cb", "db", "dc"]
    assert names_of(pairs.among({"a", "b", "c"})) == ["ba", "ca", "cb"] and names_of(pairs.among({"d", "a"})) == []
    assert names_of(pairs[1:3]) == ["ca", "cb"] and pairs[-1] == pairs[3] == list(pairs)[3]
    with pytest.raises(IndexError):
        pairs[4]


@pytest.mark.parametrize("chunk", [1, 2, 3, 4, 100])
def test_pairs_are_all_made_whatever_the_chunks(monkeypatch, chunk):
    monkeypatch.setattr(pair_classes, "_CHUNK", chunk)
    pairs = pairs_of(*[(0, 1, 0.5 * k, 0.5 * k, 0.5 * k) for k in range(4)])
    assert [pair.distance for pair in pairs] == [0.0, 0.5, 1.0, 1.5] == [data["distance"] for data in pairs.dicts()]


def test_fields_are_plain_numbers_without_negative_zeros():
    zero = -0.0
    pairs = pairs_of(
        (0, 1, zero, zero, zero), (1, 3, -0.25, -np.inf, -0.125), (3, 4, 0.5, 0.5, np.inf), (0, 4, -np.inf, -np.inf, 1),
        (0, 3, zero, -1.0, 1.0),
        approximated=["c", "a"], normal=(zero, 1.0, zero), point_a=(zero,) * 3, point_b=(zero, zero, 1.0),
        how=[SIMPLEX] * 4 + [UNDECIDED],
    )
    told = list(pairs.dicts())
    assert "-0.0" not in json.dumps(told, allow_nan=False) and list(told[0]) == list(FIELDS)
    assert [pair["depth"] for pair in told] == [0.0, 0.25, None, None, 0.0]
    assert all(math.copysign(1.0, value) == 1.0 for value in (told[0]["depth"], *told[0]["normal"]))
    assert [(pair["lower"], pair["upper"]) for pair in told[1:4]] == [(None, -0.125), (0.5, None), (None, 1.0)]
    assert [pair["approximated"] for pair in told] == [["c"], ["c"], ["a"], ["a"], []]
    assert [pair.decided for pair in pairs] == [True] * 4 + [False]


def test_the_busiest_bodies_come_first_then_by_name():
    assert pairs_of((0, 1, 1, 1, 1), (0, 3, 1, 1, 1), (1, 4, 1, 1, 1)).busiest() == [
        ("c", 2), ("d", 2), ("a", 1), ("b", 1),
    ]
    assert pairs_of().busiest() == []


def test_bodies_of_more_than_so_many_pairs_have_them_in_one_line():
    """Body d is in three pairs and c in two: of more than 2 or of more than 1; of two such bodies the busier."""
    pairs = pairs_of((0, 1, 1, 1, 1), (0, 3, 1, 1, 1), (1, 3, 1, 1, 1), (0, 4, 1, 1, 1))
    told = lambda folds: [(fold.pair.a + fold.pair.b, fold.body, fold.size) for fold in folds]
    folds, untold = pairs.folded(3, 9)
    assert told(folds) == [("dc", "d", 1), ("db", "d", 1), ("cb", "c", 1), ("da", "d", 1)] and untold == 0
    folds, untold = pairs.folded(2, 9)
    assert told(folds) == [("dc", "d", 3), ("cb", "c", 1)] and untold == 0 and isinstance(folds[0], Fold)
    folds, untold = pairs.folded(2, 1)
    assert told(folds) == [("dc", "d", 3)] and untold == 1
    assert pairs.folded(2, 0) == ([], 4)
    busier_second = pairs_of((1, 0, 1, 1, 1), (0, 3, 1, 1, 1), (4, 0, 1, 1, 1), (1, 3, 1, 1, 1))
    assert told(busier_second.folded(1, 9)[0]) == [("cd", "d", 3), ("cb", "c", 1)]
