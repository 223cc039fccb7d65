"""Makes a support tree from a hull: nested subsets of its vertices, and candidate lists between them.

Any subset of a hull's vertices is in convex position; `nested_subsets.py` chooses. `candidate_lists.py` works out the
lists between two subsets from the edges of the finer subset's hull. Kernels do both: `grow_tree.py`.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.support.grow_tree import NOT_CLOSED, UNUSED_VERTEX, grow_tree, keep_tree, tree_memory
from collide.support.support_tree import SupportTree, checked_points
from collide.support.tree_layout import (
    AT_ENTRIES,
    AT_LIST_COORDINATES,
    AT_NODES,
    AT_RING,
    AT_RING_STARTS,
    DEPTH,
    ENTRIES,
    FLAT,
    HEADER,
    LINKS,
    NODES,
)


def build_support_tree(points: np.ndarray, vertices: np.ndarray, facets: np.ndarray) -> SupportTree:
    """A support tree over a convex hull.

    points : (n, 3) finite. vertices : (h,) rows of the hull's vertices. facets : (f, 3) rows; its surface,
    closed, triangulated, counter-clockwise from outside, without facets of no area. Of a flat hull the second half
    are those of the first from the other side. Vertices may lie on an edge or a facet of the hull; they take no part in
    queries.

    Raises ValueError where the surface is not closed. Expected O(h log h).
    """
    points, vertices = checked_points(points), np.ascontiguousarray(vertices, dtype=np.int32)
    facets = _checked(points, vertices, facets)
    n, capacity = len(points), 8 * len(vertices) + 4096
    outcome = capacity
    while outcome > 0:
        capacity = outcome
        memory = np.empty(tree_memory(n, len(facets), capacity) // 8, dtype=np.int64)
        outcome = grow_tree(
            address_of(points), n, address_of(vertices), len(vertices), address_of(facets), len(facets),
            address_of(memory), capacity,
        )
    if outcome < 0:
        raise ValueError(f"support tree: {_WHY.get(outcome, 'levels do not lead to each other')}")
    block = np.empty(int(memory[0]) // 8, dtype=np.int64)
    keep_tree(address_of(points), n, len(facets), address_of(memory), capacity, address_of(block))
    return _tree_of(points, block)


_WHY = {NOT_CLOSED: "the facets are no closed surface", UNUSED_VERTEX: "a vertex without facets"}


def _tree_of(points: np.ndarray, block: np.ndarray) -> SupportTree:
    """The tree that `keep_tree` wrote."""
    header, start, integers = block[:HEADER].tolist(), address_of(block), block.view(np.int32)

    def part(at: int, n: int) -> np.ndarray:
        return integers[(at - start) // 4 :][:n]

    nodes, entries = header[NODES], header[ENTRIES]
    coordinates = block[(header[AT_LIST_COORDINATES] - start) // 8 :][: 3 * entries].view(np.float64)
    owners = part(header[AT_NODES] + (4 * (nodes + 1) + 7) // 8 * 8, nodes)
    return SupportTree(
        points, header[FLAT], header[DEPTH], part(header[AT_NODES], nodes + 1), owners,
        part(header[AT_ENTRIES], entries), coordinates, part(header[AT_RING_STARTS], len(points) + 1),
        part(header[AT_RING], header[LINKS]),
    )


def _checked(points, vertices, facets) -> np.ndarray:
    facets = np.ascontiguousarray(facets, dtype=np.int32)
    if facets.ndim != 2 or facets.shape[1] != 3 or len(facets) < 2 or len(vertices) < 3:
        raise ValueError("support tree: a hull has at least 3 vertices and 2 facets (f, 3)")
    known = np.zeros(len(points), dtype=bool)
    if vertices.min() < 0 or vertices.max() >= len(points) or facets.min() < 0 or facets.max() >= len(points):
        raise ValueError("support tree: vertices and facets are rows of the points")
    known[vertices] = True
    if known.sum() != len(vertices) or not known[facets].all():
        raise ValueError("support tree: vertices must differ from each other and hold all corners of facets")
    return facets
