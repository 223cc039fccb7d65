"""The kernels are plain Python too: without compilation the same source gives the same bits."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from itertools import combinations_with_replacement
from pathlib import Path

import naive
from naive import Case, pose, random_pose, rng_of

import collide

CHILD = """
import pickle, sys
import collide
from collide import kernels
assert kernels.PLAIN_PYTHON
rows = [(collide.distance(*case).rows, collide.collide(*case)) for case in pickle.load(sys.stdin.buffer)]
world = collide.World()
for shape, X in pickle.load(sys.stdin.buffer):
    world.add(shape, X)
rows.append((world.distances(max_distance=0.3).rows, world.collides()))
pickle.dump(rows, sys.stdout.buffer)
"""


def cases() -> list[Case]:
    rng = rng_of("plain")
    kinds = [kind for kind in naive.KINDS if kind not in ("Compound", "HPolytope")]
    chosen = [pair for pair in combinations_with_replacement(kinds, 2) if set(pair) != {"Halfspace"}]
    made = []
    for kind_a, kind_b in chosen:
        A, B = naive.one_of_each(rng)[kind_a], naive.one_of_each(rng)[kind_b]
        made.append(Case(A, B, random_pose(rng, 0.6), random_pose(rng, 0.6)))
    box = collide.Box((1, 0.5, 0.25))
    for t in ((1, 0.25, 0.125), (1 + 2**-52, 0.25, 0.125), (1 - 2**-53, 0, 0)):  # the exact stage
        made.append(Case(box, box, pose(t=(0.125, 3, 2)), pose(t=(0.125, 3, 2)) @ pose(t=t)))
    for gap in (1e-15, -1e-15, 1e-9):
        A, B = (collide.ConvexHull(naive.hull_points(rng, 9)) for _ in range(2))
        made.append(naive.with_gap(Case(A, B, random_pose(rng), random_pose(rng)), gap))
    for kind in ("Compound", "HPolytope"):
        made.append(Case(naive.one_of_each(rng)[kind], box, random_pose(rng), random_pose(rng)))
    return made


def scene():
    rng = rng_of("plain scene")
    return [(naive.one_of_each(rng)[kind], random_pose(rng, 1.0)) for kind in naive.KINDS]


def test_without_compilation_the_bits_are_the_same():
    asked = cases()
    assert len(asked) >= 40
    child = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CHILD],
        input=pickle.dumps([tuple(case) for case in asked]) + pickle.dumps(scene()),
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, cwd=Path(collide.__file__).parents[1],
        capture_output=True, timeout=300, check=False,
    )
    assert child.returncode == 0, child.stderr.decode()[-3000:]
    *answers, (world_rows, world_hit) = pickle.loads(child.stdout)
    assert len(answers) == len(asked)
    for case, (rows, hit) in zip(asked, answers):
        with naive.reproducible(case):
            differing = naive.same_bits(rows, collide.distance(*case).rows, naive.FIELDS)
            assert not differing, f"{differing} differ:\n{rows}\n{collide.distance(*case).rows}"
            assert hit == collide.collide(*case)
    world = collide.World()
    for shape, X in scene():
        world.add(shape, X)
    assert not naive.same_bits(world_rows, world.distances(max_distance=0.3).rows, naive.FIELDS)
    assert world_hit == world.collides()
    assert len({row["how"].item() for rows, _ in answers for row in rows}) >= 4
