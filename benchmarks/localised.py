"""Meshes made local: facets that boxes n × n × 1 and cylinders take, CAD parts before and after, does it pay?

    python benchmarks/localised.py   # two minutes; --files 20

growth      facets of the box n × n × 1, n = 2 … 2^20, with a + b · log2 n fitted
cylinders   facets of cylinders of n sides beside the estimate that is made before the first cut
parts       files of pybullet_data: stretches and facets before and after; boxes of the trees and pairs of facets that
            queries about two copies of the part look at, and µs a query, after over before: "shells", all pairs of
            facets of copies nearly alike; "shallow", of copies 1e-3 deep in each other; "boolean", of copies 1e-4
            apart; "us", booleans of copies near one another

Counts are the same on every machine.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from inputs import poses, touching, use_tests

use_tests("families")
import surfaces

import collide
from collide import CollideError, Mesh
from collide.adapters.bench.claims import Claim, Options, grid, installed, main
from collide.adapters.bench.growth import line_fit
from collide.adapters.bench.turns import race
from collide.mesh.facet_pieces import edges_of
from collide.mesh.predicted_facets import predicted_facets
from collide.narrowphase.facets.facet_queries import all_hits, first_hits
from collide.scenes.loaders.triangles import read_meshes

#: Facets of the parts that are looked at, and what a part may grow to.
MIN_FACETS, MAX_FACETS, GROWTH = 100, 5000, 10
#: Pairs of poses in touch, and of booleans that are timed.
POSES, BOOLEANS = 6, 100


def growth(options: Options, log2_n: int) -> list[dict]:
    made = Mesh(*surfaces.box((0, 0, 0), (2.0**log2_n, 2.0**log2_n, 1.0))).localised()
    return [{"before": made.before.local_stretches[0], "after": made.after.local_stretches[0],
             "facets": len(made.mesh.faces), "moved": made.moved}]


def growth_notes(rows):
    fit = line_fit([row["log2_n"] for row in rows], [row["facets"] for row in rows])
    over = max((row["facets"] - 12) / row["log2_n"] for row in rows)
    yield f"facets ≈ {fit.start:.0f} + {fit.slope:.1f} log2 n; at most 12 + {over:.1f} log2 n"


def cylinders(options: Options, sides: int, stretch: float) -> list[dict]:
    vertices, faces = surfaces.striped_cylinder(sides)
    ends = edges_of(faces, np.arange(len(faces))).ends
    row = {"facets": len(faces), "estimated": int(predicted_facets(vertices, ends, len(faces), stretch, 1))}
    if sides > 256:
        return [row]
    made = len(Mesh(vertices, faces).localised(stretch).mesh.faces)
    return [row | {"made": made, "over_n2": made / sides**2}]


PARTS: dict[str, Mesh] = {}


def part_cases(options: Options):
    if not installed(pybullet_data="pybullet_data"):
        return
    import pybullet_data

    root = Path(pybullet_data.getDataPath())
    suffixes = (".stl", ".obj", ".dae")
    places = sorted(p for p in root.rglob("*") if p.suffix.lower() in suffixes and "random" not in str(p))
    np.random.default_rng(1).shuffle(places)
    for place in places:
        if len(PARTS) == (2 if options.quick else options.files):
            break
        try:
            _, surface = read_meshes(place)[0]
        except CollideError:
            continue
        if MIN_FACETS <= len(surface.faces) <= MAX_FACETS:
            PARTS[str(place.relative_to(root))] = Mesh(surface.vertices, surface.faces)
            yield {"part": str(place.relative_to(root))}


def parts(options: Options, part: str) -> list[dict]:
    """Empty columns where σ ≤ 10 is not had."""
    mesh = PARTS[part]
    row: dict = {"facets": len(mesh.faces)}
    stretches = {"before": mesh.locality()}
    try:
        made = mesh.localised(max_facets=GROWTH * len(mesh.faces) + 1000)
        stretches["after"] = made.after
        row |= {"made": len(made.mesh.faces), "moved": made.moved} | cost_ratios(mesh, made.mesh)
    except CollideError as error:
        row["why"] = str(error).split(": ", 1)[1][:100]
    for when, locality in stretches.items():
        row |= {f"Σ_{when}": locality.global_stretch, f"σ_{when}": locality.local_stretches[0],
                f"σ10_{when}": locality.local_stretches[9]}
    return [row]


def cost_ratios(old: Mesh, new: Mesh) -> dict[str, float]:
    """Pairs of boxes and of facets looked at, and µs, by the same questions about two copies of the part: new over old.
    Lengths are of the part's diagonal."""
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
    X_WBs = poses(rng, BOOLEANS, 0.0)
    X_WBs[:, :3, 3] = 0.5 * rng.standard_normal((BOOLEANS, 3))
    tasks = {str(k): lambda b=b: collide.collide(b, b, np.eye(4), X_WBs) for k, b in enumerate(bodies)}
    taken = race(tasks, max_turns=5)
    for total, seconds in zip(totals, taken.values()):
        total["us"] = 1e6 * float(np.median(seconds)) / BOOLEANS
    return {name: totals[1][name] / totals[0][name] for name in totals[0]}


def part_notes(rows):
    made = [row for row in rows if "made" in row]
    yield f"{len(made)} of {len(rows)} parts made local at stretch 10, order 1"
    for key in ("shells", "shallow", "boolean", "us") if made else ():
        ratios = [row[key] for row in made]
        yield (f"{key}: after over before, median {np.median(ratios):.2f}, from {min(ratios):.2f} to "
               f"{max(ratios):.2f}, less in {sum(r < 1 for r in ratios)}")


CLAIMS = [
    Claim("growth", "boxes n × n × 1", lambda o: grid(log2_n=range(1, 6 if o.quick else 21)), growth,
          notes=growth_notes, file="localised-growth", everywhere=True),
    Claim("cylinders", "facets made and estimated", lambda o: grid(
        sides=(32, 64, 128, 256, 1024, 8192)[: 2 if o.quick else None], stretch=(10.0, 20.0)), cylinders,
          file="localised-cylinders", everywhere=True),
    Claim("parts", "CAD parts", part_cases, parts, notes=part_notes, file="localised-parts", everywhere=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS, lambda parser: parser.add_argument("--files", type=int, default=24, help="of pybullet_data"))
