"""Support queries: time, operations and memory against the number of vertices, with the lines fitted.

    python benchmarks/supports.py                # about a minute; --sizes, --no-csv, --plot FILE

For hulls of 8 to 131,072 vertices of several kinds: building the exact hull and the support tree, bytes a
vertex, ns a query by a scan, by the tree, and settled exactly; vertices looked at, steps climbed and exact
signs a query. Counts are exact, so they are fitted: looked at = a + b·log2 n for each kind. Directions are
random, and facet normals, where several vertices tie. Every settled answer is compared with brute force.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from convex_shapes import STRETCH, prism

from collide.hull.exact_hull import convex_hull
from collide.kernels import address_of, entry, view_f64, view_i64
from collide.lowering.packed_convex import pack_points
from collide.numerics.vec3 import vec3_at
from collide.support.build_support_tree import build_support_tree
from collide.support.support_mapping import support_vertex
from collide.support.support_tree_query import COUNTERS, extreme_vertices

SIZES = (512, 2048, 8192, 32768, 131072)
#: Bipyramids have two vertices with all others as neighbours, prisms two faces with half of them.
KINDS = ("sphere", "ellipsoid", "pancake", "cylinder", "bipyramid")
DIRECTIONS = 4000


def cloud(kind: str, n: int) -> np.ndarray:
    """n points in convex position; of a bipyramid all but two have four neighbours, and two have n − 2."""
    if kind == "cylinder":
        return prism(n // 2)
    if kind == "bipyramid":
        angle = np.arange(n - 2) * (2 * np.pi / (n - 2))
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n - 2)])
        return np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]])
    points = np.random.default_rng(n).normal(size=(n, 3))
    return points / np.sqrt(np.square(points).sum(axis=1))[:, None] * STRETCH[kind]


def least(task, repeats: int = 5) -> float:
    """Seconds of the fastest of several runs."""
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        task()
        taken.append(time.perf_counter() - started)
    return min(taken)


def measured(kind: str, n: int) -> dict:
    points = cloud(kind, n)
    hull = convex_hull(points)

    def build():
        return build_support_tree(points, hull.vertices, hull.facets, lambda subset: convex_hull(subset).facets)

    tree = build()
    random = np.random.default_rng(1)
    corners = points[hull.facets[random.integers(0, len(hull.facets), DIRECTIONS // 4)]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    directions = np.concatenate([random.normal(size=(3 * DIRECTIONS // 4, 3)), normals])
    counters = np.zeros(COUNTERS, dtype=np.int64)
    vertices = extreme_vertices(tree, directions, True, counters)
    checked = slice(None, None, max(1, len(directions) * n // 40_000_000))
    best = (points @ directions[checked].T).max(axis=0)
    mine = (points[vertices[checked]] * directions[checked]).sum(axis=1)
    assert (mine >= best - 1e-14 * np.abs(directions[checked]).sum(axis=1)).all(), "a settled vertex is not farthest"
    scanned, steps, looked_at, signs = counters / len(directions)
    per = 1e9 / len(directions)
    packed = pack_points(points)
    sample = directions[: max(20, 20_000_000 // n)]
    return {
        "kind": kind, "n": n, "hull_ms": least(lambda: convex_hull(points), 3) * 1e3, "tree_ms": least(build, 3) * 1e3,
        "bytes_a_vertex": tree.nbytes / n, "longest_list": int(np.diff(tree.nodes).max()),
        "tree_ns": least(lambda: extreme_vertices(tree, directions, False)) * per,
        "settled_ns": least(lambda: extreme_vertices(tree, directions, True)) * per,
        "scan_ns": least(lambda: scan_all(packed, sample), 3) / len(sample) * 1e9,
        "scanned": scanned, "looked_at": looked_at, "steps": steps, "exact_signs": signs,
    }  # fmt: skip


def _scan(coordinates_at, n, m, directions_at, count, ids_at):
    coordinates = view_f64(coordinates_at, 3 * m)
    g = view_f64(directions_at, 3 * count)
    ids = view_i64(ids_at, count)
    for k in range(count):
        ids[k] = support_vertex(coordinates, m, vec3_at(g, 3 * k))


scan = entry("void(int64, int64, int64, int64, int64, int64)")(_scan)


def scan_all(packed, directions: np.ndarray) -> None:
    """A scan over all points for each direction."""
    ids = np.empty(len(directions), dtype=np.int64)
    scan(
        address_of(packed.coordinates), len(packed.points), packed.coordinates.shape[1], address_of(directions),
        len(directions), address_of(ids),
    )  # fmt: skip


def fitted(rows: list[dict]) -> list[str]:
    lines = []
    for kind in dict.fromkeys(r["kind"] for r in rows):
        of = [r for r in rows if r["kind"] == kind]
        if len(of) < 3:
            continue
        x = np.log2([r["n"] for r in of])
        y = np.array([r["scanned"] + r["looked_at"] for r in of])
        b, a = np.polyfit(x, y, 1)
        off = np.abs(y - (a + b * x)).max()
        lines.append(f"{kind}: vertices looked at = {a:.1f} + {b:.2f}·log2 n, at most {off:.1f} off the line")
    return lines


def drawn(rows: list[dict], path: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (counts, times) = pyplot.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for kind in dict.fromkeys(r["kind"] for r in rows):
        of = [r for r in rows if r["kind"] == kind]
        n = [r["n"] for r in of]
        counts.plot(n, [r["scanned"] + r["looked_at"] for r in of], "o-", label=kind)
        line = times.plot(n, [r["tree_ns"] for r in of], "o--")[0]
        times.plot(n, [r["settled_ns"] for r in of], "o-", color=line.get_color(), label=kind)
    times.plot(n, [r["scan_ns"] for r in of], "k:", label="scan")
    counts.set(title="vertices looked at in a settled query", xscale="log", xlabel="vertices", ylim=(0, None))
    times.set(title="time [ns]: settled, and (dashed) not", xscale="log", yscale="log", xlabel="vertices")
    counts.legend()
    times.legend()
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of vertices, with commas")
    parser.add_argument("--no-csv", action="store_true", help="print only")
    parser.add_argument("--plot", metavar="FILE", help="draw counts and times (needs matplotlib)")
    args = parser.parse_args()
    rows = []
    columns = None
    for kind in KINDS:
        for n in map(int, args.sizes.split(",")):
            row = measured(kind, n)
            rows.append(row)
            if columns is None:
                columns = list(row)
                print("  ".join(f"{c:>14}" for c in columns))
            print(
                "  ".join(f"{v:>14,.4g}" if not isinstance(v, (str, int)) else f"{v:>14}" for v in row.values()),
                flush=True,
            )
    print("\n".join(["", *fitted(rows)]))
    if not args.no_csv:
        path = Path(__file__).parent / "results" / "supports.csv"
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, columns or [], lineterminator="\n")
            writer.writeheader()
            writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    if args.plot:
        drawn(rows, args.plot)


if __name__ == "__main__":
    main()
