"""What a point cloud costs, to make and to ask, beside scipy's k-d tree and coal's octree, from 10³ to 10⁷ points.

    python benchmarks/clouds.py --table made asked robots updated worn read

made    a cloud and its tree, beside cKDTree and coal's OcTree of the same points, cells as large as a ball
asked   spheres, convex shapes, gaps, nearest points; ours in batches, coal in a loop of Python, scipy in one call:
        for spheres the points within both radii are counted
robots  a Panda of hulls, and of spheres (from ../shared/data), among points on a table and 50 obstacles: configurations
        at random, distances and straight motions proven of free configurations; beside the obstacles as solids
updated points come and go, beside a cloud and its tree made anew of the points after the change
worn    what is asked of a cloud after updates of 1/100 of its points, beside a cloud made anew
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
from inputs import SHARED, rotations
from robot_peers import at_random, clutter, panda

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
    }


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


def surface_points(world: collide.World, n: int) -> np.ndarray:
    """Points on the surfaces of the bodies of a World, evenly by area."""
    rng, triangles = np.random.default_rng(1), []
    for body in map(world.body, world.ids):
        mesh = collide.tessellate(body.shape)
        triangles.append((mesh.vertices @ body.X_WB[:3, :3].T + body.X_WB[:3, 3])[mesh.faces])
    a, b, c = np.concatenate(triangles).transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    k, (u, v) = rng.choice(len(a), n, p=area / area.sum()), np.sort(rng.random((2, n)), axis=0)
    return a[k] + u[:, None] * (b - a)[k] + (v - u)[:, None] * (c - a)[k]


@cache
def checkers(robot: str, points: int) -> dict[str, collide.RobotChecker]:
    arm = panda()[0] if robot == "hulls" else collide.Robot.load(SHARED / "robots/panda/panda_spherized.urdf")
    solids, seen = clutter(50), collide.World()
    seen.add(collide.PointCloud(surface_points(solids, points), _RADIUS), name="seen", static=True)
    return {"collide": collide.RobotChecker(arm, seen), "solid": collide.RobotChecker(arm, solids)}


def robots(options: Options, robot: str, points: int, question: str) -> Race:
    n, asked_of_both = 200 if options.quick else 4000, checkers(robot, points)
    Q = at_random(asked_of_both["collide"].robot, n)
    tasks, per, columns = {}, {}, {}
    for name, checker in asked_of_both.items():
        free = Q[~checker.collides(Q)]
        begin = free[: n // 20]
        end = begin + np.random.default_rng(3).uniform(-0.5, 0.5, begin.shape)
        if question == "motions proven":
            is_free = checker.certify_edges(begin, end).free
            tasks[name] = partial(checker.certify_edges, begin[is_free], end[is_free])
            per[name] = float(is_free.sum())
        else:
            call, asked_configurations = (checker.collides, Q) if question == "booleans" else (checker.distances, begin)
            tasks[name], per[name] = partial(call, asked_configurations), float(len(asked_configurations))
        columns[f"free_{name}"] = len(free) / n
    return Race(tasks, per, columns)


def asked(options: Options, points: int, where: str, question: str) -> Race:
    n = 500 if options.quick else 5000
    return Race(asked_of(points, where, n)[question], per=n)


def change_of(cloud: collide.PointCloud, where: str, n: int, rng: np.random.Generator) -> dict:
    """n points come and as many go."""
    return {
        "added": 0.99 * points_of(10**6, where)[rng.integers(0, 10**6, n)],
        "removed": rng.choice(len(cloud), n, replace=False),
    }


def updated(options: Options, points: int, where: str, change: str) -> Race:
    cloud = collide.PointCloud(points_of(points, where), _RADIUS)
    n = points // 10 if change == "10 %" else int(change)
    comes_and_goes = change_of(cloud, where, n, np.random.default_rng(4))
    bare = cloud.updated(**comes_and_goes)
    tasks = {"without a tree": lambda: cloud.updated(**comes_and_goes)}
    with_tree = collide.PointCloud(cloud.points, _RADIUS)
    with_tree.nearest((0.0, 0.0, 0.0))
    tasks["collide"] = lambda: with_tree.updated(**comes_and_goes)
    tasks["made anew"] = lambda: collide.PointCloud(bare.points, _RADIUS).tree
    return Race(tasks)


@cache
def worn_cloud(points: int, where: str, updates: int) -> collide.PointCloud:
    cloud, rng = collide.PointCloud(points_of(points, where), _RADIUS), np.random.default_rng(5)
    cloud.nearest((0.0, 0.0, 0.0))
    for _ in range(updates):
        cloud = cloud.updated(**change_of(cloud, where, points // 200, rng))
    return cloud


def worn(options: Options, points: int, where: str, updates: int, question: str) -> Race:
    n = 500 if options.quick else 5000
    cloud, X = worn_cloud(points, where, updates), poses(n)
    tasks = {}
    for name, asked_cloud in (("collide", cloud), ("made anew", collide.PointCloud(cloud.points, _RADIUS))):
        if question == "nearest":
            tasks[name] = partial(asked_cloud.nearest, np.ascontiguousarray(X[:, :3, 3]))
        else:
            tasks[name] = partial(collide.collide, asked_cloud, shapes()[question], _EYE, X)
        tasks[name]()
    return Race(tasks, per=n)


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


def robot_cases(options: Options):
    arms = ("hulls", *(("spheres",) if SHARED.is_dir() else ()))
    points = (10**4,) if options.quick else (10**4, 10**5, 10**6)
    return grid(robot=arms, points=points, question=("booleans", "distances", "motions proven"))


def updated_cases(options: Options):
    return grid(points=sizes(options)[1:4], where=("cube", "room"), change=("10", "300", "10 %"))


def worn_cases(options: Options):
    questions = ("sphere", "box", "hull of 64", "nearest")
    points = sizes(options)[1:2] if options.quick else (10**5,)
    return grid(points=points, where=("cube", "room"), updates=(1, 10, 100), question=questions)


def read_cases(options: Options):
    kinds = ("pcd", "ply", "npz", "xyz", *(("las", "laz") if installed(laspy="laspy") else ()))
    return grid(points=(10**4,) if options.quick else (10**6,), kind=kinds)


CLAIMS = [
    Claim("made", "µs to make a cloud with its tree", made_cases, made, file="clouds-made", turns=5),
    Claim("read", "µs a point read", read_cases, read, file="clouds-read", turns=5),
    Claim("updated", "µs until a changed cloud has its tree", updated_cases, updated, file="clouds-updated", turns=9),
    Claim("worn", "µs a question to a cloud after updates", worn_cases, worn, file="clouds-worn", turns=9),
    Claim("asked", "µs a question to a cloud", asked_cases, asked, file="clouds-asked", turns=5),
    Claim("robots", "µs a configuration, or a motion, of a robot among points", robot_cases, robots,
          file="clouds-robots", turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
