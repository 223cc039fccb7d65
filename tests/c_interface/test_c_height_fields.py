"""Height fields of the C interface: the mesh of Python's vertices and faces, and Python's answers, bit by bit."""

from __future__ import annotations

import ctypes
import math
from collections import Counter

import c_library as c
import numpy as np
import pytest

import collide
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

EYE = np.eye(4)
#: Bytes of a mesh before the digest of its facets.
_DIGEST_AT, _DIGEST = 8 + 80 + 56, 16


def _field(number: int) -> tuple[np.random.Generator, collide.HeightField]:
    """Few cells on eighths or many anywhere, every other field with holes, some with a bottom of their own."""
    random = np.random.default_rng([700, number])
    shape = random.integers(2, 12, 2)
    heights = random.integers(-3, 4, shape) / 8.0 if number % 3 else random.normal(size=shape)
    if number % 2:
        heights[random.random(shape) < 0.15] = np.nan
        heights[:2, :2] = 0.25
    bottom = None if number % 4 else float(np.nanmin(heights)) - random.uniform(0.1, 2.0)
    cell = 0.25 if number % 5 == 0 else random.uniform(0.1, 0.6, 2)
    return random, collide.HeightField(heights, cell, bottom=bottom)


def _digest(handle: int) -> bytes:
    return ctypes.string_at(handle + _DIGEST_AT, _DIGEST)


def test_the_mesh_is_that_of_pythons_vertices_and_faces():
    told, digests = Counter(), set()
    for number in range(200):
        _, field = _field(number)
        bottom = None if number % 4 else field.bottom
        status, made = c.raw_height_field(field.heights, field.cell, bottom)
        of_arrays, wanted = c.raw_mesh(field.vertices, field.faces, c.SOLID)
        assert (status, of_arrays) == (c.OK, c.OK), number
        assert _digest(made) == _digest(wanted), f"field {number}: {field!r}"
        digests.add(_digest(made))
        c.library().collide_mesh_free(made)
        c.library().collide_mesh_free(wanted)
        told[field.has_holes, bottom is None] += 1
    assert min(told.values()) >= 30 and len(told) == 3 and len(digests) > 190, (told, len(digests))


def test_answers_are_pythons():
    asker, told = c.Asker(), Counter()
    for number in range(150):
        random, field = _field(number)
        shape = (collide.Box(0.25, 0.5, 0.125), collide.Sphere(0.2), collide.Cylinder(0.1, 0.3))[number % 3]
        X = collide.pose(random.normal(size=3) * (0.7, 0.7, 0.5), quat_wxyz=random.normal(size=4))
        own, body = c.CMesh(field), c.CShape(shape)
        status, hit, *_ = asker.mesh_shape(own, body, EYE, X)
        assert status == c.UNSUPPORTED or hit == collide.collide(field, shape, EYE, X), number
        told["hit", status, hit] += 1
        status, rows, _ = asker.many_contacts(own, body, EYE, X, 0.05, 8)
        if status == c.OK:
            assert rows.tobytes() == collide.contacts(field, shape, EYE, X, margin=0.05).rows.tobytes(), number
            told["contacts"] += len(rows)
        origins, ways = random.normal(size=(6, 3)) * (0.5, 0.5, 1), random.normal(size=(6, 3))
        _, rows, statuses, _ = asker.rays(own, EYE, origins, ways)
        wanted = collide.raycast(field, EYE, origins, ways)
        for k in np.flatnonzero(statuses == c.OK):
            assert rows[k]["distance"] == wanted.distance[k] and rows[k]["facet"] == wanted.facet[k], (number, k)
            assert rows[k]["point"].tobytes() == wanted.point[k].tobytes(), (number, k)
            told["ray", bool(wanted.hit[k])] += 1
    assert told["hit", c.OK, True] > 25 and told["hit", c.OK, False] > 25, told
    assert told["contacts"] > 60 and told["ray", True] > 150 and told["ray", False] > 150, told


@pytest.mark.parametrize(
    ("heights", "cell", "bottom"),
    [
        (np.zeros((1, 5)), 0.1, None), (np.zeros((5, 1)), 0.1, None), (np.full((3, 3), math.nan), 0.1, None),
        ([[0.0, math.inf], [0.0, 0.0]], 0.1, None), ([[0.0, 1.1e50], [0.0, 0.0]], 0.1, None),
        ([[math.nan, 0.0, math.nan], [0.0, 0.0, 0.0], [math.nan, 0.0, math.nan]], 0.1, None),
        (np.zeros((2, 2)), 0.0, None), (np.zeros((2, 2)), (0.1, -0.1), None), (np.zeros((2, 2)), math.nan, None),
        (np.zeros((3, 9)), 0.9e50, None), (np.zeros((2, 2)), 0.1, 0.0), (np.zeros((2, 2)), 0.1, math.nan),
        (np.zeros((2, 2)), 0.1, -1.1e50), (np.full((2, 2), 1e30), 1.0, None), (np.full((2, 2), -0.9e50), 0.9e50, None),
    ],
)
def test_what_python_takes_for_no_terrain_is_none(heights, cell, bottom):
    with pytest.raises(collide.InvalidShape):
        collide.HeightField(heights, cell, bottom=bottom)
    assert c.raw_height_field(heights, cell, bottom) == (c.INVALID_SHAPE, None)


def test_arguments_are_checked():
    assert c.raw_shape("collide_height_field_create", None, 2, 2, np.ones(2), None) == (c.INVALID_ARGUMENT, None)
    assert c.raw_shape("collide_height_field_create", np.zeros(4), 2, 2, None, None) == (c.INVALID_ARGUMENT, None)
    assert c.library().collide_height_field_create(None, 2, 2, None, None, None) == c.INVALID_ARGUMENT
    huge = 1 << 40  # refused before a height is read
    said = c.raw_shape("collide_height_field_create", np.zeros(4), huge, huge, np.ones(2), None)
    assert said == (c.INVALID_SHAPE, None)
