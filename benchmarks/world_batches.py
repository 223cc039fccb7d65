"""The same bodies in 1,000 worlds at other poses: one call of a WorldBatch beside as many calls of a World.

    python benchmarks/world_batches.py              # two minutes
    python benchmarks/world_batches.py --quick      # half a minute; no file

worlds  µs a world, for `collides`, `minimum` and `distances` within 5 cm, of 50 bodies (boxes, balls, capsules and
        hulls, ten of them static) crowded, near each other and spread out, and of 10 and 200 bodies. A World is given
        all poses by `set_poses` and asked. Answers are compared byte by byte first.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main

#: Half the side of the cube that the origins of 50 bodies are drawn in [m]; of n bodies it has n/50 the volume.
LAYOUTS = {"crowded": 1.0, "near": 1.5, "spread": 3.0}
QUESTIONS: dict[str, Callable] = {
    "collides": lambda asked, *poses: asked.collides(*poses),
    "minimum": lambda asked, *poses: asked.minimum(*poses),
    "distances": lambda asked, *poses: asked.distances(*poses, max_distance=0.05),
}


def bodies(n: int, n_worlds: int, layout: str) -> tuple[collide.World, np.ndarray]:
    rng, world = np.random.default_rng(0), collide.World()
    for k in range(n):
        world.add(
            (
                collide.Box(rng.uniform(0.1, 0.4, 3)), collide.Sphere(rng.uniform(0.05, 0.2)),
                collide.Capsule(rng.uniform(0.05, 0.1), 0.3), collide.ConvexHull(0.1 * rng.normal(size=(20, 3))),
            )[k % 4],
            static=5 * k < n,
        )
    half = LAYOUTS[layout] * (n / 50) ** (1 / 3)
    p, q = rng.uniform(-half, half, (n_worlds * n, 3)), rng.normal(size=(n_worlds * n, 4))
    return world, collide.poses(p, quat_wxyz=q).reshape(n_worlds, n, 4, 4)


def worlds(options: Options, question: str, layout: str, n: int) -> Race:
    n_worlds = 200 if options.quick else 1000
    world, X_WBs = bodies(n, n_worlds, layout)
    ask, batch, ids = QUESTIONS[question], collide.WorldBatch(world), np.array(world.ids)

    def one_by_one() -> list:
        answers = []
        for X in X_WBs:
            world.set_poses(ids, X)
            answers.append(ask(world))
        return answers

    together, single = ask(batch, X_WBs), one_by_one()
    if question == "collides":
        assert together.tolist() == single
        beside = {"hits": float(together.mean())}
    else:
        assert all(mine.rows.tobytes() == theirs.rows.tobytes() for mine, theirs in zip(together, single))
        beside = {"rows": len(together.rows) / n_worlds}
    return Race(
        {"WorldBatch": lambda: ask(batch, X_WBs), "World": one_by_one}, per=n_worlds, columns=beside,
    )


def cases(options: Options):
    yield from grid(question=QUESTIONS, layout=LAYOUTS, n=(50,))
    yield from grid(question=QUESTIONS, layout=("near",), n=(10, 200))


CLAIMS = [Claim("worlds", "µs a world", cases, worlds, unit="us", file="world_batches")]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
