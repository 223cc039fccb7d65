"""The last digits of depths: brackets in double-doubles hold the exact depth, and are a few ulps wide."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from exact_simplex import inner
from growing_surface import triangles
from naive import LATTICE_ROTATIONS, Case, pose, random_pose, rng_of
from posed_bodies import PosedBodies

import collide
from collide.kernels import address_of
from collide.narrowphase.epa import refine_depth as R
from collide.narrowphase.epa.expand_polytope import EXPANDED, Goal, Seed, epa
from collide.narrowphase.epa.polytope_surface import surface_at
from collide.narrowphase.epa.refine_depth import refine
from collide.scenes.families.ingredients import rotation_about

pytestmark = pytest.mark.plain_kernels


def overlap(rng, kind: str) -> Case:
    n = int(rng.integers(4, 12))
    A, B = (collide.ConvexHull(naive.hull_points(rng, n)) for _ in range(2))
    case = Case(A, B, random_pose(rng, 0.2), random_pose(rng, 0.2))
    if kind == "boxes":  # faces of A ⊖ B of many corners, level but for rounding
        X = random_pose(rng)
        A, B = (collide.Box(tuple(rng.uniform(0.5, 1.5, 3))) for _ in range(2))
        case = Case(A, B, X, X @ pose(t=rng.uniform(-0.3, 0.3, 3)))
    elif kind == "lattice":
        A, B = (collide.Box(tuple(rng.integers(1, 5, 3) * 0.5)) for _ in range(2))
        turns = [LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
        case = Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-2, 3, 3) * 0.25))
    elif kind in ("1e-9", "1e-13", "1e-15"):
        case = naive.with_gap(case, -float(kind))
    return case


def refined(bodies: PosedBodies):
    """(EPA's result, what refining makes of it, the facets it leaves)."""
    surface = surface_at(bodies.work.epa_at, bodies.work.epa_integers_at)
    size, error = bodies.ordered.size, bodies.error
    seed = Seed(bodies.work.points, bodies.work.ids, False, False, False, 0)
    result = epa(bodies.pair, surface, seed, Goal(False, size, error, 0.25 * error))
    assert result.status == EXPANDED
    bodies.work.request[:2] = 0
    fine = refine(
        bodies.pair, address_of(bodies.poses.terms), bodies.work, surface, result.n_facets, result.n_vertices, size,
        bodies.ordered.slop, error,
    )
    facets = triangles(surface, fine.facet).values() if fine.sound else []
    return result, fine, [[tuple(surface.ids[2 * v : 2 * v + 2].tolist()) for v in facet] for facet in facets]


def test_vertices_behind_planes_in_doubles_are_behind_in_double_doubles(monkeypatch):
    """Boxes pressed onto tilted boxes: the same depth where doubles may decide nothing, of fewer planes where they
    may."""
    rng = rng_of("behind")
    make, load = R._fine, R._load_plane
    loaded: Counter = Counter()
    for _ in range(20):
        A, B = (collide.Box(tuple(rng.uniform(0.5, 1.5, 3))) for _ in range(2))
        turned = pose(rotation_about(2, rng.uniform(0.0, 6.0)), (0.1, 0.2, (A.size[2] + B.size[2]) / 2 - 1e-7))
        X = random_pose(rng)
        bodies, answers = PosedBodies(A, B, X, X @ turned), []
        for way, rounding in (("doubles", 1.0), ("none", math.inf)):
            monkeypatch.setattr(R, "_fine", lambda *given, r=rounding: make(*given[:-1], given[-1] * r))
            monkeypatch.setattr(R, "_load_plane", lambda *given, w=way: loaded.update([w]) or load(*given))
            answers.append(refined(bodies)[1:])
        assert repr(answers[0]) == repr(answers[1]), bodies.shapes
    assert loaded["doubles"] < 0.8 * loaded["none"], loaded


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["any", "boxes", "lattice", "1e-9", "1e-13", "1e-15"])
def test_brackets(kind):
    """Sound nearly always: the bracket then holds the depth, along the normal that has it, and is narrow as promised,
    or as 2⁻⁹⁰ of the size. A lower bound is there if the origin is proven to lie inside."""
    rng = rng_of("refine depth", kind)
    seen: Counter = Counter()
    for case in (overlap(rng, kind) for _ in range(25)):
        true = -naive.exact_distance(case)
        if true <= 0:
            continue
        bodies = PosedBodies(*case)
        with naive.reproducible(case):
            result, fine, facets = refined(bodies)
            seen["sound", bool(fine.sound)] += 1
            if not fine.sound:
                continue
            assert Fraction(fine.lower) <= true <= Fraction(fine.upper) if fine.lower > -np.inf else true <= fine.upper
            assert fine.lower <= fine.depth <= fine.upper
            width = fine.upper - max(fine.lower, fine.depth * 0.5)
            assert width <= 16 * np.spacing(fine.upper) + 2.0**-90 * bodies.ordered.size
            assert fine.upper <= result.depth + 2 * bodies.error
            sign = -1.0 if bodies.ordered.flip else 1.0
            assert abs(naive.clearance_along(case, sign * np.array(fine.nhat)) + float(true)) <= 8 * bodies.error
            seen["proven"] += fine.lower > 0.0
            seen["requested"] += bodies.work.request[1] > 0
            assert bodies.work.request[1] > 0 or fine.depth >= 4 * bodies.error
            check_request(bodies, true, facets)
    assert seen["sound", True] >= 15 and seen["sound", False] <= 2, seen
    assert seen["proven"] >= (15 if kind != "1e-15" else 3), seen
    assert (seen["requested"] > 0) == (kind in ("1e-13", "1e-15")), seen


def square_of_distance(corners) -> Fraction | None:
    """Squared distance of a plane from the origin, None where three points span none."""
    a, b, c = corners
    e, f = ([x - y for x, y in zip(p, a)] for p in (b, c))
    n = [e[k - 2] * f[k - 1] - e[k - 1] * f[k - 2] for k in range(3)]
    return inner(n, a) ** 2 / inner(n, n) if any(n) else None


def check_request(bodies: PosedBodies, true: Fraction, facets) -> None:
    """Where it is complete it names every facet of the surface whose plane is as near as the nearest one, exactly."""
    complete, n_facets = (int(k) for k in bodies.work.request[:2])
    if not n_facets:
        return
    difference = bodies.difference()
    pairs = bodies.work.request[2 : 2 + 6 * n_facets].reshape(-1, 3, 2).tolist()
    named = [[tuple(ij) for ij in facet] for facet in pairs]
    squares = [square_of_distance([difference[ij] for ij in facet]) for facet in named]
    assert complete
    assert abs(float(min(s for s in squares if s is not None) / true**2) - 1.0) <= 1e-12
    named_corners = [set(facet) for facet in named]
    for facet in facets:
        square = square_of_distance([difference[ij] for ij in facet])
        assert set(facet) in named_corners or square is None or square > true**2
