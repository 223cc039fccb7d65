"""Proofs of convex parts: whatever vertices are named, nothing false is ever proven, and true proofs are taken."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import naive
import numpy as np
from naive import Case, random_pose, rng_of

import collide
from collide.certificates.convex_proofs import flaw_of_proof
from collide.certificates.exact_parts import common_vertices, exact_parts
from collide.certificates.nearest_to_origin import nearest_vertex_pairs


def small_case(rng) -> Case:
    """Hulls of a few lattice points, some with radii, often just touching."""
    A, B = (
        collide.ConvexHull(rng.integers(-2, 3, (int(rng.integers(1, 6)), 3)) * 1.0, radius=float(rng.choice([0, 0, 1])))
        for _ in "AB"
    )
    X = naive.pose(t=rng.integers(-2, 3, 3)) if rng.random() < 0.6 else random_pose(rng, 2.0)
    return Case(A, B, X, naive.pose(t=rng.integers(-2, 3, 3)))


def parts(case: Case):
    (part_a,), (part_b,) = exact_parts(case.A, case.X_WA), exact_parts(case.B, case.X_WB)
    return part_a, part_b


def test_nothing_false_is_proven_by_any_vertices():
    rng = rng_of("convex proofs")
    seen: Counter = Counter()
    for _ in range(150):
        case = small_case(rng)
        A, B = parts(case)
        with naive.reproducible(case):
            hit = naive.exact_distance(case) <= 0
            for _ in range(8):
                pairs = [(int(rng.integers(len(A))), int(rng.integers(len(B)))) for _ in range(int(rng.integers(1, 5)))]
                for claim in (True, False):
                    flaw = flaw_of_proof(A, B, pairs, hit=claim)
                    assert flaw is not None or claim == hit, pairs
                    seen[claim, flaw is None] += 1
            points_a, points_b, _ = common_vertices(A, B)
            nearest = nearest_vertex_pairs(points_a, points_b, [(0, 0)])
            assert flaw_of_proof(A, B, nearest, hit=bool(hit)) is None, nearest
            assert flaw_of_proof(A, B, nearest, hit=not hit) is not None
    assert min(seen.values()) > 30 and len(seen) == 4, seen


def test_half_spaces_by_every_vertex():
    rng = rng_of("plane proofs")
    seen: Counter = Counter()
    for k in range(120):
        case = small_case(rng)
        normal = rng.integers(-2, 3, 3) * 1.0 if k % 2 else rng.normal(size=3)
        if not normal.any():
            continue
        B = collide.Halfspace(normal, float(rng.integers(-3, 4)))
        (A,), (plane,) = exact_parts(case.A, case.X_WA), exact_parts(B, case.X_WB)
        n, offset = plane.plane
        points, grid = A.vertices, A.vertices.grid
        square = sum(c * c for c in n)
        heights = [sum(c * x for c, x in zip(n, p)) * Fraction(2) ** grid - offset for p in points]
        reaches = [h <= 0 or h * h <= A.radius**2 * square for h in heights]
        told = f"{naive.spell(case.A)}, {naive.spell(B)}, {case.X_WA.tolist()}, {case.X_WB.tolist()}"
        for i, reached in enumerate(reaches):
            assert (flaw_of_proof(A, plane, [(i, -1)], hit=True) is None) == reached, told
            assert (flaw_of_proof(plane, A, [(-1, i)], hit=True) is None) == reached, told
        assert (flaw_of_proof(A, plane, [], hit=False) is None) == (not any(reaches)), told
        seen[any(reaches)] += 1
        assert "half-spaces" in flaw_of_proof(plane, plane, [], hit=True)
    assert min(seen[True], seen[False]) > 20, seen


def test_what_names_no_vertices_is_refused():
    A, B = parts(Case(collide.Box((1, 1, 1)), collide.Sphere(0.5), np.eye(4), naive.pose(t=(3, 0, 0))))
    for pairs in ([], [(0, 0)] * 5, [(8, 0)], [(0, 1)], [(-1, 0)]):
        for hit in (True, False):
            assert flaw_of_proof(A, B, pairs, hit=hit) is not None, pairs
    assert "no axis" in flaw_of_proof(A, A, [(0, 0)], hit=False)
