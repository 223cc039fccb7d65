"""Parts of a thread's workspace do not overlap, have the room they are asked for, and fill it."""

from __future__ import annotations

import numpy as np
import pytest

from collide.kernels import address_of
from collide.narrowphase import pair_workspace as W
from collide.narrowphase.epa import polytope_surface as E
from collide.narrowphase.exact.depth_requests import ENTRY, REQUESTS
from collide.narrowphase.gap import gap_queue as Q
from collide.narrowphase.gap.precise_pair import LOW_PARTS_OF_PAIR
from collide.narrowphase.gap.tied_vertices import MAX_TIES
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.numerics.double_double import STRIDE
from collide.numerics.exact_dot_sign import PRODUCT_TERMS

pytestmark = pytest.mark.plain_kernels


def test_parts_of_a_workspace():
    doubles, integers = np.zeros(W.DOUBLES), np.zeros(W.INTEGERS, dtype=np.int64)
    work = W.workspace_at(address_of(doubles), address_of(integers))
    for number, (buffer, views) in enumerate([(doubles, (work.points, work.weights)),
                                              (integers, (work.ids, work.request, work.requests))]):
        for k, view in enumerate(views, start=1):
            assert not np.any(view), "another view has written here"
            view[:] = k + 10 * number
        assert len(np.unique(buffer)) == len(views) + 1
    assert len(work.points) >= 5 * POINT and len(work.weights) == 10 and len(work.ids) == 10
    assert len(work.request) == ENTRY and len(work.requests) == REQUESTS

    def view(buffer, at: int, n: int) -> np.ndarray:
        first = (at - address_of(buffer)) // 8
        assert first >= 0 and first + n <= len(buffer) and (at - address_of(buffer)) % 8 == 0
        return buffer[first : first + n]

    parts = [
        view(doubles, work.fine_at, 5 * STRIDE + LOW_PARTS_OF_PAIR), view(doubles, work.epa_at, E.DOUBLES),
        view(doubles, work.queue_at, Q.QUEUE_DOUBLES), view(integers, work.nearest_at, 6),
        view(integers, work.ties_at, max(MAX_TIES + 1, PRODUCT_TERMS)),
        view(integers, work.epa_integers_at, E.INTEGERS), view(integers, work.queue_integers_at, Q.QUEUE_INTEGERS),
    ]
    for part in parts:
        assert not part.any(), "another part has been here"
        part[:] = 99
    assert integers[W.REQUESTS_AT] == work.requests[0] and doubles[-1] == 99, "the last double is in use"


def test_surfaces_of_epa_do_not_overlap():
    """Nine views, and three more behind them, in as many numbers as they say."""
    doubles, integers = np.zeros(E.DOUBLES), np.zeros(E.INTEGERS, dtype=np.int64)
    at = address_of(doubles), address_of(integers)
    for k, view in enumerate([*E.surface_at(*at), *E.fine_surface_at(*at)], start=1):
        assert not view.any()
        view[:] = k
    assert doubles.all() and integers.all()
