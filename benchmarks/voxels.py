"""What a grid of voxels costs, to make and to ask, beside coal's octree.

    python benchmarks/voxels.py --table made asked

made    a VoxelGrid from an array of n³ flags, and from the list of its occupied cells, beside coal's OcTree of the
        middles of these
asked   spheres, convex shapes, gaps; ours in batches, coal in a loop of Python

The grid spans 2 m. "room": its outermost layers are occupied; "dust": one cell in a hundred, anywhere.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from clouds import coal_calls, poses, shapes

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main

_EYE = np.eye(4)
#: Cells of which coal makes a tree in seconds.
_MAX_COAL = 10**5


@cache
def flags(n: int, where: str) -> np.ndarray:
    if where == "dust":
        return np.random.default_rng(n).random((n, n, n), dtype=np.float32) < 0.01
    occupied = np.ones((n, n, n), dtype=bool)
    occupied[1:-1, 1:-1, 1:-1] = False
    return occupied


def middles(n: int, where: str) -> np.ndarray:
    return (np.argwhere(flags(n, where)) + 0.5) * (2.0 / n) - 1.0


def voxels_of(n: int, where: str) -> collide.VoxelGrid:
    return collide.VoxelGrid(flags(n, where), 2.0 / n, collide.pose((-1.0, -1.0, -1.0)))


def made(options: Options, n: int, where: str) -> Race:
    occupied, cells = flags(n, where), np.argwhere(flags(n, where))
    tasks = {
        "collide": lambda: collide.VoxelGrid(occupied, 2.0 / n), "of a list": lambda: collide.VoxelGrid(cells, 2.0 / n),
    }
    if installed(coal="coal") and len(cells) <= _MAX_COAL:
        import coal

        places = middles(n, where)
        tasks["coal"] = lambda: coal.makeOctree(places, 2.0 / n)
    made_grid = voxels_of(n, where)
    return Race(tasks, columns={"cells": made_grid.count, "bytes_a_cell": made_grid.tree.nbytes / made_grid.count})


@cache
def asked_of(n: int, where: str, asks: int) -> dict:
    """{question: {engine: call}}"""
    made_grid, X = voxels_of(n, where), poses(asks)
    calls: dict = {name: {"collide": partial(collide.collide, made_grid, S, _EYE, X)} for name, S in shapes().items()}
    calls["gap of a box"] = {"collide": partial(collide.distance, made_grid, shapes()["box"], _EYE, X, signed=False)}
    if installed(coal="coal") and made_grid.count <= _MAX_COAL:
        for name, call in coal_calls(middles(n, where), 2.0 / n, X).items():
            calls[name]["coal"] = call
    for tasks in calls.values():
        for call in tasks.values():
            call()
    return calls


def asked(options: Options, n: int, where: str, question: str) -> Race:
    asks = 200 if options.quick else 2000
    return Race(asked_of(n, where, asks)[question], per=asks)


def sizes(options: Options) -> tuple[int, ...]:
    return (32, 64) if options.quick else (64, 128, 256, 512)


CLAIMS = [
    Claim("made", "ms to make a grid", lambda o: grid(n=sizes(o), where=("room", "dust")), made, unit="ms",
          file="voxels-made", turns=5),
    Claim("asked", "µs a question to a grid",
          lambda o: grid(n=sizes(o)[:3], where=("room", "dust"), question=(*shapes(), "gap of a box")), asked,
          file="voxels-asked", turns=5),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
