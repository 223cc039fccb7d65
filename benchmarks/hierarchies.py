"""Hierarchies: depth, size, degrees and build times against the number of vertices, with the lines fitted.

    python benchmarks/hierarchies.py
    # some ten minutes to 10^6 vertices; --sizes, --kinds, --which, --no-csv, --plot FILE
    python benchmarks/hierarchies.py --bounds      # depth and size against the bound on the degrees
    python benchmarks/hierarchies.py --distance    # distances down the hierarchies, beside the default

Of every body three hierarchies: Dobkin and Kirkpatrick's ("DK"), with bounded degrees ("BDK"), and with bounded
degrees of its polar ("polar", of which n counts the facets). Depths are exact, so they are fitted: depth = a + b·log2 n
for each kind. ``degree_1`` is the largest degree of the finest level, ``degree_2`` that of the one after it,
``degree`` that of all levels but the finest, ``over`` how many levels but the finest have one above the bound,
``share`` the least part by which a level of 16 vertices or more shrinks where none is cut. A row with more levels over
the bound than `MAY_BE_OVER` names, or a share below a tenth, ends the run with an error.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "hierarchies"))
import hierarchy_families as families

import collide
from collide.hierarchies.hierarchy import DEGREE_BOUND, Hierarchy, build_hierarchy
from collide.hierarchies.hierarchy_distance import hierarchy_distance
from collide.hierarchies.packed_hierarchy import PackedHierarchy
from collide.hierarchies.polar_hull import polar_of_hull
from collide.hull.exact_hull import convex_hull

SIZES = (1_000, 10_000, 100_000, 1_000_000)
#: Polars of prisms with very many sides, turned, have as many vertices crowded at two places: they stop here.
MAX_POLAR = 1_000_000
KINDS: dict[str, Callable[[int], np.ndarray]] = {
    "sphere": families.sphere,
    "degree doubling": lambda n: families.degree_doubling(round(np.log2(n / 3))),
    "bipyramid": families.bipyramid,
    "cone": families.cone,
    "prism": lambda n: families.prism(n // 2),
    "needle": lambda n: families.turned(families.sphere(n) * [1.0, 1e-3, 1e-3]),
    "pancake": lambda n: families.turned(families.sphere(n) * [1.0, 1.0, 1e-3]),
    "moment curve": families.moment_curve,
    "arcs": families.arcs,
    "bipyramid, turned": lambda n: families.turned(families.bipyramid(n, 0.1)),
    "cone, turned": lambda n: families.turned(families.cone(n)),
    "prism, turned": lambda n: families.turned(families.prism(n // 2)),
    "pancake prism, turned": lambda n: families.turned(families.prism(n // 2, 1e-6)),
    "arcs, turned": lambda n: families.turned(families.arcs(n)),
}
#: Hierarchies of a body: plain, with bounded degrees, and that of its polar.
WHICH = ("DK", "BDK", "polar")
#: Levels but the finest that may have a vertex over the bound: two large ones are neighbours in the finest level, and
#: no double lies between them to cut both at once (docs/barba-langerman.md).
MAY_BE_OVER = {("moment curve", "BDK"): 1, ("arcs", "BDK"): 1, ("arcs, turned", "BDK"): 1}


def measured(kind: str, which: str, n: int, hierarchy: Hierarchy, hull_s: float, build_s: float) -> dict:
    degrees = [int(hierarchy.degrees(level).max()) for level in range(hierarchy.depth)]
    sizes = hierarchy.sizes
    bound = hierarchy.degree_bound or 1 << 30
    return {
        "kind": kind, "which": which, "bound": hierarchy.degree_bound, "vertices": n, "n": int(sizes[0]),
        "depth": hierarchy.depth, "total_per_n": sizes.sum() / sizes[0], "largest_per_n": sizes.max() / sizes[0],
        "degree_1": degrees[0], "degree_2": degrees[1] if len(degrees) > 1 else 0,
        "degree": max(degrees[1:], default=0),
        "over": sum(d > bound for d in degrees[1:]), "share": float(families.removed_shares(hierarchy).min()),
        "added": int((hierarchy.birth > 0).sum()),
        "bytes_per_n": sum(a.nbytes for a in hierarchy if isinstance(a, np.ndarray)) / sizes[0],
        "hull_s": hull_s, "build_s": build_s,
    }  # fmt: skip


def check(row: dict) -> None:
    """B3 beyond the finest level, and the size of the independent sets."""
    name = f"{row['which']} of {row['kind']}, {row['n']} vertices"
    allowed = MAY_BE_OVER.get((row["kind"], row["which"]), 0)
    assert row["over"] <= allowed, f"{name}: {row['over']} levels over the bound, the largest degree {row['degree']}"
    assert row["share"] >= 0.1, f"{name}: a level shrinks by {row['share']:.3f} of itself"


def timed(task):
    """(result, seconds of the processor), which do not count what other processes take meanwhile."""
    started = time.process_time()
    result = task()
    return result, time.process_time() - started


def rows_of(kind: str, n: int, bounds: tuple[int, ...], polar: bool) -> list[dict]:
    """Of one body. Bounds: 0 for a plain hierarchy."""
    points = KINDS[kind](n)
    hull, hull_s = timed(lambda: convex_hull(points))
    rows = []
    for bound in bounds:
        hierarchy, build_s = timed(lambda bound=bound: build_hierarchy(points, hull, bound))
        rows.append(measured(kind, "BDK" if bound else "DK", n, hierarchy, hull_s, build_s))
    if polar and n <= MAX_POLAR:
        body, build_s = timed(lambda: polar_of_hull(points, hull))
        rows.append(measured(kind, "polar", n, body.hierarchy, hull_s, build_s))
    return rows


def distance_row(kind: str, n: int, bound: int, count: int = 200) -> dict:
    """Two bodies of n vertices, balls a tenth of their size apart: exact counts, and µs a query in one Python loop.

    The default takes all poses in one call.
    """
    points = KINDS[kind](n)
    reach = 1.1 * np.sqrt(np.square(points).sum(axis=1)).max()
    body = PackedHierarchy(build_hierarchy(points, convex_hull(points), bound))
    rng = np.random.default_rng(5)
    rotations = np.stack([rotation_of(q) for q in rng.normal(size=(count, 4))])
    directions = rng.normal(size=(count, 3))
    shifts = 2 * reach * directions / np.sqrt(np.square(directions).sum(axis=1))[:, None]
    X_WB = np.tile(np.eye(4), (count, 1, 1))
    X_WB[:, :3, :3], X_WB[:, :3, 3] = rotations, shifts
    X_WA = np.tile(np.eye(4), (count, 1, 1))
    shape = collide.ConvexHull(points)
    best, best_default = np.inf, np.inf
    for _ in range(4):
        results, seconds = timed(lambda: [hierarchy_distance(body, body, r, s) for r, s in zip(rotations, shifts)])
        default, default_s = timed(lambda: collide.distance(shape, shape, X_WA, X_WB))
        best, best_default = min(best, seconds), min(best_default, default_s)
    apart = np.array([f.distance for f in results])
    assert np.abs(apart - default.distance).max() < 1e-12
    levels_a, levels_b, problems, looked_at = np.mean([f.counters for f in results], axis=0)
    return {
        "kind": kind, "n": len(points), "bound": bound, "depth": body.hierarchy.depth,
        "levels_a": levels_a, "levels_b": levels_b, "problems": problems, "looked_at": looked_at,
        "us": best / count * 1e6, "default_us": best_default / count * 1e6,
    }  # fmt: skip


def rotation_of(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q / np.sqrt(np.square(q).sum())
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def line(rows: list[dict]) -> tuple[float, float, float]:
    """(a, b, farthest off): depth = a + b·log2 n."""
    x = np.log2([r["n"] for r in rows])
    y = np.array([r["depth"] for r in rows])
    b, a = np.polyfit(x, y, 1)
    return a, b, float(np.abs(y - (a + b * x)).max())


def fitted(rows: list[dict]) -> list[str]:
    lines = []
    for which in ("DK", "BDK", "polar"):
        for kind in [*dict.fromkeys(r["kind"] for r in rows), ""]:
            of = [r for r in rows if r["which"] == which and r["kind"] in (kind or r["kind"])]
            if len({r["n"] for r in of}) >= 3:
                a, b, off = line(of)
                lines.append(
                    f"{which:>5} {kind or 'all':<16} depth = {a:5.1f} + {b:.2f}·log2 n, at most {off:.1f} off the line"
                )
    return lines


def drawn(rows: list[dict], path: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(15, 4.4), layout="constrained")
    for kind in dict.fromkeys(r["kind"] for r in rows):
        colour = None
        for which, style in (("BDK", "o-"), ("DK", "s:"), ("polar", "^--")):
            of = [r for r in rows if r["kind"] == kind and r["which"] == which]
            n = [r["n"] for r in of]
            label = kind if which == "BDK" else None
            for axis, field in zip(axes, ("depth", "degree", "build_s")):
                (drawing,) = axis.plot(n, [r[field] for r in of], style, color=colour, label=label, markersize=4)
                colour = drawing.get_color()
    axes[0].set(
        title="levels: bounded (—), DK (···), of the polar (– –)", xscale="log", xlabel="vertices", ylim=(0, None)
    )
    axes[1].set(title="largest degree but for the finest level", xscale="log", yscale="log", xlabel="vertices")
    axes[1].axhline(DEGREE_BOUND, color="k", linewidth=0.7)
    axes[2].set(title="time to build [s]", xscale="log", yscale="log", xlabel="vertices")
    axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=130)


def show(rows: list[dict], row: dict) -> None:
    """Print a row, the columns' names before the first, and keep it."""
    if not rows:
        print("  ".join(f"{c:>15}" for c in row))
    rows.append(row)
    print("  ".join(f"{v:>15,.4g}" if isinstance(v, float) else f"{v:>15}" for v in row.values()), flush=True)


def write(rows: list[dict], name: str, args) -> None:
    """Rows of an earlier run are kept where they were not measured again."""
    if args.no_csv:
        return
    path = Path(__file__).parent / "results" / name
    if name == "hierarchies.csv" and path.exists():
        known = {(r["kind"], r["which"], int(r["vertices"])): r for r in rows}
        with path.open(newline="") as file:
            earlier = {(r["kind"], r["which"], int(r["vertices"])): r for r in csv.DictReader(file)}
        ordered = sorted({**earlier, **known}, key=lambda k: (list(KINDS).index(k[0]), k[2], WHICH.index(k[1])))
        rows = [{column: {**earlier, **known}[key].get(column, "") for column in rows[0]} for key in ordered]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of vertices, with commas")
    parser.add_argument("--kinds", default=";".join(KINDS), help="bodies, with semicolons")
    parser.add_argument("--which", default=",".join(WHICH), help="hierarchies, with commas")
    parser.add_argument("--bounds", action="store_true", help="compare bounds on the degrees, at the first two sizes")
    parser.add_argument("--no-csv", action="store_true", help="print only")
    parser.add_argument("--plot", metavar="FILE", help="draw depth, degrees and times (needs matplotlib)")
    parser.add_argument("--distance", action="store_true", help="distances down the hierarchies")
    args = parser.parse_args()
    sizes = list(map(int, args.sizes.split(",")))
    which = args.which.split(",")
    bounds = (12, 16, 24, 32, 48, 64) if args.bounds else tuple(
        bound for name, bound in (("DK", 0), ("BDK", DEGREE_BOUND)) if name in which
    )  # fmt: skip
    for warm in ("bipyramid", "prism"):  # compile
        rows_of(warm, 200, (0, 12), True)
    rows: list[dict] = []
    if args.distance:
        for n in (256, 1024, 4096, 16384, 65536):
            show(rows, distance_row("sphere", n, DEGREE_BOUND))
        b, a = np.polyfit([np.log2(r["n"]) ** 2 for r in rows], [r["levels_b"] for r in rows], 1)
        for bound in (0, DEGREE_BOUND):  # the text's own example, without the bound and with it
            show(rows, distance_row("degree doubling", 100_000, bound, 50))
        print(f"levels gone down = {a:.1f} + {b:.2f}·(log2 n)²")
        write(rows, "hierarchies-distance.csv", args)
        return
    for kind in args.kinds.split(";"):
        for n in sizes[:2] if args.bounds else sizes:
            for row in rows_of(kind, n, bounds, not args.bounds and "polar" in which):
                show(rows, row)
                if not args.bounds and row["bound"]:
                    check(row)
    if not args.bounds:
        print("\n".join(["", *fitted(rows)]))
    write(rows, "hierarchies-bounds.csv" if args.bounds else "hierarchies.csv", args)
    if args.plot:
        drawn(rows, args.plot)


if __name__ == "__main__":
    main()
