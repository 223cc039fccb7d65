"""Distances of two posed surfaces: brackets, witnesses and facets against brute force in rational numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_families import FAMILIES, random_pose, soup
from mesh_shapes import bumpy_sphere
from naive_triangles import surface_distance

from collide.kernels import address_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh_slabs import make_slabs
from collide.narrowphase.facets.facet_queries import HEAP, stack_of, surface_distances, workspace
from collide.narrowphase.facets.surface_distance import (
    DISTANCE,
    IN_FULL,
    LOWER,
    MARKS,
    NODES,
    RESULT,
    TRIANGLES,
    UPPER,
    near_surfaces,
)


def spread_apart(rng, case):
    """The same meshes, B moved out of A's way by anything from nothing to far."""
    (va, fa), (vb, fb), X, Y = case
    size = max(np.abs(va).max(), np.abs(vb).max())
    Y = Y.copy()
    Y[:3, 3] += rng.normal(size=3) * size * rng.choice([0.0, 1.0, 3.0, 30.0])
    return (va, fa), (vb, fb), X, Y


def off_triangle(point, corners):
    """How far a point is from a triangle, by a fine look in doubles."""
    best = min(np.linalg.norm(point - c) for c in corners)
    for k in range(3):
        a, e = corners[k], corners[(k + 1) % 3] - corners[k]
        if e.any():
            best = min(best, np.linalg.norm(point - a - e * np.clip(np.sum((point - a) * e) / np.sum(e * e), 0, 1)))
    u, v, w = corners[1] - corners[0], corners[2] - corners[0], point - corners[0]
    n = np.cross(u, v)
    if n.any():
        beta, gamma = np.sum(np.cross(w, v) * n) / np.sum(n * n), np.sum(np.cross(u, w) * n) / np.sum(n * n)
        if beta >= 0 and gamma >= 0 and beta + gamma <= 1:
            best = min(best, abs(np.sum(n * w)) / np.linalg.norm(n))
    return best


@pytest.mark.parametrize("family", FAMILIES)
def test_brackets_hold_the_distance(family):
    make, _ = FAMILIES[family]
    rng = np.random.default_rng([8, *family.encode()])
    met = cases = 0
    for case in range(16):
        (va, fa), (vb, fb), X, Y = spread_apart(rng, make(rng))
        fa, fb = fa[:8], fb[:8]
        A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
        r = surface_distances(A, B, X, Y)
        square, pairs = surface_distance(va, fa, X, vb, fb, Y)
        asked = (va.tolist(), fa.tolist(), X.tolist(), vb.tolist(), fb.tolist(), Y.tolist())
        told = f"{family} {case}: va, fa, X, vb, fb, Y = {asked}"
        lower, distance, upper = (Fraction(float(v[0])) for v in (r.lower, r.distance, r.upper))
        assert lower**2 <= square <= upper**2 and lower <= distance <= upper, told
        assert r.meets[0] == (square == 0), told
        size = sum(np.abs(X[:3, :3]).sum() * np.abs(v).max() + np.abs(X[:3, 3]).max() for v, X in ((va, X), (vb, Y)))
        assert float(upper - lower) <= 2.0**-43 * size, told
        corners_a = va[fa[r.facets[0, 0]]] @ X[:3, :3].T + X[:3, 3]
        corners_b = vb[fb[r.facets[0, 1]]] @ Y[:3, :3].T + Y[:3, 3]
        assert off_triangle(r.point_a[0], corners_a) <= 1e-14 * size, told
        assert off_triangle(r.point_b[0], corners_b) <= 1e-14 * size, told
        gap = r.point_b[0] - r.point_a[0]
        assert np.abs(gap - r.distance[0] * r.normal[0]).max() <= 1e-14 * size, told
        if square == 0:
            assert tuple(r.facets[0]) in pairs, told
        swapped = surface_distances(B, A, Y, X)
        if A.content != B.content or not (X == Y).all():
            assert swapped.distance == r.distance and np.array_equal(swapped.point_a, r.point_b), told
            assert np.array_equal(swapped.normal, -r.normal), told
        met += square == 0
        cases += 1
    assert 0 < met < cases, f"{family}: {met} of {cases} meet"


def test_limits_and_batches():
    rng = np.random.default_rng(9)
    (va, fa), (vb, fb) = soup(rng, 80), soup(rng, 70)
    A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
    Xs = np.stack([random_pose(rng, 3.0) for _ in range(20)])
    Y = random_pose(rng, 3.0)
    r = surface_distances(A, B, Xs, Y)
    assert 0 < r.meets.sum() < 20
    limit = float(np.median(r.distance[~r.meets]))
    near = surface_distances(A, B, Xs, Y, limit)
    for k in range(20):
        one = surface_distances(A, B, Xs[k], Y)
        for name in r._fields:
            assert np.array_equal(getattr(one, name)[0], getattr(r, name)[k]), name
        if r.distance[k] < limit:
            assert near.distance[k] == r.distance[k] and near.meets[k] == r.meets[k]
        else:
            assert near.facets[k].tolist() == [-1, -1] and near.lower[k] == limit and near.upper[k] == np.inf


def test_nothing_near_is_left_out():
    """Distances of whole meshes are the least of those of their facets one by one, for which no box is ever parted."""
    rng = np.random.default_rng(13)
    for n, away in ((90, 0.0), (90, 1.2), (60, 4.0), (90, 1.0)):
        (va, fa), (vb, fb) = bumpy_sphere(n, n), bumpy_sphere(n, n + 1)
        X, Y = random_pose(rng), random_pose(rng)
        Y[:3, 3] = X[:3, 3] + away * 2.2 * X[:3, 0]
        if away == 0.0:
            vb = vb * 0.2  # inside
        r = surface_distances(build_mesh_tree(va, fa), build_mesh_tree(vb, fb), X, Y)
        ones_a, ones_b = ([build_mesh_tree(v, f[None]) for f in faces] for v, faces in ((va, fa), (vb, fb)))
        least = min(surface_distances(a, b, X, Y).distance[0] for a in ones_a for b in ones_b)
        assert r.lower[0] <= least <= r.upper[0] and abs(r.distance[0] - least) <= 1e-14 * (1 + least)
        assert not r.meets[0]


def near(A, B, X, Y, limit: float, enough: float) -> tuple[np.ndarray, np.ndarray]:
    """(results, marks) of one pair of poses."""
    for tree in (A, B):
        tree.need_slabs(make_slabs)
    work, results, marks = workspace(stack_of(A, B)), np.zeros(RESULT), np.zeros(MARKS, dtype=np.int64)
    X, Y = (np.ascontiguousarray(Z, dtype=np.float64) for Z in (X, Y))
    done = near_surfaces(
        A.address, B.address, address_of(X), 0, address_of(Y), 0, 1, False, limit, enough, address_of(results),
        address_of(marks), *work.addresses[:2], work.heap_address, HEAP, *work.addresses[2:],
    )
    assert done == 1
    return results, marks


def test_a_search_ends_as_soon_as_what_it_found_is_enough():
    """Then it looked at a few facets, whatever the size of the bodies; where nothing is near enough, the result is that
    of a search to the end, bit by bit."""
    rng = np.random.default_rng(21)
    ended = asked = 0
    for n in (60, 600, 2400):
        A, B = build_mesh_tree(*bumpy_sphere(n, 1)), build_mesh_tree(*bumpy_sphere(n, 2))
        for away in (2.5, 4.0):
            X, Y = random_pose(rng), random_pose(rng)
            Y[:3, 3] = X[:3, 3] + away * X[:3, 0]
            full, marks = near(A, B, X, Y, np.inf, IN_FULL)
            for share in (0.5, 0.999, 1.0 + 1e-12, 1.02, 1.5, 30.0):
                enough = share * full[DISTANCE]
                found, looked_at = near(A, B, X, Y, np.inf, enough)
                asked += 1
                if full[UPPER] <= enough:
                    ended += 1
                    assert full[LOWER] <= found[DISTANCE] <= found[UPPER] <= enough and found[LOWER] == 0.0
                    assert looked_at[TRIANGLES] <= marks[TRIANGLES]
                else:
                    assert np.array_equal(found, full) and np.array_equal(looked_at, marks)
            assert looked_at[TRIANGLES] <= 64 and looked_at[NODES] <= 16, (n, away, looked_at.tolist())
    assert 0.4 * asked < ended < 0.9 * asked, (ended, asked)
