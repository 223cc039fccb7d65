"""The walk of Barba and Langerman: rounds, constant-size tests a round and time against the number of vertices.

    python benchmarks/walk.py                # some minutes; --sizes, --kinds, --no-csv, --plot FILE
    python benchmarks/walk.py --fits         # of the rows written before

Pairs of bodies of n vertices of several kinds, at poses of which about half meet and many nearly touch. Counts are
exact, so they are fitted: rounds ≤ a + b·(log2 n + log2 m), for the mean and for the largest of all poses, and tests a
round, which must not grow: a mean above MAX_TESTS ends the run with an error. Time is
taken in turns with the default algorithm on the same hundred poses, the fastest of several turns; every answer is
compared with the default's. Two hybrids are timed beside them: the walk that tries every new plane against the whole
bodies at once (early), and the default given the walk's last plane to begin with, free of charge (default_with_axes).
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "hierarchies"))
import hierarchy_families as families
from supports import cloud, least

import collide
from collide.hierarchies.run_walk import run_walks
from collide.hierarchies.walk import APART
from collide.lowering.parts import convex_set_of

SIZES = (32, 128, 512, 2048, 8192, 32768, 131072, 1000000)
KINDS = ("sphere", "pancake", "cylinder", "bipyramid", "doubling", "moment curve")
#: Tests a round that no row may exceed in the mean. A round scans what went beside one vertex, some ten vertices, and
#: one in ten plays a game of two stars. The most, 16.7, is of a bipyramid of 128 vertices, whose two apexes are in play
#: in many of its 17 rounds; larger bodies have less.
MAX_TESTS = 20.0
POSES = 1000
#: Poses timed together: few enough that a turn is seldom interrupted.
CHUNK = 100
TURNS = 9


def body(kind: str, n: int, seed: int) -> collide.ConvexHull:
    """About n vertices. "doubling" is the example of section 4: the degree of one vertex doubles level by level."""
    if kind == "doubling":
        return collide.ConvexHull(families.degree_doubling(round(np.log2(n / 3))))
    if kind == "moment curve":  # t from −1 in steps so short that t³ is a double: rounded, it would take minutes
        t = (np.arange(n + seed) - n // 2) / 2.0 ** np.ceil(np.log2(n // 2))
        return collide.ConvexHull(np.column_stack([t, t * t, t**3]))
    points = cloud(kind, n + seed)
    return collide.ConvexHull(points)


def poses(A, B, rng) -> np.ndarray:
    """A turned at random about the origin, and moved so far along a random line that the bodies are near touching."""
    X = np.tile(np.eye(4), (POSES, 1, 1))
    q = rng.standard_normal((POSES, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    X[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1)
    X[:, 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1)
    X[:, 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    line = rng.standard_normal((POSES, 3))
    line /= np.linalg.norm(line, axis=1)[:, None]
    # Extents along the line overlap by −10 % to 30 %; a random tenth is at a thousandth of that.
    reach_a = extents(A.points, np.einsum("kij,ki->kj", X[:, :3, :3], line))
    reach_b = extents(B.points, line)
    share = rng.uniform(-0.3, 0.1, POSES)
    share[::10] *= 1e-3
    X[:, :3, 3] = -line * ((reach_a + reach_b) * (1 + share))[:, None]
    return X


def extents(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far all points (n, 3) reach along each of the directions (k, 3)."""
    blocks = (points[first : first + 10_000] for first in range(0, len(points), 10_000))
    return np.max([(directions @ block.T).max(axis=1) for block in blocks], axis=0)


def measured(kind: str, n: int) -> dict:
    rng = np.random.default_rng(n)
    A, B = body(kind, n, 0), body(kind, n, 2)
    X_WA, X_WB = poses(A, B, rng), np.eye(4)[None]
    started = time.perf_counter()
    result = collide.walk(A, B, X_WA, X_WB)
    prepared = time.perf_counter() - started
    truth = collide.collide(A, B, X_WA, X_WB)
    assert (result.hit == truth).all(), f"{kind} {n}: the walk and the default disagree"
    axes = result.rows["axis"] * np.where(result.exchanged, -1.0, 1.0) * (result.rows["status"] == APART)[:, None]
    packed_a, packed_b = convex_set_of(A), convex_set_of(B)
    names = "default", "walk", "walk_kernel", "early_kernel", "default_with_axes"
    seconds = dict.fromkeys(names, 0.0)
    for start in range(0, POSES, CHUNK):
        chunk = slice(start, start + CHUNK)
        X, X_of_B, axes_k = X_WA[chunk], np.broadcast_to(X_WB, (CHUNK, 4, 4)), axes[chunk]

        def by_kernel(early, X=X, X_of_B=X_of_B):
            run_walks(A._walk, B._walk, packed_a, packed_b, X, X_of_B, early=early)

        tasks = {
            "default": lambda X=X: collide.collide(A, B, X, X_WB),
            "walk": lambda X=X: collide.walk(A, B, X, X_WB),
            "walk_kernel": lambda: by_kernel(False),
            "early_kernel": lambda: by_kernel(True),
            "default_with_axes": lambda X=X, axes_k=axes_k: collide.collide(A, B, X, X_WB, axes=axes_k.copy()),
        }
        fastest = dict.fromkeys(names, np.inf)
        for _ in range(TURNS):
            for name in names:
                fastest[name] = min(fastest[name], least(tasks[name], 1))
        for name in names:
            seconds[name] += fastest[name]
    rows = result.rows
    per = 1e6 / POSES
    hierarchy_p, hierarchy_q = A._walk.hierarchy, B._walk.polar.hierarchy
    return {
        "kind": kind, "asked": n, "n": len(A.hull.vertices), "m": len(B.hull.vertices),
        "facets_of_r": len(B._walk.polar.starts) - 1,
        "depth_p": result.depth_p, "depth_q": result.depth_q, "hits": truth.mean(),
        "rounds_mean": rows["rounds"].mean(), "rounds_most": int(rows["rounds"].max()),
        "tests_mean": rows["tests"].mean(), "tests_most": int(rows["tests"].max()),
        "tests_a_round": rows["tests"].sum() / rows["rounds"].sum(),
        "tests_a_round_most": (rows["tests"] / rows["rounds"]).max(),
        "games_mean": rows["games"].mean(), "pivots_mean": rows["pivots"].mean(),
        "proven": result.walked.mean(), "prepare_ms": prepared * 1e3,
        "bytes_a_vertex_p": hierarchy_p.bytes / n, "bytes_a_vertex_q": hierarchy_q.bytes / n,
        **{f"{name}_us": taken * per for name, taken in seconds.items()},
    }  # fmt: skip


def fitted(rows: list[dict]) -> list[str]:
    """rounds = a + b·(log2 n + log2 m) by kind, and how far the farthest size is off the line."""
    lines = []
    for kind in [*dict.fromkeys(r["kind"] for r in rows), "all"]:
        of = [r for r in rows if kind in (r["kind"], "all")]
        if len({r["n"] for r in of}) < 3:
            continue
        x = np.log2([float(r["n"]) for r in of]) + np.log2([float(r["m"]) for r in of])
        for what in ("rounds_mean", "rounds_most", "tests_mean", "tests_most", "tests_a_round", "walk_kernel_us"):
            y = np.array([r[what] for r in of])
            b, a = np.polyfit(x, y, 1)
            above = (y - b * x).max()
            lines.append(
                f"{kind:>12}: {what} = {a:.1f} + {b:.2f}·(log2 n + log2 m), "
                f"all ≤ {above:.1f} + {b:.2f}·(log2 n + log2 m)"
            )
    return lines


def drawn(rows: list[dict], path: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (rounds, tests, times) = pyplot.subplots(1, 3, figsize=(15, 4.2), layout="constrained")
    for kind in dict.fromkeys(r["kind"] for r in rows):
        of = [r for r in rows if r["kind"] == kind]
        n = np.array([r["n"] for r in of])
        line = rounds.plot(n, [r["rounds_most"] for r in of], "o-", label=f"{kind}, most")[0]
        rounds.plot(n, [r["rounds_mean"] for r in of], "o--", color=line.get_color())
        tests.plot(n, [r["tests_a_round"] for r in of], "o-", color=line.get_color(), label=kind)
        times.plot(n, [r["walk_kernel_us"] for r in of], "o-", color=line.get_color(), label=kind)
        times.plot(n, [r["default_us"] for r in of], "o:", color=line.get_color())
    rounds.set(
        title="rounds of a query: most of 1000, and (dashed) mean", xscale="log", xlabel="vertices", ylim=(0, None)
    )
    tests.set(title="tests a round, mean", xscale="log", xlabel="vertices", ylim=(0, None))
    times.set(title="time of a query [µs]: walk, and (dotted) default", xscale="log", yscale="log", xlabel="vertices")
    rounds.legend()
    times.legend()
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of vertices, with commas")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--fits", action="store_true", help="measure nothing; fit, and draw, the rows written before")
    parser.add_argument("--no-csv", action="store_true", help="print only; else sizes not asked for keep their rows")
    parser.add_argument("--plot", metavar="FILE", help="draw rounds and times (needs matplotlib)")
    args = parser.parse_args()
    path = Path(__file__).parent / "results" / "walk.csv"
    rows = {} if args.no_csv else read(path)
    warned = False
    small = body("sphere", 32, 0), body("sphere", 32, 2)
    collide.walk(*small, np.eye(4), np.eye(4))  # what a first call loads is in no row
    for kind in () if args.fits else args.kinds.split(","):
        for n in map(int, args.sizes.split(",")):
            row = measured(kind, n)
            assert row["tests_a_round"] <= MAX_TESTS, f"{kind} {n}: {row['tests_a_round']:.1f} tests a round"
            if not warned:
                print("  ".join(f"{c:>11.11}" for c in row))
                warned = True
            rows[kind, n] = row
            print(
                "  ".join(f"{v:>11,.4g}" if not isinstance(v, (str, int)) else f"{v:>11}" for v in row.values()),
                flush=True,
            )
            if not args.no_csv:
                write(path, rows)
    print("\n".join(["", *fitted(list(rows.values()))]))
    if args.plot:
        drawn(list(rows.values()), args.plot)


def read(path: Path) -> dict[tuple[str, int], dict]:
    """Rows of an earlier run, kept where they are not measured again."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row.setdefault("tests_a_round", float(row["tests_mean"]) / float(row["rounds_mean"]))
        row.setdefault("tests_a_round_most", "")
    return {
        (row["kind"], int(float(row["asked"]))): {k: v if k == "kind" else float(v or "nan") for k, v in row.items()}
        for row in rows
    }


def write(path: Path, rows: dict[tuple[str, int], dict]) -> None:
    ordered = [rows[key] for key in sorted(rows, key=lambda key: (KINDS.index(key[0]), key[1]))]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(ordered[-1]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: as_text(v) for k, v in row.items()} for row in ordered)


def as_text(value) -> str:
    if isinstance(value, str):
        return value
    if np.isnan(value):
        return ""
    return str(int(value)) if value == int(value) else f"{value:.6g}"


if __name__ == "__main__":
    main()
