"""The sources of the house as syntax trees: modules, imports, kernels. No module is imported to be judged."""

from __future__ import annotations

import ast
import gc
import re
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {"collide": "collide", "adapters": "collide.adapters", "scenes": "collide.scenes"}

COMPILER_PACKAGES = {"numba", "llvmlite"}
#: The files that make code. They are imported where kernels are compiled just in time, and by nothing else.
MAKERS = {
    f"collide.kernels.{name}"
    for name in ("back_end", "box_vectors", "compiled_lanes", "front_end", "jit", "vectors", "views")
}
#: Under what they and the compilers' packages are imported otherwise.
GUARD = "WITH_NUMBA"


def sources(*folders: str) -> list[Path]:
    return sorted(file for folder in folders or FOLDERS for file in (ROOT / folder).rglob("*.py"))


def shown(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@cache
def tree(file: Path) -> ast.Module:
    gc.disable()  # of three million nodes that stay: looking through them again and again takes four times the parsing
    try:
        return ast.parse(file.read_text(encoding="utf-8"), filename=str(file))
    finally:
        gc.enable()


@cache
def nodes(file: Path) -> list[ast.AST]:
    """All of a file's syntax tree."""
    return list(ast.walk(tree(file)))


def dotted(file: Path) -> str:
    """Name under which a file is imported."""
    folder, *rest = file.relative_to(ROOT).with_suffix("").parts
    return ".".join([FOLDERS[folder], *(part for part in rest if part != "__init__")])


@cache
def modules() -> dict[str, Path]:
    return {dotted(file): file for file in sources()}


@cache
def imports(file: Path) -> list[tuple[str, bool, int]]:
    """(module, whether inside a function, line) of every import; names that are modules count as such."""
    known, found = modules(), []

    def visit(node: ast.AST, late: bool) -> None:
        if isinstance(node, ast.Import):
            found.extend((alias.name, late, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{shown(file)}:{node.lineno}: relative import; write the whole name"
            module = node.module or ""
            inner = [f"{module}.{alias.name}" for alias in node.names]
            found.extend((name if name in known else module, late, node.lineno) for name in inner)
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            if isinstance(node.value.func, ast.Name) and node.value.func.id == "lazy_module":
                found.append((ast.literal_eval(node.value.args[0]), late, node.lineno))
        elif isinstance(node, ast.If) and is_type_checking(node.test):
            return  # never run
        inside = late or isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, ast.expr):  # nine of ten nodes, in which nothing is imported
                visit(child, inside)

    visit(tree(file), False)
    return found


def is_type_checking(test: ast.expr) -> bool:
    return isinstance(test, (ast.Name, ast.Attribute)) and ast.unparse(test) in (
        "TYPE_CHECKING",
        "typing.TYPE_CHECKING",
    )


def foreign(file: Path) -> list[tuple[str, bool, int]]:
    """The imports that are neither of collide, of numpy nor of the standard library, by package."""
    found = [(module.split(".")[0], late, line) for module, late, line in imports(file)]
    return [item for item in found if item[0] not in {"collide", "numpy", *sys.stdlib_module_names}]


def room(module: str) -> str:
    """``collide.narrowphase.gjk.gjk`` → ``narrowphase``; ``collide`` itself → the empty string.

    Those of `collide.papers` are rooms of their own: ``papers.hierarchies``.
    """
    parts = module.split(".")
    return ".".join(parts[1 : 3 if parts[1:2] == ["papers"] else 2])


def none_of(wrong: Iterable[str]) -> None:
    """Fail with the whole list, one complaint a line."""
    wrong = list(wrong)
    assert not wrong, "\n" + "\n".join(wrong)


def decorators(function: ast.FunctionDef) -> set[str]:
    return {ast.unparse(d.func if isinstance(d, ast.Call) else d) for d in function.decorator_list}


@cache
def kernels(file: Path) -> list[ast.FunctionDef]:
    if not re.search(r"^ *@(kernel|entry)\b", file.read_text(encoding="utf-8"), re.MULTILINE):
        return []  # most of the tests' files need not be parsed
    functions = [node for node in nodes(file) if isinstance(node, ast.FunctionDef)]
    return [function for function in functions if decorators(function) & {"kernel", "entry"}]


@cache
def guarded(file: Path, otherwise: bool = False) -> set[int]:
    """Lines of a file that run only where kernels are compiled just in time; otherwise : only where they are not."""
    found: set[int] = set()
    for node in nodes(file) if GUARD in file.read_text(encoding="utf-8") else ():
        if isinstance(node, ast.If) and ast.unparse(node.test) in (GUARD, f"not {GUARD}"):
            branch = node.body if (ast.unparse(node.test) == GUARD) != otherwise else node.orelse
            found.update(
                line for inner in branch for line in range(inner.lineno, (inner.end_lineno or inner.lineno) + 1)
            )
    return found
