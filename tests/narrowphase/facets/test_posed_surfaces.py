"""Frames of two posed bodies: what composed matrices are off is bounded, mirrors are refused, balls part soundly."""

from __future__ import annotations

import math
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, pose, random_pose, rng_of, rotation
from naive_triangles import cross, inner, minus, world_points
from posed_facets import numbers_of

from collide.narrowphase.facets.posed_surfaces import (
    ERROR,
    EXTENT,
    INVERSE_A,
    N_ERROR,
    PLACING,
    PLAIN,
    SHIFT,
    UNITS,
    Extent,
    M,
    N,
    balls_apart,
    deviation_from_rotation,
    is_swapped_order,
    place,
    put_in_frame_of_a,
    put_in_world,
    shift_between,
)

pytestmark = pytest.mark.plain_kernels


def some_pose(rng, kind: str) -> np.ndarray:
    if kind == "lattice":
        return pose(LATTICE_ROTATIONS[rng.integers(24)], rng.integers(-4, 5, 3) / 4)
    X = random_pose(rng, 10.0 ** rng.integers(-3, 4))
    if kind == "no rotation":
        X[:3, :3] = X[:3, :3] @ np.diag(rng.uniform(0.5, 2.0, 3)) @ rotation(rng)
    return X


def related(P, Q, X, Y):
    """(whether it is done, placing) of two sets of points at poses."""
    placing, frames = np.full(PLACING, np.nan), np.zeros((2, 9), dtype=np.float32)
    A, B = Extent(numbers_of(P), 1, EXTENT), Extent(numbers_of(Q), 3, EXTENT)
    done = place(A, X.ravel(), B, Y.ravel(), placing, *frames)
    return done, placing


def in_frame_of(X, point) -> list[Fraction]:
    """The exact point whose image under the pose is the point given, by Cramer's rule."""
    columns = [[Fraction(x) for x in X[:3, j].tolist()] for j in range(4)]
    a, b, c = columns[:3]
    w = minus(point, columns[3])
    det = inner(a, cross(b, c))
    return [inner(w, cross(b, c)) / det, inner(a, cross(w, c)) / det, inner(a, cross(b, w)) / det]


@pytest.mark.parametrize("kind", ["rotation", "no rotation", "same rotation", "equal", "lattice"])
def test_points_are_where_exact_arithmetic_puts_them(kind):
    rng = rng_of("posed surfaces", kind)
    tight = plain = 0
    for _ in range(40):
        P, Q = (10.0 ** rng.integers(-3, 3) * rng.normal(size=(3, 3)) for _ in range(2))
        if kind == "lattice":
            P, Q = rng.integers(-4, 5, (2, 3, 3)) / 4
        X, Y = some_pose(rng, kind), some_pose(rng, kind)
        Y = X if kind == "equal" else Y
        if kind == "same rotation":  # what is left is the rounding of a sum
            Y[:3, :3], Y[:3, 3] = X[:3, :3], X[:3, 3] * (1 + 1e-9)
        told = f"P, Q, X, Y = {P.tolist()}, {Q.tolist()}, {X.tolist()}, {Y.tolist()}"
        done, placing = related(P, Q, X, Y)
        assert done and placing[UNITS] == 0.25, told
        out = np.empty(9)
        put_in_frame_of_a(placing, Q.ravel(), 0, out, 0)
        there = [in_frame_of(X, point) for point in world_points(Q, Y)]
        back = [in_frame_of(Y, point) for point in world_points(P, X)]
        image = P @ placing[N : N + 9].reshape(3, 3).T + placing[N + 9 : N + 12]
        for found, want, bound in ((out, there, placing[ERROR]), (image.ravel(), back, placing[N_ERROR])):
            off = max(abs(Fraction(x) - y) for x, y in zip(found.tolist(), [y for point in want for y in point]))
            assert off <= bound, f"{told}; off by {float(off)}, bound {bound}"
            tight += off > bound / 1000
        plain += placing[PLAIN]
        if placing[PLAIN]:  # matrix and shift are exact then
            A = [in_frame_of(X, world_points([p], Y)[0]) for p in ([0.0, 0.0, 0.0], *np.eye(3))]
            assert [Fraction(x) for x in placing[SHIFT : SHIFT + 3].tolist()] == A[0], told
            assert [[Fraction(x) for x in row] for row in placing[M : M + 9].reshape(3, 3).T.tolist()] == [
                minus(a, A[0]) for a in A[1:]
            ], told
    assert plain == (40 if kind in ("equal", "lattice") else 0)
    assert tight >= 40 or plain, "bounds say nothing"


def test_mirrors_and_what_is_nearly_singular_are_refused():
    P = np.eye(3)
    nearly = np.array([[1.0, 1.0, 0.0], [1.0, 1.0 + 1e-14, 0.0], [0.0, 0.0, 1.0]])
    for bad in (np.diag([1.0, 1.0, -1.0]), np.diag([1.0, 1.0, 0.0]), nearly):
        assert not related(P, P, pose(bad), np.eye(4))[0] and not related(P, P, np.eye(4), pose(bad))[0], bad
    assert related(P, P, pose(np.diag([1e-3, 1.0, 1e3])), np.eye(4))[0]


def test_inverses_and_deviations_are_bounded_from_above():
    rng = rng_of("deviation from rotation")
    for k in range(60):
        X = some_pose(rng, ("rotation", "no rotation", "lattice")[k % 3])
        R = [[Fraction(x) for x in row] for row in X[:3, :3].tolist()]
        gram = [[sum(R[m][i] * R[m][j] for m in range(3)) - (i == j) for j in range(3)] for i in range(3)]
        true = max(sum(map(abs, row)) for row in gram)
        bound = deviation_from_rotation(X.ravel())
        assert true <= bound <= true * (1 + 1e-12) + 2e-14, X.tolist()
        placing = related(np.eye(3), np.eye(3), X, np.eye(4))[1]
        C = [[Fraction(x) for x in row] for row in placing[INVERSE_A : INVERSE_A + 9].reshape(3, 3).tolist()]
        rest = [[sum(C[i][m] * R[m][j] for m in range(3)) - (i == j) for j in range(3)] for i in range(3)]
        assert max(sum(map(abs, row)) for row in rest) <= placing[INVERSE_A + 9] <= 1e-13, X.tolist()
    assert deviation_from_rotation(pose(np.diag([1.0, 1.0, -1.0])).ravel()) == math.inf


def test_balls_part_only_what_is_farther_than_the_margin():
    rng = rng_of("balls apart")
    seen: Counter = Counter()
    for _ in range(400):
        P, Q = rng.normal(size=(2, 6, 3))
        X, Y = random_pose(rng, 3.0), random_pose(rng, 3.0)
        margin = float(rng.choice([0.0, 0.1, 1.0]))
        p, q = (points @ Z[:3, :3].T + Z[:3, 3] for points, Z in ((P, X), (Q, Y)))
        apart = balls_apart(X.ravel(), numbers_of(P), Y.ravel(), numbers_of(Q), margin)
        # Balls hold the hulls, whose distance is at most that of any two points.
        nearest = np.linalg.norm(p[:, None] - q[None], axis=2).min()
        assert not apart or nearest > margin, f"{P.tolist()}, {Q.tolist()}, {X.tolist()}, {Y.tolist()}, {margin}"
        far = Y.copy()
        far[:3, 3] += 20.0 * rotation(rng)[0]
        seen[apart] += 1
        seen["far"] += balls_apart(X.ravel(), numbers_of(P), far.ravel(), numbers_of(Q), margin)
    assert seen[True] > 40 and seen[False] > 100 and seen["far"] > 380, seen


def test_the_order_of_poses_and_points_in_the_world():
    rng = rng_of("order of poses")
    for k in range(30):
        X, Y = random_pose(rng), random_pose(rng)
        if k % 2:
            Y[: k % 3] = X[: k % 3]
        assert is_swapped_order(X.ravel(), Y.ravel()) != is_swapped_order(Y.ravel(), X.ravel())
        assert not is_swapped_order(X.ravel(), X.ravel())
        assert is_swapped_order(X.ravel(), Y.ravel()) == (X[:3].ravel().tolist() > Y[:3].ravel().tolist())
        Q, out = rng.normal(size=(3, 3)), np.empty(9)
        put_in_world(Y.ravel(), shift_between(X.ravel(), Y.ravel()), Q.ravel(), 0, out, 0)
        want = Q @ Y[:3, :3].T + (Y[:3, 3] - X[:3, 3])
        assert np.allclose(out.reshape(3, 3), want, rtol=0, atol=1e-14)
