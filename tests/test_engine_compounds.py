"""Parts with a pose of their own, in bodies that have one too: decided on the exact product of the poses.

Every boolean is proven by its certificate in Python integers, which multiplies the poses exactly.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import collide
from collide.geometry.tables import POSE_TERMS, pose_table
from collide.results import EXACT, SWEPT, UNDECIDED

CASES = 60


def _pose(rng) -> np.ndarray:
    return collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3))


def _flush(rng) -> np.ndarray:
    """From a unit box to one that lies on it, turned and shifted."""
    return collide.pose((*rng.uniform(-0.3, 0.3, 2), 1.0), rpy=(0, 0, rng.uniform(-3, 3)))


def _box_on(rng, X_WP):
    return collide.Box((1, 1, 1)), X_WP @ _flush(rng)


def _part_on(rng, X_WP):
    X_BP = _pose(rng)
    return collide.Compound([(collide.Box((1, 1, 1)), X_BP)]), X_WP @ _flush(rng) @ np.linalg.inv(X_BP)


def _capsule_on(rng, X_WP):
    X_BP = collide.pose((0, 0, 0.5), rpy=rng.uniform(-1, 1, 3))
    standing = collide.Compound([(collide.Capsule(0.5, 1.0), X_BP)])
    return standing, X_WP @ _flush(rng) @ collide.pose((0, 0, 0.5)) @ np.linalg.inv(X_BP)


def _halfspace_on(rng, X_WP):
    X_BP = _pose(rng)
    above = collide.Compound([(collide.Halfspace((0, 0, -1), 0.5), X_BP)])
    return above, X_WP @ collide.pose((0, 0, 1.0)) @ np.linalg.inv(X_BP)


@pytest.mark.parametrize("lay", [_box_on, _part_on, _capsule_on, _halfspace_on])
def test_flush_parts_of_posed_bodies_are_decided_exactly(lay):
    rng = np.random.default_rng(5)
    hits = 0
    for case in range(CASES):
        X_WA, X_AP = _pose(rng), _pose(rng)
        A = collide.Compound([(collide.Box((1, 1, 1)), X_AP)])
        B, X_WB = lay(rng, X_WA @ X_AP)
        r = collide.distance(A, B, X_WA, X_WB)
        snippet = f"case {case}: A={A!r} B={B!r} X_WA={X_WA.tolist()} X_WB={X_WB.tolist()}"
        assert r.how in (EXACT, SWEPT) and r.certified, snippet
        assert abs(r.distance) < 1e-15 and r.lower <= r.distance <= r.upper, snippet
        assert collide.collide(A, B, X_WA, X_WB) == r.hit, snippet
        assert collide.distance(B, A, X_WB, X_WA).hit == r.hit, snippet
        collide.verify(A, B, X_WA, X_WB, r)
        hits += r.hit
    assert CASES // 6 <= hits <= CASES - CASES // 6, f"{hits} of {CASES} touch: the cases no longer lie on the edge"


def test_terms_add_up_to_the_exact_product():
    rng = np.random.default_rng(6)
    X_WB, X_BP = (np.array([_pose(rng) for _ in range(50)]) for _ in range(2))
    X_WB[0], X_BP[1] = np.eye(4), np.eye(4)
    table = pose_table(X_WB, X_BP, np.ones(50))
    assert (table.rows[:2, POSE_TERMS] == -1).all() and (table.rows[2:, POSE_TERMS] == np.arange(48)).all()
    for k in range(50):
        W, P = ([[Fraction(v) for v in row] for row in X.tolist()] for X in (X_WB[k], X_BP[k]))
        product = [[sum(W[i][m] * P[m][j] for m in range(4)) for j in range(4)] for i in range(3)]
        assert table.exact(k) == [v for row in product for v in row[:3]] + [row[3] for row in product]


def test_products_too_small_to_be_exact_stay_open():
    """Low parts that underflow: the pose is not known exactly, and the pair is not decided on a guess."""
    X = np.eye(4)
    X[0, 1], X[1, 0] = 1e-170, -1e-170
    A = collide.Compound([(collide.Box((1, 1, 1)), X)])
    r = collide.distance(A, collide.Box((1, 1, 1)), X, collide.pose((0, 0, 1)))
    assert r.how == UNDECIDED and r.hit and not r.certified and r.lower < 0 < r.upper


def test_rows_of_a_world_carry_certificates():
    rng = np.random.default_rng(7)
    world = collide.World()
    for k in range(24):
        shape = collide.Compound([(collide.Box((1, 1, 1)), _pose(rng)), (collide.Sphere(0.3), _pose(rng))])
        world.add(shape if k % 3 else collide.ConvexHull(rng.normal(size=(12, 3))), collide.pose(rng.uniform(-2, 2, 3)))
    rows = world.distances(0.3)
    world.set_pose(0, collide.pose((9, 9, 9)))  # the rows keep the poses they were asked at
    hits = 0
    for k in range(len(rows)):
        r = rows.pair(k)
        assert r.rows.tobytes() == rows.rows[k : k + 1].tobytes()
        collide.verify(*r.question, r)
        hits += r.hit
    assert 20 < hits < len(rows)
    outside = world.query(collide.Box((2, 2, 2)), np.eye(4), 0.1)
    assert len(outside) > 3
    for k in range(len(outside)):
        r = outside.pair(k)
        collide.verify(*r.question, r)
    with pytest.raises(IndexError):
        rows.pair(len(rows))
