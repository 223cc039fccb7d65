"""The table of names in docs/c-interface.md: every function of C, under a name of Python and of C++ that is there."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import collide

ROOT = Path(__file__).resolve().parents[2]
#: Handles without a row: workspaces are C's alone.
UNLISTED = r"collide_\w+_free|collide_workspace_create"


def rows() -> list[list[list[str]]]:
    """The names in the three columns of each row."""
    page = (ROOT / "docs" / "c-interface.md").read_text(encoding="utf-8").split("\n## Names\n")[1].split("\n## ")[0]
    lines = [line for line in page.splitlines() if line.startswith("| `")]
    return [[re.findall("`([^`]+)`", column) for column in line.strip("|").split(" | ")] for line in lines]


def test_every_function_of_c_has_one_row():
    abi = (ROOT / "native" / "abi.txt").read_text(encoding="utf-8")
    functions = set(re.findall(r"^function .*?\b(collide_\w+)\(", abi, re.MULTILINE))
    listed = Counter(f"collide_{name}" for _, of_c, _ in rows() for name in of_c)
    assert set(listed) == {name for name in functions if not re.fullmatch(UNLISTED, name)}
    assert set(listed.values()) == {1} and len(listed) > 80


def test_names_of_python_and_of_the_header_for_c_plus_plus_are_there():
    header = (ROOT / "native" / "collide.hpp").read_text(encoding="utf-8")
    names = [name for of_python, _, _ in rows() for name in of_python if not name.endswith("=")]
    for name in names:
        value = collide
        for part in name.split("."):
            assert hasattr(value, part), name
            value = getattr(value, part)
    members = [name.split("::")[-1] for _, _, of_cpp in rows() for name in of_cpp]
    missing = [name for name in members if not re.search(rf"\b{name}\b", header)]
    assert not missing and len(names) > 50 and len(members) > 60
