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
    CASTS,
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
    casts = mesh_casts.Casts(np.arange(len(limits)), vectors, limits, limits)
    return mesh_casts.cast_leaves([Leaf(A, EYE)], [Leaf(B, EYE)], X_WA, X_WB, casts)


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
        self.sides = [mesh_casts._side([Leaf(S, EYE)], X) for S, X in ((A, X_WA), (B, X_WB))]
        a, b = self.sides
        self.n, self.capacity = len(d), capacity
        self.questions = np.ascontiguousarray(np.hstack([d, np.full((self.n, 1), math.inf)]))
        self.table = ShapeTable(a.packed or [pack_points(np.zeros((1, 3)))])
        self.trees = np.array([tree.address for tree in a.trees] * self.n)
        self.cast, self.best = np.arange(self.n), np.full(self.n, math.inf)
        self.candidates = np.full((capacity + 1, CANDIDATE), np.nan)
        self.header = np.array([
            address_of(self.trees) if a.trees else 0, b.trees[0].address, *self.table.addresses,
            address_of(a.poses.rows), address_of(b.poses.rows), POSE, POSE, address_of(self.questions),
            address_of(self.candidates), capacity,
            address_of(a.which), address_of(self.cast), address_of(self.best),
        ])
        self.doubles, self.integers = np.zeros(TREE_CAST_DOUBLES), np.zeros(TREE_CAST_INTEGERS, dtype=np.int64)

    def ask(self, first: int) -> tuple[int, int]:
        """(questions answered, candidates); ``casts`` of facets are counted."""
        count = np.zeros(2, dtype=np.int64)
        done = cast_into_tree(
            address_of(self.header),
            first,
            self.n,
            address_of(count),
            address_of(self.doubles),
            address_of(self.integers),
        )
        self.casts = int(count[CASTS])
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


def test_facets_far_smaller_than_their_boxes_are_cast_few_times():
    """Before a few large turned facets, whose boxes hold all of it, a fine mesh casts those of its facets that come
    first; large ones that its way passes by are told from the others, whichever of the two moves."""
    fine, coarse = collide.Mesh(*bumpy_sphere(4000)), collide.Mesh(*bumpy_sphere(40))
    coarse = collide.Mesh(40.0 * coarse.vertices, coarse.faces)
    rng, n = rng_of("large facets"), 4
    X_WA, X_WB = (np.array([random_pose(rng, 0.2) for _ in range(n)]) for _ in range(2))
    away = rng.normal(size=(n, 3))
    X_WA[:, :3, 3] += 50.0 * away / np.linalg.norm(away, axis=1)[:, None]
    d = X_WB[:, :3, 3] - X_WA[:, :3, 3]
    for A, B, X, Y, way in ((fine, coarse, X_WA, X_WB, d), (coarse, fine, X_WB, X_WA, -d)):
        question = Question(A, B, X, Y, way / (2.0001 * np.abs(way).max(axis=1))[:, None], 4000)
        done, count = question.ask(0)
        assert done == n and count >= n
        assert count <= question.casts < 0.05 * n * len(fine.faces), (question.casts, len(fine.faces))


def first_meeting(A: np.ndarray, B: np.ndarray, d: np.ndarray) -> float:
    """Least t >= 0 at which triangles (k, 3, 3), moved by t d, meet triangles (m, 3, 3): a corner comes to a face, or
    an edge to an edge; inf for never. In doubles, by solving for both."""

    def corners_to_faces(points, faces, way):
        a, u, v = faces[:, 0], faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]
        normal = np.cross(u, v)
        rate, to = normal @ way, a[None] - points[:, None]
        t = (to * normal).sum(axis=2) / rate
        at = points[:, None] + t[..., None] * way - a
        square = (normal * normal).sum(axis=1)
        x, y = (np.cross(at, v) * normal).sum(axis=2) / square, (np.cross(u, at) * normal).sum(axis=2) / square
        return t[(x >= 0) & (y >= 0) & (x + y <= 1) & (t >= 0)]

    edges_a, edges_b = (np.stack([T, np.roll(T, -1, axis=1)], axis=2).reshape(-1, 2, 3) for T in (A, B))
    p, u = edges_a[:, None, 0], (edges_a[:, 1] - edges_a[:, 0])[:, None]
    q, v = edges_b[None, :, 0], (edges_b[:, 1] - edges_b[:, 0])[None]
    across, to = np.cross(u, v), q - p
    rate = across @ d  # to = x u + t d - y v
    t, x, y = (across * to).sum(axis=2) / rate, (np.cross(to, v) @ d) / rate, (np.cross(to, u) @ d) / rate
    of_edges = t[(x >= 0) & (x <= 1) & (y >= 0) & (y <= 1) & (t >= 0)]
    found = corners_to_faces(A.reshape(-1, 3), B, d), corners_to_faces(B.reshape(-1, 3), A, -d), of_edges
    return min(float(of.min(initial=math.inf)) for of in found)


@pytest.mark.parametrize("ratio", [1e-6, 1e-2, 1.0, 1e2, 1e6])
def test_meshes_of_unlike_sizes_meet_where_their_facets_do(ratio):
    rng, met, n = rng_of("unlike sizes", str(ratio)), 0, 12
    slanted = collide.Mesh(*box((-0.2, -0.1, -0.3), (0.1, 0.2, 0.2)))
    A = collide.Mesh(ratio * slanted.vertices, slanted.faces)
    size = max(1.0, ratio)
    for case in range(n):
        X_WA, X_WB = random_pose(rng, 0.2 * size), random_pose(rng, 0.2 * size)
        away = rng.normal(size=3)
        X_WA[:3, 3] += 4.0 * size * away / np.linalg.norm(away)
        d = X_WB[:3, 3] - X_WA[:3, 3] + 0.15 * size * rng.normal(size=3)
        d /= 2.0001 * np.abs(d).max()
        T_A, T_B = ((M.vertices @ X[:3, :3].T + X[:3, 3])[M.faces] for M, X in ((A, X_WA), (BUMPY, X_WB)))
        t = first_meeting(T_A, T_B, d)
        for one, other, X, Y, way in ((A, BUMPY, X_WA, X_WB, d), (BUMPY, A, X_WB, X_WA, -d)):
            found = first_contacts(rows_of(one, other, X[None], Y[None], way[None], np.full(1, math.inf)), 1)
            assert found.hit[0] == np.isfinite(t), (case, t)
            assert not found.hit[0] or abs(found.t[0, 0] - t) <= 1e-9 * size, (case, found.t, t)
        met += math.isfinite(t)
    assert 3 <= met, met
