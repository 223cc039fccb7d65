"""Pairs of curved sets that C leaves open and Python decides: C says so, and never a wrong sign that is proven."""

from __future__ import annotations

import c_library as c
import numpy as np
import pytest
from touching_pairs import exact_pair, near_pair

import collide
from collide.kernels import mode
from collide.narrowphase import convex_kernel_calls
from collide.narrowphase.exact_curved.settle_curved import settle_curved
from collide.results import UNDECIDED

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)


def test_c_leaves_open_what_python_decides_by_its_own_integers(monkeypatch):
    monkeypatch.setattr(convex_kernel_calls, "settle_curved", settle_curved)
    rng, asker = np.random.default_rng(6), c.Asker()
    n_open = n_decided = 0
    for k in range(80):
        pair = (exact_pair if k % 2 else near_pair)(rng)
        A, B = c.CShape(pair.A), c.CShape(pair.B)
        status, row = asker.distance(A, B, pair.X_WA, pair.X_WB)
        known = collide.distance(pair.A, pair.B, pair.X_WA, pair.X_WB)
        assert status == 0 and known.how != UNDECIDED, pair
        if row["how"] == UNDECIDED:
            n_open += 1
            assert row["hit"] == 1 and row["certified"] == 0 and row["lower"] <= known.upper, pair
        else:
            n_decided += 1
            assert row["hit"] == known.hit, pair
    assert n_open >= 15 and n_decided >= 15
