"""What a point cloud costs, to make and to ask, beside scipy's k-d tree and coal's octree, from 10³ to 10⁷ points.

    python benchmarks/clouds.py --table made asked read

made    a cloud and its tree, beside cKDTree and coal's OcTree of the same points, cells as large as a ball
asked   spheres, convex shapes, gaps, nearest points; ours in batches, coal in a loop of Python, scipy in one call:
        for spheres the points within both radii are counted
read    a file of each format, in µs a point, and the peak of memory while reading, in bytes a point; beside laspy's
        whole records, numpy.loadtxt, trimesh

µs a call. Points lie evenly in a cube of 2 m, or on the walls of a room, as a lidar sees them; balls have a radius of
5 mm.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
import tracemalloc
from functools import cache, partial
from pathlib import Path

import numpy as np
from inputs import rotations

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main

_RADIUS, _EYE = 0.005, np.eye(4)


@cache
def points_of(points: int, where: str) -> np.ndarray:
    rng = np.random.default_rng(points)
    places = rng.uniform(-1.0, 1.0, (points, 3))
    if where == "room":
        wall = rng.integers(0, 5, points)
        places[np.arange(points), wall % 3] = np.where(wall < 3, -1.0, 1.0) + 0.002 * rng.normal(size=points)
    return places


def made(options: Options, points: int, where: str) -> Race:
    places = points_of(points, where)
    tasks = {"collide": lambda: collide.PointCloud(places, _RADIUS).tree}
    if installed(scipy="scipy"):
        from scipy.spatial import cKDTree

        tasks["scipy"] = lambda: cKDTree(places)
    if installed(coal="coal") and points <= 10**5:
        import coal

        tasks["coal"] = lambda: coal.makeOctree(places, 2.0 * _RADIUS)
    columns = {"bytes_a_point": collide.PointCloud(places, _RADIUS).tree.nbytes / points}
    return Race(tasks, columns=columns)


def poses(n: int) -> np.ndarray:
    rng = np.random.default_rng(2)
    X = np.repeat(_EYE[None], n, axis=0)
    X[:, :3, :3], X[:, :3, 3] = rotations(rng.normal(size=(n, 4))), rng.uniform(-1.0, 1.0, (n, 3))
    return X


def shapes() -> dict:
    rng = np.random.default_rng(3)
    unit = rng.normal(size=(64, 3))
    unit /= np.sqrt(np.square(unit).sum(axis=1))[:, None]
    return {
        "sphere": collide.Sphere(0.02), "box": collide.Box((0.05, 0.04, 0.06)), "capsule": collide.Capsule(0.02, 0.05),
        "hull of 64": collide.ConvexHull(0.03 * unit), "cylinder": collide.Cylinder(0.02, 0.05),
        "mesh of 720": dented_ball(),
    }


def dented_ball() -> collide.Mesh:
    """A solid of 720 facets that is not convex."""
    mesh = collide.tessellate(collide.Ellipsoid((0.04, 0.03, 0.02)))
    away = np.square(mesh.vertices - (0.0, 0.0, 0.02)).sum(axis=1)
    return collide.Mesh(mesh.vertices * (1.0 - 0.3 * np.exp(-away / 2e-4))[:, None], mesh.faces)


def coal_calls(places: np.ndarray, size: float, X: np.ndarray) -> dict:
    """{shape: call}, each of coal's octree of cells of a size [m] around places (n, 3), against a shape at poses."""
    import coal

    octree, request = coal.makeOctree(places, size), coal.CollisionRequest()
    sides = {"sphere": coal.Sphere(0.02), "box": coal.Box(0.05, 0.04, 0.06), "capsule": coal.Capsule(0.02, 0.05)}
    eye, T = coal.Transform3s(), [coal.Transform3s(M[:3, :3], M[:3, 3]) for M in X]

    def loop(shape):
        for transform in T:
            coal.collide(octree, eye, shape, transform, request, coal.CollisionResult())

    return {name: partial(loop, shape) for name, shape in sides.items()}


@cache
def asked_of(points: int, where: str, n: int) -> dict:
    """{question: {engine: call}}"""
    places, X = points_of(points, where), poses(n)
    cloud, centres = collide.PointCloud(places, _RADIUS), np.ascontiguousarray(X[:, :3, 3])
    calls: dict = {name: {"collide": partial(collide.collide, cloud, S, _EYE, X)} for name, S in shapes().items()}
    gap = partial(collide.distance, cloud, shapes()["mesh of 720"], _EYE, X[: n // 10], signed=False)
    calls["gap of a mesh"] = {"collide": lambda: [gap() for _ in range(10)]}  # so that times are of as many questions
    calls["gap of a box"] = {"collide": partial(collide.distance, cloud, shapes()["box"], _EYE, X, signed=False)}
    calls["nearest"] = {"collide": partial(cloud.nearest, centres)}
    if installed(scipy="scipy"):
        from scipy.spatial import cKDTree

        tree = cKDTree(places)
        calls["nearest"]["scipy"] = partial(tree.query, centres)
        calls["sphere"]["scipy"] = partial(tree.query_ball_point, centres, 0.02 + _RADIUS, return_length=True)
    if installed(coal="coal") and points <= 10**5:
        for name, call in coal_calls(places, 2.0 * _RADIUS, X).items():
            calls[name]["coal"] = call
    for tasks in calls.values():
        for call in tasks.values():
            call()
    return calls


def asked(options: Options, points: int, where: str, question: str) -> Race:
    n = 500 if options.quick else 5000
    return Race(asked_of(points, where, n)[question], per=n)


@cache
def folder() -> Path:
    path = Path(tempfile.mkdtemp(prefix="collide-clouds-"))
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


@cache
def file_of(points: int, kind: str) -> Path:
    path, places = folder() / f"{points}.{kind}", points_of(points, "room")
    if kind in ("las", "laz"):
        import laspy

        data = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
        data.header.scales = np.full(3, 1e-6)
        data.x, data.y, data.z = places.T
        data.write(path)
    else:
        collide.PointCloud(places, _RADIUS).save(path)
    return path


def read(options: Options, points: int, kind: str) -> Race:
    path = file_of(points, kind)
    tasks = {"collide": lambda: collide.PointCloud.from_file(path)}
    if kind in ("las", "laz"):
        import laspy

        tasks["laspy"] = lambda: laspy.read(path).xyz
    elif kind == "xyz":
        tasks["numpy"] = lambda: np.loadtxt(path)
    elif kind == "ply" and installed(trimesh="trimesh"):
        import trimesh

        tasks["trimesh"] = lambda: trimesh.load(path, process=False)
    tracemalloc.start()
    tasks["collide"]()
    columns = {"peak_bytes_a_point": tracemalloc.get_traced_memory()[1] / points}
    tracemalloc.stop()
    return Race(tasks, per=points, columns=columns)


def sizes(options: Options) -> tuple[int, ...]:
    return (10**3, 10**4) if options.quick else (10**3, 10**4, 10**5, 10**6, 10**7)


def made_cases(options: Options):
    return grid(points=sizes(options), where=("cube", "room"))


def asked_cases(options: Options):
    questions = (*shapes(), "gap of a box", "gap of a mesh", "nearest")
    return grid(points=sizes(options)[:4], where=("cube", "room"), question=questions)


def read_cases(options: Options):
    kinds = ("pcd", "ply", "npz", "xyz", *(("las", "laz") if installed(laspy="laspy") else ()))
    return grid(points=(10**4,) if options.quick else (10**6,), kind=kinds)


CLAIMS = [
    Claim("made", "µs to make a cloud with its tree", made_cases, made, file="clouds-made", turns=5),
    Claim("read", "µs a point read", read_cases, read, file="clouds-read", turns=5),
    Claim("asked", "µs a question to a cloud", asked_cases, asked, file="clouds-asked", turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
