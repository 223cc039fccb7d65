"""What locality says about the time of mesh queries, counted: growth on the worst cases, trees, and many meshes.

    python benchmarks/locality_growth.py         # three minutes; --parts growth build meshes, --no-files

* growth: nodes that the walk compares with a box (one against up to eight) and pairs of facets that it tests for all
  pairs of facets, on harpsicordia (local: n log n is proven; with Σ = n, and with Σ ≤ 1000 whatever n, where meetings
  are linear), accordions and Chazelle's polyhedra (not local: n² is proven), touching and 1e-12 apart, with exponents
  fitted.
* build: seconds of both trees up to a million facets, over n log2 n.
* walks: pairs of boxes and of facets that the walk of theorem 3.6 looks at on its own tree, the graded one, and on the
  tree of queries, both counted by the same loop, beside what queries themselves count, with B as it stands, turned, and
  turned and scaled; some minutes.
* meshes: stretches of all meshes of shared/data and of a sample of pybullet_data's, beside what queries about them look
  at; rank correlations between the two.

Writes benchmarks/results/locality-*.csv and docs/pictures/locality-*.png. Counts are the same on every machine.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from meshes import DATA, FILES, RESULTS, mesh, rotation, touching

from collide import CollideError, Mesh
from collide.hierarchies.graded_tree import graded_tree
from collide.hierarchies.graded_walk import BoxHierarchy, boxes_of_graded, boxes_of_queries, count_walk
from collide.hierarchies.tree_figures import tree_figures
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import all_hits, first_hits
from collide.scenes.loaders.triangles import read_meshes
from collide.scenes.worst_cases import accordion, below, chazelle, harpsicordia

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
SIZES = {
    "harpsicordia": [1000 * 2**k for k in range(9)],
    "harpsicordia, Σ 1000": [1000 * 2**k for k in range(8)],
    "accordions": [8 * 2**k for k in range(7)],
    "chazelle": [8 * 2**k for k in range(7)],
}
#: Of pybullet_data: every so many of its files in order of names, and facets within these.
EVERY, MIN_VERTICES, MAX_VERTICES = 3, 200, 120_000
POSES = 6


def worst_case(family: str, size: int) -> tuple[Mesh, Mesh, int]:
    """(A, B, meetings)."""
    if family.startswith("harpsicordia"):
        return harpsicordia(size, 10.0, None if family == "harpsicordia" else 1000.0)
    mesh = {"accordions": accordion, "chazelle": chazelle}[family](size)
    return mesh, below(mesh), size**2


def growth() -> list[dict]:
    """Rows of counts, family by family."""
    rows = []
    for family, sizes in SIZES.items():
        for size in sizes:
            A, B, meetings = worst_case(family, size)
            for gap in (0.0, 1e-12):
                X = np.eye(4)
                X[2, 3] = gap
                hits = all_hits(A.tree, B.tree, X, np.eye(4))
                nodes, tested, exact = hits.counters[0].tolist()
                rows.append({
                    "family": family, "gap": gap, "vertices": len(A.vertices), "meetings": meetings,
                    "pairs": len(hits.pairs),
                    "nodes": nodes, "facet_pairs": tested, "exact": exact,
                })  # fmt: skip
        for gap in (0.0, 1e-12):
            of = [r for r in rows if r["family"] == family and r["gap"] == gap][-5:]
            n = np.array([r["vertices"] for r in of], dtype=float)
            units = {"n²": n**2} if not family.startswith("harpsicordia") else {
                "n log2 n": n * np.log2(n), "n log2² n": n * np.log2(n) ** 2,
                "meetings": np.array([r["meetings"] for r in of])}  # fmt: skip
            for what in ("nodes", "facet_pairs"):
                counted = np.array([r[what] for r in of], dtype=float)
                slope = np.polyfit(np.log(n), np.log(counted), 1)[0]
                text = "; ".join(
                    f"over {unit}: {', '.join(f'{x:.3f}' for x in counted / size)}" for unit, size in units.items()
                )
                print(f"{family:20} gap {gap:5g}: {what} n^{slope:.2f}; {text}", flush=True)
    return rows


def build() -> list[dict]:
    """Seconds of both trees, the least of three."""
    rows = []
    for n in (1000, 4000, 16_000, 64_000, 256_000, 1_024_000):
        vertices, faces = sphere(n)
        taken = {}
        for name, make in (("queries", build_mesh_tree), ("graded", graded_tree)):
            times = []
            for _ in range(3):
                started = time.perf_counter()
                made = make(vertices, faces)
                times.append(time.perf_counter() - started)
            taken[name] = min(times)
        rows.append(
            {"facets": len(faces), **{f"{k}_s": f"{t:.5f}" for k, t in taken.items()}, "graded_size": made.size()}
        )
        each = {k: t / (len(faces) * np.log2(len(faces))) * 1e9 for k, t in taken.items()}
        print(
            f"{len(faces):8} facets: {taken['queries']:.4f} s, graded {taken['graded']:.4f} s; "
            f"{each['queries']:.1f}, {each['graded']:.1f} ns · F log2 F; nodes "
            f"{made.size() / (2 * len(faces) - 1):.2f} (2F − 1)"
        )
    return rows


def walks() -> list[dict]:
    """Rows of counts of `graded_walk.py`: a pair of meshes, a motion and a tree each."""
    rows = []
    scans = [name for name in ("teapot", "bunny", "dragon 11k", "dragon 48k") if DATA.is_dir()]
    bodies = [(f"harpsicordia {n}", *harpsicordia(n, 10.0)) for n in (1000, 4000, 16_000, 64_000, 110_000)]
    bodies += [(name, Mesh(*mesh(name), solid=False), Mesh(*mesh(name), solid=False), 0) for name in scans]
    R_turned = rotation(np.random.default_rng(5))
    small = 0.02 * (R_turned - R_turned.T)
    for name, A, B, meetings in bodies:
        trees = {
            kind: [make(body) for body in (A, B)] for kind, make in (
                ("graded, cubes", lambda b: _graded(b, False)), ("graded, tight", lambda b: _graded(b, True)),
                ("queries", lambda b: boxes_of_queries(b.tree, b.vertices, b.faces)),
            )
        }  # fmt: skip
        for motion, R in (
            ("none", np.eye(3)), ("turned", np.eye(3) + small), ("turned, scaled 1.25", 1.25 * (np.eye(3) + small))
        ):  # fmt: skip
            X = np.eye(4)
            X[:3, :3] = R
            nodes, tested, _ = all_hits(A.tree, B.tree, np.eye(4), X).counters[0].tolist()
            for kind, (a, b) in trees.items():
                counts = count_walk(a, b, X)
                n = len(A.vertices)
                rows.append({
                    "bodies": name, "vertices": n, "meetings": meetings, "motion": motion, "tree": kind,
                    **counts._asdict(), "meeting_over_nlogn": f"{counts.meeting / (n * np.log2(n)):.3f}",
                    "default_nodes": nodes, "default_facet_pairs": tested,
                })  # fmt: skip
                print(" ".join(str(value) for value in rows[-1].values()), flush=True)
    return rows


def _graded(body: Mesh, tight: bool) -> BoxHierarchy:
    return boxes_of_graded(graded_tree(body.vertices, body.faces), body.vertices, body.faces, tight)


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


# --- many meshes --------------------------------------------------------------------------------


def all_meshes() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Name to (vertices, faces), box diagonals 1."""
    by_name = {name: mesh(name) for name in FILES if name != "dragon 871k"} if DATA.is_dir() else {}
    if not by_name:
        print("shared/data is not beside this checkout: left out")
    try:
        import pybullet_data
    except ImportError:
        print("pybullet_data is not installed (pip install 'collide-robotics[peers]'): left out")
        return by_name
    root = Path(pybullet_data.getDataPath())
    files = sorted(f for kind in ("obj", "stl") for f in root.rglob(f"*.{kind}"))
    for file in files[::EVERY]:
        try:
            parts = read_meshes(str(file))
        except CollideError:
            continue
        for _, part in parts[:1]:
            if MIN_VERTICES <= len(part.faces) <= MAX_VERTICES:
                used = part.vertices[part.faces].reshape(-1, 3)
                low, high = used.min(axis=0), used.max(axis=0)
                by_name[file.relative_to(root).as_posix()] = (
                    (part.vertices - (low + high) / 2) / np.linalg.norm(high - low),
                    part.faces,
                )
    return by_name


def meshes() -> list[dict]:
    """Rows of stretches and counts, a mesh each."""
    rows = []
    for name, (vertices, faces) in all_meshes().items():
        mesh = Mesh(vertices, faces, solid=False)
        locality, trees = mesh.locality(), tree_figures(mesh)
        spread = locality.quantiles([0.5, 0.9])
        rows.append({
            "mesh": name, "facets": len(faces), "Σ": locality.global_stretch, "σ": locality.local_stretches[0],
            "σ4": locality.local_stretches[3], "σ10": locality.local_stretches[9], "σ mean": locality.means[0],
            "σ10 mean": locality.means[9], "σ10 90 %": spread[1, 9], "outliers": trees.outlier_share,
            "graded depth": trees.graded_depth,
            **{key: float(f"{value:.6g}") for key, value in counted(mesh).items()},
        })  # fmt: skip
        print(f"{name[-40:]:40} {len(faces):7} σ {rows[-1]['σ']:9.3g} σ10 {rows[-1]['σ10']:8.3g} "
              f"shells {rows[-1]['shells']:6.1f} shallow {rows[-1]['shallow']:8.4f} boolean {rows[-1]['boolean']:7.1f}",
              flush=True)  # fmt: skip
    return rows


def counted(mesh: Mesh) -> dict[str, float]:
    """Pairs of boxes and of facets looked at: a facet, of two shells nearly alike and of shallow overlaps, all pairs; a
    boolean at a gap of 1e-4, whole."""
    rng = np.random.default_rng(1)
    tree = mesh.tree
    shift = np.eye(4)
    R = rotation(rng)
    small = 1e-3 * (R - R.T)
    shift[:3, :3] = np.eye(3) + small + small @ small / 2
    shift[:3, 3] = 1e-3 * rng.normal(size=3)
    shells = all_hits(tree, tree, np.eye(4), shift).counters[0, :2].sum()
    shallow, boolean = [], []
    for _ in range(POSES):
        X, Y, direction, way = touching(tree, tree, rng)
        for further, into, ask in ((-1e-3, shallow, all_hits), (1e-4, boolean, first_hits)):
            Y[:3, 3] = X[:3, 3] + (way + further) * direction
            into.append(int(ask(tree, tree, X, Y).counters[0, :2].sum()))
    return {
        "shells": shells / len(mesh.faces), "shallow": float(np.mean(shallow)) / len(mesh.faces),
        "boolean": float(np.mean(boolean)),
        "shallow / √F": float(np.mean(shallow)) / np.sqrt(len(mesh.faces)),
    }  # fmt: skip


MEASURES = ("facets", "Σ", "σ", "σ4", "σ10", "σ mean", "σ10 mean", "σ10 90 %", "outliers")
COSTS = ("shells", "shallow / √F", "boolean")


def ranks(values) -> np.ndarray:
    """Ranks, those of equal values their mean."""
    values = np.asarray(values, dtype=float)
    return np.array([(values < v).sum() + 0.5 * ((values == v).sum() - 1) for v in values])


def correlated(rows: list[dict]) -> list[dict]:
    """Spearman's rank correlations of every measure with every cost."""
    table = []
    print(f"rank correlations over {len(rows)} meshes:  " + "  ".join(f"{c:>12}" for c in COSTS))
    for measure in MEASURES:
        a = ranks([r[measure] for r in rows])
        correlations = {c: float(np.corrcoef(a, ranks([r[c] for r in rows]))[0, 1]) for c in COSTS}
        table.append({"measure": measure, "meshes": len(rows), **{c: f"{v:.2f}" for c, v in correlations.items()}})
        print(f"{measure:>30}          " + "  ".join(f"{v:12.2f}" for v in correlations.values()))
    return table


# --- files --------------------------------------------------------------------------------------


def write(name: str, rows: list[dict]) -> None:
    with open(RESULTS / f"{name}.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def draw_growth(rows: list[dict]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(10, 4.2), sharex=True, layout="constrained")
    for axes, what, label, local, square in zip(
        panels, ("nodes", "facet_pairs"), ("nodes compared with a box", "pairs of facets tested"), (1, 4), (0.05, 0.3)
    ):
        for family, colour in (
            ("harpsicordia", "#3b6ea5"),
            ("harpsicordia, Σ 1000", "#d9a441"),
            ("accordions", "#c0504d"),
            ("chazelle", "#4f8a4f"),
        ):
            for gap, style in ((0.0, "o-"), (1e-12, "x:")):
                of = [r for r in rows if r["family"] == family and r["gap"] == gap]
                name = f"{family}, {'touching' if gap == 0 else '1e-12 apart'}"
                x, y = [r["vertices"] for r in of], [r[what] for r in of]
                axes.loglog(x, y, style, color=colour, label=name, markersize=4)
        n = np.array([60.0, 2e5])
        axes.loglog(n, local * n * np.log2(n), color="#9a9a9a", linewidth=0.8)
        axes.text(n[1], local * n[1] * np.log2(n[1]) / 2.5, f"{local} n log n", fontsize=8, ha="right")
        n = np.array([60.0, 6e3])
        axes.loglog(n, square * n**2, color="#9a9a9a", linewidth=0.8)
        axes.text(n[1], square * n[1] ** 2, f" {square:g} n²", fontsize=8, va="center")
        axes.set(xlabel="vertices of each mesh", ylabel=label, title="all pairs of facets")
    panels[0].legend(fontsize=8)
    figure.savefig(PICTURES / "locality-growth.png", dpi=130)


def draw_meshes(rows: list[dict]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(8, 3.6), sharey=True, layout="constrained")
    for panel, measure in zip(panels, ("σ", "σ10 mean")):
        panel.loglog([r[measure] for r in rows], [r["shells"] for r in rows], ".", color="#3b6ea5")
        panel.set_xlabel(f"{measure} of the mesh")
    panels[0].set_ylabel("pairs looked at, a facet\ntwo shells nearly alike, all pairs")
    figure.savefig(PICTURES / "locality-meshes.png", dpi=130)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument(
        "--parts", nargs="*", default=["growth", "build", "walks", "meshes"],
        choices=["growth", "build", "walks", "meshes"],
    )
    parser.add_argument("--no-files", action="store_true")
    options = parser.parse_args()
    for part in options.parts:
        rows = {"growth": growth, "build": build, "walks": walks, "meshes": meshes}[part]()
        if part == "meshes" and rows:
            correlations = correlated(rows)
        if options.no_files or not rows:
            continue
        write(f"locality-{part}", rows)
        if part == "growth":
            draw_growth(rows)
        if part == "meshes":
            write("locality-correlations", correlations)
            draw_meshes(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
