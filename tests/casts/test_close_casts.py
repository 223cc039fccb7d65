"""The sign of the pace towards a half-space, against fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from naive import rng_of

import collide
from collide.casts import cast_pairs as P
from collide.casts.close_casts import PACE_TERMS, settle_levels
from collide.casts.portal import LEVEL, MISS
from collide.casts.posed_parts import posed_sides
from collide.kernels import address_of


def exact_pace(X: np.ndarray, m: np.ndarray, d: np.ndarray) -> Fraction:
    """How fast a body moved along d comes nearer to {x : m·x ≤ offset} at X, in lengths of the normal cof(R) m."""
    R = [[Fraction(v) for v in row[:3]] for row in X[:3].tolist()]
    total = Fraction(0)
    for i in range(3):
        for j in range(3):
            (a, b), (c, e) = ([row[n] for n in range(3) if n != j] for k, row in enumerate(R) if k != i)
            total += Fraction(d[i]) * Fraction(m[j]) * (a * e - b * c) * (-1) ** (i + j)
    return -total


def test_motions_along_a_plane_are_told_from_motions_towards_it():
    rng, counts = rng_of(71), {MISS: 0, LEVEL: 0, "0": 0}
    for number in range(600):
        m, X = rng.normal(size=3), np.eye(4)
        if number % 3 == 0:
            m = rng.integers(-4, 5, 3).astype(float)
        if number % 2:
            X = collide.pose(quat_wxyz=rng.normal(size=4))
        if np.abs(m).max() < 0.1:
            continue
        d = np.cross(X[:3, :3] @ m, rng.integers(-3, 4, 3).astype(float))
        if number % 5 == 0:
            d[int(rng.integers(3))] *= 10.0 ** -float(rng.integers(5, 260))
        if not d.any():
            continue
        d /= 2.0 ** np.frexp(np.abs(d).max())[1]
        sides = posed_sides(collide.Sphere(1.0), collide.Halfspace(m, 0.0), np.eye(4)[None], X[None], 1)
        parts, pairs = sides.parts, sides.all_pairs(np.arange(1)).pairs
        question, row, listed = np.append(d, np.inf), np.zeros(P.CAST_ROW), np.zeros(1, dtype=np.int64)
        row[P.STATUS], terms = LEVEL, np.zeros(PACE_TERMS)
        count = settle_levels(
            parts.table.addresses[1], address_of(parts.poses.rows), address_of(parts.shape_of), address_of(pairs),
            address_of(question), 1, address_of(row), address_of(terms), address_of(listed),
        )
        pace, nothing_is_tiny = exact_pace(X, m, d), np.abs(d[d != 0.0]).min() > 2.0**-200
        assert (count == 0) == (row[P.STATUS] == MISS), number
        if row[P.STATUS] == MISS:
            assert pace <= 0, (number, m, X, d)
        else:
            assert pace > 0 or not nothing_is_tiny, (number, m, X, d)
        counts[int(row[P.STATUS])] += 1
        counts["0"] += pace == 0
    assert counts[MISS] >= 200 and counts[LEVEL] >= 60 and counts["0"] >= 60, counts
