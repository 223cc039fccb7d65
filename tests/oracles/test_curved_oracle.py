"""The oracle of all shapes, held against closed forms, against itself, and against mutations of itself."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import curved_cells
import curved_oracle
import numpy as np
import pytest
import soak_pairs
from curved_cells import CONTEXT, norm, shell_depth, vector
from curved_oracle import Body, away_from, bracket

import collide
from collide import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HPolytope,
    Mesh,
    Sphere,
    pose,
)

I = np.eye(4)
TETRAHEDRON = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def holds(found, truth: float, within: float = 1e-15) -> None:
    assert found.lower <= found.upper
    assert abs(float(found.lower) - truth) <= within and abs(float(found.upper) - truth) <= within, (found, truth)


@pytest.mark.parametrize(
    ("A", "B", "at", "truth"),
    [
        (Sphere(1), Sphere(2), (3.5, 0, 0), 0.5),
        (Sphere(1), Sphere(2), (0, 0, 2.5), -0.5),
        (Sphere(1), Sphere(2), (0, 0, 0), -3.0),
        (Sphere(0.5), Box((2, 2, 2)), (2, 2, 0), math.sqrt(2) - 0.5),
        (Sphere(0.5), Box((2, 2, 2)), (0.25, 0, 0), -1.25),
        (Capsule(0.25, 2), Capsule(0.5, 2), (1, 0, 0), 0.25),
        (Cylinder(1, 2), Cylinder(0.5, 1), (0, 0, 2), 0.5),
        (Cylinder(1, 2), Cylinder(0.5, 1), (2, 0, 0), 0.5),
        (Cylinder(1, 2), Cylinder(0.5, 1), (1.25, 0, 0), -0.25),
        (Cylinder(1, 2), Sphere(0.25), (4, 0, 5), 4.75),
        (Cone(1, 2), Sphere(0.5), (0, 0, 3), 1.5),
        (Cone(1, 2), Sphere(0.5), (0, 0, -3), 1.5),
        (Cone(3, 4), Sphere(1), (3, 0, 2), 1.4),
        (Ellipsoid((1, 2, 3)), Ellipsoid((3, 2, 1)), (5, 0, 0), 1.0),
        (Ellipsoid((1, 2, 3)), Sphere(1), (0, 5, 0), 2.0),
        (Ellipsoid((1, 2, 3)), Box((1, 1, 1)), (1.25, 0, 0), -0.25),
        (Box((1, 1, 1)), ConvexHull([[0, 0, 0]], radius=0.25), (0, 2, 0), 1.25),
        (
            ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
            (0.25, 0, 0), 0.0,
        ),
        (HPolytope(np.vstack([np.eye(3), -np.eye(3)]), np.ones(6)), Sphere(1), (0, 0, 3), 1.0),
        (Halfspace((0, 0, 2), 2), Cone(1, 2), (5, 5, 4), 2.0),
        (Halfspace((0, 0, 2), 2), Mesh(*TETRAHEDRON), (5, 5, 0.5), -0.5),
        (Halfspace((0, 0, 1), 0), Halfspace((0, 0, -1), -2), (0, 0, 0), 2.0),
        (Mesh(*TETRAHEDRON), Sphere(0.25), (-1, 0.25, 0.25), 0.75),
        (Mesh(*TETRAHEDRON), Mesh(*TETRAHEDRON), (0, 0, 3), 2.0),
        (Compound([(Box((1, 1, 1)), I), (Sphere(1), pose((4, 0, 0)))]), Cylinder(1, 1), (1.75, 0, 0), 0.25),
    ],
)
def test_closed_forms(A, B, at, truth):
    within = 1e-12 if truth < 0 and not isinstance(A, Sphere | Box) else 1e-15
    holds(bracket(A, B, I, pose(at)), truth, within)
    holds(bracket(B, A, pose(at), I), truth, within)


def test_what_is_inside_a_solid_hits_and_in_a_cavity_or_a_surface_does_not():
    ball, faces = soak_pairs.ball_facets(6, 8)
    hollow = np.vstack([2 * ball, ball]), np.vstack([faces, faces[:, ::-1] + len(ball)])
    small = Sphere(0.01)
    assert bracket(Mesh(2 * ball, faces), small, I, I).hit is True
    assert bracket(Mesh(2 * ball, faces, solid=False), small, I, I).hit is False
    assert bracket(Mesh(*hollow), small, I, I).hit is False
    assert bracket(Mesh(*hollow), small, I, pose((0, 0, 1.5))).hit is True
    assert away_from(Mesh(*hollow), I, (0, 0, 1.5)) == 0 and away_from(Mesh(*hollow), I, (0, 0, 0.5)) > 0.3


def test_swapped_and_moved_pairs_have_the_same_brackets():
    open_pairs = 0
    for number in range(60):
        case = soak_pairs.draw(11, number, 1e6)
        one, other = bracket(case.A, case.B, case.X_WA, case.X_WB), bracket(case.B, case.A, case.X_WB, case.X_WA)
        assert one.lower <= other.upper and other.lower <= one.upper, number
        # Both bodies mirrored by the same exact permutation of the axes are as far apart as before.
        turned = [np.vstack([X[[1, 2, 0]], X[3:]]) for X in (case.X_WA, case.X_WB)]
        again = bracket(case.A, case.B, *turned)
        assert one.lower <= again.upper and again.lower <= one.upper, number
        open_pairs += one.hit is None
    assert open_pairs <= 6


def test_brackets_are_narrow():
    """A wide bracket proves nothing: most convex pairs are known to 1e-15 of their size."""
    widths = []
    for number in range(150):
        case = soak_pairs.draw(
            12, number, 1e6, ("sphere", "box", "hull", "swept hull", "cylinder", "cone", "ellipsoid")
        )
        found = bracket(case.A, case.B, case.X_WA, case.X_WB)
        widths.append(float(found.upper - found.lower) / soak_pairs.size_of(case))
    assert np.median(widths) < 1e-19 and np.mean(np.array(widths) < 1e-15) > 0.85, np.sort(widths)[::-10]


def test_bounds_hold_against_sampled_points_and_directions():
    """Points of both bodies are nowhere nearer than the lower bound, and no plane parts them by more than the upper."""
    random = np.random.default_rng(3)
    for number in range(40):
        case = soak_pairs.draw(13, number, 100.0, ("box", "hull", "cylinder", "cone", "ellipsoid"))
        found = bracket(case.A, case.B, case.X_WA, case.X_WB)
        with localcontext(CONTEXT):
            a, b = (Body(s, X).cells[0] for s, X in ((case.A, case.X_WA), (case.B, case.X_WB)))
            for n in random.normal(size=(30, 3)):
                (_, p), (_, q) = a.support(vector(n)), b.support(vector(-n))
                assert norm(tuple(x - y for x, y in zip(p, q))) >= found.lower - Decimal("1e-60")
                assert curved_cells.separation(a, b, vector(n)) <= found.upper + Decimal("1e-60")


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["cylinder", "cone", "ellipsoid", "box", "hull"])
def test_supports_are_farthest_points_of_the_body(kind):
    """A support is a point of the body, by the definition of the shape, and no sampled point lies farther."""
    random = np.random.default_rng(5)
    shape = soak_pairs.shape(kind, 1.0, random)
    with localcontext(CONTEXT):
        cell = Body(shape, I).cells[0]
        sampled = random.uniform(-1, 1, size=(4000, 3))
        sampled = sampled[[inside(shape, p) for p in sampled]]
        for n in random.normal(size=(50, 3)):
            value, p = cell.support(vector(n))
            assert inside(shape, np.array([float(x) for x in p]) * (1 - 1e-12))
            assert not len(sampled) or float(value) >= (sampled @ n).max() - 1e-12


def inside(shape, p) -> bool:
    x, y, z = p
    if isinstance(shape, Cylinder):
        return abs(z) <= shape.length / 2 and math.hypot(x, y) <= shape.radius
    if isinstance(shape, Cone):
        return abs(z) <= shape.length / 2 and math.hypot(x, y) <= shape.radius * (0.5 - z / shape.length) + 1e-12
    if isinstance(shape, Ellipsoid):
        return sum((c / r) ** 2 for c, r in zip(p, shape.radii)) <= 1
    if isinstance(shape, Box):
        return bool((np.abs(p) <= shape.size / 2).all())
    return bool(away_from(shape, I, p) <= 1e-9)


def test_the_engine_does_not_take_part(monkeypatch):
    for name in ("collide", "distance", "contacts"):
        monkeypatch.setattr(collide, name, None, raising=False)
    holds(bracket(Cone(1, 2), Sphere(0.5), I, pose((0, 0, 3))), 1.5)


# --- what is not a proof is refused; what is wrong is noticed --------------------------------------

_OCTAHEDRON = [vector(p) for p in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
_FACETS = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]


def test_a_surface_proves_a_depth_only_where_it_closes_around_0():
    size = Decimal(1)
    with localcontext(CONTEXT):
        assert abs(shell_depth(_OCTAHEDRON, _FACETS, size) - 1 / Decimal(3).sqrt()) < Decimal("1e-60")
        assert shell_depth(_OCTAHEDRON, _FACETS[:-1], size) is None, "a hole"
        assert shell_depth(_OCTAHEDRON, [], size) is None
        assert shell_depth(_OCTAHEDRON, [*_FACETS[:-1], _FACETS[-1][::-1]], size) is None, "a facet turned over"
        moved = [(x + 2, y, z) for x, y, z in _OCTAHEDRON]
        assert shell_depth(moved, _FACETS, size) is None, "0 outside"


@pytest.mark.parametrize("kind", ["_cylinder", "_cone", "_ellipsoid"])
@pytest.mark.parametrize("factor", ["1.001", "0.999"])
def test_a_wrong_support_function_is_noticed(kind, factor, monkeypatch):
    """Closed forms above tell a support that is off by a thousandth."""
    right = getattr(curved_cells, kind)
    wrong = {kind[1:]: lambda sizes, d: tuple(Decimal(factor) * x for x in right(sizes, d))}
    monkeypatch.setattr(curved_cells, "_SUPPORTS", {**curved_cells._SUPPORTS, **wrong})
    shape = {"_cylinder": Cylinder(1, 2), "_cone": Cone(1, 2), "_ellipsoid": Ellipsoid((1, 2, 1))}[kind]
    with pytest.raises(AssertionError):
        holds(bracket(shape, Sphere(0.5), I, pose((0, 0, 3))), 1.5)


def test_a_search_that_finds_nothing_makes_brackets_wide_and_not_wrong(monkeypatch):
    import curved_search

    monkeypatch.setattr(curved_search, "GJK_ROUNDS", 2)
    monkeypatch.setattr(curved_search, "EPA_ROUNDS", 2)
    wide = 0
    for A, B, at, truth in (
        (Cylinder(1, 2), Cylinder(0.5, 1), (1.25, 0, 0), -0.25), (Cone(3, 4), Sphere(1), (3, 0, 2), 1.4),
        (Ellipsoid((1, 2, 3)), Sphere(1), (0, 4, 3), None),
    ):
        found = bracket(A, B, I, pose(at))
        assert truth is None or found.lower - Decimal("1e-15") <= Decimal(truth) <= found.upper + Decimal("1e-15")
        wide += found.upper - found.lower > Decimal("1e-6")
    assert wide >= 2


def test_winding_asks_another_ray_where_one_grazes():
    with localcontext(CONTEXT):
        facets = Body(Mesh(*soak_pairs.ball_facets(4, 6)), I).solids[0]
        inner, outer = vector((0.01, 0.02, 0.03)), vector((5, 0, 0))
        assert curved_oracle.winding(facets, inner) == 1 and curved_oracle.winding(facets, outer) == 0
        through_an_edge = tuple(x - y for x, y in zip(facets[0][0], inner))
        rays = curved_oracle._RAYS
        try:
            curved_oracle._RAYS = [through_an_edge, *rays]
            assert curved_oracle.winding(facets, inner) == 1
            curved_oracle._RAYS = [through_an_edge]
            with pytest.raises(ArithmeticError):
                curved_oracle.winding(facets, inner)
        finally:
            curved_oracle._RAYS = rays
