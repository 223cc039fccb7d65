"""Witness points of overlapping curved bodies lie on their bodies, to half of what the bracket leaves open.

Many ways out may be as short: a ball within a cone, two cones, a capsule at a cylinder's middle. The facets that EPA
ends with are slivers then, and the point was taken from one that does not hold it: 0.8 m off a ball of 0.1 m, 77 m
off a capsule in a cone of 315 m, some of them certified. Bodies are judged here by formulas of their own.
"""

from __future__ import annotations

import math

import naive
import numpy as np
import pytest

import collide
from collide.lowering.parts import convex_set_of


def outside_box(half, p) -> float:
    return float(np.linalg.norm(np.maximum(np.abs(p) - half, 0.0)))


def outside_cone(radius: float, length: float, p) -> float:
    """Distance of a point from a cone about z, its apex at +length/2."""
    aside, z = math.hypot(p[0], p[1]), float(p[2])
    corners = np.array([[0.0, -length / 2], [radius, -length / 2], [0.0, length / 2]])
    q = np.array([aside, z])
    slope = corners[2] - corners[1]
    inward = np.array([-slope[1], slope[0]])
    if z >= -length / 2 and (q - corners[1]) @ inward >= 0.0:
        return 0.0
    return min(segment_distance(q, corners[0], corners[1]), segment_distance(q, corners[1], corners[2]))


def segment_distance(q, a, b) -> float:
    along = (q - a) @ (b - a) / ((b - a) @ (b - a))
    return float(np.linalg.norm(q - a - min(max(along, 0.0), 1.0) * (b - a)))


def outside_ellipsoid(radii, p) -> float:
    """Distance of a point from an ellipsoid: the nearest point is r² p / (r² + t), for the t that puts it on the
    surface."""
    squares, p = radii * radii, np.asarray(p)
    if (p * p / squares).sum() <= 1.0:
        return 0.0
    low, high = 0.0, float(radii.max() * np.linalg.norm(p))
    for _ in range(200):
        t = 0.5 * (low + high)
        inside = (squares * p * p / (squares + t) ** 2).sum() <= 1.0
        low, high = (low, t) if inside else (t, high)
    return float(np.linalg.norm(p - squares * p / (squares + low)))


def outside(shape, p) -> float:
    """How far a point of the shape's frame is from it [m]."""
    if isinstance(shape, collide.Sphere):
        return max(float(np.linalg.norm(p)) - shape.radius, 0.0)
    if isinstance(shape, collide.Capsule):
        z = min(max(p[2], -shape.length / 2), shape.length / 2)
        return max(float(np.linalg.norm(p - np.array([0.0, 0.0, z]))) - shape.radius, 0.0)
    if isinstance(shape, collide.Box):
        return outside_box(np.asarray(shape.size) / 2, p)
    if isinstance(shape, collide.Cylinder):
        return math.hypot(max(math.hypot(p[0], p[1]) - shape.radius, 0.0), max(abs(p[2]) - shape.length / 2, 0.0))
    if isinstance(shape, collide.Cone):
        return outside_cone(shape.radius, shape.length, p)
    return outside_ellipsoid(np.asarray(shape.radii), p)


def log_uniform(rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


MAKERS = {
    "cone": lambda rng: collide.Cone(
        log_uniform(rng, 0.1, 10), log_uniform(rng, 0.1, 10) * log_uniform(rng, 0.01, 100)
    ),
    "cylinder": lambda rng: collide.Cylinder(
        log_uniform(rng, 0.1, 10), log_uniform(rng, 0.1, 10) * log_uniform(rng, 0.01, 100)
    ),
    "ellipsoid": lambda rng: collide.Ellipsoid(tuple(log_uniform(rng, 0.1, 10) for _ in range(3))),
    "sphere": lambda rng: collide.Sphere(log_uniform(rng, 0.01, 10)),
    "capsule": lambda rng: collide.Capsule(
        log_uniform(rng, 0.1, 2), log_uniform(rng, 0.1, 10) * int(rng.integers(0, 2))
    ),
    "box": lambda rng: collide.Box(tuple(log_uniform(rng, 0.1, 10) for _ in range(3))),
}


def placed(rng) -> tuple[np.ndarray, np.ndarray]:
    """Poses at one origin or nearly, along the same axes or not."""
    X_WA, X_WB = np.eye(4), np.eye(4)
    if rng.random() < 0.5:
        X_WA[:3, :3] = naive.rotation(rng)
    X_WB[:3, :3] = X_WA[:3, :3] if rng.random() < 0.5 else naive.rotation(rng)
    if rng.random() < 0.7:
        X_WB[:3, 3] = rng.normal(size=3) * log_uniform(rng, 1e-12, 0.3)
    return X_WA, X_WB


def off_bodies(A, B, X_WA, X_WB, r) -> float:
    ends = ((A, X_WA, r.point_a), (B, X_WB, r.point_b))
    return max(outside(S, X[:3, :3].T @ (p - X[:3, 3])) for S, X, p in ends)


@pytest.mark.parametrize(
    "A, B",
    [
        (collide.Cone(1, 1), collide.Sphere(0.1)),
        (collide.Cone(2, 300), collide.Sphere(0.25)),
        (collide.Cone(2.09, 314.9), collide.Capsule(0.25, 0)),
        (collide.Sphere(34.53), collide.Cone(0.143, 1)),
        (collide.Cylinder(1, 1), collide.Sphere(0.1)),
        # Newton's method took the base for the tip: 5 mm off, beside a depth right to 1e-9
        (collide.Cone(7.7230657390907185, 0.010454426880832283), collide.Sphere(3.35765637071926)),
    ],
)
def test_bodies_at_one_origin(A, B):
    for P, Q in ((A, B), (B, A)):
        r = collide.distance(P, Q, np.eye(4), np.eye(4))
        assert off_bodies(P, Q, np.eye(4), np.eye(4), r) <= 0.5 * (r.upper - r.lower) + 1e-13


@pytest.mark.many(2)
@pytest.mark.parametrize("b", MAKERS)
@pytest.mark.parametrize("a", ("cone", "cylinder", "ellipsoid"))
def test_overlaps_of_curved_bodies(a, b):
    rng = naive.rng_of("curved witness points", a, b)
    hits = certified = 0
    for _ in range(60):
        A, B = MAKERS[a](rng), MAKERS[b](rng)
        X_WA, X_WB = placed(rng)
        r = collide.distance(A, B, X_WA, X_WB)
        if not r.hit:
            continue
        told = f"{A} {B} X_WA=np.array({X_WA.tolist()}) X_WB=np.array({X_WB.tolist()})"
        size = sum(float(np.linalg.norm(convex_set_of(S).params[:3])) + convex_set_of(S).reach for S in (A, B))
        off = off_bodies(A, B, X_WA, X_WB, r)
        hits += 1
        certified += r.certified
        assert off <= 0.5 * (r.upper - r.lower) + 1e-13 * size, f"{told}: {off!r} off, bracket {r.upper - r.lower!r}"
        assert off <= 1e-6 * size, f"{told}: {off!r} off"
        assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() <= 1e-14 * size, told
    assert hits >= 50 and certified >= 15
