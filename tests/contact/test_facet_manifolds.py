"""The kernel of bodies of facets: batches, threads, workspaces that grow, features; its parts against naive twins."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from contact_scenes import table
from mesh_shapes import box, bumpy_sphere
from naive import rng_of
from naive_triangles import triangles_meet

import collide
from collide.contact import (
    contact_pairs,
    contact_points,
    facet_manifolds,
    mesh_contacts,
    reduce_patch,
    shallow_overlaps,
)
from collide.contact.contact_rows import CONTACT_DTYPE, OVERLAP, TRANSLATION
from collide.contact.manifold_points import POINT, ManifoldPoints
from collide.contact.support_face import EDGE, FACE, VERTEX, axes_across
from collide.kernels import PLAIN_PYTHON, address_of
from collide.lowering.facet_bodies import body_of
from collide.narrowphase.facets.facet_queries import facets_within
from collide.numerics.vec3 import Vec3

EYE = np.eye(4)
CUBE = box((-0.5, -0.375, -0.25), (0.5, 0.375, 0.25))


def poses_on_table(rng, n, tilt=0.02):
    """(n, 4, 4) of a box about the top of a table: sunk, hovering, tilted, over the edge, far."""
    X = np.stack([collide.pose(rpy=(*rng.normal(scale=tilt, size=2), rng.uniform(-3, 3))) for _ in range(n)])
    X[:, :3, 3] = rng.uniform(-0.9, 0.9, (n, 3))
    X[:, 2, 3] = 0.25 + rng.choice([-0.05, -1e-3, -1e-6, 0.0, 1e-6, 5e-3, 0.5], n)
    return X


def same_rows(a: np.ndarray, b: np.ndarray) -> bool:
    return len(a) == len(b) and all(np.array_equal(a[name], b[name]) for name in CONTACT_DTYPE.names or ())


# --- batches ------------------------------------------------------------------------------------


@pytest.mark.parametrize("as_mesh", [False, True])
def test_batches_threads_and_lists_are_single_calls(as_mesh):
    rng = np.random.default_rng(int(as_mesh))
    ground = collide.Mesh(*table(6, seed=2))
    shape = collide.Mesh(*CUBE) if as_mesh else collide.Box((1.0, 0.75, 0.5))
    X = poses_on_table(rng, 96)
    batch = collide.contacts(ground, shape, EYE, X, margin=0.01)
    assert len(batch.starts) == 97
    touching = 0
    for k in range(96):
        single = collide.contacts(ground, shape, EYE, X[k], margin=0.01)
        assert same_rows(single.rows, batch[k].rows), f"pose {k}: {X[k].tolist()}"
        touching += len(single) > 0
    assert 40 < touching < 96
    for threads in (2, 3):
        assert same_rows(collide.contacts(ground, shape, EYE, X, margin=0.01, threads=threads).rows, batch.rows)
    listed = collide.contacts([ground] * 96, [shape] * 96, EYE, X, margin=0.01)
    assert same_rows(listed.rows, batch.rows) and np.array_equal(listed.starts, batch.starts)
    swapped = collide.contacts(shape, ground, X, EYE, margin=0.01)
    assert np.array_equal(swapped.point_a, batch.point_b) and np.array_equal(swapped.normal, -batch.normal)
    assert np.array_equal(swapped.rows["feature_a"], batch.rows["feature_b"])


def test_rows_of_distance_stand_in_their_places():
    """Poses deep inside a solid, among others: one row of kind "translation" each."""
    solid, small = collide.Mesh(*box()), collide.Box((0.25, 0.25, 0.25))
    X = np.repeat(EYE[None], 5, axis=0)
    X[:, :3, 3] = (0.5, 0.5, 1.125), (0.5, 0.5, 0.5), (0.5, 0.5, 9.0), (0.3, 0.5, 0.5), (0.5, 0.5, 1.12)
    c = collide.contacts(solid, small, EYE, X)
    kinds = [c[k].kind.tolist() for k in range(5)]
    assert kinds == [[OVERLAP] * 4, [TRANSLATION], [], [TRANSLATION], [OVERLAP] * 4], kinds
    for k in (1, 3):
        r = collide.distance(solid, small, EYE, X[k])
        assert c[k].distance[0] == r.distance and np.array_equal(c[k].normal[0], r.normal)
        assert same_rows(c[k].rows, collide.contacts(solid, small, EYE, X[k]).rows)


def test_workspaces_grow_and_give_the_same_rows(monkeypatch):
    """Space for few pairs of facets to begin with: rows are the same bits."""
    rng = np.random.default_rng(5)
    ground, shape, X = collide.Mesh(*table(24, seed=3)), collide.Mesh(*CUBE), poses_on_table(rng, 24)
    wanted = collide.contacts(ground, shape, EYE, X, margin=0.01)
    monkeypatch.setattr(mesh_contacts, "_FEWEST_PAIRS", 64)
    space = mesh_contacts._OfThread()
    monkeypatch.setattr(mesh_contacts, "_of_thread", space)
    monkeypatch.setattr(mesh_contacts, "_FIRST_ROWS", 1)
    monkeypatch.setattr(mesh_contacts, "_ROWS_PER_POSE", 0)
    assert same_rows(collide.contacts(ground, shape, EYE, X, margin=0.01).rows, wanted.rows)
    assert space.described[1] > 64, "more pairs than at first"


def test_a_call_after_one_that_needed_much_space_begins_with_what_may_be_kept(monkeypatch):
    """Less is worked out twice then; memory beyond that is given back, and small calls after it ask for none."""
    rng = np.random.default_rng(6)
    ground, shape, X = collide.Mesh(*table(24, seed=3)), collide.Mesh(*CUBE), poses_on_table(rng, 4)
    for name, value in (("_FEWEST_PAIRS", 8), ("_KEPT_PAIRS", 128)):
        monkeypatch.setattr(mesh_contacts, name, value)
    monkeypatch.setattr(mesh_contacts, "_of_thread", mesh_contacts._OfThread())
    collide.contacts(ground, shape, EYE, X[0])  # single calls have a workspace of their own
    begun, kernel = [], mesh_contacts.facet_manifolds
    monkeypatch.setattr(mesh_contacts, "facet_manifolds", lambda *args: begun.append(1) or kernel(*args))
    first = collide.contacts(ground, shape, EYE, X, margin=0.01)
    n_first = len(begun)
    again = collide.contacts(ground, shape, EYE, X, margin=0.01)
    assert same_rows(first.rows, again.rows) and len(begun) - n_first == n_first - 2, (n_first, len(begun))
    space = mesh_contacts._of_thread
    kept = space._words
    assert space.described[1] == 128
    collide.contacts(ground, shape, EYE, collide.pose((0.0, 0.0, 5.0))[None])
    assert mesh_contacts._of_thread._words is kept


def test_the_wider_list_goes_on_where_the_workspace_was_full(monkeypatch):
    """Deep overlaps of fine meshes: far more pairs lie within 2.5 times the depth than there is space for at first.
    Those that no patch reaches make way for the next, and rows are the same bits as with space for all at once."""
    A, B = collide.Mesh(*bumpy_sphere(2000, 3)), collide.Mesh(*bumpy_sphere(2000, 4))
    listed_in_parts = 0
    for k, depth in enumerate((0.05, 0.2, 0.4)):
        X = collide.pose((2.0 - depth, 0.1 * k, 0.0), rpy=(0.3, 0.2 * k, 1.0))
        found = []
        for fewest in (1 << 16, 1 << 12, 1 << 9):
            monkeypatch.setattr(mesh_contacts, "_FEWEST_PAIRS", fewest)
            space = mesh_contacts._OfThread()
            monkeypatch.setattr(mesh_contacts, "_of_thread", space)
            found.append((collide.contacts(A, B, EYE, X).rows, space.described[1]))
        (rows, _), *others = found
        reach = -2.5 * rows["distance"].min()
        n_within = len(facets_within(body_of(A).tree, body_of(B).tree, EYE, X, reach, 1 << 22).length)
        for again, capacity in others:
            assert same_rows(again, rows), (depth, capacity)
            listed_in_parts += capacity < n_within
    assert listed_in_parts >= 3


@pytest.mark.skipif(not PLAIN_PYTHON, reason="patches kernels: NUMBA_DISABLE_JIT=1 python -m pytest")
def test_pairs_that_no_patch_may_reach_are_not_linked_and_rows_are_the_same(monkeypatch):
    """Deep overlaps list facets within more than the depth: most lie beside the translation's shadow or look the wrong
    way. Rows are those of all pairs linked, bit by bit, on sharp and swept bodies and with a margin."""
    rng = rng_of("pairs that no patch may reach")
    linked: list[int] = []
    link_pairs = facet_manifolds.link_pairs
    monkeypatch.setattr(facet_manifolds, "link_pairs", lambda pairs, n: linked.append(pairs.n) or link_pairs(pairs, n))
    kept = of_all = wider = 0
    for case in range(4):
        ball = collide.Mesh(*bumpy_sphere(32, case))
        other = (
            collide.Box((1.0, 0.8, 0.6)), collide.ConvexHull(0.3 * rng.normal(size=(8, 3)), radius=0.05),
            collide.Mesh(*CUBE),
        )[case % 3]
        way = rng.normal(size=3)
        X_WB = collide.pose(way / np.linalg.norm(way) * rng.uniform(0.9, 1.3), rpy=rng.uniform(-3, 3, 3))
        margin = 0.05 * (case % 2)
        found = []
        for culls in (True, False):
            linked.clear()
            with monkeypatch.context() as patched:
                if not culls:
                    patched.setattr(facet_manifolds, "_MAX_WAYS", -1)
                    patched.setattr(contact_points, "_shadows_apart", lambda seen, axis: False)
                found.append((collide.contacts(ball, other, EYE, X_WB, margin=margin).rows, list(linked)))
        (rows, few), (want, all_of_them) = found
        told = f"ball = bumpy_sphere(32, {case}), {other!r}, X_WB = {X_WB.tolist()}, margin = {margin}"
        assert same_rows(rows, want) and len(few) == len(all_of_them), told
        if len(few) > 1:
            wider += 1
            kept, of_all = kept + few[-1], of_all + all_of_them[-1]
    assert wider >= 3 and kept < 0.7 * of_all, (wider, kept, of_all)


# --- features -----------------------------------------------------------------------------------


def feature_points(mesh, X, feature):
    """Corners in the world of what a feature of a mesh names."""
    number, kind = divmod(feature, 4)
    vertices, faces = mesh
    if kind == VERTEX:
        return (vertices @ X[:3, :3].T + X[:3, 3])[[number]]
    if kind == FACE:
        return (vertices @ X[:3, :3].T + X[:3, 3])[faces[number]]
    assert kind == EDGE
    ends = sorted({tuple(sorted((int(f[i]), int(f[(i + 1) % 3])))) for f in faces for i in range(3)})
    return (vertices @ X[:3, :3].T + X[:3, 3])[list(ends[number])]


def off(points, p) -> float:
    """How far p is from a point, a segment, or the plane of a triangle."""
    if len(points) == 1:
        return float(np.linalg.norm(points[0] - p))
    if len(points) == 2:
        e = points[1] - points[0]
        t = min(max((p - points[0]) @ e / (e @ e), 0.0), 1.0)
        return float(np.linalg.norm(points[0] + t * e - p))
    n = np.cross(points[1] - points[0], points[2] - points[0])
    return float(abs((p - points[0]) @ n) / np.linalg.norm(n))


def test_features_name_what_is_there():
    """Vertices, edges and facets that features name pass through the points of their rows, on both bodies."""
    rng = np.random.default_rng(7)
    ground = table(6, seed=4)
    seen = set()
    for _ in range(40):
        X = poses_on_table(rng, 1)[0]
        c = collide.contacts(collide.Mesh(*ground), collide.Mesh(*CUBE), EYE, X, margin=0.01)
        for row in c:
            if row["kind"] == TRANSLATION:
                continue
            for side, mesh, pose in (("a", ground, EYE), ("b", CUBE, X)):
                feature = int(row[f"feature_{side}"])
                assert off(feature_points(mesh, pose, feature), row[f"point_{side}"]) < 1e-9, (X.tolist(), row)
            seen.add((int(row["feature_a"]) % 4, int(row["feature_b"]) % 4))
    assert {(FACE, VERTEX), (EDGE, EDGE)} <= seen, seen


def test_features_stay_while_a_box_creeps():
    """A box that slides by a millionth a step keeps its corners' features; those of facets change where it crosses."""
    ground, shape = collide.Mesh(*table(3)), collide.Box((1.0, 0.75, 0.5))
    before = None
    for k in range(20):
        X = collide.pose((0.013 + 1e-6 * k, 0.021, 0.25 - 1e-4 + 1e-6 * (k % 3)), rpy=(0, 0, 0.3))
        c = collide.contacts(ground, shape, EYE, X, margin=1e-3)
        keys = [(int(a), int(b)) for a, b in zip(c.rows["feature_a"], c.rows["feature_b"])]
        assert len(keys) == 4 and all(b % 4 == VERTEX for _, b in keys)
        assert before is None or set(keys) == before, (k, keys, before)
        before = set(keys)


# --- parts, against naive twins -----------------------------------------------------------------


def one_pair(P, Q):
    """A pair of triangles as kernels see it, and what goes with it; they run as Python."""
    words = np.zeros(contact_pairs.WORDS_OF_PAIRS * 2, dtype=np.int64)
    pairs = contact_pairs.open_pairs(address_of(words), 2, 1)
    pairs.corners[:18] = np.concatenate([P, Q]).ravel()
    for at, T in ((0, P), (3, Q)):
        n = np.cross(T[1] - T[0], T[2] - T[0])
        pairs.normals[at : at + 3] = n / np.linalg.norm(n)
    body = SimpleNamespace(solid=False, edges=np.arange(9))
    points = contact_points.PatchPoints(
        ManifoldPoints(np.zeros(60), np.zeros(30, dtype=np.int64)), np.zeros(15), np.zeros(15, dtype=np.int64),
        np.zeros(18),
    )
    return words, pairs, body, points


def exact(T) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in p] for p in T]


@pytest.mark.plain_kernels
def test_depths_are_where_triangles_come_apart():
    """Moved by a hair less than the depth along a direction they meet, by a hair more not: in fractions."""
    rng = np.random.default_rng(11)
    met = 0
    for case in range(150):
        P, Q = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)) * 0.7
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        where = f"case {case}: P = {P.tolist()}, Q = {Q.tolist()}, n = {n.tolist()}"
        words, pairs, body, points = one_pair(P, Q)
        view = shallow_overlaps.any_side_view(axes_across(Vec3(*n.tolist())), 1e-15)
        depth = contact_points.depth_along(pairs, 0, body, body, view, points, 0.0)
        far = triangles_meet(exact(P), exact(Q + (depth * (1 + 1e-9) + 1e-9) * n))
        assert not far, where
        if depth > 1e-6 and triangles_meet(exact(P), exact(Q)):
            met += 1
            assert triangles_meet(exact(P), exact(Q + depth * (1 - 1e-9) * n)), where
        assert len(words)
    assert met > 15


@pytest.mark.plain_kernels
def test_hulls_of_patches_hold_their_points():
    """Corners are points, turn one way, and no point is beyond a side by more than the tolerance."""
    rng = np.random.default_rng(13)
    large = 0
    for case in range(200):
        n = int(rng.integers(1, 60))
        flat = rng.normal(size=(n, 2)) if rng.random() < 0.5 else rng.integers(0, 5, (n, 2)).astype(float)
        flat += rng.choice([0.0, 1e-12]) * rng.normal(size=(n, 2))
        numbers = np.zeros(POINT * n)
        numbers[0::POINT], numbers[1::POINT] = flat.T
        points = contact_points.PatchPoints(
            ManifoldPoints(numbers, np.zeros(2 * n, dtype=np.int64)), np.zeros(n), np.arange(n), np.zeros(18)
        )
        columns = np.zeros(reduce_patch.column_words(n))
        space = reduce_patch.HullSpace(*(np.zeros(n + 80, dtype=np.int64) for _ in range(5)), address_of(columns))
        tolerance = 1e-9
        m = reduce_patch.hull_of_patch(points, n, tolerance, space)
        corners = flat[space.corners[:m]]
        where = f"case {case}: flat = {flat.tolist()}"
        assert m >= 1 and len(set(space.corners[:m].tolist())) == m, where
        if m < 3:
            e = corners[-1] - corners[0]
            aside = np.abs((flat - corners[0]) @ (-e[1], e[0])) / max(np.linalg.norm(e), 1e-300)
            assert aside.max() < 4 * tolerance or np.abs(flat - corners[0]).max() < 4 * tolerance, where
            continue
        large += 1
        for p, q in zip(corners, np.roll(corners, -1, axis=0)):
            e = q - p
            heights = (e[0] * (flat[:, 1] - p[1]) - e[1] * (flat[:, 0] - p[0])) / np.linalg.norm(e)
            assert heights.min() > -4 * tolerance, where
    assert large > 120


@pytest.mark.plain_kernels
def test_spread_reaches_what_is_linked():
    """Against the transitive closure of sharing a pair of corners, by sets."""
    rng = np.random.default_rng(17)
    far = 0
    for case in range(60):
        n = int(rng.integers(2, 25))
        words = np.zeros(contact_pairs.WORDS_OF_PAIRS * n, dtype=np.int64)
        pairs = contact_pairs.open_pairs(address_of(words), n, n)
        ids = rng.integers(0, rng.integers(4, 30), (n, 6))
        pairs.ids[:] = ids.ravel()
        contact_pairs.link_pairs(pairs, 30)
        seeds, among = rng.random(n) < 0.15, rng.random(n) < 0.6
        pairs.states[:] = contact_pairs.SEED * seeds + contact_pairs.PASSABLE * among
        contact_pairs.spread(pairs)
        keys = [{(a, b) for a in row[:3].tolist() for b in row[3:].tolist()} for row in ids]
        wanted = set(np.flatnonzero(seeds).tolist())
        while True:
            new = {k for k in np.flatnonzero(among).tolist() if any(keys[k] & keys[j] for j in wanted)} - wanted
            if not new:
                break
            wanted |= new
        reached = set(np.flatnonzero(pairs.states & contact_pairs.REACHED).tolist())
        assert reached == wanted, (
            f"case {case}: ids = {ids.tolist()}, seeds = {seeds.tolist()}, among = {among.tolist()}"
        )
        far += len(wanted) > seeds.sum()
    assert far > 20


def test_a_workspace_that_grew_is_given_back_after_some_calls(monkeypatch):
    """11 MB stayed with a thread for ever after one pair of many facets; small pairs do not need them."""
    space = mesh_contacts._OfThread()
    monkeypatch.setattr(mesh_contacts, "_of_thread", space)
    space.grow()
    grown, small, X = space._words.nbytes, collide.Mesh(*CUBE), collide.pose((0, 0, 0.45))
    for k in range(mesh_contacts._CALLS_KEPT):
        assert space._words.nbytes == grown, f"given back after {k} calls"
        assert len(collide.contacts(small, small, EYE, X[None]))
    assert space._words.nbytes < 0.3 * grown and space._capacity == mesh_contacts._FEWEST_PAIRS
