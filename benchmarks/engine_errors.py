"""Every engine asked the hard families and the published cases: wrong booleans, mishaps, errors of distances.

python benchmarks/engine_errors.py [--cases 10] [--seed 1] [--engines coal,fcl] [--part families]

Answers are judged in exact arithmetic. Wrong booleans are counted twice: all of them, and those of pairs farther than
1e-12 of their size from touching. Engines whose packages are absent are left out; so are the published cases where
../shared is. Tables are printed as Markdown and written to results/ as CSV.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections import Counter
from pathlib import Path

import numpy as np

from collide import Box, Capsule, ConvexHull, Cylinder, Ellipsoid
from collide.adapters.peers.answers import counted
from collide.adapters.peers.protocol import ENGINES, Question, check_names, engine, installed
from collide.adapters.peers.stress import HIT, run
from collide.scenes.families import mesh_names, names

HERE = Path(__file__).resolve().parent
PUBLISHED = HERE.parents[1] / "shared" / "data" / "cases" / "published_cases.json"
#: Pairs nearer to touching than this part of their size are counted apart.
TOUCHING = 1e-12
#: A distance off by more than this part of the pair's size is wrong.
WRONG = 1e-6

MAKERS = {
    "box": lambda d: Box(d["size"]), "convex": lambda d: ConvexHull(d["vertices"]),
    "sphere": lambda d: ConvexHull([(0, 0, 0)], radius=d["radius"]),  # some have radius 0
    "capsule": lambda d: Capsule(d["radius"], d["length"]), "cylinder": lambda d: Cylinder(d["radius"], d["length"]),
    "ellipsoid": lambda d: Ellipsoid(d["radii"]),
}  # fmt: skip


def families(name: str, n: int, seed: int, timeout: float) -> list[dict]:
    """A row for the convex families together, and one for those of meshes."""
    rows = []
    for group, members in (("convex", names()), ("meshes", mesh_names())):
        table = run(members, n=n, seed=seed, engine=name, timeout=timeout)
        total = table.total()
        wrong = [finding for finding in table.findings if finding.kind == HIT]
        row = {
            "engine": name, "version": table.version, "families": group, "cases": total.cases,
            "not asked": total.unsupported, "wrong": total.wrong, "false hits": total.false_hits,
            "missed hits": total.false_misses, "wrong, not touching": sum(f.gap > TOUCHING for f in wrong),
            "farthest": max((f.gap for f in wrong), default=0.0), "undecided": total.undecided,
            "mishaps": counted(total.mishaps), "gap off by": total.distance_error_of_size,
            "depth off by": total.depth_error_of_size,
        }  # fmt: skip
        worst = Counter(f.family for f in wrong if f.gap > TOUCHING).most_common(3)
        rows.append(row | {"most in": ", ".join(f"{family} {count}" for family, count in worst)})
    return rows


def published(engines: list[str], timeout: float) -> list[dict]:
    """A row for every engine: the published pairs, against their references."""
    if not PUBLISHED.exists():
        print(f"published cases left out: {PUBLISHED} is not beside this checkout")
        return []
    records = json.loads(PUBLISHED.read_text())
    pairs = [
        (*(MAKERS[r[side]["type"]](r[side]) for side in "ab"), np.array(r["Ta"]), np.array(r["Tb"])) for r in records
    ]
    question = Question.from_pairs(pairs)
    truth, size = np.array([r["ref"] for r in records]), np.array(question.sizes())
    gap = np.abs(truth) > 1e-7 * size  # some references are good to 1e-8
    rows = []
    for name in engines:
        table = engine(name, timeout=timeout).answer(question)
        answered, with_distance = table.rows["answered"], table.rows["has_distance"]
        wrong = answered & gap & (table.rows["hit"] != (truth <= 0))
        off = np.where(with_distance, np.abs(table.rows["distance"] - truth) / size, 0.0)
        rows.append({
            "engine": name, "version": table.version, "cases": len(records), "answered": int(answered.sum()),
            "wrong booleans, clear of touching": int(wrong.sum()), "of": int((answered & gap).sum()),
            "wrong distances": int((off > WRONG).sum()), "with a distance": int(with_distance.sum()),
            "off by at most": float(off.max()), "mishaps": counted(Counter(filter(None, table.mishaps))),
            "worst": records[int(off.argmax())]["id"] if off.max() > WRONG else "",
        })  # fmt: skip
    return rows


def show(rows: list[dict], path: Path | None) -> None:
    """Print rows as a Markdown table, and write them as CSV."""
    if not rows:
        return
    print("| " + " | ".join(rows[0]) + " |\n|" + " --- |" * len(rows[0]))
    for row in rows:
        print("| " + " | ".join(f"{v:.0e}" if isinstance(v, float) else "-" if v is None else str(v)
                                for v in row.values()) + " |")  # fmt: skip
    if path is not None:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10, help="cases a family (10)")
    parser.add_argument("--seed", type=int, default=1, help="other seeds make other cases (1)")
    parser.add_argument("--engines", help="names, separated by commas (default: all that are installed, without exact)")
    parser.add_argument("--part", choices=("families", "published"), action="append", help="one part alone")
    parser.add_argument("--timeout", type=float, default=5.0, help="seconds an engine in a process may take a pair (5)")
    parser.add_argument("--no-csv", action="store_true", help="keep the results as they are")
    args = parser.parse_args()
    engines = args.engines.split(",") if args.engines else [name for name in installed() if name != "exact"]
    check_names(engines)
    absent = [name for name in ENGINES if name not in installed()]
    print(f"not installed: {', '.join(absent) or 'none'}\n")
    parts = args.part or ["families", "published"]
    folder = None if args.no_csv else HERE / "results"
    if "published" in parts:
        show(published(engines, args.timeout), folder and folder / "engine-errors-published.csv")
    if "families" in parts:
        rows = []
        for name in engines:
            start = time.perf_counter()
            rows += families(name, args.cases, args.seed, args.timeout)
            print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)
            show(rows[-2:], None)
        print(f"\n{args.cases} cases a family, seed {args.seed}")
        show(rows, folder and folder / "engine-errors-families.csv")


if __name__ == "__main__":
    main()
