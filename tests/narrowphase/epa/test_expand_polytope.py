"""EPA in doubles on random overlaps: its surface, its bracket and its facets, against all points of A ⊖ B exactly."""

from __future__ import annotations

import math
from collections import Counter

import naive
import numpy as np
import pytest
from exact_simplex import determinant, exact, nearest_to_origin
from growing_surface import triangles
from naive import Case, pose, random_pose, rng_of, rotation
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.epa import expand_polytope as E
from collide.narrowphase.epa.polytope_surface import surface_at
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.numerics.vec3 import Vec3

pytestmark = pytest.mark.plain_kernels


def overlap(rng, kind: str) -> Case:
    n = int(rng.integers(4, 14))
    A, B = (collide.ConvexHull(naive.hull_points(rng, n)) for _ in range(2))
    case = Case(A, B, random_pose(rng, 0.2), random_pose(rng, 0.2))
    if kind == "boxes":
        A, B = (collide.Box(tuple(rng.uniform(0.5, 1.5, 3))) for _ in range(2))
        case = Case(A, B, pose(), pose(t=rng.uniform(-0.4, 0.4, 3)))
    elif kind == "round":  # many facets nearly as near as the nearest
        A, B = (collide.ConvexHull(p / np.linalg.norm(p, axis=1)[:, None]) for p in rng.normal(size=(2, 22, 3)))
        case = case._replace(A=A, B=B)
    elif kind == "shallow":
        case = naive.with_gap(case, -float(rng.choice([1e-3, 1e-9, 1e-13])))
    elif kind == "flat":
        frame = rotation(rng)[:2]
        A, B = (collide.ConvexHull(rng.normal(size=(6, 2)) @ frame) for _ in range(2))
        case = Case(A, B, pose(), pose(t=rng.normal(size=3) * rng.choice([0.0, 1e-3])))
    return case


def run(bodies: PosedBodies, *, overlap_suffices: bool = False, start: int = 0):
    """(surface, result) of EPA begun from an extremal tetrahedron."""
    surface = surface_at(bodies.work.epa_at, bodies.work.epa_integers_at)
    seed = E.Seed(bodies.work.points, bodies.work.ids, False, False, False, start)
    goal = E.Goal(overlap_suffices, bodies.ordered.size, bodies.error, 0.25 * bodies.error)
    return surface, E.epa(bodies.pair, surface, seed, goal)


def farthest(bodies: PosedBodies, n) -> float:
    """Support value of A ⊖ B in a direction of doubles."""
    corners = np.array([[float(x) for x in point] for point in bodies.difference().values()])
    return float((corners @ np.array(n)).max())


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["any", "boxes", "round", "shallow"])
def test_surface_and_bracket(kind):
    """A sphere by Euler's formula, outwards, convex but for rounding, of points of A ⊖ B, around the origin; the depth
    is the support value of its direction, and no direction has less."""
    rng = rng_of("expand polytope", kind)
    seen: Counter = Counter()
    for case in (overlap(rng, kind) for _ in range(8 if kind == "round" else 24)):
        bodies = PosedBodies(*case)
        true = -float(naive.exact_distance(case))
        if true <= 0.0:
            continue
        with naive.reproducible(case):
            surface, result = run(bodies, start=seen["overlaps"] % 3)
            seen["overlaps"] += 1
            assert result.status == E.EXPANDED and abs(np.linalg.norm(result.nhat) - 1.0) <= 1e-15
            assert abs(farthest(bodies, result.nhat) - result.depth) <= bodies.error
            assert abs(result.depth - true) <= 4 * bodies.error, "boxes and scattered points: no thin facets"
            if result.clearance >= 0.0:
                seen["proven"] += 1
                assert result.clearance <= true + bodies.error and result.depth - result.clearance <= 4 * bodies.error
            check_surface(bodies, surface, result)
    n = 6 if kind == "round" else 15
    assert seen["overlaps"] >= n and seen["proven"] >= (1 if kind == "shallow" else n), seen


def check_surface(bodies: PosedBodies, surface, result) -> None:
    facets = triangles(surface, result.facet)
    vertices = {v for triangle in facets.values() for v in triangle}
    edges = {(t[k], t[(k + 1) % 3]) for t in facets.values() for k in range(3)}
    assert len(edges) == 3 * len(facets) and all((j, i) in edges for i, j in edges)
    assert len(vertices) - len(edges) // 2 + len(facets) == 2
    corners = surface.points[: POINT * result.n_vertices].reshape(-1, POINT)[:, :3]
    difference = bodies.difference()
    for v in vertices:
        true = difference[int(surface.ids[2 * v]), int(surface.ids[2 * v + 1])]
        assert all(abs(x - float(y)) <= bodies.error for x, y in zip(corners[v].tolist(), true))
    nearest = math.inf
    for triangle in facets.values():
        a, b, c = corners[triangle]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        # The error of a corner, as the triangle's least height makes it larger across its plane.
        edge = max(np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(a - c))
        if length < 1e-6 * edge * edge:
            continue
        slack = 4 * bodies.error * edge * bodies.ordered.size / length
        assert ((corners[sorted(vertices)] - a) @ normal / length).max() <= slack
        if result.clearance >= 0.0:
            assert determinant(*exact([a, b, c])) > 0
        nearest = min(nearest, float(nearest_to_origin([a, b, c]).square) ** 0.5)
    assert result.clearance <= nearest + 2.0**-50 * bodies.ordered.size


def test_flat_differences():
    rng = rng_of("flat differences")
    seen: Counter = Counter()
    for case in (overlap(rng, "flat") for _ in range(25)):
        bodies = PosedBodies(*case)
        with naive.reproducible(case):
            _, result = run(bodies)
            assert (result.status, result.facet, result.n_vertices) == (E.FLAT, -1, 3)
            both = farthest(bodies, result.nhat), farthest(bodies, [-x for x in result.nhat])
            assert abs(both[0] - result.depth) <= bodies.error and both[0] <= both[1] + bodies.error
            seen["level" if abs(result.depth) <= bodies.error else "apart"] += 1
            assert result.depth <= bodies.error
    assert min(seen["level"], seen["apart"]) >= 5, seen


def test_a_proven_overlap_suffices():
    """Fewer vertices, and what is said of the origin holds; a plane that separates ends it, too."""
    rng = rng_of("overlap suffices")
    seen: Counter = Counter()
    for _ in range(60):
        n = int(rng.integers(6, 40))
        A, B = (collide.ConvexHull(naive.hull_points(rng, n)) for _ in range(2))
        case = Case(A, B, random_pose(rng, 0.9), random_pose(rng, 0.9))
        bodies = PosedBodies(*case)
        with naive.reproducible(case):
            true = -float(naive.exact_distance(case))
            n_vertices = run(bodies)[1].n_vertices
            _, result = run(bodies, overlap_suffices=True)
            assert result.n_vertices <= n_vertices or true < 0
            if result.clearance > bodies.error:
                assert true > 0.0 and result.clearance <= true + bodies.error
                seen["inside", result.n_vertices < n_vertices] += 1
            if result.depth < -bodies.error:
                assert true < 0.0
                seen["separated"] += 1
    assert seen["inside", True] >= 8 and seen["separated"] >= 8, seen


def test_facet_of_a_point():
    """The facet that holds a point of the surface, whichever is named at first."""
    rng = rng_of("facet of")
    for _ in range(6):
        bodies = PosedBodies(*overlap(rng, "any"))
        surface, result = run(bodies)
        facets = triangles(surface, result.facet)
        corners = surface.points.reshape(-1, POINT)[:, :3]
        for f, triangle in facets.items():
            weights = rng.dirichlet(np.ones(3)) * 0.7 + 0.1
            a, b, c = corners[triangle]
            if np.linalg.norm(np.cross(b - a, c - a)) < 1e-3:
                continue
            p = Vec3(*(weights @ corners[triangle]).tolist())
            assert abs(E.height_over(surface, f, p)) <= bodies.error
            assert E.facet_of(surface, result.n_facets, result.facet, p, bodies.error) == f
