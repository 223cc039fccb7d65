"""Worlds of many bodies beside the broadphase managers of coal and python-fcl: adding, moving, and asking all pairs.

    python benchmarks/worlds.py                  # 10² to 10⁵ bodies; some minutes
    python benchmarks/worlds.py --only bodies=100,1000

Boxes, spheres and capsules of about a metre at random poses in a cube, two densities: in "sparse" next to none meet, in
"crowded" each meets about one other. Tasks, µs of the processor a body:

    add         from nothing: `World.add` of every body; a manager's collision objects, registered and set up
    move        every body to another pose: `World.set_poses`; ``setTransform`` (and ``computeAABB``) of every object
    collides    after such a move: whether any pair hits. Sparse worlds have no early hit
    collisions  after such a move: every pair that hits (ours with depths, proven; theirs by contacts of each pair)
    distances   after such a move: every pair within 0.1 m. Managers have no such query: ours alone

Checked first: the same pairs hit, but for those within 1e-6 m of touching.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from inputs import poses
from world_peers import Coal, Engine, Fcl

import collide
from collide.adapters.bench.claims import Claim, Options, Race, check, grid, installed, main

#: Metres of the cube's side, by the third root of the number of bodies.
SPREAD = {"sparse": 12.0, "crowded": 1.6}
TASKS = ("add", "move", "collides", "collisions", "distances")
SHAPES = (collide.Box((1.0, 0.8, 0.6)), collide.Sphere(0.5), collide.Capsule(0.3, 0.6))


class Ours(Engine):
    def add(self) -> None:
        self.world = collide.World()
        for k, X in enumerate(self.X[self.at]):
            self.world.add(SHAPES[k % 3], X)

    def move(self) -> None:
        self.world.set_poses(self.ids, self.X[self.there()])

    def collides(self) -> bool:
        return self.world.collides()

    def collisions(self) -> np.ndarray:
        return self.world.collisions()

    def distances(self) -> np.ndarray:
        return self.world.distances(0.1)

    def hits(self) -> set[tuple[int, int]]:
        rows = self.world.collisions()
        return set(zip(rows["a"].tolist(), rows["b"].tolist()))


@cache
def engines(bodies: int, density: str) -> dict[str, Engine]:
    """Those that are installed, which agree on who hits, but where bodies all but touch."""
    rng = np.random.default_rng(bodies)
    X = poses(rng, bodies, 0.5 * SPREAD[density] * bodies ** (1 / 3))
    Y = X.copy()
    Y[:, :3, 3] += rng.uniform(-0.1, 0.1, (bodies, 3))
    kinds = {"coal": Coal, "fcl": Fcl}
    made = {"collide": Ours(np.stack([X, Y]))}
    made |= {name: kinds[name](np.stack([X, Y])) for name in installed(coal="coal", fcl="fcl")}
    world, hits = made["collide"].world, made["collide"].hits()
    for peer, engine in made.items():
        for a, b in hits ^ engine.hits():
            A, B = world.body(a), world.body(b)
            gap = collide.distance(A.shape, B.shape, A.X_WB, B.X_WB).distance
            check(abs(gap) <= 1e-6, f"{peer} disagrees about bodies {a} and {b} of {bodies}, {gap:g} m apart")
    return made


def measure(options: Options, bodies: int, density: str, task: str) -> Race:
    made = engines(bodies, density)
    return Race({name: e.task(task) for name, e in made.items() if hasattr(e, task)}, bodies)


def cases(options: Options):
    return grid(bodies=(100, 1000) if options.quick else (100, 1000, 10_000, 100_000), density=SPREAD, task=TASKS)


CLAIMS = [Claim("worlds", "µs a body", cases, measure)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
