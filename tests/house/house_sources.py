"""The sources of the house as syntax trees: modules, imports, kernels. No module is imported to be judged."""

from __future__ import annotations

import ast
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
}  # fmt: skip
#: Under what they and the compilers' packages are imported otherwise.
GUARD = "WITH_NUMBA"


def sources(*folders: str) -> list[Path]:
    return sorted(file for folder in folders or FOLDERS for file in (ROOT / folder).rglob("*.py"))


def shown(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), filename=str(file))


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
    functions = lines_of(node for node in nodes(file) if isinstance(node, FUNCTIONS))
    never_run = lines_of(node for node in nodes(file) if isinstance(node, ast.If) and is_type_checking(node.test))
    for node in nodes(file):
        if not isinstance(node, (ast.Import, ast.ImportFrom, ast.Call)) or node.lineno in never_run:
            continue
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{shown(file)}:{node.lineno}: relative import; write the whole name"
            module = node.module or ""
            inner = [f"{module}.{alias.name}" for alias in node.names]
            names = [name if name in known else module for name in inner]
        elif isinstance(node.func, ast.Name) and node.func.id == "lazy_module":
            names = [ast.literal_eval(node.args[0])]
        else:
            continue
        found.extend((name, node.lineno in functions, node.lineno) for name in names)
    return sorted(found, key=lambda one: one[2])


FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)


def lines_of(found: Iterable[ast.stmt | ast.expr]) -> set[int]:
    """Lines within syntax trees, but for their first: of a function its body's."""
    return {line for node in found for line in range(node.lineno + 1, (node.end_lineno or node.lineno) + 1)}


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
    """``collide.narrowphase.gjk.gjk`` → ``narrowphase``; ``collide`` itself → the empty string."""
    return module.split(".")[1] if "." in module else ""


def none_of(wrong: Iterable[str]) -> None:
    """Fail with the whole list, one complaint a line."""
    wrong = list(wrong)
    assert not wrong, "\n" + "\n".join(wrong)


def decorators(function: ast.FunctionDef) -> set[str]:
    return {ast.unparse(d.func if isinstance(d, ast.Call) else d) for d in function.decorator_list}


@cache
def kernels(file: Path) -> list[ast.FunctionDef]:
    functions = [node for node in nodes(file) if isinstance(node, ast.FunctionDef)]
    return [function for function in functions if decorators(function) & {"kernel", "entry"}]


@cache
def guarded(file: Path, otherwise: bool = False) -> set[int]:
    """Lines of a file that run only where kernels are compiled just in time; otherwise : only where they are not."""
    found: set[int] = set()
    for node in nodes(file):
        if isinstance(node, ast.If) and ast.unparse(node.test) in (GUARD, f"not {GUARD}"):
            branch = node.body if (ast.unparse(node.test) == GUARD) != otherwise else node.orelse
            found.update(
                line for inner in branch for line in range(inner.lineno, (inner.end_lineno or inner.lineno) + 1)
            )
    return found
