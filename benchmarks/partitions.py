"""Space partitions: how large they get, how quickly points are located, and convex pieces beside coacd's.

    python benchmarks/partitions.py                      # "sizes": cells over n log n and depth, 10^3 to 10^5 facets
    python benchmarks/partitions.py --table settings     # seeds; kappa
    python benchmarks/partitions.py --table scans        # the same of meshes in shared/data, reduced or whole
    python benchmarks/partitions.py --table worst        # harpsicordia beside Chazelle's polyhedra and accordions
    python benchmarks/partitions.py --table points       # 10^5 points a mesh, as `contains` has them, and ns a point
    python benchmarks/partitions.py --table pieces       # convex pieces beside coacd's: how many, volumes
    python benchmarks/partitions.py --table clutter      # facets that cubes without guards meet
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np
from inputs import SHARED, use_tests

use_tests("families", "oracles")
from mesh_shapes import block_ring, bumpy_sphere

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.adapters.bench.growth import groups, line_fit, power_of
from collide.papers.partitions.clutter import clutter
from collide.scenes import generate


def sphere(n: int, seed: int = 0) -> collide.Mesh:
    return collide.Mesh(*bumpy_sphere(n, seed), solid=True)


def partition_of(mesh: collide.Mesh, **arguments) -> dict:
    start = time.process_time()
    s = collide.SpacePartition(mesh, **arguments).size
    seconds, n = time.process_time() - start, s.facets
    return {
        "facets": n, "cells": s.cells, "cells_a_facet": s.cells / n, "over_nlogn": s.cells / (n * np.log2(n)),
        "over_n2": s.cells / n**2, "depth": s.depth, "mean_depth": s.mean_depth, "over_log_n": s.depth / np.log2(n),
        "first_cells": s.first_cells, "most_in_one": s.max_facets, "mean_in_one": s.pieces / s.first_cells,
        "integers": s.integers, "s": seconds, "kappa": s.kappa,
    }


def growth_notes(rows, by: str = "family"):
    for (family,), some in groups(rows, by):
        if len(some) > 2:
            n, ratio = [row["facets"] for row in some], np.array([row["over_nlogn"] for row in some])
            fit = line_fit(np.log2(n), [row["depth"] for row in some])
            yield (f"{family or 'all'}: cells n^{power_of(n, [row['cells'] for row in some]):.3f}; over n log2 n from "
                   f"{ratio.min():.3f} to {ratio.max():.3f}, a factor of {ratio.max() / ratio.min():.2f}; depth "
                   f"{fit.start:.1f} + {fit.slope:.2f} log2 n")


def settings(options: Options, facets: int, **arguments) -> list[dict]:
    return [partition_of(sphere(facets), **arguments)]


def setting_cases(options: Options):
    n = 10 if options.quick else 1
    yield from grid(facets=[3000 // n], seed=range(5))
    yield from grid(facets=[10_000 // n], kappa=(8, 16, 32, 64, 128, 256, 1024))


def scan_cases(options: Options):
    """Solid meshes of shared/data, by size, up to 120,000 facets."""
    from collide.scenes.loaders.mesh_file import read_mesh

    meshes = []
    for path in sorted(SHARED.rglob("*")) if SHARED.is_dir() else []:
        if path.suffix not in (".ply", ".obj", ".stl", ".off") or path.stat().st_size > 30e6:
            continue
        try:
            parts = read_mesh(path).parts
        except collide.CollideError:
            continue
        for part in parts:
            if part.closed and part.facets is not None and part.faces >= 500:
                meshes.append((path.stem, collide.Mesh(part.points, part.facets, solid=True)))
    for name, mesh in sorted(meshes, key=lambda item: len(item[1].faces))[: 2 if options.quick else None]:
        if len(mesh.faces) <= 120_000:
            SCANS[name] = mesh
            yield {"scan": name}


SCANS: dict[str, collide.Mesh] = {}


def joined(*meshes) -> collide.Mesh:
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    faces = np.concatenate([m.faces + s for m, s in zip(meshes, starts)])
    return collide.Mesh(np.concatenate([m.vertices for m in meshes]), faces)


def pair_of(family: str, **arguments) -> collide.Mesh:
    """Both bodies of a generated pair as one mesh, where they stand."""
    scene = generate(family, **arguments)
    parts = []
    for body in scene.bodies:
        R, p = body.X_WB[:3, :3], body.X_WB[:3, 3]
        parts.append(collide.Mesh(body.shape.vertices @ R.T + p, body.shape.faces))
    return joined(*parts)


#: Family → (its size's name, sizes).
WORST = {"harpsicordia": ("n", (150, 500, 1500)), "chazelle": ("strings", (10, 20, 40, 80)),
         "accordions": ("strings", (10, 20, 40, 80))}


def hard_points(mesh: collide.Mesh, partition: collide.SpacePartition, n: int, seed: int = 0) -> np.ndarray:
    """A third anywhere, a third on corners, edges, facets and cuts, a third of those an ulp off."""
    rng = np.random.default_rng(seed)
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    k = n // 3
    some = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=k)]]
    weights = rng.integers(0, 5, size=(k, 3)) + np.array([1, 0, 0])
    on = np.einsum("ij,ijk->ik", weights / weights.sum(axis=1, keepdims=True), some)
    cells = partition.cells()
    rows = np.flatnonzero(cells.axis >= 0)
    rows = rows[rng.integers(len(rows), size=k // 3)]
    cut = rng.uniform(low, high, (k // 3, 3))
    cut[np.arange(len(cut)), cells.axis[rows]] = cells.value[rows]
    on[: len(cut)] = cut
    off = np.nextafter(on, rng.choice([-np.inf, np.inf], on.shape))
    return np.concatenate((rng.uniform(low, high, (n - 2 * k, 3)), on, off))


MESHES = {"bumpy sphere, 1,000": lambda: sphere(1000), "bumpy sphere, 3,000": lambda: sphere(3000),
          "bumpy sphere, 10,000": lambda: sphere(10_000),
          "square ring": lambda: collide.Mesh(*block_ring())}


def points(options: Options, mesh: str) -> Race:
    made = MESHES[mesh]()
    partition = collide.SpacePartition(made)
    every = hard_points(made, partition, 9_999 if options.quick else 99_999)
    results, some = partition.locate(every), every[: len(every) // 3]
    wrong = int((results.inside != collide.contains(made, np.eye(4), every)).sum())
    tasks = {"locate": lambda: partition.locate(some), "contains": lambda: collide.contains(made, np.eye(4), some)}
    return Race(tasks, len(some), {"points": len(every), "inside": int(results.inside.sum()), "differ": wrong,
                                   "on_boundary": int(results.boundary.sum())})


def pieces(options: Options, mesh: str) -> list[dict]:
    """Exact pieces, and coacd's: points of a box that hulls put wrongly, or that are in several of them."""
    made = MESHES[mesh]()
    volume, start = made.report.volume, time.process_time()
    partition = collide.SpacePartition(made)
    merged = partition.convex_pieces()
    row = {"volume": volume, "pieces": len(merged), "s": time.process_time() - start,
           "unmerged": len(partition.convex_pieces(merged=False))}
    start = time.process_time()
    parts = partition.parts(merged)
    row |= {"parts_s": time.process_time() - start, "flat": parts.n_flat, "volume_off": parts.excess / parts.volume}
    if not installed(coacd="coacd"):
        return [row]
    import coacd

    coacd.set_log_level("error")
    start = time.process_time()
    hulls = [collide.ConvexHull(v) for v, _ in coacd.run_coacd(coacd.Mesh(made.vertices, made.faces), seed=0)]
    row |= {"coacd_pieces": len(hulls), "coacd_s": time.process_time() - start,
            "coacd_volume_off": sum(collide.Mesh(*collide.tessellate(h)).volume for h in hulls) / volume - 1}
    low, high = made.vertices.min(axis=0) - 0.05, made.vertices.max(axis=0) + 0.05
    spots = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    held = sum(collide.contains(hull, np.eye(4), spots).astype(int) for hull in hulls)
    cell = np.prod(high - low) / len(spots) / volume
    wrong = ((held > 0) != collide.contains(made, np.eye(4), spots)).sum()
    twice = np.maximum(held - 1, 0).sum()
    return [row | {"coacd_put_wrongly": float(wrong * cell), "coacd_twice": float(twice * cell)}]


def cluttered(options: Options, family: str, size: int) -> list[dict]:
    mesh = sphere(size) if family == "bumpy sphere" else pair_of(family, **{WORST[family][0]: size})
    c, n = clutter(mesh, 200), len(mesh.faces)
    return [{"facets": n, "most": c.max_facets, "mean": c.mean, "most_over_log_n": c.max_facets / np.log2(n)}]


def sized(*families: tuple[str, tuple[int, ...]]):
    return lambda o: ({"family": name, "size": n} for name, ns in families for n in ns[: 1 if o.quick else 9])


SPHERES = ("bumpy sphere", (1000, 3000, 10_000, 30_000, 100_000))
asked = partial(Claim, everywhere=True, asked_for=True)
CLAIMS = [
    Claim("sizes", "partitions of bumpy spheres", sized(SPHERES), lambda o, family, size: [partition_of(sphere(size))],
          notes=growth_notes, everywhere=True, file="partitions-sizes"),
    asked("settings", "seeds and kappas", setting_cases, settings, file="partitions-settings"),
    asked("scans", "scans", scan_cases, lambda o, scan: [partition_of(SCANS[scan])], file="partitions-scans",
          notes=lambda rows: growth_notes(rows, "none")),
    asked("worst", "worst cases", sized(*((name, sizes) for name, (_, sizes) in WORST.items())),
          lambda o, family, size: [partition_of(pair_of(family, **{WORST[family][0]: size}))], notes=growth_notes,
          file="partitions-worst"),
    asked("points", "ns a point", lambda o: grid(mesh=[*MESHES][: 1 if o.quick else 4]), points, unit="ns", turns=5,
          file="partitions-points"),
    asked("pieces", "convex pieces", lambda o: grid(mesh=[*MESHES][: 1 if o.quick else 4]), pieces,
          file="partitions-pieces"),
    asked("clutter", "facets in a cube without guards", sized(("bumpy sphere", (1000, 10_000, 100_000)), (
          "harpsicordia", (1000, 10_000)), ("chazelle", (10, 40, 160))), cluttered, file="partitions-clutter"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
