"""Which vertices are level along a direction, against every vertex in Fractions: with planted ties, by scans and along
the edges of support trees."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from exact_simplex import exact, inner
from naive import LATTICE_ROTATIONS, Case, pose, random_pose, reproducible, rng_of
from posed_bodies import PosedBodies
from reproduction import reproducing

import collide
from collide.hull.exact_hull import convex_hull
from collide.kernels import address_of
from collide.narrowphase.gap import tied_vertices as T
from collide.numerics.exact_dot_sign import PRODUCT_TERMS
from collide.numerics.vec3 import Vec3
from collide.support.build_support_tree import build_support_tree

pytestmark = pytest.mark.plain_kernels

SOURCE = "points, g = {points}, {g}  # tests/narrowphase/gap/test_tied_vertices.py"
#: 48 corners, faces of four, six and eight: a truncated cuboctahedron, on a lattice.
SOLID = np.array([p for p in product((-3, -2, -1, 1, 2, 3), repeat=3) if sorted(map(abs, p)) == [1, 2, 3]]) * 0.5
#: 384 points of a lattice on a sphere: so many that neighbours are fewer than a scan takes.
BALL = np.array([p for p in product(range(-31, 32), repeat=3) if p[0] ** 2 + p[1] ** 2 + p[2] ** 2 == 953]) * 0.5
STRAIGHT = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (2.0, 1.0, 0.0), (3.0, 2.0, 1.0))


def body(points, with_tree: bool):
    """(`Vertices`, what keeps them alive)."""
    points = np.ascontiguousarray(points)
    tree = None
    if with_tree:
        hull = convex_hull(points)
        tree = build_support_tree(points, hull.vertices, hull.facets)
    padded = (len(points) + 7) // 8 * 8
    coords = np.tile(points[0], (padded, 1))
    coords[: len(points)] = points
    flat = np.ascontiguousarray(coords.T).ravel()
    return T.Vertices(flat, len(points), padded, tree.address if tree else 0), (flat, tree)


def level(points, g, limit: float) -> set[int]:
    return {k for k, p in enumerate(exact(points)) if inner(p, exact([g])[0]) <= Fraction(limit)}


@pytest.mark.parametrize("with_tree", [False, True])
def test_all_level_vertices_are_listed(with_tree):
    rng = rng_of("tied vertices", with_tree)
    points = SOLID
    vertices, held = body(points, with_tree)
    seen: Counter = Counter()
    for _ in range(200):
        g = np.array(STRAIGHT[int(rng.integers(len(STRAIGHT)))]) @ LATTICE_ROTATIONS[int(rng.integers(24))]
        slack = float(rng.choice([0.0, 0.5, 1.0, 8.0]))
        heights = points @ g
        ties = [-1] * (T.MAX_TIES + 1)
        ties[0] = int(rng.choice(np.flatnonzero(heights == heights.min())))
        with reproducing(SOURCE, points=points, g=g):
            true = level(points, g, heights.min() + slack)
            count, limit = T.tied_vertices(vertices, ties, Vec3(*g.tolist()), slack)
            assert limit == heights.min() + slack
            assert count == len(true) or min(count, len(true)) > T.MAX_TIES
            if count <= T.MAX_TIES:
                assert set(ties[:count]) == true
            seen["many" if count > T.MAX_TIES else min(count, 9)] += 1
    assert seen["many"] >= 20 and seen[1] + seen[2] >= 10 and seen[9] + seen[4] + seen[8] >= 10, (seen, held[1])


@pytest.mark.many(2)
@pytest.mark.parametrize("with_tree", [False, True])
def test_no_other_is_tied(with_tree):
    """True exactly where the level vertices are those named: also where one of these is not level itself."""
    rng = rng_of("no other is tied", with_tree)
    points = BALL if with_tree else SOLID
    vertices, held = body(points, with_tree)
    seen: Counter = Counter()
    for _ in range(200):
        g = np.array(STRAIGHT[int(rng.integers(len(STRAIGHT)))]) @ LATTICE_ROTATIONS[int(rng.integers(24))]
        g = g + rng.choice([0.0, 0.125]) * rng.integers(-2, 3, 3)
        heights = points @ g
        limit = float(np.unique(heights)[int(rng.integers(2))])
        true = level(points, g, limit)
        n = min(int(rng.integers(1, 4)), len(true))
        named = [int(k) for k in rng.choice(sorted(true), n, replace=False)]
        if rng.random() < 0.2:
            named[-1] = int(rng.integers(len(points)))
        if n == 3 and rng.random() < 0.3:
            named[1] = named[0]
        which = int(rng.integers(2))
        ids = [-1] * 6
        ids[which : 2 * n : 2] = named
        with reproducing(SOURCE + "; named, limit = {named}, {limit}", points=points, g=g, named=named, limit=limit):
            found = T.no_other_is_tied(vertices, ids, n, which, len(set(named)), Vec3(*g.tolist()), limit)
            assert found == (true == set(named))
        seen[bool(found)] += 1
    assert min(seen[True], seen[False]) > 20, (seen, held[1])


def test_distinct_vertices():
    rng = rng_of("distinct vertices")
    for _ in range(200):
        n = int(rng.integers(1, 4))
        ids = rng.integers(0, 3, 6).tolist()
        assert T.distinct_vertices(ids, n) == (len(set(ids[: 2 * n : 2])), len(set(ids[1 : 2 * n : 2])))


def lattice_case(rng) -> Case:
    A, B = (collide.ConvexHull(rng.integers(-1, 2, size=(int(rng.integers(2, 9)), 3)) * 0.5) for _ in range(2))
    turns = [LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
    return Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-3, 4, 3) * 0.5))


def test_unique_minimisers():
    """Against all vertices: the level ones of either body are those named, and these hang together."""
    rng = rng_of("unique minimiser")
    seen: Counter = Counter()
    for _ in range(400):
        case = lattice_case(rng)
        bodies = PosedBodies(*case)
        d = rng.integers(-1, 2, 3).astype(float)
        if not d.any():
            continue
        heights = {ij: inner(p, exact([d])[0]) for ij, p in bodies.difference().items()}
        lowest = [ij for ij, height in heights.items() if height == min(heights.values())]
        n = min(int(rng.integers(1, 4)), len(lowest))
        ids = [k for at in rng.choice(len(lowest), n, replace=False) for k in lowest[at]] + [-1] * (6 - 2 * n)
        with reproducible(case):
            found = T.is_unique_minimiser(bodies.pair, ids, n, [d[0], 0.0, d[1], 0.0, d[2], 0.0], 1e-9)
            named_a, named_b = set(ids[: 2 * n : 2]), set(ids[1 : 2 * n : 2])
            alone = named_a == {i for i, _ in lowest} and named_b == {j for _, j in lowest}
            assert found == (alone and len(named_a) + len(named_b) == n + 1)
        seen[n, bool(found)] += 1
    assert all(seen[key] >= 10 for key in ((1, True), (2, True), (2, False), (3, False))) and seen[3, True] >= 3, seen


@pytest.mark.parametrize("kind", ["lattice", "any"])
def test_lowest_pairs(kind):
    """How far below the first pair, to 2⁻⁹⁷ of the size, along a direction of double-doubles."""
    rng = rng_of("lowest pair", kind)
    terms = np.zeros(PRODUCT_TERMS)
    lower = 0
    for _ in range(80):
        case = lattice_case(rng)
        if kind == "any":
            case = case._replace(X_WA=random_pose(rng), X_WB=random_pose(rng))
        bodies = PosedBodies(*case)
        high = rng.normal(size=3)
        low = high * rng.uniform(-1, 1, 3) * 2.0**-54
        direction = [Fraction(x) + Fraction(y) for x, y in zip(high.tolist(), low.tolist())]
        heights = {ij: inner(p, direction) for ij, p in bodies.difference().items()}
        first = list(heights)[int(rng.integers(len(heights)))]
        with reproducible(case):
            d = np.stack([high, low], axis=1).ravel().tolist()
            found = T.lowest_pair(bodies.pair, [], [*first], d, address_of(terms), 0.25)
            error = Fraction(2.0**-97 * bodies.ordered.size * float(np.linalg.norm(high)))
            excess = 4 * (Fraction(float(found.excess.high)) + Fraction(float(found.excess.low)))
            assert abs(excess - (min(heights.values()) - heights[first])) <= error
            assert heights[found.i, found.j] - min(heights.values()) <= error
        lower += excess < 0
    assert lower >= 40
