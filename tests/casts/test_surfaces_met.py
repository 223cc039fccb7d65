"""`raycast` of unions and batches: a union is its leaves, a batch its rays, whatever the shape comes down to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mesh_shapes import block_ring
from naive import one_of_each, random_pose, rng_of

import collide
from collide.casts.cast_arguments import checked_rays
from collide.casts.leaves import leaves_of
from collide.casts.raycast import body_of_points, raycast, surfaces_met
from collide.errors import InvalidArgument

RING = collide.Mesh(*block_ring())


def shapes_of(rng) -> dict[str, collide.Shape]:
    each = one_of_each(rng)
    each["Mesh"] = RING
    each["Region"] = collide.HPolytope(rng.normal(size=(5, 3)), rng.uniform(0.1, 1.0, 5), bounded=False)
    each["Mixed"] = collide.Compound(
        [(RING, collide.pose((2, 0, 0))), (each["Sphere"], np.eye(4)), (each["Compound"], random_pose(rng)),
         (each["Box"], random_pose(rng))]
    )
    return each


KINDS = tuple(shapes_of(rng_of("kinds")))


def rays(rng, n: int):
    origins = rng.normal(size=(n, 3)) * 2
    return origins, 0.15 * rng.normal(size=(n, 3)) - origins


@pytest.mark.parametrize("all_hits", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_batches_are_singles_bit_by_bit(kind, all_hits):
    rng = rng_of("rays in batches", kind, all_hits)
    shape, n = shapes_of(rng)[kind], 12
    X = np.array([random_pose(rng, 0.1) for _ in range(n)])
    origins, directions = rays(rng, n)
    batch = raycast(shape, X, origins, directions, all_hits=all_hits)
    assert batch.hit.any()
    for k in range(n):
        one = raycast(shape, X[k], origins[k], directions[k], all_hits=all_hits)
        assert bool(np.all(one.hit)) == batch.hit[k]
        rows = slice(batch.starts[k], batch.starts[k + 1]) if all_hits else k
        for name in ("distance", "lower", "upper", "point", "normal", "facet", "certified", "item"):
            assert np.asarray(getattr(one, name)).tobytes() == np.asarray(getattr(batch, name)[rows]).tobytes(), name
    one_pose = raycast(shape, X[0], origins, directions, all_hits=all_hits)
    repeated = raycast(shape, np.array([X[0]] * n), origins, directions, all_hits=all_hits)
    assert all(np.array_equal(a, b) for a, b in zip(one_pose, repeated) if a is not None)


def without_repeats(places: list[tuple[float, int]]) -> list[tuple[float, int]]:
    return [p for i, p in enumerate(places)
            if not i or p[1] != places[i - 1][1] or p[0] - places[i - 1][0] > 1e-9]


@pytest.mark.parametrize("kind", ["Compound", "Mixed"])
def test_unions_are_all_their_leaves(kind):
    rng = rng_of("rays and unions", kind)
    shape, X = shapes_of(rng)[kind], random_pose(rng)
    origins, directions = rays(rng, 40)
    found = raycast(shape, X, origins, directions, all_hits=True)
    items = [raycast(s, X @ X_AS, origins, directions, all_hits=True) for s, X_AS in leaves_of(shape)]
    assert len(set(found.item.tolist())) == len(items) > 2
    for k in range(40):
        mine = slice(found.starts[k], found.starts[k + 1])
        places = sorted((t, number) for number, item in enumerate(items)
                        for t in item.distance[item.starts[k] : item.starts[k + 1]].tolist())
        # facets of a polytope count one by one, its walls in a union once
        merged = without_repeats(places)
        assert (np.diff(found.distance[mine]) >= 0.0).all()
        walls = without_repeats(list(zip(found.distance[mine].tolist(), found.item[mine].tolist())))
        assert [number for _, number in walls] == [number for _, number in merged]
        np.testing.assert_allclose([t for t, _ in walls], [t for t, _ in merged], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_first_is_the_first_of_all(kind):
    rng = rng_of("first of all hits", kind)
    shape, X = shapes_of(rng)[kind], random_pose(rng, 0.1)
    origins, directions, _ = checked_rays("f", *rays(rng, 30))
    every, first = (surfaces_met(shape, X[None], origins, directions, 1.5, every=flag) for flag in (True, False))
    assert set(every.ray.tolist()) == set(first.ray.tolist()) and len(set(first.ray.tolist())) > 5
    for events in (every, first):
        assert (np.lexsort((events.facet, events.item, events.t[:, 0], events.ray)) == np.arange(len(events.ray))).all()
        assert (0.0 <= events.t[:, 1]).all() and (events.t[:, 1] <= events.t[:, 0]).all()
        assert (events.t[:, 0] <= events.t[:, 2]).all() and (events.t[:, 1] <= 1.5).all()
    for ray in set(first.ray.tolist()):
        a, b = (events.t[np.searchsorted(events.ray, ray), 0] for events in (every, first))
        assert a == b


def test_numbers_of_rays_that_differ_are_refused():
    ball, three, two = collide.Sphere(1.0), np.ones((3, 3)), np.ones((2, 3))
    for arguments in ((np.eye(4), three, two), (np.array([np.eye(4)] * 2), three, three)):
        with pytest.raises(InvalidArgument, match="raycast"):
            raycast(ball, *arguments)
    for wrong, words in (({"max_distance": -1.0}, "max_distance"), ({"max_distance": math.nan}, "max_distance"),
                         ({"all_hits": 2}, "all_hits")):
        with pytest.raises(InvalidArgument, match=f"raycast: {words}"):
            raycast(ball, np.eye(4), (5, 0, 0), (-1, 0, 0), **wrong)
    with pytest.raises(InvalidArgument, match="shape must be a shape"):
        raycast("ball", np.eye(4), (5, 0, 0), (-1, 0, 0))


def test_no_rays_have_no_hits():
    for shape in (collide.Sphere(1.0), RING, collide.Compound([(RING, np.eye(4)), (collide.Sphere(1.0), np.eye(4))])):
        hits = raycast(shape, np.eye(4), np.zeros((0, 3)), np.zeros((0, 3)))
        assert hits.hit.shape == hits.distance.shape == (0,) and hits.point.shape == (0, 3)
        every = raycast(shape, np.eye(4), np.zeros((0, 3)), np.zeros((0, 3)), all_hits=True)
        assert every.starts.tolist() == [0] and every.distance.shape == (0,)


def test_balls_swept_over_hulls_are_no_facets():
    points = rng_of("swept").normal(size=(6, 3))
    assert body_of_points(collide.ConvexHull(points)) and not body_of_points(collide.ConvexHull(points, radius=0.1))
    hit = raycast(collide.ConvexHull(points, radius=0.1), np.eye(4), (9, 0, 0), (-1, 0, 0))
    assert hit.hit and hit.facet == -1
    assert raycast(collide.ConvexHull(points), np.eye(4), (9, 0, 0), (-1, 0, 0)).facet >= 0
