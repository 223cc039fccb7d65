"""Stretches of many meshes beside what queries about them look at, and the rank correlations between the two.

    python benchmarks/locality_meshes.py --plot docs/pictures/locality-meshes.png

All meshes of shared/data and a sample of pybullet_data's, box diagonals 1. Counted are boxes and pairs of facets, a
facet, of two shells nearly alike and of shallow overlaps, all pairs; and a boolean at a gap of 1e-4, whole. Counts are
the same on every machine.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from inputs import FILES, in_unit_box, mesh, meshes_here, rotation, touching

from collide import CollideError, Mesh
from collide.adapters.bench.claims import Claim, Options, grid, installed, main
from collide.adapters.bench.growth import Panel
from collide.narrowphase.facets.facet_queries import all_hits, first_hits
from collide.papers.hierarchies.tree_figures import tree_figures
from collide.scenes.loaders.triangles import read_meshes

#: Of pybullet_data: every so many of its files in order of names, and facets within these.
EVERY, MIN_VERTICES, MAX_VERTICES = 3, 200, 120_000
POSES = 6


@cache
def all_meshes() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Name to (vertices, faces), box diagonals 1."""
    by_name = {name: mesh(name) for name in meshes_here(*FILES) if name != "dragon 871k"}
    if not installed(pybullet_data="pybullet_data"):
        return by_name
    import pybullet_data

    root = Path(pybullet_data.getDataPath())
    files = sorted(f for kind in ("obj", "stl") for f in root.rglob(f"*.{kind}"))
    for file in files[::EVERY]:
        try:
            parts = read_meshes(str(file))
        except CollideError:
            continue
        for _, part in parts[:1]:
            if MIN_VERTICES <= len(part.faces) <= MAX_VERTICES:
                by_name[file.relative_to(root).as_posix()] = in_unit_box(part.vertices, part.faces)
    return by_name


def meshes(options: Options, mesh_name: str) -> list[dict]:
    vertices, faces = all_meshes()[mesh_name]
    body, rng = Mesh(vertices, faces, solid=False), np.random.default_rng(1)
    locality, trees, tree, R = body.locality(), tree_figures(body), body.tree, rotation(rng)
    small, shift = 1e-3 * (R - R.T), np.eye(4)
    shift[:3, :3] = np.eye(3) + small + small @ small / 2
    shift[:3, 3] = 1e-3 * rng.normal(size=3)
    shells = int(all_hits(tree, tree, np.eye(4), shift).counters[0, :2].sum())
    counts: dict = {"shallow": [], "boolean": []}
    for _ in range(POSES):
        X, Y, direction, way = touching(tree, tree, rng)
        for name, further, ask in (("shallow", -1e-3, all_hits), ("boolean", 1e-4, first_hits)):
            Y[:3, 3] = X[:3, 3] + (way + further) * direction
            counts[name].append(int(ask(tree, tree, X, Y).counters[0, :2].sum()))
    n, shallow = len(faces), float(np.mean(counts["shallow"]))
    return [{
        "facets": n, "Σ": locality.global_stretch, "σ": locality.local_stretches[0], "σ4": locality.local_stretches[3],
        "σ10": locality.local_stretches[9], "σ mean": locality.means[0], "σ10 mean": locality.means[9],
        "σ10 90 %": float(locality.quantiles([0.9])[0, 9]), "outliers": trees.outlier_share,
        "graded depth": trees.graded_depth, "shells": shells / n, "shallow": shallow / n,
        "boolean": float(np.mean(counts["boolean"])), "shallow / √F": shallow / np.sqrt(n),
    }]


MEASURES = ("facets", "Σ", "σ", "σ4", "σ10", "σ mean", "σ10 mean", "σ10 90 %", "outliers")


def ranks(values) -> np.ndarray:
    """Ranks, those of equal values their mean."""
    values = np.asarray(values, dtype=float)
    return np.array([(values < v).sum() + 0.5 * ((values == v).sum() - 1) for v in values])


def correlations(rows):
    costs = ("shells", "shallow / √F", "boolean")
    yield f"rank correlations over {len(rows)} meshes with {', '.join(costs)}"
    for measure in MEASURES:
        a = ranks([row[measure] for row in rows])
        each = [np.corrcoef(a, ranks([row[cost] for row in rows]))[0, 1] for cost in costs]
        yield f"{measure}: {', '.join(f'{r:.2f}' for r in each)}"


CLAIMS = [
    Claim("meshes", "stretches and what queries look at", lambda o: grid(
        mesh_name=[*all_meshes()][: 4 if o.quick else None]), meshes, notes=correlations, everywhere=True,
          file="locality-meshes", panels=tuple(
              Panel("pairs looked at, a facet, two shells nearly alike", measure, "shells", "all", "xy", style=".")
              for measure in ("σ", "σ10 mean"))),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
