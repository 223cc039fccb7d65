"""B3 for bodies and polars alike at 10,000 vertices, flat sides that were turned and rounded among them.

`benchmarks/hierarchies.py` asserts the same at 10⁵ and 10⁶ vertices.
"""

from __future__ import annotations

import os
from fractions import Fraction

import numpy as np
import pytest
from hierarchy_families import IRREGULAR, families, irregular, moment_curve, prism, removed_shares, turned

from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy import DEGREE_BOUND, build_hierarchy
from collide.papers.hierarchies.merged_facets import facet_of_triangles
from collide.papers.hierarchies.polar_hull import polar_of_hull
from collide.papers.hierarchies.true_facets import Cloud, twins_of
from collide.papers.hierarchies.validate_hierarchy import validate_hierarchy

pytestmark = pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="too slow in plain Python")
#: A curve over fifty octaves crowds its vertices far below what doubles tell apart in a polar.
NAMES = [name for name in families(40) if not name.startswith("cube") and name != "crowded"]
#: Two vertices of large degree are neighbours: one is cut a level after the other.
TWO_LARGE = {"moment curve", "arcs", "arcs, turned"}


def largest_degrees(hierarchy) -> list[int]:
    return [int(hierarchy.degrees(level).max()) for level in range(hierarchy.depth)]


@pytest.mark.many(5)
@pytest.mark.parametrize("name", NAMES)
def test_bound_and_shares(name):
    """Degrees in level 1 and above, and independent sets of a tenth of their level or more."""
    points = families(10_000)[name]
    hull = convex_hull(points)
    hierarchies = {"body": build_hierarchy(points, hull), "polar": polar_of_hull(points, hull).hierarchy}
    for which, hierarchy in hierarchies.items():
        first = 2 if which == "body" and name in TWO_LARGE else 1
        degrees = largest_degrees(hierarchy)
        assert max(degrees[first:]) <= DEGREE_BOUND, f"{which} of {name}: degrees {degrees}"
        shares = removed_shares(hierarchy)
        assert len(shares) > 8 and shares.min() >= 0.1, f"{which} of {name}: shares {shares}"


def assert_bound(hierarchy, label: str) -> None:
    degrees = largest_degrees(hierarchy)
    assert max(degrees[1:]) <= DEGREE_BOUND, f"{label}: degrees {degrees}"


@pytest.mark.parametrize("seed", [1, 7])
@pytest.mark.parametrize("name", ["bipyramid", "cone"])
def test_bound_where_neighbours_of_a_large_vertex_nearly_coincide(name, seed):
    """Two neighbours of the apex are some 10⁻⁸ apart: a cut whose vertices move far from its edges is not convex."""
    points = irregular(name, 10_000, np.random.default_rng(seed))
    hierarchy = build_hierarchy(points, convex_hull(points))
    assert hierarchy.degrees(0).max() == 10_000
    assert_bound(hierarchy, f"{name}, seed {seed}")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("n", [3_000, 10_000, 100_000])
@pytest.mark.parametrize("name", IRREGULAR)
def test_bound_of_irregular_bodies(name, n, seed):
    points = irregular(name, n, np.random.default_rng(seed))
    hull = convex_hull(points)
    assert_bound(build_hierarchy(points, hull), f"{name}, n = {n}, seed {seed}")
    assert_bound(polar_of_hull(points, hull).hierarchy, f"polar of {name}, n = {n}, seed {seed}")


@pytest.mark.parametrize("name", ["bipyramid", "cone"])
def test_levels_of_irregular_bodies_are_hulls(name):
    points = irregular(name, 150, np.random.default_rng(4))
    points[1] = points[0] + np.array([points[0, 1], -points[0, 0], 0.0]) * 1e-9  # a neighbour as near as that
    validate_hierarchy(points, build_hierarchy(points, convex_hull(points)), bounded_from=1)


@pytest.mark.parametrize(("height", "sides"), [(1.0, 3_000), (1e-6, 3_000)])
def test_turned_caps_are_one_facet_each(height, sides):
    """A rounded cap is thousands of facets; its polar is one point with a neighbour for every side, as if unrounded."""
    points = turned(prism(sides, height))
    body = polar_of_hull(points, convex_hull(points))
    assert len(body.groups) > sides + 50 and len(body.points) == sides + 2
    assert sorted(body.hierarchy.degrees(0))[-2:] == [sides, sides]
    assert max(largest_degrees(body.hierarchy)[1:]) <= 40


@pytest.mark.parametrize("name", ["prism, turned", "degree doubling", "needle, turned", "arcs"])
def test_merged_facets_lie_below_what_stands_for_them(name):
    """In fractions: a corner of a facet is below its group's plane, by no more than merging and domes allow."""
    points = families(1_000)[name]
    hull = convex_hull(points)
    body = polar_of_hull(points, hull)
    weight = float((np.abs(body.points) @ np.abs(points - body.origin).max(axis=0)).max())
    part = Fraction(2.0**-45 * (2.0 + weight) + 2.0**-51 * 64 * weight)
    merged = 0
    facets = np.ascontiguousarray(hull.facets, dtype=np.int32)
    group = body.groups[facet_of_triangles(Cloud(points), facets, twins_of(facets))]
    origin = [Fraction(x) for x in body.origin.tolist()]
    for triangle, k in list(zip(facets.tolist(), group.tolist()))[:: max(1, len(facets) // 600)]:
        q = [Fraction(x) for x in body.points[k].tolist()]
        for v in triangle:
            height = sum((Fraction(x) - o) * y for x, o, y in zip(points[v].tolist(), origin, q))
            assert 1 - part <= height < 1, f"{name}: facet {triangle} at {float(1 - height):g} below group {k}"
        merged += tuple(sorted(triangle)) != tuple(sorted(body.spans[k].tolist()))
    assert merged > 0 or name != "prism, turned"


def test_two_large_neighbours_take_a_level_each():
    """No double lies between the ends of a turned moment curve; so level 1 keeps one of them, and half its neighbours.

    A level without either would leave a plane between it and their edge, with two vertices beyond: against Lemma 4.2.
    One that stays keeps its edges to all neighbours that stay, and an independent set takes every other one at most.
    """
    points = turned(moment_curve(2_000))
    hierarchy = build_hierarchy(points, convex_hull(points))
    degrees = largest_degrees(hierarchy)
    assert degrees[0] == 1_999 and degrees[1] >= 1_999 // 2
    assert max(degrees[2:]) <= DEGREE_BOUND
    gone = [v for v in (0, 1_999) if hierarchy.last[v] == 0]
    assert len(gone) == 1
    small = turned(moment_curve(200))
    validate_hierarchy(small, build_hierarchy(small, convex_hull(small)), bounded_from=2)
