"""Grids of signed distances: brackets against exact distances in fractions, files, values that are no distances."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest
from facet_distances import nearest_square
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import rng_of
from solid_membership import windings

import collide
from collide import InvalidArgument, InvalidShape, SignedDistanceGrid, UnsupportedQuery

MADE = {"bumpy": lambda: bumpy_sphere(60), "ring": block_ring, "box": box}


def places(rng, grid, n: int) -> np.ndarray:
    """In the grid, at its nodes and in the planes of its cells, an ulp off these, outside."""
    low, high = grid.low, grid.high
    inside = rng.uniform(low, high, (n, 3))
    nodes = low + grid.cell * rng.integers(0, grid.values.shape, (n, 3))
    faces = np.where(rng.random((n, 3)) < 0.5, nodes, inside) * (1.0 + 2.0**-52 * rng.integers(-1, 2, (n, 3)))
    outside = rng.uniform(low - 3.0 * (high - low), high + 3.0 * (high - low), (n, 3))
    return np.concatenate([inside, nodes, faces, outside, 1e6 * rng.normal(size=(2, 3))])


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("shift, scale", [(0.0, 1.0), (1e6, 1.0), (1e-3, 1e-3)])
def test_brackets_hold_the_exact_distance(name, shift, scale):
    rng = rng_of("grid", name, shift)
    vertices, faces = MADE[name]()
    vertices = scale * vertices + shift * np.array([1.0, -0.5, 0.25])
    mesh = collide.Mesh(vertices, faces)
    cell = scale * np.array([0.31, 0.2, 0.27])
    grid = SignedDistanceGrid.from_mesh(mesh, cell, margin=0.1 * scale)
    assert (grid.low <= vertices.min(axis=0) - 0.099 * scale).all()
    assert (grid.high >= vertices.max(axis=0) + 0.099 * scale).all() and grid.values.dtype == np.float32
    points = places(rng, grid, 8)
    triangles, got = vertices[faces], grid.distances(points)
    numbers = windings([[[Fraction(x) for x in p] for p in t] for t in triangles.tolist()], points)
    for k, point in enumerate(points):
        case = name, shift, point.tolist(), tuple(column[k] for column in got)
        square, sign = nearest_square(point, triangles), -1 if (numbers[k] or 0) >= 1 else 1
        assert got.lower[k] <= got.distance[k] <= got.upper[k], case
        for bound, is_below in ((got.lower[k], True), (got.upper[k], False)):
            exact = Fraction(bound) * abs(Fraction(bound)) - sign * square
            assert exact <= 0 if is_below else exact >= 0, case
    within = ((points >= grid.low) & (points <= grid.high)).all(axis=1)
    width = (got.upper - got.lower)[within]
    assert within.sum() >= 16 and (width <= 1.01 * np.linalg.norm(cell) + 2.0 * grid.error).all()
    assert (width[8:16] <= 2.1 * grid.error + 1e-9 * scale + 1e-14 * np.abs(vertices).max()).all()  # at nodes
    assert grid.error <= 2.0**-23 * np.abs(grid.values).max() + 1e-8 * scale


def test_values_between_nodes_are_linear_along_each_axis():
    rng = rng_of("linear")
    slope, start = np.array([0.3, -0.5, 0.2]), 0.125
    grid = SignedDistanceGrid.from_arrays(
        start + sum(np.meshgrid(*(s * 0.5 * np.arange(n) for s, n in zip(slope, (4, 5, 6))), indexing="ij")), 0.5
    )
    points = rng.uniform(0.0, 1.5, (100, 3))
    assert np.allclose(grid.distances(points).distance, start + points @ slope, atol=1e-14)
    one = grid.distances(points[0])
    assert one.distance.shape == () and one == tuple(column[0] for column in grid.distances(points))
    assert grid.distances(np.zeros((0, 3))).lower.shape == (0,)
    assert grid.values.dtype == np.float64 and grid.error == 0.0


def test_values_that_are_no_distances_are_refused():
    rng = rng_of("steep")
    fine = np.zeros((4, 5, 6))
    refused = 0
    for da, db, dc in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1), (1, -1, 0),
                       (1, 0, -1), (0, 1, -1), (1, -1, -1), (1, 1, -1), (1, -1, 1)):
        length = np.linalg.norm(np.array([da, db, dc]) * (0.5, 0.4, 0.3))
        node = np.array([rng.integers(0, 2), rng.integers(1, 3), rng.integers(1, 4)])
        i, j, k = np.indices(fine.shape)
        values = -np.sqrt(((i - node[0]) * 0.5) ** 2 + ((j - node[1]) * 0.4) ** 2 + ((k - node[2]) * 0.3) ** 2)
        SignedDistanceGrid.from_arrays(values, (0.5, 0.4, 0.3))
        beside = node + np.array([da, db, dc])
        values[tuple(beside)] = -length * (1.0 + 1e-9)
        with pytest.raises(InvalidShape, match="no distances") as refusal:
            SignedDistanceGrid.from_arrays(values, (0.5, 0.4, 0.3))
        refused += str(node.tolist()) in str(refusal.value) and str(beside.tolist()) in str(refusal.value)
        SignedDistanceGrid.from_arrays(values, (0.5, 0.4, 0.3), error=1e-8)
    assert refused == 13
    with pytest.raises(InvalidShape, match=r"nodes \[0, 0, 0\] and \[0, 0, 1\] have 0 and 2, which differ by 1 more"):
        SignedDistanceGrid.from_arrays(2.0 * np.indices((2, 2, 2))[2], 1.0)


def test_files_and_pickles(tmp_path):
    mesh = collide.Mesh(*bumpy_sphere(60))
    points = rng_of("files").uniform(-1.5, 1.5, (50, 3))
    for grid in (
        SignedDistanceGrid.from_mesh(mesh, 0.25, margin=0.25),
        SignedDistanceGrid.from_arrays(np.zeros((2, 3, 4)), (1, 2, 3), (4, 5, 6), error=0.5),
    ):
        grid.save(tmp_path / "grid.npz")
        for again in (SignedDistanceGrid.load(tmp_path / "grid.npz"), pickle.loads(pickle.dumps(grid))):
            assert np.array_equal(again.values, grid.values) and again.values.dtype == grid.values.dtype
            assert repr(again) == repr(grid) and not again.values.flags.writeable
            for a, b in zip(again.distances(points), grid.distances(points)):
                assert np.array_equal(a, b)
    collide.Mesh(*box()).save(tmp_path / "mesh.npz")
    with pytest.raises(InvalidShape, match=r"SignedDistanceGrid.load: .*mesh.npz"):
        SignedDistanceGrid.load(tmp_path / "mesh.npz")
    steep = SignedDistanceGrid.from_arrays(np.zeros((2, 2, 2)), 1.0)
    values = np.zeros((2, 2, 2))
    values[1] = 3.0
    object.__setattr__(steep, "values", values)
    steep.save(tmp_path / "steep.npz")
    with pytest.raises(InvalidShape, match=r"steep.npz: .*no distances"):
        SignedDistanceGrid.load(tmp_path / "steep.npz")


def test_bad_arguments():
    mesh, zeros = collide.Mesh(*box()), np.zeros((2, 2, 2))
    with pytest.raises(InvalidShape, match="from_mesh"):
        SignedDistanceGrid()
    with pytest.raises(InvalidShape, match=r"nodes, more than 2\*\*30"):
        SignedDistanceGrid.from_mesh(mesh, 1e-6)
    with pytest.raises(InvalidShape, match="lost in rounding"):
        SignedDistanceGrid.from_arrays(zeros, 1e-3, (1e12, 0, 0))
    for wrong in (np.zeros((2, 2)), np.zeros((1, 2, 2)), np.full((2, 2, 2), np.nan)):
        with pytest.raises(InvalidShape, match="values"):
            SignedDistanceGrid.from_arrays(wrong, 1.0)
    for cell in (0.0, -1.0, (1, 1), np.inf):
        with pytest.raises(InvalidShape, match="cell"):
            SignedDistanceGrid.from_arrays(zeros, cell)
    with pytest.raises(UnsupportedQuery, match="signed=False"):
        SignedDistanceGrid.from_mesh(collide.Mesh(*box(), solid=False), 0.5)
    assert (SignedDistanceGrid.from_mesh(collide.Mesh(*box(), solid=False), 0.5, signed=False).values >= 0.0).all()
    with pytest.raises(InvalidArgument, match="points"):
        SignedDistanceGrid.from_arrays(zeros, 1.0).distances((0, 0, np.inf))
    with pytest.raises(AttributeError, match="immutable"):
        SignedDistanceGrid.from_arrays(zeros, 1.0).error = 2.0
