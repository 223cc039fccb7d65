"""EPA's growing polytope: after every expansion a closed, oriented, convex surface whose planes are proven."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from exact_simplex import determinant, exact
from growing_surface import CLOUDS, Surface, around_the_origin
from naive import rng_of

from collide.hull.exact_hull import convex_hull
from collide.narrowphase.epa import polytope_surface as E
from collide.narrowphase.epa.prove_facets import prove_facets
from collide.narrowphase.gjk.minkowski_difference import POINT

pytestmark = pytest.mark.plain_kernels


@pytest.mark.slow
@pytest.mark.parametrize("cloud", CLOUDS)
def test_surface_after_every_expansion(cloud):
    rng = rng_of("polytope surface", cloud)
    grown: Counter = Counter()
    for _ in range(8):
        surface = Surface(around_the_origin(rng))
        for corner in CLOUDS[cloud](rng):
            before = surface.count
            if surface.expand(corner):
                surface.check()
                grown[surface.count - before] += 1
            grown["inside"] += surface.count == before
        surface.check_planes()
        if cloud != "cube":  # in general position the surface is the hull, facet by facet
            hull = convex_hull(np.array(surface.corners))
            assert {frozenset(t) for t in hull.facets.tolist()} == {frozenset(t) for t in surface.triangles().values()}
        grown["given up"] += len(surface.slots()) < surface.count
    assert grown[2] > 30 and (cloud == "sphere" or min(grown["inside"], grown["given up"]) >= 5), grown


def test_tetrahedra_of_either_orientation():
    rng = rng_of("tetrahedra")
    for _ in range(20):
        corners = around_the_origin(rng)
        for order in ([0, 1, 2, 3], [0, 2, 1, 3]):
            surface = Surface(corners[order])
            surface.check()
            surface.check_planes()
            assert (surface.clearances[:4] > 0.0).all() and (surface.reaches[4:8] == math.inf).all()


def test_flipped_diagonals_leave_a_closed_surface():
    rng = rng_of("flips")
    flips = 0
    for _ in range(10):
        surface = Surface(around_the_origin(rng))
        for corner in CLOUDS["sphere"](rng):
            surface.expand(corner)
        for _ in range(10):
            f, e = int(rng.choice(surface.slots())), int(rng.integers(3))
            corners = {f: set(t) for f, t in surface.triangles().items()}
            h = int(surface.facets[E.FACET * f + e + E.TWIN]) // E.FACET
            across = tuple(corners[f] ^ corners[h])
            if any(set(across) <= triangle for triangle in corners.values()):
                continue  # the other diagonal is an edge already
            E.flip(surface.views, f, e, 0.0)
            surface.check()
            assert set(across) <= set(surface.triangles()[f]) and set(across) <= set(surface.triangles()[h])
            flips += 1
    assert flips > 50, flips


def test_slivers_are_proven_in_double_doubles():
    """Facets whose side plain doubles leave open: proven where the origin is behind them, and never where it is not."""
    rng = rng_of("slivers")
    seen: Counter = Counter()
    for _ in range(60):
        surface = Surface(around_the_origin(rng))
        a, b, c = rng.normal(size=(3, 3))
        c = a + rng.uniform(0.2, 0.8) * (b - a) + 1e-14 * rng.normal(size=3)
        for k, corner in enumerate((a, b, c)):
            surface.points[POINT * (4 + k) : POINT * (4 + k) + 3] = corner
            surface.corners.append(corner.tolist())
        E.set_facet(surface.views, 0, 4, 5, 6, 0.0, math.inf, math.inf)
        open_before = surface.clearances[0] < 0.0
        prove_facets(surface.views, surface.count)
        true = determinant(*exact([a, b, c]))
        assert (surface.clearances[0] >= 0.0) <= (true > 0)
        surface.check_planes()
        seen["open", bool(surface.clearances[0] >= 0.0)] += open_before
        seen["behind"] += true > 0
    assert seen["open", True] > 5 and seen["open", False] > 5, seen
