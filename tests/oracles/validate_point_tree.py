"""Checks of every property of a tree over points that queries rely on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.fields.point_tree import PointTree
from collide.fields.point_tree_kernel import MAX_LEVELS
from collide.kernels import address_of
from collide.mesh.bvh import (
    CENTRE,
    DEPTH,
    EXPONENT,
    MAX_LEAF,
    N_FACETS,
    N_NODES,
    NOTHING,
    NUMBERS_AT,
    RADIUS,
    REACH,
    WIDTH,
    leaf_runs,
)


class Leaves(NamedTuple):
    """Leaves by the ways from the root, (m, depth) slots each: node · 8 + slot, −1 behind the last.

    first, count : (m,) the run of places.
    """

    way: np.ndarray
    first: np.ndarray
    count: np.ndarray


def validate_point_tree(tree: PointTree) -> Leaves:
    """Every point is in one leaf, with its floats, and every box above holds it; links lead down, numbers are bounds,
    the header is right.

    Raises AssertionError naming node or place. O(n·depth).
    """
    n, points = len(tree.points), tree.points
    header, numbers = tree._header, tree._numbers
    assert header[N_NODES] == len(tree._nodes) and header[DEPTH] == tree.depth <= MAX_LEVELS
    assert header[N_FACETS] == len(tree.ids) >= n and header[NUMBERS_AT] == address_of(numbers)
    assert np.array_equal(tree.low, points.min(axis=0)) and np.array_equal(tree.high, points.max(axis=0))
    assert np.array_equal(numbers[REACH : REACH + 3], np.abs(points).max(axis=0)), "another reach than the points'"
    assert np.linalg.norm(points - numbers[CENTRE : CENTRE + 3], axis=1).max() <= numbers[RADIUS]
    leaves = _leaves(tree)
    places = leaves.first[:, None] + np.arange(MAX_LEAF)
    taken = np.arange(MAX_LEAF) < leaves.count[:, None]
    ids = tree.ids[places[taken]]
    assert np.array_equal(np.sort(ids), np.arange(n)), "a point is missing or doubled"
    assert len(np.unique(leaves.first)) == len(leaves.first) and (leaves.first % MAX_LEAF == 0).all()
    free = np.ones(len(tree.ids), dtype=bool)
    free[places[taken]] = False
    assert (tree.ids[free] == -1).all(), f"place {np.flatnonzero(free & (tree.ids != -1))[:1]} has a point, but no leaf"
    scaled = (points - numbers[CENTRE : CENTRE + 3]) * math.ldexp(1.0, -int(header[EXPONENT]))
    assert np.abs(scaled).max() <= 1.0, "a point out of the range of the floats"
    repeated = leaves.first[:, None] + np.minimum(np.arange(WIDTH), leaves.count[:, None] - 1)
    floats = tree._floats[leaves.first // MAX_LEAF]
    assert np.array_equal(floats, scaled[tree.ids[repeated]].transpose(0, 2, 1).astype(np.float32)), "floats are off"
    _check_boxes(tree, leaves, scaled)
    return leaves


def _leaves(tree: PointTree) -> Leaves:
    """Level by level; every node is met once at most."""
    links, used = tree._nodes[:, 6 * WIDTH :], tree._nodes[:, 3 * WIDTH : 4 * WIDTH].view(np.float32) > NOTHING / 2
    assert used[0].tolist() == [True] + [False] * (WIDTH - 1), "the root has another number of boxes than one"
    assert (links[~used] == 0).all(), "a link without a box"
    ways, nodes, leaf_ways, runs, n_seen = np.zeros((1, 0), dtype=np.int64), np.zeros(1, dtype=np.int64), [], [], 0
    for level in range(tree.depth):
        n_seen += len(nodes)
        assert used[nodes].any(axis=1).all(), "a node without boxes"
        parents, slots = np.nonzero(used[nodes])
        ways = np.column_stack([ways[parents], WIDTH * nodes[parents] + slots])
        below = links[nodes[parents], slots]
        beyond = np.full((len(below), tree.depth - level - 1), -1)
        leaf_ways.append(np.hstack([ways, beyond])[below < 0])
        runs.append(below[below < 0])
        ways, nodes = ways[below >= 0], below[below >= 0].astype(np.int64)
    assert len(nodes) == 0 and n_seen <= len(links), "deeper than it says"
    return Leaves(np.concatenate(leaf_ways), *leaf_runs(np.concatenate(runs)))


def _check_boxes(tree: PointTree, leaves: Leaves, scaled: np.ndarray) -> None:
    """Corners are worked out in doubles on the way up: 2⁻⁵⁰ is what they may round by."""
    boxes = tree._nodes[:, : 6 * WIDTH].view(np.float32).reshape(-1, 6, WIDTH).astype(np.float64)
    for column in leaves.way.T:
        inside = column >= 0
        node, slot = column[inside] // WIDTH, column[inside] % WIDTH
        box = boxes[node, :, slot]
        for i in range(MAX_LEAF):
            place = leaves.first[inside] + np.minimum(i, leaves.count[inside] - 1)
            off = np.abs(scaled[tree.ids[place]] - box[:, :3]) - box[:, 3:]
            bad = (off > 2.0**-50).any(axis=1)
            assert not bad.any(), f"box {slot[bad][:1]} of node {node[bad][:1]} does not hold place {place[bad][:1]}"
