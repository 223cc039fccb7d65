"""Batches of pairs with a mesh: the bytes of single calls, whatever is culled, broadcast, swapped or shared among
threads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import random_pose, rng_of
from surfaces import joined

import collide
from collide.errors import InvalidPose
from collide.lowering.facet_bodies import body_of
from collide.narrowphase.facets.facet_kernel_calls import balls_farther, core_hits, states
from collide.narrowphase.facets.mesh_batches import pair_hits, pair_rows, pair_states, rows_within
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT
from collide.transforms import LARGEST

SPREADS = (0.3, 2.5)


def meshes(rng) -> dict[str, collide.Mesh]:
    return {
        "box": collide.Mesh(*box()),
        "ring": collide.Mesh(*block_ring()),
        "sphere": collide.Mesh(*bumpy_sphere(60)),
        "two parts": collide.Mesh(*joined(box(), box((3, 0, 0), (4, 1, 1)))),
        "soup": collide.Mesh(*soup(rng, 12)),
    }


def partners(rng) -> dict[str, collide.Shape]:
    """One of every method of the table, some small enough to be swallowed."""
    ring = collide.Mesh(*block_ring())
    return {
        "mesh": collide.Mesh(*box()),
        "box": collide.Box((0.2, 0.2, 0.2)),
        "ball": collide.Sphere(0.25),
        "rounded hull": collide.ConvexHull(rng.normal(size=(9, 3)) * 0.3, radius=0.1),
        "cylinder": collide.Cylinder(0.3, 0.8),
        "half-space": collide.Halfspace((0, 0, 1), 0.1),
        "compound": collide.Compound([(collide.Box((1, 1, 1)), np.eye(4)), (ring, random_pose(rng, 0.5))]),
    }


def poses(rng, n: int, spread: float) -> np.ndarray:
    return np.array([random_pose(rng, spread) for _ in range(n)])


@pytest.mark.many(6)
@pytest.mark.parametrize("partner", list(partners(rng_of("names"))))
def test_batches_are_single_calls_broadcast_and_swapped(partner):
    rng = rng_of("mesh batches", partner)
    n_hits = n_apart = 0
    for name, A in meshes(rng).items():
        B = partners(rng)[partner]
        for spread in SPREADS:
            X_WA, X_WB = poses(rng, 4, spread), poses(rng, 4, spread)
            hits = collide.collide(A, B, X_WA, X_WB)
            single = [collide.collide(A, B, X, Y) for X, Y in zip(X_WA, X_WB)]
            assert hits.tolist() == single == collide.collide(B, A, X_WB, X_WA).tolist(), (name, spread)
            fixed = [collide.collide(A, B, X_WA[0], Y) for Y in X_WB]
            assert collide.collide(A, B, X_WA[:1], X_WB).tolist() == fixed, (name, spread)
            for limit in (0.0, 0.5, math.inf):
                asked_for = {"max_distance": limit, "signed": partner != "compound"}  # its depths take seconds
                rows = collide.distance(A, B, X_WA, X_WB, **asked_for).rows
                single_rows = [collide.distance(A, B, X, Y, **asked_for).rows[0] for X, Y in zip(X_WA, X_WB)]
                assert all(row.tobytes() == want.tobytes() for row, want in zip(rows, single_rows)), (
                    name,
                    spread,
                    limit,
                )
                swapped = collide.distance(B, A, X_WB, X_WA, **asked_for)
                assert np.array_equal(swapped.rows["distance"], rows["distance"]), (name, spread, limit)
            n_hits, n_apart = n_hits + int(hits.sum()), n_apart + int((~hits).sum())
    assert n_hits > 3 and n_apart > 3


def test_rows_beyond_a_limit_are_bounds_of_the_distance():
    """What balls cull is farther than the limit, and says so."""
    rng = rng_of("mesh batches", "limits")
    n_beyond = 0
    for name, A in meshes(rng).items():
        for partner, B in partners(rng).items():
            if partner == "half-space":
                continue
            X_WA, X_WB = poses(rng, 4, 3.0), poses(rng, 4, 3.0)
            true = collide.distance(A, B, X_WA, X_WB)
            limit = float(rng.uniform(0.0, 4.0))
            rows = collide.distance(A, B, X_WA, X_WB, max_distance=limit)
            assert np.array_equal(rows.beyond, true.lower > limit), (name, partner)
            far = rows.beyond
            assert (rows.lower[far] >= limit).all() and (rows.lower[far] <= true.upper[far]).all(), (name, partner)
            assert rows.distance[~far].tolist() == true.distance[~far].tolist(), (name, partner)
            n_beyond += int(far.sum())
    assert n_beyond > 30


def test_balls_are_farther_only_where_bodies_are():
    """Near the margin, for poses off rotations by as much as is accepted, and for huge and tiny bodies."""
    rng = rng_of("mesh batches", "balls")
    n_culled = 0
    for size in (1e-6, 1.0, 1e6):
        vertices, faces = box()
        mesh = collide.Mesh(vertices * size, faces)
        numbers = body_of(mesh).tree.numbers
        X_WA, X_WB = poses(rng, 200, 0.0), poses(rng, 200, 0.0)
        X_WA[:, :3, :3] *= 1 + 1e-5
        X_WB[:, :3, 3] = rng.normal(size=(200, 3)) * 3.0 * size
        centres = [X[:, :3, :3] @ numbers[:3] + X[:, :3, 3] for X in (X_WA, X_WB)]
        reach = numbers[6] * ((1 + 1e-5) + 1.0)
        gaps = np.linalg.norm(centres[1] - centres[0], axis=1) - reach
        for margin in (0.0, 0.3 * size):
            culled = balls_farther(numbers, numbers, X_WA, X_WB, margin)
            assert not (culled & (gaps <= margin)).any(), size
            assert culled[gaps > margin + 1e-3 * size].all(), size
            n_culled += int(culled.sum())
    assert n_culled > 100


def test_poses_that_are_none_are_named():
    A, B = collide.Mesh(*box()), collide.Mesh(*block_ring())
    for ask in (collide.collide, lambda *a, **k: collide.distance(*a, max_distance=0.1, **k)):
        X_WA, X_WB = np.tile(np.eye(4), (5, 1, 1)), np.tile(collide.pose((9, 0, 0)), (5, 1, 1))
        X_WB[3, 0, 1] = 0.5
        with pytest.raises(InvalidPose, match=r"X_WB\[3\] is not a rotation"):
            ask(A, B, X_WA, X_WB)
        ask(A, B, X_WA, X_WB, check_poses=False)
        X_WA[2, 1, 1] = math.nan
        with pytest.raises(InvalidPose, match=r"X_WA\[2\]"):
            ask(A, B, X_WA, X_WB, check_poses=False)
        X_WA[2] = np.eye(4)
        X_WB[3] = np.diag([1.0, 1.0, 0.0, 1.0])
        with pytest.raises(InvalidPose, match="pose 3: a matrix that is singular"):
            ask(A, B, X_WA, X_WB, check_poses=False)
        X_WB[3] = np.eye(4)
        X_WB[4, 0, 3] = 2.0 * LARGEST
        with pytest.raises(InvalidPose, match=r"X_WB\[4\] exceeds"):
            ask(A, B, X_WA, X_WB)


def test_poses_on_the_brink_of_the_tolerance_are_answered():
    """Kernels round the check otherwise than numpy: what it accepts is answered, wherever it stands in the batch."""
    A, B = collide.Mesh(*box()), collide.Box((1, 1, 1))
    X = np.tile(np.eye(4), (64, 1, 1))
    X[:, 0, 0] = np.sqrt(1 + 1e-4 + np.linspace(-3, 3, 64) * 2.0**-53)
    n_accepted = 0
    for k in range(64):
        try:
            want = collide.collide(A, B, np.eye(4), X[k])
        except InvalidPose:
            continue
        n_accepted += 1
        assert collide.collide(A, B, np.eye(4)[None], np.stack([np.eye(4), X[k], np.eye(4)])).tolist() == [
            True,
            want,
            True,
        ]
    assert 0 < n_accepted


def test_front_doors_agree():
    rng = rng_of("mesh batches", "front doors")
    for A in meshes(rng).values():
        for B in partners(rng).values():
            X_WA, X_WB = poses(rng, 1, 0.0), poses(rng, 6, 1.5)
            hits = pair_hits(A, B, X_WA, X_WB)
            rows = pair_rows(A, B, X_WA, X_WB, limit=0.5)
            assert (pair_states(A, B, X_WA, X_WB) != APART).tolist() == hits.tolist() == rows["hit"].tolist()
            within = rows_within(A, B, X_WA, X_WB, 0.5)
            near = ~rows["beyond"]
            assert within["beyond"].tolist() == rows["beyond"].tolist()
            assert within[near].tobytes() == rows[near].tobytes()


def test_points_inside_both_are_told_of_swallowed_parts():
    A, B = body_of(collide.Mesh(*box((-2,) * 3, (2,) * 3))), body_of(collide.Mesh(*box((0, 0, 0), (0.5, 0.5, 0.5))))
    X_WB = np.stack([collide.pose((0.1, 0, 0)), collide.pose((1.8, 0, 0)), collide.pose((9, 0, 0))])
    for order in (lambda *pair: pair, lambda *pair: pair[::-1]):
        bodies, X = order(A, B), order(np.eye(4)[None], X_WB)
        hits = core_hits(*bodies, *X)
        assert hits.core.tolist() == [True, True, False]
        assert np.isnan(hits.inside[1:]).all() and (np.abs(hits.inside[0]) < 1).all()
        assert states(*bodies, *X).tolist() == [HIT, HIT, APART]


def test_no_poses_make_no_answers():
    A, none = collide.Mesh(*box()), np.zeros((0, 4, 4))
    for B in partners(rng_of("none")).values():
        assert collide.collide(A, B, none, np.eye(4)[None]).shape == (0,)
        assert len(collide.distance(A, B, none, none).rows) == 0
