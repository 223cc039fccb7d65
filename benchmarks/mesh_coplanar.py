"""Facets in one plane, and on one another: all pairs of facets where doubles tell little, beside coal.

    python benchmarks/mesh_coplanar.py       # two minutes

Equal meshes in equal poses, turned and not; meshes whose vertices are rounded to a grid, one moved by a cell; flat
grids of 32,768 facets in one plane. The share of pairs of facets that needed more than doubles is told, and how many
pairs coal finds. ms of the processor.
"""

from __future__ import annotations

import numpy as np
from inputs import mesh, meshes_here, rotation
from pair_loops import CoalLoop, coal_model

from collide import Mesh
from collide.adapters.bench.claims import Claim, Options, Race, installed, main
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


def coplanar_pair(case: str) -> tuple:
    name, _, how = case.partition(", ")
    X, Y, turned = np.eye(4), np.eye(4), np.eye(4)
    turned[:3, :3] = rotation(np.random.default_rng(1))
    half = moved(0.5 / GRID, 0.25 / GRID)
    if name == "grids":
        vertices, faces = flat_grid(GRID)
        X, Y = {"on each other": (X, Y), "half a cell moved": (X, half), "turned in their plane": (X, moved(angle=0.3)),
                "turned out of it": (turned, turned @ half)}[how]
    else:
        vertices, faces = mesh(name)
        if how == "rounded and moved":
            vertices, Y = np.round(vertices * CELLS) / CELLS, moved(1 / CELLS)
        elif how == "turned":
            X = Y = turned
    made = Mesh(vertices, faces, solid=False)
    return made, made, X[None], Y[None]


def coplanar(options: Options, case: str) -> Race:
    A, B, X, Y = coplanar_pair(case)
    hits = all_hits(A.tree, B.tree, X, Y)
    _, tested, exact = hits.counters[0].tolist()
    tasks, beside = {"collide": lambda: all_hits(A.tree, B.tree, X, Y)}, {}
    if installed(coal="coal"):
        coal = CoalLoop([A], [B], X, Y, coal_model("OBB"))
        tasks["coal"] = coal.loop("all pairs")
        beside["coal"] = {"pairs_of_coal": int(coal.answers("all pairs")[0])}
    columns = {"pairs": len(hits.pairs), "tested": tested, "exact_share": exact / max(tested, 1)}
    return Race(tasks, columns=columns, beside=beside)


def coplanar_cases(options: Options):
    names = () if options.quick else meshes_here("teapot", "bunny", "dragon 203k")
    for name in names:
        yield from ({"case": f"{name}, {how}"} for how in ("equal", "turned", "rounded and moved"))
    flat = ("on each other", "half a cell moved", "turned in their plane", "turned out of it")
    yield from ({"case": f"grids, {how}"} for how in flat)


CLAIMS = [Claim("mesh-coplanar", "ms of all pairs of facets", coplanar_cases, coplanar, unit="ms", turns=3)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
