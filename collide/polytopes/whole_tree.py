"""A hierarchical tree with all its nodes: every shell cone of every net."""

from __future__ import annotations

import numpy as np

from collide.polytopes.facet_tree import FacetTree, Node


def build_whole(tree: FacetTree) -> None:
    """Make all nodes of a tree, from the root down. Raises UnsupportedQuery where they would take too much memory."""
    pending = [tree.root]
    while pending:
        node = pending.pop()
        if not node.is_leaf:
            while not _make_children(tree, node):
                tree.redraw(node)
            pending.extend(child for child in node.children.values() if child is not None and not child.is_leaf)


def _make_children(tree: FacetTree, node: Node) -> bool:
    """All children of a node; whether its sample is a net, so that none has more than ε of it."""
    corners = tree.facets[node.facets]
    marks = np.zeros(len(tree.points), dtype=bool)
    marks[corners] = True
    rows = np.flatnonzero(marks).astype(np.int32)
    places = np.zeros(len(tree.points), dtype=np.int32)
    places[rows] = np.arange(len(rows))
    corners, points = places[corners], tree.points[rows]
    beyond = [  # for each plane of the net's hull the simplices of F with a corner outside it
        np.flatnonzero(tree.beyond(points, plane[None])[0][corners].any(axis=1)) for plane in node.hull.planes
    ]
    has_facet, has_corner = np.zeros(node.n_facets, dtype=bool), np.zeros(len(rows), dtype=bool)
    most = tree.limits.epsilon * node.n_facets
    for vertex in np.unique(node.hull.facets).tolist():
        for cone, planes in enumerate(tree.cones(node, vertex).tolist()):
            for plane in planes:
                has_facet[beyond[plane]] = True
            outside = np.flatnonzero(has_facet)
            has_facet[outside] = False
            if len(outside) > most:
                return False
            if (vertex, cone) in node.children:  # made by an earlier query
                continue
            has_corner[corners[outside]] = True
            at = np.flatnonzero(has_corner)
            has_corner[at] = False
            node.children[vertex, cone] = (
                tree.make_node(node.facets[outside], node.depth + 1, rows[at]) if len(outside) else None
            )
    return True
