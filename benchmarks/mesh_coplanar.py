"""Facets in one plane, and on one another: all pairs of facets where doubles tell little, beside coal.

    python benchmarks/mesh_coplanar.py       # two minutes; --no-csv

Equal meshes in equal poses, turned and not; meshes whose vertices are rounded to a grid, one moved by a cell; flat
grids of 32,768 facets in one plane. The share of pairs of facets that needed more than doubles is told, and how many
pairs coal finds. Times are the fastest of three, engines in turn.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mesh_peers import MANY
from meshes import DATA, RESULTS, mesh, rotation

from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import all_hits

#: Cells of a unit along each axis, of vertices rounded and of the flat grids.
CELLS, GRID = 256, 128


def flat_grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """(vertices, faces): 2·n² triangles over the unit square."""
    x, y = np.meshgrid(np.arange(n + 1) / n, np.arange(n + 1) / n, indexing="ij")
    corner = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :n].ravel()
    lower, upper = (
        np.stack([corner, corner + n + 1, corner + 1], axis=1),
        np.stack([corner + 1, corner + n + 1, corner + n + 2], axis=1),
    )
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1), np.concatenate([lower, upper])


def moved(x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> np.ndarray:
    X = np.eye(4)
    X[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    X[:2, 3] = x, y
    return X


def cases():
    """(name, mesh A, mesh B, X_WA, X_WB)."""
    turned = np.eye(4)
    turned[:3, :3] = rotation(np.random.default_rng(1))
    for name in ("teapot", "bunny", "dragon 203k") if DATA.is_dir() else ():
        vertices, faces = mesh(name)
        yield f"{name}, equal", (vertices, faces), (vertices, faces), np.eye(4), np.eye(4)
        yield f"{name}, equal, turned", (vertices, faces), (vertices, faces), turned, turned
        rounded = np.round(vertices * CELLS) / CELLS
        yield f"{name} rounded, moved by a cell", (rounded, faces), (rounded, faces), np.eye(4), moved(1 / CELLS)
    grid = flat_grid(GRID)
    half = moved(0.5 / GRID, 0.25 / GRID)
    yield "grids on each other", grid, grid, np.eye(4), np.eye(4)
    yield "grids, half a cell moved", grid, grid, np.eye(4), half
    yield "grids, turned in their plane", grid, grid, np.eye(4), moved(angle=0.3)
    yield "grids, both turned out of it", grid, grid, turned, turned @ half


def fastest(task, turns: int = 3) -> float:
    taken = []
    for _ in range(turns):
        started = time.perf_counter()
        task()
        taken.append(time.perf_counter() - started)
    return 1e3 * min(taken)


def coal_model(vertices, faces):
    import coal

    model = coal.BVHModelOBB()
    model.beginModel(len(faces), len(vertices))
    model.addVertices(vertices)
    model.addTriangles(faces)
    model.endModel()
    return model


def measured(name, A, B, X_WA, X_WB) -> dict:
    import coal

    trees, models = [build_mesh_tree(*m) for m in (A, B)], [coal_model(*m) for m in (A, B)]
    places = [coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3])) for X in (X_WA, X_WB)]
    request = coal.CollisionRequest()
    request.break_distance, request.enable_contact, request.num_max_contacts = 0.0, False, MANY

    def ask_coal():
        result = coal.CollisionResult()
        coal.collide(models[0], places[0], models[1], places[1], request, result)
        return result.numContacts()

    hits = all_hits(*trees, X_WA, X_WB)
    _, triangles, exact = hits.counters[0].tolist()
    pairs_of_coal = ask_coal()
    ours, theirs = fastest(lambda: all_hits(*trees, X_WA, X_WB)), fastest(ask_coal)
    return {
        "case": name, "pairs": len(hits.pairs), "pairs_of_coal": pairs_of_coal, "tested": triangles,
        "exact_share": f"{exact / max(triangles, 1):.4f}", "ms": f"{ours:.2f}", "coal_ms": f"{theirs:.2f}",
        "ratio": f"{theirs / ours:.2f}", "us_a_test": f"{1e3 * ours / max(triangles, 1):.3f}",
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--no-csv", action="store_true")
    options = parser.parse_args()
    rows = []
    for case in cases():
        rows.append(measured(*case))
        print("  ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if not options.no_csv:
        with open(RESULTS / "mesh-coplanar.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
