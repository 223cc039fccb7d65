"""Single calls of pybullet and Pinocchio beside the same calls of collide.

    python benchmarks/host_calls.py

pybullet through `attach`, in a client of a floor, 100 balls that rest on it, and a hull. Pinocchio:
robots at random configurations. µs by the clock; engines that are not installed are left out.
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


@cache
def client() -> dict:
    """What is asked of a module by name, of pybullet and of the module that is used in place of it."""
    p = import_module("pybullet")
    from collide.adapters.hosts.pybullet_mirror import attach

    q, random = attach(p, exclusive=True), np.random.default_rng(0)
    number = q.connect(p.DIRECT)
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
            q.resetBasePositionAndOrientation(body, place, rotation, number)
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
    claim("pinocchio", "µs a configuration", pinocchio_cases, of_pinocchio, file="host-calls-pinocchio"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
