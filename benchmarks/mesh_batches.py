"""Batches of mesh pairs beside coal's loop: what a call and a pose cost, from 1 pose to 12,000; making meshes.

    python benchmarks/mesh_batches.py                   # some minutes
    python benchmarks/mesh_batches.py --table making    # a minute

batches   a torus of 2304 facets against itself, a box and a sphere; poses far apart (none within the limit), mixed or
          near (some overlap, some are a little apart). Booleans, and gaps no farther than a limit of a hundredth of the
          size; coal (OBBRSS) in a loop. µs a pose of the processor
making    `Mesh` as it comes (welding, defects, shells, volumes), the same as loose triangles the way an STL has them,
          taken as a surface without a look, read from a pickle, and `Mesh.locality`; ms
"""

from __future__ import annotations

import pickle
from functools import partial

import numpy as np
from inputs import MESHES, poses
from pair_loops import CoalLoop

import collide
from collide import Mesh
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.scenes.loaders.triangles import read_meshes
from collide.scenes.worst_cases import harpsicordia

#: Distances of the bodies' middles, in radii of the torus; and how far gaps are asked for.
SPREADS, LIMIT = {"far": (4.0, 40.0), "mixed": (1.0, 8.0), "near": (0.5, 2.0)}, 0.02


def torus(major: float = 0.7, minor: float = 0.3, n: int = 48, m: int = 24) -> collide.Mesh:
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    ring = major + minor * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), minor * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = i * m + j, (i + 1) % n * m + j
    c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    return collide.Mesh(vertices, faces)


def batches(options: Options, partner: str, where: str, n: int, question: str) -> Race:
    rng, A = np.random.default_rng(n), torus()
    B = {"torus": A, "box": collide.Box((1, 1, 1)), "sphere": collide.Sphere(0.6)}[partner]
    X, Y = poses(rng, n, 0.0), poses(rng, n, *SPREADS[where])
    ask = partial(collide.collide, A, B, X, Y)
    tasks = {"collide": ask}
    if question == "distance":  # coal as far as the limit: a security margin that no pair of facets within it escapes
        tasks["collide"] = partial(collide.distance, A, B, X, Y, max_distance=LIMIT, signed=False)
    if installed(coal="coal"):
        margin = LIMIT if question == "distance" else 0.0
        tasks["coal"] = CoalLoop([A] * n, [B] * n, X, Y).loop("boolean", margin=margin)
    return Race(tasks, n, {"hits": int(np.count_nonzero(ask()))})


def batch_cases(options: Options):
    sizes = (1, 12, 120) if options.quick else (1, 12, 120, 1200, 12_000)
    return grid(partner=("torus", "box", "sphere"), where=SPREADS, n=sizes, question=("boolean", "distance"))


FILES = ("teapot_1177.ply", "env.obj", "bunny_35947.ply", "dragon_vrip_res2.ply.gz", "dragon_vrip.ply.gz")


def making(options: Options, source: str) -> Race:
    if source.startswith("harpsicordia"):
        made = harpsicordia(int(source.split()[1]))[0]
    else:
        made = read_meshes(MESHES / source)[0][1]
    vertices, faces = np.asarray(made.vertices), np.asarray(made.faces)
    whole = Mesh(vertices, faces)
    pickled, locality = pickle.dumps(whole), whole.locality()
    corners, ids = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    columns = {"facets": len(faces), "solid": whole.solid, "shells": whole.report.shells,
               "σ": locality.local_stretches[0], "σ10": locality.local_stretches[9], "Σ": locality.global_stretch}
    return Race({
        "mesh": lambda: Mesh(vertices, faces), "soup": lambda: Mesh(corners, ids),
        "surface": lambda: Mesh(vertices, faces, solid=False), "unpickle": lambda: pickle.loads(pickled),
        "locality": whole.locality,
    }, columns=columns)


def making_cases(options: Options):
    some = slice(1 if options.quick else None)
    files = [name for name in FILES if (MESHES / name).is_file()][some]
    return grid(source=[*files, *(f"harpsicordia {n}" for n in (1_000, 10_000, 100_000)[some])])


CLAIMS = [
    Claim("batches", "µs a pose in batches", batch_cases, batches, turns=40, seconds=5.0, file="mesh-batches"),
    Claim("making", "ms of making meshes", making_cases, making, unit="ms", file="mesh-shapes", asked_for=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
