"""What is said of bodies within rounding of touching: unit normals, points as far apart as the distance, one answer
whoever asks.

Every random pair is moved until its gap or depth is between 1e-17 and 1e-8 of its size, where rounding decides what
is seen.
"""

from __future__ import annotations

import math

import naive
import numpy as np
import pytest

import collide
from collide.hull.exact_hull import convex_hull

TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def meshed(points: np.ndarray) -> collide.Mesh:
    return collide.Mesh(points, convex_hull(points).facets)


def pool(rng) -> dict[str, collide.Shape]:
    points = rng.normal(size=(20, 3)) * 0.4
    return {
        "mesh": collide.Mesh(TETRAHEDRON - 0.25, FACES),
        "box": collide.Box((1, 1, 1)),
        "sphere": collide.Sphere(0.5),
        "capsule": collide.Capsule(0.2, 1),
        "cylinder": collide.Cylinder(0.5, 1),
        "cone": collide.Cone(0.5, 1),
        "ellipsoid": collide.Ellipsoid((0.5, 0.4, 0.6)),
        "hull": collide.ConvexHull(points),
        "rounded hull": collide.ConvexHull(points, radius=0.1),
        "compound": collide.Compound(
            [
                (collide.Box((0.5, 0.5, 0.5)), collide.pose((0.1, 0.2, 0.3))),
                (collide.Sphere(0.3), collide.pose((0.3, 0.1, -0.3))),
            ]
        ),
    }


def pose(rng) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = naive.rotation(rng), rng.normal(size=3)
    return X


def brought_near(A, B, X_WA, X_WB, gap: float) -> np.ndarray:
    """X_WB moved along the normal until the distance is about ``gap``."""
    X_WB = X_WB.copy()
    for _ in range(4):
        r = collide.distance(A, B, X_WA, X_WB)
        X_WB[:3, 3] -= (r.distance - gap) * r.normal
    return X_WB


def test_a_gap_of_a_few_ulps_beside_a_mesh_has_a_unit_normal():
    """A box of triangles beside a box, turned about z: the points' difference, 5e-17 m long, told a normal of length
    4.5."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    mesh = meshed(corners)
    rng = naive.rng_of("unit normals")
    tiny = 0
    for _ in range(200):
        angle = rng.uniform(0.0, 2.0 * math.pi)
        c, s = math.cos(angle), math.sin(angle)
        X_WA, X_WB = np.eye(4), np.eye(4)
        X_WA[:2, :2] = X_WB[:2, :2] = [[c, -s], [s, c]]
        X_WB[:2, 3] = np.array([c, s]) * (1.0 + rng.integers(0, 4) * 2.0**-52)
        r = collide.distance(mesh, collide.Box((1, 1, 1)), X_WA, X_WB)
        assert abs(np.linalg.norm(r.normal) - 1.0) < 1e-15, (X_WA.tolist(), X_WB.tolist())
        if r.distance > 0.0:
            tiny += 1
            assert r.normal @ X_WA[:3, 0] > 0.999999, (X_WA.tolist(), X_WB.tolist())  # the faces', not the points'
    assert tiny > 60


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_normals_points_and_margins_beside_rounding(seed):
    """|normal| = 1; point_b − point_a = distance · normal; contacts at a margin agree with the bracket of the
    distance."""
    rng = naive.rng_of("beside rounding", seed)
    shapes = pool(rng)
    names = list(shapes)
    apart = within = beyond = 0
    for _ in range(50):
        a, b = (names[k] for k in rng.integers(0, len(names), size=2))
        A, B = shapes[a], shapes[b]
        X_WA, X_WB = pose(rng), pose(rng)
        if rng.random() < 0.4:
            X_WB[:3, :3] = X_WA[:3, :3]
        X_WB = brought_near(A, B, X_WA, X_WB, 10.0 ** rng.uniform(-17, -9))
        r = collide.distance(A, B, X_WA, X_WB)
        told = f"{a} {b} X_WA=np.array({X_WA.tolist()}) X_WB=np.array({X_WB.tolist()}) {r}"
        apart += r.lower > 0.0
        assert abs(np.linalg.norm(r.normal) - 1.0) < 1e-14, told
        if not (r.hit and "compound" in (a, b)):  # overlapping unions tell a translation, laid through the contact
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-14 * 10, told
        margins = (max(r.upper, 0.0) * (1 + 1e-7) + 1e-18, r.lower * 0.99999, r.lower - 1e-20, r.distance, r.upper)
        for margin in (max(float(m), 0.0) for m in margins):
            rows = len(collide.contacts(A, B, X_WA, X_WB, margin=margin))
            within += r.upper <= margin
            beyond += r.lower > margin
            assert rows or r.upper > margin, f"no contact though proven within {margin!r}: {told}"
            assert not rows or r.lower <= margin, f"a contact though proven beyond {margin!r}: {told}"
    assert apart > 11 and within > 33 and beyond > 22


@pytest.mark.many(8)
@pytest.mark.parametrize("part", range(4))
@pytest.mark.parametrize("kind", ("Cylinder", "Cone"))
def test_booleans_and_distances_never_contradict_each_other(kind, part):
    """Hulls of 166 points all but touching round shapes: of some 2 pairs in 100, one search proved what the other
    left open."""
    rng = naive.rng_of("one answer", kind, part)
    contradictions, decided = [], 0
    for _ in range(10):
        points = rng.normal(size=(166, 3))
        points *= np.exp(rng.uniform(np.log(0.2), np.log(3.0))) / np.linalg.norm(points, axis=1)[
            :, None
        ] ** rng.integers(0, 2)
        A = collide.ConvexHull(points)
        B = getattr(collide, kind)(1.0, np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
        X_WA = pose(rng)
        near = brought_near(A, B, X_WA, pose(rng), 1e-9)
        normal = collide.distance(A, B, X_WA, near).normal
        X_WBs = np.repeat(near[None], 50, axis=0)
        X_WBs[:, :3, 3] += (10.0 ** rng.uniform(-14, -9, size=50) - 1e-9)[:, None] * normal
        signed = collide.distance(A, B, X_WA, X_WBs)
        gaps = collide.distance(A, B, X_WA, X_WBs, signed=False)
        hits = collide.collide(A, B, X_WA, X_WBs)
        decided += int((signed.rows["how"] != collide.results.UNDECIDED).sum())
        for k in np.flatnonzero((hits != signed.hit) | (hits != gaps.hit)):
            contradictions.append((points.tolist(), B, X_WA.tolist(), X_WBs[k].tolist()))
        k = int(rng.integers(50))
        assert collide.collide(A, B, X_WA, X_WBs[k]) == hits[k]
        assert collide.collide(B, A, X_WBs[k], X_WA) == hits[k]
        world = collide.World()
        world.add(A, X_WA)
        world.add(B, X_WBs[k])
        assert world.collides() == hits[k] == bool(len(world.collisions()))
    assert not contradictions, contradictions[0]
    assert decided == 500


def test_what_a_boolean_proves_a_distance_knows():
    """The signs that are open are few, and a distance whose sign another search proved keeps its bracket around the
    truth."""
    rng = naive.rng_of("another search")
    for _ in range(30):
        A, B = collide.ConvexHull(rng.normal(size=(166, 3))), collide.Cylinder(1.0, float(rng.uniform(0.1, 2.0)))
        X_WA = pose(rng)
        X_WB = brought_near(A, B, X_WA, pose(rng), 10.0 ** rng.uniform(-13, -10))
        r = collide.distance(A, B, X_WA, X_WB)
        told = f"A=ConvexHull(np.array({A.points.tolist()})) {B} {X_WA.tolist()} {X_WB.tolist()}"
        assert r.lower <= r.distance <= r.upper and r.hit == (not r.lower > 0.0), told
        # A direction of numpy's own bounds the gap from below, whatever the engine says.
        n = r.normal
        highest = (A.points @ X_WA[:3, :3].T @ n).max() + X_WA[:3, 3] @ n
        g = X_WB[:3, :3].T @ n
        lowest = X_WB[:3, 3] @ n - B.length / 2 * abs(g[2]) - B.radius * math.hypot(g[0], g[1])
        assert r.upper >= lowest - highest - 1e-14, told


def test_no_hull_is_made_where_nothing_is_open():
    """Hulls settle what facets leave open; meshes that meet or are apart clear of rounding need none."""
    points = naive.rng_of("no hull").normal(size=(100, 3))
    mesh = meshed(points)
    near, far = collide.pose((0.5, 0, 0)), collide.pose((9, 0, 0))
    for other in (meshed(points), collide.Sphere(0.3), collide.Cylinder(0.3, 1)):
        assert collide.collide(mesh, other, np.eye(4), near) and not collide.collide(mesh, other, np.eye(4), far)
        assert collide.distance(mesh, other, np.eye(4), far).lower > 0.0
    assert collide.distance(mesh, collide.Sphere(0.3), np.eye(4), near).hit
    assert not hasattr(mesh, "_hull")  # a ball is as deep as the surface is far
    assert collide.distance(mesh, meshed(points), np.eye(4), near).hit
    assert hasattr(mesh, "_hull")  # any other depth begins with it
