"""Hierarchical trees in R^d: whole trees and their predicted sizes, poses beside the exact search, the walk in space.

    python benchmarks/hierarchical_trees.py sizes --plot docs/pictures/hierarchical-trees-bytes.png
    python benchmarks/hierarchical_trees.py poses --plot docs/pictures/hierarchical-trees-rounds.png
    python benchmarks/hierarchical_trees.py poses --add --count 10000 --families ball --dimensions 2 --sizes 1000
    python benchmarks/hierarchical_trees.py walk

Families: points on a unit sphere (``ball``), on the moment curve (``curve``), integers within a ball (``lattice``).
``sizes`` builds whole trees, predicts them first, and fits depth and bytes; what is predicted to take more than
--memory is a row with the prediction alone. ``poses`` asks about n points against as many half-spaces tangent to a
sphere, at random rotations near touching; every answer is compared with `polytopes.meets` and, where they differ, with
``certificate=True``, the exact search over all rows. ``walk`` asks `collide.walk` about the same bodies in space. Rows
go to ``benchmarks/results/hierarchical-trees-<part>.csv``.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import statistics
import time
from pathlib import Path

import numpy as np

import collide
from collide import polytopes
from collide.errors import UnsupportedQuery
from collide.polytopes.facet_tree import Sizes

RESULTS = Path(__file__).parent / "results"
#: Points of the trees that are built whole; the last is what is asked for.
SIZES = {
    2: (1000, 10_000, 100_000, 1_000_000), 3: (3000, 10_000, 30_000, 100_000), 4: (3000, 5000, 10_000), 5: (1700, 2000),
}  # fmt: skip
#: Points of the bodies that are posed, with nets of at most 24 simplices and leaves of at most 48 corners.
SIZES_ASKED = {2: (100, 1000, 10_000, 100_000), 3: (100, 1000, 10_000), 4: (100, 300, 1000), 5: (60, 120, 240)}
SMALL = Sizes(0.5, 24, 48)


def ball(n: int, d: int, seed: int = 0) -> np.ndarray:
    """Points on a unit sphere."""
    points = np.random.default_rng([n, d, seed]).normal(size=(n, d))
    return points / np.linalg.norm(points, axis=1)[:, None]


def curve(n: int, d: int) -> np.ndarray:
    """Points (t, t², …) of the moment curve, -1 ≤ t ≤ 1."""
    t = np.linspace(-1.0, 1.0, n)
    return np.stack([t**k for k in range(1, d + 1)], axis=1)


def lattice(n: int, d: int) -> np.ndarray:
    """The n integers nearest to the origin, scaled to a ball of radius about 1."""
    k = int(np.ceil(n ** (1.0 / d))) // 2 + 2
    k = k if d < 3 else int(1.4 * k)
    grid = np.array(np.meshgrid(*[np.arange(-k, k + 1.0)] * d)).reshape(d, -1).T
    nearest = grid[np.argsort((grid * grid).sum(axis=1), kind="stable")[:n]]
    return nearest / 2.0 ** np.round(np.log2(np.abs(nearest).max()))


FAMILIES = {"ball": ball, "curve": curve, "lattice": lattice}


def fitted(x, y) -> tuple[float, float, float]:
    """(intercept, slope, largest deviation) of y over x by least squares."""
    slope, intercept = np.polyfit(x, y, 1)
    return float(intercept), float(slope), float(np.abs(intercept + slope * np.asarray(x) - y).max())


# --- whole trees ------------------------------------------------------------------------------------------------------


def whole_tree(family: str, d: int, n: int, memory: int) -> dict:
    """A row: predicted, built."""
    row = {"family": family, "d": d, "n": n}
    start = time.process_time()
    try:
        body = polytopes.HierarchicalTree(FAMILIES[family](n, d), whole=True, memory=memory)
    except UnsupportedQuery as refused:
        return row | {"refused": str(refused).split("HierarchicalTree: ")[1].split(", more")[0]}
    predicted, size = body.predicted, body.size
    return row | {
        "cpu_s": round(time.process_time() - start, 2), "simplices": size.simplices,
        "simplices_predicted": predicted.simplices, "nodes": size.nodes, "nodes_predicted": predicted.nodes,
        "depth": size.depth, "depth_predicted": predicted.depth, "bytes": size.n_bytes,
        "bytes_predicted": predicted.n_bytes, "redrawn": body.tree.n_redrawn, "refused": "",
    }  # fmt: skip


def fit_sizes(rows: list[dict]) -> None:
    """Print depth = a + b log n, bytes ~ n^c."""
    for (family, d), group in itertools.groupby(rows, key=lambda row: (row["family"], row["d"])):
        built = [row for row in group if not row["refused"]]
        if len(built) >= 2:
            log_n = np.log([row["n"] for row in built])
            a, b, off = fitted(log_n, [row["depth"] for row in built])
            c = fitted(log_n, np.log([row["bytes"] for row in built]))[1]
            f = fitted(log_n, np.log([row["simplices"] or 1 for row in built]))[1]
            print(f"{family} d={d}: depth {a:.2f} + {b:.2f} log n, off {off:.2f}; bytes n^{c:.2f}; simplices n^{f:.2f}")


def plot_sizes(rows: list[dict], path: Path) -> None:
    """Bytes, built and predicted, over points."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), sharey=True)
    for axis, family in zip(axes, FAMILIES):
        for d in (2, 3, 4, 5):
            built = [row for row in rows if row["family"] == family and row["d"] == d and not row["refused"]]
            if built:
                n = [row["n"] for row in built]
                (line,) = axis.loglog(n, [row["bytes"] for row in built], "o-", label=f"d = {d}")
                axis.loglog(n, [row["bytes_predicted"] for row in built], "x--", color=line.get_color())
        axis.set_title(f"{family}: built ●, predicted ×")
        axis.set_xlabel("points")
        axis.grid(alpha=0.3)
        axis.legend()
    axes[0].set_ylabel("bytes of the whole tree")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


# --- poses ------------------------------------------------------------------------------------------------------------


def near_pose(rng, points: np.ndarray, d: int) -> np.ndarray:
    """A random rotation, and a translation that leaves the farthest point some 0 to 2.2 from the origin's ball."""
    X = np.eye(d + 1)
    X[:d, :d] = np.linalg.qr(rng.normal(size=(d, d)))[0]
    direction = rng.normal(size=d)
    direction /= np.linalg.norm(direction)
    moved = points @ X[:d, :d].T
    X[:d, d] = direction * (rng.uniform(0.4, 1.6) - float((moved @ direction).min()))
    return X


def asked_about(family: str, d: int, n: int, count: int, limits: Sizes | None) -> dict:
    """A row: answers against the judge, rounds, cones."""
    rng = np.random.default_rng([d, n])
    points, normals, offsets = FAMILIES[family](n, d), ball(n, d, 1), np.ones(n)
    A = polytopes.HierarchicalTree(points, limits=limits)
    B = polytopes.HierarchicalTree(normals=normals, offsets=offsets, limits=limits)
    rounds, cones, planes, times, judged, hits, settled, wrong = [], [], [0], [], [], 0, 0, 0
    for _ in range(count):
        X = near_pose(rng, points, d)
        start = time.process_time()
        answer = polytopes.trees_meet(A, B, X, certificate=False)
        middle = time.process_time()
        truth = polytopes.meets(points @ X[:d, :d].T + X[:d, d], normals, offsets)
        times.append(middle - start)
        judged.append(time.process_time() - middle)
        if truth.hit != answer.hit:  # rounded points may differ where they touch: the exact search has the last word
            wrong += polytopes.trees_meet(A, B, X).hit != answer.hit
        rounds.append(answer.counters["origin_rounds"] + answer.counters["rounds"])
        cones.append(answer.counters["simplices_read"])
        if answer.exclusion is not None:
            planes.append(len(answer.exclusion.planes) + len(answer.exclusion.ray_planes))
        hits, settled = hits + answer.hit, settled + answer.settled
    return {
        "family": family, "d": d, "n": n, "poses": count, "hits": hits, "wrong": wrong, "settled": settled,
        "rounds_mean": round(statistics.mean(rounds), 2), "rounds_most": max(rounds), "planes_most": max(planes),
        "cones_read_mean": round(statistics.mean(cones), 1), "cones_read_most": max(cones),
        "nodes": A.tree.n_nodes + B.tree.n_nodes, "depth": max(A.size.depth, B.size.depth),
        "redrawn": A.tree.n_redrawn + B.tree.n_redrawn,
        "megabytes": round((A.tree.n_bytes + B.tree.n_bytes) / 1e6, 2),
        "median_ms": round(1e3 * statistics.median(times), 2), "meets_ms": round(1e3 * statistics.median(judged), 2),
    }  # fmt: skip


def fit_poses(rows: list[dict]) -> None:
    """Print depth, rounds and cones over log n + log m."""
    for (family, d), group in itertools.groupby(rows, key=lambda row: (row["family"], row["d"])):
        sizes = list(group)
        if len(sizes) >= 2:
            log_nm = [2.0 * np.log(row["n"]) for row in sizes]
            for name in ("depth", "rounds_mean", "cones_read_mean"):
                a, b, off = fitted(log_nm, [row[name] for row in sizes])
                print(f"{family} d={d}: {name} {a:.2f} + {b:.2f} (log n + log m), off by at most {off:.2f}")


def plot_poses(rows: list[dict], path: Path) -> None:
    """Rounds over log n + log m."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6))
    for axis, name in zip(axes, ("rounds_mean", "cones_read_mean")):
        for family, d in dict.fromkeys((row["family"], row["d"]) for row in rows):
            group = [row for row in rows if row["family"] == family and row["d"] == d]
            style = {"ball": "o-", "curve": "^--", "lattice": "s:"}[family]
            log_nm, counts = [2 * np.log(row["n"]) for row in group], [row[name] or np.nan for row in group]
            axis.plot(log_nm, counts, style, color=f"C{d - 2}", label=f"{family}, d = {d}")
        axis.set_xlabel("log n + log m")
        axis.set_title(name.replace("_", " "))
        axis.grid(alpha=0.3)
    axes[1].set_yscale("log")
    axes[1].legend(fontsize=6)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


# --- beside the walk --------------------------------------------------------------------------------------------------


def beside_walk(n: int, count: int) -> dict:
    """A row: trees and the walk of section 5 on the same bodies and poses, d = 3."""
    rng = np.random.default_rng([3, n])
    points, corners = ball(n, 3), ball(n, 3, 1)
    hull_a, hull_b = collide.ConvexHull(points), collide.ConvexHull(corners)
    A = polytopes.HierarchicalTree(points, limits=SMALL)
    planes = _planes_of(corners)
    B = polytopes.HierarchicalTree(normals=planes[:, :3], offsets=planes[:, 3], limits=SMALL)
    rows, hits, unlike = [], 0, 0
    poses = [near_pose(rng, points, 3) for _ in range(count)]
    for X in poses:  # once unmeasured: trees make the nodes that they need, the walk its hierarchies
        polytopes.trees_meet(A, B, X, certificate=False)
    collide.walk(hull_a, hull_b, poses[0], np.eye(4))
    for X in poses:
        start = time.process_time()
        tree = polytopes.trees_meet(A, B, X, certificate=False)
        middle = time.process_time()
        walk = collide.walk(hull_a, hull_b, X, np.eye(4))
        end = time.process_time()
        hits, unlike = hits + tree.hit, unlike + (bool(walk.hit[0]) != tree.hit)
        rows.append((
            tree.counters["origin_rounds"] + tree.counters["rounds"], tree.counters["simplices_read"],
            tree.counters["net_rows"], middle - start,
            int(walk.rows["rounds"][0]), int(walk.rows["tests"][0]), end - middle,
        ))  # fmt: skip
    names = (
        "tree_rounds", "tree_cones", "tree_rows", "tree_ms", "walk_rounds", "walk_tests", "walk_ms"
    )  # fmt: skip
    means = np.mean(rows, axis=0) * [1, 1, 1, 1e3, 1, 1, 1e3]
    return {"n": n, "poses": count, "hits": hits, "unlike": unlike} | dict(zip(names, means.round(3).tolist()))


def _planes_of(corners: np.ndarray) -> np.ndarray:
    """Half-spaces of a hull around the origin: corners p become facets, a·x ≤ 1 through three each, rounded."""
    from collide.hull.exact_hull import convex_hull

    facets = np.asarray(convex_hull(corners).facets)
    normals = np.linalg.solve(corners[facets], np.ones((len(facets), 3, 1)))[:, :, 0]
    return np.column_stack((normals, np.ones(len(normals))))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=["sizes", "poses", "walk"])
    parser.add_argument("--families", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
    parser.add_argument("--dimensions", type=int, nargs="+", default=[2, 3, 4, 5])
    parser.add_argument("--sizes", type=int, nargs="+", help="points, in place of those of the part")
    parser.add_argument("--count", type=int, default=200, help="poses a body")
    parser.add_argument("--memory", type=int, default=1 << 30, help="bytes that a tree may take")
    parser.add_argument("--large", action="store_true", help="poses: nets and leaves as by default, not small ones")
    parser.add_argument("--add", action="store_true", help="keep the rows that the CSV has")
    parser.add_argument("--plot", type=Path, help="where a picture is to go")
    args = parser.parse_args()
    path = RESULTS / f"hierarchical-trees-{args.part}.csv"
    rows = read_rows(path) if args.add and path.exists() else []
    cases = [(family, d) for family in args.families for d in args.dimensions]
    if args.part == "walk":
        cases = [("ball", 3)]
    for family, d in cases:
        for n in args.sizes or (SIZES if args.part == "sizes" else SIZES_ASKED)[d]:
            if args.part == "sizes":
                row = whole_tree(family, d, n, args.memory)
            elif args.part == "poses":
                row = asked_about(family, d, n, args.count, None if args.large else SMALL)
            else:
                row = beside_walk(n, args.count)
            keys = [name for name in ("family", "d", "n") if name in row]
            rows = [old for old in rows if any(old[name] != row[name] for name in keys)]
            rows.append(row)
            print("  ".join(f"{name}={value}" for name, value in row.items()), flush=True)
            write_rows(path, rows)
    rows.sort(key=lambda row: (str(row.get("family")), row.get("d", 3), row["n"]))
    write_rows(path, rows)
    if args.part != "walk":
        (fit_sizes if args.part == "sizes" else fit_poses)(rows)
    if args.plot:
        {"sizes": plot_sizes, "poses": plot_poses}[args.part](rows, args.plot)


def write_rows(path: Path, rows: list[dict]) -> None:
    """All rows; a name that a row lacks is empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(rows)


def read_rows(path: Path) -> list[dict]:
    """The rows of a CSV, numbers as numbers."""
    with path.open(newline="") as file:
        return [{name: _number(text) for name, text in row.items()} for row in csv.DictReader(file)]


def _number(text: str):
    try:
        return int(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return text


if __name__ == "__main__":
    main()
