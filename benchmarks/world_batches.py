"""The same bodies in 1,000 worlds at other poses: one call of a WorldBatch beside as many calls of a World.

    python benchmarks/world_batches.py              # two minutes
    python benchmarks/world_batches.py --quick      # half a minute; no file

worlds  µs a world, for `collides`, `minimum` and `distances` within 5 cm, of 50 bodies (boxes, balls, capsules and
        hulls, ten of them static) crowded, near each other and spread out, and of 10 and 200 bodies. A World is given
        all poses by `set_poses` and asked. Answers are compared byte by byte first.
robots  µs a world, for `collides` and `distances` of an arm of seven links, a configuration in each world, among 50
        bodies that all stand elsewhere: a RobotBatch beside a RobotChecker whose World is moved and asked.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

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


ARM = """<robot name="arm"><link name="l0"/>{}</robot>"""
LINK = """<link name="l{k}"><collision><origin xyz="0.15 0 0"/><geometry><box size="0.3 0.06 0.06"/></geometry>
</collision></link><joint name="j{k}" type="revolute"><parent link="l{before}"/><child link="l{k}"/>
<origin xyz="{x} 0 0"/><axis xyz="0 {y} {z}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""


def robots(options: Options, question: str, layout: str, n: int) -> Race:
    n_worlds = 200 if options.quick else 1000
    world, X_WBs = bodies(n, n_worlds, layout)
    links = (LINK.format(k=k, before=k - 1, x=0.3 if k > 1 else 0, y=k % 2, z=1 - k % 2) for k in range(1, 8))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "arm.urdf"
        place.write_text(ARM.format("".join(links)), encoding="utf-8")
        checker = collide.RobotChecker(collide.Robot.load(place), world)
    Q, names = np.random.default_rng(1).uniform(-1.5, 1.5, (n_worlds, 7)), list(world.names.values())
    batch, ids = collide.RobotBatch(checker, names), np.array(world.ids)

    def one_by_one() -> list:
        answers = []
        for q, X in zip(Q, X_WBs):
            world.set_poses(ids, X)
            answers.append(getattr(checker, question)(q))
        return answers

    def together():
        return getattr(batch, question)(Q, X_WBs)

    made, single = together(), one_by_one()
    if question == "collides":
        assert made.tolist() == single
        beside = {"hits": float(made.mean())}
    else:
        assert made.rows.tobytes() == b"".join(each.rows.tobytes() for each in single)
        beside = {"rows": len(made.rows) / n_worlds}
    return Race({"RobotBatch": together, "RobotChecker": one_by_one}, per=n_worlds, columns=beside)


def robot_cases(options: Options):
    yield from grid(question=("collides", "distances"), layout=LAYOUTS, n=(50,))


CLAIMS = [Claim("worlds", "µs a world", cases, worlds, unit="us", file="world_batches"),
          Claim("robots", "µs a world", robot_cases, robots, unit="us", file="robot_batches")]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
