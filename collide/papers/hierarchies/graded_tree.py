"""The graded box-tree to the letter: J. Erickson, "Local polyhedra and geometric graphs" (2005), section 3.2.

The root's control cube is the smallest cube around the mesh; control cubes are the cells of an octree in the root's. A
node's bounding cube has its control cube's middle and twice its width. Its facet set holds the facets of its parent's
set in its bounding cube with their centroid in its control cube. A facet of a node in no child is an outlier of the
node, and a leaf. Nodes without facets are left out, and paths without branches are single edges.

The paper's bounds hold for this structure: depth ≤ log2(W/ℓ) + 3 levels, W the root's width and ℓ the
shortest edge, and at most 2m − 1 nodes with m leaves. Queries walk another tree (`build_bvh.py`): cubes twice too wide
cost 2 to 35 times more. Each level sorts its facets once: O(m·depth).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.numerics.counting_sort import only_class, sort_by_class

#: Doubles of a facet while the tree is built: centroid, box.
_FACET = 9
#: Integers of a node: level, cell (3), parent, first and last of its facets in the order.
LEVEL, CELL, PARENT, FIRST, LAST = 0, 1, 4, 5, 6
NODE = 7
#: Cells are numbered by integers of this many bits at most.
DEEPEST = 60


class GradedTree(NamedTuple):
    """A graded box-tree over m facets, as arrays.

    low, width : (3,) and a number [m]: the root's control cube.
    nodes : (k, 7) int64: level, cell x, y, z in the grid of 2^level cells a side, parent (−1 for the root), and the
        range of ``order`` of the facet set; inner nodes only, parents first.
    order : (m,) facet numbers; the facets of a node stand together.
    owner : (m,) int64, the parent node of facet k (as numbered in the mesh) as a leaf.
    outlier : (m,) bool, whether the facet is an outlier of its owner; else the facet is alone in a child, a path to a
        single leaf.
    levels : the most levels of the octree: ⌈log2(W/ℓ)⌉ + 3.
    """

    low: np.ndarray
    width: float
    nodes: np.ndarray
    order: np.ndarray
    owner: np.ndarray
    outlier: np.ndarray
    levels: int

    def depth(self) -> int:
        """Edges on the longest way from the root to a leaf, paths compressed."""
        depth = np.zeros(len(self.nodes), dtype=np.int64)
        for k, parent in enumerate(self.nodes[1:, PARENT].tolist(), 1):
            depth[k] = depth[parent] + 1
        return int(depth[self.owner].max()) + 1

    def deepest_level(self) -> int:
        """The largest level of an inner node."""
        return int(self.nodes[:, LEVEL].max())

    def size(self) -> int:
        """Nodes, leaves included."""
        return len(self.nodes) + len(self.order)


def graded_tree(vertices: np.ndarray, faces: np.ndarray) -> GradedTree:
    """The graded box-tree of facets (m, 3) over vertices (n, 3) [m]; m at least 1.

    Facets shrunk to a point, all at the same place, would go down for ever: they become outliers at the octree's last
    level, set by the shortest edge of positive length.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int64)
    m = len(faces)
    corners = vertices[faces]
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    width = float((high - low).max()) * (1.0 + 2.0**-50)
    low = np.array(0.5 * low + 0.5 * high - 0.5 * width)
    levels = _levels(corners, width)
    facets = np.concatenate([centroids(corners), corners.min(axis=1), corners.max(axis=1)], axis=1)
    nodes = np.empty((max(1, m), NODE), dtype=np.int64)
    order = np.arange(m)
    owner, outlier = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    scratch = np.empty(2 * m + 18, dtype=np.int64)
    stack = np.empty((8 * (levels + 2), NODE), dtype=np.int64)
    used = fill_graded(
        address_of(facets), m, address_of(low), width, levels, address_of(nodes), address_of(order), address_of(owner),
        address_of(outlier), address_of(scratch), address_of(stack), len(stack),
    )
    return GradedTree(low, width, nodes[:used].copy(), order, owner, outlier != 0, levels)


def centroids(corners: np.ndarray) -> np.ndarray:
    """(m, 3) from corners (m, 3, 3): the rounded means, which stand for the centroids everywhere."""
    return (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0


def _levels(corners: np.ndarray, width: float) -> int:
    edges = np.sqrt(np.square(corners - np.roll(corners, 1, axis=1)).sum(axis=2))
    edges = edges[edges > 0.0]
    if not len(edges) or width <= 0.0:
        return 0
    return int(min(math.ceil(math.log2(max(width / edges.min(), 1.0))) + 3, DEEPEST))


@entry("int64(int64, int64, int64, float64, int64, int64, int64, int64, int64, int64, int64, int64)")
def fill_graded(
    facets_at, m, low_at, width, levels, nodes_at, order_at, owner_at, outlier_at, scratch_at, stack_at, n_stack
):
    """Nodes, order, owners and outliers; returns the number of inner nodes.

    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    facets = view_f64(facets_at, _FACET * m)
    low = view_f64(low_at, 3)
    nodes = view_i64(nodes_at, NODE * max(1, m))
    order = view_i64(order_at, m)
    owner = view_i64(owner_at, m)
    outlier = view_i64(outlier_at, m)
    scratch = view_i64(scratch_at, 2 * m)
    counts = view_i64(scratch_at + 16 * m, 18)
    stack = view_i64(stack_at, NODE * n_stack)
    for k in range(NODE):
        stack[k] = 0
    stack[PARENT] = -1
    stack[LAST] = m
    top = 1
    used = 0
    while top > 0:
        top -= 1
        at = NODE * top
        first = stack[at + FIRST]
        last = stack[at + LAST]
        _sort_by_child(facets, low, width, levels, stack, at, order, scratch, counts)
        while used > 0 and only_class(counts, 8, last - first) >= 0:
            # All facets in a single child, so no branch: the node becomes the child. Only the root stays.
            child = only_class(counts, 8, last - first)
            stack[at + LEVEL] += 1
            for axis in range(3):
                stack[at + CELL + axis] = 2 * stack[at + CELL + axis] + ((child >> axis) & 1)
            _sort_by_child(facets, low, width, levels, stack, at, order, scratch, counts)
        node = used
        used += 1
        for k in range(NODE):
            nodes[NODE * node + k] = stack[at + k]
        begin = first
        for child in range(9):
            count = counts[child]
            if child == 8 or count == 1:
                for k in range(begin, begin + count):
                    owner[order[k]] = node
                    outlier[order[k]] = 1 if child == 8 else 0
            elif count > 1:
                row = NODE * top
                stack[row + LEVEL] = nodes[NODE * node + LEVEL] + 1
                for axis in range(3):
                    stack[row + CELL + axis] = 2 * nodes[NODE * node + CELL + axis] + ((child >> axis) & 1)
                stack[row + PARENT] = node
                stack[row + FIRST] = begin
                stack[row + LAST] = begin + count
                top += 1
            begin += count
    return used


@kernel
def _sort_by_child(facets, low, width, levels, stack, at, order, scratch, counts):
    """Order a node's facets by child, 8 for outliers; counts become how many there are of each."""
    level, first, last = stack[at + LEVEL], stack[at + FIRST], stack[at + LAST]
    cell = width / float(1 << level)
    for k in range(first, last):
        scratch[k] = _child_of(facets, _FACET * order[k], low, cell, stack, at) if level < levels else 8
    sort_by_class(order, first, last, 9, scratch, counts)


@kernel
def _child_of(facets, f, low, cell, stack, at):
    """The child whose control cube has the centroid, if its bounding cube holds the facet; else 8."""
    child = 0
    for axis in range(3):
        middle = low[axis] + (float(stack[at + CELL + axis]) + 0.5) * cell
        if facets[f + axis] >= middle:
            child |= 1 << axis
    for axis in range(3):
        corner = float(2 * stack[at + CELL + axis] + ((child >> axis) & 1))
        middle = low[axis] + (0.5 * corner + 0.25) * cell
        if facets[f + 3 + axis] < middle - 0.5 * cell or facets[f + 6 + axis] > middle + 0.5 * cell:
            return 8
    return child
