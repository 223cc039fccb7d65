"""Primitives: two names of one length, three ways to give three, normals of any length, limits of every number."""

from __future__ import annotations

import math
from fractions import Fraction

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


def test_plain_numbers_make_what_any_numbers_make():
    """Three of Python's own numbers are looked at one by one, all else by numpy: the same array, the same errors."""
    wanted = np.array([1.0, 2.0, 0.5])
    ways = (
        (1, 2, 0.5), [1, 2.0, 0.5], wanted, wanted[::-1][::-1], wanted.astype(np.float32), tuple(wanted),
        (Fraction(1), 2, 0.5), (np.int8(1), 2, 0.5), wanted.astype(object), (True, 2, 0.5),
    )
    for values in ways:
        size = Box(values).size
        assert type(size) is np.ndarray and size.dtype == np.float64 and size.tobytes() == wanted.tobytes(), values
        assert not size.flags.writeable and size is not values and Box(*values).size.tobytes() == wanted.tobytes()
    for values, words in (
        ((1, 2, 0.0), "size.z must be > 0"), ((1, -2, 1), "size.y must be > 0"), ((10**400, 1, 1), "finite"),
        ((1, math.nan, 1), "finite"), ((1, 2e50, 1), "size"), ((1, 1e-51, 1), "size.y must lie within"),
        ((1, 2), "shape"), (np.ones((3, 1)), "shape"), (np.ones((3, 3)), "shape"), ((1, 2, None), "real number"),
        ((1, 2, "3"), "real numbers"), ((1, (1,), 1), "rows of different lengths"),
    ):
        with pytest.raises(InvalidShape, match=words):
            Box(values)
    for radius in (True, 1, 1.0, np.float32(1), Fraction(1)):
        assert type(Sphere(radius).radius) is float


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
