"""Compile all kernels ahead of time: object files of the entries per processor level, and C text that names them.

    python native/compile_kernels.py --out build/kernels
    python native/compile_kernels.py --out build/kernels --levels v3          # one level only, for a try
    python native/compile_kernels.py --out /tmp/arm --triple aarch64-unknown-linux-gnu

Needs numba and llvmlite, no C compiler. The front end runs once, for all levels; its result is kept in the folder,
under the
checksum of what it was made from, and so are the object files: a second call does nothing. The same sources and
    versions
give the same bytes.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import sys
import time
import zlib
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
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


def levels_of(triple: str) -> tuple[Level, ...]:
    """The levels of a platform. Raises SystemExit where there are none."""
    machine = triple.split("-")[0]
    if machine in ("x86_64", "amd64"):
        return X86
    if machine in ("aarch64", "arm64"):
        return APPLE if "apple" in triple else ARM
    raise SystemExit(f"kernels cannot be compiled for {triple}: known are x86_64, aarch64 and arm64")


class Compiled(NamedTuple):
    """What was made."""

    objects: dict[str, Path]
    entries: list[tuple[str, str, bool]]
    """(name, Numba's signature, whether Python's lock is let go), in the order of the table."""
    versions: str
    sources: int
    """`sources.fingerprint` of:"""
    source_files: tuple[str, ...]
    hashes: dict[str, str]
    """`sources.entry_hashes`."""


def compile_kernels(out: Path, triple: str = "", levels: tuple[str, ...] = (), jobs: int | None = None) -> Compiled:
    """Object files of all entries in ``out``, made where they are not there yet."""
    os.environ["COLLIDE_JIT"] = "1"  # whatever library lies in the checkout
    os.environ.pop("NUMBA_DISABLE_JIT", None)
    sys.path.insert(0, str(ROOT))
    with told("importing the kernels"):
        entries = _entries()
    import llvmlite.binding as llvm

    from collide.kernels import sources

    triple = triple or llvm.get_process_triple()
    wanted = [level for level in levels_of(triple) if not levels or level.name in levels]
    if not wanted:
        raise SystemExit(f"--levels: none of {levels} is among {[level.name for level in levels_of(triple)]}")
    names = sources.kernel_sources()
    fingerprint, described = sources.fingerprint(names), _described(entries)
    made_from = f"{fingerprint:08x} {sources.compiler_versions()} {zlib.crc32(Path(__file__).read_bytes()):08x}"
    out.mkdir(parents=True, exist_ok=True)
    bitcode = out / "kernels.bc"
    _forget_others(out, made_from)
    if not bitcode.exists():
        _front(entries, bitcode)
    called = [name for name, _, _ in described]
    objects = {level.name: out / f"kernels-{triple}-{level.name}.o" for level in wanted}
    missing = [level for level in wanted if not objects[level.name].exists()]
    with ProcessPoolExecutor(jobs or min(len(missing) or 1, os.cpu_count() or 1)) as pool:
        waiting = [pool.submit(_back, called, bitcode, level, triple, objects[level.name]) for level in missing]
        for one in waiting:
            one.result()
    hashes = sources.entry_hashes()
    if strange := set(hashes) ^ set(called):
        raise SystemExit(f"entries whose sources were not found, or the other way round: {', '.join(sorted(strange))}")
    return Compiled(objects, described, sources.compiler_versions(), fingerprint, names, hashes)


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


def _described(entries) -> list[tuple[str, str, bool]]:
    return [(entry.__name__, entry.signature, entry.nogil) for entry in entries]


def _forget_others(out: Path, made_from: str) -> None:
    """Delete what was made from other sources, or by other versions."""
    note = out / "made-from.txt"
    if note.exists() and note.read_text(encoding="utf-8") == made_from:
        return
    for file in (*out.glob("kernels*.o"), *out.glob("kernels.bc")):
        file.unlink()
    note.write_text(made_from, encoding="utf-8")


def _front(entries, bitcode: Path) -> None:
    """Numba's part, once for all levels."""
    import gc

    from collide.kernels.back_end import joined
    from collide.kernels.front_end import Lowered

    code = Lowered()
    gc.disable()  # hundreds of megabytes of syntax trees live to the end anyway
    with told(f"lowering {len(entries)} entries") as tell:
        for k, entry in enumerate(entries):
            tell(f"lowering {len(entries)} entries: {k + 1}, {entry.__name__}")
            code.add(entry.__name__, entry.function, entry.signature)
    gc.enable()
    _write(bitcode, joined(code.modules))


def _back(names: list[str], bitcode: Path, level: Level, triple: str, place: Path) -> None:
    from collide.kernels.back_end import Target, machine_code

    target = Target(level.cpu, level.features, triple, level.function_passes)
    with told(f"machine code for {level.cpu}"):
        _write(place, machine_code(names, [bitcode.read_bytes()], target, prefix=f"collide_{level.name}_"))


def _write(place: Path, content: bytes) -> None:
    part = place.with_suffix(".part")
    part.write_bytes(content)
    part.replace(place)


@contextmanager
def told(what: str):
    """Say what begins, how it goes on where somebody looks, and how long it took."""
    begun = time.perf_counter()
    print(f"collide: {what} ...", file=sys.stderr, flush=True)

    def tell(label: str) -> None:
        if sys.stderr.isatty():
            print(
                f"\r\x1b[2Kcollide: {label} ({time.perf_counter() - begun:.0f} s)", end="", file=sys.stderr, flush=True
            )

    yield tell
    end = "\r\x1b[2K" if sys.stderr.isatty() else ""
    print(f"{end}collide: {what}: done in {time.perf_counter() - begun:.1f} s", file=sys.stderr, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "kernels", help="folder of the object files")
    parser.add_argument("--triple", default="", help="LLVM's name of the platform, by default this one")
    parser.add_argument("--levels", nargs="*", default=(), help="levels of the platform, by default all: v2 v3 v4")
    parser.add_argument("--jobs", type=int, help="levels worked on at once, by default one a processor")
    parser.add_argument("--json", action="store_true", help="tell what was made as JSON")
    given = parser.parse_args()
    made = compile_kernels(given.out, given.triple, tuple(given.levels), given.jobs)
    if given.json:
        paths = {level: str(place) for level, place in made.objects.items()}
        print(
            json.dumps(
                {
                    "objects": paths,
                    "entries": made.entries,
                    "versions": made.versions,
                    "sources": made.sources,
                    "source_files": made.source_files,
                    "hashes": made.hashes,
                }
            )
        )
        return
    for level, place in made.objects.items():
        print(f"{level}: {place}, {place.stat().st_size / 1e6:.2f} MB, {platform.machine()}")


if __name__ == "__main__":
    main()
