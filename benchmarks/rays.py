"""Rays against meshes: `collide.raycast` beside embree and trimesh's own rays, and pybullet's batches.

    python benchmarks/rays.py
    # half a minute; needs ../shared/data, trimesh and pybullet; embreex where it is installed

First hits of random rays through meshes of box diagonal 1, from a sphere around them at points near the middle; µs of
the processor a ray. embree and pybullet work in single precision or with meshes read anew from a file; "other facet",
"missed" and "extra" count rays for which they name another facet, none where a facet is hit, or one where none is.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from inputs import directions, mesh, meshes_here

import collide
from collide.adapters.bench.claims import Claim, Options, Race, installed, main

#: No more than one batch of pybullet's; trimesh's own rays take up to a second each.
RAYS, SAMPLE = 16_000, 16


def bullet_rays(plain, starts: list, ends: list, folder: str):
    """A task: −2 for a ray that hits, whose facet is not told, −1 for others."""
    import pybullet

    place = Path(folder) / "mesh.obj"
    plain.export(place)
    client, flag = pybullet.connect(pybullet.DIRECT), pybullet.GEOM_FORCE_CONCAVE_TRIMESH
    shape = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(place), flags=flag, physicsClientId=client)
    pybullet.createMultiBody(0, shape, physicsClientId=client)

    def ask() -> np.ndarray:
        replies = pybullet.rayTestBatch(starts, ends, numThreads=1, physicsClientId=client)
        return np.array([-1 if reply[0] < 0 else -2 for reply in replies])

    return ask


def measure(options: Options, mesh_name: str, rays: int) -> Race:
    import trimesh
    from trimesh.ray import ray_triangle

    vertices, faces = mesh(mesh_name)
    rng = np.random.default_rng(1)
    origins = directions(rng, rays)
    ways = rng.normal(size=(rays, 3)) * 0.15 - origins
    plain, body = trimesh.Trimesh(vertices, faces, process=False), collide.Mesh(vertices, faces, solid=False)
    slow = ray_triangle.RayMeshIntersector(plain)
    tasks = {
        "collide": lambda: collide.raycast(body, np.eye(4), origins, ways).facet,
        "trimesh": lambda: slow.intersects_first(origins[:SAMPLE], ways[:SAMPLE]),
    }
    if installed(embree="embreex"):
        from trimesh.ray import ray_pyembree

        quick = ray_pyembree.RayMeshIntersector(plain)
        tasks["embree"] = lambda: quick.intersects_first(origins, ways)
    if installed(pybullet="pybullet"):
        with tempfile.TemporaryDirectory() as folder:
            tasks["pybullet"] = bullet_rays(plain, origins.tolist(), (origins + 2 * ways).tolist(), folder)
    facets = {name: task() for name, task in tasks.items()}
    ours, beside = facets["collide"], {}
    for name, theirs in facets.items():
        same = ours[: len(theirs)]
        beside[name] = {"missed": int(((theirs == -1) & (same >= 0)).sum()),
                        "extra": int(((theirs != -1) & (same < 0)).sum()),
                        "other_facet": int(((theirs != same) & (theirs >= 0) & (same >= 0)).sum())}
    per = {name: float(len(theirs)) for name, theirs in facets.items()}
    return Race(tasks, per, {"facets": len(faces), "hit_share": float((ours >= 0).mean())}, beside)


def cases(options: Options):
    return [{"mesh_name": name, "rays": 2000 if options.quick else RAYS}
            for name in meshes_here("teapot", "bunny", "dragon 203k")[: 1 if options.quick else 3]]


CLAIMS = [Claim("rays", "µs a ray at a mesh", cases, measure, turns=7)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
