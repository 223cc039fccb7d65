"""Smoothed distances: means without bias, derivatives of these means, soft minima."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.errors import InvalidArgument
from collide.pairs.smoothed_distances import rotations

PAIRS = [
    (collide.Box((1, 0.6, 0.4)), collide.Cylinder(0.2, 0.5)),
    (collide.Box((1, 1, 1)), collide.Box((0.7, 0.7, 0.7))),
    (collide.Sphere(0.3), collide.ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])),
    (collide.Ellipsoid((0.3, 0.2, 0.5)), collide.Capsule(0.1, 0.6)),
]


def moved(X, by):
    """A pose turned by by[:3] about its origin and shifted by by[3:], along the axes of W."""
    out = X.copy()
    out[:3, :3] = rotations(by[None, :3])[0] @ X[:3, :3]
    out[:3, 3] += by[3:]
    return out


def poses(rng, apart: float):
    X_WA, X_WB = random_pose(rng, 0.3), random_pose(rng, 0.0)
    u = rng.normal(size=3)
    X_WB[:3, 3] = X_WA[:3, 3] + apart * u / np.linalg.norm(u)
    return X_WA, X_WB


def test_turns_are_those_of_a_vector():
    phi = np.array([[0.3, -0.5, 0.8], [0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2]])
    R = rotations(phi)
    assert np.allclose(R @ R.transpose(0, 2, 1), np.eye(3), atol=1e-15) and np.array_equal(R[1], np.eye(3))
    assert np.allclose(R[2] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    assert np.allclose(R[0] @ phi[0], phi[0], atol=1e-15)


def test_a_ball_over_a_plane_is_as_far_as_it_was():
    """The distance is linear in the shift and does not depend on turns: nothing is smoothed."""
    floor, ball = collide.Halfspace((0, 0, 1), 0.0), collide.Sphere(0.2)
    r = collide.smoothed_distances(floor, ball, np.eye(4), collide.pose((3, 1, 0.7)), angle=0.5, length=0.1)
    assert r.distance[0] == pytest.approx(0.5, abs=1e-12) and r.distance_error[0] < 1e-12  # opposite shifts cancel
    assert np.allclose(r.d_distance_B[0], [0, 0, 0, 0, 0, 1], atol=1e-12) and r.missing[0] == 0
    assert np.allclose(r.d_distance_A[0], [-1, 3, 0, 0, 0, -1], atol=1e-12)


@pytest.mark.many(4)
@pytest.mark.parametrize("apart", [0.3, 1.2])
@pytest.mark.parametrize("pair", range(len(PAIRS)))
def test_both_orders_estimate_the_same_derivative(pair, apart):
    rng = rng_of("both orders", pair, apart)
    A, B = PAIRS[pair]
    X_WA, X_WB = poses(rng, apart)
    options = {"angle": 0.2, "length": 0.05, "samples": 1 << 14}
    first = collide.smoothed_distances(A, B, X_WA, X_WB, seed=1, **options)
    zeroth = collide.smoothed_distances(A, B, X_WA, X_WB, seed=2, order=0, **options)
    for name in ("distance", "d_distance_A", "d_distance_B"):
        errors = np.hypot(getattr(first, f"{name}_error"), getattr(zeroth, f"{name}_error"))
        off = np.abs(getattr(first, name) - getattr(zeroth, name))
        assert (off <= 5.0 * errors + 1e-12).all(), (name, off / errors)
    assert first.d_distance_B_error.max() < 0.6 * zeroth.d_distance_B_error.max()


@pytest.mark.parametrize("body", ["A", "B"])
def test_first_order_is_the_derivative_of_the_mean_itself(body):
    """The same motions at poses nearby: the mean of so many smooth functions has the mean of their derivatives."""
    rng = rng_of("derivative of the mean", body)
    for A, B in PAIRS[2:]:
        X_WA, X_WB = poses(rng, 1.5)
        options = {"angle": 0.1, "length": 0.05, "samples": 512}
        r, step = collide.smoothed_distances(A, B, X_WA, X_WB, **options), 1e-5
        for k, by in enumerate(step * np.eye(6)):
            ends = []
            for sign in (1.0, -1.0):
                at = (moved(X_WA, sign * by), X_WB) if body == "A" else (X_WA, moved(X_WB, sign * by))
                ends.append(collide.smoothed_distances(A, B, *at, **options).distance[0])
            assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(getattr(r, f"d_distance_{body}")[0, k], abs=1e-6)


def test_parallel_faces_have_a_derivative_once_smoothed():
    box, X_WB = collide.Box((1, 1, 1)), collide.pose((0.2, 0, 1.5))
    assert not collide.distance(box, box, np.eye(4), X_WB, derivatives=True).unique
    r = collide.smoothed_distances(box, box, np.eye(4), X_WB, angle=0.01, length=0.001, samples=1024)
    assert r.distance[0] < 0.5  # a tilted face comes nearer with an edge
    assert np.allclose(r.d_distance_B[0, 3:], (0, 0, 1), atol=0.02) and np.isfinite(r.d_distance_B).all()


def test_batches_are_single_questions():
    A, B = PAIRS[0]
    rng = rng_of("smoothed batch")
    X = np.array([poses(rng, 1.0) for _ in range(3)])
    options = {"angle": 0.1, "length": 0.05, "samples": 32, "seed": 3}
    batch = collide.smoothed_distances(A, B, X[:, 0], X[:, 1], **options)
    for k in range(3):
        one = collide.smoothed_distances(A, B, X[k, 0], X[k, 1], **options)
        assert np.allclose(batch.d_distance_A[k], one.d_distance_A[0], atol=1e-12)
        assert batch.distance[k] == pytest.approx(one.distance[0], abs=1e-14)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"samples": 5}, "even"), ({"samples": 2}, "samples"), ({"order": 2}, "order"), ({"angle": -1.0}, "angle"),
        ({"order": 0, "angle": 0.0}, "above 0"), ({"seed": -1}, "seed"), ({"length": np.nan}, "length"),
    ],
)
def test_bad_arguments_are_named(options, words):
    box = collide.Box((1, 1, 1))
    with pytest.raises(InvalidArgument, match=words):
        collide.smoothed_distances(box, box, np.eye(4), np.eye(4), **{"angle": 0.1, "length": 0.1, **options})


# --- soft minima --------------------------------------------------------------------------------


def test_soft_minima_are_near_the_least_and_have_their_derivative():
    rng = rng_of("soft minimum")
    d, g, k = rng.normal(size=40), rng.normal(size=(40, 7)), 30.0
    starts = [0, 5, 5, 25, 40]
    soft = collide.soft_minimum(d, g, sharpness=k, starts=starts)
    for i, (first, last) in enumerate(pairwise(starts)):
        if first == last:
            assert soft.value[i] == np.inf and not soft.gradient[i].any()
            continue
        least = d[first:last].min()
        assert least - np.log(last - first) / k - 1e-12 <= soft.value[i] <= least
        assert soft.weights[first:last].sum() == pytest.approx(1.0)
    h, v = 1e-6, rng.normal(size=7)
    ends = [collide.soft_minimum(d + s * h * (g @ v), sharpness=k, starts=starts).value for s in (1.0, -1.0)]
    full = np.isfinite(soft.value)
    assert np.allclose((ends[0][full] - ends[1][full]) / (2 * h), (soft.gradient @ v)[full], atol=1e-6)


def test_rows_without_a_say_are_left_out_and_others_refused():
    soft = collide.soft_minimum([0.1, np.inf], [[1.0], [np.nan]], sharpness=10.0)
    assert soft.value[0] == pytest.approx(0.1) and soft.gradient[0, 0] == 1.0
    with pytest.raises(InvalidArgument, match=r"gradients\[1\]"):
        collide.soft_minimum([0.1, 0.2], [[1.0], [np.nan]], sharpness=10.0)
    for bad in ({"distances": [np.nan]}, {"sharpness": 0.0}, {"starts": [0, 3]}, {"gradients": [[1.0]]}):
        with pytest.raises(InvalidArgument, match=next(iter(bad))):
            collide.soft_minimum(**{"distances": [0.1, 0.2], "sharpness": 1.0, **bad})
