"""Algorithms by name: the default is none, others are found where the table says, unknown ones are named."""

from __future__ import annotations

import re

import pytest

from collide.errors import InvalidArgument
from collide.pairs.optional_algorithms import DEFAULT, named_algorithm
from collide.papers.hierarchies import hierarchy_queries


def test_names():
    for query in ("collide", "distance"):
        assert named_algorithm(query, None) is None and named_algorithm(query, DEFAULT) is None
    assert named_algorithm("collide", "barba-langerman") is hierarchy_queries.collide_by_walk
    assert named_algorithm("distance", "dobkin-kirkpatrick") is hierarchy_queries.distance_by_descent


@pytest.mark.parametrize(
    ("query", "name", "others"),
    [
        ("collide", "dobkin-kirkpatrick", '"gjk" or "barba-langerman"'),
        ("distance", "GJK", '"gjk" or "dobkin-kirkpatrick"'),
        ("distance", ["gjk"], '"gjk" or "dobkin-kirkpatrick"'),
    ],
)
def test_unknown_names(query, name, others):
    with pytest.raises(InvalidArgument, match=re.escape(f"algorithm must be {others}, got {name!r}")):
        named_algorithm(query, name)
