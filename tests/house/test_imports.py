"""The house's direction of flow and the rules of its kernels, read from the sources themselves.

No module is imported to be judged: the syntax tree says who imports whom. What only running can
tell (that start-up loads no compiler, that names resolve) is asked of a fresh interpreter.
"""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

import collide
from collide.kernels import sources as kernel_sources

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {"collide": "collide", "adapters": "collide.adapters", "scenes": "collide.scenes"}

#: What the modules of a room of the engine may import; a room may always import itself.
ROOMS = {
    "errors": set(),
    "cache_folder": set(),
    "log": set(),
    "lazy_modules": set(),
    "fork_safe_lock": set(),
    "algorithms": {"errors"},
    "kernels": {"cache_folder", "errors", "log"},
    "argument_checks": {"errors"},
    "threads": {"errors", "argument_checks"},
    "transforms": {"errors", "argument_checks"},
    "results": {"errors"},
    "numerics": {"errors", "kernels"},
    "hull": {"errors", "kernels", "numerics"},
    "support": {"errors", "fork_safe_lock", "kernels", "numerics", "hull", "log"},
    "mesh": {"errors", "fork_safe_lock", "kernels", "numerics", "log"},
    "shapes": {"errors", "argument_checks", "log", "transforms", "hull", "mesh", "support", "lazy_modules"},
    "lowering": {
        "errors",
        "argument_checks",
        "kernels",
        "log",
        "transforms",
        "numerics",
        "hull",
        "support",
        "mesh",
        "shapes",
    },
    "broadphase": {"errors", "kernels", "numerics", "lowering", "support"},
    "narrowphase": {
        "errors",
        "kernels",
        "transforms",
        "numerics",
        "hull",
        "support",
        "mesh",
        "shapes",
        "lowering",
        "broadphase",
        "results",
        "threads",
    },
    "certificates": {"errors", "transforms", "numerics", "lowering", "results", "shapes"},
    "pair_arguments": {"errors", "argument_checks", "transforms", "shapes"},
    "batches": {"errors", "transforms", "shapes", "lowering", "narrowphase", "results", "threads"},
    "security_margin": {
        "errors",
        "argument_checks",
        "transforms",
        "shapes",
        "lowering",
        "narrowphase",
        "results",
        "batches",
    },
    "query": {
        "errors",
        "argument_checks",
        "transforms",
        "shapes",
        "lowering",
        "narrowphase",
        "results",
        "batches",
        "certificates",
        "pair_arguments",
        "security_margin",
        "threads",
        "algorithms",
    },
    "contact": {
        "errors",
        "argument_checks",
        "kernels",
        "threads",
        "transforms",
        "numerics",
        "support",
        "hull",
        "mesh",
        "shapes",
        "lowering",
        "narrowphase",
        "results",
        "batches",
        "pair_arguments",
    },
    "casts": {
        "errors",
        "argument_checks",
        "kernels",
        "threads",
        "transforms",
        "numerics",
        "support",
        "mesh",
        "shapes",
        "lowering",
        "broadphase",
        "narrowphase",
        "results",
        "batches",
        "certificates",
        "pair_arguments",
    },
    "motion": {
        "errors",
        "support",
        "argument_checks",
        "kernels",
        "transforms",
        "numerics",
        "mesh",
        "shapes",
        "lowering",
        "narrowphase",
        "results",
        "batches",
        "pair_arguments",
        "threads",
    },
    "surface_queries": {
        "casts",
        "errors",
        "argument_checks",
        "transforms",
        "numerics",
        "mesh",
        "shapes",
        "lowering",
        "narrowphase",
        "results",
        "batches",
    },
    "hierarchies": {
        "errors",
        "fork_safe_lock",
        "kernels",
        "transforms",
        "numerics",
        "hull",
        "support",
        "mesh",
        "shapes",
        "lowering",
        "narrowphase",
        "results",
        "certificates",
        "batches",
        "pair_arguments",
    },
    "world_bodies": {"errors", "argument_checks", "transforms", "shapes", "broadphase"},
    "world_hits": set(),
    "world_parts": {"shapes", "lowering", "broadphase"},
    "world_part_pairs": {"broadphase", "fork_safe_lock", "world_parts"},
    "packed_world": {
        "broadphase",
        "casts",
        "errors",
        "lowering",
        "narrowphase",
        "results",
        "shapes",
        "threads",
        "world_bodies",
        "world_part_pairs",
        "world_parts",
    },
    "world_contacts": {"contact", "errors", "packed_world", "threads"},
    "world_casts": {
        "errors",
        "argument_checks",
        "batches",
        "broadphase",
        "casts",
        "lowering",
        "narrowphase",
        "packed_world",
        "shapes",
        "world_hits",
    },
    "world_minimum": {"packed_world"},
    "world_outside": {
        "broadphase",
        "lowering",
        "narrowphase",
        "packed_world",
        "results",
        "shapes",
        "threads",
        "world_parts",
    },
    "world_record": {"broadphase", "packed_world", "results", "world_bodies"},
    "world_scene": {
        "errors",
        "argument_checks",
        "log",
        "packed_world",
        "security_margin",
        "shapes",
        "world_bodies",
        "world_part_pairs",
    },
    "world_pairs": {
        "argument_checks",
        "certificates",
        "contact",
        "packed_world",
        "results",
        "security_margin",
        "threads",
        "world_contacts",
        "world_minimum",
        "world_record",
        "world_scene",
    },
    "world": {
        "errors",
        "argument_checks",
        "transforms",
        "shapes",
        "casts",
        "threads",
        "world_bodies",
        "world_casts",
        "world_hits",
        "world_outside",
        "world_pairs",
        "results",
        "certificates",
    },
    "robots": {
        "errors",
        "argument_checks",
        "kernels",
        "numerics",
        "transforms",
        "results",
        "threads",
        "shapes",
        "mesh",
        "lowering",
        "broadphase",
        "narrowphase",
        "query",
        "world",
    },
    "sweeps": {"errors", "argument_checks", "query", "shapes", "robots", "world", "reports", ""},
    "reports": {"errors", "lowering", "results", "shapes", "cache_folder", "kernels", ""},
    "cli_files": {"errors", "reports"},
    "cli_numbers": set(),
    "cli_srdf": {"cli_files", "cli_numbers", "errors", "reports", "sweeps"},
    "cli_sweep": {"cli_files", "cli_numbers", "errors", "reports", "sweeps"},
    "cli_arguments": {"cli_srdf", "cli_sweep", "errors", "reports", ""},
    "cli": {"cli_arguments", "cli_files", "cli_srdf", "cli_sweep", "errors", "reports", ""},
    "__main__": {"cli"},
}
#: Imports against the flow that are still there: rooms, and what they have to let go of. Each is asserted to be needed.
TO_GO: dict[str, set[str]] = {}
#: What functions may import besides, against the flow or from outside: conveniences that a user calls by name.
LATE = {
    "kernels": {"numba", "llvmlite"},
    "reports": {"rich", "matplotlib"},
    "cli": {"scenes", "adapters", "hierarchies"},
    "cli_files": {"scenes"},
    "cli_srdf": {"scenes"},
    "cli_sweep": {"scenes"},
    "sweeps": {"pyarrow", "distributed"},
}
#: Names that say nothing about what a module is for, and names that shadow a package when run as a script.
BAD_NAMES = {"utils", "util", "helpers", "core", "common", "misc", "fcl", "coal", "pybullet", "numba", "numpy"}

#: What compiles, or makes code for a compiler.
COMPILERS = {
    "njit", "jit", "cfunc", "vectorize", "guvectorize", "jitclass", "stencil", "overload", "intrinsic", "prange",
}  # fmt: skip
COMPILER_PACKAGES = {"numba", "llvmlite"}
#: The files that make code. They are imported where kernels are compiled just in time, and by nothing else.
MAKERS = {
    f"collide.kernels.{name}"
    for name in ("back_end", "box_vectors", "compiled_lanes", "front_end", "jit", "vectors", "views")
}  # fmt: skip
#: Under what they and the compilers' packages are imported otherwise.
GUARD = "WITH_NUMBA"
BLAS = {"dot", "vdot", "inner", "matmul", "einsum", "linalg"}


def sources(*folders: str) -> list[Path]:
    return sorted(file for folder in folders or FOLDERS for file in (ROOT / folder).rglob("*.py"))


def shown(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), filename=str(file))


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
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "lazy_module":
            found.append((ast.literal_eval(node.args[0]), late, node.lineno))
        elif isinstance(node, ast.If) and _is_type_checking(node.test):
            return  # never run
        inside = late or isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        for child in ast.iter_child_nodes(node):
            visit(child, inside)

    visit(tree(file), False)
    return found


def _is_type_checking(test: ast.expr) -> bool:
    return ast.unparse(test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


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


def kernels(file: Path) -> list[ast.FunctionDef]:
    found = [node for node in ast.walk(tree(file)) if isinstance(node, ast.FunctionDef)]
    return [f for f in found if decorators(f) & {"kernel", "entry"}]


# --- who imports whom ---------------------------------------------------------------------------


def test_rooms_are_complete():
    """A new room has to be placed in the flow before anything may live there."""
    found = {room(dotted(file)) for file in sources("collide")} - {""}
    assert found == set(ROOMS), "name the new room, or the one that left, in ROOMS"


def test_engine_flows_one_way():
    wrong = []
    for file in sources("collide"):
        own = room(dotted(file))
        allowed = {own, "lazy_modules", *ROOMS.get(own, set(ROOMS)), *TO_GO.get(own, ())}
        for module, late, line in imports(file):
            if module.split(".")[0] == "collide" and room(module) not in allowed:
                if room(module) not in LATE.get(own, set()):
                    wrong.append(f"{shown(file)}:{line}: {own} must not import {module}")
                elif not late:
                    wrong.append(f"{shown(file)}:{line}: import {module} inside the function that needs it")
    none_of(wrong)


#: Rooms whose functions may import modules of collide, and how many times: of kernels, what the build generates and may
#: not be there, and a text that is needed once. The command line may, too, so that ``--help`` answers at once.
LATE_WITHIN = {"kernels": 2}


def test_functions_import_nothing_of_collide():
    """A late import hides a circle, or what a module needs. Extras are imported where they are used: `LATE`."""
    by_room: dict[str, list[str]] = {}
    for file in sources():
        place = room(dotted(file))
        for module, late, line in imports(file):
            if late and module.split(".")[0] == "collide" and line not in guarded(file):
                by_room.setdefault(place, []).append(f"{shown(file)}:{line}: {module}")
    for name in ("cli", "cli_files", "cli_srdf", "cli_sweep"):
        by_room.pop(name, None)
    none_of(line for name, lines in by_room.items() if len(lines) > LATE_WITHIN.get(name, 0) for line in lines)


def test_what_is_to_go_is_still_there():
    """A list of exceptions that nobody needs any more would let them come back."""
    found = {
        (room(dotted(file)), room(module)) for file in sources("collide") for module, _, _ in imports(file)
        if module.startswith("collide.")
    }  # fmt: skip
    none_of(
        f"{own}: {name} is gone; strike it out"
        for own, names in TO_GO.items()
        for name in names
        if (own, name) not in found
    )


def test_rooms_have_no_cycle():
    """The table itself flows one way; what is imported late does not count."""
    done: set[str] = set()
    while len(done) < len(ROOMS):
        ready = {name for name, needs in ROOMS.items() if name not in done and needs - {""} <= done}
        assert ready, f"a circle among {sorted(set(ROOMS) - done)}"
        done |= ready


def test_engine_needs_numpy_only():
    wrong = []
    for file in sources("collide"):
        optional = LATE.get(room(dotted(file)), set())
        for package, late, line in foreign(file):
            if package in COMPILER_PACKAGES and (dotted(file) in MAKERS or line in guarded(file)):
                continue
            if package not in optional or not late:
                wrong.append(f"{shown(file)}:{line}: the engine must not need {package} here")
    none_of(wrong)


@cache
def guarded(file: Path, otherwise: bool = False) -> set[int]:
    """Lines of a file that run only where kernels are compiled just in time; otherwise : only where they are not."""
    found: set[int] = set()
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.If) and ast.unparse(node.test) in (GUARD, f"not {GUARD}"):
            branch = node.body if (ast.unparse(node.test) == GUARD) != otherwise else node.orelse
            found.update(
                line for inner in branch for line in range(inner.lineno, (inner.end_lineno or inner.lineno) + 1)
            )
    return found


def test_what_makes_code_is_imported_only_where_it_is_wanted():
    """Otherwise a process whose kernels come from the library would load a compiler, or fail where there is none."""
    none_of(
        f"{shown(file)}:{line}: import {module} under `if {GUARD}:`"
        for file in sources()
        if dotted(file) not in MAKERS
        for module, late, line in imports(file)
        if module in MAKERS and line not in guarded(file)
    )
    assert {
        dotted(file) for file in sources("collide") if foreign(file) and room(dotted(file)) == "kernels"
    } >= MAKERS - {"collide.kernels.jit"}, "a file that makes no code any more"
    guards = [file for file in sources("collide") if guarded(file)]
    assert len(guards) >= 4, "the rule would pass on nothing"


def test_outer_rooms_import_packages_where_they_use_them():
    none_of(
        f"{shown(file)}:{line}: {package}: kernels belong in the engine"
        if package == "numba"
        else f"{shown(file)}:{line}: import {package} inside the function that needs it"
        for file in sources("adapters", "scenes")
        for package, late, line in foreign(file)
        if package == "numba" or not late
    )


def test_scenes_ask_no_engine():
    """A generator may place bodies with the exact oracle's help; a scene that asks an engine is no input."""
    none_of(
        f"{shown(file)}:{line}: {module}"
        for file in sources("scenes")
        for module, _, line in imports(file)
        if module.startswith("collide.adapters") and module != "collide.adapters.peers.exact"
    )


def test_outer_rooms_have_one_name_each():
    """``import scenes`` works from the repository's root and makes a second module of every file."""
    none_of(
        f"{shown(file)}:{line}: import collide.{module}"
        for file in [*sources(), *sources("tests"), *sources("examples"), *sources("benchmarks")]
        for module, _, line in imports(file)
        if module.split(".")[0] in ("scenes", "adapters")
    )


def test_module_names_say_something():
    none_of(
        f"{shown(file)}: name it after what it is for"
        for file in sources()
        if BAD_NAMES & {file.stem, file.parent.name}
    )


# --- kernels ------------------------------------------------------------------------------------


def test_kernels_are_found():
    """The rules below would pass on nothing at all."""
    assert sum(len(kernels(file)) for file in sources("collide")) > 30


@cache
def _of_typing(file: Path) -> set[str]:
    """Names that a file has from typing, whose ``overload`` compiles nothing."""
    return {
        alias.name
        for node in ast.walk(tree(file)) if isinstance(node, ast.ImportFrom) and node.module == "typing"
        for alias in node.names
    }  # fmt: skip


def test_one_way_to_compile():
    none_of(
        f"{shown(file)}:{node.lineno}: {name} belongs in collide/kernels"
        for file in sources()
        if dotted(file) not in MAKERS
        for node in ast.walk(tree(file))
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
    for node in ast.walk(tree(file)):
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
    assert len(names) > 50 and {"load", "prepared", "address_of", "code_of"} <= set(own)
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
        for node in ast.walk(tree(file)):
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
        for node in ast.walk(tree(file)) if isinstance(node, ast.ImportFrom)
        for alias in node.names if f"{node.module}.{alias.name}" in modules()
    }  # fmt: skip


# --- what a fresh interpreter says --------------------------------------------------------------


def fresh(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=False, capture_output=True, text=True, timeout=60, cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("what", "code"),
    [
        ("import collide", "import collide"),
        ("shapes", "import collide; collide.Box((1, 2, 3)), collide.pose((0, 0, 1)), collide.InvalidShape"),
        ("scenes", "import collide.scenes; collide.scenes.shipped()"),
        ("adapters", "import collide.adapters.peers"),
        ("--help", "from collide.cli import main; assert main(['--help']) == 0"),
        ("report --help", "from collide.cli import main; assert main(['report', '--help']) == 0"),
        ("--version", "from collide.cli import main; assert main(['--version']) == 0"),
    ],
)
def test_start_up_loads_no_compiler(what, code):
    loaded = fresh(f"import sys\n{code}\nprint(*sys.modules, file=sys.stdout)").split()
    heavy = {"numba", "llvmlite", "rich", "trimesh", "yaml", "scipy", "yourdfpy", "coal", "fcl", "pybullet"}
    assert not heavy & set(loaded), f"{what} loads {sorted(heavy & set(loaded))}"


def test_importing_collide_imports_nothing_but_the_standard_library():
    assert "numpy" not in fresh("import sys, collide; print(*sys.modules)").split()


def test_public_names_resolve_and_are_documented():
    import collide.scenes

    for module in (collide, collide.scenes):
        assert inspect.getdoc(module)
        for name in module.__all__:
            value = getattr(module, name)
            assert name in dir(module)
            assert inspect.getdoc(value), f"{module.__name__}.{name} has no docstring"


def test_public_methods_are_documented():
    """In a docstring of their own, or, attributes, in that of their class."""
    for owner in (collide.World, collide.Robot, collide.PairResult, collide.WorldResult, collide.scenes.Scene):
        for name, value in vars(owner).items():
            if not name.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                told = inspect.getdoc(value) or re.search(rf"\b{name}\b", owner.__doc__)
                assert told, f"{owner.__name__}.{name} is described nowhere"


def test_names_in_all_are_the_lazy_ones():
    """`__init__` names everything three times (types, homes, __all__); they must agree."""
    init = tree(ROOT / "collide" / "__init__.py")
    checked = {
        alias.name
        for node in ast.walk(init) if isinstance(node, ast.If) and _is_type_checking(node.test)
        for inner in node.body if isinstance(inner, ast.ImportFrom) and inner.module != "collide"
        for alias in inner.names
    }  # fmt: skip
    renamed = {own: name for name, (_, own) in collide._RENAMED.items()}
    assert {renamed.get(name, name) for name in checked} == set(collide.__all__) == {*collide._HOME, *collide._RENAMED}


def test_every_module_says_what_it_is():
    for file in [*sources(), *sources("native")]:
        assert ast.get_docstring(tree(file)), f"{shown(file)}: no docstring"


def test_types_are_shipped():
    assert (ROOT / "collide" / "py.typed").is_file()
