"""Space partitions: how large they get, how quickly points are located, and convex pieces beside coacd's.

    python benchmarks/partitions.py --part sizes      cells over n log n and depth, 10^3 to 10^5 facets; seeds; kappa
    python benchmarks/partitions.py --part scans      the same of meshes in shared/data, reduced or whole
    python benchmarks/partitions.py --part worst      harpsicordia beside Chazelle's polyhedra and accordions
    python benchmarks/partitions.py --part points     10^5 points a mesh, as `contains` has them, and ns a point
    python benchmarks/partitions.py --part pieces     convex pieces beside coacd's: how many, volumes
    python benchmarks/partitions.py --part clutter    facets that cubes without guards meet
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import collide
from collide.partitions.clutter import clutter
from collide.scenes import generate

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "families"), str(ROOT / "tests" / "oracles")]
from mesh_shapes import block_ring, bumpy_sphere


def sphere(n: int, seed: int = 0) -> collide.Mesh:
    return collide.Mesh(*bumpy_sphere(n, seed), solid=True)


def row(name: str, mesh: collide.Mesh, **arguments) -> collide.SpacePartition:
    """One line about a partition."""
    start = time.process_time()
    partition = collide.SpacePartition(mesh, **arguments)
    seconds = time.process_time() - start
    s = partition.size
    n = s.facets
    print(
        f"| {name} | {n:,} | {s.kappa} | {s.cells:,} | {s.cells / n:.2f} | {s.cells / (n * np.log2(n)):.3f} "
        f"| {s.cells / n**2:.5f} | {s.depth}, {s.mean_depth:.1f} | {s.depth / np.log2(n):.2f} | {s.first_cells:,} "
        f"| {s.max_facets}, {s.pieces / s.first_cells:.1f} | {s.integers:,}, {s.fractions} | {seconds:.2f} |",
        flush=True,
    )
    return partition


def head() -> None:
    print(
        "| mesh | facets n | kappa | cells | / n | / n log2 n | / n² | depth, mean | / log2 n | first level "
        "| facets in one, mean | integers, fractions | s |\n" + "|---" * 13 + "|"
    )


def fit(sizes: list[tuple[int, int, int]]) -> None:
    """sizes : (facets, cells, depth)."""
    n, cells, depth = np.array(sizes, dtype=float).T
    power = np.polyfit(np.log(n), np.log(cells), 1)[0]
    b, a = np.polyfit(np.log2(n), depth, 1)
    ratio = cells / (n * np.log2(n))
    print(f"\ncells: n^{power:.3f}; over n log2 n from {ratio.min():.3f} to {ratio.max():.3f}, a factor of "
          f"{ratio.max() / ratio.min():.2f}; depth: {a:.1f} + {b:.2f} log2 n\n")  # fmt: skip


def sizes(largest: int) -> None:
    head()
    results = []
    for n in (1000, 3000, 10_000, 30_000, 100_000):
        if n <= largest:
            s = row(f"bumpy sphere, {n:,}", sphere(n)).size
            results.append((s.facets, s.cells, s.depth))
    fit(results)
    head()
    for seed in range(5):
        row(f"seed {seed}", sphere(3000), seed=seed)
    for kappa in (8, 16, 32, 64, 128, 256, 1024):
        row("bumpy sphere", sphere(10_000), kappa=kappa)


def scans() -> None:
    head()
    results = []
    for name, mesh in scan_meshes():
        if len(mesh.faces) <= 120_000:
            s = row(name, mesh).size
            results.append((s.facets, s.cells, s.depth))
    fit(results)


def scan_meshes():
    """Solid meshes of shared/data, by size."""
    from collide.scenes.loaders.mesh_file import read_mesh

    folder = next((p for p in (ROOT.parent / "shared", ROOT / "shared") if p.exists()), None)
    meshes = []
    for path in sorted((folder / "data").rglob("*")) if folder else []:
        if path.suffix not in (".ply", ".obj", ".stl", ".off") or path.stat().st_size > 30e6:
            continue
        try:
            parts = read_mesh(path).parts
        except collide.CollideError:
            continue
        for part in parts:
            if part.closed and part.facets is not None and part.faces >= 500:
                meshes.append((path.stem, collide.Mesh(part.points, part.facets, solid=True)))
    return sorted(meshes, key=lambda item: len(item[1].faces))


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


def worst() -> None:
    for family, name, values in (
        ("harpsicordia", "n", (150, 500, 1500)),
        ("chazelle", "strings", (10, 20, 40, 80)),
        ("accordions", "strings", (10, 20, 40, 80)),
    ):
        head()
        results = []
        for value in values:
            s = row(f"{family} {value}", pair_of(family, **{name: value})).size
            results.append((s.facets, s.cells, s.depth))
        fit(results)


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


def points(runs: int) -> None:
    print("| mesh | points | inside | on the boundary | differ from `contains` | ns a point: `locate` | `contains` |")
    print("|---" * 7 + "|")
    cases = [("bumpy sphere", sphere(n)) for n in (1000, 10_000)] + [("square ring", collide.Mesh(*block_ring()))]
    for name, mesh in cases:
        partition = collide.SpacePartition(mesh)
        every = hard_points(mesh, partition, 100_000)
        results = partition.locate(every)
        wrong = int((results.inside != collide.contains(mesh, np.eye(4), every)).sum())
        timed = every[: len(every) // 3]
        tasks = (lambda p=partition, q=timed: p.locate(q), lambda m=mesh, q=timed: collide.contains(m, np.eye(4), q))
        times = np.array([[_ns(task, len(timed)) for task in tasks] for _ in range(runs)])
        mine, theirs = np.median(times, axis=0)
        print(f"| {name}, {len(mesh.faces):,} facets | {len(every):,} | {results.inside.sum():,} "
              f"| {results.boundary.sum():,} | {wrong} | {mine:.0f} | {theirs:.0f} |", flush=True)  # fmt: skip


def _ns(task, n: int) -> float:
    start = time.process_time()
    task()
    return 1e9 * (time.process_time() - start) / n


def pieces() -> None:
    print("| mesh | volume | pieces | their volume, relative error | s | coacd: pieces | volume of hulls, error "
          "| overlaps counted twice | s |")  # fmt: skip
    print("|---" * 9 + "|")
    cases = [
        ("square ring", collide.Mesh(*block_ring())), ("bumpy sphere, 1,000", sphere(1000)),
        ("bumpy sphere, 3,000", sphere(3000)),
    ]  # fmt: skip
    for name, mesh in cases:
        volume = mesh.report.volume
        start = time.process_time()
        exact_pieces = collide.SpacePartition(mesh).convex_pieces()
        seconds = time.process_time() - start
        text = f"| {name} | {volume:.6f} | {len(exact_pieces):,} "
        text += f"| {exact_pieces.volumes.sum() / volume - 1:.1e} | {seconds:.2f} "
        print(text + coacd_columns(mesh, volume), flush=True)


def coacd_columns(mesh: collide.Mesh, volume: float) -> str:
    try:
        import coacd
    except ImportError:
        return "| pip install coacd | | | |"
    coacd.set_log_level("error")
    start = time.process_time()
    parts = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), seed=0)
    seconds = time.process_time() - start
    hulls = [collide.ConvexHull(vertices) for vertices, _ in parts]
    rng = np.random.default_rng(0)
    low, high = mesh.vertices.min(axis=0) - 0.05, mesh.vertices.max(axis=0) + 0.05
    points = rng.uniform(low, high, (20_000, 3))
    times_held = sum(collide.contains(hull, np.eye(4), points).astype(int) for hull in hulls)
    inside = collide.contains(mesh, np.eye(4), points)
    cell = np.prod(high - low) / len(points)
    wrong = ((times_held > 0) != inside).sum() * cell / volume
    twice = np.maximum(times_held - 1, 0).sum() * cell / volume
    return f"| {len(parts)} | {wrong:.1e} put wrongly, of 20,000 points | {twice:.1e} | {seconds:.2f} |"


def clutter_table() -> None:
    print("| mesh | facets | most in a cube without guards | mean | most / log2 n |")
    print("|---" * 5 + "|")
    cases = [(f"bumpy sphere {n:,}", sphere(n)) for n in (1000, 10_000, 100_000)]
    cases += [(f"harpsicordia {n:,}", pair_of("harpsicordia", n=n)) for n in (1000, 10_000)]
    cases += [(f"chazelle, {n} strings", pair_of("chazelle", strings=n)) for n in (10, 40, 160)]
    for name, mesh in cases:
        c = clutter(mesh, 200)
        n = len(mesh.faces)
        print(f"| {name} | {n:,} | {c.max_facets} | {c.mean:.1f} | {c.max_facets / np.log2(n):.2f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("sizes", "scans", "worst", "points", "pieces", "clutter"), default="sizes")
    parser.add_argument("--largest", type=int, default=100_000, help="facets of the largest mesh")
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    parts = {
        "sizes": lambda: sizes(args.largest), "scans": scans, "worst": worst, "points": lambda: points(args.runs),
        "pieces": pieces, "clutter": clutter_table,
    }  # fmt: skip
    parts[args.part]()


if __name__ == "__main__":
    main()
