"""Planes by number, vertices by name, rows that grow: doubles with bounds and integers, against Fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mesh_shapes import box, bumpy_sphere
from naive import rng_of
from reproduction import reproducing

import collide
from collide.errors import UnsupportedQuery
from collide.numerics.growing_rows import GrowingRows
from collide.papers.partitions.partition_tree import EMPTY, PartitionTree
from collide.papers.partitions.planes import Planes, meeting_points, signs_of
from collide.papers.partitions.vertices import Vertices


def drawn(rng, kind: str) -> Planes:
    vertices, faces = box() if kind == "box" else bumpy_sphere(30)
    vertices = np.asarray(vertices, dtype=float)
    if kind == "random":
        vertices = vertices * 10.0 ** float(rng.integers(-3, 4))
    planes = Planes(vertices, np.asarray(faces, dtype=np.int64))
    planes.add_axis_planes(np.array([0, 1, 2, 2]), np.array([0.25, -0.5, 0.1, 1.0 / 3.0]))
    return planes


def height_of(planes: Planes, cut: int, p: list[Fraction]) -> Fraction:
    """n · (p − a) of a plane, of its definition."""
    if cut >= 4 * planes.n:
        k = cut - 4 * planes.n
        return p[int(planes.axis.rows[k])] - Fraction(float(planes.value.rows[k]))
    a, b, c = ([Fraction(x) for x in planes.vertices[k].tolist()] for k in planes.faces[cut])
    u, v = [x - y for x, y in zip(b, a)], [x - y for x, y in zip(c, a)]
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    return sum(x * (y - z) for x, y, z in zip(n, p, a))


@pytest.mark.parametrize("kind", ["box", "random"])
def test_heights_and_coefficients_tell_sides(kind):
    rng = rng_of("planes", kind)
    planes = drawn(rng, kind)
    cuts = np.concatenate([rng.integers(0, planes.n, 60), 4 * planes.n + rng.integers(0, 4, 20)])
    points = planes.vertices[rng.integers(0, len(planes.vertices), 80)]
    points[::2] += rng.choice([0.0, 1e-17, 1.0], (40, 1)) * rng.normal(size=(40, 3))
    errors = rng.choice([0.0, 1e-9], 80)
    height, bound = planes.heights(points, errors, cuts)
    coefficients, unit, n_zero = planes.coefficients(cuts), Fraction(2) ** planes.grid, 0
    for k in range(80):
        with reproducing("p, cut = {p}, {cut}", p=points[k], cut=cuts[k]):
            exact = height_of(planes, int(cuts[k]), [Fraction(x) for x in points[k].tolist()])
            assert abs(Fraction(height[k]) - exact) <= Fraction(bound[k]) or cuts[k] >= 4 * planes.n
            moved = [Fraction(x) + Fraction(float(rng.choice([-1, 1]) * errors[k])) for x in points[k].tolist()]
            if cuts[k] < 4 * planes.n:
                assert abs(Fraction(height[k]) - height_of(planes, int(cuts[k]), moved)) <= Fraction(bound[k])
            a, b, c, d = coefficients[k]
            x, y, z = (Fraction(v) * unit for v in points[k].tolist())
            value = a * x + b * y + c * z + d
            assert (value > 0) == (exact > 0) and (value < 0) == (exact < 0)
            n_zero += value == 0
    assert n_zero > 5


def test_planes_through_edges_hold_them():
    rng = rng_of("edge planes")
    planes = drawn(rng, "random")
    for f in range(0, planes.n, 5):
        for e in range(3):
            a, b, c, d = planes.coefficients(np.array([planes.n + 3 * f + e]))[0]
            normal = planes.coefficients(np.array([f]))[0, :3]
            for k in (planes.faces[f, e], planes.faces[f, (e + 1) % 3]):
                x, y, z = planes.grid_vertices[k]
                assert a * x + b * y + c * z + d == 0
            assert 0 in (a, b, c)  # parallel to an axis
            cross = (b * normal[2] - c * normal[1], c * normal[0] - a * normal[2], a * normal[1] - b * normal[0])
            assert any(cross)  # and no plane of the facet


def test_twins_have_axis_planes_of_their_own():
    planes = drawn(rng_of("twins"), "box")
    twin = planes.with_own_axis_planes()
    assert twin.add_axis_planes(np.array([1]), np.array([7.0])).tolist() == [4 * planes.n + 4]
    assert len(planes.axis.rows) == 4 and len(twin.axis.rows) == 5 and twin.value.rows[4] == 7.0
    assert np.array_equal(twin.value.rows[:4], planes.value.rows) and twin.vertices is planes.vertices


def test_three_planes_meet_where_fractions_say():
    rng = rng_of("meeting points")
    triples = [p for p in rng.integers(-5, 6, (60, 3, 4)) if round(np.linalg.det(p[:, :3].astype(float)))]
    found = meeting_points(np.array(triples, dtype=object))
    assert len(triples) > 30
    for planes, (x, y, z, w) in zip(triples, found):
        assert w > 0 and all(int(a) * x + int(b) * y + int(c) * z + int(d) * w == 0 for a, b, c, d in planes)
    for row in signs_of(np.repeat(found[:1], 3, axis=0), np.array(triples[0], dtype=object)):
        assert row == 0
    parallel = np.array([[[1, 0, 0, 1], [2, 0, 0, 1], [0, 1, 0, 1]]], dtype=object)
    with pytest.raises(AssertionError, match="no single point"):
        meeting_points(parallel)


def test_signs_are_those_of_python_integers():
    rng = rng_of("signs")
    points = rng.integers(-3, 4, (50, 4)).astype(object) * 10**30
    planes = rng.integers(-3, 4, (50, 4)).astype(object)
    expected = [(v > 0) - (v < 0) for v in (sum(int(a) * int(b) for a, b in zip(p, q)) for p, q in zip(points, planes))]
    found = signs_of(points, planes)
    assert found.tolist() == expected and found.dtype == np.int8 and 0 in expected


@pytest.mark.parametrize("kind", ["box", "random"])
def test_vertices_lie_where_their_planes_meet(kind):
    """Signs are exact, also on planes that name the vertex; n_exact counts what integers decided."""
    rng = rng_of("vertices", kind)
    planes = drawn(rng, kind)
    vertices = Vertices(planes)
    names, at = [], []
    while len(names) < 25:
        three = np.array([4 * planes.n, 4 * planes.n + 1, int(rng.integers(planes.n))])
        rows = planes.coefficients(three)
        if not any(int(v) for v in (rows[2, 2],)):
            continue
        x, y, z, w = meeting_points(rows[None])[0]
        names.append(three)
        at.append([float(Fraction(int(v), int(w)) / 2**planes.grid) for v in (x, y, z)])
    size = np.abs(at).max(axis=1)
    made = vertices.add(np.array(at), 4e-16 * size, np.array(names))
    assert made[0] == len(planes.vertices)
    every = np.concatenate([made, rng.integers(0, len(planes.vertices), 25)])
    cuts = np.concatenate([rng.integers(0, planes.n, 40), 4 * planes.n + rng.integers(0, 4, 10)])
    every, cuts = rng.permutation(every), rng.permutation(cuts)
    cuts[:10] = [vertices.names.rows[v].max() if v >= made[0] else cut for v, cut in zip(every[:10], cuts[:10])]
    sides = vertices.sides(every, cuts)
    for v, cut, sign in zip(every.tolist(), cuts.tolist(), sides.sign.tolist()):
        x, y, z, w = vertices.exact(np.array([v]))[0]
        p = [Fraction(int(c), int(w)) / 2**planes.grid for c in (x, y, z)]
        height = height_of(planes, cut, p)
        assert sign == (height > 0) - (height < 0)
        if v < made[0]:
            assert p == [Fraction(c) for c in planes.vertices[v].tolist()]
    assert (sides.sign == 0).sum() > 3
    rounded, error = vertices.rounded(every)
    for p, row in zip(vertices.exact(every), rounded.tolist()):
        assert all(
            abs(Fraction(int(c), int(p[3])) / 2**planes.grid - Fraction(v)) <= Fraction(error)
            for c, v in zip(p[:3], row)
        )
    vertices.cut_back(int(made[3]))
    assert len(vertices.xyz.rows) == len(vertices.names.rows) == len(vertices.error.rows) == made[3]


def test_badly_known_vertices_are_worked_out_before_they_are_shown():
    planes = drawn(rng_of("badly"), "box")
    vertices = Vertices(planes)
    made = vertices.add(np.array([(0.3, -0.4, 0.2)]), np.array([0.1]), 4 * planes.n + np.array([[0, 1, 2]]))
    xyz, error = vertices.rounded(made)
    assert xyz.tolist() == [[0.25, -0.5, 0.1]] and error <= 2.0**-52
    assert vertices.xyz.rows[made].tolist() == [[0.3, -0.4, 0.2]]  # only for show


@pytest.mark.parametrize("shape", [(), (3,)])
def test_rows_grow_and_are_forgotten(shape):
    rng, rows, expected = rng_of("growing", shape), GrowingRows.empty(float, *shape), []
    for n in (0, 1, 700, 500, 1, 3000):
        new = rng.normal(size=(n, *shape))
        assert rows.add(new).tolist() == list(range(len(expected), len(expected) + n))
        expected += new.tolist()
        assert (
            rows.rows.tolist() == expected and rows.n == len(expected) and rows.n_bytes == 8 * np.prod([rows.n, *shape])
        )
    rows.rows[5] = 9.0
    assert (rows.rows[5] == 9.0).all()  # a view
    rows.cut_back(7)
    assert rows.rows.tolist() == [*expected[:5], rows.rows[5].tolist(), expected[6]]
    assert rows.add(np.zeros((1, *shape))).tolist() == [7]


def test_a_tree_that_grows_numbers_places_and_refuses_to_outgrow():
    tree = PartitionTree(2000)
    assert tree.below.rows.tolist() == [EMPTY]
    first = tree.cut(np.array([0]), np.array([7]))
    assert first.tolist() == [0] and tree.below.rows.tolist() == [0, EMPTY, EMPTY]
    second = tree.cut(np.array([2, 1]), np.array([8, 9]))
    assert second.tolist() == [1, 2] and tree.below.rows.tolist() == [0, 2, 1, *[EMPTY] * 4]
    assert tree.plane.rows.tolist() == [7, 8, 9]
    tree.hold(np.zeros(0, dtype=int), np.zeros(0, dtype=int))
    assert tree.held == []
    tree.hold(np.array([0, 1]), np.array([5, 6]))
    assert tree.n_bytes == 88 * 3 + 16 * 2 + tree.other_bytes
    tree.other_bytes, tree.prediction = 2000 - tree.n_bytes, "much is left; "
    tree.check_memory()
    tree.other_bytes += 1
    with pytest.raises(
        UnsupportedQuery, match=r"4 cells so far take 2,001 bytes, more than memory=2,000; much is left; raise"
    ):
        tree.check_memory()
    with pytest.raises(UnsupportedQuery, match="raise memory"):
        collide.SpacePartition(collide.Mesh(*box()), memory=100)
