"""Sizes, depths and outliers of the two trees over a mesh: the queries' box-tree and Erickson's graded one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.papers.hierarchies.graded_tree import graded_tree
from collide.shapes.mesh import Mesh


class TreeFigures(NamedTuple):
    """Figures of both trees over a mesh of F facets.

    facets : F.
    nodes, depth, leaves : of the box-tree of the queries: nodes of eight boxes, nodes on the longest path, runs of
        facets.
    graded_size : nodes of Erickson's graded box-tree, leaves included, paths compressed; at most 2F − 1 (2 for F = 1).
    graded_depth : edges on its longest path from root to leaf.
    graded_level : the finest level of an inner node in the octree.
    level_bound : ⌈log2(W/ℓ)⌉ + 3, W the root's width and ℓ the shortest edge of any length: no level is finer.
    outliers : facets in no child of their node.
    max_outliers : the largest number of outliers of a node; the degree of a node is at most 8 more.
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
    max_outliers: int

    @property
    def outlier_share(self) -> float:
        """Outliers over facets."""
        return self.outliers / self.facets

    @property
    def node_bound(self) -> int:
        """2F − 1: no compressed tree over F leaves has more nodes; one facet hangs from a root all the same."""
        return max(2 * self.facets - 1, 2)


def tree_figures(mesh: Mesh) -> TreeFigures:
    """Figures of both trees over a mesh of m facets.

    The graded tree is built for this alone and not kept: O(m log m), 1.2 s for a million facets.
    """
    tree, graded = mesh.tree, graded_tree(mesh.vertices, mesh.faces)
    outliers = np.bincount(graded.owner[graded.outlier], minlength=1)
    return TreeFigures(
        facets=len(tree.ids),
        nodes=len(tree.nodes),
        depth=tree.depth,
        leaves=int((tree.used() & (tree.links() < 0)).sum()),
        graded_size=graded.size(),
        graded_depth=graded.depth(),
        graded_level=graded.deepest_level(),
        level_bound=int(graded.levels),
        outliers=int(graded.outlier.sum()),
        max_outliers=int(outliers.max()),
    )
