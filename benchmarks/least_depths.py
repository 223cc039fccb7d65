"""Depths of unions and solids: how near the least translation that separates, and what the least one costs.

    python benchmarks/least_depths.py                  # "unions": random unions of balls, of boxes; 27 balls
    python benchmarks/least_depths.py --table parts    # overlaps of CAD parts of pybullet_data and example-robot-data

quick, least: length by the least one (of balls the arrangement's, in numpy; of boxes the lower bound): median, 9 in 10,
worst. bracket: upper end by lower end of depth="least". Of parts "quick" is by the least length known. ms: medians.
"""

from __future__ import annotations

import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from inputs import use_tests

use_tests("oracles")
from least_translations import Ball, Cuboid, least_of_balls
from naive import pose, random_pose, rng_of, rotation

import collide
from collide.adapters.bench.claims import Claim, Options, main
from collide.errors import CollideError

_I = np.eye(4)
#: Facets of parts that are asked about.
_FACETS = 20, 15_000


def union_of(parts: list) -> collide.Compound:
    items = []
    for part in parts:
        ball = isinstance(part, Ball)
        shape = collide.Sphere(part.radius) if ball else collide.Box(2 * part.half)
        items.append((shape, pose(t=part.centre) if ball else pose(part.R, part.centre)))
    return collide.Compound(items)


def random_parts(rng, kind: str) -> list:
    spread, parts = rng.uniform(0.3, 1.2), []
    for _ in range(int(rng.integers(2, 6))):
        c = spread * rng.normal(size=3)
        size = rng.uniform(0.15, 1.0, 3)
        parts.append(Ball(c, 0.3 + 0.7 * size[0]) if kind == "balls" else Cuboid(rotation(rng), c, size))
    return parts


def grid_of_balls(rng) -> tuple[list, list]:
    spacing = rng.uniform(0.45, 0.9)
    places = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
    balls = [Ball(spacing * place, 0.75 * spacing) for place in places]
    return balls, [Ball(0.7 * spacing * rng.normal(size=3) / 2, rng.uniform(0.05, 0.3))]


def asked(A, B, X_WA, X_WB) -> tuple:
    """(quick row, its ms, least row, its ms); the least one's translation is checked."""
    results = []
    for depth in ("quick", "least"):
        start = time.process_time()
        r = collide.distance(A, B, X_WA, X_WB, depth=depth)
        results += [r, 1e3 * (time.process_time() - start)]
        assert any(parts_by(A, B, X_WA, X_WB, (s - r.lower) * r.normal) for s in (0.0, 1e-13, 1e-9)), (A, B, X_WA, X_WB)
    return tuple(results)


def parts_by(A, B, X_WA, X_WB, way) -> bool:
    """Whether a translation of B parts the bodies; a little farther B may meet another part of A."""
    moved = X_WB.copy()
    moved[:3, 3] += way
    return not collide.collide(A, B, X_WA, moved)


def union_cases(options: Options):
    for kind, n in (("balls", 2000), ("boxes", 2000), ("27 balls", 40)):
        yield {"bodies": kind, "pairs": n // 20 if options.quick else n}


def unions(options: Options, bodies: str, pairs: int) -> list[dict]:
    rng, rows = rng_of("least depths", bodies), []
    while len(rows) < pairs:
        parts = grid_of_balls(rng) if bodies == "27 balls" else (random_parts(rng, bodies), random_parts(rng, bodies))
        A, B = map(union_of, parts)
        if collide.collide(A, B, _I, _I):
            quick, quick_ms, least, least_ms = asked(A, B, _I, _I)
            truth = -least.upper if bodies == "boxes" else least_of_balls(*parts)
            lengths = -quick.distance / truth, -least.distance / truth
            rows.append((*lengths, least.lower / least.upper, quick_ms, least_ms))
    return [summed_up(rows)]


def summed_up(rows: list[tuple]) -> dict:
    quick, least, bracket, quick_ms, least_ms = np.array(rows).T
    of = {}
    for name, values in (("quick", quick), ("least", least), ("bracket", bracket)):
        middle, ninth = np.quantile(values, [0.5, 0.9])
        of |= {f"{name}_median": middle, f"{name}_p90": ninth, f"{name}_worst": values.max()}
    return of | {"quick_ms": np.median(quick_ms), "least_ms": np.median(least_ms), "least_ms_worst": least_ms.max()}


def part_files() -> list[Path]:
    """STL and OBJ files of the wheels that are installed."""
    folders = [Path(spec.origin).parent for spec in (find_spec("pybullet_data"),) if spec and spec.origin]
    folders += [Path(path) / "cmeel.prefix/share/example-robot-data" for path in {str(f.parent) for f in folders}]
    files = [file for folder in folders for file in sorted(folder.rglob("*"))]
    return [file for file in files if file.suffix.lower() in (".stl", ".obj") and file.stat().st_size < 1_500_000]


def solids(n: int) -> list[collide.Mesh]:
    """Parts that are solids, scaled to a size of 1 m."""
    import trimesh

    files, meshes = part_files(), []
    for k in np.random.default_rng(1).permutation(len(files)).tolist():
        try:
            loaded = trimesh.load(files[k], force="mesh")
            if not _FACETS[0] <= len(loaded.faces) <= _FACETS[1]:
                continue
            vertices = np.array(loaded.vertices) - loaded.vertices.mean(axis=0)
            mesh = collide.Mesh(vertices / np.ptp(vertices, axis=0).max(), np.array(loaded.faces))
        except (CollideError, ValueError, AttributeError):  # some files are points, or have no facets
            continue
        if mesh.solid:
            meshes.append(mesh)
        if len(meshes) == n:
            break
    return meshes


def part_cases(options: Options):
    if part_files() and find_spec("trimesh"):
        yield {"bodies": "CAD parts", "pairs": 20 if options.quick else 200}


def parts(options: Options, bodies: str, pairs: int) -> list[dict]:
    rng, meshes, rows = rng_of("overlaps of parts"), solids(40 if options.quick else 300), []
    while len(rows) < pairs:
        i, j = rng.integers(len(meshes), size=2).tolist()
        X_WA, X_WB = random_pose(rng, 0.0), random_pose(rng, 0.0)
        u = rng.normal(size=3)
        X_WB[:3, 3] = X_WA[:3, 3] + rng.uniform(0.1, 0.8) * u / np.linalg.norm(u)
        if collide.collide(meshes[i], meshes[j], X_WA, X_WB):
            quick, quick_ms, least, least_ms = asked(meshes[i], meshes[j], X_WA, X_WB)
            bracket = least.lower / least.upper if least.upper < 0 else np.inf
            rows.append((quick.distance / least.distance, 1.0, bracket, quick_ms, least_ms))
    return [summed_up(rows)]


CLAIMS = [
    Claim("unions", "depths of random unions by the least translation", union_cases, unions, file="least-depths"),
    Claim("parts", "depths of overlapping CAD parts", part_cases, parts, asked_for=True, file="least-depths-parts"),
]
if __name__ == "__main__":
    main(__doc__, CLAIMS)
