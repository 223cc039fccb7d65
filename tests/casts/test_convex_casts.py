"""Casts of convex parts: rows of the kernel against the exact program, first contacts against loops."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from cast_oracles import exact_first_contact
from naive import LATTICE_ROTATIONS, pose, rng_of
from reproduction import reproducing

import collide
from collide.casts import cast_pairs as P
from collide.casts.convex_casts import (
    Marks,
    PairRows,
    answer_part_pairs,
    answer_questions,
    first_contacts,
    nothing_met,
    settle_points,
    workspace,
)
from collide.casts.portal import BEHIND, HIT, LEVEL, MISS, OPEN
from collide.casts.posed_parts import PartPairs, posed_sides
from collide.kernels import address_of

SOURCE = "A, B, X_WA, X_WB, d = {A}, {B}, {X_WA}, {X_WB}, {d}  # hulls, half units; tests/casts/test_convex_casts.py"


def tetrahedron(rng) -> np.ndarray:
    while True:
        corners = rng.integers(-2, 3, (4, 3))
        if abs(np.linalg.det((corners[1:] - corners[0]).astype(float))) > 0.5:
            return corners


class Drawn:
    """A cast of lattice tetrahedra, and its truth in Fractions."""

    def __init__(self, rng):
        self.A, self.B = tetrahedron(rng), tetrahedron(rng)
        self.X_WA, self.X_WB = (
            pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-5, 6, 3).astype(float)) for _ in range(2)
        )
        ahead = np.clip(np.round((self.X_WB - self.X_WA)[:3, 3] / rng.choice([2.0, 4.0])), -2, 2).astype(int)
        d = np.clip(ahead + rng.integers(-1, 2, 3) * int(rng.random() < 0.3), -2, 2)
        self.d = d if d.any() else np.array((1, 0, 0))
        world = [[tuple(int(x) for x in row) for row in points @ X[:3, :3].T + X[:3, 3]]
                 for points, X in ((self.A, self.X_WA), (self.B, self.X_WB))]
        self.truth = exact_first_contact(*world, tuple(self.d.tolist()))

    def pairs(self) -> PartPairs:
        A, B = (collide.ConvexHull(points.astype(float)) for points in (self.A, self.B))
        pairs = posed_sides(A, B, self.X_WA[None], self.X_WB[None], 1).all_pairs(np.arange(1))
        pairs.parts.table.build_trees(pairs.parts.shape_of)
        return pairs

    def question(self, limit: float) -> np.ndarray:
        return np.array([[*(self.d / 4.0), limit]])  # t counts quarters


def kernel_row(pairs: PartPairs, question: np.ndarray) -> np.ndarray:
    row, parts = np.zeros(P.CAST_ROW), pairs.parts
    P.cast_pairs(
        *parts.table.addresses, address_of(parts.poses.rows), address_of(parts.shape_of), address_of(pairs.pairs),
        address_of(question), 1, address_of(row), *workspace(),
    )
    return row


def test_rows_hold_the_truth_and_settled_ones_tell_it():
    rng, seen = rng_of("convex casts"), Counter()
    for _ in range(60):
        case = Drawn(rng)
        truth = None if case.truth is None else 4 * case.truth
        limit = float(rng.choice([math.inf, 8.0]))
        pairs, question = case.pairs(), case.question(limit)
        with reproducing(SOURCE, **{name: getattr(case, name) for name in ("A", "B", "X_WA", "X_WB", "d")}):
            row = kernel_row(pairs, question)
            status = int(row[P.STATUS])
            seen[status] += 1
            if status == HIT:
                assert (
                    truth is not None
                    and 0 < Fraction(row[P.LOWER]) <= truth <= Fraction(row[P.UPPER])
                    and truth <= limit
                )
                assert row[P.LOWER] <= row[P.VALUE] <= row[P.UPPER]
            elif status == MISS:
                assert truth is None or truth > limit
            elif truth is not None and truth > 0:
                assert status in (BEHIND, OPEN)
                assert Fraction(row[P.LOWER]) <= truth or status == BEHIND
            rows, marks = answer_part_pairs(pairs.parts, pairs.pairs, question)
            met = truth is not None and truth <= limit
            assert (rows[0, P.STATUS] == HIT) == met and marks.proven[0] and marks.certified[0]
            assert marks.at_start[0] == (truth == 0)
            if met:
                assert Fraction(rows[0, P.LOWER]) <= truth <= Fraction(rows[0, P.UPPER])
                assert rows[0, P.UPPER] - rows[0, P.LOWER] <= 2.0**-39 * rows[0, P.SIZE]
                if truth > 0:
                    n = rows[0, P.NORMAL : P.NORMAL + 3]
                    assert abs(np.linalg.norm(n) - 1.0) < 1e-12 and n @ case.d > -1e-9
    assert seen[HIT] > 10 and seen[MISS] > 10, seen


def test_exact_rows_are_the_least_brackets():
    rng, n = rng_of("settled points"), 0
    for _ in range(40):
        case = Drawn(rng)
        world = [[tuple(int(x) for x in row) for row in points @ X[:3, :3].T + X[:3, 3]]
                 for points, X in ((case.A, case.X_WA), (case.B, case.X_WB))]
        row = np.zeros(P.CAST_ROW)
        limit = float(rng.choice([math.inf, 3.0]))
        with reproducing(SOURCE, **{name: getattr(case, name) for name in ("A", "B", "X_WA", "X_WB", "d")}):
            settle_points(*world, -2, np.array([*case.d.astype(float), limit]), row)  # points in quarters
            truth = None if case.truth is None else case.truth / 4
            assert row[P.STATUS] == (HIT if truth is not None and truth <= limit else MISS)
            if row[P.STATUS] == HIT:
                n += 1
                assert Fraction(row[P.LOWER]) <= truth <= Fraction(row[P.UPPER])
                assert np.nextafter(row[P.LOWER], np.inf) >= row[P.UPPER] and row[P.VALUE] in (
                    row[P.LOWER],
                    row[P.UPPER],
                )
                if truth:
                    normal = row[P.NORMAL : P.NORMAL + 3]
                    at = row[P.TOUCHING : P.TOUCHING + 3]
                    reach_a = max(float(normal @ np.array(p)) for p in world[0]) / 4 + float(truth) * float(
                        normal @ case.d
                    )
                    reach_b = min(float(normal @ np.array(p)) for p in world[1]) / 4
                    np.testing.assert_allclose([reach_a, reach_b], float(normal @ at), rtol=0, atol=1e-12)
    assert n > 8


def test_bodies_before_a_plane():
    """Exactly: a corner that comes nearer by any amount meets it, one that runs along it never does."""
    half, box = collide.Halfspace((0, 0, 1), 0.0), collide.Box((2, 2, 2))
    for z, d, limit, expected in (
        (3.0, (0, 0, -0.5), math.inf, 4.0), (3.0, (0.5, 0, 0), math.inf, None), (3.0, (0, 0, 0.5), math.inf, None),
        (3.0, (0, 0, -0.5), 3.99, None), (1.0, (0.5, 0, 0), math.inf, 0.0), (0.5, (0, 0, 0.5), math.inf, 0.0),
        (np.nextafter(1.0, 2.0), (0.5, 0, 0), math.inf, None), (3.0, (0.5, 0, -(2.0**-60)), math.inf, 2.0**61),
        (3.0, (0.5, 0, -(2.0**-60)), 2.0**60, None), (3.0, (0, 0, -0.5), 4.0, 4.0),
    ):
        pairs = posed_sides(box, half, collide.pose((0, 0, z))[None], np.eye(4)[None], 1).all_pairs(np.arange(1))
        out = first_contacts(answer_questions(pairs, np.array([d], dtype=float), np.array([limit])), 1)
        assert out.hit[0] == (expected is not None) and out.proven[0], (z, d)
        if expected is not None:
            assert out.t[0, 1] <= expected <= out.t[0, 2] and out.at_start[0] == (expected == 0.0)
        if expected:
            np.testing.assert_allclose(out.normal[0], (0, 0, -1), rtol=0, atol=1e-12)
            assert abs(out.point[0, 2]) < 1e-6


def test_curved_bodies_that_graze_are_left_open_and_hit():
    ball = collide.Sphere(0.5)
    for y, hit, certified in ((1.0, True, False), (1.0 + 1e-6, False, True), (1.0 - 1e-3, True, True)):
        pairs = posed_sides(ball, ball, collide.pose((-3, y, 0))[None], np.eye(4)[None], 1).all_pairs(np.arange(1))
        out = first_contacts(answer_questions(pairs, np.array([(0.5, 0.0, 0.0)]), np.array([math.inf])), 1)
        assert (out.hit[0], out.certified[0]) == (hit, certified)
        assert not hit or out.t[0, 1] <= 2 * (3 - math.sqrt(max(1 - y * y, 0))) <= out.t[0, 2] + 1e-6


def drawn_rows(rng, n: int, k: int) -> PairRows:
    rows = np.zeros((k, P.CAST_ROW))
    rows[:, P.STATUS] = rng.choice([HIT, HIT, MISS], k)
    rows[:, P.VALUE] = rng.integers(0, 5, k)
    rows[:, P.LOWER] = rows[:, P.VALUE] - rng.choice([0.0, 0.5], k)
    rows[:, P.UPPER] = rows[:, P.VALUE] + rng.choice([0.0, 1.5], k)
    rows[:, P.NORMAL : P.CAST_ROW] = rng.normal(size=(k, P.CAST_ROW - P.NORMAL))
    proven = rng.random(k) < 0.7
    marks = Marks(proven, proven & (rng.random(k) < 0.7), rng.random(k) < 0.3)
    return PairRows(rows, marks, rng.integers(0, n, k), rng.integers(0, 3, k), rng.integers(0, 3, k))


def naive_first(pairs: PairRows, question: int):
    """(row of the first, t (3,), proven, certified) of one question; None where nothing is met."""
    hits = [k for k in range(len(pairs.owner)) if pairs.owner[k] == question and pairs.rows[k, P.STATUS] == HIT]
    if not hits:
        return None
    value, lower, upper = (pairs.rows[:, column] for column in (P.VALUE, P.LOWER, P.UPPER))
    first = min(hits, key=lambda k: (value[k], pairs.item_a[k], pairs.item_b[k], k))
    low = min(lower[k] for k in hits)
    proven = [upper[k] for k in hits if pairs.marks.proven[k]]
    high = min(proven) if proven else max(upper[k] for k in hits)
    certified = all(pairs.marks.certified[k] for k in hits if lower[k] <= high)
    return first, (min(max(value[first], low), high), low, high), bool(proven), certified


def test_first_contacts_are_those_of_a_loop():
    rng, n_hits = rng_of("first contacts"), 0
    for _ in range(60):
        n = int(rng.integers(1, 5))
        pairs = drawn_rows(rng, n, int(rng.integers(0, 12)))
        out = first_contacts(pairs, n)
        for question in range(n):
            expected = naive_first(pairs, question)
            assert out.hit[question] == (expected is not None)
            if expected is None:
                assert out.proven[question] and out.certified[question] and out.item_a[question] == -1
                continue
            n_hits += 1
            first, t, proven, certified = expected
            assert out.t[question].tolist() == list(t)
            assert (out.proven[question], out.certified[question]) == (proven, certified)
            assert out.at_start[question] == pairs.marks.at_start[first]
            assert np.array_equal(out.normal[question], pairs.rows[first, P.NORMAL : P.NORMAL + 3])
            assert np.array_equal(out.point[question], pairs.rows[first, P.TOUCHING : P.TOUCHING + 3])
            assert (out.item_a[question], out.item_b[question]) == (pairs.item_a[first], pairs.item_b[first])
    assert n_hits > 60


def test_nothing_met_is_proven():
    out = nothing_met(3)
    assert not out.hit.any() and out.proven.all() and out.certified.all() and not out.at_start.any()
    assert np.isinf(out.t).all() and not out.normal.any() and (out.item_a == -1).all() and (out.item_b == -1).all()
    assert len({id(column) for column in out}) == len(out)  # columns are written one by one
    pairs = posed_sides([], [], np.zeros((0, 4, 4)), np.zeros((0, 4, 4)), 0).all_pairs(np.arange(0))
    assert len(first_contacts(answer_questions(pairs, np.zeros((0, 3)), np.zeros(0)), 0).hit) == 0
    assert answer_questions(pairs, np.zeros((0, 3)), np.zeros(0)).rows.shape == (0, P.CAST_ROW)


@pytest.mark.parametrize("wanted", [HIT, MISS])
def test_every_row_is_settled(wanted):
    """No row that comes back is BEHIND, OPEN or LEVEL."""
    rng = rng_of("settled", wanted)
    boxes = [collide.Box(rng.uniform(0.5, 1.0, 3)) for _ in range(30)]
    X = np.array([collide.pose(rng.integers(-2, 3, 3) * 0.5) for _ in range(30)])
    half = collide.Halfspace((0, 0, 1), -1.0)
    others = [half if k % 3 == 0 else boxes[k - 1] for k in range(30)]
    pairs = posed_sides(boxes, others, X, np.eye(4)[None], 30).all_pairs(np.arange(30))
    d = np.eye(3)[rng.integers(0, 3, 30)] * -0.5
    found = answer_questions(pairs, d, np.full(30, np.inf))
    assert {BEHIND, OPEN, LEVEL}.isdisjoint(found.rows[:, P.STATUS].tolist())
    assert (found.rows[:, P.STATUS] == wanted).sum() > 3 and found.marks.proven.all()
