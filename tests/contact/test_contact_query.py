"""`contacts` of many pairs: lists of shapes, picks of a ShapeSet and batches of poses, as the single calls say."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide import Box, ConvexHull, InvalidArgument, InvalidPose, ShapeSet, Sphere, contacts, pose
from collide.narrowphase.prepared_pairs import prepared_pair

EYE = np.eye(4)
SHAPES = [Box(1, 1, 1), Sphere(0.5), ConvexHull(np.eye(3)), Box(2, 1, 0.5)]


def test_a_pair_of_shapes_a_pose():
    rng = np.random.default_rng(1)
    n = 24
    i, j = rng.integers(0, 4, size=(2, n))
    X, Y = (np.array([pose(rng.uniform(-0.7, 0.7, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)]) for _ in range(2))
    library = ShapeSet(SHAPES)
    singles = [contacts(SHAPES[a], SHAPES[b], X[k], Y[k], margin=0.05) for k, (a, b) in enumerate(zip(i, j))]
    counts = [len(c) for c in singles]
    assert max(counts) > 1 and min(counts) == 0
    for A, B in (
        (library[i], library[j]),
        ([SHAPES[k] for k in i], tuple(SHAPES[k] for k in j)),
        (library[i], [SHAPES[k] for k in j]),
    ):
        told = contacts(A, B, X, Y, margin=0.05)
        assert np.diff(told.starts).tolist() == counts
        assert all(told[k].rows.tobytes() == single.rows.tobytes() for k, single in enumerate(singles))
    one = contacts(SHAPES[0], library[j], EYE, Y, margin=0.05)
    assert all(
        one[k].rows.tobytes() == contacts(SHAPES[0], SHAPES[j[k]], EYE, Y[k], margin=0.05).rows.tobytes()
        for k in range(n)
    )
    assert len(contacts([], [], np.zeros((0, 4, 4)), EYE)) == 0
    assert len(contacts([SHAPES[0]], [SHAPES[1]], EYE, EYE).starts) == 2


def test_counts_that_do_not_match():
    with pytest.raises(InvalidArgument, match="A 2, B 3"):
        contacts(SHAPES[:2], SHAPES[:3], EYE, EYE)
    with pytest.raises(InvalidArgument, match="X_WB 3, A 2"):
        contacts(SHAPES[:2], SHAPES[:2], EYE, np.array([EYE] * 3))
    for bad in (None, "box", [SHAPES[0], None], [[SHAPES[0]]]):
        with pytest.raises(InvalidArgument, match="B must be a shape"):
            contacts(SHAPES[0], bad, EYE, EYE)
    with pytest.raises(InvalidPose, match=r"X_WB\[1\]"):
        collide.contacts(SHAPES[0], SHAPES[1], EYE, np.array([EYE, EYE * np.nan]))


def test_boxes_are_prepared_for_single_calls_by_their_first_contacts():
    """Though `distance`, which prepares other pairs, is not asked for their rows."""
    A, B, X_WB = Box(1, 1, 1), Box(0.5, 0.6, 0.7), pose((0.1, 0.2, 0.849), rpy=(0, 0, 0.3))
    first = contacts(A, B, EYE, X_WB)
    assert prepared_pair(A, B).contacts(EYE, X_WB, 8, 0.0) is not None
    assert len(first) > 2 and first.rows.tobytes() == contacts(A, B, EYE, X_WB).rows.tobytes()


def test_any_number_of_contacts_may_be_asked_for():
    """Numbers beyond what a patch can have stand for all: the long way (first call) and the prepared one agree."""
    shapes = collide.Box((1, 1, 1)), collide.Box((1, 1, 1))
    X_WB = collide.pose((0.1, 0.2, 1.0))
    rows = [collide.contacts(*shapes, np.eye(4), X_WB, max_contacts=n) for n in (10**30, 10**30, 2**31, 2**63, 100)]
    assert len(rows[0]) == 4
    assert all(np.array_equal(r.rows, rows[0].rows) for r in rows)
