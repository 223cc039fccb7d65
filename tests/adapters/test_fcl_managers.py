"""python-fcl's managers on collide: every pair, default callbacks in batches, callbacks that end, raise and prune."""

from __future__ import annotations

import math

import numpy as np
import pytest
from unit_cube import CORNERS, FACETS

from collide.adapters.hosts import fcl_api as fcl
from collide.errors import InvalidArgument, InvalidPose, UnsupportedQuery


def cube_mesh():
    model = fcl.BVHModel()
    model.beginModel(12, 8)
    model.addSubModel(CORNERS, FACETS)
    model.endModel()
    return model


def at(geometry, *translation):
    return fcl.CollisionObject(geometry, fcl.Transform(np.array(translation, dtype=float)))


def scattered(n: int, seed: int):
    rng = np.random.default_rng(seed)
    shapes = [fcl.Box(0.5, 0.4, 0.3), fcl.Sphere(0.3), fcl.Capsule(0.1, 0.5), cube_mesh(), fcl.Cone(0.3, 0.4)]
    return [
        fcl.CollisionObject(shapes[k % 5], fcl.Transform(rng.normal(size=4), rng.uniform(-2, 2, 3))) for k in range(n)
    ]


def test_managers_find_all_pairs():
    objects, guests = scattered(60, 1), scattered(30, 2)
    manager, guest_manager = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(objects)
    guest_manager.registerObjects(guests)
    manager.setup()

    def asked(*who):
        found = set()

        def callback(a, b, cdata):
            assert cdata == "data"
            if fcl.collide(a, b):
                found.add(frozenset((id(a), id(b))))

        manager.collide(*who, "data", callback)
        return found

    def truth(pairs):
        return {frozenset((id(a), id(b))) for a, b in pairs if fcl.collide(a, b)}

    for moves in (0, 3, 40):
        for k in range(moves):
            objects[k].setTranslation(np.random.default_rng(k).uniform(-2, 2, 3))
        expected = truth((a, b) for i, a in enumerate(objects) for b in objects[i + 1 :])
        assert len(expected) > 5 and asked() == expected
        assert asked(guest_manager) == truth((a, b) for a in objects for b in guests)
        assert asked(guests[0]) == truth((a, guests[0]) for a in objects)
    data = fcl.DistanceData(fcl.DistanceRequest(True, True))
    far = [at(fcl.Sphere(0.1), 10.0 * k * k, 0, 0) for k in range(1, 8)]
    far_manager = fcl.DynamicAABBTreeCollisionManager()
    far_manager.registerObjects(far)
    far_manager.distance(data, fcl.defaultDistanceCallback)
    assert math.isclose(data.result.min_distance, 29.8) and data.result.o1 is far[0]._geometry
    data = fcl.DistanceData()
    far_manager.distance(at(fcl.Sphere(0.1), 165.0, 0, 0), data, fcl.defaultDistanceCallback)
    assert math.isclose(data.result.min_distance, 4.8)
    manager.unregisterObject(objects[0])
    assert manager.size() == 59 and objects[0] not in manager.getObjects()
    manager.clear()
    assert manager.empty() and asked() == set()


def test_callbacks_end_raise_and_prune():
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([at(fcl.Sphere(1), 0, 0, 0), at(fcl.Sphere(1), 1, 0, 0), at(fcl.Sphere(1), 0, 1, 0)])
    calls = []
    manager.collide(None, lambda a, b, cdata: calls.append(1) or True)
    assert len(calls) == 1
    with pytest.raises(ZeroDivisionError):
        manager.collide(None, lambda a, b, cdata: 1 / 0)
    for wrong in ((1,), (None, 3), (3, None, print), ()):
        with pytest.raises(ValueError, match="give"):
            manager.collide(*wrong)
    data = fcl.CollisionData()
    manager.collide(data, fcl.defaultCollisionCallback)
    assert data.result.is_collision and data.done and len(data.result.contacts) == 2


# --- default callbacks, in batches --------------------------------------------------------------


def one_by_one(default):
    """The same callback, not recognised: every pair is asked alone."""
    return lambda a, b, cdata: default(a, b, cdata)


def crowd(rng, n: int, spread: float) -> list:
    shapes = [fcl.Box(0.5, 0.4, 0.3), fcl.Sphere(0.3), fcl.Capsule(0.1, 0.5), cube_mesh(), fcl.Cone(0.3, 0.4),
              fcl.Plane(np.array([0.0, 0.6, 0.8]), 0.1), fcl.Halfspace(np.array([1.0, 0.0, 0.0]), -0.9 * spread),
              fcl.OcTree(0.0001, bytes([3, 0, 0, 0x80])), fcl.Ellipsoid(0.2, 0.3, 0.1)]
    kinds = rng.choice(9, n, p=[0.2, 0.2, 0.15, 0.1, 0.1, 0.01, 0.01, 0.03, 0.2])
    poses = [fcl.Transform(rng.normal(size=4), rng.uniform(-spread, spread, 3)) for _ in kinds]
    return [fcl.CollisionObject(shapes[k], tf) for k, tf in zip(kinds, poses)]


def contact_values(result):
    return result.is_collision, [
        (c.o1, c.o2, c.b1, c.b2, c.normal.tolist(), c.pos.tolist(), c.penetration_depth) for c in result.contacts
    ]


@pytest.mark.many(6)
@pytest.mark.parametrize("seed", range(8))
def test_batches_say_what_callbacks_would(seed):
    """The same contacts in the same order, bit by bit, and the same least distance."""
    rng = np.random.default_rng(40 + seed)
    n, spread = int(rng.integers(20, 160)), rng.uniform(1.0, 4.0)
    mine, theirs = crowd(rng, n, spread), crowd(rng, 40, spread)
    manager, other = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(mine)
    other.registerObjects(theirs)
    big = at(fcl.Sphere(0.8 * spread), 0.0, 0.0, 0.0)
    n_contacts = 0
    for who in ((), (other,), (big,), (theirs[0],)):
        for limit, with_contacts in ((1, False), (1, True), (7, True), (1000, True), (1000, False), (0, True)):
            results = []
            for callback in (fcl.defaultCollisionCallback, one_by_one(fcl.defaultCollisionCallback)):
                cdata = fcl.CollisionData(fcl.CollisionRequest(limit, with_contacts))
                manager.collide(*who, cdata, callback)
                results.append((contact_values(cdata.result), cdata.done))
            n_contacts += len(results[0][0][1])
            assert results[0] == results[1], f"seed {40 + seed}, {len(who)} other, limit {limit}, {with_contacts}"
        for signed in (False, True):
            results = []
            for callback in (fcl.defaultDistanceCallback, one_by_one(fcl.defaultDistanceCallback)):
                cdata = fcl.DistanceData(fcl.DistanceRequest(True, signed))
                manager.distance(*who, cdata, callback)
                results.append(cdata.result.min_distance)
            both_met = results[0] <= 0.0 and results[1] <= 0.0  # whichever pair that meets came first
            assert both_met or abs(results[0] - results[1]) < 1e-12, f"seed {40 + seed}, {results}"
    assert n_contacts > 100


@pytest.mark.parametrize("seed", range(6))
def test_least_distances_are_the_least(seed):
    """Of balls, whose distances are known, however far apart they are."""
    rng = np.random.default_rng(60 + seed)
    n, spread = int(rng.integers(2, 400)), 10.0 ** rng.uniform(1, 4)
    centres, radii = rng.uniform(-spread, spread, (n, 3)), rng.uniform(0.001, 0.2, n)
    manager, rest = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
    balls = [at(fcl.Sphere(r), *c) for r, c in zip(radii, centres)]
    manager.registerObjects(balls)
    rest.registerObjects(balls[n // 2 :])
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2) - radii[:, None] - radii[None]
    gaps[np.tril_indices(n)] = np.inf
    lone = at(fcl.Sphere(0.1), *rng.uniform(-spread, spread, 3))
    from_lone = np.linalg.norm(centres - lone.getTranslation(), axis=1) - radii - 0.1
    half = fcl.DynamicAABBTreeCollisionManager()
    half.registerObjects(balls[: n // 2])
    questions = [(manager, (), gaps.min()), (manager, (lone,), from_lone.min())]
    if n > 1:
        questions.append((half, (rest,), gaps[: n // 2, n // 2 :].min()))
    for asked, who, truth in questions:
        for callback in (fcl.defaultDistanceCallback, one_by_one(fcl.defaultDistanceCallback)):
            cdata = fcl.DistanceData()
            asked.distance(*who, cdata, callback)
            expected = truth if truth > 0.0 else -1.0
            assert math.isclose(cdata.result.min_distance, expected, rel_tol=1e-12), f"seed {60 + seed}, {len(who)}"


def test_what_has_no_answer_is_told_as_by_a_single_call():
    """Also where the pair stands late in a batch."""
    manager = fcl.DynamicAABBTreeCollisionManager()
    objects = [at(fcl.Box(1, 1, 1), 0.01 * k, 0, 0) for k in range(60)]
    manager.registerObjects(objects)
    wanted = fcl.CollisionRequest(num_max_contacts=100000)
    objects[55].setRotation(2.0 * np.eye(3))
    with pytest.raises(InvalidPose):
        manager.collide(fcl.CollisionData(wanted), fcl.defaultCollisionCallback)
    objects[55].setRotation(np.eye(3))
    objects[58] = at(fcl.BVHModel(), 0, 0, 0)
    manager.registerObject(objects[58])
    with pytest.raises(InvalidArgument, match="endModel"):
        manager.collide(fcl.CollisionData(wanted), fcl.defaultCollisionCallback)
    manager.unregisterObject(objects[58])
    with pytest.raises(UnsupportedQuery, match="cost"):
        manager.collide(fcl.CollisionData(fcl.CollisionRequest(9, enable_cost=True)), fcl.defaultCollisionCallback)


def test_objects_may_come_and_go_within_callbacks():
    manager = fcl.DynamicAABBTreeCollisionManager()
    objects = [at(fcl.Sphere(1), 0.1 * k, 0, 0) for k in range(50)]
    manager.registerObjects(objects)
    seen = []

    def callback(a, b, cdata):
        seen.append((a, b))
        manager.unregisterObject(a)
        manager.registerObject(at(fcl.Sphere(1), 0, 0, 0))

    manager.collide(None, callback)
    assert len(seen) > 400 and {obj for pair in seen for obj in pair} <= set(objects)
    with pytest.raises(TypeError, match="CollisionObject"):
        manager.update([3])
