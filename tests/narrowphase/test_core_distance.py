"""Two cores: the bracket of their distance or depth, judged exactly, whatever of it is asked for."""

from __future__ import annotations

from collections import Counter

import naive
import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, Case, pose, random_pose, rng_of, rotation
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.core_distance import convex_cores
from collide.narrowphase.gjk.minkowski_difference import POINT_OF_A, POINT_OF_B, weighted_sum

pytestmark = pytest.mark.plain_kernels


def pair(rng, kind: str) -> Case:
    A, B = (collide.ConvexHull(naive.hull_points(rng, int(rng.integers(1, 12)))) for _ in range(2))
    spread = rng.choice([0.6, 2.0])
    case = Case(A, B, random_pose(rng, spread), random_pose(rng, spread))
    if kind == "near":
        return naive.with_gap(case, float(rng.choice([1e-3, 1e-9, -1e-9, -1e-3])))
    if kind == "lattice":
        A, B = (collide.Box(tuple(rng.integers(1, 5, 3) * 0.5)) for _ in range(2))
        turns = [LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
        return Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-4, 5, 3) * 0.25))
    if kind == "large":  # more vertices than GJK's tetrahedron is a seed for
        A, B = (collide.ConvexHull(naive.hull_points(rng, 40)) for _ in range(2))
    if kind == "flat":
        frame = rotation(rng)[:2]
        A, B = (collide.ConvexHull(rng.normal(size=(5, 2)) @ frame) for _ in range(2))
        return Case(A, B, pose(), pose(t=rng.normal(size=2) @ frame * 0.5))
    return case._replace(A=A, B=B)


def cores(bodies: PosedBodies, **asked):
    """From no axis that was there before."""
    query = bodies.query(**asked)
    bodies.work.weights[:] = 0.0
    return convex_cores(bodies.ordered, query, bodies.work, bodies.radius, bodies.error, False, 0)


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["any", "near", "lattice", "large", "flat"])
def test_brackets(kind):
    rng = rng_of("core distance", kind)
    seen: Counter = Counter()
    for _ in range(20 if kind in ("large", "near") else 40):
        case = pair(rng, kind)
        bodies = PosedBodies(*case)
        true, error = float(naive.exact_distance(case)), bodies.error
        if abs(true) <= 4 * error and kind != "flat":
            continue  # for the exact stage
        with naive.reproducible(case):
            core = cores(bodies)
            seen["apart" if true > 0 else "meeting"] += 1
            assert core.lower - error <= true <= core.upper + error
            assert abs(core.depth + true) <= 1e-9 * bodies.ordered.size + 4 * error
            if core.deepest < np.inf:
                assert core.shallowest <= -true * (1 + 1e-14) and -true <= core.deepest * (1 + 1e-14)
            n = np.array(core.nhat) * (-1.0 if bodies.ordered.flip else 1.0)
            assert abs(naive.clearance_along(case, n) + core.depth) <= 1e-9 * bodies.ordered.size + 8 * error
            check_witness_points(bodies, core)
            # A gap alone: the same number; of an overlap a point of both, and as good a sign.
            gap = cores(bodies, depths=False)
            assert gap.lower - error <= true <= gap.upper + error
            if true > 4 * error:
                assert (gap.depth, gap.lower, gap.upper) == (core.depth, core.lower, core.upper)
            elif gap.n_points == 4 and kind != "flat":
                a = weighted_sum(bodies.work.points, bodies.work.weights, 4, POINT_OF_A)
                b = weighted_sum(bodies.work.points, bodies.work.weights, 4, POINT_OF_B)
                assert np.abs(np.subtract(np.subtract(a, b), bodies.pair.t)).max() <= 8 * error
                seen["common point"] += 1
            boolean = cores(bodies, boolean=True, depths=False, limit=0.0)
            assert boolean.lower - error <= true
            assert true <= boolean.upper + error or boolean.lower - error > 0.0, "beyond the limit: not measured"
            assert boolean.iterations % 65536 <= core.iterations % 65536
            decided = boolean.lower > error or boolean.upper < -error
            assert decided or kind in ("flat", "near", "lattice")
            limited = cores(bodies, limit=0.5 * abs(true))
            assert true <= 4 * error or limited.lower - error > 0.5 * true
    assert kind == "flat" or min(seen["apart"], seen["meeting"]) >= 5, seen
    assert kind != "any" or seen["common point"] >= 5, seen


def check_witness_points(bodies: PosedBodies, core) -> None:
    """A point of each core, by weights, as far apart as the depth and along the normal."""
    work, n = bodies.work, core.n_points
    weights = work.weights[:n]
    assert weights.min() >= 0.0 and abs(weights.sum() - 1.0) <= 1e-15
    a, b = (np.array(weighted_sum(work.points, work.weights, n, first)) for first in (POINT_OF_A, POINT_OF_B))
    assert np.abs(a - b - bodies.pair.t - core.depth * np.array(core.nhat)).max() <= 1e-9 * bodies.ordered.size
