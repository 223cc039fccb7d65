"""Names are the field's words: no identifier of ours is a private word that docs/glossary.md has a better one for.

The syntax tree gives what a file names itself: modules, functions, classes, arguments, variables, attributes and
constants. What it merely uses of others (``str.split``) is not judged.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from house_sources import nodes

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("collide", "adapters", "scenes", "benchmarks", "examples")

#: Part of a name (between underscores) → what to write instead.
PARTS = {
    "alike": "same_tree, or what is equal",
    "begun": "is_building, started",
    "calm": "leaves_without_improvement",
    "chosen": "indices, or what of: rows, facets",
    "dives": "what is counted: descents",
    "endless": "unbounded",
    "hasty": "fast_compile, opt_level",
    "hopeless": "too_small",
    "nobody": "is_empty",
    "patience": "the limit: delay_s, max_leaves",
    "plant": "build (lazy tree)",
    "planted": "is_built (lazy tree)",
    "plural": "is_compound",
    "room": "workspace, lane block",
    "rooms": "workspaces",
    "roomy": "well_conditioned",
    "said": "status, message",
    "seldom": "cold",
    "shown": "label, text, or what is printed",
    "speaker": "find (union–find)",
    "sure": "proven",
    "tell": "describe, report",
    "told": "out, status, reported",
    "unsure": "ambiguous",
    "vague": "ambiguous",
    "waits": "is_queued",
}
#: A whole name (without leading underscores and trailing digits) → what to write instead.
WHOLE = {
    "clear": "proven_apart, gap",
    "decide": "settle",
    "few": "max_*, n_*",
    "found": "what was found: rows, pairs, hits",
    "given": "values, arguments, X_WA: what was given",
    "halves": "halfspaces",
    "kept": "n_kept, remaining",
    "left": "remaining (left child of a tree excepted)",
    "loose": "error_bound",
    "many": "n_*",
    "most": "max_*",
    "one": "A, or what it is: pair, body, row",
    "other": "B, or what it is (an operator's argument excepted)",
    "own": "what it is: kernel, body",
    "pick": "select",
    "posed": "PosesWithSlop, ContactFrame, ExactPlacement: which of them",
    "swept": "convex_convex",
    "turn": "rotation",
}
#: First part of a longer name → what to write instead.
FIRST = {"few": "max_", "many": "n_", "most": "max_"}
#: (file, name) → why the word is right there.
EXCEPTIONS: dict[tuple[str, str], str] = {
    **{
        (
            f"adapters/peers/{name}.py",
            "P",
        ): "polytopes P and Q in their own frames, as in the literature; A and B are their images"
        for name in ("exact", "exact_meshes", "exact_peer")
    },
    **{
        (f"collide/papers/hierarchies/{name}.py", "P"): "the polyhedra P and Q of Barba and Langerman"
        for name in ("hierarchy_queries", "matrix_game", "validate_walk", "walk_steps")
    },
    ("adapters/hosts/fcl_managers.py", "clear"): "python-fcl's name",
    **{
        (f"adapters/hosts/coal_{name}.py", word): "coal's name"
        for name, word in (
            ("containers", "other"), ("enums", "BVH_BUILD_STATE_BEGUN"), ("enums", "BVH_BUILD_STATE_REPLACE_BEGUN"),
            ("enums", "BVH_BUILD_STATE_UPDATE_BEGUN"), ("managers", "clear"), ("requests", "clear"),
            ("requests", "other"), ("transform", "other"),
        )
    },
    ("collide/narrowphase/dispatch.py", "P"): "a cell of the table: Method.PLANES",
    ("scenes/families/case.py", "P"): "the same: the arguments of the exact oracle, field by field",
    ("scenes/worst_cases.py", "left"): "beside right: two vertices of one roof",
    ("collide/reports/number_format.py", "plural"): "of English grammar",
    **{
        (f"collide/papers/hierarchies/{name}.py", "P"): "polytopes P and R, Q the polar of R, of Barba and Langerman"
        for name in ("hierarchy_queries", "matrix_game", "validate_walk", "walk_steps")
    },
    **{
        (f"collide/papers/polytopes/{name}.py", "P"): "the polygons P and Q of Barba and Langerman"
        for name in ("planar_certificates", "planar_predicates")
    },
    ("collide/results.py", "SWEPT"): "swept overlap: how a pair was decided, one of `How`",
}
#: Rooms that are being rebuilt, and how many names each may still have; none is. Numbers only go down.
ALLOWED_FOR_NOW: dict[str, int] = {}


def files() -> list[Path]:
    return sorted(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py") if file.name != "built.py")


def identifiers(found: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """(line, name) of everything that a file names."""
    for node in found:
        if isinstance(node, ast.FunctionDef):
            yield node.lineno, node.name
            # Python's own word for the second operand
            operator = re.fullmatch(r"__\w+__", node.name)
            yield from ((a.lineno, a.arg) for a in arguments(node) if not (operator and a.arg == "other"))
        elif isinstance(node, ast.Lambda):
            yield from ((a.lineno, a.arg) for a in arguments(node))
        elif isinstance(node, ast.ClassDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.attr


def arguments(node: ast.FunctionDef | ast.Lambda) -> list[ast.arg]:
    given = node.args
    return [*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))]


@cache
def better(name: str) -> str | None:
    """What to write instead of a name, None where it is a good one."""
    plain = re.sub(r"\d+$", "", name.strip("_"))
    if plain in ("O", "P"):
        return "A, B"
    parts = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", plain).lower().split("_")
    if len(parts) == 1 and parts[0] in WHOLE:
        return WHOLE[parts[0]]
    if len(parts) > 1 and parts[0] in FIRST:
        return FIRST[parts[0]] + "_".join(parts[1:])
    return next((PARTS[part] for part in parts if part in PARTS), None)


@cache
def complaints() -> dict[tuple[str, str], list[str]]:
    """(file, name) → what is wrong with it, for every name that the lists above hold."""
    wrong: dict[tuple[str, str], list[str]] = {}
    for file in files():
        place = file.relative_to(ROOT).as_posix()
        named = [(1, file.stem), *identifiers(nodes(file))]
        for line, name in named:
            if (word := better(name)) is not None:
                wrong.setdefault((place, name), []).append(f"{place}:{line}: {name}: write {word}")
    return wrong


def room(place: str) -> str:
    """``collide/narrowphase/gjk/gjk.py`` → ``collide/narrowphase/gjk``; a file of its own where it is in no room."""
    folder = place.rpartition("/")[0]
    return place if folder == "collide" else folder


def test_names_are_the_words_of_the_field():
    by_room: dict[str, list[str]] = {}
    for (place, name), lines in complaints().items():
        if (place, name) not in EXCEPTIONS:
            by_room.setdefault(room(place), []).append(lines[0])
    wrong = [line for name, lines in by_room.items() if len(lines) > ALLOWED_FOR_NOW.get(name, 0) for line in lines]
    assert not wrong, "\n" + "\n".join(wrong)


#: Words for which `WHOLE` has better ones, of those that C is held to; its code is younger than the rule.
OF_C = {"few", "left", "many"}


def test_names_of_c_are_the_words_of_the_field():
    """Every identifier of C outside comments and strings; COLLIDE_ENDLESS_DEPTH is public."""
    wrong = []
    for file in sorted((ROOT / "native").glob("*.[ch]")):
        code = re.sub(r'/\*.*?\*/|"(?:\\.|[^"\\])*"', "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        for name in sorted(set(re.findall(r"[A-Za-z_]\w*", code)) - {"COLLIDE_ENDLESS_DEPTH"}):
            if (word := better(name)) is not None and (name not in WHOLE or name in OF_C):
                wrong.append(f"{file.name}: {name}: write {word}")
    assert not wrong, "\n".join(wrong)


def test_exceptions_are_needed():
    """An exception that nobody needs any more would let the word come back."""
    unneeded = [f"{place}: {name}" for place, name in EXCEPTIONS if (place, name) not in complaints()]
    assert not unneeded, unneeded


@pytest.mark.parametrize(
    ("name", "good"),
    [
        ("_told", False), ("told_at", False), ("OUT_OF_ROOM", False), ("most_facets", False), ("other", False),
        ("O", False),
        ("Posed", False), ("foundations", True), ("max_facets", True), ("another", True), ("mostly", True),
        ("PosedPair", True),
    ],
)
def test_rule_knows_good_names_from_bad(name, good):
    assert (better(name) is None) == good


if __name__ == "__main__":  # for the hook of pre-commit, and to see what is left
    for key, lines in complaints().items():
        if key not in EXCEPTIONS:
            print(*lines, sep="\n")
