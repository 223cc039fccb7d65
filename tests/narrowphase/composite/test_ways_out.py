"""Depths in unions with half-spaces, judged by formulas and by moving bodies along what is told."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import collide

EYE = np.eye(4)
GROUND = collide.Halfspace((0, 0, 1), 0.0)


def parted(S, B, X_WB, r) -> bool:
    """Whether moving B by −lower along the normal parts the bodies."""
    X = X_WB.copy()
    X[:3, 3] += -r.lower * r.normal
    return not collide.collide(S, B, EYE, X)


@pytest.mark.parametrize("box", [collide.Box((1, 1, 1)), collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1)))[:2])])
def test_a_ball_half_sunk_in_the_ground_beside_a_box(box):
    """It was refused: the overlap had no end."""
    S, ball = collide.Compound([(GROUND, EYE), (box, collide.pose((2, 0, 0)))]), collide.Sphere(0.5)
    for x, height in itertools.product((0.0, 1.2, 2.0), (0.1, 0.0, -0.3)):
        X = collide.pose((x, 0, height))
        r, swapped = collide.distance(S, ball, EYE, X), collide.distance(ball, S, X, EYE)
        assert np.isfinite(r.lower) and r.lower <= r.distance <= r.upper <= -(0.5 - height) + 1e-12
        assert parted(S, ball, X, r)
        assert (swapped.lower, swapped.upper) == (r.lower, r.upper) and np.array_equal(swapped.normal, -r.normal)
    r = collide.distance(S, ball, EYE, collide.pose((0, 0, 0.1)))
    assert abs(r.distance + 0.4) < 1e-4 and abs(r.normal[2] - 1.0) < 1e-12
    assert isinstance(box, collide.Mesh) or r.certified


def shortest(normals, depths) -> float:
    """The least |x| with normals · x ≥ depths, by projecting onto them in turns (R. L. Dykstra, 1983)."""
    x, corrections = np.zeros(3), np.zeros((len(normals), 3))
    for _ in range(20000):
        before = x.copy()
        for k, (n, d) in enumerate(zip(normals, depths)):
            y = x + corrections[k]
            x = y + max(d - n @ y, 0.0) * n
            corrections[k] = y - x
        if np.abs(x - before).max() < 1e-15:
            break
    return float(np.linalg.norm(x))


def test_corners_of_several_half_spaces_by_projection():
    """Of half-spaces alone the shortest way out is known: the bracket is around it, and narrow."""
    rng = np.random.default_rng(2)
    n_several = 0
    for _ in range(40):
        k = int(rng.integers(2, 6))
        normals = rng.normal((0, 0, 1.5), 1.0, (k, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        normals = normals[normals[:, 2] > 0.1]
        offsets = rng.uniform(-0.3, 0.3, len(normals))
        if len(normals) < 2:
            continue
        room = collide.Compound([(collide.Halfspace(n, o), EYE) for n, o in zip(normals, offsets)])
        B = collide.Sphere(0.4) if rng.uniform() < 0.5 else collide.Box((0.6, 0.5, 0.4))
        X = collide.pose(rng.normal(size=3) * 0.2, quat_wxyz=rng.normal(size=4))
        corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * (0.6, 0.5, 0.4)
        reach = np.full(len(normals), 0.4)
        if isinstance(B, collide.Box):
            reach = (-(corners @ X[:3, :3].T) @ normals.T).max(axis=0)
        depths = offsets + reach - normals @ X[:3, 3]
        if depths.max() <= 0.0:
            continue
        want, r = shortest(normals, depths), collide.distance(room, B, EYE, X)
        where = (normals.tolist(), offsets.tolist(), X.tolist(), B, want, r.lower, r.upper)
        assert r.lower - 1e-9 <= -want <= r.upper + 1e-9 and r.upper - r.lower < 1e-9, where
        assert parted(room, B, X, r), where
        n_several += want > depths.max() + 1e-6
    assert n_several >= 10  # are longer than one half-space alone would have it


def test_random_unions_with_half_spaces_are_parted():
    """Ground, a wall and boxes, against a union, too: what is told parts them, and is no less than any part's depth."""
    rng = np.random.default_rng(4)
    n_overlaps = 0
    for _ in range(30):
        items = [(GROUND, EYE), (collide.Halfspace((1, 0, 0.2), -0.5), EYE)][: int(rng.integers(1, 3))]
        items += [(collide.Box(rng.uniform(0.2, 1, 3)), collide.pose(rng.normal(size=3))) for _ in range(3)]
        S = collide.Compound([items[k] for k in rng.permutation(len(items))])
        B = collide.Compound([(collide.Sphere(0.3), collide.pose(rng.normal(size=3) * 0.4)) for _ in range(2)])
        X = collide.pose(rng.normal(size=3) * 0.4)
        r = collide.distance(S, B, EYE, X)
        if r.hit:
            n_overlaps += 1
            assert np.isfinite(r.lower) and parted(S, B, X, r), (items, X.tolist())
    assert n_overlaps >= 15


def test_what_has_no_way_out_is_refused_still():
    between = collide.Compound([(GROUND, EYE), (collide.Halfspace((0, 0, -1), -0.5), EYE)])
    with pytest.raises(collide.UnsupportedQuery, match="no translation was found"):
        collide.distance(between, collide.Sphere(0.5), EYE, collide.pose((3.0, 0.2, 0.3)))
    tilted = collide.Compound([(collide.Halfspace((0, 1, 1), 0.0), EYE), (collide.Sphere(0.1), EYE)])
    with pytest.raises(collide.UnsupportedQuery, match="no translation was found"):
        collide.distance(between, tilted, EYE, EYE)
