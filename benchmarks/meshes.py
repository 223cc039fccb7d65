"""Triangle meshes against coal and FCL: building, booleans, all pairs of facets, distances.

    python benchmarks/meshes.py                       # ten minutes; --only meshes=teapot,bunny, --poses 24

Meshes are scaled to a box diagonal of 1 and stand in random poses of six classes: far (0.5 apart), gaps of 1e-2 and
1e-4, shallow (1e-3 into each other), deep (0.1), and inside (the second mesh a tenth as large, in the first one). µs a
pose of the processor. collide answers all poses in one call of the functions on trees, of booleans each ten times over,
since a batch has more than a dozen; "single" is one call of `collide.collide` a pose, of surfaces, as the peers are
asked. coal has OBBRSS and OBB, which has no distances. "differ" counts booleans unlike ours.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from inputs import mesh, meshes_here, touching
from pair_loops import coal_model, mesh_loops

import collide
from collide import Mesh
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import all_hits, first_hits, surface_distances

#: A mesh against itself, and against a convex hull given as a mesh: few large flat facets against many small ones.
PAIRS = {name: (name, name) for name in ("teapot", "bunny", "dragon 11k", "dragon 48k", "dragon 203k", "dragon 871k")}
PAIRS |= {"env/rob": ("env", "rob")} | {f"{name}/hull": (name, f"hull of {name}") for name in ("bunny", "dragon 203k")}
#: How far along the way from touching, in diagonals.
CLASSES = {"far": 0.5, "gap 1e-2": 1e-2, "gap 1e-4": 1e-4, "shallow": -1e-3, "deep": -0.1, "inside": None}
QUESTIONS = {"boolean": first_hits, "all pairs": all_hits, "distance": surface_distances}
#: How often a batch of booleans holds every pose.
OVER = 10
Bodies = tuple[Mesh, Mesh, np.ndarray, np.ndarray]


@cache
def bodies(meshes: str, where: str, count: int) -> Bodies:
    """(A, B, X_WAs, X_WBs), surfaces."""
    (vertices, faces), second = (mesh(name) for name in PAIRS[meshes])
    A, B, rng = Mesh(vertices, faces, solid=False), Mesh(*second, solid=False), np.random.default_rng(1)
    Xs, Ys = [], []
    for _ in range(count):
        X, Y, direction, way = touching(A.tree, B.tree, rng)
        further, inside = CLASSES[where], rng.normal(size=3) * 0.02
        Y[:3, 3] = X[:3, 3] + (inside if further is None else (way + further) * direction)
        Xs.append(X)
        Ys.append(Y)
    return A, B.scaled(0.1) if where == "inside" else B, np.array(Xs), np.array(Ys)


def pairs(options: Options, meshes: str, where: str, question: str) -> Race:
    A, B, Xs, Ys = asked = bodies(meshes, where, 4 if options.quick else options.poses)
    facets = f"{len(A.faces)}/{len(B.faces)}"
    if question == "build":
        tasks: dict = {"collide": lambda: [build_mesh_tree(m.vertices, m.faces) for m in (A, B)]}
        if installed(coal="coal"):
            for kind in ("OBBRSS", "OBB"):
                tasks[f"coal {kind}"] = partial(list, map(coal_model(kind), (A, B)))
        loops, engines = mesh_loops("build", asked, ())
        return Race(tasks | loops, columns={"facets": facets}, close=lambda: [e.close() for e in engines.values()])
    ask, n, repeated = QUESTIONS[question], float(len(Xs)), OVER if question == "boolean" else 1
    repeated_poses = [np.tile(X, (repeated, 1, 1)) for X in (Xs, Ys)]
    loops, engines = mesh_loops(question, asked)
    tasks = {"collide": partial(ask, A.tree, B.tree, *repeated_poses)} | loops
    per, beside = dict.fromkeys(tasks, n) | {"collide": n * repeated}, {}
    if question == "boolean":
        tasks["collide single"], per["collide single"] = lambda: [collide.collide(A, B, *X) for X in zip(Xs, Ys)], n
        hits = np.diff(first_hits(A.tree, B.tree, Xs, Ys).starts) > 0
        beside = {name: {"differ": int(((e.answers("boolean") > 0) != hits).sum())} for name, e in engines.items()}
    nodes, tested, exact = ask(A.tree, B.tree, Xs, Ys).counters.mean(axis=0).tolist()
    counts = {"facets": facets, "nodes": nodes, "triangles": tested, "exact": exact}
    return Race(tasks, per, counts, beside, close=lambda: [e.close() for n, e in engines.items() if n == "fcl"])


def pair_cases(options: Options):
    for pair in PAIRS if meshes_here("bunny") else ():
        if not options.quick or pair == "teapot":
            yield from grid(meshes=[pair], where=["far"], question=["build"])
            yield from grid(meshes=[pair], where=CLASSES, question=QUESTIONS)


CLAIMS = [Claim("meshes", "µs a pose of two meshes", pair_cases, pairs, turns=5, seconds=30.0)]


if __name__ == "__main__":
    main(__doc__, CLAIMS, lambda parser: parser.add_argument("--poses", type=int, default=12, help="of a class (12)"))
