"""Checks of every property that Erickson's paper promises of a graded box-tree, by their definitions: for tests."""

from __future__ import annotations

import numpy as np

from collide.papers.hierarchies.graded_tree import CELL, FIRST, LAST, LEVEL, PARENT, GradedTree, centroids


def validate_graded_tree(tree: GradedTree, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Each property of the paper's section 3.2, by its definition; raises AssertionError naming node or facet.

    Cells lie in each other and are smaller from node to node; facet sets are as defined, from the
    centroids and the bounding cubes of every level, also of levels compressed away; outliers fit no
    child; no node is empty or has a single child; a leaf for each facet; at most 2m − 1 nodes; depth as bounded.
    """
    corners = np.asarray(vertices, dtype=float)[np.asarray(faces)]
    m = len(corners)
    nodes, parent = tree.nodes, tree.nodes[:, PARENT]
    assert np.array_equal(np.sort(tree.order), np.arange(m)), "a facet is missing or doubled"
    assert nodes[0, LEVEL] == 0 and parent[0] == -1 and (nodes[0, FIRST], nodes[0, LAST]) == (0, m), "no root"
    assert (corners >= tree.low).all() and (corners <= tree.low + tree.width * (1 + 1e-15)).all(), "outside the root"
    for k in range(1, len(nodes)):
        up = nodes[k, LEVEL] - nodes[parent[k], LEVEL]
        assert 0 <= parent[k] < k and up > 0, f"node {k} is not below its parent"
        assert (nodes[k, CELL : CELL + 3] >> up == nodes[parent[k], CELL : CELL + 3]).all(), (
            f"node {k} outside its parent"
        )
    cells = {tuple(row) for row in nodes[:, LEVEL : CELL + 3].tolist()}
    assert len(cells) == len(nodes), "two nodes with one control cube"
    children = np.bincount(parent[1:], minlength=len(nodes)) + np.bincount(tree.owner, minlength=len(nodes))
    assert (children[1:] >= 2).all() and (children[0] >= 2 or m == 1 or len(nodes) > 1), "a path that is not compressed"
    assert tree.size() <= max(2 * m - 1, 2), "too many nodes"  # a single facet hangs from a root
    assert tree.deepest_level() <= tree.levels, "deeper than the shortest edge allows"
    sizes = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1)
    # Only facets shrunk to points would go down for ever: levels end for their sake.
    assert (sizes == 0.0).any() or tree.deepest_level() < tree.levels or m == 1, "levels ended too early"
    _check_facet_sets(tree, corners)


def _check_facet_sets(tree: GradedTree, corners: np.ndarray) -> None:
    middles = centroids(corners)
    low, high = corners.min(axis=1), corners.max(axis=1)
    for k, row in enumerate(tree.nodes.tolist()):
        facets = tree.order[row[FIRST] : row[LAST]]
        assert len(facets) > 0, f"node {k} is empty"
        above = tree.nodes[row[PARENT], LEVEL] + 1 if k else 0
        for level in range(above, row[LEVEL] + 1):
            cell = np.array(row[CELL : CELL + 3]) >> (row[LEVEL] - level)
            assert _belongs(tree, level, cell[None], middles[facets], low[facets], high[facets]).all(), (
                f"a facet not of node {k}"
            )
    # The facets that hang from a node: outliers fit no child, others are alone in theirs.
    owner = tree.nodes[tree.owner]
    assert ((owner[:, FIRST] <= _places(tree)) & (_places(tree) < owner[:, LAST])).all(), "a leaf outside its node"
    level = owner[:, LEVEL] + 1
    cell = _cell_of(tree, middles, owner)
    fits = _belongs(tree, level[:, None], cell, middles, low, high)
    clearly = _belongs(tree, level[:, None], cell, middles, low, high, -1.0)
    ended = owner[:, LEVEL] >= tree.levels
    assert not (clearly & tree.outlier & ~ended).any(), "an outlier that fits a child"
    assert (fits | tree.outlier).all(), "a leaf that is an outlier and is not marked so"
    alone = ~tree.outlier
    keys = np.concatenate([tree.owner[alone, None], cell[alone]], axis=1)
    assert len(np.unique(keys, axis=0)) == len(keys), "two leaves that belong to one child"


def _places(tree: GradedTree) -> np.ndarray:
    places = np.empty(len(tree.order), dtype=np.int64)
    places[tree.order] = np.arange(len(tree.order))
    return places


def _cell_of(tree: GradedTree, middles: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """The child cell that holds each centroid."""
    size = tree.width / 2.0 ** owner[:, LEVEL, None]
    halfway = tree.low + (owner[:, CELL : CELL + 3] + 0.5) * size
    return 2 * owner[:, CELL : CELL + 3] + (middles >= halfway)


def _belongs(tree: GradedTree, level, cell, middles, low, high, benefit=1.0) -> np.ndarray:
    """Whether centroids are in control cubes and facets in bounding cubes, with rounding in favour or not."""
    size = tree.width / 2.0 ** np.asarray(level, dtype=float)
    slack = benefit * 4e-16 * (tree.width + np.abs(tree.low).max())
    middle = tree.low + (cell + 0.5) * size
    inside = np.abs(middles - middle) <= 0.5 * size + slack
    return (inside & (low >= middle - size - slack) & (high <= middle + size + slack)).all(axis=1)
