"""Overlays of tetrahedral meshes to a million cells against a million, and beside manifold3d and Qhull cell by cell.

    python benchmarks/overlays.py                  # twelve minutes, 4 GB; pip install manifold3d scipy for the peers
    python benchmarks/overlays.py --cubes 8 20     # a look, no CSV

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

import argparse
import csv
import logging
import os
import platform
import resource
import time
from fractions import Fraction
from itertools import permutations
from pathlib import Path

import numpy as np

import collide
from collide.tetrahedra.cell_overlaps import exact_overlap

RESULTS = Path(__file__).parent / "results"
STILL, ASIDE = np.eye(4), collide.pose((0.01, 0.02, 0.03), rpy=(0.02, 0.03, 0.01))
FACES = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]
Row = dict[str, object]


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


def measure(n: int) -> list[Row]:
    """All families of one size; Delaunay's of as many cells, up to 10⁵."""
    rows = families(*(block(n, seed) for seed in (0, 1)), names=("one frame", "turned", "itself"))
    if n > 26:
        return rows
    try:
        from scipy.spatial import Delaunay
    except ImportError:
        print("Delaunay's meshes are left out: scipy is not installed")
        return rows
    points = [np.random.default_rng(seed).uniform(size=(9 * n**3 // 10, 3)) for seed in (0, 1)]
    return rows + families(*((p, Delaunay(p).simplices) for p in points), names=("Delaunay",))


def families(first: tuple, second: tuple, names: tuple[str, ...]) -> list[Row]:
    """Two meshes by their vertices and cells, in the families of these names."""
    started = time.process_time()
    A, B = collide.TetMesh(*first), collide.TetMesh(*second)
    made = time.process_time() - started
    started = time.process_time()
    A.tree, B.tree  # noqa: B018
    trees = time.process_time() - started
    rows = []
    for family in names:
        seconds, result = {}, None
        arguments = A, A if family == "itself" else B, STILL, ASIDE if family == "turned" else STILL
        for name, asked in (("pairs", {}), ("volumes", {"volumes": True}), ("centroids", {"centroids": True})):
            result = None
            started = time.process_time()
            result = collide.overlapping_cells(*arguments, **asked)
            seconds[name] = round(time.process_time() - started, 2)
        assert result is not None and result.volumes is not None
        rows.append({
            "family": family, "cells A": len(A.cells), "cells B": len(arguments[1].cells), "made s": round(made, 2),
            "trees s": round(trees, 2), **{f"{name} s": s for name, s in seconds.items()}, "pairs": len(result.pairs),
            "boxes meet": int(result.counters[0, 1]), "in integers": int(result.counters[0, 2]),
            "in fractions": int(result.counters[0, 3]), "sum of volumes": float(result.volumes.sum()),
            "memory MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        })  # fmt: skip
        print(rows[-1], flush=True)
    return rows


def peers(n: int, count: int) -> list[Row]:
    """Pairs that overlap, that do by a hair, and that touch, by each engine."""
    A, B = (collide.TetMesh(*block(n, seed)) for seed in (0, 1))
    A.tree, B.tree  # noqa: B018
    rng = np.random.default_rng(0)
    hair = collide.pose((2.0**-47, 2.0**-48, 2.0**-48))
    rows = []
    for kind, second, X_WB in (("overlapping", B, STILL), ("by a hair", A, hair), ("touching", A, STILL)):
        started = time.process_time()
        ours = collide.overlapping_cells(A, second, STILL, X_WB, volumes=True, settle=kind != "by a hair")
        seconds = time.process_time() - started
        if kind == "touching":
            around = [np.flatnonzero((A.cells == v).any(axis=1)) for v in range(len(A.vertices))]
            cells = rng.choice(len(A.cells), count)
            pairs = np.array([(a, b) for a in cells for b in around[A.cells[a, 0]] if b != a])[:count]
            volumes = np.isin(pairs @ [len(A.cells), 1], ours.pairs @ [len(A.cells), 1]).astype(float)
            seconds /= ours.counters[0, 1] / len(pairs)
        else:
            thin = np.flatnonzero(ours.pairs[:, 0] != ours.pairs[:, 1]) if second is A else np.arange(len(ours.pairs))
            some = rng.choice(thin, count, replace=False)
            pairs, volumes = ours.pairs[some], ours.volumes[some]
            seconds *= len(pairs) / len(ours.pairs)
        exact = [exact_overlap(A, second, STILL, X_WB, a, b) for a, b in pairs.tolist()]
        corners = A.vertices[A.cells[pairs[:, 0]]], second.vertices[second.cells[pairs[:, 1]]] + X_WB[:3, 3]
        answers = {"collide": (volumes, seconds)}
        answers.update((name, engine(*corners, exact)) for name, engine in engines().items())
        for name, (volumes, seconds) in answers.items():
            if name == "Qhull" and kind == "touching":
                continue  # there is no point within to give it
            off = [abs(Fraction(float(v)) - e.volume) / e.volume for v, e in zip(volumes, exact) if e.volume and v]
            wrong = sum((v > 0) != (e.volume > 0) for v, e in zip(volumes, exact))
            rows.append({
                "pairs": kind, "engine": name, "n": len(pairs),
                "us a pair": round(float(1e6 * seconds / len(pairs)), 2),
                "off": f"{float(max(off, default=0)):.1e}", "wrong": int(wrong),
            })  # fmt: skip
            print(rows[-1], flush=True)
    return rows


def engines() -> dict:
    """name → (volumes, seconds) of cells (k, 4, 3) against cells, what they share exactly being known."""
    able = {}
    for name, engine, package in (("manifold3d", by_manifold, "manifold3d"), ("Qhull", by_qhull, "scipy.spatial")):
        try:
            __import__(package)
        except ImportError:
            print(f"{name} is left out: {package} is not installed")
        else:
            able[name] = engine
    return able


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


def write(name: str, rows: list[Row]) -> None:
    path = RESULTS / f"{name}.csv"
    about = f"{platform.processor() or platform.machine()}, {len(os.sched_getaffinity(0))} cores"
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [*rows[0], "machine"])
        table.writeheader()
        table.writerows({**row, "machine": about} for row in rows)
    print(f"wrote {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cubes", type=int, nargs="+", help="small cubes along a side (default: 12 26 56)")
    parser.add_argument("--pairs", type=int, default=2000, help="pairs that peers are given")
    arguments = parser.parse_args()
    logging.getLogger("collide").setLevel(logging.ERROR)
    by_size = [row for n in arguments.cubes or (12, 26, 56) for row in measure(n)]
    by_engine = peers(12, arguments.pairs)
    if not arguments.cubes:
        write("overlays", by_size)
        write("overlays-peers", by_engine)


if __name__ == "__main__":
    main()
