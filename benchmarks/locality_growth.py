"""What locality says about the time of mesh queries, counted: growth on the worst cases, and trees.

    python benchmarks/locality_growth.py         # three minutes
    python benchmarks/locality_growth.py --table growth --plot docs/pictures/locality-growth.png

growth   nodes that the walk compares with a box (one against up to eight) and pairs of facets that it tests for all
         pairs of facets, on harpsicordia (local: n log n is proven; with Σ = n, and with Σ ≤ 1000 whatever n, where
         meetings are linear), accordions and Chazelle's polyhedra (not local: n² is proven), touching and 1e-12 apart
build    seconds of both trees up to a million facets, over n log2 n
walks    pairs of boxes and of facets that the walk of theorem 3.6 looks at on its own tree, the graded one, and on the
         tree of queries, both counted by the same loop, beside what queries themselves count, with B as it stands,
         turned, and turned and scaled; some minutes

Counts are the same on every machine.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from inputs import mesh, meshes_here, rotation

from collide import Mesh
from collide.adapters.bench.claims import Claim, Options, Race, grid, main
from collide.adapters.bench.growth import Panel, groups, power_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import all_hits
from collide.papers.hierarchies.graded_tree import graded_tree
from collide.papers.hierarchies.graded_walk import boxes_of_graded, boxes_of_queries, count_walk
from collide.scenes.worst_cases import accordion, below, chazelle, harpsicordia

SIZES = {
    "harpsicordia": [1000 * 2**k for k in range(9)],
    "harpsicordia, Σ 1000": [1000 * 2**k for k in range(8)],
    "accordions": [8 * 2**k for k in range(7)],
    "chazelle": [8 * 2**k for k in range(7)],
}


def worst_case(family: str, size: int) -> tuple[Mesh, Mesh, int]:
    """(A, B, meetings)."""
    if family.startswith("harpsicordia"):
        return harpsicordia(size, 10.0, None if family == "harpsicordia" else 1000.0)
    mesh = {"accordions": accordion, "chazelle": chazelle}[family](size)
    return mesh, below(mesh), size**2


def growth(options: Options, family: str, size: int, gap: float) -> list[dict]:
    A, B, meetings = worst_case(family, size)
    X = np.eye(4)
    X[2, 3] = gap
    hits = all_hits(A.tree, B.tree, X, np.eye(4))
    nodes, tested, exact = hits.counters[0].tolist()
    return [{"vertices": len(A.vertices), "meetings": meetings, "pairs": len(hits.pairs), "nodes": nodes,
             "facet_pairs": tested, "exact": exact}]


def growth_notes(rows):
    for (family, gap), some in groups(rows, "family", "gap"):
        some = some[-5:]
        n = np.array([row["vertices"] for row in some], dtype=float)
        units = {"n²": n**2}
        if family.startswith("harpsicordia"):
            units = {"n log2 n": n * np.log2(n), "meetings": np.array([row["meetings"] for row in some])}
        for what in ("nodes", "facet_pairs"):
            counts = np.array([row[what] for row in some], dtype=float)
            over = "; ".join(f"over {u}: {', '.join(f'{x:.3f}' for x in counts / size)}" for u, size in units.items())
            power = power_of(n, counts) if len(n) > 1 else np.nan
            yield f"{family}, gap {gap:g}: {what} n^{power:.2f}; {over}"


def growth_cases(options: Options):
    for family, sizes in SIZES.items():
        yield from grid(family=[family], size=sizes[: 2 if options.quick else None], gap=(0.0, 1e-12))


def build(options: Options, facets: int) -> Race:
    vertices, faces = sphere(facets)
    n, size = len(faces), graded_tree(vertices, faces).size()
    tasks = {"queries": lambda: build_mesh_tree(vertices, faces), "graded": lambda: graded_tree(vertices, faces)}
    return Race(tasks, columns={"F": n, "F_log2_F": int(n * np.log2(n)), "graded_over_2F": size / (2 * n - 1)})


def build_notes(rows):
    for row in rows:
        yield f"{row['engine']}, {row['F']:,}: {row['median_s'] * 1e9 / row['F_log2_F']:.1f} ns · F log2 F"


@cache
def bodies(name: str) -> tuple[Mesh, Mesh, int]:
    if name.startswith("harpsicordia"):
        return harpsicordia(int(name.split()[1]), 10.0)
    return Mesh(*mesh(name), solid=False), Mesh(*mesh(name), solid=False), 0


def walks(options: Options, bodies_of: str, motion: str) -> list[dict]:
    A, B, meetings = bodies(bodies_of)
    R = rotation(np.random.default_rng(5))
    X, n, rows = np.eye(4), len(A.vertices), []
    if motion != "none":
        X[:3, :3] += 0.02 * (R - R.T)
        X[:3, :3] *= 1.25 if motion.endswith("scaled 1.25") else 1.0
    nodes, tested, _ = all_hits(A.tree, B.tree, np.eye(4), X).counters[0].tolist()
    for kind in ("graded, cubes", "graded, tight", "queries"):
        trees = [
            boxes_of_queries(b.tree, b.vertices, b.faces) if kind == "queries"
            else boxes_of_graded(graded_tree(b.vertices, b.faces), b.vertices, b.faces, kind == "graded, tight")
            for b in (A, B)
        ]
        counts = count_walk(*trees, X)
        over = counts.meeting / (n * np.log2(n))
        rows.append({"tree": kind, "vertices": n, "meetings": meetings, **counts._asdict(), "default_nodes": nodes,
                     "meeting_over_nlogn": over, "default_facet_pairs": tested})
    return rows


def walk_cases(options: Options):
    names = [f"harpsicordia {n}" for n in (1000, 4000, 16_000, 64_000, 110_000)]
    names += meshes_here("teapot", "bunny", "dragon 11k", "dragon 48k")
    return grid(bodies_of=names[: 1 if options.quick else None], motion=("none", "turned", "turned, scaled 1.25"))


def sphere(n: int) -> tuple[np.ndarray, np.ndarray]:
    """About n facets on a bumpy sphere: rings between two poles."""
    around, rings = max(4, int(np.sqrt(n))), max(2, n // (2 * max(4, int(np.sqrt(n)))))
    theta, phi = np.pi * (np.arange(rings) + 0.5)[:, None] / rings, 2 * np.pi * np.arange(around)[None] / around
    r = 1 + 0.1 * np.sin(3 * theta) * np.cos(5 * phi)
    vertices = np.stack([r * np.sin(theta) * np.cos(phi), r * np.sin(theta) * np.sin(phi), r * np.cos(theta)], axis=-1)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij"))
    a, b = i * around + j, i * around + (j + 1) % around
    return vertices.reshape(-1, 3), np.concatenate(
        [np.stack([a, a + around, b], 1), np.stack([b, a + around, b + around], 1)]
    )


CLAIMS = [
    Claim("growth", "what all pairs of facets look at", growth_cases, growth, notes=growth_notes, everywhere=True,
          file="locality-growth", panels=tuple(
              Panel(f"{label}, {'touching' if gap == 0 else '1e-12 apart'}", "vertices", what, "family", "xy",
                    lambda row, gap=gap: row["gap"] == gap)
              for what, label in (("nodes", "nodes compared"), ("facet_pairs", "facets tested"))
              for gap in (0.0, 1e-12))),
    Claim("build", "s of building trees", lambda o: [
        {"facets": n} for n in (1000, 4000, 16_000, 64_000, 256_000, 1_024_000)[: 2 if o.quick else None]],
          build, unit="s", turns=3, notes=build_notes, everywhere=True, file="locality-build"),
    Claim("walks", "the walk of theorem 3.6", walk_cases, walks, everywhere=True, file="locality-walks"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
