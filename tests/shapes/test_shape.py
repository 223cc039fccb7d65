"""Shapes are values: immutable, equal and hashed by their numbers, the same after a pickle."""

from __future__ import annotations

import copy
import pickle

import naive
import numpy as np
import pytest
from naive import Case, random_pose, rng_of

import collide
from collide.lowering.parts import parts_of

EYE = np.eye(4)


def shapes(seed: str = "values"):
    made = naive.one_of_each(rng_of(seed))
    made["hull with faces"] = collide.ConvexHull(np.eye(3), faces=[[0, 1, 2]], radius=0.25)
    made["nested"] = collide.Compound([(made["Compound"], EYE), (made["Box"], naive.pose(t=(1, 2, 3)))])
    return made


NAMES = tuple(shapes())


def arrays_of(shape):
    """Every array a shape hands out."""
    for field in (*type(shape).__slots__, *shape._fields):
        value = getattr(shape, field, None)  # worked out when first asked for
        if isinstance(value, np.ndarray):
            yield value
    if isinstance(shape, collide.Compound):
        for part, X in shape.items:
            yield X
            yield from arrays_of(part)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_about_a_shape_can_be_changed(name):
    shape = shapes()[name]
    for field in shape._fields:
        with pytest.raises(AttributeError, match="immutable"):
            setattr(shape, field, 1.0)
        with pytest.raises(AttributeError, match="immutable"):
            delattr(shape, field)
    with pytest.raises(AttributeError):
        shape.colour = "red"
    for array in arrays_of(shape):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("way", ["pickle", "copy", "deepcopy"])
def test_copies_are_equal_and_read_only(name, way):
    shape = shapes()[name]
    for used in (False, True):  # before and after a query has packed it
        if used:
            parts_of(shape)
        for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1) if way == "pickle" else (0,):
            other = {
                "pickle": lambda p=protocol: pickle.loads(pickle.dumps(shape, p)),
                "copy": lambda: copy.copy(shape),
                "deepcopy": lambda: copy.deepcopy(shape),
            }[way]()
            assert type(other) is type(shape) and other == shape and hash(other) == hash(shape)
            assert all(not array.flags.writeable for array in arrays_of(other))
            assert repr(other) == repr(shape)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "Halfspace"])
def test_a_pickled_shape_answers_with_the_same_bits(name):
    rng = rng_of("pickled", name)
    shape, ball = shapes()[name], collide.Box((0.3, 0.4, 0.5))
    again = pickle.loads(pickle.dumps(shape))
    for _ in range(4):
        case = Case(shape, ball, random_pose(rng, 0.5), random_pose(rng, 0.5))
        assert not naive.same_bits(collide.distance(*case).rows, collide.distance(*case._replace(A=again)).rows)


@pytest.mark.parametrize("name", NAMES)
def test_equality_goes_by_value(name):
    one, again, other = shapes()[name], shapes()[name], shapes("other")[name]
    assert one == again and one is not again and hash(one) == hash(again)
    assert len({one, again}) == 1
    assert one != "a shape" and one != None
    if name != "hull with faces":
        assert one != other and len({one, other}) == 2


def test_kinds_are_never_equal():
    assert len(set(shapes().values())) == len(NAMES)
    assert collide.Cylinder(1, 2) != collide.Cone(1, 2)
    assert collide.Capsule(1, 2) != collide.Cylinder(1, 2)


def test_negative_zero_is_zero():
    assert collide.ConvexHull([[0.0, 0, 0]]) == collide.ConvexHull([[-0.0, 0, 0]])
    assert hash(collide.ConvexHull([[0.0, 0, 0]])) == hash(collide.ConvexHull([[-0.0, 0, 0]]))


def test_the_hash_does_not_need_what_a_query_builds():
    shape = shapes()["HPolytope"]
    before = hash(shape)
    parts_of(shape)
    assert hash(shape) == before


def test_arrays_given_stay_the_callers_own():
    points = np.eye(3)
    hull = collide.ConvexHull(points)
    points[0, 0] = 7.0
    assert hull.points[0, 0] == 1.0 and points.flags.writeable
    X = np.eye(4)
    compound = collide.Compound([(hull, X)])
    X[0, 3] = 5.0
    assert compound.items[0][1][0, 3] == 0.0 and X.flags.writeable
    world = collide.World()
    world.add(hull, X, name="hull")
    X[0, 3] = 9.0
    assert world.body("hull").X_WB[0, 3] == 5.0
    with pytest.raises(ValueError, match="read-only"):
        world.body("hull").X_WB[0, 3] = 1.0


def test_integers_and_lists_are_fine():
    assert collide.Box([1, 2, 3]) == collide.Box(np.array([1.0, 2.0, 3.0]))
    assert collide.Sphere(1) == collide.Sphere(1.0) == collide.Sphere(np.float32(1))
    assert collide.ConvexHull([[0, 0, 0], [1, 0, 0]]) == collide.ConvexHull(np.array([[0, 0, 0], [1, 0, 0]], dtype=int))


def test_repr_is_short_and_names_the_numbers():
    for shape in shapes().values():
        assert type(shape).__name__ in repr(shape)
        assert len(repr(shape)) < 160 or isinstance(shape, collide.Compound)  # see the open faults
    assert repr(collide.Sphere(0.5)) == "Sphere(radius=0.5)"


def test_results_cannot_be_confused_with_their_rows():
    r = collide.distance(collide.Sphere(1), collide.Sphere(1), EYE, naive.pose(t=(3, 0, 0)))
    r.normal[0] = 9.0  # a copy of a single answer's vector
    assert r.normal[0] == 1.0
    assert isinstance(r.distance, float) and isinstance(r.hit, bool) and len(r) == 1


def test_repeated_points_can_be_dropped():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, 0), (1, 0, 0), (-0.0, 0, 0)])
    hull = collide.ConvexHull(points, radius=0.5)
    assert np.array_equal(hull.without_repeats().points, [(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    assert hull.without_repeats().radius == 0.5
    assert hull.without_repeats().without_repeats() == hull.without_repeats()
