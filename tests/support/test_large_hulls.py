"""Large hulls: support trees propose, settled vertices prove. Same answers as scans, validated."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import collide
from collide.errors import InvalidShape
from collide.lowering import lazy_structures
from collide.lowering.lazy_structures import may_have_tree, support_tree_of
from collide.lowering.parts import convex_set_of
from collide.results import EXACT
from collide.scenes.families import generate, names
from collide.support import lazy_support_tree
from collide.support.support_tree import SupportTree, list_coordinates_of

EYE = np.eye(4)


def _ball(rng, n, axes=(1, 1, 1)):
    points = rng.normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * axes


@pytest.fixture()
def trees_everywhere(monkeypatch):
    """Every hull gets a support tree, however small, so that the hard families meet them."""
    monkeypatch.setattr(lazy_structures, "MIN_FOR_TREE", 4)
    monkeypatch.setattr(lazy_support_tree, "MIN_VERTICES", 4)


def _is_built(shape) -> bool:
    packed = convex_set_of(shape)
    return may_have_tree(packed) and support_tree_of(packed).tree is not None


@pytest.mark.many(10)
@pytest.mark.parametrize("family", names())
def test_hard_families_with_a_tree_on_every_hull(family, trees_everywhere):
    """Booleans as without trees (which the oracle has judged), brackets that share the truth."""
    trees = 0
    for case in generate(family, 12, 31):
        A, B, X_WA, X_WB = case.shapes()
        with_trees = collide.distance(A, B, X_WA, X_WB)
        trees += _is_built(A) + _is_built(B)
        plain = [
            collide.ConvexHull(S.points, radius=S.radius) if isinstance(S, collide.ConvexHull) else S for S in (A, B)
        ]
        for S in plain:
            if isinstance(S, collide.ConvexHull):
                convex_set_of(S).prepared.with_tree = False
        scanned = collide.distance(*plain, X_WA, X_WB)
        assert with_trees.hit == scanned.hit == collide.collide(A, B, X_WA, X_WB), case.snippet()
        assert max(with_trees.lower, scanned.lower) <= min(with_trees.upper, scanned.upper), case.snippet()
        if with_trees.certificate is not None:
            collide.verify(A, B, X_WA, X_WB, with_trees)
    if not family.startswith(
        ("box", "halfspace", "swept", "flat", "degenerate", "touch_scaled", "long", "padded", "tiny_m")
    ):
        assert trees >= 8, f"{trees} trees in {family}: the test no longer tests them"


@pytest.mark.parametrize("axes", [(1, 1, 1), (1, 3, 10), (1, 1, 0.02)])
def test_large_hulls_answer_as_scans_do(axes):
    rng = np.random.default_rng(8)
    A, B = (collide.ConvexHull(_ball(rng, 3000, axes)) for _ in range(2))
    scans = [collide.ConvexHull(S.points) for S in (A, B)]
    for S in scans:
        convex_set_of(S).prepared.with_tree = False
    X_WB = np.array(
        [collide.pose(_ball(rng, 1)[0] * rng.uniform(0, 3 * max(axes)), rpy=rng.uniform(-3, 3, 3)) for _ in range(300)]
    )
    r, scanned = collide.distance(A, B, EYE, X_WB), collide.distance(*scans, EYE, X_WB)
    assert _is_built(A) and _is_built(B)
    assert 20 < r.hit.sum() < 280 and np.array_equal(r.hit, scanned.hit)
    assert np.array_equal(collide.collide(A, B, EYE, X_WB), r.hit)
    np.testing.assert_allclose(r.distance, scanned.distance, rtol=0, atol=1e-12)
    assert (np.maximum(r.lower, scanned.lower) <= np.minimum(r.upper, scanned.upper)).all()
    for k in range(0, 300, 60):
        collide.verify(A, B, EYE, X_WB[k], r[k])


def test_large_hulls_that_touch_are_decided_exactly():
    """A vertex of one on a facet of the other: exact by dyadic coordinates, then moved by one ulp."""
    rng = np.random.default_rng(9)
    half = np.round(_ball(rng, 4000) * 2**20) / 2**20
    top = np.concatenate([half, [[0, 0, 1.5]]])
    A = collide.ConvexHull(top)
    slab = np.array([[x, y, z] for x in (-4, 4) for y in (-4, 4) for z in (0, 1)], dtype=float)
    B = collide.ConvexHull(slab)
    for z, expected in ((1.5, True), (np.nextafter(1.5, 2), False), (np.nextafter(1.5, 1), True)):
        r = collide.distance(A, B, EYE, collide.pose((0.25, -0.5, z)))
        assert (
            r.hit is expected
            and r.how == EXACT
            and collide.collide(A, B, EYE, collide.pose((0.25, -0.5, z))) is expected
        )
        collide.verify(A, B, EYE, collide.pose((0.25, -0.5, z)), r)
    mirrored = collide.ConvexHull(top * (1, 1, -1))
    r = collide.distance(A, mirrored, EYE, collide.pose((0, 0, 3)))
    assert r.hit and r.how == EXACT
    assert not collide.collide(A, mirrored, EYE, collide.pose((0, 0, np.nextafter(3, 4))))


def test_prisms_on_their_caps_meet_exactly():
    """Hundreds of vertices tie in the deciding direction."""
    angles = 2 * np.pi * np.arange(700) / 700
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    prism = collide.ConvexHull(np.concatenate([np.hstack([ring, np.full((700, 1), z)]) for z in (-0.5, 0.5)]))
    for shift in (0.0, 0.3, 1.2):
        assert collide.collide(prism, prism, EYE, collide.pose((shift, 0, 1)))
        assert not collide.collide(prism, prism, EYE, collide.pose((shift, 0, np.nextafter(1, 2))))
        r = collide.distance(prism, prism, EYE, collide.pose((shift, 0.1, 1)))
        assert r.hit and r.distance == 0.0 and r.how == EXACT
        collide.verify(prism, prism, EYE, collide.pose((shift, 0.1, 1)), r)
    assert _is_built(prism)


def test_interior_and_repeated_points_change_nothing():
    rng = np.random.default_rng(10)
    surface = _ball(rng, 500)
    cloud = np.concatenate([surface * 0.9, surface, surface[::3], np.zeros((3, 3)), surface * 0.5])
    A, B = collide.ConvexHull(surface), collide.ConvexHull(cloud)
    assert len(B.hull.vertices) == len(np.unique(surface, axis=0))
    X_WB = np.array([collide.pose(_ball(rng, 1)[0] * rng.uniform(1.5, 2.5)) for _ in range(200)])
    one, other = collide.distance(A, A, EYE, X_WB), collide.distance(A, B, EYE, X_WB)
    assert np.array_equal(one.hit, other.hit) and 40 < one.hit.sum() < 160
    np.testing.assert_allclose(one.distance, other.distance, rtol=0, atol=1e-13)


@pytest.mark.parametrize("flatten", [(1, 1, 0), (1, 0, 0), (0, 0, 0)])
def test_large_clouds_without_volume(flatten):
    rng = np.random.default_rng(11)
    flat = collide.ConvexHull(_ball(rng, 900) * flatten)
    ball = collide.Sphere(0.25)
    assert collide.collide(flat, ball, EYE, collide.pose((0, 0, 0.25)))
    assert not collide.collide(flat, ball, EYE, collide.pose((0, 0, np.nextafter(0.25, 1))))
    assert flat.hull.dimension == sum(flatten)
    r = collide.distance(flat, flat, EYE, collide.pose((0.5 * flatten[0], 0.25 * flatten[1], 1)))
    assert abs(r.distance - 1) < 1e-15 and not r.hit
    collide.verify(flat, flat, EYE, collide.pose((0.5 * flatten[0], 0.25 * flatten[1], 1)), r)


def test_trees_are_made_once_when_first_needed_also_by_many_threads():
    A = collide.ConvexHull(_ball(np.random.default_rng(12), 2000))
    own_tree = support_tree_of(convex_set_of(A))
    assert own_tree._tree is None, "packing alone needs no tree"
    seen = []
    threads = [threading.Thread(target=lambda: seen.append(own_tree.address)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(seen)) == 1 and seen[0] != 0
    world = collide.World()
    B = collide.ConvexHull(A.points)
    world.add(B)
    world.add(B, collide.pose((50, 0, 0)))
    assert not world.collides() and "tree" not in convex_set_of(B).prepared.made, "nothing near: nothing to build"
    world.add(collide.Sphere(0.5))
    assert world.collides() and support_tree_of(convex_set_of(B))._tree is not None


def test_given_faces_are_checked_not_trusted():
    rng = np.random.default_rng(15)
    points = _ball(rng, 100)
    facets = collide.ConvexHull(points).hull.facets
    collide.ConvexHull(points, faces=facets).validate()
    flipped, missing = facets.copy(), facets[1:]
    flipped[7] = flipped[7][::-1]
    for wrong in (flipped, missing):
        shape = collide.ConvexHull(points, faces=wrong)
        with pytest.raises(InvalidShape, match="faces"):
            shape.validate()
        assert collide.collide(shape, shape, EYE, collide.pose((1.0, 0, 0))), "the set does not depend on them"


@pytest.mark.parametrize("axes", [(1, 1, 1), (1, 3, 10)])
def test_bad_proposals_cost_time_not_truth(axes):
    """Candidate lists shuffled among their owners: what settles a vertex is the hull's edges, not the lists."""
    rng = np.random.default_rng(16)
    points = _ball(rng, 1200, axes)
    A, B = collide.ConvexHull(points), collide.ConvexHull(points)
    tree = lazy_support_tree._built(points)
    entries, last = tree.entries.copy(), tree.nodes[1]  # what follows the first list are rows of points
    entries[last:] = rng.permutation(entries[last:])
    rows = np.concatenate([tree.owners[entries[:last]], entries[last:]])  # a tree of two levels
    coordinates = list_coordinates_of(points, tree.nodes, rows)
    shuffled = lazy_support_tree.LazySupportTree(B.points)
    shuffled._tree = SupportTree(
        B.points, tree.flat, tree.depth, tree.nodes, tree.owners, entries, coordinates, tree.ring_starts, tree.ring
    )
    convex_set_of(B).prepared.made["tree"] = shuffled
    X_WB = np.array(
        [collide.pose(_ball(rng, 1)[0] * rng.uniform(0, 3 * max(axes)), rpy=rng.uniform(-3, 3, 3)) for _ in range(300)]
    )
    good, bad = collide.distance(A, A, EYE, X_WB), collide.distance(A, B, EYE, X_WB)
    assert 30 < good.hit.sum() < 270
    assert np.array_equal(good.hit, bad.hit) and np.array_equal(collide.collide(A, B, EYE, X_WB), good.hit)
    assert np.array_equal(collide.collide(B, A, X_WB, EYE), good.hit)
    assert (np.maximum(good.lower, bad.lower) <= np.minimum(good.upper, bad.upper)).all()
    assert (bad.iterations != good.iterations).any(), "the lists are still good: nothing was tested"
    for k in range(0, 300, 50):
        collide.verify(A, B, EYE, X_WB[k], bad[k])


@pytest.mark.parametrize("n", [128, 512, 4096])
def test_balls_that_nearly_touch_take_few_rounds(n):
    """Counted. GJK that begins with one point of A ⊖ B alone takes 7.7, 9.7 and 11.6 rounds on average."""
    rng = np.random.default_rng(n)
    A, B = (collide.ConvexHull(_ball(rng, n)) for _ in range(2))
    X_WB = np.array([collide.pose(3 * _ball(rng, 1)[0], rpy=rng.uniform(-3, 3, 3)) for _ in range(200)])
    for _ in range(3):  # the nearest features change on the way
        apart = collide.distance(A, B, EYE, X_WB)
        X_WB[:, :3, 3] -= (apart.distance - rng.uniform(1e-3, 1e-2, 200))[:, None] * apart.normal
    near = collide.distance(A, B, EYE, X_WB)
    assert near.certified.all() and ((0 < near.distance) & (near.distance < 0.02)).mean() > 0.9
    assert (near.iterations & 0xFFFF).mean() < 6.5
