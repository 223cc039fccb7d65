"""Hierarchical trees in R^d: boundary simplices, nodes, bytes, rounds and shell cones read, beside `polytopes.meets`.

    python benchmarks/hierarchical_trees.py                       # balls of 100 points up to LARGEST, d = 2 to 5
    python benchmarks/hierarchical_trees.py --poses 1000 --sizes 1000 100000 --dimensions 3

Points on a unit sphere against as many half-spaces tangent to one, at random rotations, 0 to 2.2 apart. Each answer
is compared with the exact search over all rows (`certificate=True`), and every tenth certificate is verified. Nodes
are made as poses ask for them: bytes are what these poses needed, not the whole tree.
"""

from __future__ import annotations

import argparse
import csv
import statistics
import time
from pathlib import Path

import numpy as np

from collide import polytopes

LARGEST = {2: 100_000, 3: 10_000, 4: 1000, 5: 100}


def ball(rng, n: int, d: int) -> np.ndarray:
    """Points on a unit sphere."""
    points = rng.normal(size=(n, d))
    return points / np.linalg.norm(points, axis=1)[:, None]


def measured(d: int, n: int, n_poses: int) -> dict:
    """One row."""
    rng = np.random.default_rng([d, n])
    points, normals = ball(rng, n, d), ball(rng, n, d)
    start = time.perf_counter()
    A = polytopes.HierarchicalTree(points)
    B = polytopes.HierarchicalTree(normals=normals, offsets=np.ones(n))
    built = time.perf_counter() - start
    rounds, cones, times, hits, settled = [], [], [], 0, 0
    for k in range(n_poses):
        X = np.eye(d + 1)
        X[:d, :d] = np.linalg.qr(rng.normal(size=(d, d)))[0]
        X[:d, d] = rng.uniform(0.0, 2.2) * ball(rng, 1, d)[0]
        start = time.perf_counter()
        answer = polytopes.trees_meet(A, B, X, certificate=False)
        times.append(time.perf_counter() - start)
        proven = polytopes.trees_meet(A, B, X)  # raises where the exact search says otherwise
        assert proven.hit == answer.hit
        if k % 10 == 0:
            polytopes.verify_trees(points, normals, np.ones(n), proven, X)
        rounds.append(answer.counters["origin_rounds"] + answer.counters["rounds"])
        cones.append(answer.counters["simplices_read"])
        hits, settled = hits + answer.hit, settled + answer.settled
    start = time.perf_counter()
    for _ in range(5):
        polytopes.meets(points @ X[:d, :d].T + X[:d, d], normals, np.ones(n))
    return {
        "d": d, "n": n, "boundary": len(A.tree.facets), "build_s": round(built, 3), "poses": n_poses, "hits": hits,
        "settled": settled, "rounds_mean": round(statistics.mean(rounds), 2), "rounds_most": max(rounds),
        "cones_read_mean": round(statistics.mean(cones), 1), "nodes": A.tree.n_nodes + B.tree.n_nodes,
        "redrawn": A.tree.n_redrawn + B.tree.n_redrawn, "megabytes": round((A.tree.n_bytes + B.tree.n_bytes) / 1e6, 2),
        "median_ms": round(1e3 * statistics.median(times), 2), "mean_ms": round(1e3 * statistics.mean(times), 2),
        "meets_ms": round(200.0 * (time.perf_counter() - start), 2),
    }  # fmt: skip


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dimensions", type=int, nargs="+", default=[2, 3, 4, 5])
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 1000, 10_000, 100_000])
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--csv", type=Path, help="write the rows there")
    args = parser.parse_args()
    rows = []
    for d in args.dimensions:
        for n in (size for size in args.sizes if size <= LARGEST.get(d, 100) or len(args.sizes) == 1):
            rows.append(measured(d, n, args.poses))
            print("  ".join(f"{name}={value}" for name, value in rows[-1].items()), flush=True)
    if args.csv:
        with args.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
