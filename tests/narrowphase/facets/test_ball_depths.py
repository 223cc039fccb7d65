"""Depths of balls and points in bodies of facets: the distance to the surface, and the radius."""

from __future__ import annotations

import numpy as np
import pytest
from facet_distances import to_facets
from naive import Case, pose, random_pose, reproducible, rng_of, share

import collide

I = np.eye(4)
BLOCK = collide.Mesh(*collide.tessellate(collide.Box((1, 2, 3)))[:2])
_WAVES = np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-2, 2, 21))
HILLS = collide.HeightField(0.4 * np.sin(3 * _WAVES[0]) * np.cos(2 * _WAVES[1]), 0.2)


def point() -> collide.ConvexHull:
    return collide.ConvexHull([[0.0, 0.0, 0.0]])


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.3])
def test_a_ball_in_a_block_is_as_deep_as_the_next_face(radius):
    rng = rng_of("ball in a block", radius)
    half = np.array([0.5, 1.0, 1.5])
    hits = []
    for _ in range(60):
        c = rng.uniform(-1.3, 1.3, 3) * half
        X = random_pose(rng)
        case = Case(BLOCK, collide.Sphere(radius) if radius else point(), X, X @ pose(t=c))
        beyond = np.maximum(np.abs(c) - half, 0.0)
        truth = np.linalg.norm(beyond) - radius if beyond.any() else (np.abs(c) - half).max() - radius
        with reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            assert r.distance == pytest.approx(truth, abs=1e-12) and r.certified
            assert r.lower <= truth + 1e-14 and truth - 1e-14 <= r.upper and r.upper - r.lower < 2e-11
            if r.hit:
                assert not collide.collide(*case.with_b_moved(-r.lower * r.normal))
                swapped = collide.results.flipped(collide.distance(*case.swapped()).rows)
                assert [swapped[name].tolist() for name in ("distance", "lower", "upper", "normal")] == [
                    r.rows[name].tolist() for name in ("distance", "lower", "upper", "normal")
                ]
    assert 0.2 < share(hits) < 0.95


def test_a_point_in_hills_is_as_deep_as_the_surface_is_far():
    """The surface's distance facet by facet, in numpy; a ball may be held by other hills, and its lower bound holds."""
    rng = rng_of("point in hills")
    exact = []
    for _ in range(60):
        c = np.array([*rng.uniform(-1.8, 1.8, 2), rng.uniform(-0.6, 0.3)])
        if not collide.contains(HILLS, I, c):
            continue
        depth = to_facets(c[None], HILLS)[0]
        r = collide.distance(HILLS, point(), I, pose(t=c))
        assert r.distance == pytest.approx(-depth, abs=1e-12) and r.certified
        radius = rng.uniform(0.05, 0.5)
        case = Case(HILLS, collide.Sphere(radius), I, pose(t=c))
        r = collide.distance(*case)
        assert r.upper == pytest.approx(-depth - radius, abs=1e-12) and r.lower <= r.distance <= r.upper
        assert not collide.collide(*case.with_b_moved(-r.lower * r.normal))
        exact.append(r.certified)
    assert len(exact) > 20 and 0.2 < share(exact) < 1


def test_a_ball_in_a_narrow_slot_is_not_said_to_come_out_into_the_slot():
    """Of two walls 0.1 apart a ball of radius 0.2 in the first: the slot is nearest, and too narrow."""
    wall = collide.Box((1, 4, 4))
    vertices, faces = collide.tessellate(wall)[:2]
    beside = np.concatenate([vertices, vertices + np.array([1.1, 0, 0])])
    walls = collide.Mesh(beside, np.concatenate([faces, faces + len(vertices)]))
    case = Case(walls, collide.Sphere(0.2), I, pose(t=(0.3, 0, 0)))
    r = collide.distance(*case)
    assert r.upper == pytest.approx(-0.4, abs=1e-12) and not r.certified
    assert r.lower <= -1.0 + 1e-9 and not collide.collide(*case.with_b_moved(-r.lower * r.normal))
    free = collide.distance(walls, collide.Sphere(0.04), I, pose(t=(0.3, 0, 0)))
    assert free.distance == pytest.approx(-0.24, abs=1e-12) and free.certified
