"""Crossings of rounded solids, asked of few facets: the same as among all pairs, in integers."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive_triangles import as_integers, cross, inner, minus, triangles_meet, world_points

import collide
from collide.solids import clean_mesh, rounded_crossings
from collide.solids.arrangement import crossings_of


def crossing_in_integers(mesh) -> list:
    """Pairs i < j of facets of a mesh that share more than corners and edges."""
    points = as_integers(world_points(mesh.vertices, np.eye(4)))[0]
    corners = [[points[v] for v in f] for f in mesh.faces.tolist()]
    low, high = mesh.vertices[mesh.faces].min(axis=1), mesh.vertices[mesh.faces].max(axis=1)
    meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    return [(i, j) for i, j in np.argwhere(np.triu(meet, 1)).tolist() if _shares_more(corners[i], corners[j])]


def _shares_more(P, Q) -> bool:
    common = [p for p in P if p in Q]
    if len(common) > 2:
        return True
    if len(common) == 2:
        x, y = (next(p for p in T if p not in common) for T in (P, Q))
        n, k = (cross(minus(common[1], common[0]), minus(p, common[0])) for p in (x, y))
        return cross(n, k) == [0, 0, 0] and inner(n, k) > 0
    if len(common) == 1:
        (a, b), (c, d) = ([p for p in T if p not in common] for T in (P, Q))
        return triangles_meet([a, b, b], Q) or triangles_meet([c, d, d], P)
    return triangles_meet(P, Q)


def solids_in_touch(rng):
    """Two solids and poses: in one turned frame, an ulp from flush, far from the origin, or anywhere."""
    X = collide.pose(rng.uniform(-1, 1, 3) * rng.choice([0.0, 1.0, 1e3]), rpy=rng.uniform(-3, 3, 3))
    Y = X.copy()
    if rng.random() < 0.5:
        Y[:3, 3] += X[:3, :3] @ rng.choice([0.0, 0.5, 1.0], 3)
        return collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), X, Y
    A, B = (
        collide.Box(rng.integers(1, 5, 3) * 0.25) if rng.random() < 0.5
        else collide.Mesh(*bumpy_sphere(int(rng.choice([16, 40])), int(rng.integers(9))), solid=True)
        for _ in range(2)
    )
    Y[:3, 3] += X[:3, :3] @ (rng.integers(-4, 5, 3) * 0.25)
    Y[:3, 3] += np.spacing(Y[:3, 3]) * rng.integers(-2, 3, 3)
    if rng.random() < 0.3:
        Y[:3, :3] = collide.pose(rpy=rng.uniform(-3, 3, 3))[:3, :3]
    return A, B, X, Y


@pytest.mark.slow
def test_crossings_are_those_of_all_pairs_in_integers(monkeypatch):
    """What is asked leaves facets out in most results, also in rounds where facets cross."""
    asked_of = []

    def judged(mesh, asked):
        made = ask(mesh, asked)
        if asked is not None:
            want = crossing_in_integers(mesh)
            assert list(map(tuple, made.tolist())) == want, (seed, np.flatnonzero(asked).tolist())
            asked_of.append((len(asked) - int(asked.sum()), len(want)))
        return made

    ask = clean_mesh.rounded_crossings
    monkeypatch.setattr(rounded_crossings, "_MIN_FACETS", 0)
    monkeypatch.setattr(clean_mesh, "rounded_crossings", judged)
    for seed in range(300):
        rng = np.random.default_rng(seed)
        A, B, X, Y = solids_in_touch(rng)
        collide.boolean(A, B, X, Y, str(rng.choice(["union", "union", "difference", "intersection"])))
    passed, crossing = np.array(asked_of).T
    assert len(asked_of) > 130 and (passed > 0).mean() > 0.5 and (crossing > 0).sum() > 5, (
        len(asked_of), (passed > 0).mean(), (crossing > 0).sum()
    )


def test_facets_whose_boxes_meet_those_of_facets_asked_are_taken():
    """None is lost, and where facets are of one size few others are taken."""
    rng = np.random.default_rng(5)
    others = lost = 0
    for case in range(80):
        n = int(rng.integers(20, 400))
        size = 0.05 * 10.0 ** (rng.uniform(-2, 1.5, (n, 1, 1)) * (case % 2))
        corners = rng.uniform(0, 1, (n, 1, 3)) * rng.choice([1.0, 1.0, 1e-9], 3) + size * rng.normal(size=(n, 3, 3))
        vertices, faces = corners.reshape(-1, 3), np.arange(3 * n, dtype=np.int32).reshape(-1, 3)
        asked = rng.random(n) < rng.choice([0.02, 0.3])
        low, high = corners.min(axis=1), corners.max(axis=1)
        meets = ((low[:, None] <= high[asked]) & (low[asked] <= high[:, None])).all(axis=2).any(axis=1)
        taken = rounded_crossings._with_near(vertices, faces, asked)
        assert (taken >= meets).all() and (taken >= asked).all(), (case, np.flatnonzero(meets & ~taken).tolist())
        others += int((meets & ~asked).sum())
        lost += int((~taken).sum()) if case % 2 == 0 else 0
    assert others > 500 and lost > 3000, (others, lost)


def test_large_solids_are_asked_in_part():
    """No box-tree of the whole solid is made, and the solid is clean."""
    A, B = (collide.Mesh(*bumpy_sphere(3000, seed), solid=True) for seed in (0, 1))
    Y = collide.pose((0.9, 0.3, 0.2), rpy=(0.3, 0.5, 0.7))
    made = collide.boolean(A, B, np.eye(4), Y, "union")
    assert not len(crossings_of(made.mesh)) and not hasattr(collide.boolean(A, B, np.eye(4), Y, "union").mesh, "_tree")


def test_poses_that_shrink_or_lose_a_direction_ask_all():
    size = rounded_crossings._inverse_size
    rng = np.random.default_rng(3)
    for _ in range(50):
        R = np.eye(4)
        R[:3, :3] = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-6, 6)
        C = np.linalg.inv(R[:3, :3])
        assert np.abs(C).sum(axis=1).max() * (1.0 - 1e-9) <= size(R)
    R[:3, 0] = 0.0
    assert size(R) == np.inf
