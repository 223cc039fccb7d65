"""Single calls of pybullet and coal beside the same calls of collide: medians, both in turns.

    python benchmarks/host_calls.py [--rounds 400]

pybullet through `attach`, in a client of a floor, 100 balls that rest on it, and a hull. coal: shapes that are apart
and that meet, with the default request for contacts. Engines that are not installed are left out.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from importlib import import_module

import numpy as np
from scipy.spatial import ConvexHull


def medians(rounds: int, *calls: Callable[[], object]) -> list[float]:
    """Of each call [µs], asked in turns."""
    taken: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for call, times in zip(calls, taken):
            start = time.perf_counter()
            call()
            times.append(1e6 * (time.perf_counter() - start))
    return [statistics.median(times) for times in taken]


def time_pybullet(rounds: int) -> None:
    p = import_module("pybullet")
    from collide.adapters.hosts.pybullet_mirror import attach

    client = p.connect(p.DIRECT)
    q = attach(p, client)
    random = np.random.default_rng(0)
    q.createMultiBody(0.0, q.createCollisionShape(p.GEOM_PLANE))
    ball = q.createCollisionShape(p.GEOM_SPHERE, radius=0.2)
    balls = [q.createMultiBody(1.0, ball, basePosition=[*random.uniform(-4, 4, 2), 0.2]) for _ in range(100)]
    corners = [[x, y, z] for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (-0.3, 0.3)]
    shape = q.createCollisionShape(p.GEOM_MESH, vertices=corners)
    hull = q.createMultiBody(1.0, shape, basePosition=[0.0, 0.0, 0.3])
    q.stepSimulation()
    mirror, places = q.mirror_of(client), [p.getBasePositionAndOrientation(body, client) for body in balls]

    def moved() -> None:
        for body, (place, rotation) in zip(balls, places):
            p.resetBasePositionAndOrientation(body, place, rotation, client)
        mirror.update()

    print("update of 102 bodies, none moved: {:.0f} µs".format(*medians(rounds, mirror.update)))
    print("set by resetBasePositionAndOrientation, 100, and update: {:.0f} µs".format(*medians(rounds // 4, moved)))
    ends = [[x, y, 5.0] for x, y in random.uniform(-4, 4, (100, 2))], [[0.0, 0.0, -1.0]] * 100
    about = {
        "getClosestPoints of two bodies": lambda m: m.getClosestPoints(balls[0], hull, 9.0, physicsClientId=client),
        "getClosestPoints of a body and a shape": lambda m: m.getClosestPoints(
            balls[0], -1, 9.0, collisionShapeB=shape, collisionShapePositionB=[0, 0, 1],
            collisionShapeOrientationB=[0, 0, 0, 1], physicsClientId=client,
        ),
        "getContactPoints of two bodies": lambda m: m.getContactPoints(balls[0], hull, physicsClientId=client),
        "getContactPoints of all": lambda m: m.getContactPoints(physicsClientId=client),
        "rayTest": lambda m: m.rayTest(ends[0][0], ends[1][0], physicsClientId=client),
        "rayTestBatch of 100": lambda m: m.rayTestBatch(*ends, physicsClientId=client),
    }  # fmt: skip
    for name, ask in about.items():
        theirs, ours = medians(rounds, lambda: ask(p), lambda: ask(q))  # noqa: B023
        print(f"{name}: pybullet {theirs:.1f} µs, attach {ours:.1f} µs")
    p.disconnect(client)


def time_coal(rounds: int) -> None:
    coal = import_module("coal")
    from collide.adapters.hosts import coal_api

    turns = np.arange(500) + 0.5
    height, angle = 1.0 - turns / 250.0, np.pi * (1.0 + 5.0**0.5) * turns
    across = np.sqrt(1.0 - height**2)
    points = 0.5 * np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)
    facets = ConvexHull(points).simplices

    def ball_mesh(module):
        model = module.BVHModelOBBRSS()
        model.beginModel(len(facets), len(points))
        model.addVertices(points)
        model.addTriangles(facets)
        model.endModel()
        return model

    shapes = {
        "two boxes": lambda m: (m.Box(1, 1, 1), m.Box(1, 1, 1)),
        "ball and box": lambda m: (m.Sphere(0.5), m.Box(1, 1, 1)),
        "two balls of 996 triangles": lambda m: (ball_mesh(m), ball_mesh(m)),
    }
    for name, make in shapes.items():
        for where, away in (("apart", 1.5), ("meeting", 0.9)):
            row = []
            for ask in ("collide", "distance"):
                calls = []
                for module in (coal, coal_api):
                    ask_it = getattr(module, ask)
                    request = module.CollisionRequest() if ask == "collide" else module.DistanceRequest()
                    result = module.CollisionResult() if ask == "collide" else module.DistanceResult()
                    a, b = make(module)
                    X, Y = module.Transform3s(), module.Transform3s(np.eye(3), np.array([away, 0.05, 0.02]))

                    def call(f=ask_it, a=a, b=b, X=X, Y=Y, request=request, result=result):
                        result.clear()
                        f(a, X, b, Y, request, result)

                    calls.append(call)
                row.append("{}: coal {:.1f} µs, here {:.1f} µs".format(ask, *medians(rounds, *calls)))
            print(f"{name}, {where}: {'; '.join(row)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=400)
    rounds = parser.parse_args().rounds
    for time_host in (time_pybullet, time_coal):
        try:
            time_host(rounds)
        except ImportError as error:
            print(f"left out: {error}")


if __name__ == "__main__":
    main()
