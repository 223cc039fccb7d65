"""Winding numbers of `solid_membership.py` against those of `naive_triangles.py`, on and next to triangles."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import solid_membership
from naive_triangles import as_integers, winding
from solid_membership import as_doubles, windings


def tetrahedra(rng, kind: str) -> list:
    """Triangles of two to four tetrahedra, some turned over: corners on a grid, thirds of them, or any; large or small
    by powers of two."""
    triangles, many = [], rng.integers(2, 5)
    scale = Fraction(2) ** int(rng.choice([0, 0, -900, 300]))
    while len(triangles) < 4 * many:
        corners = rng.integers(0, 4, (4, 3)) if kind != "any" else rng.normal(size=(4, 3))
        if abs(np.linalg.det(corners[1:] - corners[0])) < 1e-6:
            continue
        exact = [[Fraction(v) * scale / (3 if kind == "thirds" else 1) for v in p] for p in corners.tolist()]
        triangles += [[exact[k] for k in t] for t in ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))]
    return triangles


def points_of(rng, triangles: np.ndarray, n: int) -> np.ndarray:
    """On corners, edges and triangles as near as doubles come, up to two units in the last place beside, and around."""
    weights = rng.integers(0, 3, (n, 3)) + 1e-300
    near = (triangles[rng.integers(len(triangles), size=n)] * weights[:, :, None]).sum(axis=1)
    near /= weights.sum(axis=1)[:, None]
    near += rng.integers(-2, 3, near.shape) * rng.choice([0, 0, 1], (n, 1)) * np.spacing(np.abs(near))
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    return np.concatenate([near, low + (high - low) * rng.random((n // 2, 3))])


@cache
def cases() -> list:
    """(seed and kind, triangles, points, numbers in integers)."""
    made = []
    for seed in range(18):
        rng = np.random.default_rng(seed)
        kind = ("grid", "thirds", "any")[seed % 3]
        corners = tetrahedra(rng, kind)
        points = points_of(rng, as_doubles(corners), 24)
        # times three, for `as_integers` multiplies by a power of two
        listed = [[[3 * Fraction(v) for v in p] for p in some]
                  for some in ([p for t in corners for p in t], points.tolist())]
        whole, at = as_integers(*listed)
        truth = [winding([whole[k : k + 3] for k in range(0, len(whole), 3)], p) for p in at]
        made.append((f"default_rng({seed}), {kind!r}", corners, points, truth))
    return made


def disagreements() -> tuple[list[str], Counter]:
    """(cases where the numbers differ, what the numbers were)."""
    wrong, seen = [], Counter()
    for name, corners, points, truth in cases():
        numbers = windings(corners, points)
        seen.update(truth)
        wrong += [f"{name}, {p.tolist()}: {a}, not {b}" for p, a, b in zip(points, numbers, truth) if a != b]
    return wrong, seen


def test_numbers_are_those_of_integers():
    wrong, seen = disagreements()
    assert not wrong, wrong[:5]
    assert min(seen[None], seen[0], seen[1] + seen[-1]) > 50 and min(seen[1], seen[-1], seen[2] + seen[-2]) > 5, seen
    assert windings([], np.zeros((2, 3))) == [0, 0]


@pytest.mark.parametrize("fault", ["no error is allowed for", "nothing is exact", "a triangle is lost"])
def test_faults_are_noticed(monkeypatch, fault):
    if fault == "no error is allowed for":
        monkeypatch.setattr(solid_membership, "_U", 0.0)
    elif fault == "nothing is exact":
        monkeypatch.setattr(solid_membership._Surface, "_exact", lambda self, j, point, ray: 0)
    else:
        near = solid_membership._Surface._near
        monkeypatch.setattr(solid_membership._Surface, "_near", lambda *some: tuple(ids[1:] for ids in near(*some)))
    assert disagreements()[0]


def test_what_has_no_area_encloses_nothing():
    """Two facets that are segments stand in a wall of a box: points on the segment are on the wall, points beside are
    not."""
    corners = [[[Fraction(v) for v in p] for p in t] for t in (
        ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 0, 0), (0, 0, 1), (1, 0, 0)), ((0, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((1, 0, 0), (0, 0, 1), (0, 1, 0)), ((1, 0, 0), (2, 0, 0), (3, 0, 0)), ((3, 0, 0), (2, 0, 0), (1, 0, 0)),
    )]
    at = np.array([[0.5, 0, 0], [2.5, 0, 0], [0.1, 0.1, 0.1], [0.1, 0.1, -1.0], [4.0, 0.0, 0.0]])
    assert windings(corners, at)[0] is None and windings(corners, at)[1] == 0
    assert abs(windings(corners, at)[2]) == 1 and windings(corners, at)[3:] == [0, 0]
