"""Docstrings say their nouns: words that stand for other words are at most 3 % of a docstring's words.

"Make a direction a candidate, if it is one and none of those there are" has a meaning for its author alone. A sentence
with a subject, a verb, a quantity and a unit needs few of the eight words; the rule is in CONTRIBUTING.md.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest
from house_sources import nodes, none_of, shown, sources

STAND_INS = frozenset({"that", "which", "it", "one", "none", "there", "those", "such"})
LARGEST_SHARE = 0.03
#: A docstring of fewer words may hold a single word of the eight.
SHORT = 33


def stand_ins(docstring: str) -> tuple[int, int]:
    """(words of the eight, all words) of a docstring, code spans and directives in back quotes left out."""
    prose = re.sub(r"``.*?``|`[^`]*`", "", docstring, flags=re.DOTALL)
    words = re.findall(r"[a-z]+", prose.lower())
    return sum(word in STAND_INS for word in words), len(words)


def is_refused(docstring: str) -> bool:
    n_stand_ins, n_words = stand_ins(docstring)
    most = 1 if n_words < SHORT else LARGEST_SHARE * n_words
    return n_stand_ins > most


def docstrings() -> Iterator[tuple[str, str]]:
    """(file:line name, docstring) of the modules, classes and functions of `collide`."""
    for file in sources("collide"):
        for node in nodes(file):
            has_docstring = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
            if has_docstring and (text := ast.get_docstring(node)):
                yield f"{shown(file)}:{node.body[0].lineno} {getattr(node, 'name', 'module')}", text


def test_docstrings_say_their_nouns():
    found = list(docstrings())
    assert len(found) > 4000
    none_of(
        f"{where}: {stand_ins(text)[0]} of {stand_ins(text)[1]} words stand for others: {text.splitlines()[0]}"
        for where, text in found
        if is_refused(text)
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
