"""Signs of polynomials in six posed corners, against fractions: in A's frame, in the world, where all else is noise."""

from __future__ import annotations

from collections import Counter
from itertools import permutations

import numpy as np
import pytest
from naive import rng_of
from naive_triangles import as_integers, cross, inner, minus, world_points
from posed_facets import FAMILIES, PosedFacets, exact_corners, posed_pair, told

from collide.narrowphase.facets.exact_corners import EXACT_AT, EXACT_ERROR, shares_a_corner, sign1, sign2, sign3

pytestmark = pytest.mark.plain_kernels

ORDERS = [list(order) for order in permutations(range(6), 4)]


def sign(x) -> int:
    return (x > 0) - (x < 0)


def in_chosen_frame(facets: PosedFacets, case):
    """The six corners in the frame of the exact points, which is A's wherever its doubles are not rounded."""
    if facets.corners[EXACT_ERROR] > 0.0:
        P, Q = exact_corners(*case)
    else:
        P, Q = as_integers(*(world_points(facets.corners[at : at + 9].reshape(3, 3), np.eye(4)) for at in (0, 9)))
    return P + Q




@pytest.mark.parametrize("family", FAMILIES)
def test_signs(family):
    rng = rng_of("signs of corners", family)
    seen: Counter = Counter()
    for _ in range(30):
        case = posed_pair(rng, family)
        facets = PosedFacets(*case)
        world = [*exact_corners(*case)[0], *exact_corners(*case)[1]]
        for k in rng.choice(len(ORDERS), 6, replace=False):
            i, j, m, n = ORDERS[k]
            want = inner(cross(minus(world[j], world[i]), minus(world[m], world[i])), minus(world[n], world[i]))
            assert sign3(facets.pair, i, j, m, n) == sign(want), f"{told(*case)}; sign3 of {i, j, m, n}"
            axis = int(rng.integers(3))
            found = sign2(facets.pair, axis, i, j, m)
            x = in_chosen_frame(facets, case)
            area = cross(minus(x[j], x[i]), minus(x[m], x[i]))[axis]
            assert found == sign(area), f"{told(*case)}; sign2 of {axis, i, j, m}"
            assert sign1(facets.pair, axis, i, j) == sign(x[j][axis] - x[i][axis]), f"{told(*case)}; {axis, i, j}"
            seen["volume", sign(want)] += 1
            seen["area", sign(area)] += 1
    if family == "random":
        assert seen["volume", 0] == 0
    else:
        least = 10 if family != "near touching" else 0
        assert seen["volume", 0] >= least and seen["area", 0] >= least // 2, seen


def test_shared_corners_are_seen_without_rounding_only():
    rng = rng_of("shared corners")
    seen: Counter = Counter()
    for k in range(150):
        case = posed_pair(rng, ("lattice", "touching", "near touching")[k % 3])
        facets = PosedFacets(*case)
        P, Q = exact_corners(*case)
        shared, found = any(p == q for p in P for q in Q), shares_a_corner(facets.pair)
        exact_frame = facets.corners[EXACT_ERROR] == 0.0
        assert found == (shared and exact_frame), told(*case)
        assert exact_frame == (k % 3 < 2), told(*case)
        seen[found] += 1
        rounded = facets.corners[EXACT_AT : EXACT_AT + 18].reshape(6, 3)
        if not exact_frame:
            truth = world_points(case[0], case[2]) + world_points(case[1], case[3])
            errors = [abs(x - float(y)) for row, point in zip(rounded, truth) for x, y in zip(row, point)]
            assert max(errors) <= facets.corners[EXACT_ERROR] < 1e-13, told(*case)
    assert seen[True] > 5 and seen[False] > 20, seen
