"""The house's direction of flow, read from the sources themselves: the syntax tree says who imports whom.

import-linter says less: layers that follow from `ROOMS` would allow 2,295 of the 4,830 pairs of rooms, where `ROOMS`
allows 487, and its contracts tell neither imports inside functions nor those under `WITH_NUMBA` from others.
"""

from __future__ import annotations

from house_sources import (
    COMPILER_PACKAGES,
    GUARD,
    MAKERS,
    dotted,
    foreign,
    guarded,
    imports,
    none_of,
    room,
    shown,
    sources,
)

#: What the modules of a room of the engine may import; a room may always import itself.
ROOMS = {
    "errors": set(),
    "cache_folder": {"log"},
    "whole_file": set(),
    "given_files": {"errors"},
    "log": set(),
    "lazy_modules": set(),
    "fork_safe_lock": set(),
    "child_process": set(),
    "algorithms": {"errors"},
    "kernels": {"cache_folder", "errors", "log", "whole_file"},
    "argument_checks": {"errors"},
    "threads": {"errors", "argument_checks"},
    "transforms": {"errors", "argument_checks"},
    "results": {"errors", "argument_checks"},
    "numerics": {"errors", "kernels"},
    "least_distance": {"errors", "argument_checks", "kernels", "numerics"},
    "hull": {"errors", "kernels", "least_distance", "numerics"},
    "support": {"errors", "fork_safe_lock", "kernels", "numerics", "hull", "log"},
    "mesh": {"errors", "fork_safe_lock", "kernels", "numerics", "log"},
    "shapes": {
        "errors", "argument_checks", "log", "transforms", "hull", "least_distance", "mesh", "support", "lazy_modules",
        "whole_file",
    },
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
        "least_distance",
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
    "certificates": {
        "errors", "argument_checks", "least_distance", "transforms", "numerics", "lowering", "results", "shapes",
    },
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
        "least_distance",
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
    "tetrahedra": {
        "errors", "argument_checks", "kernels", "log", "mesh", "numerics", "shapes", "threads", "transforms",
    },
    "solids": {
        "errors", "argument_checks", "transforms", "numerics", "mesh", "shapes", "lowering", "narrowphase",
        "surface_queries", "kernels",
    },
    "partitions": {  # labels of cells come from the winding numbers of meshes, and points on facets from exact tests
        "errors", "argument_checks", "transforms", "numerics", "mesh", "shapes", "lowering", "narrowphase",
        "surface_queries",
    },
    "hierarchies": {
        "errors",
        "argument_checks",
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
    "polytopes": {
        "errors", "argument_checks", "certificates", "hull", "kernels", "least_distance", "numerics", "pair_arguments",
        "shapes", "threads", "transforms",
    },
    "world_bodies": {"errors", "argument_checks", "transforms", "numerics", "shapes", "broadphase"},
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
    "world_overlaps": {"errors", "packed_world", "solids"},
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
        "world_overlaps",
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
        "packed_world",
        "query",
        "world",
    },
    "sweeps": {
        "errors", "argument_checks", "child_process", "given_files", "log", "query", "shapes", "robots", "world",
        "reports", "whole_file", "",
    },
    "reports": {
        "argument_checks", "cache_folder", "errors", "given_files", "kernels", "lowering", "results", "shapes",
        "solids", "whole_file", "",
    },
    "pages": {"errors", "contact", "lowering", "reports", "results", "shapes", "whole_file"},
    "cli_files": {"errors", "reports", "whole_file"},
    "cli_scenes": {"errors", "reports"},
    "cli_pages": {"cli_files", "cli_scenes", "errors", "pages", "reports"},
    "cli_numbers": set(),
    "cli_srdf": {"cli_files", "cli_numbers", "errors", "reports", "sweeps", "whole_file"},
    "cli_sweep": {"cli_files", "cli_numbers", "errors", "reports", "sweeps"},
    "cli_view": {"cli_pages", "cli_scenes", "pages"},
    "cli_bench": {"cli_numbers", "errors", "reports"},
    "cli_compare": {"cli_files", "cli_pages", "cli_scenes", "errors", "reports", "whole_file", ""},
    "cli_engines": {"reports"},
    "cli_fuzz": {"cli_files", "cli_numbers", "errors", "reports"},
    "cli_locality": {"cli_files", "errors", "hierarchies", "reports"},
    "cli_arguments": {
        "cli_bench", "cli_compare", "cli_engines", "cli_fuzz", "cli_locality", "cli_numbers", "cli_pages", "cli_srdf",
        "cli_sweep", "cli_view", "errors", "reports", "",
    },
    "cli": {
        "cli_arguments", "cli_bench", "cli_compare", "cli_files", "cli_fuzz", "cli_locality", "cli_pages", "cli_scenes",
        "cli_srdf", "cli_sweep", "cli_view", "errors", "reports", "whole_file", "",
    },
    "__main__": {"cli"},
}
#: Imports against the flow that are still there: rooms, and what they have to let go of. Each is asserted to be needed.
TO_GO: dict[str, set[str]] = {}
#: What functions may import besides, against the flow or from outside: conveniences that a user calls by name.
LATE = {
    "kernels": {"numba", "llvmlite"},
    "reports": {"rich", "matplotlib"},
    "cli": {"scenes", "adapters", "hierarchies"},
    "cli_bench": {"adapters"},
    "cli_compare": {"scenes", "adapters"},
    "cli_files": {"scenes"},
    "cli_engines": {"adapters"},
    "cli_fuzz": {"adapters"},
    "cli_locality": {"scenes"},
    "cli_pages": {"scenes"},
    "cli_scenes": {"scenes"},
    "cli_srdf": {"scenes"},
    "cli_sweep": {"scenes"},
    "cli_view": {"adapters"},
    "sweeps": {"pyarrow", "distributed"},
    "tetrahedra": {"meshio"},
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
    for name in [name for name in by_room if name == "cli" or name.startswith("cli_")]:
        by_room.pop(name)
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


