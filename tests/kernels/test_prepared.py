"""Kernels bound to a header: what is no matrix as they read it is left to the long way, and nothing is written then."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.lowering.facet_bodies import body_of
from collide.narrowphase.facets.facet_kernel_calls import SinglePair
from collide.results import PAIR_DTYPE

EYE = np.eye(4)
FAR = collide.pose((5, 0, 0))


@pytest.fixture(scope="module")
def pair() -> SinglePair:
    mesh = collide.Mesh(np.eye(3), [[0, 1, 2]], solid=False)
    return SinglePair(body_of(mesh), body_of(collide.Box((1, 1, 1))))


def misaligned() -> np.ndarray:
    return np.frombuffer(b"\0" * 4 + EYE.tobytes(), dtype=np.uint8)[4:].view(np.float64).reshape(4, 4)


@pytest.mark.parametrize(
    "X",
    [EYE.tolist(), EYE.astype(np.float32), np.asfortranarray(collide.pose((1, 2, 3))), np.stack([EYE] * 2)[:, :3],
     np.zeros((2, 4, 4)), np.eye(8)[::2, ::2], np.eye(3), None, EYE.astype(">f8")],
    ids=range(9),
)
def test_what_is_left_to_the_long_way(pair, X):
    assert pair.collide(X, EYE) is None and pair.collide(EYE, X) is None
    assert pair.distance(X, FAR, True, np.inf) is None and pair.distance(EYE, X, True, np.inf) is None


def test_matrices_are_answered(pair):
    assert pair.collide(EYE, EYE) is True and pair.collide(EYE, FAR) is False
    row = pair.distance(EYE, FAR, True, np.inf)
    assert row.dtype == PAIR_DTYPE and row.shape == (1,) and not row["hit"][0] and row["distance"][0] > 3
    read_only = FAR.copy()
    read_only.flags.writeable = False
    assert pair.collide(EYE, read_only) is False


def test_poses_that_are_none_are_left_to_whoever_says_so(pair):
    for X in (2 * EYE, np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0])):
        assert pair.collide(EYE, X) is None and pair.distance(EYE, X, False, np.inf) is None
