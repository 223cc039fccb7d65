"""Docstrings say their nouns: words that stand for other words are at most 3 % of a docstring's words.

"Make a direction a candidate, if it is one and none of those there are" has a meaning for its author alone. A sentence
with a subject, a verb, a quantity and a unit needs few of the eight words; the rule is in CONTRIBUTING.md.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest
from house_sources import ROOT, nodes, none_of, shown, sources

STAND_INS = frozenset({"that", "which", "it", "one", "none", "there", "those", "such"})
LARGEST_SHARE = 0.03
#: A docstring of fewer words may hold a single word of the eight.
SHORT = 33
#: Rooms and files of `collide` whose docstrings are held to the rule.
HELD = (
    "__init__.py", "__main__.py", "base", "broadphase", "casts", "certificates", "cli", "curved", "errors.py", "hull",
    "kernels", "least_distance", "lowering", "mesh", "motion", "numerics", "pages", "pairs", "papers", "polytopes.py",
    "pose_arrays.py", "reports", "results.py", "robots", "shapes", "solids", "surface_queries", "support", "sweeps",
    "transforms.py", "worlds",
)
#: Rooms and files still to be rewritten. Only to be struck out.
OPEN = ("contact", "narrowphase")


def stand_ins(docstring: str) -> tuple[int, int]:
    """(words of the eight, all words) of a docstring, code spans and directives in back quotes left out."""
    prose = re.sub(r"``.*?``|`[^`]*`", "", docstring, flags=re.DOTALL)
    words = re.findall(r"[a-z]+", prose.lower())
    return sum(word in STAND_INS for word in words), len(words)


def is_refused(docstring: str) -> bool:
    n_stand_ins, n_words = stand_ins(docstring)
    most = 1 if n_words < SHORT else LARGEST_SHARE * n_words
    return n_stand_ins > most


def docstrings(place: str) -> Iterator[tuple[str, str]]:
    """(file:line name, docstring) of modules, classes and functions of a room or a file of `collide`."""
    for file in sources("collide"):
        if file.relative_to(ROOT / "collide").parts[0] != place:
            continue
        for node in nodes(file):
            has_docstring = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
            if has_docstring and (text := ast.get_docstring(node)):
                yield f"{shown(file)}:{node.body[0].lineno} {getattr(node, 'name', 'module')}", text


@pytest.mark.parametrize("place", HELD)
def test_docstrings_say_their_nouns(place):
    none_of(
        f"{where}: {stand_ins(text)[0]} of {stand_ins(text)[1]} words stand for others: {text.splitlines()[0]}"
        for where, text in docstrings(place)
        if is_refused(text)
    )
    assert any(docstrings(place)), f"{place} has no docstring: is the name right?"


def test_every_room_is_held_or_named_as_open():
    """An open room that keeps the rule is held from then on."""
    places = {file.relative_to(ROOT / "collide").parts[0] for file in sources("collide")}
    assert sorted((*HELD, *OPEN)) == sorted(places)
    none_of(
        f"collide/{place} keeps the rule: move it from OPEN to HELD"
        for place in OPEN
        if not any(is_refused(text) for _, text in docstrings(place))
    )


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        ("Make a direction a candidate, if it is one and none of those there are.", True),
        ("Write for each facet the one that stands for it, itself where none does.", True),
        ("Bodies that move.", False),  # a single word of a short docstring
        ("Bodies that move, and those around.", True),
        ("Which ``that which it one none`` and `it` are names.", False),
        ("distance " * 31 + "it", False),  # 1 of 32 words: short
        ("distance " * 32 + "it", True),  # 1 of 33
        ("distance " * 33 + "it", False),  # 1 of 34
        ("it " * 3 + "distance " * 97, False),
        ("it " * 4 + "distance " * 97, True),
        ("Such\n\n    a ``code\n    span`` is no such thing.", True),
    ],
)
def test_rule_knows_prose_from_riddles(text, refused):
    assert is_refused(text) == refused
