"""The sources a kernel's machine code depends on, and a hash that changes with them.

Kernels see constants of modules, so an entry is made of its own code and of every definition reached from its code, in
its own module and in modules imported by this module, and so on: read from the sources, nothing is imported for it. A
start compares a checksum of the files' bytes; where the checksum differs, `entry_hashes` tells the entries touched by
an edit.
"""

from __future__ import annotations

import ast
import os
import sys
import zlib
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

#: The installed package.
PACKAGE = Path(__file__).parent.parent
#: Files of this room that make code of kernels; its others only decide how kernels run.
COMPILER_SOURCES = tuple(
    f"kernels/{name}.py" for name in
    ("back_end", "box_vectors", "compiled_lanes", "front_end", "kept_lowered", "lanes", "plain_lanes", "prepared",
     "vectors", "views")
)


def kernel_sources() -> tuple[str, ...]:
    """Files of the package from which the library is compiled, "results.py" say: the modules of entries, their imports,
    the imports of these, and so on, and the modules of the compiler. Found by the build, and written down: a start has
    no time to look."""
    files = set(COMPILER_SOURCES)
    for path in _files_of_entries():
        files.update(map(_place_of, _reached(_module_of(path))))
    return tuple(sorted(files))


def _files_of_entries() -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.py")) if b"\n@entry(" in path.read_bytes()]


def _module_of(path: Path) -> str:
    return ".".join(("collide", *path.relative_to(PACKAGE).with_suffix("").parts))


def _place_of(module: str) -> str:
    name = "/".join(module.split(".")[1:])
    return f"{name}/__init__.py" if (PACKAGE / name).is_dir() else f"{name}.py"


def fingerprint(names: tuple[str, ...]) -> int:
    """A checksum of files of the package. Two milliseconds. Raises OSError where a file is missing."""
    checksum = 0
    for name in names:
        with open(os.path.join(PACKAGE, *name.split("/")), "rb") as file:
            text = file.read().replace(b"\r\n", b"\n")
        checksum = zlib.crc32(text, zlib.crc32(name.encode(), checksum))
    return checksum


def entry_hashes() -> dict[str, str]:
    """A hash for each entry of the package, by name: what `of_function` says of each. Read from the sources alone.

    About a second: the build writes the hashes down, and a start looks only where the bytes of a source differ.
    """
    return {
        name: _hash_of(module, (name,))
        for module in map(_module_of, _files_of_entries())
        for name, definition in _parsed(module).definitions.items()
        if definition.is_entry
    }


def of_function(function: Callable) -> str:
    """A hash of everything a function's machine code can depend on: the function's own code and values, and every
    definition of the package reached from this code, compiled without docstrings, comments and blank lines.

    A definition is reached where its name stands in reached code, in the function's module or in a module imported from
    there, directly or through others: names alone decide, so an unrelated definition of the same name makes a hash
    change too often, never too seldom.
    """
    return _hash_of_function(function, beyond_kernels=True)


def of_own_code(function: Callable) -> str:
    """A hash of everything a function is lowered from, its callees being known by their results' types: as
    `of_function`, but of callees the decorators and parameters alone."""
    return _hash_of_function(function, beyond_kernels=False)


@cache
def of_compiler() -> str:
    """A hash of what makes code of kernels."""
    return _hash_of("", ())


def is_defined_in_module(function: Callable) -> bool:
    """Whether a function's module and name identify the function; a function made by another function holds values
    besides."""
    return not function.__closure__ and function.__qualname__ in _parsed(function.__module__ or "").definitions


def values_held(function: Callable) -> str:
    """The difference between functions made of the same source: their code, and the values held by their closures."""
    code = function.__code__
    cells = [_named(cell.cell_contents) for cell in function.__closure__ or ()]
    parts = code.co_code.hex(), code.co_names, _constants(code), function.__defaults__, cells
    return repr((function.__qualname__, *parts))


def _hash_of_function(function: Callable, *, beyond_kernels: bool) -> str:
    module = function.__module__ or ""
    if is_defined_in_module(function):
        return _hash_of(module, (function.__qualname__,), beyond_kernels=beyond_kernels)
    names = tuple(_parsed(module).definitions)
    return _hash_of(module, names, values_held(function), beyond_kernels=beyond_kernels)


def _hash_of(module: str, names: tuple[str, ...], values: str = "", *, beyond_kernels: bool = True) -> str:
    """Of the definitions of these names in a module, and of all that they reach."""
    import hashlib  # here: a start from the library need not load it

    parts = {*_compiler_parts(), *definitions_reached(module, names, beyond_kernels=beyond_kernels).values()}
    return hashlib.sha256((values + "".join(sorted(part.digest for part in parts))).encode()).hexdigest()


def definitions_reached(
    module: str, names: Iterable[str], *, beyond_kernels: bool = True
) -> dict[tuple[str, str], _Part]:
    """Definitions of the package reached by code of these names in a module, by module and name; under "" all
    statements beside definitions of a module, where any of its definitions is reached or the module imported.

    beyond_kernels : False takes of a reached kernel only the inputs of its callers' lowering, and follows its code no
    further.
    """
    modules, known = _reached(module), _definitions_seen_by(module)
    parts: dict[tuple[str, str], _Part] = {}
    names = {*names}
    waiting, reached = {module, *names}, set[str]()
    while waiting:
        reached.add(name := waiting.pop())
        added = known.get(name, {})
        if not beyond_kernels and name not in names:
            added = {place: _faces(place).get(name, part) for place, part in added.items()}
        places = {*added} | ({name} & modules)
        parts |= {(place, name): part for place, part in added.items()}
        parts |= {(place, ""): _parsed(place).rest for place in places}
        waiting.update(*(part.names for part in added.values()), *(_parsed(place).rest.names for place in places))
        waiting -= reached
    return parts


@cache
def _definitions_seen_by(module: str) -> dict[str, dict[str, _Part]]:
    """Definitions of a module and of its imports, by name and module."""
    seen: dict[str, dict[str, _Part]] = {}
    for place in _reached(module):
        for name, part in _parsed(place).definitions.items():
            seen.setdefault(name, {})[place] = part
    return seen


class _Part(NamedTuple):
    """A piece of a module."""

    digest: str
    names: frozenset[str] = frozenset()
    """What stands in its code as a global name or an attribute, or is imported there."""
    is_entry: bool = False


class _Module(NamedTuple):
    definitions: dict[str, _Part]
    """Functions, classes, values and what is imported, each by the name that it has in the module."""
    rest: _Part
    """All further statements of the module's own level: they may set whatever they want, so that they always count."""


@cache
def _compiler_parts() -> frozenset[_Part]:
    """All of the files that make code of kernels."""
    modules = (_parsed(f"collide.{name[:-3].replace('/', '.')}") for name in COMPILER_SOURCES)
    return frozenset(_Part(part.digest) for known in modules for part in (known.rest, *known.definitions.values()))


@cache
def _parsed(module: str) -> _Module:
    nodes: dict[str, list[ast.stmt]] = {}
    rest = []
    for node in _tree(module).body:
        named = _names_set_by(node)
        for name, statement in named:
            nodes.setdefault(name, []).append(statement)
        if not named:
            rest.append(node)
    definitions = {name: _part(module, statements) for name, statements in nodes.items()}
    return _Module(definitions, _part(module, rest))


@cache
def _faces(module: str) -> dict[str, _Part]:
    """Of a module's kernels what their callers are lowered from beside the types of their results: decorators and
    parameters."""
    kernels = [node for node in _tree(module).body if _is_decorated(node, "kernel") or _is_decorated(node, "entry")]
    faces: dict[str, _Part] = {}
    for node in kernels:
        assert isinstance(node, ast.FunctionDef)
        decorators = [ast.copy_location(ast.Expr(decorator), decorator) for decorator in node.decorator_list]
        node.body, node.decorator_list = [ast.copy_location(ast.Pass(), node)], []
        faces[node.name] = _part(module, [*decorators, node])
    return faces


def _tree(module: str) -> ast.Module:
    try:
        return ast.parse(_text(module))
    except SyntaxError:  # something typed in by hand
        return ast.parse("")


def _part(module: str, nodes: list[ast.stmt]) -> _Part:
    """Statements as Python compiles them: without comments, docstrings and places in the file."""
    import hashlib

    code = compile(ast.Module(nodes, []), module, "exec", dont_inherit=True, optimize=2)
    content: list = [module]
    names: set[str] = set()
    waiting = [code]
    while waiting:
        current = waiting.pop()
        names.update(current.co_names)
        inner = [constant for constant in current.co_consts if hasattr(constant, "co_code")]
        content += [current.co_name, current.co_code.hex(), current.co_names, current.co_varnames, current.co_freevars]
        content += [
            sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value)
            for value in current.co_consts if not hasattr(value, "co_code")
        ]
        waiting += inner
    return _Part(
        hashlib.sha256(repr(content).encode()).hexdigest(),
        frozenset(names),
        is_entry=any(_is_decorated(node, "entry") for node in nodes),
    )


def _names_set_by(node: ast.stmt) -> list[tuple[str, ast.stmt]]:
    """Names that a statement of a module does nothing but set, and what sets each; [] for any other statement."""
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        return [(node.name, node)]
    if isinstance(node, ast.Import):
        # `import collide.a.b as c`: what stands behind c is found by the names of its attributes
        return [((alias.asname or alias.name).split(".")[0], node) for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module != "__future__":
        alone = (ast.copy_location(ast.ImportFrom(node.module, [alias], node.level), node) for alias in node.names)
        return [(alias.asname or alias.name, statement) for alias, statement in zip(node.names, alone)]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    names = [inner for target in targets for inner in (target.elts if isinstance(target, ast.Tuple) else [target])]
    known = [name.id for name in names if isinstance(name, ast.Name)]
    return [(name, node) for name in known] if len(known) == len(names) else []


def _is_decorated(node: ast.stmt, name: str) -> bool:
    """Whether a function is decorated by this name, called or not."""
    decorators = getattr(node, "decorator_list", ())
    return any(getattr(getattr(call, "func", call), "id", "") == name for call in decorators)


def _named(value):
    """A value, or what a function or kernel is called and holds: its own text would tell where it stands in memory."""
    function = getattr(value, "py_func", value)
    if not hasattr(function, "__qualname__"):
        return value
    named = f"{function.__module__}.{function.__qualname__}"
    return (named, values_held(function)) if getattr(function, "__closure__", None) else named


def _constants(code) -> list:
    return [constant if not hasattr(constant, "co_code") else _constants(constant) for constant in code.co_consts]


def _reached(module: str) -> set[str]:
    """A module, its imports of the package, their imports, …."""
    reached, waiting = set(), [module]
    while waiting:
        source_module = waiting.pop()
        if source_module not in reached:
            reached.add(source_module)
            waiting += _imported(source_module)
    return reached


@cache
def _imported(module: str) -> tuple[str, ...]:
    imported, waiting = [], [*_tree(module).body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            imported += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            inner = getattr(node, field, ())
            waiting += inner if isinstance(inner, list) else ()
    # `collide` itself imports everything, and no kernel takes anything from there.
    return tuple(name for name in imported if name.startswith("collide.") and _may_matter(name))


def _may_matter(module: str) -> bool:
    """Whether a name is a module, and more than a decision how kernels run."""
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
