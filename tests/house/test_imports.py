"""The house's direction of flow, read from the sources themselves: the syntax tree says who imports whom.

import-linter says less: layers that follow from `ROOMS` would allow 2,295 of the 4,830 pairs of rooms, where `ROOMS`
allows 487, and its contracts tell neither imports inside functions nor those under `WITH_NUMBA` from others.
"""

from __future__ import annotations

import ast
from collections import Counter

from house_sources import (
    COMPILER_PACKAGES,
    GUARD,
    MAKERS,
    dotted,
    foreign,
    guarded,
    imports,
    modules,
    nodes,
    none_of,
    room,
    shown,
    sources,
)

#: What the modules of a room of the engine may import; a room may always import itself.
ROOMS = {
    "errors": set(),
    "base": {"errors"},
    "kernels": {"errors", "base"},
    "transforms": {"errors", "base"},
    "pose_arrays": {"errors", "base", "transforms"},
    "results": {"errors", "base"},
    "numerics": {"errors", "kernels"},
    "least_distance": {"errors", "base", "kernels", "numerics"},
    "hull": {"errors", "kernels", "numerics", "least_distance"},
    "curved": {"errors", "kernels", "numerics", "hull"},
    "support": {"errors", "base", "kernels", "numerics", "hull", "curved"},
    "mesh": {"errors", "base", "kernels", "numerics"},
    "fields": {"errors", "base", "kernels", "numerics", "mesh"},
    "shapes": {"errors", "base", "transforms", "least_distance", "hull", "support", "mesh", "fields"},
    "lowering": {"errors", "base", "kernels", "transforms", "numerics", "hull", "curved", "support", "mesh", "shapes"},
    "broadphase": {"errors", "kernels", "numerics", "curved", "support", "lowering"},
    "narrowphase": {
        "errors", "base", "kernels", "transforms", "results", "numerics", "least_distance", "hull", "curved", "support",
        "mesh", "fields", "shapes", "lowering", "broadphase",
    },
    "certificates": {
        "errors", "base", "transforms", "results", "numerics", "least_distance", "hull", "shapes", "lowering",
        "narrowphase",
    },
    "derivatives": {"errors", "base", "kernels", "results", "numerics", "curved", "shapes", "lowering", "narrowphase"},
    "pairs": {
        "errors", "base", "transforms", "results", "shapes", "lowering", "narrowphase", "certificates", "derivatives",
    },
    "contact": {
        "errors", "base", "kernels", "transforms", "results", "numerics", "hull", "curved", "support", "mesh", "shapes",
        "lowering", "narrowphase", "derivatives", "pairs",
    },
    "hull_levels": {"errors", "base", "hull", "shapes", "lowering", "pairs"},
    "casts": {
        "errors", "base", "kernels", "transforms", "results", "numerics", "least_distance", "curved", "support", "mesh",
        "shapes", "lowering", "broadphase", "narrowphase", "certificates", "pairs",
    },
    "motion": {
        "errors", "base", "kernels", "transforms", "results", "numerics", "support", "mesh", "shapes", "lowering",
        "narrowphase", "derivatives", "pairs",
    },
    "surface_queries": {
        "errors", "base", "transforms", "results", "numerics", "mesh", "fields", "shapes", "lowering", "narrowphase",
        "pairs", "casts",
    },
    "solids": {
        "errors", "base", "kernels", "transforms", "numerics", "mesh", "shapes", "lowering", "narrowphase",
        "surface_queries",
    },
    "spheres": {
        "errors", "base", "mesh", "shapes", "lowering", "certificates", "pairs", "surface_queries",
    },
    "worlds": {
        "errors", "base", "transforms", "results", "numerics", "shapes", "lowering", "broadphase", "narrowphase",
        "certificates", "pairs", "contact", "casts", "solids",
    },
    "robots": {
        "errors", "base", "kernels", "transforms", "results", "numerics", "hull", "mesh", "shapes", "lowering",
        "broadphase", "narrowphase", "pairs", "worlds",
    },
    "reports": {"", "errors", "base", "kernels", "results", "shapes", "lowering", "solids"},
    "sweeps": {"", "errors", "base", "shapes", "pairs", "worlds", "robots", "reports"},
    "pages": {"errors", "base", "results", "shapes", "lowering", "contact", "reports"},
    "papers": set(),
    "papers.hierarchies": {
        "errors", "base", "kernels", "transforms", "results", "numerics", "hull", "support", "mesh", "shapes",
        "lowering", "narrowphase", "certificates", "pairs",
    },
    "papers.partitions": {
        "errors", "base", "kernels", "transforms", "numerics", "mesh", "shapes", "lowering", "narrowphase",
        "surface_queries",
    },
    "papers.polytopes": {
        "errors", "base", "kernels", "transforms", "numerics", "least_distance", "hull", "shapes", "certificates",
        "pairs",
    },
    "papers.tetrahedra": {"errors", "base", "kernels", "transforms", "numerics", "mesh", "shapes"},
    "polytopes": {"papers.polytopes"},
    "cli": {"", "errors", "base", "reports", "sweeps", "pages", "papers.hierarchies", "spheres"},
    "__main__": {"cli"},
}
#: Imports against the flow that are still there: rooms, and what they have to let go of. Each is asserted to be needed.
TO_GO: dict[str, set[str]] = {}
#: What functions may import besides, against the flow or from outside: conveniences that a user calls by name.
LATE = {
    "kernels": {"numba", "llvmlite"},
    "reports": {"rich", "matplotlib"},
    "cli": {"scenes", "adapters", "papers.hierarchies", "polytopes"},
    "sweeps": {"pyarrow", "distributed"},
    "papers.tetrahedra": {"meshio"},
    "shapes": {"PIL", ""},
}
#: Names that say nothing about what a module is for, and names that shadow a package when run as a script.
BAD_NAMES = {"utils", "util", "helpers", "core", "common", "misc", "fcl", "coal", "pybullet", "numba", "numpy"}

# --- who imports whom ---------------------------------------------------------------------------


def test_rooms_are_complete():
    """A new room has to be placed in the flow before anything may live there."""
    found = {room(dotted(file)) for file in sources("collide")} - {""}
    assert found == set(ROOMS), "name the new room, or the one that left, in ROOMS"


def test_engine_flows_one_way():
    wrong = []
    for file in sources("collide"):
        own = room(dotted(file))
        allowed = {own, *ROOMS.get(own, set(ROOMS)), *TO_GO.get(own, ())}
        for module, late, line in imports(file):
            if module.split(".")[0] == "collide" and room(module) not in allowed:
                if room(module) not in LATE.get(own, set()):
                    wrong.append(f"{shown(file)}:{line}: {own} must not import {module}")
                elif not late:
                    wrong.append(f"{shown(file)}:{line}: import {module} inside the function that needs it")
    none_of(wrong)


#: Rooms whose functions may import modules of collide, and how many times: of kernels, what the build generates and may
#: not be there, and a text that is needed once. The command line may, too, so that ``--help`` answers at once.
LATE_WITHIN = {"kernels": 2, "shapes": 1}


def test_functions_import_nothing_of_collide():
    """A late import hides a circle, or what a module needs. Extras are imported where they are used: `LATE`."""
    by_room: dict[str, list[str]] = {}
    for file in sources():
        place = room(dotted(file))
        for module, late, line in imports(file):
            if late and module.split(".")[0] == "collide" and line not in guarded(file):
                by_room.setdefault(place, []).append(f"{shown(file)}:{line}: {module}")
    by_room.pop("cli", None)
    none_of(line for name, lines in by_room.items() if len(lines) > LATE_WITHIN.get(name, 0) for line in lines)


def test_what_is_to_go_is_still_there():
    """A list of exceptions that nobody needs any more would let them come back."""
    found = {
        (room(dotted(file)), room(module)) for file in sources("collide") for module, _, _ in imports(file)
        if module.startswith("collide.")
    }
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


def test_module_names_say_something():
    none_of(
        f"{shown(file)}: name it after what it is for"
        for file in sources()
        if BAD_NAMES & {file.stem, file.parent.name}
    )




def named_modules(file) -> set[str]:
    """Modules that a file imports anywhere, for types and inside functions too."""
    names, known = set(), modules()
    for node in nodes(file):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            names.update({name for name in inner if name in known} or {node.module or ""})
    return names


def test_file_names_are_unique():
    """One thing, one name: a reader who searches for a file finds one."""
    names = Counter(file.name for file in sources("collide") if file.name != "__init__.py")
    none_of(f"{name}: {count} files" for name, count in names.items() if count > 1)


def test_modules_import_in_no_circle():
    """Not even for types: two files that need each other are one file, or cut in the wrong place."""
    needs = {
        dotted(file): named_modules(file) - {dotted(file)} for file in sources("collide") if dotted(file) != "collide"
    }  # `collide` itself names all that is public, and imports it when asked
    needs = {name: modules & set(needs) for name, modules in needs.items()}
    while free := [name for name, modules in needs.items() if not modules]:
        for name in free:
            del needs[name]
        needs = {name: modules - {*free} for name, modules in needs.items()}
    none_of(f"{name}: {', '.join(sorted(modules))}" for name, modules in sorted(needs.items()))
