"""Primitives: two names of one length, three ways to give three, normals of any length, limits of every number."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import collide
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
        (((1, 2),), "shape"), ((1, 2), "got \\(1, 2, None\\)"), (((1, -2, 3),), rf"{field}\.y must be (>|≥) 0"),
        (((1, 2, math.inf),), "finite"), ((((1, 2, 3),) * 2,), "shape"), ((-1, 1, 1), rf"{field}\.x"),
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
        ((1, 2, -1e-60), "size.z must be ≥ 0"), ((1, -2, 1), "size.y must be ≥ 0"), ((10**400, 1, 1), "finite"),
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


def test_rounded_boxes():
    """The whole box has the lengths given; a ball meets faces, edges and corners by the closed form."""
    size, radius = np.array([1.0, 0.5, 0.75]), 0.125
    shape = Box.rounded(size, radius)
    assert isinstance(shape, collide.ConvexHull) and shape.radius == radius and len(shape.points) == 8
    rng = np.random.default_rng(0)
    hits = 0
    for p in rng.integers(-8, 9, (200, 3)) / 8.0:
        core = float(np.linalg.norm(np.maximum(np.abs(p) - (0.5 * size - radius), 0.0)))
        r = collide.distance(shape, Sphere(0.25), np.eye(4), collide.pose(p))
        assert r.hit == (core <= 0.375) or abs(core - 0.375) < 1e-15, p
        assert r.distance == pytest.approx(core - 0.375, abs=1e-15) or core == 0.0, p
        hits += bool(r.hit)
    assert 20 <= hits <= 180, hits
    low, high = (f(collide.tessellate(shape).vertices, axis=0) for f in (np.min, np.max))
    assert np.allclose(high - low, size, atol=1e-15)
    assert Box.rounded((1, 1, 1), 0.5).points.tolist() == [[0.0, 0.0, 0.0]] * 8
    ball = Box.rounded((1, 1, 1), 0.5)
    assert collide.distance(ball, Sphere(0.5), np.eye(4), collide.pose((0, 0, 2))).distance == 1.0
    assert Box.rounded((1, 2, 3), 0).points.tolist() == collide.tessellate(Box((1, 2, 3))).vertices.tolist()
    for arguments, words in (
        (((1, 0.2, 1), 0.125), r"at most half of every length, got 0\.125 and size \[1\.0, 0\.2, 1\.0\]"),
        (((1, 0, 1), 0.0), "Box.rounded: size.y must be > 0"), (((1, 1, 1), -1), "Box.rounded: radius must be ≥ 0"),
        (((1, 1), 0.1), "Box.rounded: size must have shape"),
    ):
        with pytest.raises(InvalidShape, match=words):
            Box.rounded(*arguments)
