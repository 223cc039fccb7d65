"""Kernels bound to a header: what is no matrix as they read it is left to the long way, and nothing is written then."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.lowering.facet_bodies import body_of
from collide.narrowphase.facets.facet_kernel_calls import prepared_facets
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE

EYE = np.eye(4)
FAR = collide.pose((5, 0, 0))


@pytest.fixture(scope="module")
def pair() -> Prepared:
    mesh = collide.Mesh(np.eye(3), [[0, 1, 2]], solid=False)
    return prepared_facets(body_of(mesh), body_of(collide.Box((1, 1, 1))))


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
    assert _row(pair, X, FAR, True) is None and _row(pair, EYE, X, True) is None


def test_matrices_are_answered(pair):
    assert pair.collide(EYE, EYE) is True and pair.collide(EYE, FAR) is False
    row = _row(pair, EYE, FAR, True)
    assert row is not None and not row["hit"] and row["distance"] > 3
    read_only = FAR.copy()
    read_only.flags.writeable = False
    assert pair.collide(EYE, read_only) is False


def test_poses_that_are_none_are_left_to_whoever_says_so(pair):
    for X in (2 * EYE, np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0])):
        assert pair.collide(EYE, X) is None and _row(pair, EYE, X, False) is None


def _row(pair: Prepared, X_WA, X_WB, depths: bool) -> np.void | None:
    memory = bytearray(PAIR_DTYPE.itemsize)
    if pair.distance(X_WA, X_WB, memory, depths, np.inf) is None:
        assert not any(memory), "the row is written"
        return None
    return np.frombuffer(memory, PAIR_DTYPE)[0]
