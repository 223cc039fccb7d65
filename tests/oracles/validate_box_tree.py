"""Checks of the properties of a tree of bodies' boxes that its traversal relies on."""

from __future__ import annotations

from collide.broadphase.box_tree import BoxTree


def validate_box_tree(tree: BoxTree) -> None:
    """Check every property the traversal relies on; raises AssertionError naming the node."""
    assert sorted([*tree.order, *tree.unbounded]) == list(range(len(tree.boxes))), "a body is missing or doubled"
    for node in range(1, tree.leaves):
        for child in (2 * node, 2 * node + 1):
            low, high = tree.nodes[child, :3], tree.nodes[child, 3:]
            inside = (tree.nodes[node, :3] <= low).all() and (tree.nodes[node, 3:] >= high).all()
            assert inside or (low > high).all(), f"node {node} does not enclose node {child}"
    for leaf, body in enumerate(tree.order):
        assert (tree.nodes[tree.leaves + leaf] == tree.boxes[body]).all(), f"leaf {leaf} is not body {body}'s box"
