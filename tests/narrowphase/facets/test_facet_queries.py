"""Closed meshes of a thousand facets near to touching, and the kernels as plain Python."""

from __future__ import annotations

import inspect
import os
import pickle
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from mesh_families import FAMILIES, random_pose
from mesh_shapes import block_ring, bumpy_sphere
from naive_triangles import as_integers, squared_distance, triangles_meet, world_points

import collide
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import (
    all_hits,
    first_hits,
    points_in_solid,
    self_hits,
    surface_distances,
    surfaces_meet,
)
from collide.papers.hierarchies.graded_tree import graded_tree


def pairs_by_boxes(va, fa, X, vb, fb, Y):
    """Pairs that meet, judged exactly among those whose boxes come within 1e-9 of each other."""
    a, b = ((v @ X[:3, :3].T + X[:3, 3])[f] for v, f, X in ((va, fa, X), (vb, fb, Y)))
    low_a, high_a, low_b, high_b = a.min(axis=1), a.max(axis=1), b.min(axis=1), b.max(axis=1)
    near = (low_a[:, None] <= high_b[None] + 1e-9).all(axis=2) & (low_b[None] <= high_a[:, None] + 1e-9).all(axis=2)
    exact_a, exact_b = as_integers(world_points(va, X), world_points(vb, Y))
    return [
        (i, j)
        for i, j in np.argwhere(near).tolist()
        if triangles_meet([exact_a[v] for v in fa[i]], [exact_b[v] for v in fb[j]])
    ]


def test_near_to_touching():
    """Gaps and depths down to a few ulps: no pair too many, none too few, and brackets that hold."""
    rng = np.random.default_rng(21)
    (va, fa), (vb, fb) = bumpy_sphere(900, 1), bumpy_sphere(700, 2)
    A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
    hits = cases = 0
    for case in range(3):
        X, Y = random_pose(rng), random_pose(rng)
        away = rng.normal(size=3)
        Y[:3, 3] = X[:3, 3] + 3.0 * away / np.linalg.norm(away)
        for _ in range(3):  # until it touches but for rounding
            r = surface_distances(A, B, X, Y)
            Y[:3, 3] -= r.distance[0] * r.normal[0]
        start = Y[:3, 3].copy()
        for gap in (1e-2, 1e-6, 1e-12, 1e-15, 0.0, -1e-15, -1e-12, -1e-6, -1e-3):
            Y[:3, 3] = start + gap * r.normal[0]
            want = pairs_by_boxes(va, fa, X, vb, fb, Y)
            found = all_hits(A, B, X, Y)
            told = f"case {case}, gap {gap}: X, Y = {X.tolist(), Y.tolist()}"
            assert list(map(tuple, found.pairs.tolist())) == want, told
            assert surfaces_meet(A, B, X, Y)[0] == bool(want), told
            s = surface_distances(A, B, X, Y)
            assert s.meets[0] == bool(want), told
            i, j = s.facets[0]
            exact_a, exact_b = world_points(va[fa[i]], X), world_points(vb[fb[j]], Y)
            scale = max(x.denominator for points in (exact_a, exact_b) for p in points for x in p)
            square = squared_distance(*as_integers(exact_a, exact_b)) / Fraction(scale) ** 2
            assert square <= Fraction(float(s.upper[0])) ** 2 and Fraction(float(s.lower[0])) ** 2 <= square, told
            if not want:
                for direction in rng.normal(size=(6, 3)):
                    Z = Y.copy()
                    Z[:3, 3] += direction / np.linalg.norm(direction) * s.lower[0] * 0.999999
                    assert not surfaces_meet(A, B, X, Z)[0], told
            hits += bool(want)
            cases += 1
    assert 0.3 < hits / cases < 0.8


def test_large_facets_against_fine_ones():
    """Leaves opened against boxes become triangles with half-spaces along their edges: no pair is lost to these."""
    rng = np.random.default_rng(23)
    va, fa = bumpy_sphere(1500, 3)
    A = build_mesh_tree(va, fa)
    hits = cases = 0
    for case in range(24):
        # A few triangles through, along and beside the fine surface, slivers and such without area among them.
        corners = rng.normal(size=(4, 3, 3)) * (1.2, 1.2, 1.2 * 10.0 ** rng.integers(-12, 1))
        corners[1, 2] = corners[1, 1] if case % 5 == 0 else corners[1, 1] + rng.normal(size=3) * 1e-6
        corners[2, 0] = va[fa[case]].mean(axis=0)
        corners[3] = va[fa[7 * case]][0] + (corners[3] - corners[3].mean(axis=0)) * 0.02
        vb, fb = corners.reshape(-1, 3), np.arange(12).reshape(4, 3)
        X, Y = random_pose(rng), random_pose(rng)
        Y[:3, 3] = X[:3, 3] + rng.normal(size=3) * (0.3 + case % 3)
        B = build_mesh_tree(vb, fb)
        told = f"case {case}: X, Y, B = {X.tolist(), Y.tolist(), vb.tolist()}"
        want = pairs_by_boxes(va, fa, X, vb, fb, Y)
        found = all_hits(A, B, X, Y)
        assert list(map(tuple, found.pairs.tolist())) == want, told
        assert sorted(map(tuple, all_hits(B, A, Y, X).pairs[:, ::-1].tolist())) == want, told
        assert surfaces_meet(A, B, X, Y)[0] == bool(want), told
        # Far fewer than the boxes of the triangles hold.
        assert found.counters[0, 1] < 30 * (len(want) + 8), told
        hits += len(want)
        cases += bool(want)
    assert hits > 200 and 6 < cases < 22


def test_far_apart_or_not_a_matrix_that_mirrors_is_refused():
    va, fa = bumpy_sphere(300)
    A = build_mesh_tree(va, fa)
    far, touching = np.eye(4), np.eye(4)
    far[:3, 3] = 50.0, 0.0, 0.0
    assert not surfaces_meet(A, A, np.eye(4), far)[0]
    assert all_hits(A, A, np.eye(4), far).counters.sum() == 0  # their balls are apart
    touching[0, 3] = 2.0 * va[:, 0].max()
    assert all_hits(A, A, np.eye(4), touching).counters[0, 0] > 0
    for X in (np.diag([-1.0, 1.0, 1.0, 1.0]), np.diag([1.0, 1.0, 0.0, 1.0])):
        for shift in (0.0, 50.0):
            X[0, 3] = shift
            with pytest.raises(collide.InvalidPose):
                surfaces_meet(A, A, X, np.eye(4))


def test_balls_part_only_what_is_apart():
    """Near to where two balls touch, at any distance from the origin, for matrices near and not so near to
    rotations."""
    rng = np.random.default_rng(31)
    vb, fb = np.array([[-1.0, 0, 0], [1.0, 0, 0]]), np.array([[0, 1, 1]])  # a segment along x fills its ball
    A = build_mesh_tree(vb, fb)
    hits = 0
    for case in range(400):
        X, Y = np.eye(4), np.eye(4)
        stretch = rng.choice([1.0, 1.0 + 1e-5, 1.0 - 1e-5, 1.01, 0.5])
        Y[:3, :3] *= stretch
        X[0, 3] = rng.choice([0.0, 1.0, 1e6, -3e9]) * rng.random()
        Y[0, 3] = X[0, 3] + (1.0 + stretch) + rng.choice([0.0, 1e-15, -1e-15, 1e-9, -1e-9, 1e-4, -1e-4])
        gap = Fraction(float(Y[0, 3])) - Fraction(float(Y[0, 0])) - Fraction(float(X[0, 3])) - 1
        assert surfaces_meet(A, A, X, Y)[0] == (gap <= 0), (case, X.tolist(), Y.tolist())
        hits += gap <= 0
    assert 100 < hits < 300


def test_one_inside_the_other_meets_nothing():
    (va, fa) = bumpy_sphere(2000)
    A, B = build_mesh_tree(va, fa), build_mesh_tree(va * 0.1, fa)
    Xs = np.stack([random_pose(np.random.default_rng(k), 0.1) for k in range(10)])
    assert not surfaces_meet(A, B, np.eye(4), Xs).any()
    assert (points_in_solid(A, np.eye(4), va[0] * 0.1, Xs) == 2).all()
    assert (points_in_solid(B, Xs, va[0], np.eye(4)) == 0).all()


def test_points_segments_and_rays_are_facets_without_area():
    va, fa = bumpy_sphere(1000)
    tree = build_mesh_tree(va, fa)
    ray = build_mesh_tree(np.array([[0.0, 0, 0], [10.0, 0.3, 0.2]]), np.array([[0, 1, 1]]))
    assert len(all_hits(tree, ray, np.eye(4), np.eye(4)).pairs) == 1
    corner = build_mesh_tree(va[17:18], np.array([[0, 0, 0]]))
    X = random_pose(np.random.default_rng(1))
    pairs = all_hits(tree, corner, X, X).pairs
    assert set(pairs[:, 0]) == set(np.flatnonzero((fa == 17).any(axis=1)))
    far = build_mesh_tree(np.array([[0.0, 0.0, 5.0]]), np.array([[0, 0, 0]]))
    r = surface_distances(tree, far, np.eye(4), np.eye(4))
    assert abs(r.distance[0] - 3.9) < 1e-14 and np.allclose(r.point_a[0], [0, 0, 1.1])


def answers(cases) -> list[bytes]:
    """Everything that trees and queries say about some pairs of meshes."""
    told = []
    for (va, fa), (vb, fb), X, Y in cases:
        A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
        told += [A.nodes, graded_tree(va, fa).nodes, *all_hits(A, B, X, Y), *first_hits(A, B, X, Y), *self_hits(A)]
        told += [*surface_distances(A, B, X, Y), points_in_solid(A, X, vb[:3], Y)]
    return [array.tobytes() for array in told]


CHILD = f"""
import pickle, sys
import numpy as np
from collide import kernels
from collide.mesh.build_bvh import build_mesh_tree
from collide.papers.hierarchies.graded_tree import graded_tree
from collide.narrowphase.facets.facet_queries import *
{inspect.getsource(answers)}
assert kernels.PLAIN_PYTHON
pickle.dump(answers(pickle.load(sys.stdin.buffer)), sys.stdout.buffer)
"""


def test_without_compilation_the_bits_are_the_same():
    cases = []
    for family, (make, _) in FAMILIES.items():
        rng = np.random.default_rng([5, *family.encode()])
        cases += [make(rng) for _ in range(2)]
    ring = block_ring()
    cases.append((ring, (ring[0] * 0.25, ring[1]), collide.pose((0.5, 0, 0)), np.eye(4)))
    child = subprocess.run(
        [sys.executable, "-c", CHILD], input=pickle.dumps(cases), env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(collide.__file__).parents[1], capture_output=True, timeout=300, check=False,
    )
    assert child.returncode == 0, child.stderr.decode()[-3000:]
    assert pickle.loads(child.stdout) == answers(cases)


def test_the_first_hit_is_one_of_all():
    rng = np.random.default_rng(31)
    A, B = build_mesh_tree(*bumpy_sphere(1500, 3)), build_mesh_tree(*bumpy_sphere(1500, 4))
    Xs, Ys = (np.stack([random_pose(rng, 0.7) for _ in range(30)]) for _ in range(2))
    whole, first = all_hits(A, B, Xs, Ys), first_hits(A, B, Xs, Ys)
    assert 0 < np.count_nonzero(np.diff(first.starts)) < 30
    for k in range(30):
        some = set(map(tuple, whole.pairs[whole.starts[k] : whole.starts[k + 1]].tolist()))
        one = set(map(tuple, first.pairs[first.starts[k] : first.starts[k + 1]].tolist()))
        assert one <= some and bool(one) == bool(some)


def test_a_limited_number_of_hits_are_some_of_all():
    """Of a bumpy sheet of 60 by 60 cells and the sheet made flat."""
    x, y = np.meshgrid(np.arange(61.0), np.arange(61.0))
    vertices = np.stack([x, y, np.sin(x * y)], axis=2).reshape(-1, 3)
    corner = (np.arange(60)[:, None] * 61 + np.arange(60)).ravel()
    faces = np.concatenate([np.stack([corner, corner + d, corner + 62], axis=1) for d in (1, 61)])
    A, B = build_mesh_tree(vertices, faces), build_mesh_tree(vertices * np.array([1.0, 1.0, 0.0]), faces)
    for (first, last), X in (((A, B), np.eye(4)), ((B, A), collide.pose((0.01, 0, 0)))):
        whole = all_hits(first, last, X, np.eye(4)).pairs
        assert len(whole) > 6000
        for max_pairs in (1000, 5000, len(whole), 10 * len(whole)):
            some = all_hits(first, last, X, np.eye(4), max_pairs).pairs
            assert set(map(tuple, some.tolist())) <= set(map(tuple, whole.tolist()))
            assert min(max_pairs, len(whole)) <= len(some) <= max(4096, 4 * max_pairs)
            assert np.array_equal(some, all_hits(first, last, X, np.eye(4), max_pairs).pairs)
            assert max_pairs < len(whole) or np.array_equal(some, whole)
        assert len(all_hits(first, last, X, np.eye(4), 1000).pairs) < len(whole)
