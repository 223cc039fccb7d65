"""Boxes without thickness: rectangles, segments and points, in every query, beside closed forms and fractions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from mesh_shapes import block_ring
from naive import LATTICE_ROTATIONS, Case, exact_distance, exact_hit, pose, random_pose, reproducible, rng_of
from separating_axes import Polytope, overlap_depth

import collide
from collide.adapters.peers.question import ask

EYE = np.eye(4)
SIZES = ((1, 0.5, 0), (0, 1, 0.5), (1, 0, 0.5), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0))


def aligned_signed_distance(size_a, size_b, t) -> float:
    """Of boxes with parallel edges, B's middle at t from A's: the gap, or minus the shortest way out."""
    over = 0.5 * (np.array(size_a) + size_b) - np.abs(t)
    return -float(over.min()) if (over >= 0.0).all() else float(np.linalg.norm(np.minimum(over, 0.0)))


@pytest.mark.many(4)
@pytest.mark.parametrize("size", SIZES)
def test_boxes_with_parallel_edges(size):
    rng, seen, flat = rng_of("flat", size), [0, 0, 0], collide.Box(size)
    for _ in range(100):
        partner = tuple(rng.integers(0, 5, 3) / 4.0)
        t = rng.integers(-5, 6, 3) / 8.0
        case = Case(flat, collide.Box(partner), EYE, pose(t=t))
        with reproducible(case):
            truth = aligned_signed_distance(size, partner, t)
            for c in (case, case.swapped()):
                r = collide.distance(*c)
                assert r.hit == collide.collide(*c) == (truth <= 0.0) and r.certified
                assert r.distance == pytest.approx(truth, abs=1e-15)
                collide.verify(*c, r)
            near = collide.contacts(*case, margin=0.25)
            assert (len(near) > 0) == (truth <= 0.25)
            assert not len(near) or near.distance.min() == pytest.approx(truth, abs=1e-12)
        seen[1 + int(np.sign(truth))] += 1
    assert min(seen) >= (0 if size == (0, 0, 0) else 2), seen


@pytest.mark.parametrize("size", SIZES)
def test_turned_boxes_and_rounded_partners_in_fractions(size):
    rng, hits = rng_of("flat and turned", size), 0
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    partners = (
        collide.Sphere(0.25), collide.Capsule(0.125, 0.5), collide.Box((0.5, 1, 0.75)), collide.Box((0.75, 0, 1)),
        collide.ConvexHull(rng.integers(-4, 5, (9, 3)) / 8.0), collide.ConvexHull(corners, radius=0.125),
    )
    for k in range(60):
        on_lattice = k % 2 == 0
        R = LATTICE_ROTATIONS[k % len(LATTICE_ROTATIONS)] if on_lattice else random_pose(rng)[:3, :3]
        t = rng.integers(-5, 6, 3) / 8.0 if on_lattice else rng.normal(size=3) * 0.5
        case = Case(collide.Box(size), partners[k % len(partners)], pose(t=(0.5, 0.25, 0)), pose(R, t))
        with reproducible(case):
            hit = exact_hit(case)
            r = collide.distance(*case)
            assert r.hit == collide.collide(*case) == hit
            assert hit or abs(float(exact_distance(case) - r.upper)) <= 4e-15
            collide.verify(*case, r)
        hits += hit
    assert 3 <= hits <= 57, hits


def test_depths_are_those_of_separating_axes():
    rng, seen = rng_of("flat depths"), 0
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    for _ in range(60):
        size, solid = rng.permutation([1.0, 0.5, 0.0]), rng.uniform(0.3, 1.0, 3)
        case = Case(collide.Box(size), collide.Box(solid), random_pose(rng, 0.2), random_pose(rng, 0.2))
        thin = np.where(size == 0.0, 1e-13, size)  # qhull wants an inside
        A = Polytope(corners * thin @ case.X_WA[:3, :3].T + case.X_WA[:3, 3])
        B = Polytope(corners * solid @ case.X_WB[:3, :3].T + case.X_WB[:3, 3])
        with reproducible(case):
            depth, r = overlap_depth(A, B), collide.distance(*case)
            assert (r.distance < 0.0) == (depth > 1e-12) and r.certified
            if depth > 0.0:
                assert r.distance == pytest.approx(-depth, abs=1e-12)
                seen += 1
                moved = case.with_b_moved((1 + 1e-9) * -r.distance * r.normal)
                assert not collide.collide(*moved)
    assert seen >= 30, seen


def test_every_query_takes_them():
    sheet, ball, ring = collide.Box((2, 1, 0)), collide.Sphere(0.25), collide.Mesh(*block_ring())
    up = pose(t=(0.5, 0.25, 1.0))
    assert collide.collide(sheet, ball, EYE, pose(t=(0, 0, 0.25))) and not collide.collide(sheet, ball, EYE, up)
    for partner, gap in ((ball, 0.75), (collide.Cylinder(0.25, 0.5), 0.75), (collide.Ellipsoid((1, 1, 0.5)), 0.5)):
        assert collide.distance(sheet, partner, EYE, up).distance == pytest.approx(gap, abs=1e-9)
    assert collide.distance(sheet, collide.Halfspace((0, 0, 1), -0.5), EYE, EYE).distance == 0.5
    assert collide.distance(sheet, collide.Plane((0, 0, 1), 1.0, 0.5), EYE, EYE).distance == pytest.approx(0.75)
    assert collide.distance(sheet, collide.PointCloud([(0, 0, 0.5)], 0.125), EYE, EYE).distance == 0.375
    assert collide.collide(sheet, ring, EYE, EYE) == collide.collide(
        collide.ConvexHull([(-1, -0.5, 0), (1, -0.5, 0), (1, 0.5, 0), (-1, 0.5, 0)]), ring, EYE, EYE
    )
    c = collide.contacts(collide.Box((1, 1, 1)), sheet, pose(t=(0, 0, -0.5)), EYE)
    assert len(c) == 4 and np.allclose(np.abs(c.normal[:, 2]), 1.0) and np.allclose(c.distance, 0.0)
    r = collide.raycast(sheet, EYE, [(0.5, 0.25, 3), (0.5, 0.25, -3), (2, 0.25, 3), (3, 0, 0)], [
        (0, 0, -1), (0, 0, 1), (0, 0, -1), (-1, 0, 0)
    ])
    assert r.hit.tolist() == [True, True, False, True] and r.distance[[0, 1, 3]].tolist() == [3.0, 3.0, 2.0]
    points = [(0.5, 0.5, 0), (0.5, 0.5, 1e-300), (1.1, 0, 0)]
    assert collide.contains(sheet, EYE, points).tolist() == [True, False, False]
    cast = collide.shape_cast(ball, pose(t=(0, 0, 2)), (0, 0, -1), sheet, EYE)
    assert cast.hit and cast.distance == pytest.approx(1.75, abs=1e-9)
    t = collide.time_of_impact(ball, sheet, pose(t=(0, 0, 2)), pose(t=(0, 0, -2)), EYE, EYE)
    assert t.hit and t.lower <= 1.75 / 4 <= t.upper
    world = collide.World()
    world.add(sheet, name="sheet", static=True)
    world.add(ball, pose(t=(0.5, 0, 0.5)), name="ball")
    world.add(collide.Compound([(sheet, EYE), (sheet, pose(t=(0, 0, 2)))]), pose(t=(0, 0, 3)), name="shelf")
    assert sorted(world.distances()["distance"].tolist()) == pytest.approx([0.25, 2.25, 3.0], abs=1e-12)
    assert world.raycast((0, 0.25, -1), (0, 0, 1)).names == ["sheet"]
    made = collide.tessellate(sheet)
    assert made.deviation == 0.0 and len(made.vertices) == 4 and len(made.faces) == 4
    assert len(collide.tessellate(collide.Box((1, 0, 0))).faces) == 0 and len(ask([(sheet, ball, EYE, up)]).pairs) == 1
    signless = collide.Box((1, -0.0, 2))
    assert signless == collide.Box(1, 0, 2) and repr(signless) == "Box(size=[1.0, 0.0, 2.0])"


@pytest.mark.parametrize("query", [collide.boolean, collide.overlap_volume])
def test_what_needs_an_inside_says_so(query):
    more = ("union",) if query is collide.boolean else ()
    with pytest.raises(collide.InvalidArgument, match="has no inside: the points of this Box lie in one plane"):
        query(collide.Mesh(*block_ring()), collide.Box((1, 1, 0)), EYE, EYE, *more)
