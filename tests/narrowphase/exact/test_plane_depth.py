"""Depths below rounding and of small hulls, from planes in integers, against the exact depth."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import combinations, islice, product

import naive
import numpy as np
import pytest
from exact_bodies import ExactBodies, drawn
from exact_simplex import determinant, inner, nearest_to_origin
from naive import Case, reproducible, rng_of
from naive_triangles import world_points

import collide
from collide.hull.exact_hull import convex_hull
from collide.kernels import address_of
from collide.narrowphase.bounds import EXACT_ERROR
from collide.narrowphase.exact import all_planes as A
from collide.narrowphase.exact.depth_requests import ENTRY, MAX_TIED_FACETS
from collide.narrowphase.exact.plane_depth import nearest_plane

pytestmark = pytest.mark.plain_kernels


def overlap(rng, kind: str) -> Case:
    """Bodies that share a point: deeply, by less than rounding, or with the origin on their difference's surface."""
    case = drawn(rng, "lattice" if kind == "touching" else "any")
    if kind == "rounding":
        A, B = (collide.ConvexHull(naive.hull_points(rng, int(rng.integers(4, 7)))) for _ in range(2))
        case = naive.with_gap(case._replace(A=A, B=B), -1e-16)
    elif kind == "any":
        case = case.with_b_moved(case.X_WA[:3, 3] - case.X_WB[:3, 3])
    return case


def overlaps(rng, kind: str, n: int):
    """(case, its depth) of n cases."""
    pairs = ((case, -naive.exact_distance(case)) for case in (overlap(rng, kind) for _ in range(1000)))
    return islice((pair for pair in pairs if pair[1] >= 0), n)


def value(x) -> Fraction:
    return Fraction(float(x.high)) + Fraction(float(x.low))


def surface_requests(bodies: ExactBodies) -> list[int]:
    """The facets of the hull of A ⊖ B that are nearest the origin, nearest first, as an entry of requests."""
    names, points = list(bodies.difference()), list(bodies.difference().values())
    hull = convex_hull(np.array([[float(x) for x in p] for p in points]))
    facets = []
    for facet in hull.facets.tolist() if hull.dimension == 3 else []:
        a, b, c = (points[k] for k in facet)
        e, f = ([x - y for x, y in zip(p, a)] for p in (b, c))
        n = [e[k - 2] * f[k - 1] - e[k - 1] * f[k - 2] for k in range(3)]
        height = determinant(a, b, c)
        facets.append((float(height * abs(height) / inner(n, n)) if any(n) else np.inf, facet))
    facets.sort()
    facets, rest = facets[:MAX_TIED_FACETS], facets[MAX_TIED_FACETS:]
    complete = int(bool(facets) and (not rest or rest[0][0] > facets[-1][0]))
    return [complete, len(facets), *(k for _, facet in facets for corner in facet for k in names[corner])]


@pytest.mark.many(4)
@pytest.mark.parametrize("kind", ["rounding", "touching", "any"])
def test_nearest_planes(kind):
    rng = rng_of("nearest plane", kind)
    seen: Counter = Counter()
    for case, true in overlaps(rng, kind, 30):
        bodies = ExactBodies(*case)
        request = surface_requests(bodies)
        with reproducible(case):
            assert len(request) <= ENTRY
            # Entry 0 stands for none at all.
            depth = nearest_plane(bodies.ordered, bodies.poses.terms.ravel(), bodies.digits, [0, *request], 1)
            flat = bodies.pair.A.n * bodies.pair.B.n <= 3
            if depth.proven:
                assert abs(value(depth.depth) - true) <= Fraction(EXACT_ERROR) * true
            else:
                # A surface with no more facets than an entry holds, facing outwards in doubles as it does exactly.
                assert request[0] == 0 or true == 0 or kind == "rounding"
            none = nearest_plane(bodies.ordered, bodies.poses.terms.ravel(), bodies.digits, [0, *request], 0)
            assert none.proven == flat
        seen["zero" if true == 0 else "deep", bool(depth.proven)] += 1
    wanted = {"rounding": ("deep", True), "touching": ("zero", True), "any": ("deep", True)}[kind]
    assert seen[wanted] >= 8, seen


def test_requests_are_not_trusted():
    """Three points whose plane cuts A ⊖ B, or that are named clockwise, prove nothing, whatever the entry says."""
    rng = rng_of("requests that lie")
    seen: Counter = Counter()
    for case, true in overlaps(rng, "any", 30):
        bodies = ExactBodies(*case)
        names, points = list(bodies.difference()), list(bodies.difference().values())
        if len(names) <= 3:
            continue
        corners = [int(k) for k in rng.choice(len(names), 3, replace=False)]
        if rng.random() < 0.5:  # the nearest facet: its plane is outermost
            nearest = surface_requests(bodies)[2:8]
            corners = [names.index((nearest[k], nearest[k + 1])) for k in (0, 2, 4)] if nearest else corners
        for order in (corners, corners[::-1]):
            a, b, c = (points[k] for k in order)
            e, f = ([x - y for x, y in zip(p, a)] for p in (b, c))
            n = [e[k - 2] * f[k - 1] - e[k - 1] * f[k - 2] for k in range(3)]
            outermost = inner(n, a) > 0 and all(inner(n, p) <= inner(n, a) for p in points)
            request = [0, 1, 1, *(k for at in order for k in names[at])]
            with reproducible(case):
                depth = nearest_plane(bodies.ordered, bodies.poses.terms.ravel(), bodies.digits, request, 1)
                assert depth.proven == outermost or (any(n) and inner(n, a) == true == 0)
            seen[bool(depth.proven)] += 1
    assert min(seen[True], seen[False]) >= 5, seen


def planes_that_may_decide(bodies: ExactBodies, depth: float) -> tuple[int, int]:
    """How many pairs of edges span a plane, and how many have no plane or one as near the origin as the depth."""
    difference = np.array([[float(x) for x in p] for p in bodies.difference().values()])
    cores = [np.array([[float(x) for x in p] for p in world_points(naive.corners(shape)[0], X)])
             for shape, X in zip(bodies.shapes, bodies.X)]
    edges = [[q - p for p, q in combinations(core, 2)] for core in cores]
    corners = [(q - p, r - p) for core in cores for p, q, r in combinations(core, 3)]
    n_planes = n_tied = 0
    for e, f in [*product(*edges), *corners]:
        n = np.cross(e, f)
        heights = difference @ n
        n_planes += n.any()
        n_tied += min(heights.max(), -heights.min()) <= depth * np.linalg.norm(n)
    return n_planes, n_tied


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["rounding", "touching", "any"])
def test_all_planes(kind):
    """The least extent over all of them is the depth; three vertex pairs are named around its point of A ⊖ B."""
    rng = rng_of("all planes", kind)
    seen: Counter = Counter()
    for case, true in overlaps(rng, kind, 14):
        bodies = ExactBodies(*case)
        doubles, ids = np.zeros(A.DOUBLES), [0] * 6
        terms = bodies.poses.terms.ravel()
        with reproducible(case):
            found = A.depth_by_all_planes(
                bodies.ordered, terms, address_of(terms), bodies.digits, address_of(doubles), ids
            )
            seen[bool(found.proven), true > 0] += 1
            if not found.proven:  # no plane at all, or too many to try
                n_planes, n_tied = planes_that_may_decide(bodies, float(true))
                assert n_planes == 0 or n_tied > 256
                continue
            assert abs(value(found.depth) - true) <= Fraction(EXACT_ERROR) * true
            n = np.array(found.nhat)
            assert abs(np.linalg.norm(n) - 1.0) <= 1e-15
            sign = -1.0 if bodies.ordered.flip else 1.0
            assert abs(naive.clearance_along(case, sign * n) + float(true)) <= bodies.error
            triangle = [bodies.difference()[ids[k], ids[k + 1]] for k in (0, 2, 4)]
            foot = [Fraction(x) * true for x in n.tolist()]
            from_foot = nearest_to_origin([[x - y for x, y in zip(p, foot)] for p in triangle])
            assert float(from_foot.square) ** 0.5 <= 8 * bodies.error
    assert seen[True, kind != "touching"] >= 5, seen


def test_number_of_planes():
    for n_a in range(1, 7):
        for n_b in range(1, 7):
            n = np.arange
            edges = [(p, q) for p in n(n_a) for q in n(p)], [(p, q) for p in n(n_b) for q in n(p)]
            triples = sum(1 for k in (n_a, n_b) for p in n(k) for q in n(p) for _ in n(q))
            assert A.planes_of(n_a, n_b) == len(edges[0]) * len(edges[1]) + triples


def test_large_hulls_are_left_open():
    rng = rng_of("too many planes")
    shapes = [collide.ConvexHull(naive.hull_points(rng, 40)) for _ in range(2)]
    bodies = ExactBodies(*shapes, np.eye(4), np.eye(4))
    assert not A.depth_by_all_planes(bodies.ordered, [], 0, bodies.digits, 0, [0] * 6).proven
