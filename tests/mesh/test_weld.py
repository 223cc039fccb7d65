"""Vertices with equal coordinates, against a dictionary."""

from __future__ import annotations

import numpy as np
import pytest
from naive import rng_of

from collide.mesh import weld as module
from collide.mesh.weld import weld


def by_dictionary(points: np.ndarray) -> list[int]:
    seen: dict = {}
    return [seen.setdefault(tuple(point), k) for k, point in enumerate((points + 0.0).tolist())]


@pytest.mark.parametrize(
    "kind", ["lattice", "all different", "all the same", "one apart by an ulp", "signed zeros", "huge and tiny"]
)
def test_first_rows(kind):
    rng = rng_of("weld", kind)
    shares = []
    for n in (1, 2, 3, 17, 300):
        points = {
            "lattice": rng.integers(-2, 3, size=(n, 3)) * 0.1,
            "all different": rng.normal(size=(n, 3)),
            "all the same": np.full((n, 3), 1 / 3),
            "one apart by an ulp": np.nextafter(1 / 3, np.where(rng.random((n, 3)) < 0.1, 1.0, 1 / 3)),
            "signed zeros": rng.choice([0.0, -0.0], size=(n, 3)),
            "huge and tiny": rng.choice([5e-324, -5e-324, 1e308, 0.0], size=(n, 3)),
        }[kind]
        first = weld(points)
        assert first.dtype == np.int32 and first.tolist() == by_dictionary(points), points.tolist()
        shares.append((first != np.arange(n)).mean())
    assert max(shares) > 0.1 or kind == "all different"


@pytest.mark.plain_kernels
def test_hashes_spread():
    """Coordinates of a lattice differ in few bits: their hashes still fill a table about as chance would."""
    hashes = set()
    bits = (np.arange(4096) * 0.125).view(np.int64).tolist()
    for value in bits:
        h = module._mix(0, value)
        assert 0 <= h < 2**31
        hashes.add(h & 8191)
    assert len(hashes) > 0.9 * 8192 * (1 - np.exp(-0.5)), len(hashes)
