"""Steps of Worlds: every pair after every body has moved, after few have, after some came and went; memory a body.

    python benchmarks/world_steps.py                 # a minute or two

Boxes and hulls of 12 points, a tenth to a third of a metre. "random": in a cube, a third of them hit something;
"sparse": the same, far enough apart that no two hit; "pit": in layers on a static floor between static walls, each a
millimetre from its neighbours. In a step all move by up to a centimetre (in the pit, a tenth of a millimetre), unless
said. Milliseconds of the processor:

    move              `set_poses`
    collides          a boolean, after such a step
    collisions        hitting pairs with depths, after such a step
    contacts          manifolds, after such a step
    few moved         one body in a hundred moves, then `collides`
    come and go       ten bodies are removed and ten added, then `collides`
    minimum           the nearest pair
    all asleep        nothing moves, all sleep: `collides`
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main
from collide.adapters.bench.turns import Seconds


class Scene:
    """A World, where its moving bodies are, and how far they go in a step."""

    def __init__(self, layout: str, n: int):
        self.rng, self.world = np.random.default_rng(n), collide.World()
        rng = self.rng
        self.shapes = [collide.Box(rng.uniform(0.1, 0.3, 3)) for _ in range(20)]
        self.shapes += [collide.ConvexHull(rng.normal(size=(12, 3)) * 0.1) for _ in range(20)]
        side = n ** (1 / 3) * (0.5 if layout == "random" else 2.0)
        self.step = 1e-4 if layout == "pit" else 0.01
        if layout == "pit":
            self.shapes = [collide.Box((0.199, 0.199, 0.199))] * 20
            width = max(2, round(n ** (1 / 3)))
            cells = np.array([(k % width, k // width % width, k // width**2) for k in range(n)])
            self.X = np.tile(np.eye(4), (n, 1, 1))
            self.X[:, :3, 3] = 0.2 * cells + 0.1
            for axis in range(3):
                for end in (0.0, 0.2 * width)[: 1 if axis == 2 else 2]:
                    X, size = np.eye(4), np.full(3, 0.2 * width + 2.0)
                    X[:3, 3], size[axis] = 0.1 * width, 1.0
                    X[axis, 3] = end + (0.5005 if end else -0.5005)
                    self.world.add(collide.Box(size), X, static=True)
        else:
            places, turns = rng.uniform(0, side, (n, 3)), rng.normal(size=(n, 4))
            self.X = np.array([collide.pose(p, quat_wxyz=q) for p, q in zip(places, turns)])
        started = time.process_time()
        self.ids = np.array([self.world.add(self.shapes[k % len(self.shapes)], X) for k, X in enumerate(self.X)])
        self.us_to_add = (time.process_time() - started) / n * 1e6
        self.sparse = np.sort(rng.choice(n, max(1, n // 100), replace=False))

    def move(self, some: slice | np.ndarray = slice(None)) -> float:
        """Seconds of telling where bodies are now."""
        X = self.X[some].copy()
        X[:, :3, 3] += self.rng.uniform(-self.step, self.step, (len(X), 3))
        started = time.process_time()
        self.world.set_poses(self.ids[some], X)
        return time.process_time() - started

    def asked(self, ask) -> Seconds:
        """After all have moved."""
        self.move()
        started = time.process_time()
        ask()
        return Seconds(time.process_time() - started)

    def sparse_moved(self) -> Seconds:
        spent, started = self.move(self.sparse), time.process_time()
        self.world.collides()
        return Seconds(spent + time.process_time() - started)

    def come_and_go(self) -> None:
        for k in self.rng.choice(len(self.ids), 10, replace=False).tolist():
            self.world.remove(int(self.ids[k]))
            self.ids[k] = self.world.add(self.shapes[k % len(self.shapes)], self.X[k])
        self.world.collides()

    def asleep(self) -> Seconds:
        self.world.sleep(self.world.ids)
        started = time.process_time()
        self.world.collides()
        spent = time.process_time() - started
        self.world.wake(self.world.ids)
        return Seconds(spent)


def measure(options: Options, layout: str, bodies: int) -> Race:
    scene = Scene(layout, bodies)
    world = scene.world
    tasks = {"move": lambda: Seconds(scene.move())}
    for task in ("collides", "collisions", "contacts"):
        tasks[task] = partial(scene.asked, getattr(world, task))
    tasks |= {"few moved": scene.sparse_moved, "come and go": scene.come_and_go, "minimum": world.minimum}
    scene.move()
    about = {"hits": len(world.collisions()), "bytes_per_body": world.stats["bytes_per_body"]}
    return Race(tasks | {"all asleep": scene.asleep}, columns=about | {"us_to_add": scene.us_to_add})


def cases(options: Options):
    sizes = (100, 1000) if options.quick else (100, 1000, 5000, 20_000)
    return grid(layout=("random", "sparse", "pit"), bodies=sizes)


CLAIMS = [Claim("world_steps", "ms a step; × against telling where bodies are", cases, measure, unit="ms", turns=11)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
