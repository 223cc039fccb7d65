"""Contacts of compounds of many parts: those of the parts one by one, and no work for parts that are far."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.narrowphase.composite import composite_meshes, composite_parts
from collide.narrowphase.composite.composite_parts import CompoundParts

EYE = np.eye(4)


def clutter(rng, n: int, spread: float) -> collide.Compound:
    makers = (lambda w: collide.Box((w, w, w)), lambda w: collide.Sphere(w), lambda w: collide.Cylinder(w, w))
    return collide.Compound([
        (makers[int(rng.integers(3))](rng.uniform(0.05, 0.1)), collide.pose(p, rpy=r))
        for p, r in zip(rng.uniform(-spread, spread, (n, 3)), rng.uniform(-3, 3, (n, 3)))
    ])


@pytest.fixture
def posed_rows(monkeypatch):
    """How many poses of parts are made."""
    rows: list[int] = []
    placed = CompoundParts.placed

    def counted(self, which, X_WB, about):
        rows.append(len(which))
        return placed(self, which, X_WB, about)

    monkeypatch.setattr(CompoundParts, "placed", counted)
    return rows


@pytest.mark.many(2)
@pytest.mark.parametrize(("n_a", "n_b"), [(1, 200), (12, 15), (60, 60)])
def test_rows_are_those_of_the_parts_one_by_one(n_a, n_b, posed_rows):
    """Against every part of A with every part of B, through the box-tree and without; hits and misses both."""
    rng = np.random.default_rng(n_b)
    hits = 0
    for trial in range(3):
        A, B = clutter(rng, n_a, 0.1), clutter(rng, n_b, 0.5 if n_b > 50 else 0.25)
        X_WA, X_WB = collide.pose(rng.uniform(-0.3, 0.3, 3)), collide.pose((0, 0, 0), rpy=rng.uniform(-3, 3, 3))
        found = collide.contacts(A, B, X_WA, X_WB, margin=0.01)
        pairs = {tuple(pair) for pair in np.stack([found.rows["part_a"], found.rows["part_b"]], axis=1).tolist()}
        expected = {
            (i, j)
            for i, (a, X_a) in enumerate(A.items)
            for j, (b, X_b) in enumerate(B.items)
            if collide.distance(a, b, X_WA @ X_a, X_WB @ X_b).distance <= 0.01
        }
        assert pairs == expected, f"seed {n_b}, trial {trial}: {pairs ^ expected}"
        hits += len(pairs)
        n_near = posed_rows.pop()
        assert posed_rows.pop() == n_near <= 0.5 * n_a * n_b and not posed_rows
    assert hits >= 3


def test_far_compounds_pose_no_part(posed_rows):
    rng = np.random.default_rng(3)
    A, B = clutter(rng, 300, 0.5), clutter(rng, 300, 0.5)
    assert not len(collide.contacts(A, B, EYE, collide.pose((5, 0, 0)), margin=0.1))
    assert posed_rows == [0, 0]


def test_half_spaces_are_near_whatever_their_boxes(posed_rows):
    rng = np.random.default_rng(4)
    A = collide.Compound([(collide.Halfspace((0.6, 0.0, 0.8), 0.1), EYE), (collide.Sphere(0.1), EYE)])
    B = clutter(rng, 300, 0.5)
    found = collide.contacts(A, B, EYE, EYE)
    below = {
        j for j, (shape, X) in enumerate(B.items) if collide.distance(A.items[0][0], shape, EYE, X).distance <= 0.0
    }
    assert {j for i, j in zip(found.rows["part_a"], found.rows["part_b"]) if i == 0} == below and len(below) > 50


def test_parts_with_meshes_that_cannot_be_nearest_are_not_asked(monkeypatch):
    """A row of 60 mesh cubes beside a box: the distance is that of the nearest, and few are asked for theirs; where
    they overlap, few parts' support values are worked out."""
    cube = collide.Mesh(*collide.tessellate(collide.Box((0.1, 0.1, 0.1))))
    A = collide.Compound([(cube, collide.pose((0.2 * k, 0.01 * k, 0))) for k in range(60)])
    B = collide.Box((0.3, 0.3, 0.3))
    asked: list[int] = []
    part_rows = composite_meshes.part_rows
    monkeypatch.setattr(composite_meshes, "part_rows", lambda *given: asked.append(1) or part_rows(*given))
    for x in (-0.7, 3.1, 12.8):
        asked.clear()
        X = collide.pose((x, -1.0, 0))
        found = collide.distance(A, B, EYE, X)
        nearest = min(collide.distance(cube, B, Y, X).distance for _, Y in A.items)
        assert found.lower <= nearest + 1e-12 and abs(found.distance - nearest) < 1e-12
        assert len(asked) <= 12
    values: list[int] = []
    extent_of = composite_parts.extent_of
    monkeypatch.setattr(composite_parts, "extent_of", lambda *given: values.append(1) or extent_of(*given))
    assert collide.distance(A, B, EYE, collide.pose((0.2, 0.0, 0.0))).hit
    assert len(values) < 19 * (60 + 1) // 2


def test_boxes_near_are_all_pairs_within_the_margin(monkeypatch):
    """With and without the tree the same pairs, and none is lost to rounding at the margin."""
    rng = np.random.default_rng(6)
    A, B = (CompoundParts(clutter(rng, 40, 0.5)) for _ in range(2))
    X_WA, X_WB = (
        np.array([collide.pose(rng.uniform(-1, 1, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(5)]) for _ in "ab"
    )
    a, b = A.boxes(X_WA)[:, :, None], B.boxes(X_WB)[:, None]
    apart = np.maximum(b[..., :3] - a[..., 3:], a[..., :3] - b[..., 3:]).max(axis=-1)
    for few in (0, 1 << 20):
        monkeypatch.setattr(composite_parts, "_MAX_PAIRS", few)
        found = set(zip(*(column.tolist() for column in composite_parts.boxes_near(A, B, X_WA, X_WB, 0.05))))
        assert found == set(map(tuple, np.argwhere(apart <= 0.05).tolist())) and len(found) > 20
