"""One solid of many and configuration obstacles: vertices of arrangements by kind, times beside established engines.

    python benchmarks/combined_solids.py       # ten minutes; needs manifold3d, pyclipper and shapely for the peers

vertices       r bumpy spheres in one arrangement: corners, edges through facets, three facets, over r³ n log² n
memory         bytes a pair of facets, and of segments, takes while it is cut exactly
union          `combine` beside manifold3d's batch union
robot          the panda's links in one pose, as hulls, in one solid
space, plane   configuration obstacles beside manifold3d's, pyclipper's and shapely's
combs          figure 10 of the paper

Times are ms of the processor. `tests/solids/test_combine.py` judges sets of solids by points and volumes.
"""

from __future__ import annotations

import tracemalloc
from functools import partial

import numpy as np
from inputs import use_tests

use_tests("families", "oracles", "solids")
from manifold_solids import manifold_of
from mesh_shapes import bumpy_sphere
from planar_obstacle_judge import combs, turned_by

import collide
from collide.adapters.bench.claims import Claim, Options, Race, installed, main
from collide.solids.arrangement import Arrangement, arrange
from collide.solids.solid_operands import solid_operand

TURNED = collide.pose((0, 0, 0), rpy=(0.3, -0.4, 0.7))[:3, :3]


def spheres(r: int, n: int):
    """r bumpy spheres of n facets that all overlap."""
    rng = np.random.default_rng(0)
    poses = [collide.pose(rng.uniform(-0.3, 0.3, 3), rpy=rng.uniform(-2, 2, 3)) for _ in range(r)]
    return [collide.Mesh(*bumpy_sphere(n, seed)) for seed in range(r)], np.array(poses)


def arranged(shapes, poses) -> Arrangement:
    names = [f"shapes[{k}]" for k in range(len(shapes))]
    return arrange([solid_operand("benchmark", *named, True) for named in zip(names, shapes, poses)])


def vertex_kinds(arrangement: Arrangement) -> tuple[int, int, int]:
    """(corners of bodies, points where an edge goes through a facet, points of three facets)."""
    points, facets = arrangement.points, arrangement.facets
    on_edge: dict[int, bool] = {}
    for f, triangle in zip(arrangement.sheets.facet.tolist(), arrangement.sheets.triangles.tolist()):
        corners = [points.vertex(v) for v in facets.corners[f].tolist()]
        n = facets.normal(f)
        axis = int(np.argmax([abs(x) for x in n]))
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for p in triangle:
            if p >= points.n_vertices and not on_edge.get(p):
                on_edge[p] = any(points.side(corners[k], corners[k - 2], p, u, v) == 0 for k in range(3))
    n_corners = len({points.vertex(v) for v in np.unique(facets.corners).tolist()})
    n_edges = sum(on_edge.values())
    return n_corners, n_edges, len(on_edge) - n_edges


def vertices(options: Options, r: int, n: int) -> list[dict]:
    shapes, poses = spheres(r, n)
    n, kinds = len(shapes[0].faces), vertex_kinds(arranged(shapes, poses))
    row = dict(zip(("corners", "edge_facet", "three_facets"), kinds))
    return [row | {"facets": n, "over_r3_nlog2n": sum(kinds) / (r**3 * n * np.log2(n) ** 2)}]


def memory(options: Options, pairs: str) -> list[dict]:
    from collide.solids import exact_facets, plane_arrangement

    module = exact_facets if pairs == "facets" else plane_arrangement
    asked = (*spheres(2, 100)[0], TURNED) if pairs == "facets" else combs(6)
    counts: list[str] = []
    right = module.Limits.check_memory
    module.Limits.check_memory = lambda self, needed, of: counts.append(of)
    tracemalloc.start()
    collide.configuration_obstacle(*asked)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    module.Limits.check_memory = right
    n = max(int(of.split()[0].replace(",", "")) for of in counts)
    return [{"n": n, "bytes_a_pair": peak / n}]


def union(options: Options, r: int, n: int) -> Race:
    shapes, poses = spheres(r, n)
    tasks, beside = {"collide": lambda: collide.combine(shapes, poses, "union")}, {}
    if installed(manifold3d="manifold3d"):
        import manifold3d

        parts = [manifold_of(s.vertices @ X[:3, :3].T + X[:3, 3], s.faces) for s, X in zip(shapes, poses)]

        def united() -> float:
            return manifold3d.Manifold.batch_boolean(parts, manifold3d.OpType.Add).volume()

        exact, tasks["manifold3d"] = tasks["collide"]().mesh.report.volume, united
        beside["manifold3d"] = {"volume_off": abs(united() - exact) / exact}
    return Race(tasks, columns={"facets": len(shapes[0].faces)}, beside=beside)


def robot(options: Options, scene: str) -> Race:
    from collide.scenes import load

    shapes, poses, n_meshes = [], [], 0
    for body in [body for body in load(scene).bodies if body.owner is not None]:
        shape = body.shape
        if isinstance(shape, collide.Mesh) and shape.solid:
            n_meshes += 1
        else:
            shape = collide.ConvexHull(np.asarray(collide.tessellate(shape, tolerance=1e-3)[0]))
        shapes.append(shape)
        poses.append(body.X_WB)
    made = collide.combine(shapes, poses, "union")
    columns = {"links": len(shapes), "solid_meshes": n_meshes, "facets": len(made.mesh.faces),
               "shells": made.mesh.report.shells, "litres": 1e3 * made.mesh.report.volume,
               "crossings": len(made.self_collisions)}
    return Race({"collide": lambda: collide.combine(shapes, poses, "union")}, columns=columns)


def space(options: Options, facets_a: int, facets_b: int) -> Race:
    A, B = collide.Mesh(*bumpy_sphere(facets_a, 0)), collide.Mesh(*bumpy_sphere(facets_b, 1))
    r = collide.configuration_obstacle(A, B, TURNED)
    tasks, beside = {"collide": lambda: collide.configuration_obstacle(A, B, TURNED)}, {}
    columns = {"pieces": r.n_pieces, "cells": r.n_cells, "asked": r.n_asked, "facets": len(r.mesh.faces),
               "crossings": len(r.self_collisions)}
    if installed(manifold3d="manifold3d"):
        first, second = manifold_of(A.vertices, A.faces), manifold_of(-B.vertices @ TURNED.T, B.faces[:, ::-1])
        volume = first.minkowski_sum(second).volume()
        tasks["manifold3d"] = lambda: first.minkowski_sum(second).volume()
        beside["manifold3d"] = {"off": abs(volume - r.mesh.report.volume) / volume}
    return Race(tasks, columns=columns, beside=beside)


def outline(n: int, bumps: int, depth: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(n) / n
    radius = 1 + depth * np.cos(bumps * angle)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def plane(options: Options, corners: int) -> Race:
    A, B, R = outline(corners, 5, 0.1), outline(corners, 7, 0.2), turned_by(0.4)
    r, reflected = collide.configuration_obstacle([A], [B], R), -B @ R.T
    tasks: dict = {"collide": lambda: collide.configuration_obstacle([A], [B], R)}
    peers = installed(pyclipper="pyclipper", shapely="shapely")
    if "pyclipper" in peers and corners <= 500:  # its time grows as n⁴
        tasks["pyclipper"] = partial(_by_clipper, A, reflected, 2.0**40)
    if "shapely" in peers:
        tasks["shapely"] = partial(_by_shapely, A, reflected)
    beside = {name: {"off": abs(task() - r.area) / r.area} for name, task in tasks.items() if name != "collide"}
    return Race(tasks, columns={"pieces": r.n_pieces, "points": r.n_corners}, beside=beside)


def _by_clipper(A, B, scale: float) -> float:
    """The boundary of A moved along that of B, and B moved to a corner of A, in integers."""
    import pyclipper as clipper

    first, second = (np.round(x * scale).astype(np.int64).tolist() for x in (A, B))
    union = clipper.Pyclipper()
    union.AddPaths(clipper.MinkowskiSum(first, second, True), clipper.PT_SUBJECT, True)
    solution = union.Execute(clipper.CT_UNION, clipper.PFT_NONZERO, clipper.PFT_NONZERO)
    return sum(clipper.Area(path) for path in solution if clipper.Orientation(path)) / scale**2


def _by_shapely(A, B) -> float:
    """The parallelograms of all pairs of edges, united, holes filled: polygons without holes here."""
    import shapely

    a, b = np.roll(A, -1, axis=0), np.roll(B, -1, axis=0)
    corners = np.stack(
        [A[:, None] + B[None], a[:, None] + B[None], a[:, None] + b[None], A[:, None] + b[None]], axis=2
    ).reshape(-1, 4, 2)
    made = shapely.union_all(shapely.polygons(corners))
    return shapely.Polygon(made.exterior).area


def figure_10(options: Options, n: int) -> list[dict]:
    A, B, R = combs(n)
    r = collide.configuration_obstacle(A, B, R)
    holes = len(r.rings) - 1
    return [{"corners_of_A": len(A[0]), "pieces": r.n_pieces, "points": r.n_corners,
             "corners": sum(map(len, r.rings)), "holes": holes, "holes_over_n3": holes / n**3}]


def claim(name: str, sentence: str, measure, *columns: str, of=(), everywhere=False) -> Claim:
    def cases(options: Options):
        some = of[: 2 if options.quick else None]
        return [dict(zip(columns, values if len(columns) > 1 else [values])) for values in some]

    file = f"combined-solids-{name}"
    return Claim(name, sentence, cases, measure, unit="ms", turns=3, file=file, everywhere=everywhere)


COUNTS = [(2, 200), (3, 200), (4, 200), (6, 200), (8, 200), (4, 50), (4, 100), (4, 400), (4, 800)]
CLAIMS = [
    claim("vertices", "vertices of arrangements", vertices, "r", "n", of=COUNTS, everywhere=True),
    claim("memory", "bytes of cutting exactly", memory, "pairs", of=["facets", "segments"], everywhere=True),
    claim("union", "ms of a union", union, "r", "n", of=[(2, 200), (4, 200), (8, 200), (8, 1000)]),
    claim("robot", "ms of a robot's links in one solid", robot, "scene", of=["panda_workbench"]),
    claim("space", "ms of a configuration obstacle in space", space, "facets_a", "facets_b",
          of=[(20, 20), (50, 20), (50, 50), (100, 50), (200, 50)]),
    claim("plane", "ms of one in the plane", plane, "corners", of=[25, 100, 250, 500, 1000]),
    claim("combs", "figure 10 of the paper", figure_10, "n", of=[2, 4, 6, 8, 12], everywhere=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
