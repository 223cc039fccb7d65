"""Check a tree's nodes: every F_σ̄ again, in integers, and no larger than ε of its parent."""

from __future__ import annotations

import numpy as np

from collide.polytopes.facet_tree import FacetTree, Node, exactly_outside


def validate_facet_tree(tree: FacetTree) -> int:
    """Check all nodes that were made; returns how many. Raises AssertionError with what is wrong.

    Every child is recomputed from its parent without doubles, one half-space of the shell cone after the other; every
    point of a net must be in all half-spaces of the net's hull.
    """
    pending: list[Node] = [tree.root]
    n_nodes = 0
    while pending:
        node = pending.pop()
        n_nodes += 1
        for plane in node.hull.planes:
            assert not exactly_outside(node.corners, plane).any(), "a point of a net is outside the net's hull"
        assert node.is_leaf or node.children is not None
        if node.is_leaf:
            assert np.isin(tree.facets[node.facets], node.net).all(), "a leaf's net misses a corner"
            assert not node.children, "a leaf has children"
        for (vertex, cone), child in node.children.items():
            planes = node.hull.planes[node.cones[vertex].facets[cone]]
            rows = np.unique(tree.facets[node.facets])
            out = np.zeros(len(tree.points), dtype=bool)
            for plane in planes:
                out[rows] |= exactly_outside(tree.points[rows], plane)
            wanted = node.facets[out[tree.facets[node.facets]].any(axis=1)]
            held = wanted[:0] if child is None else child.facets
            assert np.array_equal(wanted, held), "a child is not what is outside its shell cone"
            assert len(held) <= tree.limits.epsilon * len(node.facets), "a child has more than ε of its parent"
            if child is not None:
                assert child.depth == node.depth + 1, "a depth is wrong"
                pending.append(child)
    assert n_nodes <= tree.n_nodes, "nodes were not counted"
    return n_nodes
