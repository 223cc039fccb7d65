"""Booleans of two solids beside manifold3d: times, volumes, nodes compared with a box, and pairs of facets tested.

    python benchmarks/solids.py                    # some minutes; needs manifold3d; --repeats 15

Two bumpy spheres of as many facets stand in each other. Both engines get meshes that are made, and what they keep with
them. Times are of the processor, of all threads, and in the table "clock" of the clock: manifold3d has threads, ours is
one; ms. `--table small` unites two boxes flush in a turned frame, and eight bumpy spheres. How often manifold3d's
volumes are off is counted by `tests/differential/test_solids.py`.
"""

from __future__ import annotations

import time
from functools import cache

import numpy as np
from inputs import use_tests

use_tests("families", "oracles", "solids")
from manifold_solids import OPERATIONS, asked, manifold_of
from mesh_shapes import bumpy_sphere

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.solids.arrangement import crossings_of


@cache
def solids(n: int) -> tuple:
    """(A, B, X, Y, B's vertices in the world)."""
    parts, Y = [bumpy_sphere(n, seed) for seed in (0, 1)], collide.pose((0.9, 0.3, 0.2), rpy=(0.3, 0.5, 0.7))
    A, B = (collide.Mesh(*part, solid=True) for part in parts)
    for mesh in (A, B):
        crossings_of(mesh)
    return A, B, np.eye(4), Y, parts[1][0] @ Y[:3, :3].T + Y[:3, 3]


def measure(options: Options, facets: int, op: str) -> Race:
    A, B, X, Y, in_world = solids(facets)
    made = collide.boolean(A, B, X, Y, op)
    nodes, tested = collide.facet_pairs(A, B, X, Y).counters[0, :2].tolist()
    columns = {"crossings": len(made.self_collisions), "meeting": made.n_meeting, "cut": made.n_cut, "boxes": nodes,
               "tested": tested}
    tasks = {"collide": lambda: collide.boolean(A, B, X, Y, op)}
    beside = {"collide": {"facets_made": len(made.mesh.faces)}}
    if installed(manifold3d="manifold3d"):
        a, b = manifold_of(A.vertices, A.faces), manifold_of(in_world, B.faces)
        result, volume = asked(a, b, op)
        exact = made.mesh.report.volume
        beside["manifold3d"] = {"facets_made": result.num_tri(), "volume_off": abs(volume - exact) / exact}
        tasks["manifold3d"] = lambda: asked(a, b, op)
    if op == "intersection":
        tasks["overlap_volume"] = lambda: collide.overlap_volume(A, B, X, Y)
    return Race(tasks, columns=columns, beside=beside)


def measure_small(options: Options, union: str) -> Race:
    """Of few facets, or of many bodies."""
    X = collide.pose((0, 0, 0), rpy=(0.3, 0.4, 0.5))
    if union == "two flush boxes":
        Y = X.copy()
        Y[:3, 3] = X[:3, :3] @ (1.0, 0.5, 0.0)
        shapes, poses = [collide.Box((1, 1, 1))] * 2, [X, Y]
        part = collide.tessellate(shapes[0], tolerance=1.0)[:2]
        tasks = {"collide": lambda: collide.boolean(*shapes, *poses, "union")}
    else:
        rng, part = np.random.default_rng(0), bumpy_sphere(992)
        shapes = [collide.Mesh(*part, solid=True)] * 8
        poses = [collide.pose(rng.uniform(-0.8, 0.8, 3), rpy=rng.uniform(-3, 3, 3)) for _ in shapes]
        tasks = {"collide": lambda: collide.combine(shapes, poses, "union")}
    made = tasks["collide"]()
    beside = {"collide": {"facets_made": len(made.mesh.faces)}}
    if installed(manifold3d="manifold3d"):
        from manifold3d import Manifold, OpType

        bodies = [manifold_of(part[0] @ X_WS[:3, :3].T + X_WS[:3, 3], part[1]) for X_WS in poses]
        tasks["manifold3d"] = lambda: Manifold.batch_boolean(bodies, OpType.Add).volume()
        beside["manifold3d"] = {"facets_made": Manifold.batch_boolean(bodies, OpType.Add).num_tri()}
    return Race(tasks, columns={"crossings": len(made.self_collisions), "cut": made.n_cut}, beside=beside)


def small_cases(options: Options):
    return grid(union=("two flush boxes", "eight spheres"))


def cases(options: Options):
    return grid(facets=(1000, 10_000, 100_000)[: 1 if options.quick else 3], op=OPERATIONS)


CLAIMS = [
    Claim("solids", "ms of the processor a boolean", cases, measure, unit="ms", turns=5),
    Claim("small", "ms of the processor a union", small_cases, measure_small, unit="ms", turns=5),
    Claim("clock", "ms by the clock", cases, measure, unit="ms", turns=5, clock=time.perf_counter, file="solids-clock"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
