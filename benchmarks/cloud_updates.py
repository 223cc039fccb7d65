"""What it costs to have points come and go in a cloud, and what is asked of it afterwards, beside a cloud made anew.

    python benchmarks/cloud_updates.py --table updated worn

updated points come and go, beside a cloud and its tree made anew of the points after the change
worn    what is asked of a cloud after updates of 1/100 of its points, beside a cloud made anew

µs a call; points and balls of `clouds.py`.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from clouds import points_of, poses, shapes, sizes

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main

_RADIUS, _EYE = 0.005, np.eye(4)


def change_of(cloud: collide.PointCloud, where: str, n: int, rng: np.random.Generator) -> dict:
    """n points come and as many go."""
    return {
        "added": 0.99 * points_of(10**6, where)[rng.integers(0, 10**6, n)],
        "removed": rng.choice(len(cloud), n, replace=False),
    }


def updated(options: Options, points: int, where: str, change: str) -> Race:
    cloud = collide.PointCloud(points_of(points, where), _RADIUS)
    n = points // 10 if change == "10 %" else int(change)
    comes_and_goes = change_of(cloud, where, n, np.random.default_rng(4))
    bare = cloud.updated(**comes_and_goes)
    tasks = {"without a tree": lambda: cloud.updated(**comes_and_goes)}
    with_tree = collide.PointCloud(cloud.points, _RADIUS)
    with_tree.nearest((0.0, 0.0, 0.0))
    tasks["collide"] = lambda: with_tree.updated(**comes_and_goes)
    tasks["made anew"] = lambda: collide.PointCloud(bare.points, _RADIUS).tree
    return Race(tasks)


@cache
def worn_cloud(points: int, where: str, updates: int) -> collide.PointCloud:
    cloud, rng = collide.PointCloud(points_of(points, where), _RADIUS), np.random.default_rng(5)
    cloud.nearest((0.0, 0.0, 0.0))
    for _ in range(updates):
        cloud = cloud.updated(**change_of(cloud, where, points // 200, rng))
    return cloud


def worn(options: Options, points: int, where: str, updates: int, question: str) -> Race:
    n = 500 if options.quick else 5000
    cloud, X = worn_cloud(points, where, updates), poses(n)
    tasks = {}
    for name, asked_cloud in (("collide", cloud), ("made anew", collide.PointCloud(cloud.points, _RADIUS))):
        if question == "nearest":
            tasks[name] = partial(asked_cloud.nearest, np.ascontiguousarray(X[:, :3, 3]))
        else:
            tasks[name] = partial(collide.collide, asked_cloud, shapes()[question], _EYE, X)
        tasks[name]()
    return Race(tasks, per=n)


def updated_cases(options: Options):
    return grid(points=sizes(options)[1:4], where=("cube", "room"), change=("10", "300", "10 %"))


def worn_cases(options: Options):
    questions = ("sphere", "box", "hull of 64", "nearest")
    points = sizes(options)[1:2] if options.quick else (10**5,)
    return grid(points=points, where=("cube", "room"), updates=(1, 10, 100), question=questions)


CLAIMS = [
    Claim("updated", "µs until a changed cloud has its tree", updated_cases, updated, file="clouds-updated", turns=9),
    Claim("worn", "µs a question to a cloud after updates", worn_cases, worn, file="clouds-worn", turns=9),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
