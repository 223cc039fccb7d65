"""The shortest translation that parts two bodies, where a formula tells which that is."""

from __future__ import annotations

import math

import naive
import numpy as np
from naive import pose, rng_of

from collide.narrowphase.facets.separating_translation import SeparatingTranslation, shortened

#: Sides of the cubes: they meet where no coordinate of their centres differs by more.
SIDE = 1.0


def cubes_meet(X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    return (np.abs(X_WB[:, :3, 3] - X_WA[:, :3, 3]) <= SIDE).all(axis=1)


def balls_meet(X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    return np.square(X_WB[:, :3, 3] - X_WA[:, :3, 3]).sum(axis=1) <= SIDE**2


AXES = np.concatenate([np.eye(3), -np.eye(3)])


def parts(meet, X_WA, X_WB, found: SeparatingTranslation) -> bool:
    moved = X_WB.copy()
    moved[:3, 3] += found.bound * (1 + 1e-12) * found.normal
    return not meet(X_WA[None], moved[None])[0]


def test_cubes_come_apart_by_their_least_overlap():
    rng = rng_of("separating cubes")
    exact = 0
    for _ in range(60):
        X_WA, X_WB = pose(t=rng.normal(size=3)), pose()
        offset = rng.uniform(-0.98, 0.98, 3)
        X_WB[:3, 3] = X_WA[:3, 3] + offset
        least = SIDE - np.abs(offset).max()
        known = SeparatingTranslation(3.0, 3.0, np.array([1.0, 0.0, 0.0]))
        found = shortened(cubes_meet, X_WA, X_WB, known, AXES, [])
        assert least - 1e-12 <= found.length <= found.bound and found.bound <= found.length * (1 + 1e-12)
        assert abs(np.linalg.norm(found.normal) - 1.0) < 1e-12 and parts(cubes_meet, X_WA, X_WB, found), offset.tolist()
        assert found.length <= 2.0 * least + 1e-9, (
            "a length between the best and its half is tried in the best direction"
        )
        exact += found.length <= 1.01 * least
    assert exact > 30, exact


def test_nothing_longer_than_what_is_known():
    """Where no direction offers less, the answer is what was known before; candidates that part are taken as they
    are."""
    X_WA, X_WB = pose(), pose(t=(0.25, 0.0, 0.0))
    known = SeparatingTranslation(0.75, 0.75, np.array([1.0, 0.0, 0.0]))
    sideways = np.array([[0.0, 1.0, 0.0]])
    found = shortened(cubes_meet, X_WA, X_WB, known, sideways, [])
    assert found.length <= 0.75 and naive.share(found.normal == [1.0, 0.0, 0.0]) == 1.0
    candidate = np.array([0.76, 0.0, 0.0])
    loose = SeparatingTranslation(5.0, 5.0, np.array([0.0, 0.0, 1.0]))
    found = shortened(cubes_meet, X_WA, X_WB, loose, sideways, [candidate])
    assert 0.75 < found.length <= 0.76 + 1e-12 and found.normal[0] > 0.999


def test_touching_bodies_need_nearly_nothing():
    X_WA, X_WB = pose(), pose(t=(1.0, 0.0, 0.0))
    known = SeparatingTranslation(0.5, 0.5, np.array([0.0, 1.0, 0.0]))
    for meet in (cubes_meet, balls_meet):
        found = shortened(meet, X_WA, X_WB, known, AXES, [])
        assert 0.0 < found.length <= 1e-13 and math.isfinite(found.bound) and parts(meet, X_WA, X_WB, found)


def test_steps_that_round_to_nothing_tell_no_direction():
    """At 1e6 m and beyond a step of 1e-12 m moves nothing; whatever is told of the bodies there, no number is NaN."""
    for away in (1e6, 1e12):
        X_WA, X_WB = pose(t=(away, away, away)), pose(t=(away, away, away))
        for candidate in ([], [np.zeros(3)], [np.full(3, 1e-200)], [np.array([1e-13, 0.0, 0.0])]):
            known = SeparatingTranslation(1e-12, 2e-12, np.array([0.0, 0.0, 1.0]))
            found = shortened(lambda X, Y: np.zeros(len(Y), dtype=bool), X_WA, X_WB, known, AXES, candidate)
            assert np.isfinite(found.normal).all() and abs(np.linalg.norm(found.normal) - 1.0) < 1e-12
            assert 0.0 < found.length <= 1e-12 and found.length <= found.bound <= 2e-12
