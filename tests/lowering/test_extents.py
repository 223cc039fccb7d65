"""How far packed shapes reach along directions, against the formulas of the shapes that they were packed from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import KINDS, extent_along, one_of_each, random_pose, rng_of, spell, unit
from reproduction import reproducing

from collide.lowering.extents import extent_of
from collide.lowering.parts import parts_of


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"Halfspace"}))
def test_extents(kind):
    """The greatest of a body's parts, at any pose, also at matrices that stretch."""
    rng = rng_of("extents", kind)
    for k in range(40):
        shape, X = one_of_each(rng)[kind], random_pose(rng, 2.0)
        n = unit(rng.normal(size=3)) if k % 4 else np.eye(3)[k % 3]
        if k % 3 == 0:
            X[:3, :3] = X[:3, :3] @ np.diag(rng.uniform(0.5, 2.0, 3)) if kind != "Compound" else X[:3, :3]
        with reproducing("shape, X, n = {shape}, {X}, {n}", shape=spell(shape), X=X, n=n):
            found = max(extent_of(packed, X @ X_SP, n) for packed, X_SP in parts_of(shape))
            assert abs(found + extent_along(shape, X, -n)) <= 1e-14 * 8


def test_halfspaces_have_none():
    rng = rng_of("extents of halfspaces")
    ((packed, _),) = parts_of(one_of_each(rng)["Halfspace"])
    assert extent_of(packed, np.eye(4), unit(rng.normal(size=3))) == math.inf
