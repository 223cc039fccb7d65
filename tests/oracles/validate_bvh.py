"""Checks of every property of a box-tree that queries rely on."""

from __future__ import annotations

import numpy as np

from collide.mesh.bvh import MeshTree, leaf_runs
from collide.mesh.bvh_slabs import make_slabs


def validate_mesh_tree(tree: MeshTree, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Every facet is in one leaf, with its corners; every box holds all corners below it, every slab too.

    Raises AssertionError naming the node. O(m·depth).
    """
    assert np.array_equal(np.sort(tree.ids), np.arange(len(faces))), "a facet is missing or doubled"
    corners = np.asarray(vertices, dtype=float)[np.asarray(faces)[tree.ids]]
    assert np.array_equal(corners.reshape(-1, 9), tree.triangles), "triangles are not those of the facets"
    first, last = _ranges(tree)
    (centres, half_lengths), origins = tree.boxes(), tree.origins()
    slabs = make_slabs(tree).reshape(-1, 5, 8).astype(float)
    scaled = (corners - tree.centre) * 2.0**-tree.exponent
    rounding = 4e-16 * (1.0 + np.abs(corners).max() * 2.0**-tree.exponent)
    for node, slot in zip(*np.nonzero(tree.used())):
        points = scaled[first[node, slot] : last[node, slot]].reshape(-1, 3)
        off = np.abs(points - centres[node, slot]) - half_lengths[node, slot]
        assert (off <= rounding).all(), f"box {slot} of node {node} does not hold what is below it"
        heights = ((points - origins[node]) * slabs[node, :3, slot]).sum(axis=1)
        off = np.abs(heights - slabs[node, 3, slot]) - slabs[node, 4, slot]
        assert (off <= 4 * rounding).all(), f"slab {slot} of node {node} does not hold what is below it"


def _ranges(tree: MeshTree) -> tuple[np.ndarray, np.ndarray]:
    """(k, 8) first and last triangle below every slot."""
    links, used = tree.links(), tree.used()
    first = np.full(links.shape, len(tree.ids), dtype=np.int64)
    last = np.zeros(links.shape, dtype=np.int64)
    leaf = used & (links < 0)
    first[leaf], count = leaf_runs(links[leaf])
    last[leaf] = first[leaf] + count
    for node in range(len(links) - 1, -1, -1):
        for slot in np.flatnonzero(used[node] & (links[node] >= 0)).tolist():
            below = links[node, slot]
            first[node, slot], last[node, slot] = first[below].min(), last[below].max()
    return first, last
