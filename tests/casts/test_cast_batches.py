"""Casts of mixed shapes in one batch: each is what it is alone, bit by bit; unions are the least of their items."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mesh_shapes import block_ring, box
from naive import one_of_each, random_pose, rng_of

import collide
from collide.casts.cast_arguments import checked_directions
from collide.casts.cast_batches import cast_batch
from collide.casts.convex_casts import CastRows
from collide.casts.directions import Directions
from collide.casts.leaves import leaves_of
from collide.casts.shape_cast import ShapeCasts, shape_cast
from collide.errors import InvalidArgument, UnsupportedQuery

EYE = np.eye(4)
RING, BLOCK = collide.Mesh(*block_ring()), collide.Mesh(*box((-0.3,) * 3, (0.3,) * 3))


def shapes_of(rng) -> dict[str, collide.Shape]:
    each = one_of_each(rng)
    each["Mesh"], each["Block"] = RING, BLOCK
    each["Region"] = collide.HPolytope(rng.normal(size=(4, 3)), rng.uniform(0.1, 1.0, 4), bounded=False)
    each["Mixed"] = collide.Compound([(RING, EYE), (each["Sphere"], collide.pose((0, 0, 1.5)))])
    return each


def drawn(*words, n: int):
    """A batch in which no kind follows itself."""
    rng = rng_of("cast batches", *words)
    each = shapes_of(rng)
    B = [each[name] for name in rng.permutation(list(each)).tolist()]
    movers = [each[name] for name in ("Box", "Block", "Compound", "Cone", "Mixed", "Sphere")]
    A, B = [movers[k % len(movers)] for k in range(n)], [B[k % len(B)] for k in range(n)]
    X_WA, X_WB = (np.array([random_pose(rng, 0.5) for _ in range(n)]) for _ in range(2))
    away = rng.normal(size=(n, 3))
    X_WA[:, :3, 3] += 5.0 * away / np.linalg.norm(away, axis=1)[:, None] * (np.arange(n) % 5 > 0)[:, None]
    d = X_WB[:, :3, 3] - X_WA[:, :3, 3] + 0.3 * rng.normal(size=(n, 3))
    return A, B, X_WA, X_WB, checked_directions("f", "d", d, "a cast")[0]


def some(directions: Directions, which) -> Directions:
    return Directions(np.ascontiguousarray(directions.vectors[which]), directions.exponents[which])


def test_mixed_batches_are_singles_bit_by_bit():
    n = 30
    A, B, X_WA, X_WB, directions = drawn("mixed", n=n)
    limits = directions.limits(2.0)
    batch = cast_batch(A, B, X_WA, X_WB, directions, limits)
    for k in range(n):
        one = cast_batch(A[k], B[k], X_WA[k : k + 1], X_WB[k : k + 1], some(directions, [k]), limits[k : k + 1])
        for name, a, b in zip(CastRows._fields, one, batch):
            assert a.tobytes() == b[k : k + 1].tobytes(), (k, name)
    assert 5 < batch.hit.sum() < n and batch.at_start.any() and (batch.at_start <= batch.hit).all()
    met = batch.hit
    assert (batch.t[met, 1] <= batch.t[met, 0]).all() and (batch.t[met, 0] <= batch.t[met, 2]).all()
    assert (batch.t[batch.at_start] == 0.0).all() and np.isinf(batch.t[~met]).all()
    ahead = met & ~batch.at_start
    assert (np.einsum("ij,ij->i", batch.normal, directions.vectors)[ahead] > -1e-7).all()
    np.testing.assert_allclose(np.linalg.norm(batch.normal[ahead], axis=1), 1.0, rtol=0, atol=1e-9)


def test_one_shape_and_one_pose_stand_for_all():
    A, B, X_WA, X_WB, directions = drawn("one for all", n=8)
    limits = directions.limits(math.inf)
    for a, b in ((A[1], B[2]), (collide.Box((1, 1, 1)), collide.Sphere(0.5))):
        one = cast_batch(a, b, X_WA, X_WB[:1], directions, limits)
        all_ = cast_batch([a] * 8, [b] * 8, X_WA, np.repeat(X_WB[:1], 8, axis=0), directions, limits)
        assert all(p.tobytes() == q.tobytes() for p, q in zip(one, all_))


@pytest.mark.parametrize("kind", ["Mixed", "Compound"])
def test_unions_are_met_where_their_first_item_is(kind):
    n = 14
    rng = rng_of("cast onto unions", kind)
    each = shapes_of(rng)
    A, B = each["Box"], each[kind]
    X_WA, X_WB = (np.array([random_pose(rng, 0.3) for _ in range(n)]) for _ in range(2))
    X_WA[:, 0, 3] -= 6.0
    d = checked_directions("f", "d", X_WB[:, :3, 3] - X_WA[:, :3, 3] + 0.4 * rng.normal(size=(n, 3)), "")[0]
    limits = d.limits(math.inf)
    found = cast_batch(A, B, X_WA, X_WB, d, limits)
    items = [cast_batch(A, shape, X_WA, X_WB @ X, d, limits) for shape, X in leaves_of(B)]
    t = np.array([item.t[:, 0] for item in items])
    assert (found.hit == np.isfinite(t).any(axis=0)).all() and found.hit.sum() > 6
    met = found.hit
    np.testing.assert_allclose(found.t[met, 0], t.min(axis=0)[met], rtol=0, atol=1e-8)
    clear = np.sort(t, axis=0)[1][met] - t.min(axis=0)[met] > 1e-6
    assert (found.item_b[met][clear] == t.argmin(axis=0)[met][clear]).all() and (found.item_a[met] == 0).all()


@pytest.mark.parametrize("far", [0.0, 30.0])
def test_regions_are_met_where_their_planes_are(far):
    """A corner of two planes, onto which a ball falls: by the formula of the plane that it meets last."""
    rng = rng_of("regions", far)
    region = collide.HPolytope([(0, 0, 1), (1, 0, 0)], [0.0, 1.0], bounded=False)
    ball, n = collide.Sphere(0.5), 12
    start = np.stack([rng.uniform(-4, 0.9, n), rng.uniform(-far, far + 1e-3, n), rng.uniform(2, 5, n)], axis=1)
    X_WA = np.array([collide.pose(p) for p in start])
    d = checked_directions("f", "d", np.array([(0.0, 0.0, -1.0)] * n), "")[0]
    out = cast_batch(ball, region, X_WA, EYE[None], d, d.limits(math.inf))
    assert out.hit.all() and out.proven.all()
    np.testing.assert_allclose(d.t_of(out.t[:, 0]), start[:, 2] - 0.5, rtol=0, atol=1e-9)
    up = checked_directions("f", "d", np.array([(0.0, 0.0, 1.0)] * n), "")[0]
    away = cast_batch(ball, region, X_WA, EYE[None], up, up.limits(math.inf))
    assert not away.hit.any() and away.proven.all()
    # mixed with bodies that are none
    mixed = cast_batch(ball, [region if k % 2 else ball for k in range(n)], X_WA, EYE[None], d, d.limits(math.inf))
    assert all(column[1::2].tobytes() == other[1::2].tobytes() for column, other in zip(mixed, out))


def test_no_casts_have_no_rows():
    none = Directions(np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    region = collide.HPolytope([(0, 0, 1)], [0.0], bounded=False)
    for A, B in ((collide.Sphere(1.0), RING), ([], []), (RING, collide.Sphere(1.0)), (collide.Sphere(1.0), region)):
        if isinstance(A, collide.Shape):
            assert collide.shape_cast(A, np.zeros((0, 4, 4)), np.zeros((0, 3)), B, EYE).hit.shape == (0,)
        out = cast_batch(A, B, np.zeros((0, 4, 4)), np.zeros((0, 4, 4)), none, np.zeros(0))
        assert len(out.hit) == 0 and out.t.shape == (0, 3)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_answer_the_same_bits(threads):
    rng, n = rng_of("cast threads"), 1501
    A, B = collide.Box((0.4, 0.3, 0.2)), collide.Cylinder(0.3, 0.5)
    X = np.array([collide.pose(p) for p in rng.normal(size=(n, 3)) * 2])
    d = 0.3 * rng.normal(size=(n, 3)) - X[:, :3, 3]
    one = shape_cast(A, X, d, B, EYE, max_distance=0.9)
    assert isinstance(one, ShapeCasts)
    many = collide.shape_cast([A] * n, X, d, [B] * n, EYE, max_distance=0.9, threads=threads)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(one, many)) and 0.1 < one.hit.mean() < 0.9


def test_wrong_casts_are_refused_by_name():
    ball, two, three = collide.Sphere(1.0), np.array([EYE] * 2), np.array([EYE] * 3)
    with pytest.raises(InvalidArgument, match=r"X_WA 2.*X_WB 3"):
        collide.shape_cast(ball, two, (1, 0, 0), ball, three)
    with pytest.raises(InvalidArgument, match="A 3"):
        collide.shape_cast([ball] * 3, two, (1, 0, 0), ball, EYE)
    with pytest.raises(InvalidArgument, match=r"X_WA 2.*direction_W 3"):
        collide.shape_cast(ball, two, np.ones((3, 3)), ball, EYE)
    with pytest.raises(UnsupportedQuery, match="shape_cast: A: Halfspace has no end"):
        collide.shape_cast(collide.Halfspace((0, 0, 1), 0.0), EYE, (1, 0, 0), ball, EYE)
    with pytest.raises(InvalidArgument, match="max_distance"):
        collide.shape_cast(ball, EYE, (1, 0, 0), ball, EYE, max_distance=-0.5)
    with pytest.raises(InvalidArgument, match="threads"):
        collide.shape_cast(ball, EYE, (1, 0, 0), ball, EYE, threads=0)
