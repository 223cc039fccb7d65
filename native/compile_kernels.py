"""Compile kernels ahead of time: an object file for each link unit and level of processors.

    python native/compile_kernels.py                       # for this processor's level, into build/kernels
    python native/compile_kernels.py --levels all          # for all levels of the platform, as releases have them
    python native/compile_kernels.py --out arm --triple aarch64-unknown-linux-gnu

Needs numba and llvmlite, no C compiler. Link units are compiled in parallel, each in a process of its own. Files are
kept under a hash of the code that they are made from: a second call compiles the units that an edit concerns. The same
sources and versions give the same bytes.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import multiprocessing
import os
import platform
import sys
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent


class Level(NamedTuple):
    """One kind of processor that the library serves.

    function_passes, features : what made kernels as fast as those compiled for the very processor; see docs/kernels.md.
    """

    name: str
    cpu: str
    features: str = ""
    function_passes: bool = False


X86 = (
    Level("v2", "x86-64-v2"),
    Level("v3", "x86-64-v3", function_passes=True),
    # As LLVM defines it the level prefers vectors of 256 bits: kernels are up to a fifth slower.
    Level("v4", "x86-64-v4", features="-prefer-256-bit"),
)
ARM = (Level("arm64", "generic"),)
APPLE = (Level("arm64", "apple-m1"),)


#: Link units, those that take longest first, and the beginnings of the names of their modules in `collide`: kernels
#: that share what they call stand together.
UNITS = {
    "convex": ("narrowphase.",),
    "contacts": ("contact.",),
    "papers": ("hierarchies.", "polytopes.", "tetrahedra.", "least_distance."),
    "facets": ("narrowphase.facets.",),
    "motion": ("casts.", "motion."),
    "exact": ("narrowphase.exact.",),
    "worlds": ("broadphase.", "robots.", "support.", "numerics."),
    "meshes": ("mesh.", "solids.", "hull."),
}


def unit_of(module: str) -> str:
    """The link unit of an entry's module: that with the longest beginning of its name."""
    name = module.removeprefix("collide.")
    found = [(len(start), unit) for unit, starts in UNITS.items() for start in starts if name.startswith(start)]
    if not found:
        raise SystemExit(f"{module} defines an entry, and UNITS of native/compile_kernels.py has no link unit for it")
    return max(found)[1]


def levels_of(triple: str, wanted: str = "") -> tuple[Level, ...]:
    """Levels of a platform. wanted : names, "all", or "" for that of this machine, where it is of the platform.

    Raises SystemExit where there are none.
    """
    machine = triple.split("-")[0]
    if machine in ("x86_64", "amd64"):
        levels: tuple[Level, ...] = X86
    elif machine in ("aarch64", "arm64"):
        levels = APPLE if "apple" in triple else ARM
    else:
        raise SystemExit(f"kernels cannot be compiled for {triple}: known are x86_64, aarch64 and arm64")
    names = [level.name for level in levels]
    if wanted == "all" or (not wanted and machine != platform.machine().lower()):
        return levels
    chosen = wanted.replace(",", " ").split() or [_own_level(names)]
    if strange := [name for name in chosen if name not in names]:
        raise SystemExit(f"COLLIDE_LEVELS: {strange[0]!r} is no level of {machine}; it has {', '.join(names)}, and all")
    return tuple(level for level in levels if level.name in chosen)


def _own_level(names: list[str]) -> str:
    """The best of these levels that this processor has, as `levels.h` decides it."""
    if len(names) == 1:
        return names[0]
    import llvmlite.binding as llvm

    has = llvm.get_host_cpu_features()
    needs = {
        "v4": ("avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl"),
        "v3": ("fma", "movbe", "avx", "f16c", "bmi", "avx2", "bmi2", "lzcnt"),
    }
    return next((name for name, features in needs.items() if all(has.get(one) for one in features)), "v2")


class Compiled(NamedTuple):
    """What was made."""

    objects: dict[str, list[Path]]
    """By level."""
    entries: list[tuple[str, str, bool]]
    """(name, Numba's signature, whether Python's lock is let go), in the order of the table."""
    versions: str
    sources: int
    """`sources.fingerprint` of:"""
    source_files: tuple[str, ...]
    hashes: dict[str, str]
    """`sources.entry_hashes`."""


def compile_kernels(out: Path, triple: str = "", levels: str = "", jobs: int | None = None) -> Compiled:
    """Object files of all entries in ``out``, made where they are not there yet. levels : as in `levels_of`."""
    os.environ["COLLIDE_JIT"] = "1"  # whatever library lies in the checkout
    os.environ.pop("NUMBA_DISABLE_JIT", None)
    sys.path.insert(0, str(ROOT))
    begun = time.perf_counter()
    say("importing the kernels")
    entries = _entries()
    import llvmlite.binding as llvm

    from collide.kernels import sources

    triple = triple or llvm.get_process_triple()
    chosen, names, hashes = levels_of(triple, levels), sources.kernel_sources(), sources.entry_hashes()
    fingerprint = sources.fingerprint(names)  # now: of what is compiled, whatever is edited meanwhile
    described = [(entry.__name__, entry.signature, entry.nogil) for entry in entries]
    if strange := set(hashes) ^ {entry.__name__ for entry in entries}:
        raise SystemExit(f"entries whose sources were not found, or the other way round: {', '.join(sorted(strange))}")
    out.mkdir(parents=True, exist_ok=True)
    tasks = [_Task(unit, triple, chosen, out, _made_from(unit, hashes, sources.compiler_versions())) for unit in UNITS]
    missing = [task for task in tasks if not all(task.place(level).exists() for level in task.levels)]
    if missing:
        counts = f"{len(missing)} of {len(tasks)} link units for {', '.join(level.cpu for level in chosen)}"
        say(f"compiling {counts}: {', '.join(task.unit for task in missing)} (about a minute for all on two cores)")
        with multiprocessing.Pool(min(jobs or os.cpu_count() or 1, len(missing)), maxtasksperchild=1) as pool:
            for done, (unit, seconds) in enumerate(pool.imap_unordered(_make, missing, chunksize=1), 1):
                say(f"{done} of {len(missing)}: {unit}, {seconds:.0f} s")
    _forget_others(out, tasks)
    say(f"machine code of {len(entries)} kernels: {time.perf_counter() - begun:.0f} s")
    objects = {level.name: [task.place(level) for task in tasks] for level in chosen}
    return Compiled(objects, described, sources.compiler_versions(), fingerprint, names, hashes)


class _Task(NamedTuple):
    """A link unit to be compiled."""

    unit: str
    triple: str
    levels: tuple[Level, ...]
    out: Path
    made_from: str

    def place(self, level: Level) -> Path:
        return self.out / f"{self.unit}-{self.triple}-{level.name}-{self.made_from}.o"


def _made_from(unit: str, hashes: dict[str, str], versions: str) -> str:
    """A hash of all that a unit's machine code depends on."""
    own = sorted((entry.__name__, entry.signature, hashes[entry.__name__]) for entry in _entries_of(unit))
    return hashlib.sha256(repr((own, versions, X86, ARM, APPLE)).encode()).hexdigest()[:16]


def _entries_of(unit: str) -> list:
    return [entry for entry in _entries() if unit_of(entry.function.__module__) == unit]


def _forget_others(out: Path, tasks: list[_Task]) -> None:
    """Delete what was made from other sources, or by other versions."""
    for task in tasks:
        for file in (*out.glob(f"{task.unit}-*.o"), *out.glob(f"{task.unit}-*.bc")):
            if not file.stem.endswith(task.made_from):
                file.unlink()


@cache
def _entries() -> list:
    """All entries of the package, in the order of their modules' names and of the lines in them."""
    from collide.kernels import jit

    written = 0
    for file in sorted((ROOT / "collide").rglob("*.py")):
        if found := sum(line.startswith("@entry(") for line in file.read_text(encoding="utf-8").splitlines()):
            importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
            written += found
    own = [entry for entry in jit.entries if entry.function.__module__.startswith("collide.")]
    entries = sorted(own, key=lambda entry: (entry.function.__module__, entry.function.__code__.co_firstlineno))
    names = [entry.__name__ for entry in entries]
    if twice := {name for name in names if names.count(name) > 1}:
        raise SystemExit(f"two entries have one name: {', '.join(sorted(twice))}")
    if written != len(entries):
        raise SystemExit(f"{written} entries stand in the sources, {len(entries)} were found")
    return entries


def _make(task: _Task) -> tuple[str, float]:
    """Numba's part of a unit, kept for further levels, and LLVM's for each level. (unit, seconds)."""
    from collide.kernels.back_end import Target, machine_code

    begun = time.perf_counter()
    bitcode = task.out / f"{task.unit}-{task.made_from}.bc"
    if not bitcode.exists():
        _write(bitcode, _lowered(task.unit))
    names = [entry.__name__ for entry in _entries_of(task.unit)]
    for level in task.levels:
        if not task.place(level).exists():
            target = Target(level.cpu, level.features, task.triple, level.function_passes)
            code = machine_code(names, [bitcode.read_bytes()], target, prefix=f"collide_{level.name}_")
            _write(task.place(level), code)
    return task.unit, time.perf_counter() - begun


def _lowered(unit: str) -> bytes:
    import gc

    from collide.kernels.back_end import joined
    from collide.kernels.front_end import Lowered

    code = Lowered()
    gc.disable()  # hundreds of megabytes of syntax trees live to the end anyway
    for entry in _entries_of(unit):
        code.add(entry.__name__, entry.function, entry.signature)
    return joined(code.modules)


def _write(place: Path, content: bytes) -> None:
    part = place.with_suffix(".part")
    part.write_bytes(content)
    part.replace(place)


def say(what: str) -> None:
    """On stderr; and where that is no terminal, as under pip, which hides what builds say, on the terminal itself."""
    print(f"collide: {what}", file=sys.stderr, flush=True)
    if not sys.stderr.isatty():
        with suppress(OSError), open("/dev/tty", "w", encoding="utf-8") as terminal:
            terminal.write(f"\r\x1b[2Kcollide: {what}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "kernels", help="folder of the object files")
    parser.add_argument("--triple", default="", help="LLVM's name of the platform, by default this one")
    parser.add_argument("--levels", default="", help="v2, v3, v4, several of them, or all; by default this processor's")
    parser.add_argument("--jobs", type=int, help="link units compiled at once, by default one a processor")
    parser.add_argument("--json", action="store_true", help="tell what was made as JSON")
    given = parser.parse_args()
    made = compile_kernels(given.out, given.triple, given.levels, given.jobs)
    if given.json:
        objects = {level: [str(place) for place in places] for level, places in made.objects.items()}
        print(json.dumps({**made._asdict(), "objects": objects}))
        return
    for level, places in made.objects.items():
        size = sum(place.stat().st_size for place in places)
        print(f"{level}: {len(places)} files in {given.out}, {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
