"""Rays against meshes: `collide.raycast` beside embree and trimesh's own rays, and pybullet's batches.

    python benchmarks/rays.py
    # half a minute; needs trimesh and pybullet; embreex where it is installed

First hits of random rays through meshes of box diagonal 1, from a sphere around them at points near the middle. Engines
take turns; times are the least of several turns, per ray. embree and pybullet work in single precision or with meshes
read anew from a file; "facets" and "missed" count rays for which they name another facet, or none, where a facet is
hit.
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from meshes import DATA, RESULTS, mesh

import collide

#: No more than one batch of pybullet's.
RAYS, TURNS = 16_000, 7
#: trimesh's own rays take up to a second each.
SAMPLE = 16


def rays(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(RAYS, 3))
    origins /= np.linalg.norm(origins, axis=1)[:, None]
    return origins, rng.normal(size=(RAYS, 3)) * 0.15 - origins


def engines(vertices, faces, origins, directions, folder: Path) -> dict:
    """Name to a task that gives (facets or −1, which rays it was asked)."""
    body = collide.Mesh(vertices, faces, solid=False)
    by_engine = {"collide": lambda: collide.raycast(body, np.eye(4), origins, directions).facet}
    import trimesh
    from trimesh.ray import ray_triangle

    plain = trimesh.Trimesh(vertices, faces, process=False)
    sample = slice(0, SAMPLE)
    slow = ray_triangle.RayMeshIntersector(plain)
    by_engine["trimesh"] = lambda: slow.intersects_first(origins[sample], directions[sample])
    try:
        from trimesh.ray import ray_pyembree

        quick = ray_pyembree.RayMeshIntersector(plain)
        by_engine["embree"] = lambda: quick.intersects_first(origins, directions)
    except (ImportError, AttributeError):
        print("embree is not installed (pip install embreex): left out")
    try:
        import pybullet

        place = folder / "mesh.obj"
        plain.export(place)
        client = pybullet.connect(pybullet.DIRECT)
        flag = pybullet.GEOM_FORCE_CONCAVE_TRIMESH
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH, fileName=str(place), flags=flag, physicsClientId=client
        )
        pybullet.createMultiBody(0, shape, physicsClientId=client)
        starts, ends = origins.tolist(), (origins + 2 * directions).tolist()

        def ask() -> np.ndarray:
            replies = pybullet.rayTestBatch(starts, ends, numThreads=1, physicsClientId=client)
            return np.array([-1 if reply[0] < 0 else -2 for reply in replies])

        by_engine["pybullet"] = ask
    except ImportError:
        print("pybullet is not installed (pip install 'collide-robotics[peers]'): left out")
    return by_engine


def main() -> int:
    if not DATA.is_dir():
        print("skipped: shared/data is not beside this checkout")
        return 0
    rows = []
    for name in ("teapot", "bunny", "dragon 203k"):
        vertices, faces = mesh(name)
        origins, directions = rays(1)
        with tempfile.TemporaryDirectory() as folder:
            tasks = engines(vertices, faces, origins, directions, Path(folder))
            facets = {engine: task() for engine, task in tasks.items()}
            best = dict.fromkeys(tasks, np.inf)
            for k in range(TURNS):
                for engine, task in tasks.items():
                    if engine == "trimesh" and k:
                        continue
                    started = time.perf_counter()
                    task()
                    best[engine] = min(best[engine], time.perf_counter() - started)
        ours = facets["collide"]
        for engine, seconds in best.items():
            theirs = facets[engine]
            others = ours[: len(theirs)]
            wrong = {
                "missed": int(((theirs == -1) & (others >= 0)).sum()),
                "extra": int(((theirs != -1) & (others < 0)).sum()),
            }
            if engine != "pybullet":
                wrong["facets"] = int(((theirs != others) & (theirs >= 0) & (others >= 0)).sum())
            each = seconds / len(theirs) * 1e6
            rows.append(
                {
                    "mesh": name,
                    "facets": len(faces),
                    "engine": engine,
                    "us_per_ray": f"{each:.2f}",
                    "hit_share": f"{(ours >= 0).mean():.2f}",
                    **{f"rays_{key}": value for key, value in wrong.items()},
                }
            )
            print(
                f"{name:12} {engine:9} {each:8.2f} µs a ray, {each / (best['collide'] / RAYS * 1e6):7.2f} of "
                f"collide's; {wrong}",
                flush=True,
            )
    place = RESULTS / "rays.csv"
    with open(place, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*dict.fromkeys(key for row in rows for key in row), "cores"])
        writer.writeheader()
        writer.writerows(row | {"cores": os.cpu_count()} for row in rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
