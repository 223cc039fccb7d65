"""What comments and docstrings name in back quotes is there: files, functions, constants, arguments."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from house_sources import nodes

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("adapters", "benchmarks", "collide", "examples", "native", "scenes", "tests")
_FILE = re.compile(r"[\w/.-]+\.(?:py|c|h|md|sh)")
_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*(?:\(\))?")
#: Files of users.
_OF_USERS = (".yaml", ".gz", ".stl", ".urdf")
#: What is not ours, or not there on purpose.
EXCEPTIONS = {"__array__", "timeit"}


class Source(NamedTuple):
    """prose : (line, text) of comments and docstrings.   names : words of everything else, strings too."""

    prose: list[tuple[int, str]]
    names: set[str]


#: Comments and strings, each whole: what is between them is code.
_COMMENT_OR_STRING = re.compile(
    r"""\#[^\n]*|(?:\b[rRbBuUfF]{1,2})?(?:\"{3}(?:\\.|[^\\])*?\"{3}|\'{3}(?:\\.|[^\\])*?\'{3}"""
    r"""|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')""",
    re.DOTALL,
)


def read_source(file: Path) -> Source:
    text, docstrings = file.read_text(encoding="utf-8"), set()
    for node in nodes(file):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node, clean=False):
            docstrings.add(node.body[0].lineno)
    prose: list[tuple[int, str]] = []
    code: list[str] = []
    comment_ends, line, end = 0, 1, 0
    for found in _COMMENT_OR_STRING.finditer(text):
        between, string = text[end : found.start()], found.group()
        code.append(between)
        line, end = line + between.count("\n"), found.end()
        if string[0] == "#":
            words = string.lstrip("#: ")
            if comment_ends == line - 1 and prose:  # back quotes may close on the next line
                prose[-1] = prose[-1][0], f"{prose[-1][1]} {words}"
            else:
                prose.append((line, words))
            comment_ends = line
        elif line in docstrings and not text[text.rfind("\n", 0, found.start()) + 1 : found.start()].strip():
            prose.append((line, string))
        else:
            code.append(string)
        line += string.count("\n")
    code.append(text[end:])
    return Source(prose, set(re.findall(r"\b[A-Za-z_]\w*", "\n".join(code))))


@cache
def sources() -> dict[Path, Source]:
    files = (file for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py")))
    return {file: read_source(file) for file in files if file.name != "built.py"}


@cache
def known() -> tuple[set[str], str]:
    """Names of the whole tree; paths of its files, a line each."""
    names = set().union(*(source.names for source in sources().values()), EXCEPTIONS)
    for file in (ROOT / "native").glob("*.[ch]"):
        names.update(re.findall(r"[A-Za-z_]\w*", file.read_text(encoding="utf-8")))
    files = [file for folder in (*FOLDERS, "docs") for file in (ROOT / folder).rglob("*.*")] + list(ROOT.glob("*.*"))
    names.update(part for file in files for part in (file.stem, file.parent.name))
    return names, "".join(f"\n/{file.relative_to(ROOT).as_posix()}\n" for file in files)


def missing(text: str, beside: frozenset[str] | set[str] = frozenset()) -> list[str]:
    """What a text names in back quotes and is nowhere.   beside : names of the code that it stands in."""
    names, paths = known()
    absent = []
    for quoted in re.findall(r"`+([^`]+)`+", text):
        if _FILE.fullmatch(quoted):
            if f"/{quoted}\n" not in paths:
                absent.append(quoted)
        elif _NAME.fullmatch(quoted) and not quoted.endswith(_OF_USERS):
            parts = quoted.removesuffix("()").split(".")
            if not names.issuperset(parts) or not (parts[0] in beside or _is_member(parts)):
                absent.append(quoted)
    return absent


def _is_member(parts: list[str]) -> bool:
    """Whether ``module.name`` is in a module of that name, where there is one, or a folder in one."""
    if len(parts) < 2 or any(file.parent.parts[-2:] == tuple(parts[-2:]) for file in sources()):
        return True
    modules = [source for file, source in sources().items() if parts[-2] in (file.stem, file.parent.name)]
    return not modules or any(parts[-1] in source.names for source in modules)


@pytest.fixture(scope="module", autouse=True)
def read() -> None:
    """Before the first rule, and no rule's own time."""
    known()


@pytest.mark.parametrize("folder", FOLDERS)
def test_names_in_comments_and_docstrings_exist(folder):
    wrong = [
        f"{file.relative_to(ROOT)}:{line}: {name}"
        for file, source in sources().items()
        if file.relative_to(ROOT).parts[0] == folder
        for line, text in source.prose
        for name in missing(text, source.names)
    ]
    assert not wrong, "\n".join(wrong)


#: In two pieces: words of strings count as names.
_ABSENT = "no_such" + "_thing"


@pytest.mark.parametrize(
    "text",
    ["as in `?.py`", "`narrowphase/?/gjk.py`", "``?``", "`rows.?()`", "`collide.narrowphase.?`", "see\n``?``: `rows`"],
)
def test_rule_finds_what_is_not_there(text):
    assert missing(text.replace("?", _ABSENT)), text


def test_rule_reads_most_of_the_tree():
    prose = [text for source in sources().values() for _, text in source.prose]
    quoted = [name for text in prose for name in re.findall(r"`([^`]+)`", text)]
    assert sum(bool(_NAME.fullmatch(name) or _FILE.fullmatch(name)) for name in quoted) > 1200
