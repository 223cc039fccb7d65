"""Answers of all kinds from seeds, as digests: the same bits are asked for however kernels were made, and wherever
they run.

python tests/kernels/answers_digest.py [pairs hulls meshes worlds]
{"mode": "compiled", "level": "v4", "digests": {"pairs": "5d41…", …}, "counts": {"pairs": [hits, asked], …}}
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("oracles", "families")]

import naive
import surfaces
from naive import LATTICE_ROTATIONS, pose, random_pose, rng_of

import collide
from collide.hull.exact_hull import convex_hull
from collide.kernels import library
from collide.kernels.mode import MODE

KINDS = tuple(kind for kind in naive.KINDS if kind != "Compound")


def pairs() -> Iterator[tuple[np.ndarray, int, int]]:
    """Convex shapes of every kind, two by two: apart, overlapping, and on lattices, where doubles decide nothing."""
    rng = rng_of("digest of pairs")
    A, B, X, Y = [], [], [], []
    while len(A) < 300:
        kind_a, kind_b = rng.choice(KINDS, 2)
        if kind_a == kind_b == "Halfspace":
            continue
        A.append(naive.one_of_each(rng)[kind_a])
        B.append(naive.one_of_each(rng)[kind_b])
        X.append(random_pose(rng, 0.5))
        Y.append(random_pose(rng, 0.5))
    boxes = [collide.Box(size) for size in ((1, 1, 1), (0.5, 1, 2), (2, 0.25, 1))]
    for _ in range(100):
        A.append(boxes[rng.integers(3)])
        B.append(boxes[rng.integers(3)])
        for poses in (X, Y):
            poses.append(pose(LATTICE_ROTATIONS[rng.integers(24)], rng.integers(-3, 4, 3) / 4))
    X, Y = np.array(X), np.array(Y)
    found = collide.distance(A, B, X, Y).rows
    yield found, found["hit"].sum(), len(A)
    yield collide.distance(A, B, X, Y, signed=False).rows, 0, 0
    yield collide.collide(A, B, X, Y), 0, 0


def hulls() -> Iterator[tuple[np.ndarray, int, int]]:
    """Convex hulls of points, hulls of 500 vertices with their support trees, and single calls."""
    rng = rng_of("digest of hulls")
    for n in (5, 30, 300):
        points = rng.normal(size=(n, 3))
        yield np.asarray(convex_hull(points).facets), 0, 0
        yield np.asarray(convex_hull(np.round(points * 2)).facets), 0, 0
    large = []
    for _ in range(3):
        points = rng.normal(size=(500, 3))
        large.append(collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None]))
    shapes = [*large, *(naive.one_of_each(rng)[kind] for kind in ("Box", "ConvexHull", "Cylinder", "Compound"))]
    for k in range(60):
        A, B = large[k % 3], shapes[rng.integers(len(shapes))]
        X, Y = random_pose(rng, 1.5), random_pose(rng, 1.5)
        found = collide.distance(A, B, X, Y)
        yield found.rows, found.hit, 1
        yield np.array(collide.collide(A, B, X, Y)), 0, 0


def meshes() -> Iterator[tuple[np.ndarray, int, int]]:
    """Meshes against meshes and the rest: booleans, distances and contacts."""
    rng = rng_of("digest of meshes")
    tori = [collide.Mesh(*surfaces.torus()), collide.Mesh(*surfaces.torus(20, 9)), collide.Mesh(*surfaces.ball())]
    others = [*tori, *(naive.one_of_each(rng)[kind] for kind in ("Box", "Sphere", "ConvexHull", "Capsule"))]
    for k in range(60):
        A, B = tori[k % 3], others[rng.integers(len(others))]
        X, Y = random_pose(rng, 1.8), random_pose(rng, 1.8)
        found = collide.distance(A, B, X, Y, signed=False)
        yield found.rows, found.hit, 1
        yield np.array(collide.collide(A, B, X, Y)), 0, 0
    for kind in ("Box", "Cylinder", "ConvexHull"):
        for _ in range(4):
            A, B = naive.one_of_each(rng)[kind], naive.one_of_each(rng)["Box"]
            found = collide.contacts(A, B, random_pose(rng, 0.3), random_pose(rng, 0.3))
            yield found.rows, int(len(found.rows) > 0), 1


def worlds() -> Iterator[tuple[np.ndarray, int, int]]:
    """Worlds of all kinds of bodies."""
    rng = rng_of("digest of worlds")
    world = collide.World()
    shapes = [*naive.one_of_each(rng).values(), collide.Mesh(*surfaces.torus())]
    for k in range(40):
        world.add(shapes[k % len(shapes)], random_pose(rng, 2.5))
    for _ in range(3):
        found = world.distances(max_distance=0.5).rows
        yield found, found["hit"].sum(), len(found)
        yield world.collisions().rows, 0, 0
        for k in range(40):
            world.set_pose(k, random_pose(rng, 2.5))


def told(names: list[str]) -> dict:
    """What is printed. Raises AssertionError where answers are all alike, so that digests would say nothing."""
    digests, counts = {}, {}
    for name in names:
        digest, hits, asked = hashlib.sha256(), 0, 0
        for answer, more_hits, more in globals()[name]():
            digest.update(repr((answer.dtype.str, answer.shape)).encode() + answer.tobytes())
            hits, asked = hits + int(more_hits), asked + more
        assert 0.1 * asked < hits < 0.95 * asked, (name, hits, asked)
        digests[name], counts[name] = digest.hexdigest()[:16], [hits, asked]
    return {"mode": MODE, "level": library.level, "digests": digests, "counts": counts}


if __name__ == "__main__":
    print(json.dumps(told(sys.argv[1:] or ["pairs", "hulls", "meshes", "worlds"])))
