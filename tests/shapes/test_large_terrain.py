"""Height fields of many cells, of which triangles are made where they are needed, beside the whole mesh; and holes."""

from __future__ import annotations

import tracemalloc
from unittest import mock

import numpy as np
import pytest

import collide
from collide.shapes import height_field

EYE = np.eye(4)


def terrain(rng, case: int) -> tuple[collide.HeightField, collide.Mesh]:
    """A field asked tile by tile, and the same as a mesh whose surface was looked at."""
    shape = rng.integers(2, 40, 2)
    heights = rng.normal(size=shape) * 0.3 if case % 2 else rng.integers(-4, 5, shape) / 8
    if case % 3 == 0:
        heights[rng.random(shape) < 0.05] = np.nan
        heights[:2, :2] = 0.25
    small = collide.HeightField(heights, (0.25, 0.5))
    with mock.patch.object(height_field, "_MAX_MESHED", 0):
        large = collide.HeightField(heights, (0.25, 0.5))
        assert large.is_field
    mesh = collide.Mesh(small.vertices, small.faces)
    assert mesh.solid and mesh.report.volume == pytest.approx(small.report.volume)
    return large, mesh


def others(rng) -> list:
    return [
        collide.Sphere(0.2), collide.Box((0.3, 0.5, 0.2)), collide.ConvexHull(rng.normal(size=(12, 3)) * 0.3),
        collide.Cylinder(0.2, 0.5), collide.Halfspace((0, 0.6, 0.8), -1.0),
        collide.Compound([(collide.Sphere(0.2), collide.pose((0.2, 0, 0))), (collide.Box((0.1, 0.1, 0.1)), EYE)]),
        collide.Mesh(*collide.tessellate(collide.Box((0.4, 0.3, 0.5)))[:2]),
    ]


@pytest.fixture
def large_fields():
    with mock.patch.object(height_field, "_MAX_MESHED", 0):
        yield


def places(rng, field: collide.HeightField) -> tuple[np.ndarray, np.ndarray]:
    X = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
    x, y = field.grid_lines
    place = (rng.uniform(-1.1, 1.1) * x[-1], rng.uniform(-1.1, 1.1) * y[-1], rng.uniform(-1.0, 1.5))
    return X, X @ collide.pose(place, rpy=rng.uniform(-3, 3, 3))


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_pairs_casts_and_impacts_are_those_of_the_mesh(large_fields, seed):
    rng, asked, hits, met = np.random.default_rng([1, seed]), 0, 0, 0
    for case in range(6):
        field, mesh = terrain(rng, case)
        for B in others(rng):
            X, Y = places(rng, field)
            hit = collide.collide(field, B, X, Y)
            assert hit == collide.collide(mesh, B, X, Y), (case, B)
            mine, theirs = (collide.distance(S, B, X, Y, signed=False) for S in (field, mesh))
            assert mine.distance == pytest.approx(theirs.distance, abs=1e-9), (case, B)
            asked, hits = asked + 1, hits + hit
            if isinstance(B, collide.Halfspace):
                continue
            deep = collide.distance(field, B, X, Y)
            if deep.hit:
                out = Y.copy()
                out[:3, 3] += deep.normal * (-float(deep.distance) * (1 + 1e-9) + 1e-9)
                assert not collide.collide(mesh, B, X, out), (case, B)
            v, Y1 = rng.normal(size=3), Y.copy()
            Y1[:3, 3] += rng.normal(size=3)
            casts = [collide.shape_cast(B, Y, v, S, X) for S in (field, mesh)]
            impacts = [collide.time_of_impact(B, S, Y, Y1, X, X) for S in (field, mesh)]
            assert casts[0].hit == casts[1].hit and impacts[0].hit == impacts[1].hit, (case, B)
            assert casts[0].distance == pytest.approx(casts[1].distance, abs=1e-9), (case, B)
            assert impacts[0].time == pytest.approx(impacts[1].time, abs=1e-8), (case, B)
            met += bool(casts[0].hit)
    assert 0.2 * asked < hits < 0.9 * asked and met > 0.3 * asked, (asked, hits, met)


def test_rays_are_those_of_the_mesh(large_fields):
    rng, hits = np.random.default_rng(2), 0
    for case in range(24):
        field, mesh = terrain(rng, case)
        X = collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3))
        origins = X[:3, 3] + rng.normal(size=(60, 3)) * (4, 4, 2) @ X[:3, :3].T
        vectors = rng.normal(size=(60, 3))
        for options in ({}, {"max_distance": 1.0}):
            mine, theirs = (collide.raycast(S, X, origins, vectors, **options) for S in (field, mesh))
            assert np.array_equal(mine.hit, theirs.hit), case
            assert np.allclose(mine.distance[mine.hit], theirs.distance[mine.hit], atol=1e-9), case
            assert np.allclose(mine.normal[mine.hit], theirs.normal[mine.hit], atol=1e-9), case
            tops = mine.hit & (mine.facet >= 0)
            assert np.array_equal(mine.facet[tops], theirs.facet[tops]), case
            hits += int(tops.sum())
    assert hits > 120


def test_contacts_push_out_of_the_surface(large_fields):
    rng, n_rows = np.random.default_rng(3), 0
    heights = rng.uniform(0.0, 0.05, (200, 200))
    field = collide.HeightField(heights, 0.1, bottom=-1.0)
    for _ in range(30):
        X = collide.pose((*rng.uniform(-8, 8, 2), 0.14), rpy=(0, 0, rng.uniform(-3, 3)))
        rows = collide.contacts(field, collide.Box((0.5, 0.4, 0.2)), EYE, X).rows
        assert len(rows) and (rows["normal"][:, 2] > 0.5).all() and (rows["distance"] >= -0.05).all()
        cells = field.cells_of(rows["facet_a"])
        assert (cells.row >= 0).all() and not rows["part_a"].any()
        assert (np.abs((cells.column - 99) * 0.1 - rows["point_a"][:, 0]) < 0.11).all()
        n_rows += len(rows)
    assert n_rows > 60


def test_numbers_leave_out_holes():
    heights = np.zeros((4, 5))
    heights[1, 3] = np.nan
    field = collide.HeightField(heights, 1.0)
    assert field.has_holes and field.pyramid.n_cells == 8
    there = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (2, 3)]
    cells = field.cells_of(np.arange(16))
    assert list(zip(cells.row[::2].tolist(), cells.column[::2].tolist())) == there
    assert cells.triangle.tolist() == [0, 1] * 8 and field.cells_of(16).row == -1
    assert not collide.collide(field, collide.Sphere(0.1), EYE, collide.pose((1.0, -0.5, -0.5)))
    assert collide.collide(field, collide.Sphere(0.1), EYE, collide.pose((-1.0, -0.5, -0.5)))
    again = collide.HeightField(field.heights, field.cell, bottom=field.bottom)
    assert np.array_equal(again.heights, field.heights, equal_nan=True) and again == field


def test_no_triangle_is_made_before_it_is_needed():
    heights = np.random.default_rng(4).random((1200, 1200))
    tracemalloc.start()
    field = collide.HeightField(heights, 0.5)
    assert field.is_field
    assert collide.collide(field, collide.Sphere(0.5), EYE, collide.pose((100, 50, 0.9)))
    hit = collide.raycast(field, EYE, (10.0, 20.0, 5.0), (0, 0, -1))
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert hit.hit and 4.0 <= hit.distance <= 5.0
    assert kept < 2.5 * field.heights.nbytes  # of a whole mesh: 40 times


def test_no_query_makes_all_triangles(large_fields, tmp_path):
    """Worlds, checkers and points inside ask large terrain as a whole: its vertices are never made."""
    def made(name: str):
        raise AssertionError(f"{name} of the whole terrain were asked for")

    field = collide.HeightField(np.random.default_rng(5).random((300, 300)) * 0.1, 0.1, bottom=-1.0)
    with mock.patch.object(height_field.HeightField, "__getattr__", lambda self, name: made(name) if name in (
        "vertices", "faces") else object.__getattribute__(self, name)):
        assert collide.contains(field, EYE, [(0, 0, -0.5), (0, 0, 0.5)]).tolist() == [True, False]
        world = collide.World()
        world.add(field, name="hills")
        world.add(collide.Sphere(0.2), collide.pose((1, 2, 0.1)), name="ball")
        world.replace("hills", field)
        assert world.collides() and len(world.contacts().rows)
        assert world.raycast((0, 0, 3), (0, 0, -1)).rows["hit"].all()
        assert world.distances(max_distance=1.0).rows["hit"].all()
        link = collide.Robot.load(_rail(tmp_path))
        assert collide.RobotChecker(link, world).collides(np.zeros((1, 1))).shape == (1,)


def _rail(folder):
    path = folder / "rail.urdf"
    body = '<link name="{0}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    joint = '<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>'
    path.write_text(f'<robot name="r">{body.format("a")}{body.format("b")}{joint}'
                    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>')
    return path


def test_images_are_terrain(tmp_path):
    grey = np.array([[0, 255], [51, 102], [0, 0]], dtype=np.uint8)
    field = collide.HeightField.from_image(grey, 1.0, low=-1.0, high=4.0)
    assert np.allclose(field.heights, [[-1, -1], [0, 1], [-1, 4]])
    assert collide.HeightField.from_image(grey[::-1] / 255.0, 2.0).heights[0, 1] == 1.0
    image = pytest.importorskip("PIL.Image")
    image.fromarray(grey).save(tmp_path / "hills.png")
    assert collide.HeightField.from_image(tmp_path / "hills.png", 1.0, low=-1.0, high=4.0) == field
    (tmp_path / "text.png").write_text("no picture")
    for bad, match in (
        (np.zeros((2, 2, 3), np.uint8), "turn colours to grey"), (np.zeros((2, 2), int), "unsigned integers or floats"),
        (np.array([[0.0, 200.0], [300.0, 50.0]]), "lie within 0 … 1"),
        (tmp_path / "text.png", "cannot identify"), (tmp_path / "none.png", "No such file"),
    ):
        with pytest.raises(collide.InvalidShape, match=match):
            collide.HeightField.from_image(bad, 1.0)
