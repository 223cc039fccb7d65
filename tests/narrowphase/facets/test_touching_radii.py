"""Balls, capsules and rounded hulls that touch meshes within rounding: decided, and rightly."""

from __future__ import annotations

import numpy as np
import pytest
from curved_oracle import bracket

import collide
from collide.results import UNDECIDED


def mesh_of(name: str, rng) -> collide.Mesh:
    """A box, a random hull, or an L: all solid."""
    if name == "hull":
        shape = collide.ConvexHull(rng.normal(size=(12, 3)))
        return collide.Mesh(*collide.tessellate(shape, tolerance=0.1)[:2])
    box = collide.Mesh(*collide.tessellate(collide.Box((2.0, 1.0, 0.5)), tolerance=0.1)[:2])
    if name == "box":
        return box
    leg = collide.Mesh(box.vertices[:, ::-1].copy(), box.faces[:, ::-1].copy())
    return collide.boolean(box, leg, np.eye(4), collide.pose((0.75, 0.0, 0.5)), "union").mesh


def swept(name: str, rng):
    if name == "sphere":
        return collide.Sphere(rng.uniform(0.1, 0.5))
    if name == "capsule":
        return collide.Capsule(rng.uniform(0.1, 0.5), rng.uniform(0.2, 1.0))
    return collide.ConvexHull(rng.normal(size=(3, 3)), radius=rng.uniform(0.1, 0.5))


@pytest.mark.parametrize("kind", ["sphere", "capsule", "rounded"])
@pytest.mark.parametrize("mesh", ["box", "hull", "L"])
def test_touching_is_decided(mesh, kind):
    rng = np.random.default_rng([46, len(mesh), len(kind)])
    n_hits = n_gaps = n_near = 0
    for _ in range(12):
        A, B = mesh_of(mesh, rng), swept(kind, rng)
        X_WA = collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4))
        X_WB = collide.pose(3.0 * rng.normal(size=3), quat_wxyz=rng.normal(size=4))
        for _ in range(3):
            r = collide.distance(A, B, X_WA, X_WB)
            X_WB[:3, 3] -= r.distance * r.normal
        X_WB[:3, 3] += rng.integers(-1, 2, size=3) * np.spacing(X_WB[:3, 3])
        r = collide.distance(A, B, X_WA, X_WB)
        swapped = collide.distance(B, A, X_WB, X_WA)
        known = bracket(A, B, X_WA, X_WB, depths=False)
        case = (A, B, X_WA.tolist(), X_WB.tolist())
        assert r.how != UNDECIDED and r.hit == swapped.hit, case
        assert known.upper <= 0 if r.hit else known.lower > 0, case
        assert collide.collide(A, B, X_WA, X_WB) == r.hit == collide.distance([A], [B], X_WA, X_WB).hit[0], case
        assert r.lower <= r.distance <= r.upper and (r.upper <= 0.0 if r.hit else r.lower > 0.0), case
        n_hits, n_gaps, n_near = n_hits + r.hit, n_gaps + (not r.hit), n_near + (abs(r.distance) < 1e-14)
    assert n_hits >= 2 and n_gaps >= 2 and n_near >= 10, (n_hits, n_gaps, n_near)
