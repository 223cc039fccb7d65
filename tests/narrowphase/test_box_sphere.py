"""Booleans of a box and a sphere in closed form, against exact distances."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.box_sphere import decide_box_sphere, is_box_and_sphere
from collide.narrowphase.rows import view_row
from collide.results import FORMULA, PAIR_DTYPE

pytestmark = pytest.mark.plain_kernels


def decided(bodies) -> np.ndarray | None:
    """The row (1,), or ``None`` where the sign is left open."""
    rows = np.zeros(1, dtype=PAIR_DTYPE)
    return rows if decide_box_sphere(bodies.ordered, np.inf, view_row(rows.ctypes.data)) else None


@pytest.mark.many(2)
@pytest.mark.parametrize("stretched", [False, True])
def test_brackets_hold_and_tell_hits(stretched):
    """Balls off their origins, either order, matrices that are no rotations by 1e-5: their brackets hold, too."""
    rng, told, hits = rng_of("box and sphere", stretched), 0, 0
    for _ in range(60):
        box = collide.Box(rng.uniform(0.2, 2.0, 3))
        ball = collide.ConvexHull([rng.normal(size=3) * 0.2], radius=rng.uniform(0.1, 0.6))
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        X_WB[:3, 3] = X_WA[:3, 3] + 0.75 * rng.normal(size=3)
        if stretched:
            X_WA[:3, :3] += rng.uniform(-1e-5, 1e-5, (3, 3))
        case = Case(box, ball, X_WA, X_WB)
        if rng.random() < 0.5:
            case = Case(ball, box, X_WB, X_WA)
        with naive.reproducible(case):
            bodies = PosedBodies(*case)
            assert is_box_and_sphere(bodies.pair)
            row = decided(bodies)
            if row is None:
                continue
            told += 1
            hits += int(row["hit"][0])
            true = float(naive.exact_distance(case))
            assert row["hit"][0] == (true <= 0.0) and row["how"][0] == FORMULA
            if true > 0.0:
                assert row["lower"][0] <= true <= row["upper"][0]
                assert row["upper"][0] - row["lower"][0] <= (3e-4 if stretched else 1e-12)
                assert naive.clearance_along(case, row["normal"][0]) > 0.0, "the axis of a miss separates"
    assert told >= 55 and 10 <= hits <= told - 10, (told, hits)


def test_touching_is_left_open():
    """Doubles do not tell: the exact stage does."""
    box, ball = collide.Box((1.0, 1.0, 1.0)), collide.Sphere(0.25)
    for t in ((0.75, 0.0, 0.0), (0.0, 0.25, -0.75)):
        case = Case(box, ball, np.eye(4), naive.pose(t=t))
        assert decided(PosedBodies(*case)) is None
        assert collide.collide(*case)


def test_other_pairs_are_not_taken():
    capsule, ball, hull = collide.Capsule(0.1, 1.0), collide.Sphere(0.25), collide.ConvexHull(np.eye(3))
    for A, B in ((capsule, ball), (collide.Box((1, 1, 1)), capsule), (hull, ball), (collide.Cylinder(1, 1), ball)):
        bodies = PosedBodies(A, B, np.eye(4), naive.pose(t=(3.0, 0.0, 0.0)))
        assert not is_box_and_sphere(bodies.pair), (A, B)
