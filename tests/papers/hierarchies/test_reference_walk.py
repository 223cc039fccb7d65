"""The walk in rational numbers against the exact oracle, every invariant of every round asserted on the way."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
import reference_walk as reference

from collide.adapters.peers import exact

EYE, NOWHERE = np.eye(3), np.zeros(3)
CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
OPTIONS = [{}, {"refine": False}, {"early": True}, {"refine": False, "early": True}]


def snippet(P, R) -> str:
    return f"import numpy as np, reference_walk as r\nr.walk(r.exact({P.tolist()}), r.exact({R.tolist()}))"


def pair(kind: str, rng) -> tuple[np.ndarray, np.ndarray]:
    n, m = rng.integers(4, 14, 2)
    if kind == "apart or not":
        return rng.standard_normal((n, 3)) + 1.5 * rng.standard_normal(3), rng.standard_normal((m, 3))
    if kind == "lattice":  # coplanar facets, repeated points, touching in corners, edges and facets
        P, R = rng.integers(-3, 4, (n, 3)).astype(float), rng.integers(-3, 4, (m, 3)).astype(float)
        return P + rng.integers(-5, 6, 3), R
    P, R = rng.integers(0, 3, (n, 3)).astype(float), rng.integers(0, 3, (m, 3)).astype(float)
    P[:, rng.integers(3)] += 2  # touching in a plane, or apart
    return P, R


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["apart or not", "lattice", "flush"])
def test_equal_to_the_oracle_with_all_invariants(kind):
    rng = np.random.default_rng([6, len(kind)])
    seen, hits, walks = Counter(), 0, 0
    for k in range(40):
        P, R = pair(kind, rng)
        found = reference.walk(reference.exact(P), reference.exact(R), **OPTIONS[k % 4])
        if found is None:
            continue
        truth = exact.hit(P, EYE, NOWHERE, R, EYE, NOWHERE)
        assert found.hit == truth, snippet(P, R)
        assert len(found.rounds) - 1 <= len(found.P) - 1 + len(found.Q) - 1
        assert found.missing == 0
        seen.update((r.space, r.case) for r in found.rounds)
        hits, walks = hits + truth, walks + 1
    assert walks > 22 and 0.15 < hits / walks < 0.85
    assert {(space, case) for space in ("primal", "polar") for case in ("1", "2.1", "2.2")} <= set(
        seen
    ) or kind == "flush", seen


@pytest.mark.slow
def test_larger_bodies_go_deep():
    rng = np.random.default_rng(3)
    for k in range(3):
        P, R = rng.standard_normal((40, 3)), rng.standard_normal((40, 3))
        P = P / np.linalg.norm(P, axis=1)[:, None] + 1.1 * rng.standard_normal(3)
        found = reference.walk(reference.exact(P), reference.exact(R), check=k < 1)
        assert found is not None and min(len(found.P), len(found.Q)) >= 5
        assert found.hit == exact.hit(P, EYE, NOWHERE, R, EYE, NOWHERE), snippet(P, R)


def test_exact_at_one_ulp():
    step = Fraction(1, 2**52)
    for gap, hit in ((Fraction(0), True), (step, False), (-step, True)):
        for shift in ((2 + gap, Fraction(1, 2), 0), (Fraction(1, 2), -2 - gap, 2), (2 + gap, 2, 2)):
            P = [tuple(c + s for c, s in zip(p, shift)) for p in reference.exact(CUBE)]
            found = reference.walk(P, reference.exact(CUBE))
            assert found is not None and found.hit == hit, (gap, shift)


# --- where the text is taken at its word ----------------------------------------------------------


def test_weak_separation_calls_touching_cubes_apart():
    """Section 5, "Analysis": the walk ends with P_1 separated "and we conclude that P and R do not intersect".

    Separated allows both to touch the plane (section 3), and of two invariants that hold the paper lets one choose
    freely. Two cubes with a common face then end as apart. Strict separation against weak inverse separation are
    exactly the two cases of the small game, and decide.
    """
    P, R = reference.exact(CUBE + np.array((2.0, 0.5, 0.25))), reference.exact(CUBE)
    weak, strict = reference.walk(P, R, weak=True), reference.walk(P, R)
    assert weak is not None and strict is not None
    assert not weak.hit and strict.hit


def test_the_polar_of_a_body_that_holds_the_origin_has_no_tangent_plane():
    """Section 5 takes planes tangent to ρ∞(P_i*) and their polar points; ρ∞ is empty where P_i* holds the origin.

    A point x of P_i takes their place: the origin itself is one, and no plane is its polar.
    """
    P = reference.exact(np.array([(3, 3, 3), (3, -3, -3), (-3, 3, -3), (-3, -3, 3)]))
    found = reference.walk(P, reference.exact(CUBE))
    assert found is not None and found.hit
    tetrahedron = found.P[-1].vertices()
    assert reference.in_hull(tetrahedron, (Fraction(0),) * 3), "ρ∞ of the tetrahedron is empty"
    value, _, _ = reference.game(tetrahedron, found.Q[-1].vertices())
    assert value <= 0
    assert len(found.Q) > 1 and {r.space for r in found.rounds} == {"base", "polar"}


def test_a_level_with_vertices_of_its_own_has_no_neighbours_to_scan():
    """Section 5 scans the neighbours in P_{i−1} of the vertex v of P_i where π is tangent.

    v is in P_{i−1} by property A3, which bounded hierarchies give up: a vertex made by a cut (section 4, Figure 4) lies
    inside an edge of the level below. The plane there is tangent along that edge, or the vertex that was cut off is
    beyond it: that one takes v's place. The walk stays right, whichever vertex the hierarchy was cut at.
    """
    rng = np.random.default_rng(9)
    met = 0
    for _ in range(32):
        P, R = pair("apart or not", rng)
        points, moved_R = reference.exact(P), reference.exact(R)
        if len(reference._spanning(moved_R, range(len(moved_R)))) < 4:
            continue
        centre = reference.inner_point(moved_R)
        points = [reference.minus(p, centre) for p in points]
        moved_R = [reference.minus(r, centre) for r in moved_R]
        base = reference.level_of(points, range(len(points)))
        if not base.ring:
            continue
        apex = max(base.ring, key=lambda v: len(base.ring[v]))
        cut = [reference.between(points[apex], points[u], Fraction(1, 3)) for u in base.ring[apex]]
        ids = [v for v in base.ring if v != apex] + list(range(len(points), len(points) + len(cut)))
        points += cut
        levels = [base, *reference.hierarchy(points, ids=ids)]
        found = reference.Walk(levels, reference.hierarchy(reference.polar(moved_R)), early=True)
        assert found.hit == exact.hit(P, EYE, NOWHERE, R, EYE, NOWHERE), snippet(P, R)
        met += found.missing
    assert met > 2
