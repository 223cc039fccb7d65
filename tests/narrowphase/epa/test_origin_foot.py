"""Nearest points of triangles and of whole surfaces, and their weights, against subsets of corners in Fractions."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import exact, nearest_to_origin
from growing_surface import CLOUDS, Surface, around_the_origin
from naive import rng_of
from reproduction import reproducing

from collide.narrowphase.epa import origin_foot as F
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels

SOURCE = "corners, p = {corners}, {p}  # tests/narrowphase/epa/test_origin_foot.py"
ULP = 2.0**-52


def drawn(rng, n: int, kind: str) -> np.ndarray:
    corners = rng.normal(size=(n, 3))
    if kind == "lattice":
        corners = rng.integers(-2, 3, size=(n, 3)) * 0.5
    elif kind == "needle":  # as thin as rounding
        corners = corners[:1] + np.linspace(0.0, 1.0, n)[:, None] * corners[-1:] + 1e-15 * rng.normal(size=(n, 3))
    elif kind == "repeated":
        corners = corners[rng.integers(0, max(n - 1, 1), n)]
    return corners


def check(corners, weights, distance: float, p) -> None:
    """A convex combination as far from p, as a sum of coordinates, as is said; no farther than the nearest point."""
    size = max(float(np.abs(corners - p).max()), float(np.abs(corners).max()))
    assert min(weights) >= 0.0 and abs(sum(weights) - 1.0) <= 4 * ULP
    combined = [sum(Fraction(w) * (x - y) for w, x, y in zip(weights, axis, [Fraction(p[k])] * len(weights)))
                for k, axis in enumerate(zip(*exact(corners)))]
    assert abs(float(sum(map(abs, combined))) - distance) <= 32 * ULP * size
    true = nearest_to_origin([[x - y for x, y in zip(row, exact([p])[0])] for row in exact(corners)])
    assert distance >= math.sqrt(float(true.square)) - 32 * ULP * size
    assert distance <= float(sum(map(abs, true.point))) + 32 * ULP * size


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["random", "lattice", "needle", "repeated"])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_nearest_points(n, kind):
    """Of points in a simplex, beside it, and far from it: also where its area says nothing about where they lie."""
    rng = rng_of("origin foot", n, kind)
    seen: Counter = Counter()
    for _ in range(60):
        corners = drawn(rng, n, kind)
        p = rng.dirichlet(np.ones(n)) @ corners + rng.choice([0.0, 1e-9, 1.0]) * rng.normal(size=3)
        if n == 4 and min(nearest_to_origin(corners - p).weights) > 0:
            continue  # within the tetrahedron: not asked
        with reproducing(SOURCE, corners=corners, p=p):
            weights = [math.nan] * n
            distance = F.weigh_corners(corners.ravel(), 3, n, weights, Vec3(*p.tolist()))
            check(corners, weights, distance, p)
            if n == 3:
                nearest = F.nearest_of_triangle(*(Vec3(*corner) for corner in corners.tolist()), Vec3(*p.tolist()))
                check(corners, nearest[1:], nearest.distance, p)
                assert nearest.distance == distance
        seen[sum(w > 0.0 for w in weights)] += 1
    assert kind in ("needle", "repeated") or all(seen[k] >= 3 for k in range(1, min(n, 3) + 1)), seen


def by_vertex(surface: Surface, ids) -> np.ndarray:
    """Coordinates of the vertices that ids name: points 1 and 2 may have been exchanged."""
    assert ids[::2] == ids[1::2]
    order = np.argsort(surface.ids[: 2 * len(surface.corners) : 2])
    return np.array(surface.corners)[order][[int(k) for k in ids[::2]]]


def grown(rng, cloud: str) -> Surface:
    surface = Surface(around_the_origin(rng))
    for corner in CLOUDS[cloud](rng):
        surface.expand(corner)
    return surface


@pytest.mark.slow
@pytest.mark.parametrize("cloud", ["sphere", "needle", "cube"])
def test_a_surface_passes_its_points(cloud):
    """A point of any facet is found, whichever is tried first; one off the surface by the facet that is nearest."""
    rng = rng_of("weigh nearest", cloud)
    outside = 0
    for _ in range(4):
        surface = grown(rng, cloud)
        slots, corners = surface.slots(), np.array(surface.corners)
        size = float(np.abs(corners).max())
        for _ in range(8):
            f, first = (int(k) for k in rng.choice(slots, 2))
            triangle = corners[surface.triangles()[f]]
            off = float(rng.choice([0.0, 1e-3])) * size
            p = rng.dirichlet(np.ones(3)) @ triangle
            p *= 1.0 + off / float(np.linalg.norm(p))
            points, ids, weights = [0.0] * (3 * POINT), [0] * 6, [0.0] * 3
            tolerance = 8 * ULP * size if off == 0.0 else 1e-4 * size
            at = Vec3(*p.tolist())
            args = surface.views, surface.count, first, points, ids, weights, True, at, tolerance
            distance = F.weigh_nearest(*args)
            found = np.array(points).reshape(3, POINT)[:, :3]
            assert (by_vertex(surface, ids) == found).all()
            check(found, weights, distance, p)
            nearest = min(
                sum(map(abs, nearest_to_origin(exact(corners[t] - p)).point)) for t in surface.triangles().values()
            )
            assert distance <= max(tolerance, float(nearest) + 32 * ULP * size)
            outside += off > 0.0 and distance > tolerance
    assert outside >= 3, outside


@pytest.mark.parametrize("cloud", ["sphere", "scattered", "needle"])
def test_origin_within_a_surface(cloud):
    """Four corners whose weighted sum is the origin."""
    rng = rng_of("weigh origin", cloud)
    for _ in range(6):
        surface = grown(rng, cloud)
        points, ids, weights = [0.0] * (4 * POINT), [0] * 8, [0.0] * 4
        assert F.weigh_origin(surface.views, surface.count, points, ids, weights)
        corners = by_vertex(surface, ids)
        assert min(weights) >= 0.0 and abs(sum(weights) - 1.0) <= 4 * ULP and len(set(ids[::2])) == 4
        combined = [sum(Fraction(w) * x for w, x in zip(weights, axis)) for axis in zip(*exact(corners))]
        assert float(sum(map(abs, combined))) <= 16 * ULP * float(np.abs(corners).max())


def test_weights_in_a_facet():
    """Least weight negative exactly where the foot is outside; the stored weights are clamped and add up to 1."""
    rng = rng_of("load facet")
    seen: Counter = Counter()
    surface = grown(rng, "sphere")
    corners = np.array(surface.corners)
    for f in surface.slots():
        triangle = corners[surface.triangles()[f]]
        true = rng.dirichlet(np.ones(3)) * 3.0 - 2.0 * rng.dirichlet(np.ones(3)) if f % 2 else rng.dirichlet(np.ones(3))
        points, ids, weights = [0.0] * (3 * POINT), [-1] * 6, [0.0] * 3
        inside = F.load_facet(surface.views, f, points, ids, weights, f % 3 > 0, Vec3(*(true @ triangle).tolist()))
        assert (np.array(points).reshape(3, POINT)[:, :3] == triangle).all()
        assert ids == [-1] * 6 if f % 3 == 0 else (by_vertex(surface, ids) == triangle).all()
        assert abs(inside - true.min()) <= 1e-10
        positive = np.maximum(true, 0.0)
        assert np.abs(weights - positive / positive.sum()).max() <= 1e-10
        seen[bool(inside < 0)] += 1
    assert min(seen[True], seen[False]) >= 10, seen
