"""All pairs of facets within a distance, against exact distances of all pairs."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from mesh_families import degenerate_case, flat_case, grid_case, identical_case, random_case, turned_grid_case
from naive_triangles import as_integers, squared_distance, world_points

import collide
from collide.errors import InvalidPose
from collide.narrowphase.facets import facets_within as near_pairs
from collide.narrowphase.facets.facet_queries import facets_within

FAMILIES = [random_case, grid_case, flat_case, turned_grid_case, degenerate_case, identical_case]


def exact_distances(a, b, X_WA, X_WB) -> np.ndarray:
    exact = [world_points(a[0], X_WA), world_points(b[0], X_WB)]
    P, Q = as_integers(*exact)
    scale = max(x.denominator for points in exact for p in points for x in p)
    return np.array(
        [
            [float(squared_distance([P[v] for v in f], [Q[v] for v in g]) / scale**2) ** 0.5 for g in b[1].tolist()]
            for f in a[1].tolist()
        ]
    )


@pytest.mark.parametrize("family", FAMILIES, ids=lambda f: f.__name__)
def test_against_all_pairs(family):
    listed = outside = 0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        a, b, X_WA, X_WB = family(rng)
        reach = (0.0, 0.05, 0.25, 1.0, 0.5)[seed]
        A, B = collide.Mesh(*a, solid=False), collide.Mesh(*b, solid=False)
        found = facets_within(A.tree, B.tree, X_WA, X_WB, reach, 1 << 20)
        truth = exact_distances(a, b, X_WA, X_WB)
        where = f"{family.__name__}, seed {seed}, reach {reach}"
        got = np.zeros(truth.shape, dtype=bool)
        got[found.facets[:, 0], found.facets[:, 1]] = True
        assert not (truth[~got] <= reach).any(), where
        assert not (truth[got] > reach * (1 + 1e-12) + 1e-12).any(), where
        assert len(np.unique(found.facets, axis=0)) == len(found.facets), where
        own = truth[found.facets[:, 0], found.facets[:, 1]]
        assert np.array_equal(found.meets, own == 0.0), where
        assert (found.lower <= own * (1 + 1e-15)).all() and np.abs(found.length - own).max(initial=0.0) < 1e-12, where
        across = np.sqrt(np.square(found.point_b - found.point_a).sum(axis=1))
        assert np.abs(across - found.length).max(initial=0.0) < 1e-12, where
        listed += int(got.sum())
        outside += int((~got).sum())
    assert listed > 60 and (outside > 60 or family is identical_case)


def test_nothing_is_lost_and_trees_are_walked_once(monkeypatch):
    """Whatever the room: a second walk costs as much as the first."""
    from mesh_shapes import bumpy_sphere

    walks, list_pairs = [], near_pairs.list_near_pairs
    monkeypatch.setattr(near_pairs, "list_near_pairs", lambda *args: walks.append(1) or list_pairs(*args))

    given = bumpy_sphere(900, 3)
    mesh = collide.Mesh(*given)
    near = facets_within(mesh.tree, mesh.tree, np.eye(4), collide.pose((0.01, 0, 0)), 0.2, 1 << 20)
    assert len(near.length) > 4 * 512
    assert facets_within(mesh.tree, mesh.tree, np.eye(4), collide.pose((0.01, 0, 0)), 0.2, 1000) is None
    closer = facets_within(mesh.tree, mesh.tree, np.eye(4), collide.pose((0.01, 0, 0)), 0.1, 1 << 20)
    kept = near.lower <= 0.1
    assert np.array_equal(near.facets[kept], closer.facets) and np.array_equal(near.length[kept], closer.length)
    assert len(walks) == 3


def test_a_mirror_is_refused():
    tree = collide.Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).tree
    with pytest.raises(InvalidPose):
        facets_within(tree, tree, np.eye(4), np.diag([1.0, 1, -1, 1]), 0.1, 1 << 20)


def test_very_unlike_sizes():
    """A facet of 1e-12 m beside one of 1 km."""
    small = collide.Mesh(1e-12 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    large = collide.Mesh(1e3 * np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), [[0, 1, 2]])
    for gap, reach, many in ((1e-3, 1e-2, 1), (1e-3, 1e-4, 0), (0.0, 0.0, 1)):
        for one, other, sign in ((small, large, -1), (large, small, 1)):
            found = facets_within(one.tree, other.tree, np.eye(4), collide.pose((0, 0, sign * gap)), reach, 1 << 20)
            assert len(found.length) == many and np.abs(found.length - gap).max(initial=0.0) < 1e-12


CHILD = """
import pickle, sys
import collide
from collide.narrowphase.facets import facets_within as near_pairs
from collide.narrowphase.facets.facet_queries import facets_within
found = []
for a, b, X_WA, X_WB, reach in pickle.load(sys.stdin.buffer):
    A, B = collide.Mesh(*a, solid=False), collide.Mesh(*b, solid=False)
    pairs = facets_within(A.tree, B.tree, X_WA, X_WB, reach, 1 << 20)
    found.append((*map(bytes, pairs), collide.contacts(A, B, X_WA, X_WB).rows.tobytes()))
pickle.dump(found, sys.stdout.buffer)
"""


def test_plain_python_says_the_same():
    """The walk without a compiler, and all that is made of it: the same bytes."""
    cases = []
    for k, family in enumerate(FAMILIES):
        a, b, X_WA, X_WB = family(np.random.default_rng(k))
        cases.append(((a[0], a[1][:3]), (b[0], b[1][:3]), X_WA, X_WB, 0.3))
    answers = []
    for flag in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-c", CHILD], input=pickle.dumps(cases), env={**os.environ, "NUMBA_DISABLE_JIT": flag},
            capture_output=True, check=True, timeout=300,
        )
        answers.append(pickle.loads(done.stdout))
    assert answers[0] == answers[1] and sum(len(found[1]) for found in answers[0]) > 10
