"""The polar transformation: Lemmas 3.1 to 3.6 and Theorem 3.7 of Barba and Langerman as properties, exactly.

The oracles use other means than the module: facets of a body by trying triples of its points, intersections by
listing the vertices of all half-spaces together. Where the paper's text does not hold, its example stands here.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from polarity import (
    Halfspace,
    Plane,
    Polyhedron,
    common_point,
    contains,
    cross,
    from_halfspaces,
    inner,
    minus,
    polar_infinity,
    polar_zero,
    polyhedron,
    separates,
    separating_plane,
    vector,
    within_infinity,
    within_zero,
)

ORIGIN = vector((0, 0, 0))
SETTINGS = settings(max_examples=30, deadline=None, derandomize=True, print_blob=True)
#: Small integers: touching, vertices in line with the origin, facets through it all happen often.
numbers = st.integers(-3, 3)
points = st.tuples(numbers, numbers, numbers).map(vector)
fractions = st.builds(Fraction, st.integers(-6, 6), st.integers(1, 4))
anywhere = st.tuples(fractions, fractions, fractions).map(vector)


def facets(body: Polyhedron) -> list[Halfspace]:
    """Half-spaces of a solid body, by trying all triples of its points."""
    found = {}
    for a, b, c in combinations(body.vertices, 3):
        normal = cross(minus(b, a), minus(c, a))
        heights = [inner(normal, minus(v, a)) for v in body.vertices]
        if any(normal) and (max(heights) <= 0 or min(heights) >= 0):
            sign = 1 if max(heights) <= 0 else -1
            outward = tuple(sign * x for x in normal)
            found[outward] = Halfspace(outward, inner(outward, a))
    return list(found.values())


def is_solid(body: Polyhedron) -> bool:
    a = body.vertices[0]
    return any(
        inner(cross(minus(b, a), minus(c, a)), minus(d, a)) != 0 for b, c, d in combinations(body.vertices[1:], 3)
    )


solids = (
    st.lists(points, min_size=4, max_size=6, unique=True).map(lambda rows: Polyhedron(tuple(rows))).filter(is_solid)
)


def around(body: Polyhedron) -> Polyhedron:
    """The body moved so that the origin is strictly inside."""
    middle = tuple(sum(x) / len(body.vertices) for x in zip(*body.vertices))
    return Polyhedron(tuple(minus(v, middle) for v in body.vertices))


def meet(body: Polyhedron, halfspaces: list[Halfspace]) -> Polyhedron:
    """The part of a solid body inside half-spaces, by its vertices."""
    return from_halfspaces([*facets(body), *halfspaces])


def polar_vertices(halfspaces: list[Halfspace]) -> Polyhedron:
    return from_halfspaces(halfspaces)


# --- Lemmas 3.1 to 3.6 --------------------------------------------------------------------------


@SETTINGS
@given(anywhere, anywhere)
def test_lemma_3_1(x, z):
    """With h the plane whose polar is z: x is on a side of h exactly if z is on that side of ρ(x)."""
    point = Polyhedron((x,))
    plane = Polyhedron((z,))
    assert within_zero(point, z) == within_zero(plane, x)
    assert within_infinity(point, z) == within_infinity(plane, x)


@SETTINGS
@given(solids)
def test_lemma_3_2(body):
    """ρ0 twice is the body again, where the origin is strictly inside."""
    body = around(body)
    polar = polar_vertices(polar_zero(body))
    assert polar.vertices and not polar.rays
    again = polar_vertices(polar_zero(polar))
    extreme = from_halfspaces(facets(body))
    assert set(again.vertices) == set(extreme.vertices) and not again.rays


@SETTINGS
@given(solids, anywhere)
def test_lemma_3_3(body, x):
    """x ∈ ρ0(P) if and only if P ⊆ ρ0(x), and the same for ∞."""
    assert contains(polar_zero(body), x) == (not meet(body, [open_side(x, 1)]).vertices)
    assert contains(polar_infinity(body), x) == (not meet(body, [open_side(x, -1)]).vertices)


def open_side(x, sign) -> Halfspace:
    """The far side of ρ(x), or the near one, without its border: by the smallest step that small fractions can make."""
    least = Fraction(1, 10**4)
    return Halfspace(tuple(-sign * c for c in x), -sign - least)


@SETTINGS
@given(solids, st.lists(st.integers(0, 5), min_size=6, max_size=6))
def test_lemma_3_4(body, weights):
    """A point of P: ρ0(P) is in ρ0(x), ρ∞(P) in ρ∞(x)."""
    weights = weights[: len(body.vertices)]
    if not sum(weights):
        weights = [1] * len(body.vertices)
    x = tuple(sum(w * c for w, c in zip(weights, axis)) / Fraction(sum(weights)) for axis in zip(*body.vertices))
    near, far = polar_vertices(polar_zero(body)), polar_vertices(polar_infinity(body))
    assert within_zero(near, x)
    assert within_infinity(far, x) or not far.vertices


@SETTINGS
@given(solids, points)
def test_lemma_3_5(body, direction):
    """The polar of a plane tangent to ρ0(P) or ρ∞(P) is a point on the border of P."""
    sides = facets(body)
    hits = 0
    for polar, far in ((polar_vertices(polar_zero(body)), False), (polar_vertices(polar_infinity(body)), True)):
        if not polar.vertices:
            continue
        values = [inner(direction, v) for v in polar.vertices]
        runs = [inner(direction, d) for d in polar.rays]
        bounded = min(runs, default=0) >= 0 if far else max(runs, default=0) <= 0
        level = min(values) if far else max(values)
        if bounded and level > 0:
            x = tuple(c / level for c in direction)
            assert contains(sides, x) and any(inner(h.normal, x) == h.offset for h in sides)
            hits += 1
    HITS["tangent"] = HITS.get("tangent", 0) + hits


@SETTINGS
@given(solids, st.data())
def test_lemma_3_6(body, data):
    """P ⊆ Q gives ρ0(Q) ⊆ ρ0(P) and ρ∞(Q) ⊆ ρ∞(P)."""
    kept = data.draw(st.lists(st.sampled_from(body.vertices), min_size=1, unique=True))
    part = Polyhedron(tuple(kept))
    near, far = polar_vertices(polar_zero(body)), polar_vertices(polar_infinity(body))
    assert all(contains(polar_zero(part), y) for y in near.vertices)
    assert all(contains(polar_infinity(part), y) for y in far.vertices)


# --- Theorem 3.7 --------------------------------------------------------------------------------

HITS: dict[str, int] = {}


def check_theorem(body: Polyhedron, other: Polyhedron) -> bool:
    """Both sides of the theorem for P = body and Q = other; returns whether P and ρ0(Q) meet."""
    common = meet(body, polar_zero(other)).vertices
    far = polar_vertices(polar_infinity(body))
    inside = contains(facets(body), ORIGIN)
    assert inside == (not far.vertices), "the origin is in P if and only if ρ∞(P) is empty"
    # The planes ⟨x, y⟩ = 1 with ρ∞(P) beyond and Q on this side, by the constraints on x.
    candidates = [*polar_zero(other), *polar_infinity(far)] if far.vertices else polar_zero(other)
    planes = [x for x in from_halfspaces([*candidates, *box()]).vertices if any(x)]
    if far.vertices:
        assert bool(common) == bool(planes), (body, other)
    for x in common:
        if any(x):
            plane = separating_plane(x)
            assert within_zero(other, plane.normal), "(1): Q on the origin's side"
            assert within_infinity(far, plane.normal) or not far.vertices, "(1): ρ∞(P) beyond"
    if far.vertices:
        for z in planes:
            x = common_point(Plane(z), far)
            assert contains(facets(body), x) and contains(polar_zero(other), x), "(2)"
    return bool(common)


def box() -> list[Halfspace]:
    """So that the planes have extreme ones."""
    return [
        Halfspace(tuple(Fraction(sign * (k == axis)) for k in range(3)), Fraction(1000))
        for axis in range(3) for sign in (1, -1)
    ]


@SETTINGS
@given(solids, solids)
def test_theorem_3_7_origin_outside_both_or_not(body, other):
    HITS["anywhere"] = HITS.get("anywhere", 0) + 1
    HITS["anywhere, meet"] = HITS.get("anywhere, meet", 0) + check_theorem(body, other)


@pytest.mark.slow
@SETTINGS
@given(solids, points, solids)
def test_theorem_3_7_origin_inside_q(body, shift, other):
    """As the walk has it: the origin strictly inside Q, outside P."""
    body = Polyhedron(tuple(minus(v, tuple(2 * c for c in shift)) for v in body.vertices))
    HITS["outside P"] = HITS.get("outside P", 0) + (not contains(facets(body), ORIGIN))
    HITS["inside Q, meet"] = HITS.get("inside Q, meet", 0) + check_theorem(body, around(other))


def test_theorem_3_7_touching():
    """P touches ρ0(Q): both a common point and a plane that separates them weakly."""
    octahedron = polyhedron([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
    for touching in ([(1, 0, 0), (2, 1, 0), (2, 0, 1), (2, -1, -1)], [(1, 1, 1), (2, 3, 2), (3, 2, 2), (2, 2, 3)]):
        body = polyhedron(touching)
        assert meet(body, polar_zero(octahedron)).vertices == (body.vertices[0],)
        assert check_theorem(body, octahedron)
        plane = Plane(vector((1, 0, 0)))
        cube = polar_vertices(polar_zero(octahedron))
        assert separates(plane, cube, body)


@pytest.mark.slow
@SETTINGS
@given(solids, points, solids)
def test_theorem_3_7_with_the_spaces_exchanged(body, shift, other):
    """The symmetric half: Q meets ρ∞(P) if and only if a plane separates ρ0(Q) from P, with (1) and (2)."""
    far = Polyhedron(tuple(minus(v, tuple(2 * c for c in shift)) for v in body.vertices))
    near = other if sum(map(sum, other.vertices)) % 3 else around(other)
    polar = polar_vertices(polar_zero(near))
    common = meet(near, polar_infinity(far)).vertices
    planes = from_halfspaces([*polar_zero(polar), *polar_infinity(far)]).vertices
    assert bool(common) == bool(planes), (far, near)
    for x in common:
        assert separates(separating_plane(x), polar, far), "(1)"
    for z in planes:
        level = max(inner(z, y) for y in polar.vertices)
        assert level > 0, "ρ0(Q) has the origin inside the plane"
        x = tuple(c / level for c in z)  # of the parallel plane that is tangent to ρ0(Q)
        assert contains(facets(near), x) and contains(polar_infinity(far), x), "(2)"
    HITS["exchanged"] = HITS.get("exchanged", 0) + 1
    HITS["exchanged, meet"] = HITS.get("exchanged, meet", 0) + bool(common)


def test_cases_were_not_one_sided():
    """Runs after the properties: they must have seen both answers, and the origin inside and outside."""
    if "anywhere" not in HITS or "inside Q, meet" not in HITS or "exchanged" not in HITS:
        pytest.skip("needs the other tests of this file")
    assert 0.1 < HITS["anywhere, meet"] / HITS["anywhere"] < 0.9, HITS
    assert HITS["outside P"] >= 10 and HITS["inside Q, meet"] >= 3, HITS
    assert HITS["tangent"] >= 10, HITS
    assert 0.1 < HITS["exchanged, meet"] / HITS["exchanged"] < 0.9, HITS


# --- where the text does not hold ---------------------------------------------------------------


def test_polar_is_not_bounded_where_the_origin_is_on_the_border():
    """Section 3: "P contains the origin if and only if ρ∞(P) = ∅ and ρ0(P) is bounded". A corner at the origin."""
    corner = polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    assert not polar_vertices(polar_infinity(corner)).vertices
    assert polar_vertices(polar_zero(corner)).rays


def test_lemma_3_2_needs_rays_where_the_origin_is_on_the_border():
    """Section 3 defines ρ0 by the vertices alone. The polar of this corner has one vertex, and three rays."""
    corner = polyhedron([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    polar = polar_vertices(polar_zero(corner))
    assert len(polar.vertices) == 1 and len(polar.rays) == 3
    outside = vector((-5, 0, 0))
    assert within_zero(Polyhedron(polar.vertices), outside) and not contains(facets(corner), outside)
    assert set(polar_vertices(polar_zero(polar)).vertices) == set(corner.vertices)


def test_polar_of_a_segment_has_no_vertex():
    """The proof of Lemma 3.5 takes a plane tangent at a vertex; the polar of a segment has none."""
    with pytest.raises(ValueError, match="line"):
        polar_vertices(polar_zero(polyhedron([(1, 0, 0), (0, 1, 0)])))


def test_the_origin_as_witness_has_no_plane():
    """Theorem 3.7 (1) takes ρ(x) for every common point x. For x = 0 that is no plane."""
    with pytest.raises(ValueError, match="origin"):
        separating_plane(ORIGIN)
    with pytest.raises(ValueError, match="empty"):
        common_point(Plane(vector((1, 0, 0))), Polyhedron(()))
    with pytest.raises(ValueError, match="far side"):
        common_point(Plane(vector((1, 0, 0))), polyhedron([(0, 0, 0)]))
