"""Unions of which more pairs of parts are near than a list holds: every pair has its say."""

from __future__ import annotations

import numpy as np
import pytest

import collide


def test_a_rod_through_hundreds_of_boxes_keeps_its_distance_from_the_nearest():
    """Most balls around boxes meet the ball around the rod, and few boxes are near it: the list of 256 never fills."""
    box, rod, u = collide.Box((0.1, 0.1, 0.1)), collide.Box((0.05, 0.02, 4.8)), np.ones(3) / 3.0**0.5
    x = np.cross(u, [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = np.column_stack([x, np.cross(u, x), u]), 1.5
    apart = hits = 0
    for seed in range(6):
        for n in (512, 513, 600, 1025, 1600):
            places = np.random.default_rng([3, seed]).uniform(0.0, 3.0, (n, 3))
            union = collide.Compound([(box, collide.pose(place)) for place in places])
            poses = np.tile(np.eye(4), (n, 1, 1))
            poses[:, :3, 3] = places
            wanted = max(float(collide.distance(box, rod, poses, X, signed=False).distance.min()), 0.0)
            for A, B, X_A, X_B in ((union, rod, np.eye(4), X), (rod, union, X, np.eye(4))):
                row = collide.distance(A, B, X_A, X_B, signed=False)
                assert row.distance == pytest.approx(wanted, abs=1e-12) and bool(row.hit) == (wanted == 0.0), (seed, n)
                assert collide.collide(A, B, X_A, X_B, security_margin=0.01) == (wanted <= 0.01), (seed, n)
                assert collide.distance(A, B, X_A, X_B).hit == (wanted == 0.0), (seed, n)
            apart, hits = apart + (wanted > 0.0), hits + (wanted == 0.0)
    assert apart >= 1 and hits >= 10, (apart, hits)
