"""Support vertices of the exact stage: of all vertices, in Fractions, none lies lower."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from exact_bodies import ExactBodies, drawn
from exact_simplex import inner
from naive import corners, pose, random_pose, reproducible, rng_of
from naive_triangles import world_points
from reproduction import reproducing

import collide
from collide.narrowphase.exact import exact_workspace as W
from collide.narrowphase.exact.exact_supports import support_pair

pytestmark = pytest.mark.plain_kernels


@pytest.mark.many(4)
@pytest.mark.parametrize("kind", ["any", "lattice", "far apart in size", "composed"])
def test_support_pairs(kind):
    """The last vertices against a direction, exactly, and the first ones of equals: planted ties on lattices."""
    rng = rng_of("support pairs", kind)
    tied = 0
    for _ in range(60):
        case = drawn(rng, kind)
        bodies = ExactBodies(*case)
        d = rng.integers(-1, 2, 3) if rng.random() < 0.5 else rng.integers(-(2**40), 2**40, 3)
        if not d.any():
            continue
        n = bodies.set_direction(d)
        i, j, v = support_pair(bodies.exact, n)
        heights = {}
        with reproducible(case):
            for ij in np.ndindex(bodies.pair.A.n, bodies.pair.B.n):
                W.set_point(bodies.exact, 0, *ij)
                heights[ij] = inner([Fraction(int(x)) for x in d], bodies.point(0))
                if kind != "composed":
                    assert bodies.point(0) == bodies.difference()[ij]
            lowest = [ij for ij, height in heights.items() if height == min(heights.values())]
            assert (i, j) == lowest[0]
            assert np.abs(np.array(v) - d / math.sqrt(sum(int(x) ** 2 for x in d))).max() <= 2.0**-50
        tied += len(lowest) > 1
    assert tied >= (15 if kind == "lattice" else 0), tied


def test_supports_down_the_edges_of_large_hulls():
    """One of the lowest vertices, exactly, also where a whole cap is level."""
    rng = rng_of("climb")
    angle = np.arange(120) * (np.pi / 60)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.ones(120)])
    prism = collide.ConvexHull(np.concatenate([ring, ring * (1.0, 1.0, -1.0)]))
    points = rng.normal(size=(240, 3))
    ball = collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None])
    bodies = ExactBodies(prism, ball, pose(), random_pose(rng), with_trees=True)
    assert bodies.pair.A.tree and bodies.pair.B.tree
    for k in range(40):
        d = [0, 0, (-1) ** k] if k % 4 < 2 else [int(x) for x in rng.integers(-(2**30), 2**30, 3)]
        i, j, _ = support_pair(bodies.exact, bodies.set_direction(d))
        with reproducing("d = {d}  # tests/narrowphase/exact/test_exact_directions.py", d=d):
            for vertex, shape, X, sense in zip((i, j), bodies.shapes, bodies.X, (1, -1)):
                heights = [sense * inner([Fraction(x) for x in d], p) for p in world_points(corners(shape)[0], X)]
                assert heights[vertex] == min(heights)
