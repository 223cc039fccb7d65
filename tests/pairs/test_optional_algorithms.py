"""Algorithms by name: the default is none, others are found where the table says, unknown ones are named."""

from __future__ import annotations

import re

import pytest

from collide.errors import InvalidArgument
from collide.pairs.optional_algorithms import DEFAULT, named_algorithm
from collide.papers.hierarchies import hierarchy_queries


def test_names():
    assert named_algorithm("collide", None) is None and named_algorithm("collide", DEFAULT) is None
    assert named_algorithm("collide", "barba-langerman") is hierarchy_queries.collide_by_walk


@pytest.mark.parametrize(
    ("query", "name", "others"),
    [
        ("collide", "dobkin-kirkpatrick", '"gjk" or "barba-langerman"'),
        ("collide", "GJK", '"gjk" or "barba-langerman"'),
        ("collide", ["gjk"], '"gjk" or "barba-langerman"'),
    ],
)
def test_unknown_names(query, name, others):
    with pytest.raises(InvalidArgument, match=re.escape(f"algorithm must be {others}, got {name!r}")):
        named_algorithm(query, name)
