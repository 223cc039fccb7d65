"""What trees over a mesh came out like: sizes, depths and outliers of the one that queries walk and of the paper's."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hierarchies.graded_tree import GradedTree
from collide.mesh.bvh import MeshTree


class TreeFigures(NamedTuple):
    """Figures of both trees over one mesh of F facets.

    facets : F.
    nodes, depth, leaves : of the tree that queries walk: nodes of eight boxes, nodes on the longest way down, runs of facets.
    graded_size : nodes of Erickson's graded box-tree, leaves included, paths compressed; at most 2F − 1 (2 for F = 1).
    graded_depth : edges on its longest way from root to leaf.
    graded_level : the finest level of the octree that an inner node stands on.
    level_bound : ⌈log2(W/ℓ)⌉ + 3, W the root's width and ℓ the shortest edge of any length: no level is finer.
    outliers : facets that belong to no child of their node.
    most_outliers : the most of them at one node, its degree but for 8.
    """

    facets: int
    nodes: int
    depth: int
    leaves: int
    graded_size: int
    graded_depth: int
    graded_level: int
    level_bound: int
    outliers: int
    most_outliers: int

    @property
    def outlier_share(self) -> float:
        """Outliers over facets."""
        return self.outliers / self.facets

    @property
    def node_bound(self) -> int:
        """2F − 1: no compressed tree over F leaves has more nodes; one facet hangs from a root all the same."""
        return max(2 * self.facets - 1, 2)


def tree_figures(tree: MeshTree, graded: GradedTree) -> TreeFigures:
    """Figures of two trees over the same facets. O(nodes)."""
    degrees = np.bincount(graded.owner[graded.outlier], minlength=1)
    leaves = int((tree.used() & (tree.links() < 0)).sum())
    return TreeFigures(
        len(tree.ids), len(tree.nodes), tree.depth, leaves, graded.size(), graded.depth(), graded.deepest_level(),
        int(graded.levels), int(graded.outlier.sum()), int(degrees.max()),
    )  # fmt: skip
