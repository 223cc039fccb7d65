"""Fields of hosts' contacts and results that are worked out when they are read: of the question as it was asked."""

import copy
import pickle
from functools import partial

import numpy as np
import pytest

from collide.adapters.hosts import coal_api as coal
from collide.adapters.hosts import coal_queries, fcl_facets
from collide.adapters.hosts import fcl_api as fcl
from collide.adapters.hosts.fields_when_read import FieldsWhenRead

N_PAIRS = 60


def surface(model):
    """The surface of a tetrahedron, by a host's calls."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    model.beginModel(4, 4)
    model.addSubModel(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    model.endModel()
    return model


COAL = {
    "box": lambda: coal.Box(1, 2, 3), "ball": lambda: coal.Sphere(0.7), "can": lambda: coal.Cylinder(0.5, 1.5),
    "mesh": lambda: surface(coal.BVHModelOBBRSS()), "plane": lambda: coal.Halfspace(np.array([0.0, 0, 1]), 0.1),
}
FCL = {
    "box": lambda: fcl.Box(1, 2, 3), "ball": lambda: fcl.Sphere(0.7), "can": lambda: fcl.Cylinder(0.5, 1.5),
    "mesh": lambda: surface(fcl.BVHModel()), "plane": lambda: fcl.Halfspace(np.array([0.0, 0, 1]), 0.1),
}


def values(contact, names=()):
    return [np.array(getattr(contact, name)).tolist() for name in names or contact._later]


def coal_pairs():
    rng = np.random.default_rng(7)
    for _ in range(N_PAIRS):
        first, second = rng.choice(list(COAL), 2)
        ends = [coal.Transform3s(coal.Quaternion(*rng.normal(size=4)).normalized(), rng.normal(size=3)) for _ in "12"]
        yield COAL[first](), ends[0], COAL[second](), ends[1]


def coal_answers(g1, tf1, g2, tf2):
    """A question's contacts' values read at once, and a result that nobody has read yet."""
    results = [coal.CollisionResult(), coal.CollisionResult()]
    for result in results:
        coal.collide(g1, tf1, g2, tf2, coal.CollisionRequest(), result)
    at_once = [values(c) for c in results[0].getContacts()], results[0].distance_lower_bound
    return at_once, results[1]


def test_coals_contacts_are_of_the_poses_and_shapes_that_were_asked():
    n_contacts = 0
    for g1, tf1, g2, tf2 in coal_pairs():
        at_once, later = coal_answers(g1, tf1, g2, tf2)
        tf1.setTranslation(np.full(3, 50.0))  # programs move one transform from query to query
        if isinstance(g2, coal.Box):
            g2.halfSide = np.full(3, 9.0)
        if isinstance(g1, coal.Sphere):
            g1.setSweptSphereRadius(3.0)
        n_contacts += later.numContacts()
        assert ([values(c) for c in later.getContacts()], later.distance_lower_bound) == at_once, (g1, g2)
    assert 0.2 * N_PAIRS < n_contacts < 0.9 * N_PAIRS


def test_coals_distances_are_of_the_poses_that_were_asked():
    for g1, tf1, g2, tf2 in coal_pairs():
        results = [coal.DistanceResult(), coal.DistanceResult()]
        if isinstance(g1, coal.Halfspace) and isinstance(g2, coal.Halfspace):
            continue
        for result in results:
            assert coal.distance(g1, tf1, g2, tf2, coal.DistanceRequest(), result) == result.min_distance
        at_once = values(results[0])
        tf2.setTranslation(np.full(3, 50.0))
        assert values(results[1]) == at_once


def test_fcls_contacts_are_of_the_poses_that_were_asked():
    rng, n_contacts = np.random.default_rng(8), 0
    for _ in range(N_PAIRS):
        first, second = rng.choice(list(FCL), 2)
        objects = [
            fcl.CollisionObject(FCL[name](), fcl.Transform(rng.normal(size=4), rng.normal(size=3)))
            for name in (first, second)
        ]
        results = [fcl.CollisionResult(), fcl.CollisionResult()]
        gaps = [fcl.DistanceResult(), fcl.DistanceResult()]
        for result, gap in zip(results, gaps):
            fcl.collide(*objects, fcl.CollisionRequest(enable_contact=True), result)
            fcl.distance(*objects, fcl.DistanceRequest(), gap)
        nearest = "min_distance", "nearest_points", "b1", "b2"
        at_once = [values(c) for c in results[0].contacts], values(gaps[0], nearest)
        objects[0].setTranslation(np.full(3, 50.0))
        n_contacts += len(results[1].contacts)
        assert ([values(c) for c in results[1].contacts], values(gaps[1], nearest)) == at_once, (first, second)
    assert 0.2 * N_PAIRS < n_contacts < 0.9 * N_PAIRS


def test_what_nobody_reads_is_not_worked_out(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("worked out without being asked for")

    for name in ("distance", "contacts"):
        monkeypatch.setattr(coal_queries.engine, name, refuse)
    for module in (coal_queries, fcl_facets):
        monkeypatch.setattr(module, "nearest_points", refuse)
    n_hits = 0
    for g1, tf1, g2, tf2 in coal_pairs():
        if isinstance(g1, coal.Halfspace) and isinstance(g2, coal.Halfspace):
            continue
        result = coal.CollisionResult()
        n_hits += coal.collide(g1, tf1, g2, tf2, coal.CollisionRequest(), result)
        if result.isCollision():
            with pytest.raises(AssertionError, match="without being asked"):
                result.getContact(0).normal  # noqa: B018 - reads it
    assert n_hits > 10
    first, second = (fcl.CollisionObject(surface(fcl.BVHModel())) for _ in "12")
    result = fcl.CollisionResult()
    assert fcl.collide(first, second, fcl.CollisionRequest(), result) == 1
    with pytest.raises(AssertionError, match="without being asked"):
        result.contacts[0].b1  # noqa: B018 - reads it


def test_bounds_that_nobody_reads_do_not_pile_up():
    box, far, result = coal.Box(1, 1, 1), coal.Transform3s(np.array([5.0, 0, 0])), coal.CollisionResult()
    for k in range(2 * coal_queries._MAX_BOUNDS):
        far.setTranslation(np.array([5.0 + k, 0, 0]))
        coal.collide(box, coal.Transform3s(), box, far, coal.CollisionRequest(), result)
        assert len(result._bounds_to_come) <= coal_queries._MAX_BOUNDS
    assert result.distance_lower_bound == pytest.approx(4.0)
    result.distance_lower_bound = 1.5
    assert result.distance_lower_bound == 1.5


class Fields(FieldsWhenRead):
    _later = ("a", "b")


def counted(calls):
    calls.append(1)
    return 1, [2]


def test_fields_are_worked_out_once_and_what_was_set_stays():
    calls, made = [], Fields()
    made._postpone(partial(counted, calls))
    assert {"a", "b"} <= set(dir(made)) and not calls
    made.a = 7
    assert (made.b, made.a, made.b) == ([2], 7, [2]) and len(calls) == 1
    with pytest.raises(AttributeError, match="Fields has no c"):
        made.c  # noqa: B018 - reads it
    with pytest.raises(AttributeError, match="Fields has no a"):
        Fields().a  # noqa: B018 - reads it


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda contact: pickle.loads(pickle.dumps(contact))])
def test_a_copy_has_the_fields(copied):
    box, result = coal.Box(1, 1, 1), coal.CollisionResult()
    coal.collide(box, coal.Transform3s(), box, coal.Transform3s(np.array([0.9, 0, 0])), coal.CollisionRequest(), result)
    contact = result.getContact(0)
    assert values(copied(contact)) == values(contact)
    assert copied(contact).penetration_depth == pytest.approx(-0.1)
