"""Every mesh of pybullet_data, and many random corruptions of each: refused with the row to blame, or answered rightly.

    python benchmarks/mesh_corruptions.py                       # all files, 200 corruptions each: an hour or two
    python benchmarks/mesh_corruptions.py --minutes 20 --share 0/2
    python benchmarks/mesh_corruptions.py --only duck.obj --case 17

One case is one question of a probe beside the mesh, judged by exact arithmetic (`tests/families/mesh_corruptions.py`).
Files are gone through in rounds of a few corruptions, so that a run cut short has seen all of them. A file and the
number
of a case give the same case again. Exit status: 0 nothing wrong, 1 something is.
"""

from __future__ import annotations

import argparse
import logging
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from zlib import crc32

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "families"))

import mesh_corruptions

from collide.errors import CollideError
from collide.scenes.loaders.triangles import SUFFIXES, read_triangles

#: Corruptions of a file between two others.
ROUND = 10
#: Every so many cases the depth is asked too.
DEEP = 25


def files(only: str | None) -> list[tuple[str, Path]]:
    """Mesh files of pybullet_data by their names in it, sorted."""
    import pybullet_data

    root = Path(pybullet_data.getDataPath())
    files = [(p.relative_to(root).as_posix(), p) for p in root.rglob("*") if p.suffix.lower() in SUFFIXES]
    return sorted(entry for entry in files if only is None or only in entry[0])


def whole(path: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """All triangles of a file as one mesh; None of what has none."""
    try:
        parts = [(v, f) for _, v, f in read_triangles(path)[0] if len(f)]
    except CollideError as error:
        print(f"{path.name}: {error}")
        return None
    if not parts:
        return None
    starts = np.cumsum([0, *(len(v) for v, _ in parts)])
    return np.concatenate([v for v, _ in parts]), np.concatenate([f + s for (_, f), s in zip(parts, starts)])


def case(name: str, mesh: tuple[np.ndarray, np.ndarray], k: int) -> tuple[str, mesh_corruptions.Said]:
    """Case k of a file: number 0 is the mesh as it is."""
    rng = np.random.default_rng([crc32(name.encode()), k])
    kinds = mesh_corruptions.KINDS
    kind = kinds[0] if k == 0 else kinds[1 + k % (len(kinds) - 1)]
    return kind, mesh_corruptions.ask(rng, mesh_corruptions.spoil(rng, *mesh, kind), deep=k % DEEP == 0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corruptions", type=int, default=200, help="of each file (default: 200)")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after so long")
    parser.add_argument("--only", help="files with this in their names")
    parser.add_argument("--case", type=int, help="this case alone")
    parser.add_argument("--share", default="0/1", help="k/n: every n-th file, from the k-th; for several processes")
    parser.add_argument("--most-facets", type=int, default=10**9, help="leave out larger files")
    args = parser.parse_args()
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    offset, step = map(int, args.share.split("/"))
    started, counts, kinds, wrong, seen = time.perf_counter(), Counter(), Counter(), 0, set()
    some = files(args.only)[offset::step]
    cases = range(args.corruptions + 1) if args.case is None else [args.case]
    stopped = False
    for begin in range(0, len(cases), ROUND):
        for name, path in some:
            if time.perf_counter() - started > 60 * args.minutes:
                stopped = True
                break
            mesh = whole(path)
            if mesh is None or len(mesh[1]) > args.most_facets:
                counts["left out"] += begin == 0
                continue
            seen.add(name)
            for k in cases[begin : begin + ROUND]:
                try:
                    kind, outcome = case(name, mesh, k)
                except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
                    kind, outcome = "?", mesh_corruptions.Said("raised", False, f"{type(error).__name__}: {error}")
                counts[outcome.outcome] += 1
                counts["solids" if outcome.solid else "surfaces"] += outcome.outcome not in ("refused", "raised")
                kinds[kind] += 1
                if outcome.wrong:
                    wrong += 1
                    print(f"WRONG --only {name} --case {k} ({kind}): {outcome.wrong}", flush=True)
        spent = time.perf_counter() - started
        end = "in the middle of" if stopped else "after"
        print(
            f"{spent:6.0f} s  {end} case {min(begin + ROUND, len(cases)) - 1} of {len(seen)} files: {dict(counts)}, "
            f"{wrong} wrong",
            flush=True,
        )
        if stopped:
            break
    print(f"cases by kind: {dict(kinds)}")
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    main()
