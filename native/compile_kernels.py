"""Compile kernels ahead of time: object files of all kernels for each level of processors.

    python native/compile_kernels.py                       # for this processor's level, into build/kernels
    python native/compile_kernels.py --levels all          # for all levels of the platform, as releases have them
    python native/compile_kernels.py --out arm --triple aarch64-unknown-linux-gnu

Needs numba and llvmlite, no C compiler. Three kinds of files are kept, and a second call makes those anew that an edit
concerns: each kernel as Numba lowers it (`collide/kernels/kept_lowered.py`), each link unit's list of its objects,
under a hash of its entries' code, and each object file, under a hash of what LLVM makes it from. So an object is the
same, byte by byte, whether or not there was anything to take. Units are lowered in parallel, then objects compiled.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import multiprocessing
import os
import pickle
import platform
import subprocess
import sys
import time
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent


#: Seconds after which a lowered kernel that nothing asked for is forgotten.
_KEPT_FOR = 30 * 86_400


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


#: Link units and the beginnings of the names of their modules in `collide`: kernels that share what they call stand
#: together. Those that take longest are lowered first; two that share much not at once, or both would lower it.
UNITS = {
    "convex": ("narrowphase.",),
    "derivatives": ("derivatives.",),
    "papers": ("papers.", "least_distance."),
    "contacts": ("contact.",),
    "facets": ("narrowphase.facets.",),
    "motion": ("casts.", "motion."),
    "exact": ("narrowphase.exact.",),
    "meshes": ("mesh.", "solids.", "hull.", "lowering.", "fields."),
    "worlds": ("broadphase.", "robots.", "support.", "numerics."),
}


#: Kernels that stand in objects of their own, which their callers' objects call: large ones that are called from few
#: places, and seldom in a pair's time. An edit of theirs, or of what they call, does not concern their callers' code.
APART = (
    "narrowphase.core_distance._by_epa", "narrowphase.core_distance._shallow_depth",
    "narrowphase.epa.expand_polytope.epa", "narrowphase.epa.refine_depth.refine",
    "narrowphase.gap.gap_queue.refine_queued", "narrowphase.gjk.mpr_batch.answer_small_hulls",
    "narrowphase.composite.composite_rows.separate_bodies", "narrowphase.halfspace_convex.halfspace_convex",
    "narrowphase.shallow_cylinders.shallow_cylinders", "narrowphase.exact.exact_gjk.touch_exactly",
    "narrowphase.facets.exact_triangles._meeting_exactly",
    "contact.shallow_overlaps.separate_pairs", "contact.contact_patches.grow_patch",
    "contact.facet_manifolds._put_patch", "contact.facet_manifolds._put_patches",
    "contact.convex_manifolds.put_manifold", "contact.closed_form_rows.put_closed_form",
    "contact.support_face.support_face", "contact.curved_manifolds._put_patches",
    "contact.curved_patches.grow_over", "contact.patch_rows.choose_points", "contact.clearing_length._facets_part",
    "casts.portal.cast_line", "casts.cut_parts.cut_part", "motion.kept_axis.gap_along",
    "motion.convex_impact.search_contact", "hull.quickhull.grow_hull",
)


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
    if strange := [name for name in APART if not _is_kernel(name)]:
        raise SystemExit(f"{strange[0]} stands in APART of native/compile_kernels.py, and is no kernel of its module")
    out.mkdir(parents=True, exist_ok=True)
    tasks = [_Unit(unit, out, _made_from(unit, hashes, sources.compiler_versions())) for unit in UNITS]
    jobs = jobs or os.cpu_count() or 1
    if changed := [task for task in tasks if not task.complete()]:
        say(f"lowering {len(changed)} of {len(tasks)} link units: {', '.join(task.unit for task in changed)}")
        _do(_lower, changed, jobs)
    groups = list(dict.fromkeys(group for task in tasks for group in task.groups()))
    missing = [
        _Object(group, triple, level, out) for group in groups for level in chosen
        if not group.place(out, triple, level).exists()
    ]
    if missing:
        made_for = ", ".join(level.cpu for level in chosen)
        say(f"compiling {len(missing)} of {len(groups) * len(chosen)} objects for {made_for}")
        _do(_compile, sorted(missing, key=lambda task: -task.group.size), jobs)
    _forget_others(out, tasks, groups)
    say(f"machine code of {len(entries)} kernels: {time.perf_counter() - begun:.0f} s")
    objects = {level.name: [group.place(out, triple, level) for group in groups] for level in chosen}
    return Compiled(objects, described, sources.compiler_versions(), fingerprint, names, hashes)


def _do(work, tasks: list, jobs: int) -> None:
    """Each task in a process of its own, so that what one leaves in memory ends with it."""
    with multiprocessing.Pool(min(jobs, len(tasks)), maxtasksperchild=1) as pool:
        for done, (name, seconds) in enumerate(pool.imap_unordered(work, tasks, chunksize=1), 1):
            if seconds > 2 or done == len(tasks):
                say(f"{done} of {len(tasks)}: {name}, {seconds:.0f} s")


class _Group(NamedTuple):
    """What one object file is made from: the entries of a module, or a kernel that stands apart, with all they call."""

    label: str
    digest: str
    size: int

    def place(self, out: Path, triple: str, level: Level) -> Path:
        return out / f"{self.label}-{triple}-{level.name}-{self.digest}.o"

    def code(self, out: Path) -> Path:
        return out / f"{self.label}-{self.digest}.bc"


class _Unit(NamedTuple):
    """A link unit, and the list of its objects."""

    unit: str
    out: Path
    made_from: str

    @property
    def place(self) -> Path:
        return self.out / f"{self.unit}-{self.made_from}.json"

    def groups(self) -> list[_Group]:
        return [_Group(*known) for known in json.loads(self.place.read_text(encoding="utf-8"))]

    def complete(self) -> bool:
        return self.place.exists() and all(group.code(self.out).exists() for group in self.groups())


class _Object(NamedTuple):
    """An object file to be made."""

    group: _Group
    triple: str
    level: Level
    out: Path


def _made_from(unit: str, hashes: dict[str, str], versions: str) -> str:
    """A hash of all that a unit's machine code depends on."""
    own = sorted((entry.__name__, entry.signature, hashes[entry.__name__]) for entry in _entries_of(unit))
    return hashlib.sha256(repr((own, versions, X86, ARM, APPLE, APART)).encode()).hexdigest()[:16]


def _entries_of(unit: str) -> list:
    return [entry for entry in _entries() if unit_of(entry.function.__module__) == unit]


def _is_kernel(name: str) -> bool:
    from collide.kernels.front_end import KernelDispatcher

    module, _, function = f"collide.{name}".rpartition(".")
    return isinstance(getattr(sys.modules.get(module), function, None), KernelDispatcher)


def _forget_others(out: Path, tasks: list[_Unit], groups: list[_Group]) -> None:
    """Delete what was made from other sources, or by other versions."""
    known = {task.made_from for task in tasks} | {group.digest for group in groups}
    for file in (*out.glob("*.o"), *out.glob("*.bc"), *out.glob("*.json")):
        if file.stem.split("-")[-1] not in known:
            file.unlink()
    for file in (out / "lowered").glob("*"):
        if file.stat().st_mtime < time.time() - _KEPT_FOR:
            file.unlink(missing_ok=True)


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


def _lower(task: _Unit) -> tuple[str, float]:
    """Numba's part of a unit's objects, and the list of them. (unit, seconds)."""
    import gc

    from collide.kernels.front_end import Lowered, keep_lowered

    begun = time.perf_counter()
    gc.disable()  # hundreds of megabytes of syntax trees live to the end anyway
    keep_lowered(task.out / "lowered")
    apart, modules = frozenset(f"collide.{name}" for name in APART), {}
    for entry in _entries_of(task.unit):
        code = modules.setdefault(entry.function.__module__, Lowered(apart))
        code.add(entry.__name__, entry.function, entry.signature)
    groups = [_written(module.split(".")[-1], code, task.out) for module, code in modules.items()]
    waiting, known = [code.outside for code in modules.values()], set()
    while waiting:
        for name, library in waiting.pop().items():
            if name not in known:
                known.add(name)
                code = Lowered(apart)
                code.add_apart(name, library)
                groups.append(_written(name, code, task.out))
                waiting.append(code.outside)
    _write(task.place, json.dumps(groups).encode())
    return task.unit, time.perf_counter() - begun


def _written(label: str, code, out: Path) -> _Group:
    """What an object is made from, in a file under its hash."""
    from collide.kernels import sources

    names, outside = code.names, sorted(code.outside)
    versions = repr((sources.compiler_versions(), sources.of_compiler(), X86, ARM, APPLE))
    digest = hashlib.sha256(repr((versions, names, outside)).encode())
    for module in code.modules:
        digest.update(hashlib.sha256(module).digest())
    group = _Group(label, digest.hexdigest()[:16], sum(map(len, code.modules)))
    if not group.code(out).exists():
        _write(group.code(out), zlib.compress(pickle.dumps((names, outside, code.modules)), 1))
    return group


def _compile(task: _Object) -> tuple[str, float]:
    """LLVM's part of an object. (its name, seconds)."""
    from collide.kernels.back_end import Target, machine_code

    begun = time.perf_counter()
    names, outside, modules = pickle.loads(zlib.decompress(task.group.code(task.out).read_bytes()))
    level = task.level
    target = Target(level.cpu, level.features, task.triple, level.function_passes)
    code = machine_code(names, modules, target, prefix=f"collide_{level.name}_", outside=outside)
    _write(task.group.place(task.out, task.triple, level), code)
    return f"{task.group.label} for {level.cpu}", time.perf_counter() - begun


def _write(place: Path, content: bytes) -> None:
    part = place.with_suffix(f".{os.getpid()}")  # units that call one kernel write its object's file both
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
    if os.environ.get("PYTHONHASHSEED") != "0":  # the order of sets, which Numba's code has, must be one for all
        seeded = {**os.environ, "PYTHONHASHSEED": "0"}
        raise SystemExit(subprocess.run([sys.executable, *sys.argv], env=seeded, check=False).returncode)
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
