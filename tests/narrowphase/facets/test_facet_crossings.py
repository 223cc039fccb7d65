"""Facets that clearly cross: what doubles say of them against the exact common piece, and how many they settle."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from mesh_shapes import bumpy_sphere

import collide
from collide.narrowphase.facets.facet_crossings import PROMISE, facet_crossings
from collide.narrowphase.facets.facet_geometry import FacetCorners
from collide.narrowphase.facets.facet_queries import all_hits
from collide.numerics.exact_points import on_one_grid, placed
from collide.surface_queries.overlay import common_piece


def _cases(rng, n: int):
    """Facets at random, on a lattice, nearly equal, and thin; poses turned."""
    A, B = rng.normal(size=(2, n, 3, 3))
    A[1::4], B[1::4] = np.round(2.0 * A[1::4]), np.round(2.0 * B[1::4])
    B[2::4] = A[2::4] + 1e-9 * rng.normal(size=B[2::4].shape)
    A[3::4] *= (1.0, 1.0, 1e-6)
    poses = [np.array([collide.pose(0.3 * rng.normal(size=3), rpy=rng.normal(size=3)) for _ in range(n)])
             for _ in range(2)]
    poses[0][1::4] = poses[1][1::4] = poses[1][2::4] = np.eye(4)
    poses[0][2::4] = np.eye(4)
    return A, B, *poses


def _exact_ends(A, B, X, Y) -> list[list[Fraction]]:
    (a, b), grid = on_one_grid(placed(X, A), placed(Y, B))
    unit = Fraction(2) ** grid
    return [[Fraction(x, p[3]) * unit for x in p[:3]] for p in common_piece(a, b)]


def test_clear_crossings_are_segments_with_these_ends():
    A, B, X, Y = _cases(np.random.default_rng(3), 400)
    found = facet_crossings(A, B, X, Y)
    for k in np.flatnonzero(found.is_clear | found.is_segment).tolist():
        case = f"A, B = {A[k].tolist()}, {B[k].tolist()}; X, Y = {X[k].tolist()}, {Y[k].tolist()}"
        ends = _exact_ends(A[k], B[k], X[k], Y[k])
        assert len(ends) == 2, case
        off = [max(abs(Fraction(c) - e) for c, e in zip(place, end)) for place, end in _in_order(found.place[k], ends)]
        assert max(off) <= found.error[k] * (1 if found.is_clear[k] else 16), case
        for end, slot in enumerate(found.slots[k].tolist()):  # on the edge that is named
            corners, pose = (A[k], X[k]) if slot < 3 else (B[k], Y[k])
            p, q = (pose[:3, :3] @ corners[i % 3] + pose[:3, 3] for i in (slot % 3, slot % 3 + 1))
            assert np.linalg.norm(np.cross(found.place[k, end] - p, q - p)) < 1e-9 * max(1.0, np.ptp([p, q])), case
    assert 40 < found.is_clear.sum() < 200
    assert not found.is_clear[2::4].any()  # nearly in one plane


def _in_order(places, ends):
    """The two ends found, each with that of the exact ones which is nearer."""
    first = sum((Fraction(c) - e) ** 2 for c, e in zip(places[0], ends[0]))
    second = sum((Fraction(c) - e) ** 2 for c, e in zip(places[0], ends[1]))
    return list(zip(places, ends if first <= second else ends[::-1]))


def test_doubles_settle_what_crosses_clearly():
    """Once their bound was read 16 times too wide, and integers worked all of it out."""
    A, B = (collide.Mesh(*bumpy_sphere(1000, seed)) for seed in (0, 1))
    X, Y = np.eye(4), collide.pose((0.9, 0.3, 0.2), rpy=(0.3, 0.5, 0.7))
    pairs = all_hits(A.tree, B.tree, X, Y).pairs
    corners = FacetCorners(A.tree)[pairs[:, 0]], FacetCorners(B.tree)[pairs[:, 1]]
    found = facet_crossings(*corners, *(np.repeat(pose[None], len(pairs), axis=0) for pose in (X, Y)))
    assert len(pairs) > 100 and found.is_clear.all()
    assert 0.5 * len(pairs) < found.is_segment.sum()
    largest = np.maximum(np.abs(corners[0] @ X[:3, :3].T).max(axis=(1, 2)), 1.0)
    assert (found.error[found.is_segment] <= 4.0 * PROMISE * largest[found.is_segment]).all()
