"""Signed distances of single facets: those of hulls of their corners, and inside the oracle's brackets."""

from __future__ import annotations

import numpy as np
import pytest
from curved_oracle import bracket
from samples import sizes

import collide
from collide.narrowphase.facets.single_facets import facets_with, two_facets
from collide.results import PAIR_DTYPE

SOLIDS = {
    "box": collide.Box((0.7, 0.6, 0.5)), "ball": collide.Sphere(0.4), "capsule": collide.Capsule(0.2, 0.6),
    "can": collide.Cylinder(0.3, 0.7), "cone": collide.Cone(0.3, 0.7), "ellipsoid": collide.Ellipsoid((0.4, 0.3, 0.2)),
    "hull": collide.ConvexHull(np.random.default_rng(5).normal(size=(40, 3)) / 3),
}


def sheet(rng) -> collide.Mesh:
    """Facets of all sizes in all directions, some with their corners on a line."""
    corners = rng.normal(size=(20, 3, 3)) * rng.choice([1e-3, 0.1, 1.0], size=(20, 1, 1))
    corners[::7, 2] = 2.0 * corners[::7, 1] - corners[::7, 0]
    corners += rng.normal(size=(20, 1, 3)) * 0.15
    return collide.Mesh(corners.reshape(-1, 3), np.arange(60).reshape(-1, 3), solid=False)


def row_of(memory) -> np.void:
    assert memory is not None
    return np.frombuffer(memory, PAIR_DTYPE, 1)[0]


@pytest.mark.parametrize("name", SOLIDS)
@sizes(40, 1000)
def test_a_facet_and_a_solid(name, n):
    rng, solid, n_hits = np.random.default_rng(11), SOLIDS[name], 0
    for k in range(n):
        mesh, X, Y = sheet(rng), *(collide.pose(rng.normal(size=3) / 8, rpy=rng.uniform(-3, 3, 3)) for _ in "12")
        i = int(rng.integers(20))
        row = row_of(facets_with(solid).distance(X, Y, mesh, i))
        corners = mesh.vertices[mesh.faces[i]]
        other = collide.distance(collide.ConvexHull(corners), solid, X, Y)
        case = f"n {k}: facet {corners.tolist()}, {solid!r}, X_WA={X.tolist()}, X_WB={Y.tolist()}"
        assert row["lower"] - 1e-15 <= other.upper and other.lower - 1e-15 <= row["upper"], case
        assert bool(row["hit"]) == other.hit, case
        n_hits += other.hit
        if k % 8 == 0:
            truth = bracket(collide.ConvexHull(corners), solid, X, Y)
            assert row["lower"] <= float(truth.upper) + 1e-15 and float(truth.lower) - 1e-15 <= row["upper"], case
            np.testing.assert_allclose(row["point_b"] - row["point_a"], row["distance"] * row["normal"], atol=1e-9)
    assert 0.08 * n < n_hits < 0.9 * n


@sizes(60, 2000)
def test_two_facets(n):
    rng, n_hits = np.random.default_rng(12), 0
    for k in range(n):
        A, B = sheet(rng), sheet(rng)
        X, Y = (collide.pose(rng.normal(size=3) / 8, rpy=rng.uniform(-3, 3, 3)) for _ in "12")
        i, j = rng.integers(20, size=2).tolist()
        row = row_of(two_facets().distance(X, Y, A, i, B, j))
        corners = A.vertices[A.faces[i]], B.vertices[B.faces[j]]
        other = collide.distance(*map(collide.ConvexHull, corners), X, Y)
        case = f"n {k}: facets {corners[0].tolist()}, {corners[1].tolist()}, X_WA={X.tolist()}, X_WB={Y.tolist()}"
        assert bool(row["hit"]) == other.hit and abs(row["distance"] - other.distance) <= 1e-14, case
        n_hits += other.hit
    assert 0.03 * n < n_hits < 0.5 * n


def test_matrices_that_are_no_poses_are_left_to_the_long_way():
    mesh, bad = sheet(np.random.default_rng(0)), np.full((4, 4), np.nan)
    assert facets_with(SOLIDS["box"]).distance(bad, np.eye(4), mesh, 0) is None
    assert two_facets().distance(np.eye(4), bad, mesh, 0, mesh, 1) is None
