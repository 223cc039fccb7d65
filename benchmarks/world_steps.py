"""Steps of Worlds: every pair after every body has moved, after few have, after some came and went; memory a body.

    python benchmarks/world_steps.py                 # a minute or two

Boxes and hulls of 12 points, a tenth to a third of a metre. "random": in a cube, a third of them hit something;
"sparse": the same, far enough apart that no two hit; "pit": in layers on a static floor between static walls, each a
millimetre from its neighbours. In a step all move by up to a centimetre (in the pit, a tenth of a millimetre), unless
said.

    move              `set_poses`
    collides          a boolean, after such a step
    collisions        hitting pairs with depths
    contacts          manifolds
    few moved         one body in a hundred moves, then `collides`
    come and go       ten bodies are removed and ten added, then `collides`
    minimum           the nearest pair
    all asleep        nothing moves, all sleep: `collides`

Milliseconds of CPU time of this process; medians.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from convex import write
from startup import machine

import collide

SIZES = (100, 1000, 5000, 20_000)
LAYOUTS = ("random", "sparse", "pit")
REPEATS = 11


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

    def jittered(self, some: slice | np.ndarray) -> np.ndarray:
        X = self.X[some].copy()
        X[:, :3, 3] += self.rng.uniform(-self.step, self.step, (len(X), 3))
        return X

    def move(self, some: slice | np.ndarray = slice(None)) -> None:
        self.world.set_poses(self.ids[some], self.moved)

    def come_and_go(self) -> None:
        for k in self.rng.choice(len(self.ids), 10, replace=False).tolist():
            self.world.remove(int(self.ids[k]))
            self.ids[k] = self.world.add(self.shapes[k % len(self.shapes)], self.X[k])


def cpu_ms(task: Callable[[], object]) -> float:
    started = time.process_time()
    task()
    return (time.process_time() - started) * 1e3


def measure(layout: str, n: int) -> list[dict]:
    scene = Scene(layout, n)
    world, sparse = scene.world, np.sort(scene.rng.choice(n, max(1, n // 100), replace=False))
    times: dict[str, list[float]] = {}

    def note(task: str, call: Callable[[], object]) -> None:
        times.setdefault(task, []).append(cpu_ms(call))

    for _ in range(REPEATS):
        for task in ("collides", "collisions", "contacts"):
            scene.moved = scene.jittered(slice(None))
            note("move", scene.move)
            note(task, getattr(world, task))
    hits = len(world.collisions())
    bytes_per_body = world.stats["bytes_per_body"]
    for _ in range(REPEATS):
        scene.moved = scene.jittered(sparse)
        note("few moved", lambda: (scene.move(sparse), world.collides()))
    for _ in range(REPEATS):
        note("come and go", lambda: (scene.come_and_go(), world.collides()))
    for _ in range(3):
        note("minimum", world.minimum)
    world.sleep(world.ids)
    for _ in range(REPEATS):
        note("all asleep", world.collides)
    shared = {"layout": layout, "bodies": n, "hits": hits, "bytes_per_body": bytes_per_body}
    rows = [shared | {"task": "add (µs a body)", "median": round(scene.us_to_add, 2), "min": "", "max": ""}]
    return rows + [
        shared
        | {"task": task, "median": round(statistics.median(values), 4), "min": round(min(values), 4)}
        | {"max": round(max(values), 4)}
        for task, values in times.items()
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--layouts", nargs="+", default=LAYOUTS, choices=LAYOUTS)
    parser.add_argument("--no-csv", action="store_true", help="keep the results as they are")
    options = parser.parse_args()
    rows = []
    for layout in options.layouts:
        for n in options.sizes:
            measured = measure(layout, n)
            rows += measured
            figures = "  ".join(f"{row['task']} {row['median']}" for row in measured)
            first = measured[0]
            print(f"{layout:<7}{n:>7}  {first['hits']:>6} hits  {first['bytes_per_body']} B a body  {figures}")
    if not options.no_csv:
        write("world_steps", rows, machine())
    return 0


if __name__ == "__main__":
    sys.exit(main())
