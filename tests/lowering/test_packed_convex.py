"""Convex sets as kernels read them: what their numbers promise, from their points, in Fractions."""

from __future__ import annotations

import hashlib
from fractions import Fraction

import numpy as np
import pytest
from naive import hull_points, rng_of

import collide
from collide.kernels import address_of
from collide.lowering import packed_convex as P
from collide.lowering.facet_table import FacetTable
from collide.lowering.lazy_structures import coarse_address
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import ADDRESS, COUNT, KIND, LOWEST, PADDED, RANK, REACH, ShapeTable


def is_integer_times(values, exponent: int) -> bool:
    return all((Fraction(v) / Fraction(2) ** exponent).denominator == 1 for v in np.ravel(values).tolist())


@pytest.mark.parametrize("n", [1, 2, 8, 9, 63, 64, 200])
def test_points(n):
    rng = rng_of("packed points", n)
    points = rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-3, 4, size=(n, 3))
    packed = P.pack_points(points.copy(), radius=0.25, slop=1e-9)
    columns = packed.coordinates
    assert (
        columns.shape[1] % P.BLOCK == 0 and columns.shape[1] - n < P.BLOCK and address_of(columns) % (8 * P.BLOCK) == 0
    )
    assert np.array_equal(columns[:, :n].T, points) and (columns[:, n:] == points[0][:, None]).all()
    assert (packed.radius, packed.slop) == (0.25, 1e-9)
    farthest = max(sum(Fraction(v) ** 2 for v in p) for p in points.tolist())
    assert farthest <= Fraction(packed.reach) ** 2 <= farthest * (1 + Fraction(1, 10**14))
    assert is_integer_times(points, packed.lowest) and not is_integer_times(points, packed.lowest + 1)
    assert (coarse_address(packed) != 0) == (n >= 64)
    assert not packed.points.flags.writeable and not columns.flags.writeable


def test_content_tells_sets_apart():
    """Equal for equal sets, also where zeros have other signs; another for any other number."""
    points = np.array([(0.0, 1.0, 2.0), (3.0, -0.0, 1.0)])
    same = P.pack_points(points.copy()).content
    assert P.pack_points(points + 0.0).content == same
    moved = points.copy()
    moved[1, 2] = np.nextafter(1.0, 2.0)
    others = [
        P.pack_points(moved), P.pack_points(points[::-1].copy()), P.pack_points(points.copy(), radius=0.5),
        P.pack_points(points[:1].copy()),
        P.pack_curved(P.CYLINDER, (1.0, 2.0), 3.0), P.pack_curved(P.CONE, (1.0, 2.0), 3.0),
        P.pack_halfspace((0.0, 0.0, 1.0), 2.0),
    ]
    assert len({same, *(p.content for p in others)}) == 1 + len(others)


def test_content_is_the_digest_of_its_numbers():
    """Of kind, radius, four numbers, and points whose zeros have one sign: what files and other processes hold."""
    rng = rng_of("digests")
    straddled = np.array([0x00000000_00000000, 0x00000080_00000000, 0x3FF00000_00000000], dtype=np.uint64)
    clouds = [
        np.array([(0.0, -0.0, 1.0)]), np.array([(1.0, 2.0, -3.0)]), straddled.view(np.float64).reshape(1, 3),
        np.asfortranarray(rng.normal(size=(9, 3))), rng.normal(size=(9, 6))[:, ::2],
    ]
    assert b"\x80" in clouds[2].tobytes() and not np.signbit(clouds[2]).any()
    for points in clouds:
        numbers = [0.0, 0.5, 0.0, 0.0, 0.0, 0.0, *(abs(v) if v == 0.0 else v for v in points.ravel().tolist())]
        wanted = hashlib.blake2b(np.array(numbers).tobytes(), digest_size=16).digest()
        assert P.pack_points(points.copy(order="K"), radius=0.5).content == wanted, points
    wanted = hashlib.blake2b(np.array([P.CONE, 0.0, 1.0, 2.0, 0.0, 0.0]).tobytes(), digest_size=16).digest()
    assert P.pack_curved(P.CONE, (1.0, 2.0), 3.0).content == wanted


def test_tables_hold_what_was_packed():
    rng = rng_of("shape table")
    packed = [P.pack_points(hull_points(rng, n)) for n in (4, 9, 100)] + [
        P.pack_curved(P.ELLIPSOID, (1.0, 2.0, 3.0), 3.0)
    ]
    table = ShapeTable([*packed, packed[1]])
    for row, p in zip(table.ints, [*packed, packed[1]]):
        assert (row[KIND], row[COUNT], row[PADDED], row[LOWEST]) == (
            p.kind,
            len(p.points),
            p.coordinates.shape[1],
            p.lowest,
        )
        assert row[ADDRESS] == address_of(p.coordinates)
    ranks = table.ints[:, RANK].tolist()
    assert ranks[4] == ranks[1] and sorted(set(ranks)) == list(range(4))
    order = [packed[k].content for k in np.argsort(ranks[:4])]
    assert order == sorted(order), "rank is by content, so that it does not depend on the order of asking"


def test_triangles_stand_in_tables_as_shapes_do():
    rng = rng_of("facet table")
    corners = rng.normal(size=(20, 3, 3)) * 10.0 ** rng.integers(-3, 3, size=(20, 1, 1))
    corners[3] = 0.0
    (packed, _), = parts_of(collide.Box((1, 2, 3)))
    table = FacetTable(corners, packed)
    alone = ShapeTable([P.pack_points(t.copy()) for t in corners] + [packed])
    columns = [KIND, COUNT, PADDED, LOWEST]
    assert np.array_equal(table.ints[:, columns], alone.ints[:, columns])
    assert np.array_equal(table.numbers[-1], alone.numbers[-1]) and np.array_equal(
        table.numbers[:, REACH], alone.numbers[:, REACH]
    )
    assert (table.ints[:-1, RANK] < table.ints[-1, RANK]).all()
    for k in range(20):
        assert (
            np.array_equal(table.coordinates[k, :, :3].T, corners[k])
            and (table.coordinates[k, :, 3:] == corners[k, :1].T).all()
        )
