"""Overlaps of many shells against closed forms in fractions: brackets in doubles, and in integers where asked."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from mesh_shapes import box
from solid_families import joined

import collide
from collide.errors import InvalidArgument
from collide.solids import triangle_sums

I = np.eye(4)


def shells(n: int, seed: int, far: float) -> tuple[np.ndarray, np.ndarray]:
    """(low, high) (n³, 3) of boxes apart from one another, a step of 1 m, around a point far away."""
    rng = np.random.default_rng(seed)
    grid = np.array(list(product(range(n), repeat=3)), dtype=float) + far
    return grid - rng.uniform(0.1, 0.4, grid.shape), grid + rng.uniform(0.1, 0.4, grid.shape)


def mesh_of(low: np.ndarray, high: np.ndarray) -> collide.Mesh:
    return collide.Mesh(*joined(*(box(a, b) for a, b in zip(low, high))))


def truth(a: tuple, b: tuple, shift) -> tuple[Fraction, list[Fraction]]:
    """(volume, moments) that boxes a share with boxes b, moved by a shift."""
    total, moments = Fraction(0), [Fraction(0)] * 3
    near = np.ones((len(a[0]), len(b[0])), dtype=bool)
    for k in range(3):
        near &= (a[0][:, None, k] <= b[1][:, k] + shift[k] + 1e-6) & (a[1][:, None, k] >= b[0][:, k] + shift[k] - 1e-6)
    for i, j in np.argwhere(near).tolist():
        ends = [(max(Fraction(a[0][i, k]), Fraction(b[0][j, k]) + Fraction(shift[k])),
                 min(Fraction(a[1][i, k]), Fraction(b[1][j, k]) + Fraction(shift[k]))) for k in range(3)]
        if all(low < high for low, high in ends):
            volume = np.prod([high - low for low, high in ends])
            total += volume
            moments = [m + volume * (low + high) / 2 for m, (low, high) in zip(moments, ends)]
    return total, moments


@pytest.mark.parametrize("far", [0.0, 1000.0])
@pytest.mark.parametrize("seed", range(2))
def test_many_shells_are_known_in_doubles(monkeypatch, seed, far):
    a, b, shift = shells(5, seed, far), shells(5, seed + 10, far), (0.3, -0.21, 0.13)
    A, B, X = mesh_of(*a), mesh_of(*b), collide.pose(shift)
    exact, moments = truth(a, b, shift)
    r = collide.overlap_volume(A, B, I, X, exact=True)
    assert 0 < Fraction(r.lower) <= exact <= Fraction(r.upper) and r.upper - r.lower <= 4 * np.spacing(r.volume)
    np.testing.assert_allclose(r.centroid, [float(m / exact) for m in moments], rtol=1e-14)
    monkeypatch.setattr(triangle_sums, "_exactly", None)
    s = collide.overlap_volume(A, B, I, X)
    assert 0 < Fraction(s.lower) <= exact <= Fraction(s.upper) and s.lower <= s.volume <= s.upper, (seed, far)
    assert s.upper - s.lower < (2e-12 if far == 0.0 else 1e-10) * s.volume
    np.testing.assert_allclose(s.centroid, [float(m / exact) for m in moments], rtol=1e-11)


def test_what_doubles_leave_open_is_added_up_in_integers(monkeypatch):
    asked = []
    exactly = triangle_sums._exactly
    monkeypatch.setattr(triangle_sums, "_exactly", lambda *given: asked.append(1) or exactly(*given))
    cube = collide.Box((1, 1, 1))
    for k, depth in enumerate((0.5, 1e-12)):
        r = collide.overlap_volume(cube, cube, I, collide.pose((0, 0, 1 - depth)))
        assert len(asked) == k
        assert Fraction(r.lower) <= 1 - Fraction(1 - depth) <= Fraction(r.upper)
    with pytest.raises(InvalidArgument, match="exact must be True or False"):
        collide.overlap_volume(cube, cube, I, I, exact="yes")
