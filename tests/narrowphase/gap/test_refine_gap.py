"""Gaps refined from a feature: proven brackets hold the distance of its hull, in Fractions, and are a few ulps wide."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import exact, inner, nearest_to_origin
from naive import LATTICE_ROTATIONS, pose, random_pose, rng_of
from naive_triangles import world_points
from reproduction import reproducing

from collide.narrowphase.gap import gap_layout as at
from collide.narrowphase.gap.refine_gap import refine_gaps
from collide.numerics import double_double as dd

pytestmark = pytest.mark.plain_kernels

SOURCE = "X_WA, X_WB, a, b, radii = {X_WA}, {X_WB}, {a}, {b}, {radii}  # tests/narrowphase/gap/test_refine_gap.py"
ULP = 2.0**-52


class Feature:
    """One to three vertex pairs of two posed bodies, each with a vertex in common with the first where parts = 1."""

    def __init__(self, rng, n: int, parts: int, kind: str):
        self.X_WA, self.X_WB = (random_pose(rng, 0.0) for _ in range(2))
        if kind == "lattice":
            self.X_WA, self.X_WB = (pose(LATTICE_ROTATIONS[int(rng.integers(24))]) for _ in range(2))
        self.X_WB[:3, 3] = (
            np.array([0.0, 0.0, 3.0]) if kind == "lattice" else rng.normal(size=3) * (1e-6 if kind == "near" else 3.0)
        )
        draw = (
            (lambda: rng.integers(-4, 5, size=(n, 3)) * 0.25)
            if kind == "lattice"
            else (lambda: rng.normal(size=(n, 3)))
        )
        self.a, self.b = draw(), draw()
        self.of_a = rng.integers(0, 2, n).astype(bool)
        if parts == 1:  # the other vertex is the first's
            self.a[1:][~self.of_a[1:]], self.b[1:][self.of_a[1:]] = self.a[0], self.b[0]
        self.n, self.parts = n, parts
        if n == 3 and rng.random() < 0.7:  # the foot within the triangle
            w = np.array([[float(x) for x in point] for point in self.points()])
            across = np.cross(w[1] - w[0], w[2] - w[0])
            self.X_WB[:3, 3] += np.array([0.5, 0.25, 0.25]) @ w - (1e-6 if kind == "near" else 0.25) * across
        self.radii = (0.0, 0.0) if kind == "lattice" else tuple(rng.uniform(0.0, 0.1, 2).tolist())

    def question(self) -> list[float]:
        q = [0.0] * at.QUESTION
        for first, X in ((at.POSE_A, self.X_WA), (at.POSE_B, self.X_WB)):
            q[first : first + 12] = [*X[:3, :3].ravel().tolist(), *X[:3, 3].tolist()]
        q[at.CORNER_A : at.CORNER_A + 3], q[at.CORNER_B : at.CORNER_B + 3] = self.a[0].tolist(), self.b[0].tolist()
        q[at.SCALE], q[at.ERROR] = 2.0**-4, 1e-13
        q[at.RADIUS_A], q[at.RADIUS_B] = self.radii
        for k in range(1, self.n):
            edges = [(self.a[k], self.a[0], 1.0), (self.b[0], self.b[k], 0.0)]
            if self.parts == 1:
                edges = edges[:1] if self.of_a[k] else edges[1:]
            for part, (head, tail, of_a) in enumerate(edges):
                where = at.EDGES + at.EDGE * (k - 1) + at.PART * part
                q[where : where + at.PART] = [*head.tolist(), *tail.tolist(), of_a]
        return q

    def points(self) -> list[list[Fraction]]:
        """Of A ⊖ B, exactly."""
        pairs = zip(world_points(self.a, self.X_WA), world_points(self.b, self.X_WB))
        return [[x - y for x, y in zip(p, q)] for p, q in pairs]

    def source(self):
        return reproducing(SOURCE, X_WA=self.X_WA, X_WB=self.X_WB, a=self.a, b=self.b, radii=self.radii)


def refined(feature: Feature) -> list[float]:
    answer = [0.0] * at.ANSWER
    refine_gaps(feature.question(), feature.n, feature.parts, False, [0.0] * at.FEATURE, [0.0] * dd.STRIDE, answer)
    return answer


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["any", "near", "lattice"])
@pytest.mark.parametrize(("n", "parts"), [(1, 1), (2, 1), (2, 2), (3, 1), (3, 2)])
def test_proven_gaps(n, parts, kind):
    rng = rng_of("refine gap", n, parts, kind)
    seen: Counter = Counter()
    for _ in range(80):
        feature = Feature(rng, n, parts, kind)
        true = nearest_to_origin(feature.points())
        with feature.source():
            answer = refined(feature)
            inside = min(true.weights) > 0
            assert not answer[at.PROVEN] or inside, "the foot is not within the feature"
            seen["inside", bool(answer[at.PROVEN])] += inside
            if not answer[at.PROVEN]:
                continue
            r = sum(map(Fraction, feature.radii))
            lower, nearest, upper = (answer[k] for k in (at.GAP_LOWER, at.GAP_NEAREST, at.GAP_UPPER))
            assert lower <= nearest <= upper and upper - lower <= 4 * math.ulp(abs(nearest)) + 1e-28
            assert at_most(Fraction(lower) + r, true.square) and not strictly_less(Fraction(upper) + r, true.square)
            check_vectors(feature, answer, true)
    assert seen["inside", True] >= 10, seen


def at_most(length: Fraction, square: Fraction) -> bool:
    """length ≤ √square"""
    return length <= 0 or length**2 <= square


def strictly_less(length: Fraction, square: Fraction) -> bool:
    """length < √square"""
    return length < 0 or length**2 < square


def check_vectors(feature: Feature, answer: list[float], true) -> None:
    """The unit vector points from B to A; the witness points are in the world, where the weights put them."""
    length = math.sqrt(float(true.square))
    unit = np.array(answer[at.UNIT : at.UNIT + 3])
    if length > 0.0:
        assert np.abs(unit - np.array([float(x) for x in true.point]) / length).max() <= 8 * ULP
    for first, points, X in ((at.POINT_A, feature.a, feature.X_WA), (at.POINT_B, feature.b, feature.X_WB)):
        where = [sum(w * p[axis] for w, p in zip(true.weights, world_points(points, X))) for axis in range(3)]
        assert np.abs(np.array(answer[first : first + 3]) - [float(x) for x in where]).max() <= 1e-9


def test_a_foot_on_the_brink_is_not_proven():
    """The origin above a corner or an edge's end, exactly: another feature may be as near."""
    rng = rng_of("brink")
    for _ in range(40):
        feature = Feature(rng, 2, 1, "lattice")
        points = exact(feature.points())
        edge = [x - y for x, y in zip(points[1], points[0])]
        if inner(points[0], edge) == 0 and any(edge):
            assert refined(feature)[at.PROVEN] == 0.0
            break
    else:
        raise AssertionError("no case on the brink")


def test_nothing_is_proven_of_nothing():
    """Cores that share the point: no direction. Lanes that hold no question are zeros."""
    feature = Feature(rng_of("nothing"), 1, 1, "lattice")
    feature.X_WA = feature.X_WB = np.eye(4)
    feature.b = feature.a.copy()
    assert refined(feature)[at.PROVEN] == 0.0
    answer = [1.0] * at.ANSWER
    with np.errstate(all="ignore"):
        zeros = np.zeros(at.QUESTION)
        refine_gaps(zeros, 1, 1, False, np.zeros(at.FEATURE), np.zeros(dd.STRIDE), answer)
    assert answer[at.PROVEN] == 0.0
