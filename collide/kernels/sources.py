"""Which sources a kernel's machine code depends on, and a number that changes with them.

Kernels see constants of modules, so what an entry is made of is the text of its own module and of all modules that are
imported there, and so on: read from the sources, nothing is imported for it.
"""

from __future__ import annotations

import ast
import os
import sys
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

#: The installed package.
PACKAGE = Path(__file__).parent.parent
#: Files of this room that make code of kernels; its others only decide how kernels run.
COMPILER_SOURCES = tuple(
    f"kernels/{name}.py" for name in
    ("back_end", "box_vectors", "compiled_lanes", "front_end", "lanes", "plain_lanes", "prepared", "vectors", "views")
)  # fmt: skip


def kernel_sources() -> tuple[str, ...]:
    """Files of the package that the library is compiled from, "results.py" say: those that define entries, what these
    import, and so on, and what makes code of them. Found by the build, which writes the list down: a start has no time
    to look."""
    files = set(COMPILER_SOURCES)
    for path in sorted(PACKAGE.rglob("*.py")):
        if b"\n@entry(" in path.read_bytes():
            module = ".".join(("collide", *path.relative_to(PACKAGE).with_suffix("").parts))
            files.update(map(_place_of, _reached(module)))
    return tuple(sorted(files))


def _place_of(module: str) -> str:
    name = "/".join(module.split(".")[1:])
    return f"{name}/__init__.py" if (PACKAGE / name).is_dir() else f"{name}.py"


def fingerprint(names: tuple[str, ...]) -> int:
    """A checksum of such files. Two milliseconds. Raises OSError where one is not there."""
    checksum = 0
    for name in names:
        with open(os.path.join(PACKAGE, *name.split("/")), "rb") as file:
            text = file.read().replace(b"\r\n", b"\n")
        checksum = zlib.crc32(text, zlib.crc32(name.encode(), checksum))
    return checksum


def of_function(function: Callable) -> str:
    """A hash of what a function's machine code can depend on: its own code, and the sources that its module reaches."""
    import hashlib  # here: a start from the library need not load it

    digest = hashlib.sha256()
    code = function.__code__
    cells = [_named(cell.cell_contents) for cell in function.__closure__ or ()]
    parts = code.co_code.hex(), code.co_names, _constants(code), function.__defaults__, cells
    digest.update(repr((function.__qualname__, *parts)).encode())
    for module in sorted(_reached(function.__module__ or "")):
        digest.update(module.encode())
        digest.update(_text(module))
    return digest.hexdigest()


def _named(value):
    """A value, or what a kernel is called: its own text would tell where it stands in memory."""
    function = getattr(value, "py_func", value)
    return f"{function.__module__}.{function.__qualname__}" if hasattr(function, "__qualname__") else value


def _constants(code) -> list:
    return [constant if not hasattr(constant, "co_code") else _constants(constant) for constant in code.co_consts]


def _reached(module: str) -> set[str]:
    """The package's modules that a module imports, those that these import, …, and itself."""
    reached, waiting = set(), [module]
    while waiting:
        source_module = waiting.pop()
        if source_module not in reached:
            reached.add(source_module)
            waiting += _imported(source_module)
    return reached


@cache
def _imported(module: str) -> tuple[str, ...]:
    try:
        tree = ast.parse(_text(module))
    except SyntaxError:  # something typed in by hand
        return ()
    imported = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            imported += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    # `collide` itself imports everything, and no kernel takes anything from there.
    return tuple(name for name in imported if name.startswith("collide.") and _may_matter(name))


def _may_matter(module: str) -> bool:
    """Whether it is a module at all, and none that only decides how kernels run."""
    if _file(module) is None or module == "collide.kernels":
        return False
    return not module.startswith("collide.kernels.") or f"{module[8:].replace('.', '/')}.py" in COMPILER_SOURCES


@cache
def _file(module: str) -> Path | None:
    loaded = sys.modules.get(module)
    if loaded is not None:
        place = getattr(loaded, "__file__", None)
        return Path(place) if place else None
    if not module.startswith("collide."):
        return None
    relative = Path(*module.split(".")[1:])
    for place in (PACKAGE / relative.with_suffix(".py"), PACKAGE / relative / "__init__.py"):
        if place.is_file():
            return place
    return None


def _text(module: str) -> bytes:
    place = _file(module)
    return place.read_bytes() if place is not None and place.is_file() else b""


@cache
def compiler_versions() -> str:
    import llvmlite
    import numba

    return (
        f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, Python "
        f"{sys.version_info[0]}.{sys.version_info[1]}"
    )
