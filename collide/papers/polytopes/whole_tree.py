"""A hierarchical tree with all its nodes: every shell cone of every net."""

from __future__ import annotations

import numpy as np

from collide.papers.polytopes.facet_tree import FacetTree, Node


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
    """Make all children of a node; returns whether its sample is a net: each child at most ε of the node."""
    rows, corners = np.unique(tree.facets[node.facets], return_inverse=True)
    corners = corners.reshape(node.n_facets, -1)
    beyond = _beyond_planes(tree, node, tree.points[rows], corners)
    has_facet, has_corner = np.zeros(node.n_facets, dtype=bool), np.zeros(len(rows), dtype=bool)
    max_outside = tree.limits.epsilon * node.n_facets
    for vertex in np.unique(node.hull.facets).tolist():
        for cone, planes in enumerate(tree.cones(node, vertex).tolist()):
            outside = _members(np.concatenate([beyond[plane] for plane in planes]), has_facet)
            if len(outside) > max_outside:
                return False
            if (vertex, cone) not in node.children:  # else made by an earlier query
                at = _members(corners[outside].ravel(), has_corner)
                node.children[vertex, cone] = (
                    tree.make_node(node.facets[outside], node.depth + 1, rows[at]) if len(outside) else None
                )
    return True


def _beyond_planes(tree: FacetTree, node: Node, points: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """For each plane of the net's hull the places in F of simplices with a corner outside it."""
    order = np.argsort(corners, axis=None, kind="stable") // corners.shape[1]  # simplices at each point
    ends = np.cumsum(np.bincount(corners.ravel(), minlength=len(points)))
    starts = np.concatenate((ends[:1] * 0, ends[:-1]))
    has_facet = np.zeros(node.n_facets, dtype=bool)
    beyond = []
    for plane in node.hull.planes:
        at = np.flatnonzero(tree.beyond(points, plane[None])[0])
        lists = [order[start:end] for start, end in zip(starts[at].tolist(), ends[at].tolist())]
        beyond.append(_members(np.concatenate((order[:0], *lists)), has_facet).astype(np.int32))
    return beyond


def _members(numbers: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """The different ones of some numbers, ascending; by marks, all False before and after, where they are many."""
    if 16 * len(numbers) < len(marks):
        return np.unique(numbers)
    marks[numbers] = True
    members = np.flatnonzero(marks)
    marks[members] = False
    return members
