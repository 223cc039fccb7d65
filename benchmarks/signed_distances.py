"""What signed distances of points from a mesh cost, beside open3d's (Embree, floats) and trimesh's; grids of them.

    python benchmarks/signed_distances.py --table points grids

points   distance, nearest facet and sign of points spread in a box around a mesh, or within a hundredth of its size of
         its surface, in one call; open3d with one thread; trimesh, and collide.distance of a point, asked fewer points
grids    points asked of a grid of 100 cells along the longest side, beside the exact distances

µs a point, in one thread. Bodies: spheres, a knobby sphere, and the bunny of shared/data, a surface: without sign.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from inputs import mesh as file_mesh
from inputs import meshes_here

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main

_TOLERANCES = {"sphere of 720": 1e-2, "sphere of 6k": 1e-3, "sphere of 63k": 1e-4}
_EYE = np.eye(4)


@cache
def body(name: str) -> collide.Mesh:
    if name == "bunny":
        return collide.Mesh(*file_mesh(name), solid=False)
    vertices, faces = collide.tessellate(collide.Sphere(1.0), tolerance=_TOLERANCES.get(name, 3e-4))
    if name == "knobby of 20k":
        vertices = vertices * (1.0 + 0.15 * np.sin(9.0 * vertices).prod(axis=1))[:, None]
    return collide.Mesh(vertices, faces)


def points_of(mesh: collide.Mesh, where: str, n: int) -> np.ndarray:
    rng = np.random.default_rng(n)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = high - low
    if where == "box":
        return rng.uniform(low - 0.1 * size, high + 0.1 * size, (n, 3))
    weights = rng.dirichlet(np.ones(3), n)
    corners = mesh.vertices[mesh.faces[rng.integers(0, len(mesh.faces), n)]]
    return np.einsum("nk,nkd->nd", weights, corners) + 0.01 * size.max() * rng.uniform(-1.0, 1.0, (n, 3))


def points(options: Options, shape: str, where: str) -> Race:
    n = 10**4 if options.quick else 2 * 10**5
    mesh, n_single = body(shape), 50
    places = points_of(mesh, where, n)
    tasks = {"collide": partial(collide.signed_distances, mesh, places, signed=mesh.solid)}
    per = {"collide": float(n)}
    ours, columns = tasks["collide"]().distance, {"facets": len(mesh.faces), "points": n}
    X = np.tile(_EYE, (n_single, 1, 1))
    X[:, :3, 3] = places[:n_single]
    tasks["collide.distance"] = partial(collide.distance, mesh, collide.Sphere(1e-12), _EYE, X, signed=mesh.solid)
    per["collide.distance"] = float(n_single)
    beside: dict = {}
    if installed(open3d="open3d"):
        import open3d as o3d

        scene, singles = o3d.t.geometry.RaycastingScene(nthreads=1), o3d.core.Tensor(places.astype(np.float32))
        scene.add_triangles(
            o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.faces.astype(np.uint32))
        )
        ask = scene.compute_signed_distance if mesh.solid else scene.compute_distance
        tasks["open3d"], per["open3d"] = partial(ask, singles, nthreads=1), float(n)
        theirs = tasks["open3d"]().numpy().astype(float)
        beside["open3d"] = {
            "wrong_signs": int(((theirs < 0) != (ours < 0)).sum()), "largest_error": float(np.abs(theirs - ours).max()),
        }
    if installed(trimesh="trimesh", rtree="rtree"):
        import trimesh

        surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        ask = trimesh.proximity.signed_distance if mesh.solid else trimesh.proximity.closest_point
        tasks["trimesh"], per["trimesh"] = partial(ask, surface, places[:n_single]), float(n_single)
    return Race(tasks, per=per, columns=columns, beside=beside)


def grids(options: Options, shape: str) -> Race:
    n = 10**4 if options.quick else 10**6
    mesh = body(shape)
    places = points_of(mesh, "box", n)
    cell = float(np.ptp(mesh.vertices, axis=0).max()) / 100.0
    made = collide.SignedDistanceGrid.from_mesh(mesh, cell, margin=15.0 * cell, signed=mesh.solid)
    bounds, exact = made.distances(places), collide.signed_distances(mesh, places, signed=mesh.solid).distance
    columns = {
        "nodes": made.values.size, "width_in_cells": float((bounds.upper - bounds.lower).max()) / cell,
        "error_in_cells": float(np.abs(bounds.distance - exact).max()) / cell,
    }
    tasks = {
        "grid": partial(made.distances, places),
        "exact": partial(collide.signed_distances, mesh, places, signed=mesh.solid),
    }
    return Race(tasks, per=n, columns=columns)


def shapes() -> tuple[str, ...]:
    return (*_TOLERANCES, "knobby of 20k", *meshes_here("bunny"))


CLAIMS = [
    Claim("points", "µs a signed distance", lambda o: grid(shape=shapes(), where=("box", "near")), points,
          file="signed-distances", turns=5),
    Claim("grids", "µs a bracket from a grid", lambda o: grid(shape=shapes()), grids, file="signed-distance-grids",
          turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
