"""Casts into trees of facets: candidates hold the first facet of all, room that runs out changes nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.casts import mesh_casts
from collide.casts.cast_pairs import LOWER, NORMAL, STATUS, TOUCHING, UPPER, VALUE
from collide.casts.cast_trees import (
    CANDIDATE,
    FACET_A,
    FACET_B,
    OF_QUESTION,
    TREE_CAST_DOUBLES,
    TREE_CAST_INTEGERS,
    cast_into_tree,
)
from collide.casts.convex_casts import PairRows, first_contacts
from collide.casts.leaves import Leaf
from collide.casts.portal import HIT, MISS
from collide.kernels import address_of
from collide.lowering.packed_convex import pack_points
from collide.lowering.shape_table import POSE, ShapeTable

EYE = np.eye(4)
BUMPY, RING = collide.Mesh(*bumpy_sphere(60)), collide.Mesh(*block_ring())
MOVERS = {"Box": collide.Box((0.3, 0.2, 0.4)), "Capsule": collide.Capsule(0.1, 0.5), "Cone": collide.Cone(0.2, 0.4),
          "Mesh": collide.Mesh(*box((-0.2, -0.1, -0.3), (0.1, 0.2, 0.2)))}


def drawn(*words, n: int):
    rng = rng_of("cast trees", *words)
    X_WA, X_WB = (np.array([random_pose(rng, 0.2) for _ in range(n)]) for _ in range(2))
    away = rng.normal(size=(n, 3))
    X_WA[:, :3, 3] += 4.0 * away / np.linalg.norm(away, axis=1)[:, None]
    d = X_WB[:, :3, 3] - X_WA[:, :3, 3] + 0.6 * rng.normal(size=(n, 3))
    return X_WA, X_WB, d / (2.0001 * np.abs(d).max(axis=1))[:, None]


def rows_of(A, B, X_WA, X_WB, vectors, limits) -> PairRows:
    return mesh_casts.cast_leaves(Leaf(A, EYE), Leaf(B, EYE), X_WA, X_WB, vectors, limits)


@pytest.mark.parametrize("kind", MOVERS)
def test_first_of_candidates_is_the_first_of_facets(kind):
    n = 6
    X_WA, X_WB, d = drawn(kind, n=n)
    A, facets = MOVERS[kind], [collide.ConvexHull(BUMPY.vertices[f]) for f in BUMPY.faces]
    found = first_contacts(rows_of(A, BUMPY, X_WA, X_WB, d, np.full(n, math.inf)), n)
    movers = [A] if kind != "Mesh" else [collide.ConvexHull(A.vertices[f]) for f in A.faces]
    t = np.array([collide.shape_cast(a, X_WA, d, facet, X_WB).distance for a in movers for facet in facets]).min(axis=0)
    assert (found.hit == np.isfinite(t)).all() and found.hit.any() and found.proven.all()
    np.testing.assert_allclose(found.t[found.hit, 0], t[found.hit], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", MOVERS)
def test_the_mesh_may_move_instead(kind):
    """Swapped roles against the way: the same t, normals turned round, points moved along."""
    n = 10
    X_WA, X_WB, d = drawn("swapped", kind, n=n)
    limits = np.full(n, math.inf)
    A = MOVERS[kind]
    one = first_contacts(rows_of(A, RING, X_WA, X_WB, d, limits), n)
    other = first_contacts(rows_of(RING, A, X_WB, X_WA, -d, limits), n)
    assert (one.hit == other.hit).all() and one.hit.sum() > 2
    met = one.hit
    np.testing.assert_allclose(one.t[met], other.t[met], rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.normal[met], -other.normal[met], rtol=0, atol=1e-6)
    np.testing.assert_allclose((one.point - one.t[:, :1] * d)[met], other.point[met], rtol=0, atol=1e-6)


def test_limits_are_kept():
    n = 12
    X_WA, X_WB, d = drawn("limits", n=n)
    whole = first_contacts(rows_of(MOVERS["Box"], BUMPY, X_WA, X_WB, d, np.full(n, math.inf)), n)
    met = np.flatnonzero(whole.hit)
    assert len(met) > 4
    for factor, hit in ((0.999, False), (1.001, True)):
        limits = whole.t[met, 0] * factor
        cut = first_contacts(rows_of(MOVERS["Box"], BUMPY, X_WA[met], X_WB[met], d[met], limits), len(met))
        assert (cut.hit == hit).all() and cut.proven.all()
        assert not hit or np.array_equal(cut.t[:, 0], whole.t[met, 0])


def test_meshes_fall_onto_planes_by_their_corners():
    half = collide.Halfspace((0, 0, 1), 0.0)
    rng, n = rng_of("meshes and planes"), 5
    X = np.array([random_pose(rng) for _ in range(n)])
    X[:, 2, 3] += 5.0
    found = rows_of(RING, half, X, np.array([EYE] * n), np.array([(0.25, 0.0, -0.5)] * n), np.full(n, math.inf))
    lowest = (RING.vertices @ X[:, 2, :3].T + X[:, 2, 3]).min(axis=0)
    assert (found.rows[:, STATUS] == HIT).all() and found.owner.tolist() == list(range(n)) and found.marks.proven.all()
    np.testing.assert_allclose(found.rows[:, VALUE], 2 * lowest, rtol=1e-12)


class Question:
    """What the entry is handed, kept alive."""

    def __init__(self, A, B, X_WA, X_WB, d, capacity: int):
        self.sides = [mesh_casts._side(Leaf(S, EYE), X) for S, X in ((A, X_WA), (B, X_WB))]
        a, b = self.sides
        self.n, self.capacity = len(d), capacity
        self.questions = np.ascontiguousarray(np.hstack([d, np.full((self.n, 1), math.inf)]))
        self.table = ShapeTable([a.packed if a.packed is not None else pack_points(np.zeros((1, 3)))])
        self.candidates = np.full((capacity + 1, CANDIDATE), np.nan)
        self.header = np.array([
            0 if a.tree is None else a.tree.address, b.tree.address, *self.table.addresses, address_of(a.poses.rows),
            address_of(b.poses.rows), POSE, POSE, address_of(self.questions), address_of(self.candidates), capacity,
        ])
        self.doubles, self.integers = np.zeros(TREE_CAST_DOUBLES), np.zeros(TREE_CAST_INTEGERS, dtype=np.int64)

    def ask(self, first: int) -> tuple[int, int]:
        """(questions answered, candidates)."""
        count = np.zeros(1, dtype=np.int64)
        done = cast_into_tree(
            address_of(self.header),
            first,
            self.n,
            address_of(count),
            address_of(self.doubles),
            address_of(self.integers),
        )
        return done, int(count[0])


@pytest.mark.parametrize("kind", ["Box", "Mesh"])
def test_a_question_without_room_is_left_whole(kind):
    X_WA, X_WB, d = drawn("room", kind, n=9)
    large = Question(MOVERS[kind], BUMPY, X_WA, X_WB, d, 4000)
    done, count = large.ask(0)
    assert done == 9 and count > 9
    rows = large.candidates[:count]
    assert set(rows[:, STATUS].tolist()).isdisjoint({MISS}) and (np.diff(rows[:, OF_QUESTION]) >= 0).all()
    assert (rows[:, LOWER] <= rows[:, UPPER]).all() and (rows[:, LOWER] >= 0.0).all()
    assert (rows[:, FACET_A] == -1).all() == (kind == "Box")
    assert ((0 <= rows[:, FACET_B]) & (rows[:, FACET_B] < len(BUMPY.faces))).all()
    capacity = int(np.bincount(rows[:, OF_QUESTION].astype(int)).max()) + 100
    small, first, answered = Question(MOVERS[kind], BUMPY, X_WA, X_WB, d, capacity), 0, []
    while first < 9:
        done, count = small.ask(first)
        assert first < done and count <= capacity and np.isnan(small.candidates[capacity]).all()
        answered.append(small.candidates[:count].copy())
        first = done
    assert np.concatenate(answered).tobytes() == rows.tobytes()
    none = Question(MOVERS[kind], BUMPY, X_WA, X_WB, d, 0)
    assert none.ask(int(rows[0, OF_QUESTION])) == (int(rows[0, OF_QUESTION]), 0)


def test_batches_are_singles_bit_by_bit():
    """Rows of a batch are those of its casts one by one."""
    X_WA, X_WB, d = drawn("growing", n=4)
    n, limits = 4, np.full(4, math.inf)
    whole = rows_of(MOVERS["Mesh"], BUMPY, X_WA, X_WB, d, limits)
    for k in range(n):
        one = rows_of(MOVERS["Mesh"], BUMPY, X_WA[k : k + 1], X_WB[k : k + 1], d[k : k + 1], limits[:1])
        mine = whole.owner == k
        assert one.rows.tobytes() == whole.rows[mine].tobytes() and (one.owner == 0).all()
    assert (np.abs(np.linalg.norm(whole.rows[whole.marks.proven, NORMAL : NORMAL + 3], axis=1) - 1) < 1e-9).all()
    assert np.isfinite(whole.rows[whole.marks.proven, TOUCHING : TOUCHING + 3]).all()
