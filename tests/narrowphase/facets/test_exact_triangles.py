"""The exact stage of triangles, through the entry that traversals call: meeting, passing, overlapping, by fractions."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from naive import random_pose, rng_of
from naive_triangles import cross, inner, minus, triangles_meet
from posed_facets import FAMILIES, PosedFacets, exact_corners, posed_pair, told

from collide.narrowphase.facets.exact_triangles import BACK, BY, FROM, MEET, OVERLAP, PASS, THROUGH, UNCLEAR

pytestmark = pytest.mark.plain_kernels  # corners are placed by kernels


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_meeting(family):
    rng = rng_of("exact triangles meet", family)
    seen: Counter = Counter()
    for _ in range(150):
        P, Q, X_WA, X_WB = posed_pair(rng, family)
        want = triangles_meet(*exact_corners(P, Q, X_WA, X_WB))
        assert PosedFacets(P, Q, X_WA, X_WB).ask(MEET) == want, told(P, Q, X_WA, X_WB)
        assert PosedFacets(Q, P, X_WB, X_WA).ask(MEET) == want, told(Q, P, X_WB, X_WA)
        seen[want] += 1
    assert min(seen[True], seen[False]) > 10, seen


def passing(T, p, q) -> int:
    """How the segment p q passes the triangle T, all integers."""
    a, b, c = T
    n = cross(minus(b, a), minus(c, a))
    start, end = inner(n, minus(p, a)), inner(n, minus(q, a))
    if n == [0, 0, 0]:
        return BY
    if start == end == 0:
        return UNCLEAR
    if not triangles_meet(T, [p, q, q]):
        return BY
    if start == 0 or end == 0:
        return FROM if start == 0 else UNCLEAR
    share = Fraction(start, start - end)
    x = [u + share * (v - u) for u, v in zip(p, q)]
    weights = [inner(n, cross(minus(v, u), minus(x, u))) for u, v in ((a, b), (b, c), (c, a))]
    if min(weights) == 0:
        return UNCLEAR
    return THROUGH if start > 0 else BACK


def test_passing():
    rng = rng_of("segments pass")
    seen: Counter = Counter()
    for k in range(900):
        P, Q, X_WA, X_WB = posed_pair(rng, FAMILIES[k % len(FAMILIES)])
        T, S = exact_corners(P, Q, X_WA, X_WB)
        want = passing(T, S[0], S[1])
        assert PosedFacets(P, Q, X_WA, X_WB).ask(PASS) == want, told(P, Q, X_WA, X_WB)
        seen[want] += 1
    assert min(seen[how] for how in (BY, THROUGH, BACK, UNCLEAR, FROM)) >= 10, seen


def test_overlapping_on_an_edge():
    """Two triangles on one edge share more than it where they are coplanar and on one side of it."""
    rng = rng_of("triangles on an edge")
    seen: Counter = Counter()
    for k in range(300):
        P = rng.integers(-3, 4, (3, 3)).astype(float)
        Q = P.copy()
        s, t = rng.integers(-4, 5, 2) / 4
        Q[2] = P[0] + s * (P[1] - P[0]) + t * (P[2] - P[0])
        if k % 3 == 0:
            Q[2, k % 2] = np.nextafter(Q[2, k % 2], 9.0)
        X = random_pose(rng)
        (a, b, c), (_, _, d) = exact_corners(P, Q, X, X)
        inwards = [cross(minus(b, a), minus(x, a)) for x in (c, d)]
        want = inner(inwards[0], minus(d, a)) == 0 and inner(*inwards) > 0
        assert PosedFacets(P, Q, X, X).ask(OVERLAP) == want, told(P, Q, X, X)
        seen[want] += 1
    assert min(seen[True], seen[False]) > 50, seen
