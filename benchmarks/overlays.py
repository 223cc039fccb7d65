"""Overlays of tetrahedral meshes to a million cells against a million, and beside manifold3d and Qhull cell by cell.

    python benchmarks/overlays.py                  # twelve minutes, 4 GB; pip install manifold3d scipy for the peers
    python benchmarks/overlays.py --quick          # a look, no CSV

Two meshes of one cube, n³ small cubes of six cells each, inner vertices shaken by up to a fifth of a small cube. "one
frame" has both at one pose, "turned" the second one a little aside, "itself" one mesh twice: cells touch in faces,
edges and corners everywhere. "Delaunay" has random points (scipy), so slivers of any kind, up to 10⁵ cells. One thread;
seconds are the processor's: making both `TetMesh` and their trees, pairs, pairs with volumes, pairs with volumes and
centroids. "in fractions" are volumes that double-doubles could not round. Memory is the largest that the process had by
then.

The peers intersect given pairs one by one: manifold3d as two solids, Qhull (scipy) as half-spaces around a point
within, which it has to be given. Our time is that of the whole overlay, finding the pairs included, divided by the
pairs that were found ("touching": by the pairs whose boxes meet). "by a hair": a mesh on itself, moved by 2⁻⁴⁷.
"off" is the largest error of a volume as a share of itself, "wrong" counts pairs whose verdict (a volume or none) is
not the exact one.
"""

from __future__ import annotations

import logging
import resource
import time
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from itertools import permutations

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, Options, grid, installed, main
from collide.papers.tetrahedra.cell_overlaps import exact_overlap

STILL, ASIDE = np.eye(4), collide.pose((0.01, 0.02, 0.03), rpy=(0.02, 0.03, 0.01))
FACES = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]


def block(n: int, seed: int, shaken: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, in multiples of 2⁻⁴⁸, and cells of the unit cube."""
    side = np.linspace(0, 1, n + 1)
    vertices = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    moves = np.random.default_rng(seed).uniform(-shaken, shaken, vertices.shape) / n
    vertices += np.where((vertices > 0) & (vertices < 1), moves, 0)
    vertices = np.round(vertices * 2.0**48) * 2.0**-48
    corners = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = []
    for axes in permutations(range(3)):
        steps = np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(axes)]], axis=0)
        cells.append((corners[:, None] + steps) @ [(n + 1) ** 2, n + 1, 1])
    return vertices, np.concatenate(cells)


def cpu(task: Callable) -> tuple[float, object]:
    started = time.process_time()
    made = task()
    return time.process_time() - started, made


@cache
def meshes(cubes: int, kind: str) -> tuple[collide.TetMesh, collide.TetMesh, float, float]:
    """(A, B, seconds of both, seconds of their trees)."""
    if kind == "Delaunay":
        from scipy.spatial import Delaunay

        points = [np.random.default_rng(seed).uniform(size=(9 * cubes**3 // 10, 3)) for seed in (0, 1)]
        parts = [(p, Delaunay(p).simplices) for p in points]
    else:
        parts = [block(cubes, seed) for seed in (0, 1)]
    made_s, (A, B) = cpu(lambda: [collide.TetMesh(*part) for part in parts])  # type: ignore[misc]
    return A, B, made_s, cpu(lambda: (A.tree, B.tree))[0]


def overlay(options: Options, cubes: int, family: str) -> list[dict]:
    A, B, made_s, trees_s = meshes(cubes, "Delaunay" if family == "Delaunay" else "block")
    asked = A, A if family == "itself" else B, STILL, ASIDE if family == "turned" else STILL
    row: dict = {"cells_A": len(A.cells), "cells_B": len(asked[1].cells), "made_s": made_s, "trees_s": trees_s}
    for name, what in (("pairs", {}), ("volumes", {"volumes": True}), ("centroids", {"centroids": True})):
        row[f"{name}_s"], result = cpu(lambda what=what: collide.overlapping_cells(*asked, **what))
    names = ("boxes_meet", "in_integers", "in_fractions")
    row |= {"pairs": len(result.pairs), **dict(zip(names, result.counters[0, 1:4].tolist()))}
    return [row | {"sum_of_volumes": float(result.volumes.sum()),
                   "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024}]


def cases(options: Options):
    logging.getLogger("collide").setLevel(logging.ERROR)
    for cubes in (5,) if options.quick else (12, 26, 56):
        yield from grid(cubes=[cubes], family=("one frame", "turned", "itself"))
        if cubes <= 26 and installed(Delaunay="scipy"):
            yield {"cubes": cubes, "family": "Delaunay"}


def peers(options: Options, pairs: str) -> list[dict]:
    """Pairs that overlap, that do by a hair, and that touch, by each engine."""
    count = 200 if options.quick else 2000
    A, B, *_ = meshes(5 if options.quick else 12, "block")
    rng, hair = np.random.default_rng(0), collide.pose((2.0**-47, 2.0**-48, 2.0**-48))
    second, X_WB = {"overlapping": (B, STILL), "by a hair": (A, hair), "touching": (A, STILL)}[pairs]
    seconds, ours = cpu(lambda: collide.overlapping_cells(A, second, STILL, X_WB, volumes=True,
                                                          settle=pairs != "by a hair"))
    if pairs == "touching":
        around = [np.flatnonzero((A.cells == v).any(axis=1)) for v in range(len(A.vertices))]
        cells = rng.choice(len(A.cells), count)
        asked = np.array([(a, b) for a in cells for b in around[A.cells[a, 0]] if b != a])[:count]
        volumes = np.isin(asked @ [len(A.cells), 1], ours.pairs @ [len(A.cells), 1]).astype(float)
        seconds /= ours.counters[0, 1] / len(asked)
    else:
        thin = np.flatnonzero(ours.pairs[:, 0] != ours.pairs[:, 1]) if second is A else np.arange(len(ours.pairs))
        some = rng.choice(thin, min(count, len(thin)), replace=False)
        asked, volumes = ours.pairs[some], ours.volumes[some]
        seconds *= len(asked) / len(ours.pairs)
    exact = [exact_overlap(A, second, STILL, X_WB, a, b) for a, b in asked.tolist()]
    corners = A.vertices[A.cells[asked[:, 0]]], second.vertices[second.cells[asked[:, 1]]] + X_WB[:3, 3]
    answers = {"collide": (volumes, seconds)}
    for name in installed(manifold3d="manifold3d", Qhull="scipy"):
        if name == "manifold3d" or pairs != "touching":  # Qhull has no point within to be given there
            answers[name] = (by_manifold if name == "manifold3d" else by_qhull)(*corners, exact)
    rows = []
    for name, (measured, spent) in answers.items():
        off = [abs(Fraction(float(v)) - e.volume) / e.volume for v, e in zip(measured, exact) if e.volume and v]
        wrong = sum((v > 0) != (e.volume > 0) for v, e in zip(measured, exact))
        rows.append({"engine": name, "n": len(exact), "us_a_pair": 1e6 * spent / len(exact),
                     "off": float(max(off, default=0)), "wrong": int(wrong)})
    return rows


def by_manifold(A, B, exact):
    import manifold3d

    def solid(cell):
        return manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(cell), np.array(FACES, dtype=np.uint64)))

    solids = [(solid(a), solid(b)) for a, b in zip(A, B)]
    started = time.process_time()
    volumes = [(a ^ b).volume() for a, b in solids]
    return np.array(volumes), time.process_time() - started


def by_qhull(A, B, exact):
    from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

    planes = np.concatenate([half_spaces(A), half_spaces(B)], axis=1)
    volumes = np.zeros(len(A))
    started = time.process_time()
    for k, shared in enumerate(exact):
        if shared.centroid is not None:
            try:
                corners = HalfspaceIntersection(planes[k], np.array([float(x) for x in shared.centroid])).intersections
                volumes[k] = ConvexHull(corners).volume
            except QhullError:  # too flat for it
                pass
    return volumes, time.process_time() - started


def half_spaces(cells: np.ndarray) -> np.ndarray:
    """(k, 4, 4): n · x + d ≤ 0 of each face."""
    a, b, c = (cells[:, [face[k] for face in FACES]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    return np.concatenate([n, -(n * a).sum(axis=2, keepdims=True)], axis=2)


CLAIMS = [
    Claim("overlays", "overlays of tetrahedral meshes", cases, overlay),
    Claim("peers", "µs a pair of cells", lambda o: grid(pairs=("overlapping", "by a hair", "touching")), peers,
          file="overlays-peers"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
