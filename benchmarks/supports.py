"""Support queries: time, operations and memory against the number of vertices, with the lines fitted.

    python benchmarks/supports.py                # about a minute; --plot FILE draws counts and times

Hulls of 512 to 131,072 vertices of several kinds: building the exact hull and the support tree, bytes a vertex, ns a
query by a scan of numpy's, by the tree, and settled exactly; vertices looked at, steps climbed and exact signs a query.
Counts are exact, so they are fitted: looked at = a + b·log2 n for each kind. Directions are random, and facet normals,
where several vertices tie. Every settled answer is compared with brute force.
"""

from __future__ import annotations

import numpy as np
from convex_shapes import STRETCH, prism
from inputs import ball

from collide.adapters.bench.claims import Claim, Options, Race, check, grid, main
from collide.adapters.bench.growth import Panel, log2_lines
from collide.adapters.bench.turns import mean_seconds
from collide.hull.exact_hull import convex_hull
from collide.support.build_support_tree import build_support_tree
from collide.support.support_tree_query import COUNTERS, extreme_vertices

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
    return ball(n) * STRETCH[kind]


def measure(options: Options, kind: str, n: int) -> Race:
    points = cloud(kind, n)
    hull = convex_hull(points)

    def build():
        return build_support_tree(points, hull.vertices, hull.facets)

    tree, random = build(), np.random.default_rng(1)
    corners = points[hull.facets[random.integers(0, len(hull.facets), DIRECTIONS // 4)]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    directions = np.concatenate([random.normal(size=(3 * DIRECTIONS // 4, 3)), normals])
    counters = np.zeros(COUNTERS, dtype=np.int64)
    vertices = extreme_vertices(tree, directions, True, counters)
    some = slice(None, None, max(1, len(directions) * n // 40_000_000))
    best = (points @ directions[some].T).max(axis=0)
    mine = (points[vertices[some]] * directions[some]).sum(axis=1)
    off = 1e-14 * np.abs(directions[some]).sum(axis=1)
    check(bool((mine >= best - off).all()), f"a settled vertex of {kind} {n} is not farthest")
    scanned, steps, looked_at, signs = (counters / len(directions)).tolist()
    sample = directions[: max(20, 2_000_000 // n)]
    tasks = {
        "settled": lambda: extreme_vertices(tree, directions, True),
        "tree": lambda: extreme_vertices(tree, directions, False), "scan": lambda: (sample @ points.T).argmax(axis=1),
    }
    return Race(tasks, dict.fromkeys(tasks, float(len(directions))) | {"scan": float(len(sample))}, {
        "hull_ms": 1e3 * mean_seconds(lambda: convex_hull(points), 1), "tree_ms": 1e3 * mean_seconds(build, 1),
        "bytes_a_vertex": tree.nbytes / n, "longest_list": int(np.diff(tree.nodes).max()), "scanned": scanned,
        "climbed": looked_at, "looked_at": scanned + looked_at, "steps": steps, "exact_signs": signs,
    })


def settled(row: dict) -> bool:
    return row["engine"] == "settled"


def notes(rows):
    return log2_lines([row for row in rows if settled(row)], ("kind",), ("looked_at",))


SIZES = (512, 2048, 8192, 32768, 131072)
CLAIMS = [Claim(
    "supports", "ns a support query", lambda o: grid(kind=KINDS, n=SIZES[: 3 if o.quick else None]), measure,
    unit="ns", turns=5, notes=notes, panels=(
        Panel("vertices looked at in a settled query", "n", "looked_at", "kind", where=settled),
        Panel("ns a settled query", "n", "median_ns", "kind", "xy", settled),
        Panel("ns a query not settled", "n", "median_ns", "kind", "xy", lambda row: row["engine"] == "tree"),
        Panel("ns a query by a scan", "n", "median_ns", "kind", "xy", lambda row: row["engine"] == "scan"),
    ),
)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
