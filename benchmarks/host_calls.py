"""Single calls of pybullet, coal and Pinocchio beside the same calls of collide.

    python benchmarks/host_calls.py

pybullet through `attach`, in a client of a floor, 100 balls that rest on it, and a hull. coal: shapes that are apart
and that meet, with the default request for contacts. Pinocchio: robots at random configurations. µs by the clock;
engines that are not installed are left out.
"""

from __future__ import annotations

import time
from functools import cache, partial
from importlib import import_module

import numpy as np
from inputs import use_tests

use_tests("differential")
import pinocchio_robots

from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.adapters.peers.hull_facets import triangulate


@cache
def client() -> dict:
    """What is asked of a module by name, of pybullet and of its mirror, which is attached to the client."""
    p = import_module("pybullet")
    from collide.adapters.hosts.pybullet_mirror import attach

    number = p.connect(p.DIRECT)
    q, random = attach(p, number), np.random.default_rng(0)
    q.createMultiBody(0.0, q.createCollisionShape(p.GEOM_PLANE))
    ball = q.createCollisionShape(p.GEOM_SPHERE, radius=0.2)
    balls = [q.createMultiBody(1.0, ball, basePosition=[*random.uniform(-4, 4, 2), 0.2]) for _ in range(100)]
    corners = [[x, y, z] for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (-0.3, 0.3)]
    shape = q.createCollisionShape(p.GEOM_MESH, vertices=corners)
    hull = q.createMultiBody(1.0, shape, basePosition=[0.0, 0.0, 0.3])
    q.stepSimulation()
    mirror, places = q.mirror_of(number), [p.getBasePositionAndOrientation(body, number) for body in balls]

    def moved() -> None:
        for body, (place, rotation) in zip(balls, places):
            p.resetBasePositionAndOrientation(body, place, rotation, number)
        mirror.update()

    ends = [[x, y, 5.0] for x, y in random.uniform(-4, 4, (100, 2))], [[0.0, 0.0, -1.0]] * 100
    of_shape = {"collisionShapeB": shape, "collisionShapePositionB": [0, 0, 1],
                "collisionShapeOrientationB": [0, 0, 0, 1]}
    questions = {
        "closest points of two bodies": ("getClosestPoints", (balls[0], hull, 9.0), {}),
        "closest points of a body and a shape": ("getClosestPoints", (balls[0], -1, 9.0), of_shape),
        "contacts of two bodies": ("getContactPoints", (balls[0], hull), {}),
        "contacts of all": ("getContactPoints", (), {}), "a ray": ("rayTest", (ends[0][0], ends[1][0]), {}),
        "a batch of 100 rays": ("rayTestBatch", ends, {}),
    }
    calls: dict = {"update of 102 bodies": {"collide": mirror.update}, "100 reset, and update": {"collide": moved}}
    for name, (method, positional, named) in questions.items():
        named = named | {"physicsClientId": number}
        calls[name] = {engine: partial(getattr(module, method), *positional, **named)
                       for engine, module in (("collide", q), ("pybullet", p))}
    return calls


def sphere_points() -> np.ndarray:
    turns = np.arange(500) + 0.5
    height, angle = 1.0 - turns / 250.0, np.pi * (1.0 + 5.0**0.5) * turns
    across = np.sqrt(1.0 - height**2)
    return 0.5 * np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def ball_mesh(module):
    points, facets = triangulate(sphere_points())
    model = module.BVHModelOBBRSS()
    model.beginModel(len(facets), len(points))
    model.addVertices(points)
    model.addTriangles(facets)
    model.endModel()
    return model


SHAPES = {
    "two boxes": lambda m: (m.Box(1, 1, 1), m.Box(1, 1, 1)), "ball and box": lambda m: (m.Sphere(0.5), m.Box(1, 1, 1)),
    "two balls of 996 triangles": lambda m: (ball_mesh(m), ball_mesh(m)),
}


def of_coal(options: Options, shapes: str, where: str, question: str) -> Race:
    from collide.adapters.hosts import coal_api

    tasks = {}
    for name, module in (("collide", coal_api), ("coal", import_module("coal"))):
        kind = "Collision" if question == "collide" else "Distance"
        request, result = getattr(module, f"{kind}Request")(), getattr(module, f"{kind}Result")()
        a, b = SHAPES[shapes](module)
        away = 1.5 if where == "apart" else 0.9
        asked = a, module.Transform3s(), b, module.Transform3s(np.eye(3), np.array([away, 0.05, 0.02])), request, result

        def call(ask=getattr(module, question), asked=asked) -> None:  # noqa: B008
            asked[-1].clear()
            ask(*asked)

        tasks[name] = call
    return Race(tasks)


def coal_cases(options: Options):
    shapes, questions = SHAPES if installed(coal="coal") else (), ("collide", "distance")
    return grid(shapes=shapes, where=("apart", "meeting"), question=questions)


def of_pinocchio(options: Options, robot: str, question: str) -> Race:
    """µs a configuration: all pairs with results, or whether any collides, ours of all configurations in one call."""
    import pinocchio as pin

    from collide.adapters.hosts import pinocchio as host

    model, geom_model = pinocchio_robots.load(robot)
    data, ours, theirs = model.createData(), geom_model.createData(), geom_model.createData()
    low, high = np.maximum(model.lowerPositionLimit, -3.0), np.minimum(model.upperPositionLimit, 3.0)
    Q = np.random.default_rng(22).uniform(low, high, (10 if options.quick else 100, model.nq))
    first = question == "any"
    tasks = {"collide": lambda: [host.compute_collisions(model, data, geom_model, ours, q) for q in Q],
             "pinocchio": lambda: [pin.computeCollisions(model, data, geom_model, theirs, q, first) for q in Q]}
    if first:
        tasks["collide"] = lambda: host.collides(model, data, geom_model, ours, Q)
    return Race(tasks, len(Q))


def pinocchio_cases(options: Options):
    present = installed(pinocchio="pinocchio") and pinocchio_robots.robots_folder()
    return grid(robot=list(pinocchio_robots.ROBOTS)[: 1 if options.quick else None] if present else (),
                question=("all pairs", "any"))


claim = partial(Claim, turns=40, seconds=3.0, clock=time.perf_counter)
CLAIMS = [
    claim("pybullet", "µs a call", lambda o: grid(call=client() if installed(pybullet="pybullet") else ()),
          lambda o, call: Race(client()[call]), file="host-calls-pybullet"),
    claim("coal", "µs a call", coal_cases, of_coal, file="host-calls-coal"),
    claim("pinocchio", "µs a configuration", pinocchio_cases, of_pinocchio, file="host-calls-pinocchio"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
