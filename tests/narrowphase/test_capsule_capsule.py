"""Closed forms of spheres and capsules: nearest points against the nearest point of the parallelogram of differences in
Fractions, cores against exact distances."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from exact_simplex import exact, nearest_to_origin
from naive import Case, pose, random_pose, rng_of
from posed_bodies import PosedBodies
from reproduction import reproducing

import collide
from collide.narrowphase.capsule_capsule import nearest_of_segments
from collide.narrowphase.convex_convex import closed_form_cores
from collide.narrowphase.gjk.minkowski_difference import AXIS, NEAREST_POINT, POINT
from collide.narrowphase.kernel_dispatch import CAPSULES, SPHERE_CAPSULE, SPHERES

pytestmark = pytest.mark.plain_kernels

SOURCE = "a, b = {a}, {b}  # tests/narrowphase/test_capsule_capsule.py"
ULP = 2.0**-52


def segments(rng, kind: str) -> tuple[np.ndarray, np.ndarray]:
    a, b = rng.normal(size=(2, 2, 3))
    if kind == "lattice":
        a, b = rng.integers(-2, 3, size=(2, 2, 3)) * 0.5
    elif kind == "parallel":
        b[1] = b[0] + rng.uniform(-2, 2) * (a[1] - a[0])
    elif kind == "point":
        b[1] = b[0]
        a[1] = a[0] if rng.random() < 0.3 else a[1]
    elif kind == "near":  # crossing within 1e-9
        s, t = rng.uniform(0.1, 0.9, 2)
        b += a[0] + s * (a[1] - a[0]) - b[0] - t * (b[1] - b[0]) + 1e-9 * rng.normal(size=3)
    return a, b


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["random", "lattice", "parallel", "point", "near"])
def test_nearest_of_segments(kind):
    rng = rng_of("segments", kind)
    seen: Counter = Counter()
    for _ in range(150):
        a, b = segments(rng, kind)
        corners = np.array([a[0] - b[0], a[1] - b[0], a[0] - b[1], a[1] - b[1]])
        points, weights = [0.0] * (4 * POINT), [0.0] * 10
        for k, corner in enumerate(corners.tolist()):
            points[POINT * k : POINT * k + 3] = corner
        with reproducing(SOURCE, a=a, b=b):
            distance, lower = nearest_of_segments(points, weights)
            true, size = nearest_to_origin(corners), float(np.abs(corners).max())
            nearest = math.sqrt(float(true.square))
            assert nearest - 16 * ULP * size <= distance <= nearest + 16 * ULP * size
            assert lower <= nearest + 8 * ULP * size, "a bound"
            if nearest > 1e-6 * size:
                assert lower >= nearest - 1e-12 * size, "a good bound"
            if kind == "near":  # where the nearest point itself has no digits left
                assert lower >= nearest - 32 * ULP * size
            shares = weights[:4]
            assert min(shares) >= 0.0 and abs(sum(shares) - 1.0) <= 4 * ULP
            v = [sum(Fraction(w) * x for w, x in zip(shares, axis)) for axis in zip(*exact(corners))]
            assert max(abs(float(x) - y) for x, y in zip(v, weights[NEAREST_POINT:])) <= 8 * ULP * size
            assert math.hypot(*map(float, v)) <= nearest + 16 * ULP * size
            if lower > 0.0:
                axis = np.array(weights[AXIS : AXIS + 3])
                assert abs(np.linalg.norm(axis) - 1.0) <= 4 * ULP
                assert abs((corners @ axis).min() - lower) <= 8 * ULP * size, "the axis has the bound"
            seen[sum(w > 0.0 for w in shares)] += 1
    few = {"random": [1, 2, 4], "lattice": [1, 2, 4], "parallel": [2], "point": [1, 2], "near": [4]}[kind]
    assert all(seen[k] >= 8 for k in few), seen


#: The method by the number of segments among the cores.
HOW = SPHERES, SPHERE_CAPSULE, CAPSULES


def cores_of(bodies):
    pair = bodies.pair
    return closed_form_cores(pair, HOW[pair.A.n + pair.B.n - 2], bodies.work, bodies.error)


@pytest.mark.parametrize("apart", [True, False])
@pytest.mark.parametrize("n_segments", [0, 1, 2])
def test_cores(apart, n_segments):
    """Depths where cores meet: no unit vector parts them by less, of many."""
    rng = rng_of("segment cores", apart, n_segments)
    cases = 0
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    while cases < 40:
        length, other_length = rng.uniform(0.5, 2.0, 2)
        A, B = collide.Capsule(0.1, length), collide.Capsule(0.2, other_length)
        if n_segments < 2:
            A = collide.Sphere(0.3)
        if n_segments < 1:
            B = collide.Sphere(0.4)
        if rng.random() < 0.5:  # ranks go by content: the point is worked on as A and as B
            A, B = B, A
        X_WA = random_pose(rng)
        X_WB = random_pose(rng, 3.0)
        if not apart:  # a point of one upon a point of the other
            middles = [rng.uniform(-0.4, 0.4) * getattr(S, "length", 0.0) for S in (A, B)]
            on_a, on_b = (X @ (0.0, 0.0, middle, 1.0) for X, middle in zip((X_WA, X_WB), middles))
            X_WB[:3, 3] += (on_a - on_b)[:3]
        case = Case(A, B, X_WA, X_WB)
        bodies = PosedBodies(*case)
        with naive.reproducible(case):
            core = cores_of(bodies)
            true = float(naive.exact_distance(case)) + bodies.radius
            assert core.lower - bodies.error <= true <= core.upper + bodies.error
            assert core.n_points == (4 if n_segments else 1) and core.n_vertices == 4
            n = np.array(core.nhat) * (-1.0 if bodies.ordered.flip else 1.0)
            assert abs(np.linalg.norm(n) - 1.0) <= 1e-15
            assert abs(naive.clearance_along(case, n) + bodies.radius + core.depth) <= 1e-12
            least = min(-naive.clearance_along(case, d) - bodies.radius for d in directions[cases :: 40])
            assert core.depth <= least + bodies.error
            assert (-core.depth > bodies.error) == apart
        cases += 1


def test_parallel_cores_that_meet():
    """A direction across both, though their normal says nothing."""
    for shift in (0.0, 0.5):
        for turn in (pose(), random_pose(rng_of("parallel cores"))):
            case = Case(collide.Capsule(0.1, 1.0), collide.Capsule(0.1, 2.0), turn, turn @ pose(t=(0.0, 0.0, shift)))
            bodies = PosedBodies(*case)
            core = cores_of(bodies)
            assert abs(core.depth) <= bodies.error and abs(np.dot(core.nhat, turn[:3, 2])) <= 1e-15
    bodies = PosedBodies(collide.Sphere(1.0), collide.Sphere(2.0), pose(), pose())
    assert cores_of(bodies).nhat == (0.0, 0.0, 1.0)
