"""What pair queries are asked: single pairs, lists and batches, and which lengths do not go together."""

from __future__ import annotations

import numpy as np
import pytest

from collide import Box, InvalidArgument, InvalidPose, ShapeSet, Sphere
from collide.pairs.pair_arguments import asked_poses, pose_at, pose_batch, shape_at

EYE = np.eye(4)
BOX, BALL = Box((1, 1, 1)), Sphere(1.0)
THREE = np.stack([EYE] * 3)


@pytest.mark.parametrize(
    ("A", "B", "X_WA", "X_WB", "lengths", "single"),
    [
        (BOX, BALL, EYE, EYE, (1, 1), True),
        (BOX, BALL, EYE, THREE, (1, 3), False),
        (BOX, BALL, THREE, THREE, (3, 3), False),
        (BOX, BALL, EYE, THREE[:1], (1, 1), False),
        ([BOX] * 3, BALL, EYE, THREE, (1, 3), False),
        ([BOX] * 3, (BALL, BALL, BOX), EYE, EYE, (1, 1), False),
        (ShapeSet([BOX, BALL])[np.array([0, 1, 0])], BALL, THREE, EYE, (3, 1), False),
        (BOX, BALL, EYE, THREE[:0], (1, 0), False),
        ([], BALL, EYE, EYE, (1, 1), False),
    ],
)
def test_what_goes_together(A, B, X_WA, X_WB, lengths, single):
    poses_a, poses_b, is_single = asked_poses(A, B, X_WA, X_WB)
    assert (len(poses_a), len(poses_b)) == lengths and is_single is single
    assert poses_a.shape[1:] == poses_b.shape[1:] == (4, 4) and poses_a.flags.c_contiguous


@pytest.mark.parametrize(
    ("A", "B", "X_WA", "X_WB", "error", "words"),
    [
        (BOX, BALL, THREE, THREE[:2], InvalidArgument, "X_WA 3, X_WB 2; batches must be equally long"),
        ([BOX] * 2, BALL, THREE, EYE, InvalidArgument, "X_WA 3, X_WB 1, A 2"),
        ([BOX], BALL, THREE, EYE, InvalidArgument, "X_WA 3, X_WB 1, A 1"),
        ([BOX] * 2, [BALL] * 3, EYE, EYE, InvalidArgument, "A 2, B 3"),
        (BOX, BALL, THREE[:0], THREE, InvalidArgument, "X_WA 0, X_WB 3"),
        (1.0, BALL, EYE, EYE, InvalidArgument, "A must be a shape, for example .*, got 1.0"),
        (BOX, [BALL, None], EYE, EYE, InvalidArgument, "B must be a shape"),
        (BOX, BALL, np.eye(3)[:2], EYE, InvalidPose, "X_WA"),
    ],
)
def test_what_does_not(A, B, X_WA, X_WB, error, words):
    with pytest.raises(error, match=words):
        asked_poses(A, B, X_WA, X_WB)


def test_arrays_as_they_should_be_are_not_copied_and_others_are_converted():
    X, single = pose_batch(EYE, "X")
    assert np.shares_memory(X, EYE) and single
    X, single = pose_batch(THREE[::-1], "X")
    assert X.flags.c_contiguous and not single
    for given in (EYE.tolist(), EYE.astype(np.float32), (np.eye(3), np.zeros(3))):
        X, single = pose_batch(given, "X")
        assert X.dtype == np.float64 and np.array_equal(X, EYE[None]) and single


def test_of_pair_k():
    X = np.arange(32.0).reshape(2, 4, 4)
    assert np.array_equal(pose_at(X, 1), X[1]) and np.array_equal(pose_at(X[:1], 7), X[0])
    assert shape_at([BOX, BALL], 1) is BALL and shape_at(BOX, 5) is BOX
