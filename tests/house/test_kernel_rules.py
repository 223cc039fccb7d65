"""Rules of kernels, read from the sources: where they live, what they see, what they may not do."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from house_sources import (
    MAKERS,
    ROOT,
    decorators,
    dotted,
    guarded,
    kernels,
    modules,
    nodes,
    none_of,
    shown,
    sources,
    tree,
)

from collide.kernels import sources as kernel_sources

#: What compiles, or makes code for a compiler.
COMPILERS = {
    "njit", "jit", "cfunc", "vectorize", "guvectorize", "jitclass", "stencil", "overload", "intrinsic", "prange",
}
BLAS = {"dot", "vdot", "inner", "matmul", "einsum", "linalg"}


def test_kernels_are_found():
    """The rules below would pass on nothing at all."""
    assert sum(len(kernels(file)) for file in sources("collide")) > 30


@cache
def _of_typing(file: Path) -> set[str]:
    """Names that a file has from typing, whose ``overload`` compiles nothing."""
    return {
        alias.name
        for node in nodes(file) if isinstance(node, ast.ImportFrom) and node.module == "typing"
        for alias in node.names
    }


def test_one_way_to_compile():
    none_of(
        f"{shown(file)}:{node.lineno}: {name} belongs in collide/kernels"
        for file in sources()
        if dotted(file) not in MAKERS
        for node in nodes(file)
        if isinstance(node, (ast.Name, ast.Attribute))
        for name in [node.id if isinstance(node, ast.Name) else node.attr]
        if name in COMPILERS - _of_typing(file)
    )


def test_kernels_live_where_their_sources_are_hashed():
    """`sources.kernel_sources` names these; a kernel elsewhere could be stale in the library and answer wrongly."""
    none_of(
        f"{shown(file)}:{kernel.lineno}: kernel {kernel.name}"
        for file in sources()
        for kernel in kernels(file)
        if not is_hashed(file)
    )


def is_hashed(file: Path) -> bool:
    """Whether an edit of a file changes the library's checksum."""
    return shown(file).removeprefix("collide/") in hashed()


@cache
def hashed() -> frozenset[str]:
    return frozenset(kernel_sources.kernel_sources())


@cache
def given(file: Path) -> dict[str, tuple[str, str, ast.expr | None]]:
    """Names that a file has for kernels: (module it comes from, name there, what it is made of where this file makes
    it)."""
    found: dict = {}
    for node in nodes(file):
        if isinstance(node, ast.ImportFrom) and node.lineno not in guarded(file, otherwise=True):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found[alias.asname or alias.name] = (whole if whole in modules() else node.module, alias.name, None)
    for node in tree(file).body:
        if isinstance(node, ast.Assign):
            for name in (name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)):
                found[name] = (dotted(file), name, node.value)
    return found


def origins(file: Path, name: str, seen: set) -> set[str]:
    """Modules of the package that decide what a name stands for in a kernel of this file."""
    if (file, name) in seen or name not in given(file):
        return set()
    seen.add((file, name))
    module, original, value = given(file)[name]
    if value is not None:
        return {module}.union(*(origins(file, used.id, seen) for used in ast.walk(value) if isinstance(used, ast.Name)))
    return {module} | origins(modules()[module], original, seen) if module in modules() else set()


#: Files that hand on to kernels what others define, and nothing of their own that is compiled.
ROUTES = {"collide.kernels", "collide.kernels.jit", "collide.kernels.plain"}


def test_what_kernels_see_is_hashed_as_well():
    """A constant of another file, compiled into the library, would keep its old value there."""
    wrong: dict[str, str] = {}
    seen_from = set()
    for file in sources("collide"):
        for kernel in kernels(file):
            for name in {node.id for node in ast.walk(kernel) if isinstance(node, ast.Name)}:
                for module in origins(file, name, set()):
                    seen_from.add(module)
                    if not is_hashed(modules()[module]) and module not in ROUTES:
                        wrong[module] = f"{module}: {name} in kernels of {shown(file)}"
    assert len(seen_from) > 40 and "collide.results" in seen_from, "the rule would pass on nothing"
    none_of(wrong.values())


def test_no_entry_has_the_name_of_another():
    """The library knows entries by their names alone, beside a few functions of its own."""
    names = [kernel.name for file in sources("collide") for kernel in kernels(file) if "entry" in decorators(kernel)]
    own = re.findall(
        r'^    \{"(\w+)", \w+, METH_', (ROOT / "native" / "python_module.c").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(names) > 50 and {"load", "prepared", "address_of", "code_of", "builtin_of"} <= set(own)
    twice = sorted({name for name in names if names.count(name) > 1} | (set(names) & set(own)))
    assert not twice, twice


def test_kernels_outside_the_package_have_names_of_their_own():
    """Where kernels come from the library, an entry of a test of the same name would be the library's."""
    names = {kernel.name for file in sources("collide") for kernel in kernels(file) if "entry" in decorators(kernel)}
    none_of(
        f"{shown(file)}:{kernel.lineno}: the library has a {kernel.name} too"
        for file in sources("tests", "benchmarks", "examples")
        for kernel in kernels(file)
        if kernel.name in names
    )


def test_nothing_speaks_of_what_is_gone():
    """Rooms that kernels had before they had one of their own."""
    gone = re.compile(r"\b(_jit|_lean_compile|_kernel_cache|_simd)\b")
    none_of(
        f"{shown(file)}:{number}: {line.strip()}"
        for file in sources("collide", "adapters", "scenes", "tests", "examples", "benchmarks", "native")
        if file != Path(__file__)
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if gone.search(line)
    )


def test_no_flag_that_changes_numbers_or_threads():
    wrong = []
    for file in sources():
        for node in nodes(file):
            names = [node.arg] if isinstance(node, ast.keyword) else []
            names += (
                [key.value for key in node.keys if isinstance(key, ast.Constant)] if isinstance(node, ast.Dict) else []
            )
            wrong += [f"{shown(file)}:{node.lineno}: {name}" for name in names if name in ("fastmath", "parallel")]
    none_of(wrong)


def test_kernels_call_no_blas():
    """BLAS sums in an order of its own choosing: other bits on other machines, and no error bound."""
    none_of(
        f"{shown(file)}:{kernel.lineno}: kernel {kernel.name} uses {ast.unparse(node)}"
        for file in sources("collide")
        for kernel in kernels(file)
        for node in ast.walk(kernel)
        if (isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult))
        or (isinstance(node, ast.Attribute) and node.attr in BLAS and ast.unparse(node.value) not in _own_modules(file))
    )


@cache
def _own_modules(file: Path) -> set[str]:
    """Names that a file has for modules of the house: their inner products are summed as they are written."""
    return {
        alias.asname or alias.name
        for node in nodes(file) if isinstance(node, ast.ImportFrom)
        for alias in node.names if f"{node.module}.{alias.name}" in modules()
    }
