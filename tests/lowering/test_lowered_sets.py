"""Sets of a few numbers lowered all at once: row by row what numpy and hashlib make of their definition."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import pytest
from naive import rng_of

import collide
from collide.lowering import lowered_sets as L
from collide.lowering.convex_sets import PRIMITIVE_NUMBERS, convex_set
from collide.lowering.packed_convex import BLOCK, CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.lowering.parts import parts_of
from collide.lowering.set_rows import ADDRESS, COUNT, KIND, LOWEST, PADDED, PARAMS, RADIUS, REACH, SLOP
from collide.lowering.shape_table import RANK, ShapeTable


def some_shapes(rng, n):
    """Of all seven classes; lengths from 1e-40 to 1e40, whole numbers among them, signs of zero both."""
    shapes = []
    for k in range(n):
        u = 10.0 ** rng.uniform(-40, 40, 3) if k % 3 == 0 else rng.uniform(0.1, 2.0, 3)
        x, y, z = (rng.integers(1, 5, 3).astype(float) if k % 3 == 1 else u).tolist()
        shapes.append([
            collide.Box((x, y, z)), collide.Sphere(x), collide.Capsule(x, y if k % 2 else 0.0), collide.Cylinder(x, y),
            collide.Cone(x, y), collide.Ellipsoid((x, y, z)),
            collide.Halfspace((0.0, -0.0, 1.0) if k % 2 else (0.6, -0.0, 0.8), -0.0 if k % 4 else 1.5),
        ][k % 7])
    return shapes


def points_and_numbers(shape):
    """(kind, core points, radius, four numbers) by the definitions of the classes."""
    none = np.zeros((0, 3))
    if isinstance(shape, collide.Box):
        half = shape.size / 2
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
        return POINTS, corners, 0.0, [*half, 0.0]
    if isinstance(shape, collide.Sphere):
        return POINTS, np.zeros((1, 3)), shape.radius, [0.0] * 4
    if isinstance(shape, collide.Capsule):
        ends = np.array([[0, 0, -shape.length / 2], [0, 0, shape.length / 2]])
        return POINTS, ends if shape.length else np.zeros((1, 3)), shape.radius, [0.0] * 4
    if isinstance(shape, collide.Ellipsoid):
        return ELLIPSOID, none, 0.0, [*shape.radii, 0.0]
    if isinstance(shape, collide.Halfspace):
        return HALFSPACE, none, 0.0, [*shape.normal, shape.offset]
    kind = CYLINDER if isinstance(shape, collide.Cylinder) else CONE
    return kind, none, 0.0, [shape.radius, shape.length / 2, 0.0, 0.0]


def lowest_bit(points):
    """The largest e for which all coordinates are whole multiples of 2^e."""
    exponents = []
    for value in points.ravel().tolist():
        numerator, denominator = abs(value).as_integer_ratio()
        if numerator:
            exponents.append((numerator & -numerator).bit_length() - denominator.bit_length())
    return min(exponents, default=2000)


@pytest.mark.parametrize("with_others", [False, True])
def test_rows_are_those_of_the_definitions(with_others):
    rng = rng_of("lowered sets", with_others)
    shapes = some_shapes(rng, 140)
    hulls = [parts_of(collide.ConvexHull(rng.normal(size=(n, 3))))[0][0] for n in (5, 300)] if with_others else []
    sets = [PRIMITIVE_NUMBERS[type(shape)](shape) for shape in shapes]
    if with_others:
        sets[3:3], shapes[3:3] = hulls, hulls
    lowered = L.LoweredSets(sets)
    assert len(lowered) == len(sets) and lowered.with_tree == ([4] if with_others else [])
    for k, shape in enumerate(shapes):
        row, numbers, packed = lowered.ints[k], lowered.numbers[k], lowered[k]
        assert packed is lowered[k] is lowered[k - len(sets)]
        if with_others and k in (3, 4):
            assert packed is shape and row[COUNT] == len(shape.points)
            assert packed.content == lowered.contents[16 * k : 16 * k + 16]
            continue
        kind, points, radius, four = points_and_numbers(shape)
        assert (row[KIND], row[COUNT], row[PADDED]) == (kind, len(points), BLOCK if len(points) else 0)
        assert row[LOWEST] == lowest_bit(points) and numbers[SLOP] == 0.0 and numbers[RADIUS] == radius
        assert numbers[PARAMS:].tolist() == four
        far = max((math.hypot(*p) for p in points.tolist()), default=0.0)
        if kind in (CYLINDER, CONE):
            far = math.hypot(*four)
        elif kind == ELLIPSOID:
            far = max(four)
        assert far <= numbers[REACH] <= far * (1 + 1e-14)
        head = np.array([kind, radius, *(four if kind != POINTS else [0.0] * 4)])
        digest = hashlib.blake2b(head.tobytes() + (points + 0.0).tobytes(), digest_size=16).digest()
        assert lowered.contents[16 * k : 16 * k + 16] == packed.content == digest
        assert np.array_equal(packed.points, points) and not packed.points.flags.writeable
        assert np.array_equal(packed.points, convex_set(shape).points) and packed.address == row[ADDRESS]
        if len(points):
            filled = np.vstack([points, np.tile(points[:1], (BLOCK - len(points), 1))])
            assert np.array_equal(packed.coordinates, filled.T) and row[ADDRESS] % 64 == 0
            assert not np.signbit(packed.points[packed.points == 0.0]).any()


def test_tables_of_bodies_are_those_of_their_sets():
    """Ranks, rows and packed sets of several bodies, equal sets among them, beside a table of the sets one by one."""
    rng = rng_of("tables of bodies")
    shapes = some_shapes(rng, 60)
    numbers = [PRIMITIVE_NUMBERS[type(shape)](shape) for shape in shapes]
    bodies = [L.LoweredSets(numbers[:25]), L.LoweredSets(numbers[20:]), L.LoweredSets(numbers[:1])]
    table, sets = ShapeTable.of_bodies(bodies), [packed for body in bodies for packed in body]
    whole = ShapeTable(sets)
    assert len(table.packed) == len(sets) and all(a is b for a, b in zip(table.packed, sets))
    assert table.packed[-1] is sets[-1] and table.packed[30] is sets[30]
    with pytest.raises(IndexError):
        table.packed[len(sets)]
    for column in (KIND, COUNT, PADDED, ADDRESS, LOWEST, RANK):
        assert np.array_equal(table.ints[:, column], whole.ints[:, column]), column
    assert np.array_equal(table.numbers, whole.numbers) and 30 <= len(set(table.ints[:, RANK].tolist())) <= 60
    contents = [b"\0" * 16, b"\xff" + b"\0" * 15, b"\0" * 15 + b"\xff", b"\0" * 7 + b"\x80" + b"\0" * 8, b"\0" * 16]
    assert L.ranks_of(b"".join(contents)).tolist() == [sorted(set(contents)).index(content) for content in contents]


def test_parts_of_a_compound_are_lowered_without_python_of_their_own():
    """No packed set is made until asked for: a union of 300 boxes is lowered in some calls, not in thousands."""
    rng = rng_of("lowered compound")
    boxes = [collide.Box(size) for size in rng.uniform(0.1, 1.0, (300, 3))]
    shape = collide.Compound([(box, collide.pose(rng.normal(size=3))) for box in boxes])
    parts = parts_of(shape)
    assert isinstance(parts, L.PlacedSets) and not parts.sets._packed
    assert collide.collide(shape, collide.Sphere(0.1), np.eye(4), collide.pose((90.0, 0, 0))) is False
    assert not parts.sets._packed and parts.X_BP is shape.poses
    packed, X = parts[7]
    assert X.base is not None and np.array_equal(packed.points.max(axis=0), shape.items[7][0].size / 2)
