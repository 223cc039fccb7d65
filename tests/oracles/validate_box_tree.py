"""Checks of every property of a tree of bodies' boxes that walks, updates and promises rely on. Naive."""

from __future__ import annotations

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.broadphase.graded_boxes import BODY, LINK, MAX_CHILDREN, MAX_DEPTH, PARENT, SKIP


def children_of(links: np.ndarray, node: int) -> list[int]:
    children, child = [], node + 1
    while child < links[node, SKIP]:
        children.append(child)
        child = int(links[child, SKIP])
    return children


def depths_of(tree: BoxTree) -> np.ndarray:
    """(m,) edges from the root of its tree to each node."""
    links, depth = tree.links[: tree.n_nodes], np.zeros(tree.n_nodes, dtype=np.int64)
    for node in range(tree.n_nodes):
        if links[node, PARENT] >= 0:
            depth[node] = depth[links[node, PARENT]] + 1
    return depth


def validate_box_tree(tree: BoxTree, removed: int = 0) -> None:
    """Raises AssertionError naming the node.   removed : how many bodies were taken out."""
    n, links = tree.n_nodes, tree.links[: tree.n_nodes]
    assert links.shape == (n, LINK) and tree.sections[0] == 0 and tree.sections == sorted(set(tree.sections))
    placed = sorted([*tree.order.tolist(), *tree.unbounded.tolist()])
    assert len(placed) == len(set(placed)) == len(tree.boxes) - removed, "a body is missing or doubled"
    roots = set(tree.sections[:-1])
    n_holes = 0
    for node in range(n):
        skip, body, parent = links[node].tolist()
        assert node < skip <= n, f"node {node} skips to {skip}"
        assert (parent < 0) == (node in roots), f"node {node} has the parent {parent}"
        assert parent < 0 or (parent < node and skip <= links[parent, SKIP]), f"node {node} is not within {parent}"
        low, high = tree.nodes[node, :3], tree.nodes[node, 3:]
        if skip == node + 1:
            if body < 0:
                n_holes += 1
                assert (low > high).all(), f"leaf {node} has a box and no body"
                continue
            assert tree.leaf_of[body] == node, f"body {body} is not told its leaf {node}"
            assert (low <= tree.boxes[body, :3]).all() and (high >= tree.boxes[body, 3:]).all(), (
                f"leaf {node} does not hold body {body}'s box"
            )
        else:
            assert body == -1, f"inner node {node} has a body"
            children = children_of(links, node)
            assert 2 <= len(children) <= MAX_CHILDREN, f"node {node} has {len(children)} children"
            assert all(links[child, PARENT] == node for child in children), f"node {node} has children of others"
            boxes = tree.nodes[children]
            assert (low == boxes[:, :3].min(axis=0)).all() and (high == boxes[:, 3:].max(axis=0)).all(), (
                f"node {node} is not the box around its children"
            )
    assert n <= 2 * (len(tree.order) + n_holes), f"{n} nodes of {len(tree.order)} bodies"
    assert n == 0 or depths_of(tree).max() <= MAX_DEPTH
    assert 2 * n_holes <= n // 2 + 64 + 1, f"{n_holes} holes of {n} nodes"
    fixed = [int(body) for body in links[: tree.n_fixed, BODY] if body >= 0]
    assert tree._fixed[fixed].all(), "a body that moves is in the tree of those that stay"


def growth_of(tree: BoxTree) -> float:
    """All sides of the tree's nodes beside those of one made anew: its quality."""

    def sides(some: BoxTree) -> float:
        used = some.links[: some.n_nodes]
        inner = some.nodes[: some.n_nodes][used[:, SKIP] > np.arange(some.n_nodes) + 1]
        return float(np.maximum(inner[:, 3:] - inner[:, :3], 0.0).sum())

    alive = tree._alive
    return sides(tree) / max(sides(BoxTree(tree.boxes[alive], tree._fixed[alive])), 1e-300)
