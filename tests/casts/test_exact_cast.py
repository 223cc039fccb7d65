"""The exact program of casts against facets by definition, and by hand where the difference is flat."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from cast_oracles import exact_first_contact
from naive import random_pose, rng_of
from reproduction import reproducing

from collide.casts import exact_cast
from collide.casts.exact_cast import cast_exactly
from collide.numerics.exact_points import PlacedPoints


def test_solids_are_those_of_their_facets():
    rng = rng_of("exact casts")
    outcomes = []
    while len(outcomes) < 60:
        A, B = (rng.integers(-3, 4, size=(4, 3)).tolist() for _ in range(2))
        A = [[x + s for x, s in zip(a, shift)] for shift in [rng.integers(-5, 6, size=3).tolist()] for a in A]
        d = rng.integers(-2, 3, size=3).tolist()
        if not any(d):
            continue
        try:
            truth = exact_first_contact(A, B, tuple(d))
        except ValueError:
            continue
        source = "from collide.casts.exact_cast import cast_exactly; print(cast_exactly({A}, {B}, {d}))"
        with reproducing(source, A=A, B=B, d=d):
            contact = cast_exactly(A, B, d)
            assert contact.t == truth
            if truth is not None:
                assert sum(contact.weights.values()) == 1 and all(w > 0 for w in contact.weights.values())
                for axis in range(3):  # the two points that touch are one
                    gap = sum(w * (A[i][axis] - B[j][axis]) for (i, j), w in contact.weights.items())
                    assert gap + truth * d[axis] == 0
            if truth:
                n = contact.normal
                assert sum(x * y for x, y in zip(n, d)) > 0
        outcomes.append("miss" if truth is None else "start" if truth == 0 else "hit")
    assert min(outcomes.count(kind) for kind in ("miss", "start", "hit")) > 4, outcomes


@pytest.mark.parametrize(
    ("A", "B", "d", "t"),
    [
        ([(0, 0, 0)], [(6, 0, 0)], (4, 0, 0), Fraction(3, 2)), ([(0, 0, 0)], [(6, 0, 1)], (4, 0, 0), None),
        ([(0, 0, 0)], [(-6, 0, 0)], (4, 0, 0), None), ([(1, 2, 3)], [(1, 2, 3)], (1, 1, 1), Fraction(0)),
        ([(0, 0, 0), (0, 2, 0)], [(5, 2, 0), (5, 4, 0)], (1, 0, 0), Fraction(5)),
        ([(0, 0, 0), (0, 2, 0)], [(5, 3, 0), (5, 4, 0)], (1, 0, 0), None),
        ([(0, 0, 0), (2, 0, 0)], [(5, 0, 0), (9, 0, 0)], (2, 0, 0), Fraction(3, 2)),
        ([(0, 0, 0), (2, 0, 0), (0, 2, 0)], [(6, 1, 0), (8, 1, 0), (7, 5, 0)], (1, 0, 0), Fraction(5)),
        ([(0, 0, 0), (2, 0, 0), (0, 2, 0)], [(6, 0, 3), (8, 1, 3), (7, 5, 3)], (0, 0, 1), None),
    ],
)
def test_points_segments_and_flat_sets(A, B, d, t):
    assert cast_exactly(A, B, d).t == t
    assert cast_exactly(A * 2, B + B[:1], d).t == t


@pytest.mark.parametrize("seed", range(4))
def test_of_placed_points_doubles_choose_and_nothing_is_answered_otherwise(seed, monkeypatch):
    """Points on a ball, and a lattice with many ties, both posed: contacts, normals and weights are those of the same
    points as integers, and exact products are of a twentieth of the points a round.
    """
    rng, counts, n_met = rng_of("placed points", seed), [0], 0
    ball = rng.normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    lattice = np.stack(np.meshgrid(*[np.arange(-3.0, 4.0)] * 3), axis=-1).reshape(-1, 3)
    product = exact_cast.inner

    def counted(a, b):
        counts[0] += 1
        return product(a, b)

    monkeypatch.setattr(exact_cast, "inner", counted)
    for points in (ball, lattice):
        for case in range(4):
            placed = PlacedPoints(points, (random_pose(rng, 0.5),) if case % 2 else ())
            begin = [x << max(2 - placed.grid, 0) for x in rng.integers(1, 3, 3).tolist()]
            d = [-x for x in begin] if case < 3 else [begin[0], 0, 0]
            for sides in (([begin], placed), (placed, [begin])):
                way = d if sides[1] is placed else [-x for x in d]
                plain = [side if side is not placed else list(placed) for side in sides]
                counts[0] = 0
                answer, of_doubles = cast_exactly(*sides, way), counts[0]
                counts[0] = 0
                assert answer == cast_exactly(*plain, way), f"seed {seed}: {begin}, {way}"
                assert points is lattice or 20 * of_doubles < counts[0], (of_doubles, counts[0])
                n_met += answer.t is not None
    assert n_met >= 8
