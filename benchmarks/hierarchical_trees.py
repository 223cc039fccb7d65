"""Hierarchical trees in R^d: whole trees and their predicted sizes, poses beside the exact search, the walk in space.

    python benchmarks/hierarchical_trees.py --table sizes --plot docs/pictures/hierarchical-trees-bytes.png
    python benchmarks/hierarchical_trees.py --table poses --plot docs/pictures/hierarchical-trees-rounds.png
    python benchmarks/hierarchical_trees.py --table poses --count 10000 --only family=ball --only d=2 --only n=1000
    python benchmarks/hierarchical_trees.py --table walk

Families: points on a unit sphere ("ball"), on the moment curve ("curve"), integers within a ball ("lattice"). "sizes"
builds whole trees, predicts them first, and fits depth and bytes; what is predicted to take more than --memory is a row
with the prediction alone. "poses" asks about n points against as many half-spaces tangent to a sphere, at random
rotations near touching; every answer is compared with `polytopes.meets` and, where they differ, with
``certificate=True``, the exact search over all rows. "walk" asks `collide.walk` about the same bodies in space.
"""

from __future__ import annotations

import time

import numpy as np
from inputs import ball

import collide
from collide import polytopes
from collide.adapters.bench.claims import Claim, Options, Race, main
from collide.adapters.bench.growth import Panel, groups, log2_lines, power_of
from collide.errors import UnsupportedQuery
from collide.hull.exact_hull import convex_hull
from collide.papers.polytopes.facet_tree import Sizes

#: Points of the trees that are built whole; the last is what is asked for.
SIZES = {
    2: (1000, 10_000, 100_000, 1_000_000), 3: (3000, 10_000, 30_000, 100_000), 4: (3000, 5000, 10_000), 5: (1700, 2000),
}
#: Points of the bodies that are posed, with nets of at most 24 simplices and leaves of at most 48 corners.
SIZES_ASKED = {2: (100, 1000, 10_000, 100_000), 3: (100, 1000, 10_000), 4: (100, 300, 1000), 5: (60, 120, 240)}
SMALL = Sizes(0.5, 24, 48)


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


FAMILIES = {"ball": lambda n, d: ball(n, 0, d), "curve": curve, "lattice": lattice}


def whole_tree(options: Options, family: str, d: int, n: int) -> list[dict]:
    """Predicted, built."""
    start = time.process_time()
    try:
        body = polytopes.HierarchicalTree(FAMILIES[family](n, d), whole=True, memory=options.memory)
    except UnsupportedQuery as refused:
        return [{"refused": str(refused).split("HierarchicalTree: ")[1].split(", more")[0]}]
    row: dict = {"refused": "", "cpu_s": time.process_time() - start, "redrawn": body.tree.n_redrawn}
    for name in ("simplices", "nodes", "depth", "n_bytes"):
        row[name.removeprefix("n_")] = getattr(body.size, name)
        row[f"{name.removeprefix('n_')}_predicted"] = getattr(body.predicted, name)
    return [row]


def size_notes(rows: list[dict]):
    """depth = a + b log2 n, bytes ~ n^c."""
    built = [row for row in rows if not row["refused"]]
    yield from log2_lines(built, ("family", "d"), ("depth",), least=2)
    for (family, d), some in groups(built, "family", "d"):
        if len(some) > 1:
            n, sizes = [row["n"] for row in some], [row["bytes"] for row in some]
            simplices = power_of(n, [row["simplices"] or 1 for row in some])
            yield f"{family} {d}: bytes n^{power_of(n, sizes):.2f}; simplices n^{simplices:.2f}"


def near_pose(rng, points: np.ndarray, d: int) -> np.ndarray:
    """A random rotation, and a translation that leaves the farthest point some 0 to 2.2 from the origin's ball."""
    X = np.eye(d + 1)
    X[:d, :d] = np.linalg.qr(rng.normal(size=(d, d)))[0]
    direction = rng.normal(size=d)
    direction /= np.linalg.norm(direction)
    moved = points @ X[:d, :d].T
    X[:d, d] = direction * (rng.uniform(0.4, 1.6) - float((moved @ direction).min()))
    return X


def poses(options: Options, family: str, d: int, n: int) -> list[dict]:
    """Answers against the judge, rounds, cones."""
    rng, limits = np.random.default_rng([d, n]), None if options.large else SMALL
    points, normals, offsets = FAMILIES[family](n, d), ball(n, 1, d), np.ones(n)
    A = polytopes.HierarchicalTree(points, limits=limits)
    B = polytopes.HierarchicalTree(normals=normals, offsets=offsets, limits=limits)
    rounds, cones, planes, times, judged, hits, settled, wrong = [], [], [0], [], [], 0, 0, 0
    for _ in range(20 if options.quick else options.count):
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
    return [{
        "poses": len(times), "hits": hits, "wrong": wrong, "settled": settled, "nm": n * n,
        "rounds_mean": float(np.mean(rounds)), "rounds_most": max(rounds), "planes_most": max(planes),
        "cones_read_mean": float(np.mean(cones)), "cones_read_most": max(cones),
        "nodes": A.tree.n_nodes + B.tree.n_nodes, "depth": max(A.size.depth, B.size.depth),
        "redrawn": A.tree.n_redrawn + B.tree.n_redrawn, "megabytes": (A.tree.n_bytes + B.tree.n_bytes) / 1e6,
        "median_ms": 1e3 * float(np.median(times)), "meets_ms": 1e3 * float(np.median(judged)),
    }]


def pose_notes(rows: list[dict]):
    figures = ("depth", "rounds_mean", "cones_read_mean")
    return log2_lines(rows, ("family", "d"), figures, "nm", "(log2 n + log2 m)", least=2)


def beside_walk(options: Options, n: int) -> Race:
    """Trees and the walk of section 5 on the same bodies and poses, d = 3; ms a pose."""
    rng, points, corners = np.random.default_rng([3, n]), ball(n), ball(n, 1)
    hulls, facets = (collide.ConvexHull(points), collide.ConvexHull(corners)), np.asarray(convex_hull(corners).facets)
    # Half-spaces of a hull around the origin: a·x ≤ 1 through three corners each, rounded.
    normals = np.linalg.solve(corners[facets], np.ones((len(facets), 3, 1)))[:, :, 0]
    A = polytopes.HierarchicalTree(points, limits=SMALL)
    B = polytopes.HierarchicalTree(normals=normals, offsets=np.ones(len(normals)), limits=SMALL)
    asked = [near_pose(rng, points, 3) for _ in range(20 if options.quick else options.count)]
    trees = [polytopes.trees_meet(A, B, X, certificate=False) for X in asked]
    walks = [collide.walk(*hulls, X, np.eye(4)) for X in asked]
    means = {
        "tree_rounds": [t.counters["origin_rounds"] + t.counters["rounds"] for t in trees],
        "tree_cones": [t.counters["simplices_read"] for t in trees],
        "tree_rows": [t.counters["net_rows"] for t in trees], "walk_rounds": [w.rows["rounds"][0] for w in walks],
        "walk_tests": [w.rows["tests"][0] for w in walks],
    }
    columns = {"poses": len(asked), "hits": sum(t.hit for t in trees),
               "unlike": sum(bool(w.hit[0]) != t.hit for t, w in zip(trees, walks))}
    return Race({
        "tree": lambda: [polytopes.trees_meet(A, B, X, certificate=False) for X in asked],
        "walk": lambda: [collide.walk(*hulls, X, np.eye(4)) for X in asked],
    }, len(asked), columns | {name: float(np.mean(some)) for name, some in means.items()})


def cases(sizes: dict):
    return lambda options: (
        {"family": family, "d": d, "n": n}
        for family in FAMILIES for d in sizes for n in sizes[d][: 1 if options.quick else None]
    )




def arguments(parser) -> None:
    parser.add_argument("--count", type=int, default=200, help="poses a body")
    parser.add_argument("--memory", type=int, default=1 << 30, help="bytes that a tree may take")
    parser.add_argument("--large", action="store_true", help="poses: nets and leaves as by default, not small ones")


CLAIMS = [
    Claim("sizes", "whole trees", cases(SIZES), whole_tree, file="hierarchical-trees-sizes", everywhere=True,
          notes=size_notes, panels=tuple(
              Panel(f"{name}: bytes built, and (dashed) predicted", "n", "bytes", "d", "xy",
                    lambda row, name=name: row["family"] == name and not row["refused"], "bytes_predicted")
              for name in FAMILIES)),
    Claim("poses", "poses near touching", cases(SIZES_ASKED), poses, file="hierarchical-trees-poses", everywhere=True,
          notes=pose_notes, panels=tuple(
              Panel(f"{name}: rounds, and (dashed) cones read, over n m", "nm", "rounds_mean", "d", "xy",
                    lambda row, name=name: row["family"] == name, "cones_read_mean") for name in FAMILIES)),
    Claim("walk", "ms a pose beside the walk", lambda o: [{"n": n} for n in SIZES_ASKED[3][: 1 if o.quick else None]],
          beside_walk, unit="ms", turns=3, file="hierarchical-trees-walk", everywhere=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
