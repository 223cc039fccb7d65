"""What a robot among the points of a cloud costs, beside the obstacles themselves, which are solid.

    python benchmarks/cloud_robots.py

robots  a Panda of hulls, and of spheres (from ../shared/data), among points on a table and 50 obstacles: configurations
        at random, distances and straight motions proven of free configurations

µs a configuration, or a motion. Balls have a radius of 5 mm; points lie on surfaces, evenly by area.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from inputs import SHARED
from robot_peers import at_random, clutter, panda

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main

_RADIUS = 0.005


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


def robot_cases(options: Options):
    arms = ("hulls", *(("spheres",) if SHARED.is_dir() else ()))
    points = (10**4,) if options.quick else (10**4, 10**5, 10**6)
    return grid(robot=arms, points=points, question=("booleans", "distances", "motions proven"))


CLAIMS = [
    Claim("robots", "µs a configuration, or a motion, of a robot among points", robot_cases, robots,
          file="cloud-robots", turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
