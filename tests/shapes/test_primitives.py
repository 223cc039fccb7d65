"""Primitives: two names of one length, three ways to give three, normals of any length, limits of every number."""

from __future__ import annotations

import math

import numpy as np
import pytest

from collide import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, InvalidShape, Sphere
from collide.transforms import LARGEST, SMALLEST


@pytest.mark.parametrize("kind", [Capsule, Cylinder, Cone])
def test_length_and_height_are_one_number(kind):
    assert kind(0.5, 2.0) == kind(0.5, length=2.0) == kind(0.5, height=2.0) == kind(radius=0.5, height=2)
    shape = kind(0.5, 2.0)
    assert (shape.radius, shape.length) == (0.5, 2.0) and isinstance(shape.length, float)
    for arguments, got in (({}, "neither"), ({"length": 1.0, "height": 1.0}, "both")):
        with pytest.raises(InvalidShape, match=f"{kind.__name__}: give one of length and height.*got {got}"):
            kind(0.5, **arguments)


def test_a_capsule_alone_may_have_no_length():
    assert Capsule(0.5, 0.0).length == 0.0 and Capsule(0.5, -0.0) == Capsule(0.5, 0)
    for kind in (Cylinder, Cone):
        with pytest.raises(InvalidShape, match=f"{kind.__name__}: length must be > 0"):
            kind(0.5, 0.0)


@pytest.mark.parametrize(("kind", "field"), [(Box, "size"), (Ellipsoid, "radii")])
def test_three_lengths(kind, field):
    shape = kind((1, 2, 3))
    assert shape == kind(1, 2, 3) == kind([1.0, 2.0, 3.0]) == kind(np.array([1, 2, 3]))
    values = getattr(shape, field)
    assert values.tolist() == [1.0, 2.0, 3.0] and values.dtype == np.float64 and not values.flags.writeable
    for arguments, words in (
        (((1, 2),), "shape"), ((1, 2), "got \\(1, 2, None\\)"), (((1, -2, 3),), rf"{field}\.y must be > 0"),
        (((1, 2, math.inf),), "finite"), ((((1, 2, 3),) * 2,), "shape"), ((0, 1, 1), rf"{field}\.x"),
    ):
        with pytest.raises(InvalidShape, match=words):
            kind(*arguments)


def test_numbers_must_be_such_as_can_be_squared():
    for make in (Sphere, lambda r: Capsule(r, 1.0), lambda h: Cylinder(1.0, h), lambda r: Cone(r, 1.0)):
        for fine in (SMALLEST, 1.0, LARGEST):
            make(fine)
        for bad in (0.0, -1.0, math.nan, math.inf, SMALLEST / 2, LARGEST * 2, "1", None, [1.0]):
            with pytest.raises(InvalidShape):
                make(bad)


def test_half_spaces():
    floor = Halfspace((0, 0, 2), 1.0)
    assert floor.normal.tolist() == [0.0, 0.0, 2.0] and floor.offset == 1.0
    assert Halfspace((0, 0, 1), -3) == Halfspace([0.0, 0.0, 1.0], -3.0)
    for arguments in (((0, 0, 0), 1.0), ((0, 0, math.nan), 1.0), ((0, 1), 1.0), ((0, 0, 1), math.inf)):
        with pytest.raises(InvalidShape, match="Halfspace"):
            Halfspace(*arguments)
