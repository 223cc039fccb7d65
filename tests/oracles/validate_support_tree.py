"""Checks a support tree: what its arrays promise, and what its answers are worth, against exact brute force."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.support.support_tree import SupportTree
from collide.support.support_tree_query import extreme_vertices

#: Part of the unsettled answers that may be off by more than rounding.
_MISSES = 1e-3


def validate_support_tree(tree: SupportTree, samples: int = 100, seed: int = 0) -> None:
    """Raise AssertionError, naming the place, unless the tree holds what queries rely on.

    Checked are: neighbours both ways, none twice; every coarse vertex on its own list, no candidate twice;
    answers in ``samples`` random directions, facet normals and directions between two facet normals each,
    settled ones exactly. O(samples·n); meant for tests and for arrays of doubtful origin.
    """
    _check_rings(tree)
    _check_lists(tree)
    rng = np.random.default_rng(seed)
    random = rng.normal(size=(samples, 3))
    normals, between = _facet_directions(tree, samples, rng)
    missed = 0
    for what, directions in (("random", random), ("facet normal", normals), ("between normals", between)):
        raw, settled = (extreme_vertices(tree, directions, exact) for exact in (False, True))
        for g, unproven, proven in zip(directions, raw.tolist(), settled.tolist()):
            assert proven >= 0, f"{what} {g.tolist()}: not proven"
            best = farthest_rows(tree.points, g)
            assert proven in best, f"{what} {g.tolist()}: vertex {proven} is not farthest, {min(best)} is"
            missed += not _within_rounding(tree.points, g, unproven, proven)
    assert missed <= _MISSES * 3 * samples + 1, f"{missed} of {3 * samples} answers need climbing"


def farthest_rows(points: np.ndarray, g: np.ndarray) -> set[int]:
    """All rows that are farthest in direction g, in exact arithmetic."""
    values, bounds = _values(points, g)
    candidates = np.flatnonzero(values >= (values - bounds).max() - bounds)
    if len(candidates) == 1:
        return {int(candidates[0])}
    direction = [Fraction(c) for c in g.tolist()]
    exact = {
        int(row): sum((Fraction(c) * d for c, d in zip(points[row].tolist(), direction)), Fraction(0))
        for row in candidates
    }
    best = max(exact.values())
    return {row for row, value in exact.items() if value == best}


def _values(points: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Products with g, and bounds of their rounding errors; directions are expected to be of ordinary size."""
    terms = points * g
    return terms.sum(axis=1), np.abs(terms).sum(axis=1) * 1e-15 + 1e-300


def _within_rounding(points, g, vertex, best) -> bool:
    values, bounds = _values(points[[vertex, best]], g)
    return bool(values[0] >= values[1] - 2.0 * bounds.max() - 1e-15 * np.abs(g).max() * np.abs(points).max())


def _check_rings(tree: SupportTree) -> None:
    n = len(tree.points)
    source = np.repeat(np.arange(n), np.diff(tree.ring_starts))
    ways, back = source * n + tree.ring, tree.ring.astype(np.int64) * n + source
    values, counts = np.unique(ways, return_counts=True)
    assert (counts == 1).all(), f"vertex {values[counts > 1][0] // n} has a neighbour twice"
    one_way = np.setdiff1d(ways, back)
    assert not len(one_way), f"{one_way[0] // n} has the neighbour {one_way[0] % n}, but not the other way round"


def _check_lists(tree: SupportTree) -> None:
    rows = tree.rows_of_entries()
    node = np.repeat(np.arange(len(tree.nodes) - 1), np.diff(tree.nodes))
    has_owner = np.zeros(len(tree.nodes) - 1, dtype=bool)
    has_owner[node[rows == tree.owners[node]]] = True
    has_owner[0] = True
    assert has_owner.all(), f"vertex {tree.owners[~has_owner][0]} is not on its own list"
    first = tree.points[rows[tree.nodes[node]]]
    filling = (tree.points[rows] == first).all(axis=1)  # short lists are filled up with their first entry
    keys = (node.astype(np.int64) * len(tree.points) + rows)[~filling]
    values, counts = np.unique(keys, return_counts=True)
    assert (counts == 1).all(), f"node {values[counts > 1][0] // len(tree.points)} has a candidate twice"


def _facet_directions(tree: SupportTree, samples: int, rng) -> tuple[np.ndarray, np.ndarray]:
    """Normals of facets, and sums of the unit normals of two that share an edge."""
    degree = np.diff(tree.ring_starts)
    vertices = rng.choice(np.flatnonzero(degree > 0), size=samples)
    shift = rng.integers(0, 1 << 30, size=samples)

    def neighbour(i):
        return (
            tree.points[tree.ring[tree.ring_starts[vertices] + (shift + i) % degree[vertices]]] - tree.points[vertices]
        )

    scale = 1.0 / np.abs(tree.points).max()
    corners = [neighbour(i) * scale for i in range(3)]
    normals = np.cross(corners[0], corners[1])
    next_normals = np.cross(corners[1], corners[2])
    units = [n / np.maximum(np.sqrt((n * n).sum(axis=1)), 1e-300)[:, None] for n in (normals, next_normals)]
    between = units[0] + units[1]
    flat = np.abs(between).max(axis=1) < 1e-9  # both sides of a flat hull
    between[flat] = corners[0][flat]
    normals[np.abs(normals).max(axis=1) < 1e-250] = (0.0, 0.0, 1.0)
    return normals, between
