"""Distances down the hierarchies, each proven in the test: the points are in the bodies, and a plane keeps these apart.

The oracle is a pair of inequalities in numpy over all vertices and facets; it shares no code with the kernels. Counts
of rounds are exact, and bounded by the product of the depths.
"""

from __future__ import annotations

import os
from functools import cache

import numpy as np
import pytest
from hierarchy_families import degree_doubling, families, sphere

import collide
from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy import DEGREE_BOUND, build_hierarchy
from collide.papers.hierarchies.hierarchy_distance import hierarchy_distance
from collide.papers.hierarchies.packed_hierarchy import PackedHierarchy
from collide.scenes.families import generate
from collide.scenes.families.ingredients import rotation

SIZE = 200 if os.environ.get("NUMBA_DISABLE_JIT") != "1" else 40
NAMES = list(families(40))


@cache
def packed(name: str, bound: int):
    points = families(SIZE)[name]
    hull = convex_hull(points)
    corners = points[hull.facets]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.sqrt(np.square(normals).sum(axis=1))
    sure = length > 1e-12
    normals = normals[sure] / length[sure, None]
    offsets = (normals * corners[sure, 0]).sum(axis=1)
    return points, normals, offsets, PackedHierarchy(build_hierarchy(points, hull, bound))


def times(rotation, points):
    return np.stack([(rotation[k] * points).sum(axis=-1) for k in range(3)], axis=-1)


@pytest.mark.parametrize("bound", [0, DEGREE_BOUND])
@pytest.mark.parametrize("name", NAMES)
def test_distances_are_proven(name, bound):
    rng = np.random.default_rng([NAMES.index(name), bound])
    points, normals, offsets, a = packed(name, bound)
    apart = 0
    for other in ("sphere", "bipyramid, turned", "arcs", "cube, turned", "prism"):
        points_b, normals_b, offsets_b, b = packed(other, bound)
        centre_b = points_b.mean(axis=0)
        for far in (0.0, 1.2, 1.7, 2.5, 9.0):
            turned = rotation(rng)
            direction = rng.normal(size=3)
            shift = points.mean(axis=0) - times(turned, centre_b)
            shift += far * direction / np.sqrt(np.square(direction).sum())
            snippet = (name, other, bound, turned.tolist(), shift.tolist())
            found = hierarchy_distance(a, b, turned, shift)
            assert found.counters[0] < a.hierarchy.depth, snippet
            assert found.counters[1] <= a.hierarchy.depth * b.hierarchy.depth, snippet
            if far == 0.0:
                assert found.distance < 1e-9, snippet
            if found.distance < 1e-9:
                continue
            apart += 1
            posed = times(turned, points_b) + shift
            axis = (found.point_b - found.point_a) / found.distance
            gap = (posed * axis).sum(axis=1).min() - (points * axis).sum(axis=1).max()
            assert gap >= found.distance * (1 - 1e-9) - 1e-12, snippet
            assert ((normals * found.point_a).sum(axis=1) - offsets).max() < 1e-9, snippet
            inside_b = times(turned.T, found.point_b - shift)
            assert ((normals_b * inside_b).sum(axis=1) - offsets_b).max() < 1e-9 * (1 + np.abs(centre_b).max()), snippet
    assert apart >= 5


def test_levels_gone_down_grow_with_the_product_of_logarithms():
    """Exact counts, so no timing: from 2^8 to 2^12 vertices the levels may grow by (12/8)² and a little, not by 16."""
    rng = np.random.default_rng(3)
    mean = []
    for n in (256, 4096) if SIZE > 100 else (32, 128):
        body = PackedHierarchy(build_hierarchy(sphere(n), convex_hull(sphere(n))))
        counts = [
            hierarchy_distance(body, body, rotation(rng), 2.2 * d / np.sqrt(np.square(d).sum())).counters[1]
            for d in rng.normal(size=(40, 3))
        ]
        mean.append(np.mean(counts))
    assert mean[1] < 3.5 * mean[0], mean


def test_a_vertex_of_large_degree_in_the_body_itself_is_scanned_with_and_without_a_bound():
    """Section 4's body, its large vertex nearest. Without a bound every level's list is scanned, n in all. With one
    only the body itself has the vertex, but its star is scanned once: the text counts on a perturbation that makes P
    simple."""
    points = degree_doubling(9 if SIZE > 100 else 5)
    hull = convex_hull(points)
    ball = sphere(60)
    b = PackedHierarchy(build_hierarchy(ball, convex_hull(ball)))
    for bound in (0, DEGREE_BOUND):
        a = PackedHierarchy(build_hierarchy(points, hull, bound))
        found = hierarchy_distance(a, b, np.eye(3), np.array([0.05, 0.02, 1.5]))
        assert 0.4 < found.distance < 0.6
        assert 0.9 * len(points) < found.counters[3] < 2 * len(points) + 1000


@pytest.mark.many(2)
@pytest.mark.parametrize(
    "family", ["rand_sep", "near_sep", "rand_pen", "boxes_rest", "needles", "cyl1000", "identical"]
)
def test_distances_of_the_public_call_are_proven(family):
    """`algorithm="dobkin-kirkpatrick"`: the proposal of the hierarchies, settled in integers to the last digit."""
    gaps = 0
    for case in generate(family, n=8, seed=12):
        question = case.shapes()
        r, default = collide.distance(*question, algorithm="dobkin-kirkpatrick"), collide.distance(*question)
        assert r.hit == default.hit and r.certified, case.snippet()
        assert max(r.lower, default.lower) <= min(r.upper, default.upper), case.snippet()
        assert abs(r.distance - default.distance) <= 4 * np.spacing(abs(default.distance)), case.snippet()
        if not r.hit:
            gaps += 1
            assert r.iterations > 0 and abs(r.normal @ r.normal - 1.0) < 1e-14
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-12 * (1 + np.abs(r.point_a).max())
            collide.verify(*question, r)
    assert gaps >= {"identical": 0, "cyl1000": 1, "rand_pen": 1, "boxes_rest": 1}.get(family, 4)


def test_batches_and_what_is_not_served():
    rng = np.random.default_rng(12)
    A, B = (collide.ConvexHull(rng.normal(size=(40, 3))) for _ in range(2))
    X_WB = np.array([collide.pose(rng.normal(size=3) * 3, rpy=rng.uniform(-3, 3, 3)) for _ in range(30)])
    together = collide.distance(A, B, np.eye(4), X_WB, algorithm="dobkin-kirkpatrick")
    assert 3 <= together.hit.sum() <= 27
    for k in range(30):
        alone = collide.distance(A, B, np.eye(4), X_WB[k], algorithm="dobkin-kirkpatrick")
        assert alone.rows.tobytes() == together.rows[k : k + 1].tobytes()
    flat = collide.ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    assert collide.distance(flat, A, np.eye(4), X_WB[0], algorithm="dobkin-kirkpatrick").certified
    for wrong in ("barba-langerman", "fast", np.array(["gjk", "gjk"])):
        with pytest.raises(collide.InvalidArgument, match="algorithm"):
            collide.distance(A, B, np.eye(4), np.eye(4), algorithm=wrong)
    with pytest.raises(collide.UnsupportedQuery, match="Sphere"):
        collide.distance(collide.Sphere(1), B, np.eye(4), np.eye(4), algorithm="dobkin-kirkpatrick")
    with pytest.raises(collide.InvalidArgument, match="max_distance"):
        collide.distance(A, B, np.eye(4), np.eye(4), max_distance=1.0, algorithm="dobkin-kirkpatrick")


@pytest.mark.parametrize("far", [1e160, 1e200, np.inf, np.nan])
def test_numbers_beyond_doubles_give_no_vertices(far):
    """Squares overflow: nothing is found, and nothing is read by a vertex number that was never written."""
    *_, body = packed("cube, turned", DEGREE_BOUND)
    found = hierarchy_distance(body, body, np.eye(3), np.array([far, far, 0.0]))
    assert not found.distance < np.inf and (found.vertices == -1).all()


@pytest.mark.parametrize("size", [1e-45, 1e-30, 1.0, 1e30, 1e45])
def test_extreme_sizes_are_left_to_the_default(size):
    points = sphere(50) * size
    A, B = collide.ConvexHull(points), collide.ConvexHull(points[::-1])
    X_WB = np.eye(4)
    X_WB[:3, 3] = 4 * size, size, 0.0
    for shift in (1.0, 2.0**60):
        X_WB[:3, 3] *= shift
        try:
            default = collide.distance(A, B, np.eye(4), X_WB)
        except (collide.InvalidPose, collide.InvalidArgument, collide.UnsupportedQuery) as error:
            with pytest.raises(type(error)):
                collide.distance(A, B, np.eye(4), X_WB, algorithm="dobkin-kirkpatrick")
            continue
        r = collide.distance(A, B, np.eye(4), X_WB, algorithm="dobkin-kirkpatrick")
        assert r.certified and r.hit == default.hit, (size, shift)
        assert abs(r.distance - default.distance) <= 4 * np.spacing(default.distance), (size, shift)


def test_singular_poses_unchecked_are_left_to_the_default():
    A, X = collide.ConvexHull(sphere(50)), np.diag([0.0, 1.0, 1.0, 1.0])
    answers = [
        collide.distance(A, A, X, collide.pose((0, 3, 1)), check_poses=False, algorithm=name).distance
        for name in ("gjk", "dobkin-kirkpatrick")
    ]
    assert answers[0] == answers[1] > 0
