"""Winding numbers by rays: doubles and integers agree with a count of all facets in fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from solid_judge import arrangement_of, solids_of

from collide.solids import rays


def winding_in_fractions(corners: list, p: tuple, axis: int) -> int | None:
    """How often triangles (lists of three exact points) wind around a point; ``None`` if an edge is ahead of it."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    total = 0
    for a, b, c in corners:
        sides = [(q[u] - s[u]) * (p[v] - s[v]) - (q[v] - s[v]) * (p[u] - s[u]) for s, q in ((b, c), (c, a), (a, b))]
        if min(sides) < 0 < max(sides):
            continue
        whole = sum(sides)
        if whole == 0:
            spans = all(min(x[k] for x in (a, b, c)) <= p[k] <= max(x[k] for x in (a, b, c)) for k in (u, v))
            if spans and not any(sides) and max(x[axis] for x in (a, b, c)) > p[axis]:
                return None
            continue
        height = sum(side * (x[axis] - p[axis]) for side, x in zip(sides, (a, b, c))) / whole
        if height > 0:
            if 0 in sides:
                return None
            total += 1 if whole > 0 else -1
    return total


def test_rays_count_what_fractions_count():
    """Every sheet is tried as a start; a start is on its own facet exactly, which is not ahead."""
    known = told = 0
    for family in ("random shells", "boxes", "turned grid shells", "smooth"):
        for seed in range(3):
            A, B, X, Y = solids_of(family, seed)
            arrangement = arrangement_of(A, B, X, Y)
            facets, points, sheets = arrangement.facets, arrangement.points, arrangement.sheets
            rows = np.random.default_rng(seed).permutation(len(sheets.triangles))[:12]
            starts = rays._Starts(sheets, points, rows, seed)
            exact, is_along_edge = rays._windings(facets, starts, True)
            doubles, is_open = rays._windings(facets, starts, False)
            for body in range(2):
                rows_of_body = np.flatnonzero(facets.body == body).tolist()
                corners = [[tuple(map(Fraction, q)) for q in facets.exact_corners(f)] for f in rows_of_body]
                for k in range(len(rows)):
                    x, y, z, w = starts.exact(k)
                    p = (Fraction(x, w), Fraction(y, w), Fraction(z, w))
                    want = winding_in_fractions(corners, p, int(starts.axes[k]))
                    case = family, seed, body, int(rows[k])
                    if not is_along_edge[k]:
                        assert want == exact[k, body], case
                        told += 1
                    if not is_open[k]:
                        assert want == doubles[k, body], case
                        known += 1
                    n = facets.normal(int(starts.facet[k]))[starts.axes[k]]
                    assert n != 0 and (n > 0) == starts.upwards[k], case
    assert told > 200 and known > 100, (told, known)
