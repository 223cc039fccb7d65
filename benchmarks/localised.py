"""Meshes made local: facets that boxes n × n × 1 and cylinders take, CAD parts before and after, does it pay?

    python benchmarks/localised.py   # two minutes; --parts growth cylinders parts picture, --files 20

* growth: facets of the box n × n × 1, n = 2 … 2^20, with a + b · log2 n fitted.
* cylinders: facets of cylinders of n sides beside the estimate that is made before the first cut.
* parts: every so many of the mesh files of pybullet_data: stretches and facets before and after; boxes of the trees
  looked at and pairs of facets tested by queries about two copies of the part, and µs a query, before and after.

* picture: writes docs/pictures/localised.png (needs matplotlib and pybullet_data).

Counts are the same on every machine.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "tests" / "families")]
import surfaces
from meshes import rotation, touching

import collide
from collide import CollideError, Mesh
from collide.mesh.facet_pieces import edges_of
from collide.mesh.predicted_facets import predicted_facets
from collide.narrowphase.facets.facet_queries import all_hits, first_hits
from collide.scenes.loaders.triangles import read_meshes

#: Facets of the parts that are looked at, and what a part may grow to.
MIN_FACETS, MAX_FACETS, GROWTH = 100, 5000, 10
#: Pairs of poses in touch, and of booleans that are timed.
POSES, BOOLEANS = 6, 100


def growth() -> None:
    counts = []
    for k in range(1, 21):
        n = 2.0**k
        made = Mesh(*surfaces.box((0, 0, 0), (n, n, 1.0))).localised()
        counts.append(len(made.mesh.faces))
        before, after = made.before.local_stretches[0], made.after.local_stretches[0]
        print(f"2^{k:<2} × 2^{k:<2} × 1: σ {before:11.6g} → {after:5.3f}, "
              f"{counts[-1]:5} facets, moved {made.moved:g}", flush=True)  # fmt: skip
    slope, start = np.polyfit(np.arange(1, 21), counts, 1)
    over = max((count - 12) / k for k, count in enumerate(counts, 1))
    print(f"facets ≈ {start:.0f} + {slope:.1f} log2 n; at most 12 + {over:.1f} log2 n")


def cylinders() -> None:
    for sides in (32, 64, 128, 256, 1024, 8192):
        vertices, faces = surfaces.striped_cylinder(sides)
        ends = edges_of(faces, np.arange(len(faces))).ends
        for stretch in (10.0, 20.0):
            estimate = predicted_facets(vertices, ends, len(faces), stretch, 1)
            text = f"{sides:5} sides, {len(faces):6} facets, σ ≤ {stretch:g}: estimated {estimate:9}"
            if sides <= 256:
                made = len(Mesh(vertices, faces).localised(stretch).mesh.faces)
                text += f", made {made:6}, {made / sides**2:.3f} n²"
            print(text, flush=True)


def parts(files: int) -> None:
    try:
        import pybullet_data
    except ImportError:
        print("pybullet_data is not installed (pip install 'collide-robotics[peers]'): left out")
        return
    root = Path(pybullet_data.getDataPath())
    suffixes = (".stl", ".obj", ".dae")
    places = sorted(p for p in root.rglob("*") if p.suffix.lower() in suffixes and "random" not in str(p))
    np.random.default_rng(1).shuffle(places)
    rows = []
    for place in places:
        if len(rows) == files:
            break
        try:
            _, surface = read_meshes(place)[0]
            if MIN_FACETS <= len(surface.faces) <= MAX_FACETS:
                rows.append(part(str(place.relative_to(root)), Mesh(surface.vertices, surface.faces)))
        except CollideError as error:
            print(f"{place.relative_to(root)}: {error}")
    made = [row for row in rows if row]
    print(f"{len(made)} of {len(rows)} parts made local at stretch 10, order 1")
    for key in ("shells", "shallow", "boolean", "us"):
        ratios = [row[key] for row in made]
        print(f"{key}: after over before, median {np.median(ratios):.2f}, from {min(ratios):.2f} to {max(ratios):.2f}, "
              f"less in {sum(r < 1 for r in ratios)}")  # fmt: skip


def part(name: str, mesh: Mesh) -> dict | None:
    """Ratios after over before of what queries cost in all; None where σ ≤ 10 is not had."""
    before = mesh.locality()
    text = f"{name[-44:]:44} {len(mesh.faces):5} facets Σ {before.global_stretch:9.4g} "
    text += f"σ {before.local_stretches[0]:9.4g} σ10 {before.local_stretches[9]:6.3g} →"
    try:
        made = mesh.localised(max_facets=GROWTH * len(mesh.faces) + 1000)
    except CollideError as error:
        print(text, str(error).split(": ", 1)[1][:100], flush=True)
        return None
    after = made.after
    text += f" {len(made.mesh.faces):6} Σ {after.global_stretch:9.4g} σ {after.local_stretches[0]:6.3g} "
    text += f"σ10 {after.local_stretches[9]:6.3g} moved {made.moved:.1e}"
    ratios = cost_ratios(mesh, made.mesh)
    print(text, "; cost after/before", " ".join(f"{key} {ratio:.2f}" for key, ratio in ratios.items()), flush=True)
    return ratios


def cost_ratios(old: Mesh, new: Mesh) -> dict[str, float]:
    """Pairs of boxes and of facets looked at, and µs, by the same questions about two copies of the part: new over old.

    shells : all pairs of facets of copies nearly alike; shallow : of copies 1e-3 deep in each other; boolean : of
    copies 1e-4 apart; us : booleans of copies near one another. Lengths are of the part's diagonal.
    """
    diagonal = float(np.linalg.norm(np.ptp(old.vertices[old.faces].reshape(-1, 3), axis=0)))
    bodies = [mesh.scaled(1.0 / diagonal) for mesh in (old, new)]
    rng = np.random.default_rng(1)
    small = 1e-3 * np.cross(np.eye(3), rng.standard_normal(3))
    shift = collide.pose(1e-3 * rng.standard_normal(3))
    shift[:3, :3] = np.linalg.qr(np.eye(3) + small)[0]
    shift[:3, :3] *= np.sign(np.diag(shift[:3, :3]))
    questions = [("shells", all_hits, np.eye(4), shift)]
    for _ in range(POSES):
        X, Y, direction, way = touching(bodies[0].tree, bodies[0].tree, rng)
        for name, ask, further in (("shallow", all_hits, -1e-3), ("boolean", first_hits, 1e-4)):
            moved = Y.copy()
            moved[:3, 3] = X[:3, 3] + (way + further) * direction
            questions.append((name, ask, X, moved))
    totals = [{"shells": 0, "shallow": 0, "boolean": 0, "us": 0.0} for _ in bodies]
    for body, total in zip(bodies, totals):
        for name, ask, X, Y in questions:
            total[name] += int(ask(body.tree, body.tree, X, Y).counters[0, :2].sum())
    X_WBs = np.tile(np.eye(4), (BOOLEANS, 1, 1))
    for X in X_WBs:
        X[:3, :3], X[:3, 3] = rotation(rng), 0.5 * rng.standard_normal(3)
    times = np.zeros((6, 2))
    for run in times:  # the first warms up
        for k, body in enumerate(bodies):
            started = time.process_time()
            collide.collide(body, body, np.eye(4), X_WBs)
            run[k] = time.process_time() - started
    for total, seconds in zip(totals, np.median(times[1:], axis=0)):
        total["us"] = 1e6 * float(seconds) / BOOLEANS
    return {name: totals[1][name] / totals[0][name] for name in totals[0]}


def picture() -> None:
    """A box and a part, before and after, facets that face the eye."""
    import pybullet_data
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    surface = read_meshes(next(Path(pybullet_data.getDataPath()).rglob("fr12_h103_lowres.stl")))[0][1]
    figure = Figure(figsize=(11, 7), layout="constrained")
    axes = figure.subplots(2, 2, subplot_kw={"projection": "3d"})
    elevation, azimuth = np.radians(50.0), np.radians(35.0)
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    bodies = (("64 × 64 × 1 box", Mesh(*surfaces.box((0, 0, 0), (64.0, 64.0, 1.0)))),
              ("fr12_h103_lowres.stl", Mesh(surface.vertices, surface.faces)))  # fmt: skip
    for panels, (name, body) in zip(axes, bodies):
        made = body.localised()
        for panel, mesh, locality in zip(panels, (body, made.mesh), (made.before, made.after)):
            corners = mesh.vertices[mesh.faces]
            low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
            faces_eye = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ towards > 0.0
            panel.add_collection3d(
                Poly3DCollection(corners[faces_eye], facecolors="#dbe8f5", edgecolors="#16324f", linewidths=0.35)
            )
            panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
            panel.set_box_aspect(high - low, zoom=0.95)
            panel.set_axis_off()
            panel.view_init(np.degrees(elevation), np.degrees(azimuth))
            panel.set_title(f"{name}: {len(mesh.faces)} facets, σ = {locality.local_stretches[0]:.1f}", fontsize=10)
    figure.savefig(Path(__file__).parents[1] / "docs" / "pictures" / "localised.png", dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", default=["growth", "cylinders", "parts"])
    parser.add_argument("--files", type=int, default=24, help="files of pybullet_data")
    args = parser.parse_args()
    for name in args.parts:
        {"growth": growth, "cylinders": cylinders, "parts": lambda: parts(args.files), "picture": picture}[name]()


if __name__ == "__main__":
    main()
