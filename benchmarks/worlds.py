"""Worlds of many bodies beside the broadphase managers of coal and python-fcl: adding, moving, and asking all pairs.

    python benchmarks/worlds.py                  # 10² to 10⁵ bodies; some minutes
    python benchmarks/worlds.py --sizes 100 1000

Boxes, spheres and capsules of about a metre at random poses in a cube, two densities: in "sparse" next to none meet, in
"crowded" each meets about one other. Tasks, a body each:

    add         from nothing: `World.add` of every body; a manager's collision objects, registered and set up
    move        every body to another pose: `World.set_poses`; ``setTransform`` (and ``computeAABB``) of every object
    collides    after such a move: whether any pair hits. Sparse worlds have no early hit
    collisions  after such a move: every pair that hits (ours with depths, proven; theirs by contacts of each pair)
    distances   after such a move: every pair within 0.1 m. Managers have no such query: ours alone

Engines take turns; of every task the median, the least and the largest of the turns, CPU time of this process. Ratios
are of medians, theirs by ours. Checked first: the same pairs hit, but for those within 1e-6 m of touching.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import collide

RESULTS = Path(__file__).resolve().parent / "results"
SIZES = (100, 1000, 10_000, 100_000)
#: Metres of the cube's side, by the third root of the number of bodies.
SPREAD = {"sparse": 12.0, "crowded": 1.6}
#: Seconds that the turns of one size may take, and how many there are.
SECONDS, TURNS = 40.0, 9

SHAPES = (collide.Box((1.0, 0.8, 0.6)), collide.Sphere(0.5), collide.Capsule(0.3, 0.6))
Tasks = dict[str, Callable[[], object]]


def poses(n: int, spread: float, seed: int) -> np.ndarray:
    """(2, n, 4, 4): two sets of random poses, that bodies move to and fro between, a tenth of a metre apart."""
    rng = np.random.default_rng(seed)
    side = spread * n ** (1 / 3)
    X = np.array([collide.pose(p, quat_wxyz=q) for p, q in zip(rng.uniform(0, side, (n, 3)), rng.normal(size=(n, 4)))])
    Y = X.copy()
    Y[:, :3, 3] += rng.uniform(-0.1, 0.1, (n, 3))
    return np.stack([X, Y])


class Ours:
    """`collide.World`."""

    def __init__(self, X: np.ndarray):
        self.X, self.at, self.ids = X, 0, np.arange(len(X[0]))
        self.world = self.add()

    def add(self) -> collide.World:
        world = collide.World()
        for k, X in enumerate(self.X[0]):
            world.add(SHAPES[k % len(SHAPES)], X)
        return world

    def move(self) -> None:
        self.at = 1 - self.at
        self.world.set_poses(self.ids, self.X[self.at])

    def hits(self) -> set[tuple[int, int]]:
        rows = self.world.collisions()
        return set(zip(rows["a"].tolist(), rows["b"].tolist()))

    def tasks(self) -> Tasks:
        def after_move(ask: Callable[[], object]) -> Callable[[], object]:
            return lambda: (self.move(), ask())[1]

        world = self.world
        return {
            "add": self.add, "move": self.move, "collides": after_move(world.collides),
            "collisions": after_move(world.collisions), "distances": after_move(lambda: world.distances(0.1)),
        }  # fmt: skip


class Coal:
    """coal's `DynamicAABBTreeCollisionManager`, its callbacks in C++."""

    def __init__(self, X: np.ndarray):
        import coal

        self.coal, self.X, self.at = coal, X, 0
        box, ball, capsule = coal.Box(*SHAPES[0].size), coal.Sphere(0.5), coal.Capsule(0.3, 0.6)
        self.geometries = box, ball, capsule
        self.transforms = [
            [coal.Transform3s(np.array(x[:3, :3]), np.array(x[:3, 3])) for x in some] for some in X
        ]
        self.manager, self.objects = self.add()

    def add(self):
        coal, n = self.coal, len(self.X[0])
        manager = coal.DynamicAABBTreeCollisionManager()
        objects = [coal.CollisionObject(self.geometries[k % 3], self.transforms[0][k]) for k in range(n)]
        for obj in objects:
            manager.registerObject(obj)
        manager.setup()
        return manager, objects

    def move(self) -> None:
        self.at = 1 - self.at
        for obj, transform in zip(self.objects, self.transforms[self.at]):
            obj.setTransform(transform)
            obj.computeAABB()
        self.manager.update()

    def collides(self) -> bool:
        callback = self.coal.CollisionCallBackDefault()
        callback.data.request.num_max_contacts = 1
        self.manager.collide(callback)
        return callback.data.result.isCollision()

    def collisions(self):
        callback = self.coal.CollisionCallBackDefault()
        callback.data.request.num_max_contacts = 1 << 30
        self.manager.collide(callback)
        return callback.data.result

    def hits(self) -> set[tuple[int, int]]:
        """Coal's contacts do not name their bodies in Python: every pair whose boxes meet, asked alone."""
        coal = self.coal
        boxes = [obj.getAABB() for obj in self.objects]
        low, high = np.array([box.min_ for box in boxes]), np.array([box.max_ for box in boxes])
        hits, request = set(), coal.CollisionRequest()
        for i, obj in enumerate(self.objects):
            near = (low[i] <= high[i + 1 :]).all(axis=1) & (low[i + 1 :] <= high[i]).all(axis=1)
            for j in (np.flatnonzero(near) + i + 1).tolist():
                if coal.collide(obj, self.objects[j], request, coal.CollisionResult()):
                    hits.add((i, j))
        return hits

    def tasks(self) -> Tasks:
        return {
            "add": self.add, "move": self.move, "collides": lambda: (self.move(), self.collides()),
            "collisions": lambda: (self.move(), self.collisions()),
        }  # fmt: skip


class Fcl:
    """python-fcl's `DynamicAABBTreeCollisionManager`, its default callbacks in Python."""

    def __init__(self, X: np.ndarray):
        import fcl

        self.fcl, self.X, self.at = fcl, X, 0
        self.geometries = fcl.Box(*SHAPES[0].size), fcl.Sphere(0.5), fcl.Capsule(0.3, 0.6)
        self.transforms = [[fcl.Transform(x[:3, :3], x[:3, 3]) for x in some] for some in X]
        self.manager, self.objects = self.add()

    def add(self):
        fcl, n = self.fcl, len(self.X[0])
        manager = fcl.DynamicAABBTreeCollisionManager()
        objects = [fcl.CollisionObject(self.geometries[k % 3], self.transforms[0][k]) for k in range(n)]
        manager.registerObjects(objects)
        manager.setup()
        return manager, objects

    def move(self) -> None:
        self.at = 1 - self.at
        for obj, transform in zip(self.objects, self.transforms[self.at]):
            obj.setTransform(transform)
        self.manager.update()

    def collisions(self, max_contacts: int):
        data = self.fcl.CollisionData(request=self.fcl.CollisionRequest(num_max_contacts=max_contacts))
        self.manager.collide(data, self.fcl.defaultCollisionCallback)
        return data.result

    def hits(self) -> set[tuple[int, int]]:
        # The callback gets objects of its own: they are known by where they are.
        place = {tuple(obj.getTranslation()): k for k, obj in enumerate(self.objects)}
        hits, request = set(), self.fcl.CollisionRequest()

        def ask(a, b, _data) -> bool:
            if self.fcl.collide(a, b, request, self.fcl.CollisionResult()):
                i, j = place[tuple(a.getTranslation())], place[tuple(b.getTranslation())]
                hits.add((min(i, j), max(i, j)))
            return False

        self.manager.collide(None, ask)
        return hits

    def tasks(self) -> Tasks:
        return {
            "add": self.add, "move": self.move, "collides": lambda: (self.move(), self.collisions(1)),
            "collisions": lambda: (self.move(), self.collisions(1 << 30)),
        }  # fmt: skip


def engines(X: np.ndarray) -> dict:
    """Those that are installed."""
    made = {"collide": Ours(X)}
    for name, engine in (("coal", Coal), ("python-fcl", Fcl)):
        try:
            made[name] = engine(X)
        except ImportError:
            print(f"{name} is not installed: left out")
    return made


def check(made: dict, name: str) -> None:
    """Engines agree on who hits, but where bodies all but touch. Raises SystemExit."""
    ours = made["collide"]
    hits = ours.hits()
    for peer, engine in made.items():
        for a, b in hits ^ engine.hits():
            A, B = ours.world.body(a), ours.world.body(b)
            distance = collide.distance(A.shape, B.shape, A.X_WB, B.X_WB).distance
            if abs(distance) > 1e-6:
                raise SystemExit(f"{name}: {peer} disagrees about bodies {a} and {b}, {distance:g} m apart")
    print(f"{name}: {len(hits)} pairs hit")


def cpu_time(task: Callable[[], object]) -> float:
    started = time.process_time()
    task()
    return time.process_time() - started


def measure(n: int, density: str) -> list[dict]:
    made = engines(poses(n, SPREAD[density], seed=n))
    check(made, f"{n} bodies, {density}")
    tasks = {(name, task): call for name, engine in made.items() for task, call in engine.tasks().items()}
    times: dict[tuple[str, str], list[float]] = {key: [] for key in tasks}
    started = time.perf_counter()
    for round_number in range(TURNS):
        for key, call in tasks.items():
            times[key].append(cpu_time(call) / n * 1e6)
        if round_number >= 2 and time.perf_counter() - started > SECONDS:
            break
    ours = {task: statistics.median(values) for (name, task), values in times.items() if name == "collide"}
    return [
        {
            "bodies": n, "density": density, "task": task, "engine": name,
            "median_us_a_body": round(statistics.median(values), 4), "min": round(min(values), 4),
            "max": round(max(values), 4), "turns": len(values),
            "ratio": round(statistics.median(values) / ours[task], 2),
        }
        for (name, task), values in times.items()
    ]  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--no-csv", action="store_true", help="keep the results as they are")
    options = parser.parse_args()
    rows = []
    for n in options.sizes:
        for density in SPREAD:
            for row in measure(n, density):
                rows.append(row)
                print(
                    f"{row['bodies']:>7} {density:<8} {row['task']:<11} {row['engine']:<11} "
                    f"{row['median_us_a_body']:>10.3f} µs a body   × {row['ratio']}"
                )
    if not options.no_csv:
        machine = {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()}
        with open(RESULTS / "worlds.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [*rows[0], *machine])
            writer.writeheader()
            writer.writerows(row | machine for row in rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
