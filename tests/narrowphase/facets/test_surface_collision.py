"""Facets of two posed meshes that meet: the walk over their trees against brute force in Python integers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from mesh_families import FAMILIES, random_pose, soup
from naive_triangles import facet_pairs

import collide
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import all_hits, first_hits


@pytest.mark.many(6)
@pytest.mark.parametrize("family", FAMILIES)
def test_all_pairs_are_those_of_brute_force(family):
    make, cases = FAMILIES[family]
    rng = np.random.default_rng([7, *family.encode()])
    met = tested = exact = 0
    for case in range(cases):
        (va, fa), (vb, fb), X, Y = make(rng)
        A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
        found = all_hits(A, B, X, Y)
        want = facet_pairs(va, fa, X, vb, fb, Y)
        asked = (va.tolist(), fa.tolist(), X.tolist(), vb.tolist(), fb.tolist(), Y.tolist())
        told = f"{family} {case}: va, fa, X, vb, fb, Y = {asked}"
        assert list(map(tuple, found.pairs.tolist())) == want, told
        first = first_hits(A, B, X, Y)
        assert len(first.pairs) == bool(want) and set(map(tuple, first.pairs.tolist())) <= set(want), told
        swapped = all_hits(B, A, Y, X)
        assert sorted(map(tuple, swapped.pairs[:, ::-1].tolist())) == want, told
        if A.content != B.content or not (X == Y).all():
            assert np.array_equal(first_hits(B, A, Y, X).pairs[:, ::-1], first.pairs), told
        met += len(want)
        tested += len(fa) * len(fb)
        exact += int(found.counters[0, 2])
    assert 0.002 < met / tested < 0.9, f"{family}: {met} of {tested} pairs meet"
    if family not in ("random", "scaled"):
        assert exact > 20, f"{family}: only {exact} pairs needed integers"


def test_batches_are_their_poses_one_by_one():
    rng = np.random.default_rng(3)
    (va, fa), (vb, fb) = soup(rng, 60), soup(rng, 50)
    A, B = build_mesh_tree(va, fa), build_mesh_tree(vb, fb)
    Xs, Ys = (np.stack([random_pose(rng, 2.0) for _ in range(25)]) for _ in range(2))
    whole = all_hits(A, B, Xs, Ys)
    assert 0 < (np.diff(whole.starts) == 0).sum() < 25
    for k, (begin, end) in enumerate(pairwise(whole.starts)):
        one = all_hits(A, B, Xs[k], Ys[k])
        assert np.array_equal(one.pairs, whole.pairs[begin:end]) and np.array_equal(one.counters[0], whole.counters[k])
    fixed = all_hits(A, B, Xs[3], Ys)
    assert np.array_equal(
        fixed.pairs[fixed.starts[3] : fixed.starts[4]], whole.pairs[whole.starts[3] : whole.starts[4]]
    )


def test_nothing_is_lost_where_there_are_many_pairs():
    """All facets at one place: the output is filled and taken up again many times."""
    n = 300
    rng = np.random.default_rng(4)
    vertices = np.array([[1.0, 0, 0], [-1, 1, 0], [-1, -1, 0]])[None] + 0.01 * rng.normal(size=(n, 3, 3))
    other = vertices[:, :, [2, 0, 1]]
    faces = np.arange(3 * n).reshape(n, 3)
    A, B = build_mesh_tree(vertices.reshape(-1, 3), faces), build_mesh_tree(other.reshape(-1, 3), faces)
    found = all_hits(A, B, np.eye(4), np.stack([np.eye(4)] * 2))
    assert np.array_equal(np.diff(found.starts), [n * n, n * n])
    assert np.array_equal(found.pairs[: n * n], np.stack(np.divmod(np.arange(n * n), n), axis=1))


def test_matrices_that_are_no_rotations_are_used_as_they_stand():
    rng = np.random.default_rng(5)
    met = 0
    for _ in range(6):
        (va, fa), (vb, fb) = soup(rng, 10), soup(rng, 10)
        X, Y = random_pose(rng, 0.3), random_pose(rng, 0.3)
        X[:3, :3] += rng.normal(size=(3, 3)) * 0.2
        Y[:3, :3] *= 3.0
        found = all_hits(build_mesh_tree(va, fa), build_mesh_tree(vb, fb), X, Y)
        want = facet_pairs(va, fa, X, vb, fb, Y)
        assert list(map(tuple, found.pairs.tolist())) == want
        met += len(want)
    assert met > 5
    with pytest.raises(collide.InvalidPose, match="singular"):
        all_hits(build_mesh_tree(va, fa), build_mesh_tree(vb, fb), np.diag([1.0, 1.0, 0.0, 1.0]), Y)
