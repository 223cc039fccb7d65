"""Coarse points: the farthest along a spiral of directions of the cloud stretched to a cube, by numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import rng_of
from reproduction import reproducing

from collide.kernels import address_of
from collide.support.coarse_points import COARSE, choose_coarse

SOURCE = "points = {points}  # tests/support/test_coarse_points.py"


def spiral() -> np.ndarray:
    """Directions at equal heights, each the golden angle on from the last."""
    heights = (2 * np.arange(COARSE) + 1) / COARSE - 1.0
    angles = np.arange(COARSE) * math.pi * (3.0 - math.sqrt(5.0))
    radii = np.sqrt(1.0 - heights**2)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles), heights])


def chosen(points) -> tuple[int, np.ndarray, np.ndarray]:
    points, block = np.ascontiguousarray(points, dtype=float), np.full(4 * COARSE, np.nan)
    n = choose_coarse(address_of(points), len(points), address_of(block))
    return n, block[: 3 * COARSE].reshape(3, COARSE).T, block[3 * COARSE :].view(np.int64)


@pytest.mark.parametrize("n", [1, 2, 20, 64, 500])
@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (1e3, 1.0, 1e-3), (1.0, 1.0, 0.0)])
def test_farthest_points(n, stretch):
    rng = rng_of("coarse points", n, stretch)
    points = rng.normal(size=(n, 3)) * stretch + rng.normal(size=3)
    with reproducing(SOURCE, points=points):
        different, coordinates, ids = chosen(points)
        assert (coordinates == points[ids]).all()
        assert len(set(ids[:different].tolist())) == different == len(set(ids.tolist()))
        extent = np.ptp(points, axis=0)
        cube = (points - 0.5 * (points.min(axis=0) + points.max(axis=0))) / np.where(extent > 0, extent, 1.0)
        values = cube @ spiral().T
        # Each direction's farthest point is there, and each point is the farthest one of some direction.
        assert (values[ids].max(axis=0) >= values.max(axis=0) - 1e-12).all()
        assert all((values[k] >= values.max(axis=0) - 1e-12).any() for k in ids.tolist())
        # What stands behind the different ones are repetitions, in the order of directions.
        farthest = values.argmax(axis=0)
        if n != 2:  # of two, some directions have none that is farther
            assert ids[different:].tolist() == farthest[: COARSE - different].tolist()
            assert ids[:different].tolist() == list(dict.fromkeys(farthest.tolist()))


def test_all_different_where_there_are_enough():
    """Of a sphere's points nearly every direction has its own."""
    points = rng_of("coarse sphere").normal(size=(4000, 3))
    assert chosen(points / np.linalg.norm(points, axis=1)[:, None])[0] == COARSE
