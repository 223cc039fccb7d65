"""How near hulls of few planes and of few vertices come to a body, and what making them costs.

    python benchmarks/nested_hulls.py                  # balls, cylinders and thin bodies: a minute
    python benchmarks/nested_hulls.py --table hierarchy_levels   # beside hierarchies of Dobkin and Kirkpatrick

Distances are parts of the body's size. Times are seconds of the processor, all levels up to the size together.
"""

from __future__ import annotations

import time

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, Options, main
from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy import build_hierarchy

POINT = collide.ConvexHull(np.zeros((1, 3)))
SIZES = (16, 64, 256, 1024, 4096)


def ball(n: int) -> np.ndarray:
    points = np.random.default_rng(n).normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def cylinder(n: int) -> np.ndarray:
    turns = np.linspace(0.0, 2.0 * np.pi, n // 2, endpoint=False)
    rim = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
    return np.concatenate([rim, rim + np.eye(3)[2]])


BODIES = {
    "ball": (ball, 100_000), "ball, small": (ball, 2_000), "cylinder": (cylinder, 1_000),
    "pancake": (lambda n: ball(n) * [1.0, 1.0, 0.01], 5_000), "needle": (lambda n: ball(n) * [1.0, 0.01, 0.01], 5_000),
}


def cases(options: Options):
    for body in BODIES:
        for size in SIZES:
            yield {"body": body, "size": size}


def distances(options: Options, body: str, size: int) -> list[dict]:
    make, n = BODIES[body]
    hull = collide.ConvexHull(make(n))
    start = time.process_time()
    level = collide.nested_hulls(hull, [k for k in collide_sizes() if k <= size])[-1]
    seconds = time.process_time() - start
    extent = float(np.ptp(hull.points, axis=0).max())
    return [{
        "vertices": len(hull.hull.vertices), "planes": level.planes, "outer": level.outer_within / extent,
        "inner": level.inner_within / extent, "gap": level.gap[1] / extent, "s": seconds,
    }]


def collide_sizes() -> list[int]:
    """Sizes of all levels that a call makes."""
    return [2**k for k in range(3, 13)]


def hierarchy_cases(options: Options):
    for body in ("ball, small", "cylinder", "pancake", "needle"):
        yield {"body": body}


def beside_hierarchies(options: Options, body: str) -> list[dict]:
    """Levels of 12 to 1,500 vertices: their distance by that of as many vertices chosen here."""
    make, n = BODIES[body]
    points = make(n)
    vertices = points[convex_hull(points).vertices]
    whole = collide.ConvexHull(vertices)
    hierarchy = build_hierarchy(vertices, convex_hull(vertices), 0)
    rows = []
    for depth in range(hierarchy.depth):
        ids = hierarchy.vertices(depth)
        if 12 <= len(ids) <= 1500:
            (level,) = collide.nested_hulls(whole, [len(ids)])
            X = np.tile(np.eye(4), (len(vertices), 1, 1))
            X[:, :3, 3] = vertices
            of_level = collide.ConvexHull(hierarchy.points[ids])
            far = float(collide.distance(of_level, POINT, np.eye(4), X).rows["distance"].max())
            rows.append({"level": depth, "chosen": len(ids), "hierarchy": far, "here": level.inner_within})
    return rows


CLAIMS = [
    Claim("nested_hulls", "hulls of few planes around bodies, and of few vertices in them", cases, distances),
    Claim("hierarchy_levels", "beside levels of hierarchies of as many vertices", hierarchy_cases, beside_hierarchies),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
