"""Octrees: leaves of all sizes as cells, unknown space, maps of rays, what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from field_unions import random_leaves

import collide


def cells_by_hand(leaves: collide.OcTreeLeaves, unknown: str) -> set[tuple[int, ...]]:
    occupied, known = set(), set()
    for cell, exponent, log_odds in zip(leaves.cell.tolist(), leaves.exponent.tolist(), leaves.log_odds.tolist()):
        inside = {tuple(np.add(cell, offset).tolist()) for offset in np.ndindex((1 << exponent,) * 3)}
        known |= inside
        occupied |= inside if log_odds >= 0.0 else set()
    if unknown == "occupied":
        low, high = np.array(sorted(known)).min(axis=0), np.array(sorted(known)).max(axis=0)
        everything = {tuple((offset + low).tolist()) for offset in np.array(list(np.ndindex(*(high - low + 1))))}
        occupied |= everything - known
    return occupied


@pytest.mark.parametrize("unknown", ["free", "occupied"])
def test_leaves_are_their_cells(unknown):
    rng, n_large = np.random.default_rng(1), 0
    for case in range(24):
        leaves = random_leaves(rng, 1 + case % 4)
        tree = collide.OcTree(leaves, 0.25, unknown=unknown)
        wanted = cells_by_hand(leaves, unknown)
        assert set(map(tuple, tree.cells.tolist())) == wanted and tree.count == len(wanted), case
        assert pickle.loads(pickle.dumps(tree)) == tree
        n_large += int((leaves.exponent > 0).sum())
    assert n_large > 50


def test_one_leaf_of_any_size_is_a_cube():
    for exponent in range(9):
        tree = collide.OcTree(([[0, 0, 0]], [exponent], [1.0]), 0.5)
        side = 0.5 * 2.0**exponent
        assert tree.count == 8**exponent and tree.tree.nbytes < 2000
        ball, above = collide.Sphere(0.25), collide.pose((0.5 * side, 0.4 * side, side + 1.0))
        row = collide.distance(tree, ball, np.eye(4), above)
        assert row.distance == 0.75 and (tree.cells_of(row.part_a) * 0.5 <= side).all()


def test_the_threshold_decides():
    leaves = ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [0, 0, 0], np.log([0.3 / 0.7, 1.0, 0.9 / 0.1]))
    assert [collide.OcTree(leaves, 0.1, threshold=p).count for p in (0.2, 0.5, 0.8)] == [3, 2, 1]
    with pytest.raises(collide.InvalidShape, match=r"none of 3 leaves is occupied, the threshold being 0\.95"):
        collide.OcTree(leaves, 0.1, threshold=0.95)


def test_rays_free_the_cells_that_they_go_through():
    """Beside a walk in steps of a hundredth of a cell."""
    rng, origin = np.random.default_rng(2), np.array([0.05, 0.03, 0.02])
    points = rng.uniform(-1.0, 1.0, (40, 3))
    tree = collide.OcTree.from_rays(origin, points, 0.1)
    hits = {tuple(cell) for cell in np.floor(points / 0.1).astype(int).tolist()}
    assert set(map(tuple, tree.cells.tolist())) == hits
    free = {tuple(cell) for cell in tree.leaves.cell[tree.leaves.log_odds < 0.0].tolist()}
    missed = 0
    for p in points:
        t = np.linspace(0.0, 1.0, int(np.linalg.norm(p - origin) / 0.001))[:, None]
        stepped = {tuple(cell) for cell in np.floor((origin + t * (p - origin)) / 0.1).astype(int).tolist()}
        missed += len(stepped - hits - free)
        assert len(stepped - hits - free) <= 1  # cut at a corner, where rounding decides
    assert missed <= 3 and len(free) > 200
    near = collide.OcTree.from_rays(origin, points, 0.1, max_range=0.8)
    assert set(map(tuple, near.cells.tolist())) < hits and len(near.leaves.cell) < len(tree.leaves.cell)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ((([[0, 0, 0]], [0]), 0.1), r"must be \(cell, exponent, log_odds\).*taken by OcTree\.from_points"),
        (("map.bt", 0.1), r"leaves must be numbers, got 'map\.bt'; files are read by OcTree\.from_file"),
        ((([[0, 0, 0]], [0], [-1.0]), 0.1), "none of 1 leaves is occupied, the threshold being 0.5; take a lower"),
        ((([[0, 0]], [0], [1.0]), 0.1), r"cell \(n, 3\) and exponent \(n,\) of int"),
        ((([[0.5, 0, 0]], [0], [1.0]), 0.1), "of int"),
        ((([[1, 0, 0]], [1], [1.0]), 0.1), "no multiple of its leaf's 2 cells"),
        ((([[0, 0, 0]], [17], [1.0]), 0.1), "exponent must lie within 0 … 16"),
        ((([[0, 0, 0], [1, 0, 0]], [1, 0], [1.0, 1.0]), 0.1), "within others, or stand twice"),
        ((([[0, 0, 0], [5, 4, 7]], [3, 2], [1.0, 1.0]), 0.1), "no multiple"),
        ((([[0, 0, 0], [4, 4, 4]], [3, 2], [1.0, -1.0]), 0.1), "within others, or stand twice"),
        ((([[0, 0, 0], [0, 0, 0]], [0, 0], [1.0, 1.0]), 0.1), "within others, or stand twice"),
        ((([[0, 0, 0]], [0], [1.0]), -1.0), "resolution must be > 0"),
        ((([[0, 0, 0], [1 << 21, 0, 0]], [0, 0], [1.0, 1.0]), 0.1), "2²⁰ are the most"),
    ],
)
def test_what_is_no_octree_is_refused(arguments, match):
    with pytest.raises(collide.InvalidShape, match=match):
        collide.OcTree(*arguments)


def test_bad_options_are_refused():
    leaves = ([[0, 0, 0]], [0], [1.0])
    for options, match in (
        ({"threshold": 1.0}, r"within \(0, 1\)"), ({"unknown": "maybe"}, '"free" or "occupied"'),
    ):
        with pytest.raises(collide.InvalidShape, match=match):
            collide.OcTree(leaves, 0.1, **options)
    with pytest.raises(collide.InvalidShape, match="2 origins and 3 points"):
        collide.OcTree.from_rays(np.zeros((2, 3)), np.ones((3, 3)), 0.1)
    with pytest.raises(collide.InvalidShape, match="no ray of 3 ends within max_range"):
        collide.OcTree.from_rays((0, 0, 0), np.ones((3, 3)), 0.1, max_range=0.5)
    for origins, points in (((1e6, 0, 0), np.ones((3, 3))), ((0, 0, 0), [[1, 1, 1], [1e6, 0, 0]])):
        with pytest.raises(collide.InvalidShape, match="resolution of 1e-11 m is too fine"):
            collide.OcTree.from_rays(origins, points, 1e-11)


def test_files_hold_the_leaves(tmp_path):
    rng = np.random.default_rng(3)
    for case in range(8):
        leaves = random_leaves(rng, 1 + case % 4)
        tree = collide.OcTree(leaves, 0.125)
        tree.save(tmp_path / "map.bt")
        again = collide.OcTree.from_file(tmp_path / "map.bt", resolution=0.125)
        assert np.array_equal(again.cells, tree.cells) and len(again.leaves.cell) == len(leaves.cell)
        assert np.array_equal(collide.OcTree.from_file(tmp_path / "map.bt", threshold=0.9).cells, tree.cells)
    with pytest.raises(collide.InvalidShape, match=r"its resolution is 0\.125 m, not 0\.1"):
        collide.OcTree.from_file(tmp_path / "map.bt", resolution=0.1)
    (tmp_path / "cut.bt").write_bytes((tmp_path / "map.bt").read_bytes()[:-3])
    for path, match in (("cut.bt", "octree .*cut.bt"), ("none.bt", "none.bt")):
        with pytest.raises(collide.InvalidShape, match=match):
            collide.OcTree.from_file(tmp_path / path)
    with pytest.raises(collide.InvalidShape, match=r"suffix must be \.bt"):
        tree.save(tmp_path / "map.ply")
    with pytest.raises(collide.InvalidShape, match="cells within ±32768"):
        collide.OcTree(([[40_000, 0, 0]], [0], [1.0]), 0.1).save(tmp_path / "far.bt")


def test_rays_too_long_for_their_cells_are_refused_before_they_are_walked():
    for arguments, match in (
        (((0, 0, 0), [[1, 0, 0]], 1e-9), "134217728 are the most; take larger cells"),
        (((1e19, 0, 0), [[1e19, 1, 0]], 1.0), "too fine for these points"),
    ):
        with pytest.raises(collide.InvalidShape, match=match):
            collide.OcTree.from_rays(*arguments)
