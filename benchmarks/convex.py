"""Booleans and distances of convex pairs beside coal and python-fcl, as ratios, with the bars to be met.

    python benchmarks/convex.py --quick                      # a look: small hulls, few poses, no CSV
    python benchmarks/convex.py --table sphere               # one table at all its sizes
    python benchmarks/convex.py --table all --engines coal   # everything, without python-fcl

Tables: hulls of n points on a sphere, an ellipsoid 1:3:10, a pancake 1:50, and cylinders (two n/2-gons);
"shapes", random pairs of hundreds of different hulls, whose data are in no cache; "single", one Python call
a pair; "threads", large batches with `threads=2`, and plain arithmetic in two threads, µs in all (two cores
shared with others are less than two); "cgal", our boolean beside the times published for CGAL's hull
hierarchy, on other hardware. Poses: a third 0.05 to 1 lengths apart, a third within 1 % of touching, a third 5 to 50 %
    deep, shuffled into one batch; all engines get the same. Engines take turns in
one run, and ratios are of medians. Ours is a batch call, coal and python-fcl are Python loops, each at
its best: objects and transforms are ready beforehand, and booleans want no contacts. Our times by class
are of batches a third as long, which spread the cost of a call over fewer pairs.

First the engines are checked against each other: booleans must agree where the bodies are not within 1e-6
of touching. Bars are the ratios of a prototype; "stretch" is what is hoped for.
"""

from __future__ import annotations

import argparse
import csv
import re
import statistics
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from convex_peers import QUESTIONS, Coal, Fcl
from convex_shapes import CLASSES, LENGTH, Scene, WorldSolids, scene
from startup import machine

#: Distributions of the engines compared with.
PACKAGES = {"coal": "coal", "fcl": "python-fcl"}
RESULTS = Path(__file__).resolve().parent / "results"
SIZES = (8, 128, 512, 2048, 8192, 32768, 131072)
TABLES = {
    "sphere": SIZES, "ellipsoid": SIZES, "cylinder": SIZES, "pancake": SIZES, "shapes": (8, 128, 2048, 8192),
    "single": SIZES[:5], "threads": (8, 128, 2048, 8192), "cgal": (40, 100, 1000, 10_000, 100_000),
}  # fmt: skip

#: (table, question) -> n -> the prototype's ratio coal / ours; for threads, one thread's time / two threads'.
BARS: dict[tuple[str, str], dict[int, float]] = {
    ("sphere", "boolean"): dict(zip(SIZES, (4.1, 5.7, 7.1, 7.9, 10.6, 14.6, 54))),
    ("sphere", "signed"): dict(zip(SIZES, (2.4, 2.1, 2.2, 2.3, 3.5, 5.2, 15.7))),
    ("sphere", "unsigned"): dict(zip(SIZES, (3.0, 3.6, 4.0, 4.6, 9, 11, 45))),
    ("ellipsoid", "boolean"): {8192: 10.2}, ("ellipsoid", "signed"): {8192: 4.2},
    ("ellipsoid", "unsigned"): {8192: 5.2},
    ("cylinder", "boolean"): {512: 5.1, 8192: 5.9}, ("cylinder", "signed"): {512: 2.5, 8192: 3.0},
    ("cylinder", "unsigned"): {512: 2.8, 8192: 3.6},
    ("pancake", "boolean"): {32768: 15.7}, ("pancake", "signed"): {32768: 7.2}, ("pancake", "unsigned"): {32768: 8.5},
    ("shapes", "boolean"): {8: 6.0, 128: 13.5, 2048: 10.4, 8192: 22.9},
    ("shapes", "signed"): {8: 2.6, 128: 3.0, 2048: 4.3, 8192: 8.3},
    ("shapes", "unsigned"): {8: 3.3, 128: 5.0, 2048: 6.8, 8192: 12.2},
    ("single", "boolean"): dict(zip(SIZES, (2.0, 3.5, 5, 6.9, 13.9))),
    **{("threads", question): {n: 1.8 for n in TABLES["threads"]} for question in QUESTIONS},
}  # fmt: skip
STRETCH = {
    ("sphere", "boolean"): dict(zip(SIZES, (5, 7, 9, 11, 15, 20, 70))),
    ("sphere", "signed"): dict(zip(SIZES, (4, 4, 4, 5, 7, 10, 25))),
}
#: Published times of CGAL's hull hierarchy [µs]; ours must stay below a quarter.
CGAL = dict(zip(TABLES["cgal"], (1.7, 2.7, 12.9, 27.9, 58.4)))
#: Poses so near to touching, in lengths, that engines may disagree.
TOUCHING = 1e-6


# --- ours ---------------------------------------------------------------------------------------


def ours(asked: Scene, table: str, threads: int = 1) -> dict:
    """question -> a function of no arguments that answers the whole scene."""
    from collide import collide, distance

    solids, which, X_WBs = asked.solids, asked.which, asked.X_WBs
    if table == "shapes":
        in_world = WorldSolids(solids)
        return {
            "boolean": lambda: in_world.hits(which, X_WBs),
            "signed": lambda: in_world.rows(which, X_WBs)["distance"],
            "unsigned": lambda: in_world.rows(which, X_WBs, signed=False)["distance"],
        }
    A, B, eye = solids[0].shape, solids[1].shape, np.eye(4)
    if table == "single":
        poses = list(X_WBs)
        return {
            "boolean": lambda: [collide(A, B, eye, X) for X in poses],
            "signed": lambda: [distance(A, B, eye, X) for X in poses],
        }
    return {
        "boolean": lambda: collide(A, B, eye, X_WBs, threads=threads),
        "signed": lambda: distance(A, B, eye, X_WBs, threads=threads),
        "unsigned": lambda: distance(A, B, eye, X_WBs, signed=False, threads=threads),
    }


def operation_counts(asked: Scene) -> str:
    """Rounds of GJK and EPA for signed distances, and the time of one: what `PairResult.iterations` tells.

    A round asks one support point of each body, so this bounds the cost of a support query from above.
    The engine counts no support queries of booleans.
    """
    in_world = WorldSolids(asked.solids)
    rows = in_world.rows(asked.which, asked.X_WBs)
    seconds = min(seconds_of(lambda: in_world.rows(asked.which, asked.X_WBs)) for _ in range(3))
    gjk, epa = rows["iterations"] & 0xFFFF, rows["iterations"] >> 16
    parts = []
    for k, name in enumerate(CLASSES):
        of = asked.labels == k
        parts.append(f"{name} {gjk[of].mean():.1f}+{epa[of].mean():.1f}")
    each = seconds / max(int((gjk + epa).sum()), 1) * 1e9
    exact = int((rows["exact"] > 0).sum())
    return f"rounds of GJK+EPA: {', '.join(parts)}; {each:.0f} ns a round; exact stage on {exact} of {len(rows)}"


# --- measuring ----------------------------------------------------------------------------------


def seconds_of(task) -> float:
    started = time.perf_counter()
    task()
    return time.perf_counter() - started


def disagreements(asked: Scene, coal: Coal) -> str:
    """Against coal, away from touching: pairs whose booleans differ, and the largest difference of distances."""
    in_world = WorldSolids(asked.solids)
    not_touching = np.abs(asked.distances) > TOUCHING * LENGTH
    hits, signed = coal.answers("boolean") > 0, coal.answers("signed")
    differ = not_touching & (in_world.hits(asked.which, asked.X_WBs) != hits)
    text = f"{differ.sum()} of {not_touching.sum()} booleans differ from coal's"
    if differ.any():
        text += f" (in {(differ & (hits != (signed <= 0))).sum()} coal's own distance contradicts its boolean)"
    return f"{text}; distances by at most {np.abs(asked.distances - signed).max() / LENGTH:.0e} lengths"


def compared(table: str, n: int, asked: Scene, engines: list[str], repeats: int) -> list[dict]:
    """Rows of one size: medians of interleaved repeats, µs a pair, by question, engine and class of pose."""
    mix = ours(asked, table)
    parts = {name: ours(asked.only(np.flatnonzero(asked.labels == k)), table) for k, name in enumerate(CLASSES)}
    peers: dict = {e: {"coal": Coal, "fcl": Fcl}[e](asked.solids, asked.which, asked.X_WBs) for e in engines}
    loops = {"coal": {q: peers["coal"].loop(q) for q in QUESTIONS}} if "coal" in peers else {}
    times: dict[tuple[str, str, str], list[float]] = {}

    def note(question: str, engine: str, poses: str, seconds: float, count: int) -> None:
        times.setdefault((question, engine, poses), []).append(seconds / count * 1e6)

    if "coal" in peers:
        log(f"{table}, n = {n}: {disagreements(asked, peers['coal'])}")
    for _ in range(repeats + 1):
        for question, task in mix.items():
            note(question, "collide", "mix", seconds_of(task), len(asked.which))
            if "coal" in loops:
                note(question, "coal", "mix", seconds_of(loops["coal"][question]), len(asked.which))
            if "fcl" in peers:
                note(question, "fcl", "mix", peers["fcl"].seconds(question), len(asked.which))
            for k, name in enumerate(CLASSES):
                note(question, "collide", name, seconds_of(parts[name][question]), int((asked.labels == k).sum()))
    if "fcl" in peers:
        peers["fcl"].close()
    if table != "single":
        log(f"{table}, n = {n}: {operation_counts(asked)}")
    return [row(table, n, *key, warm) for key, (_, *warm) in times.items()]


def arithmetic(share: int) -> None:
    """Some ten milliseconds a share of work that touches no more than a cache holds, and lets other threads run."""
    numbers = np.linspace(0.0, 1.0, 20_000)
    for _ in range(100 * share):
        np.sin(numbers, out=numbers)


def threaded(n: int, asked: Scene, repeats: int) -> list[dict]:
    """The same batch by one thread and by two."""
    alone, together = ours(asked, "threads"), ours(asked, "threads", threads=2)
    times: dict[tuple[str, str, str], list[float]] = {}

    def note(question: str, seconds_a: float, seconds_b: float, count: int) -> None:
        times.setdefault((question, "collide", "mix"), []).append(seconds_a / count * 1e6)
        times.setdefault((question, "two threads", "mix"), []).append(seconds_b / count * 1e6)

    with ThreadPoolExecutor(2) as pool:
        for _ in range(repeats + 1):
            for question, task in alone.items():
                note(question, seconds_of(task), seconds_of(together[question]), len(asked.which))
            # What two threads of nothing but arithmetic gain: cores that are shared with others give less than two.
            shared = seconds_of(lambda: list(pool.map(arithmetic, (1, 1))))
            note("arithmetic", seconds_of(lambda: arithmetic(2)), shared, 1)
    return [row("threads", n, *key, warm) for key, (_, *warm) in times.items()]


def beside_cgal(n: int, asked: Scene, repeats: int) -> list[dict]:
    task = ours(asked, "cgal")["boolean"]
    taken = [seconds_of(task) / len(asked.which) * 1e6 for _ in range(repeats + 1)][1:]
    published = row("cgal", n, "boolean", "CGAL, published", "mix", [CGAL[n]]) if n in CGAL else None
    return [row("cgal", n, "boolean", "collide", "mix", taken), *([published] if published else [])]


def row(table: str, n: int, question: str, engine: str, poses: str, taken: list[float]) -> dict:
    return {
        "table": table, "n": n, "question": question, "engine": engine, "poses": poses, "runs": len(taken),
        "median_us": statistics.median(taken), "min_us": min(taken), "max_us": max(taken),
    }  # fmt: skip


# --- tables -------------------------------------------------------------------------------------


def judged(rows: list[dict]) -> list[dict]:
    """The rows with ratio, bar, stretch and verdict, where an engine is compared with ours."""
    ours_mixed = [r for r in rows if (r["engine"], r["poses"]) == ("collide", "mix")]
    mine = {(r["table"], r["n"], r["question"]): r["median_us"] for r in ours_mixed}
    for r in rows:
        r["ratio"] = r["bar"] = r["stretch"] = r["verdict"] = ""
        if r["engine"] == "collide":
            continue
        our_answers, key = mine[r["table"], r["n"], r["question"]], (r["table"], r["question"])
        ratio = our_answers / r["median_us"] if r["engine"] == "two threads" else r["median_us"] / our_answers
        bar: float | None = 4.0 if r["table"] == "cgal" else BARS.get(key, {}).get(r["n"])
        stretch = STRETCH.get(key, {}).get(r["n"])
        r["ratio"] = f"{ratio:.2f}"
        if r["engine"] != "fcl" and bar is not None:
            r["bar"], r["stretch"] = f"{bar:g}", f"{stretch:g}" if stretch else ""
            r["verdict"] = "missed" if ratio < bar else "stretch" if stretch and ratio >= stretch else "met"
    return rows


def show(table: str, rows: list[dict]) -> None:
    """One line a question and size: our time by class, theirs, the ratios and the bars."""
    others = [engine for engine in dict.fromkeys(r["engine"] for r in rows) if engine != "collide"]
    by_key = {(r["question"], r["n"], r["engine"], r["poses"]): r for r in rows}
    classes = [name for name in (*CLASSES, "mix") if any(r["poses"] == name for r in rows)]
    lines = [["question", "n", *classes, *(cell for e in others for cell in (e, "×")), "bar", "stretch", "verdict"]]
    for question in dict.fromkeys(r["question"] for r in rows):
        for n in dict.fromkeys(r["n"] for r in rows):
            line = [question, f"{n:,}"]
            line += [f"{by_key[question, n, 'collide', name]['median_us']:.3f}" for name in classes]
            verdict = ["", "", ""]
            for engine in others:
                r = by_key.get((question, n, engine, "mix"))
                line += [f"{r['median_us']:.3f}", r["ratio"]] if r else ["", ""]
                if r and r["bar"]:
                    verdict = [r["bar"], r["stretch"], r["verdict"]]
            lines.append(line + verdict)
    aligned(f"{table}: µs a pair; ours by class of pose and mixed, others mixed", lines)
    verdicts = [r for r in rows if r["verdict"]]
    missed = [f"{r['question']} at {r['n']:,}" for r in verdicts if r["verdict"] == "missed"]
    if verdicts:
        print(f"bars met: {len(verdicts) - len(missed)} of {len(verdicts)};", "missed:", ", ".join(missed) or "none")
    sys.stdout.flush()


def aligned(title: str, lines: list[list[str]]) -> None:
    """A table: the first column to the left, the others to the right."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    log(f"\n{title}")
    for first, *rest in lines:
        log("  ".join([first.ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(rest, widths[1:]))]).rstrip())


def write(name: str, rows: list[dict], about: dict[str, str]) -> Path:
    """The CSV of this name on this kind of machine; a later run on it takes its place."""
    slug = re.sub(r"[^a-z0-9]+", "-", about["cpu"].lower()).strip("-")
    RESULTS.mkdir(exist_ok=True)
    place = RESULTS / f"{name}_{slug}_{about['cores']}-cores.csv"
    with place.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*rows[0], *about], lineterminator="\n")
        writer.writeheader()
        for r in rows:
            rounded = {k: f"{v:.4f}" if isinstance(v, float) else v for k, v in r.items()}
            writer.writerow({**rounded, **about})
    return place


def say(text: str) -> None:
    """Progress."""
    print(text, file=sys.stderr, flush=True)


def log(text: str) -> None:
    """A finding."""
    print(text, flush=True)


#: Poses of each class that two threads share: they pay in batches that take ten milliseconds.
_FOR_THREADS = 20_000


def measure(table: str, n: int, poses: int, repeats: int, engines: list[str]) -> list[dict]:
    kind = table if table in ("sphere", "ellipsoid", "cylinder", "pancake") else "sphere"
    # As many different hulls as fill a cache many times over and still are made in a minute.
    shapes = min(500, max(60, 500_000 // n)) if table == "shapes" else 2
    if table == "threads":
        poses = max(poses, _FOR_THREADS)
    count = max(10, min(poses, poses * 8192 // n))
    say(f"{table}, n = {n}: placing {count} poses of each class" + (f" of {shapes} shapes" if shapes > 2 else ""))
    asked = scene(kind, n, count, shapes)
    say(f"  n = {n}: timing {repeats} repeats")
    if table == "threads":
        return threaded(n, asked, repeats)
    if table == "cgal":
        return beside_cgal(n, asked, repeats)
    return compared(table, n, asked, engines, repeats)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", choices=[*TABLES, "all"], default="all", help="which table (default: all)")
    parser.add_argument("--sizes", help="numbers of vertices, commas between (default: each table's own)")
    parser.add_argument("--poses", type=int, default=1000,
                        help="poses of each class up to n = 8,192, fewer above (default: 1000)")  # fmt: skip
    parser.add_argument("--repeats", type=int, default=9, help="interleaved repeats whose median counts (default: 9)")
    parser.add_argument("--engines", default="coal,fcl",
                        help="whom to compare with: coal, fcl, both with a comma, or '' (default: coal,fcl); "
                             "one that is not installed is left out with a word")  # fmt: skip
    parser.add_argument("--quick", action="store_true",
                        help="a look: n = 8, 128, 512 (or --sizes), 200 poses a class, 3 repeats, no CSV")  # fmt: skip
    parser.add_argument("--no-csv", action="store_true", help="print the tables alone")
    args = parser.parse_args()
    if args.quick:
        args.poses, args.repeats, args.no_csv = 200, 3, True
        args.sizes = args.sizes or "8,128,512"
    try:
        args.sizes = [int(word) for word in args.sizes.split(",")] if args.sizes else None
    except ValueError:
        parser.error(f"--sizes takes whole numbers with commas between, got {args.sizes!r}")
    args.engines = [word for word in args.engines.split(",") if word]
    if unknown := set(args.engines) - PACKAGES.keys():
        parser.error(f"no engine {', '.join(sorted(unknown))}: there are coal and fcl")
    if min(args.poses, args.repeats, *(n - 7 for n in args.sizes or [8])) < 1:
        parser.error("at least one pose, one repeat and eight vertices are needed")
    return args


def main() -> None:
    args, about = arguments(), machine()
    for engine in list(args.engines):
        if find_spec(engine) is None:
            say(f"left out: {engine} (not installed)")
            args.engines.remove(engine)
        else:
            about[engine] = metadata.version(PACKAGES[engine])
    print(", ".join(f"{name} {value}" for name, value in about.items()), flush=True)
    for table in TABLES if args.table == "all" else [args.table]:
        rows = []
        for n in args.sizes or TABLES[table]:
            rows += measure(table, n, args.poses, args.repeats, args.engines)
        show(table, judged(rows))
        if not args.no_csv:
            print("written to", write(f"convex-{table}", rows, about).relative_to(RESULTS.parent.parent))


if __name__ == "__main__":
    main()
