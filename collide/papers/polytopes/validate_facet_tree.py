"""Check a tree's nodes: every F_σ̄ again, in integers, and no larger than ε of its parent."""

from __future__ import annotations

import numpy as np

from collide.papers.polytopes.exact_planes import whole_numbers
from collide.papers.polytopes.facet_tree import FacetTree, Node


def validate_facet_tree(tree: FacetTree, whole: bool = False) -> int:
    """Check all nodes made; returns their number. Raises AssertionError with the fault.

    Every child is recomputed from its parent without doubles, half-space by half-space of the shell cone; every
    point of a net must be in all half-spaces of the net's hull. With ``whole`` every cone at every vertex of every
    net's hull must have been visited.
    """
    pending: list[tuple[Node, np.ndarray]] = [(tree.root, np.arange(len(tree.facets)))]
    n_nodes = n_bytes = 0
    while pending:
        node, F = pending.pop()
        n_nodes, n_bytes = n_nodes + 1, n_bytes + node.n_bytes
        if node.is_leaf:
            assert not node.children and not node.cones, "a leaf has children"
            assert np.isin(np.unique(tree.facets[F]), node.rows).all(), "a leaf misses a corner"
            assert len(node.rows) <= tree.limits.leaf, "a leaf has too many corners"
            continue
        assert np.array_equal(node.facets, F), "a child is not what is outside its shell cone"
        pending.extend(_children(tree, node, F, whole))
    assert n_nodes == tree.n_nodes, "nodes were not counted"
    held = 0 if tree.root.n_facets == 0 else tree.facets.nbytes
    assert n_bytes + held <= tree.n_bytes <= n_bytes + tree.facets.nbytes, "bytes were not counted"
    return n_nodes


def _children(tree: FacetTree, node: Node, F: np.ndarray, whole: bool) -> list[tuple[Node, np.ndarray]]:
    """The existing children of a node, each with its expected set of simplices."""
    everything = np.unique(np.concatenate([np.arange(0), *(cones.ravel() for cones in node.cones.values())]))
    rows = np.unique(tree.facets[F])
    corners, planes = whole_numbers(tree.points[rows]), node.hull.planes
    net = whole_numbers(tree.points[node.rows])
    for plane in planes:
        assert not _is_beyond(net, plane).any(), "a point of a net is outside the net's hull"
    used = np.unique(node.hull.facets)
    assert np.array_equal(used, np.arange(len(node.rows))), "a net has points that are no corners of its hull"
    beyond = {int(row): _is_beyond(corners, planes[row]) for row in everything}
    local = np.searchsorted(rows, tree.facets[F])
    if whole:
        keys = {(vertex, cone) for vertex in np.unique(node.hull.facets).tolist()
                for cone in range(len(node.cones[vertex]))}
        assert keys == set(node.children), "a shell cone was not looked at"
    children: list[tuple[Node, np.ndarray]] = []
    for (vertex, cone), child in node.children.items():
        is_out = np.zeros(len(rows), dtype=bool)
        for row in node.cones[vertex][cone].tolist():
            is_out |= beyond[row]
        wanted = F[is_out[local].any(axis=1)]
        assert len(wanted) == (0 if child is None else child.n_facets), "a child is not what is outside its shell cone"
        assert len(wanted) <= tree.limits.epsilon * len(F), "a child has more than ε of its parent"
        if child is not None:
            assert child.depth == node.depth + 1, "a depth is wrong"
            if child.is_leaf:
                assert np.array_equal(np.unique(tree.facets[wanted]), child.rows), "a leaf is not what is outside"
            children.append((child, wanted))
    return children


def _is_beyond(points: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """a·x > b, (n,) bool, for points of Python's integers and a plane of doubles, in integers."""
    mantissas, exponents = np.frexp(plane)
    lowest = int(exponents[mantissas != 0.0].min())
    whole = [int(m) << (e - lowest) if m else 0 for m, e in zip(np.ldexp(mantissas, 53).tolist(), exponents.tolist())]
    return (points @ np.array(whole[:-1], dtype=object) > whole[-1]).astype(bool)
