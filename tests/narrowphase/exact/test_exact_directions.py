"""Points, normals, heights and support vertices in integers, against the same in Fractions."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from digit_numbers import number_at, put_number
from exact_simplex import inner
from naive import LATTICE_ROTATIONS, Case, corners, hull_points, pose, random_pose, reproducible, rng_of
from naive_triangles import world_points
from posed_bodies import PosedBodies
from reproduction import reproducing

import collide
from collide.narrowphase.exact import exact_directions as D
from collide.narrowphase.exact import exact_workspace as W
from collide.narrowphase.exact.exact_supports import support_pair
from collide.numerics.digits import BITS

pytestmark = pytest.mark.plain_kernels

ERROR = Fraction(2.0**-80)


class ExactBodies(PosedBodies):
    """A pair in integers, its poses loaded."""

    def __init__(self, *case, with_trees: bool = False):
        super().__init__(*case, with_trees=with_trees)
        self.digits = np.zeros(W.INTEGERS, dtype=np.int64)
        self.exact = W.exact_pair(self.ordered, self.poses.terms.ravel(), self.digits, 0.0, 0.0)
        assert W.fits(self.exact)
        W.load_poses(self.exact)

    def number(self, at: int, n: int) -> Fraction:
        return Fraction(number_at(self.digits, at, n))

    def point(self, k: int) -> list[Fraction]:
        unit = Fraction(2) ** int(BITS * self.exact.grid)
        return [unit * self.number(W.point_at(self.exact.d, k, axis), self.exact.d) for axis in range(3)]

    def direction(self, n: int) -> list[Fraction]:
        return [self.number(W.direction_at(self.exact.d, axis), n) for axis in range(3)]

    def set_direction(self, direction) -> int:
        """Three integers; returns how many digits their components have."""
        n = self.exact.d
        for axis, x in enumerate(direction):
            put_number(self.digits, W.direction_at(n, axis), n, int(x))
        return n


def drawn(rng, kind: str) -> Case:
    A, B = (collide.ConvexHull(hull_points(rng, int(rng.integers(1, 9)))) for _ in range(2))
    case = Case(A, B, random_pose(rng), random_pose(rng))
    if kind == "lattice":
        A, B = (collide.ConvexHull(rng.integers(-1, 2, size=(int(rng.integers(1, 9)), 3)) * 0.5) for _ in range(2))
        turns = [LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
        return Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-2, 3, 3) * 0.5))
    if kind == "far apart in size":
        return case._replace(A=collide.ConvexHull(A.points * 2.0**-70), B=collide.ConvexHull(B.points * 2.0**60))
    if kind == "composed":
        A, B = (collide.Compound([(shape, random_pose(rng))]) for shape in (A, B))
        return case._replace(A=A, B=B)
    return case


def cross(a, b):
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def sign(x) -> int:
    return (x > 0) - (x < 0)


@pytest.mark.parametrize("kind", ["any", "lattice", "far apart in size"])
def test_normals_and_heights(kind):
    rng = rng_of("exact directions", kind)
    seen: Counter = Counter()
    for _ in range(60):
        case = drawn(rng, kind)
        bodies = ExactBodies(*case)
        exact, difference = bodies.exact, bodies.difference()
        pairs = [list(difference)[k] for k in rng.integers(0, len(difference), 4)]
        with reproducible(case):
            for k, (i, j) in enumerate(pairs):
                W.set_point(exact, k, i, j)
                assert bodies.point(k) == difference[i, j]
            a, b, c, p = (difference[ij] for ij in pairs)
            true = cross([x - y for x, y in zip(b, a)], [x - y for x, y in zip(c, a)])
            normal = D.set_normal(exact)
            assert normal.side == sign(inner(true, a))
            unit = Fraction(2) ** int(2 * BITS * exact.grid)
            facing = [x if normal.side >= 0 else -x for x in true]
            assert [unit * x for x in bodies.direction(normal.n)] == facing
            seen[normal.side] += 1
            assert D.side_of(exact, normal.n, 3) == sign(inner(facing, p))
            length = D.direction_length(exact, normal.n)
            square = inner(facing, facing)
            if square == 0:
                assert length.value.high == 0.0
                seen["no area"] += 1
                continue
            height = D.height_along(exact, normal.n, length, 3)
            value = Fraction(float(height.high)) + Fraction(float(height.low))
            ratio = inner(facing, p)
            assert abs(value * abs(value) * square - ratio * abs(ratio)) <= 4 * ERROR * ratio * ratio
            rounded = np.array(D.direction_double(exact, normal.n))
            scaled = np.array([float(x / max(map(abs, facing))) for x in facing])
            assert np.abs(rounded / np.linalg.norm(rounded) - scaled / np.linalg.norm(scaled)).max() <= 2.0**-50
            D.reverse_direction(exact, normal.n)
            assert [unit * x for x in bodies.direction(normal.n)] == [-x for x in facing]
    assert min(seen[1], seen[-1]) >= 5 and (kind != "lattice" or min(seen[0], seen["no area"]) >= 5), seen


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
