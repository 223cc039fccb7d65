"""Voxel grids: what they are made of, what they refuse, contacts over their inner faces."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import collide

EYE = np.eye(4)


def test_arrays_lists_and_points_make_the_same_cells():
    rng = np.random.default_rng(1)
    for n in (1, 3, 4, 5, 16, 17, 65):
        occupied = rng.random((n, 3 * n % 20 + 1, 7)) < 0.2
        occupied[-1, 0, 0] = True
        cells = np.argwhere(occupied)
        grid = collide.VoxelGrid(occupied, (0.1, 0.2, 0.4))
        assert np.array_equal(grid.cells, cells) and grid.count == len(cells)
        assert np.array_equal(grid.cells_of(np.ravel_multi_index(tuple(cells.T), occupied.shape)), cells)
        shuffled = np.repeat(cells, 2, axis=0)[rng.permutation(2 * len(cells))] - 40
        listed = collide.VoxelGrid(shuffled, (0.1, 0.2, 0.4))
        assert np.array_equal(listed.cells, cells - 40)
        middles = (cells - 40 + 0.5) * (0.1, 0.2, 0.4)
        assert np.array_equal(collide.VoxelGrid.from_points(middles, (0.1, 0.2, 0.4)).cells, cells - 40)


def test_grids_are_values():
    grid = collide.VoxelGrid(np.ones((2, 3, 4), dtype=np.uint8), 0.5, collide.pose((1, 2, 3), rpy=(0.1, 0.2, 0.3)))
    copy = pickle.loads(pickle.dumps(grid))
    assert copy == grid and hash(copy) == hash(grid) and grid != collide.VoxelGrid(np.ones((2, 3, 4), dtype=bool), 0.5)
    assert repr(grid) == "VoxelGrid(<24 of 2×3×4 cells>, cell=0.5)"
    with pytest.raises(AttributeError, match="immutable"):
        grid.cell = 1.0
    with pytest.raises(ValueError, match="read-only"):
        grid.X[0, 0] = 2.0


def test_a_bit_a_cell_is_kept():
    occupied = np.random.default_rng(2).random((256, 256, 256), dtype=np.float32) < 0.5
    grid = collide.VoxelGrid(occupied, 0.01)
    assert grid.count == np.count_nonzero(occupied) and grid.tree.nbytes < 1.1 * occupied.size / 8


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ((np.zeros((2, 2, 2), bool), 0.1), "none of 2 × 2 × 2 cells is occupied; of an empty map make no body"),
        (("room.binvox", 0.1), r"must be numbers, got 'room\.binvox'; files are read by VoxelGrid\.from_file"),
        ((np.ones((2, 2, 2)), 0.1), r"\(2, 2, 2\) float64; of probabilities take occupied > 0\.5"),
        ((np.zeros((0, 3), int), 0.1), "no cell is occupied"),
        ((np.ones((2, 2)), 0.1), r"\(nx, ny, nz\) of bool, or cells \(k, 3\) of int"),
        ((np.ones((2, 2, 2)), 0.1), "of bool"),
        ((np.ones((4, 3), bool), 0.1), r"got bool \(k, 3\)"),
        ((np.ones((2, 2, 2), bool), 0.0), "cell must be > 0"),
        ((np.ones((2, 2, 2), bool), (0.1, -1.0, 0.1)), r"cell\[1\] must be > 0"),
        (([[0, 0, 0], [1 << 20, 0, 0]], 0.1), "take larger cells, or several grids"),
        (([[0, 0, 0], [2000, 2000, 2000]], 0.1), "2001 × 2001 × 2001 cells are more"),
        (([[1 << 62, 0, 0]], 0.1), "±2⁶²"),
    ],
)
def test_what_is_no_grid_is_refused(arguments, match):
    with pytest.raises(collide.InvalidShape, match=match):
        collide.VoxelGrid(*arguments)


def test_numbers_of_no_cell_are_refused():
    grid = collide.VoxelGrid(np.ones((2, 2, 2), bool), 0.1)
    for parts in (8, -1, 0.5, [0, 9]):
        with pytest.raises(collide.InvalidArgument, match="cells_of: parts"):
            grid.cells_of(parts)


def terrain(rng) -> np.ndarray:
    """Steps of one cell, columns full to the ground."""
    heights = rng.integers(1, 4, (12, 12))
    return np.arange(4)[None, None] < heights[..., None]


def test_bodies_on_a_floor_of_cells_are_pushed_up_alone():
    """Whatever lies on a floor, flush cells or not, has contacts with normals straight up."""
    floor, rng, n_rows = collide.VoxelGrid(np.ones((20, 20, 2), bool), 0.1), np.random.default_rng(3), 0
    bodies = (collide.Box((0.35, 0.25, 0.2)), 0.1), (collide.Sphere(0.15), 0.15), (collide.Cylinder(0.2, 0.2), 0.1)
    for shape, height in bodies:
        for _ in range(20):
            depth, place = rng.uniform(1e-4, 0.01), rng.uniform(0.5, 1.5, 2)
            X = collide.pose((*place, 0.2 + height - depth), rpy=(0, 0, rng.uniform(-3, 3)))
            rows = collide.contacts(floor, shape, EYE, X).rows
            assert len(rows) and np.allclose(rows["normal"], (0, 0, 1), atol=1e-9)
            assert np.allclose(rows["distance"], -depth, atol=1e-9)
            assert np.allclose(rows["point_a"][:, 2], 0.2, atol=1e-9)
            cells = floor.cells_of(rows["part_a"])
            assert (np.abs((cells + 0.5) * 0.1 - rows["point_a"]) <= 0.05 + 1e-9).all()
            n_rows += len(rows)
    assert n_rows > 200


def test_no_contact_pushes_through_a_face_between_cells():
    rng, n_rows = np.random.default_rng(4), 0
    for k in range(60):
        occupied = terrain(rng)
        grid, shape = collide.VoxelGrid(occupied, 0.1), (collide.Sphere(0.12), collide.Box((0.2, 0.3, 0.15)))[k % 2]
        X = collide.pose((*rng.uniform(0.2, 1.0, 2), rng.uniform(0.15, 0.4)), rpy=rng.uniform(-3, 3, 3))
        rows = collide.contacts(grid, shape, EYE, X, margin=0.02).rows
        outside = np.floor((rows["point_a"] + 1e-4 * rows["normal"]) / 0.1).astype(int)
        within = ((outside >= 0) & (outside < occupied.shape)).all(axis=1)
        filled = np.zeros(len(rows), dtype=bool)
        filled[within] = occupied[tuple(outside[within].T)]
        assert not filled.all() or not len(rows) or collide.collide(grid, shape, EYE, X)
        if not filled.all():
            assert not filled.any()
        n_rows += len(rows)
    assert n_rows > 100


def test_binvox_files_hold_the_cells(tmp_path):
    grid = collide.VoxelGrid(np.random.default_rng(5).random((5, 6, 7)) < 0.4, 0.125, collide.pose((0.5, 1.0, -2.0)))
    grid.save(tmp_path / "grid.binvox")
    again = collide.VoxelGrid.from_file(tmp_path / "grid.binvox")
    assert np.array_equal(again.cells, grid.cells) and np.array_equal(again.X, grid.X)
    assert np.array_equal(again.cell, grid.cell)
    turned = collide.VoxelGrid([(0, 0, 0)], 0.1, collide.pose((0, 0, 0), rpy=(0.1, 0, 0)))
    for bad, path, match in (
        (turned, "a.binvox", "the grid is turned"), (grid, "a.vox", r"suffix must be \.binvox"),
        (collide.VoxelGrid([(0, 0, 0)], (0.1, 0.2, 0.1)), "a.binvox", "cells are cubes"),
        (grid, "none/a.binvox", "none/a.binvox"),
    ):
        with pytest.raises(collide.InvalidShape, match=match):
            bad.save(tmp_path / path)
    (tmp_path / "cut.binvox").write_bytes((tmp_path / "grid.binvox").read_bytes()[:-2])
    with pytest.raises(collide.InvalidShape, match="cut short"):
        collide.VoxelGrid.from_file(tmp_path / "cut.binvox")


def test_the_surface_of_a_grid_closes_around_its_cells():
    rng = np.random.default_rng(6)
    for case in range(12):
        occupied = rng.random(rng.integers(1, 7, 3)) < 0.6
        occupied.flat[0] = True
        X = collide.pose((0.5, 0, 1), rpy=(0.1, 0.2, 0.3)) if case % 2 else collide.pose((0.5, 0, 1))
        grid = collide.VoxelGrid(occupied, (0.1, 0.2, 0.3), X)
        mesh = collide.Mesh(*collide.tessellate(grid))
        assert mesh.solid and mesh.report.volume == pytest.approx(grid.count * 0.006, rel=1e-9)


def test_grids_scale_and_mirror():
    cells = [(0, 0, 0), (1, 0, 0), (3, 2, 1)]
    grid = collide.VoxelGrid(cells, 0.5, collide.pose((1.0, 0.0, 0.0)))
    mirrored = grid.scaled((-2.0, 1.0, 0.5))
    assert mirrored.cells.tolist() == [[-4, 2, 1], [-2, 0, 0], [-1, 0, 0]]
    assert mirrored.cell.tolist() == [1.0, 0.5, 0.25]
    assert mirrored.X[:3, 3].tolist() == [-2.0, 0.0, 0.0]
    tree = collide.OcTree(([[0, 0, 0], [2, 0, 0]], [1, 0], [1.0, 1.0]), 0.5).scaled((-2.0, 2.0, 2.0))
    assert tree.resolution == 1.0 and tree.cells[:, 0].tolist() == [-3, *[-2] * 4, *[-1] * 4]
    turned = collide.VoxelGrid(cells, 0.5, collide.pose((0, 0, 0), rpy=(0.1, 0, 0)))
    with pytest.raises(collide.InvalidShape, match="scale before it is placed"):
        turned.scaled((1.0, 2.0, 1.0))
    with pytest.raises(collide.InvalidShape, match="single resolution"):
        tree.scaled((1.0, 2.0, 1.0))
