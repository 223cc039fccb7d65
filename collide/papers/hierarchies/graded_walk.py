"""The walk of theorem 3.6 over two hierarchies of boxes, counted: what the bound is about, on the paper's own tree.

J. Erickson, "Local polyhedra and geometric graphs" (2005), section 3.2: two boxes that meet are replaced by one of them
and the children of the other, the larger; what is left in the end are pairs of facets. The paper's volumes are the
bounding cubes of a graded box-tree; `tight` puts the boxes of the facet sets in their place, as it recommends.
Queries walk another tree with the same loop (`boxes_of_queries`). Poses may turn, move and scale.

For counts only: breadth first in numpy, boxes parted along the six axes of their frames, in doubles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.mesh.bvh import MeshTree, leaf_runs
from collide.papers.hierarchies.graded_tree import CELL, LEVEL, PARENT, GradedTree

#: What doubles round of a box's place, of the terms.
_ROUNDING = 2.0**-44
#: Pairs of boxes compared at once.
_BLOCK = 1 << 20


class BoxHierarchy(NamedTuple):
    """Boxes under boxes, over the facets of a mesh; the root is box 0, facets come last, in the order of the mesh.

    centres, half_lengths : (n, 3) [m], in the frame of the mesh.
    first, children : of box k the children are ``children[first[k] : first[k + 1]]``; a facet has none.
    """

    centres: np.ndarray
    half_lengths: np.ndarray
    first: np.ndarray
    children: np.ndarray


class WalkCounts(NamedTuple):
    """compared : pairs of boxes (a facet is its box).   meeting : pairs of meeting boxes, the walk's calls.
    facet_pairs : meeting pairs of facets: the pairs to be tested.
    """

    compared: int
    meeting: int
    facet_pairs: int


def boxes_of_graded(tree: GradedTree, vertices: np.ndarray, faces: np.ndarray, tight: bool = False) -> BoxHierarchy:
    """The graded box-tree over facets (m, 3) of vertices (n, 3): bounding cubes, and facets by their boxes.

    tight : the boxes around facet sets in place of the cubes. O(m·depth).
    """
    n = len(tree.nodes)
    width = tree.width * 0.5 ** tree.nodes[:, LEVEL].astype(float)
    centres = tree.low + (tree.nodes[:, CELL : CELL + 3] + 0.5) * width[:, None]
    half_lengths = np.repeat(width[:, None], 3, axis=1)
    parents = np.concatenate([tree.nodes[1:, PARENT], tree.owner])
    return _with_facets(centres, half_lengths, parents, vertices[faces], n, tight)


def boxes_of_queries(tree: MeshTree, vertices: np.ndarray, faces: np.ndarray) -> BoxHierarchy:
    """The tree that queries walk, its slots as boxes; facets of a leaf are children of its box."""
    nodes, slots = np.nonzero(tree.used())
    number = np.full(tree.used().shape, -1)
    number[nodes, slots] = np.arange(len(nodes))
    centres, half_lengths = (rows[nodes, slots] * 2.0**tree.exponent for rows in tree.boxes())
    links = tree.links()[nodes, slots]
    above = np.full(len(tree.nodes), -1)
    above[links[links >= 0]] = np.flatnonzero(links >= 0)
    owner = np.empty(len(tree.ids), dtype=np.int64)
    leaves = np.flatnonzero(links < 0)
    run, count = leaf_runs(links[leaves])
    owner[tree.ids[np.repeat(run - (np.cumsum(count) - count), count) + np.arange(len(tree.ids))]] = np.repeat(
        leaves, count
    )
    parents = np.concatenate([above[nodes[1:]], owner])
    return _with_facets(tree.centre + centres, half_lengths, parents, vertices[faces], len(nodes), False)


def _with_facets(centres, half_lengths, parents, corners, n: int, tight: bool) -> BoxHierarchy:
    """parents : of all boxes but the first, facets behind the n others."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    if tight:
        low = np.concatenate([np.full((n, 3), np.inf), low])
        high = np.concatenate([np.full((n, 3), -np.inf), high])
        np.minimum.at(low, parents[n - 1 :], low[n:])
        np.maximum.at(high, parents[n - 1 :], high[n:])
        for k in range(n - 1, 0, -1):
            low[parents[k - 1]] = np.minimum(low[parents[k - 1]], low[k])
            high[parents[k - 1]] = np.maximum(high[parents[k - 1]], high[k])
        all_centres, all_half_lengths = 0.5 * (low + high), 0.5 * (high - low)
    else:
        all_centres = np.concatenate([centres, 0.5 * (low + high)])
        all_half_lengths = np.concatenate([half_lengths, 0.5 * (high - low)])
    order = np.argsort(parents, kind="stable")
    counts = np.bincount(parents, minlength=len(all_centres))
    return BoxHierarchy(all_centres, all_half_lengths, np.append(0, np.cumsum(counts)), order + 1)


def count_walk(A: BoxHierarchy, B: BoxHierarchy, X_AB: np.ndarray | None = None) -> WalkCounts:
    """Pairs visited by the walk to find all pairs of facets of A and of B with meeting boxes.

    X_AB : (4, 4) takes points of B's frame to A's; the map may turn, move and scale. ``None`` is the identity.
    """
    X_AB = np.eye(4) if X_AB is None else np.asarray(X_AB, dtype=float)
    scale = np.abs(np.linalg.det(X_AB[:3, :3])) ** (1 / 3)
    size_a = A.half_lengths.max(axis=1)
    size_b = scale * B.half_lengths.max(axis=1)
    waiting = [np.zeros((1, 2), dtype=np.int64)]
    compared = meeting = facet_pairs = 0
    while waiting:
        pairs = waiting.pop()
        if len(pairs) > _BLOCK:
            waiting += [pairs[: len(pairs) // 2], pairs[len(pairs) // 2 :]]
            continue
        compared += len(pairs)
        pairs = pairs[_boxes_meet(A, B, pairs, X_AB)]
        meeting += len(pairs)
        n_a, n_b = (np.diff(of.first)[pairs[:, k]] for k, of in enumerate((A, B)))
        facet_pairs += int(((n_a == 0) & (n_b == 0)).sum())
        opens_b = (n_b > 0) & ((n_a == 0) | (size_b[pairs[:, 1]] > size_a[pairs[:, 0]]))
        opens_a = (n_a > 0) & ~opens_b
        waiting += [
            more for more in (_opened(A, pairs[opens_a], 0), _opened(B, pairs[opens_b], 1)) if len(more)
        ]
    return WalkCounts(compared, meeting, facet_pairs)


def _opened(of: BoxHierarchy, pairs: np.ndarray, side: int) -> np.ndarray:
    """Pairs with the children of one side in its place."""
    begin = of.first[pairs[:, side]]
    counts = of.first[pairs[:, side] + 1] - begin
    more = np.repeat(pairs, counts, axis=0)
    more[:, side] = of.children[np.repeat(begin - (np.cumsum(counts) - counts), counts) + np.arange(len(more))]
    return more


def _boxes_meet(A: BoxHierarchy, B: BoxHierarchy, pairs: np.ndarray, X_AB: np.ndarray) -> np.ndarray:
    """Which pairs no axis of either frame parts."""
    R, t = X_AB[:3, :3], X_AB[:3, 3]
    S = np.linalg.inv(R)
    (ca, ha), (cb, hb) = ((of.centres[pairs[:, k]], of.half_lengths[pairs[:, k]]) for k, of in enumerate((A, B)))
    across = cb @ R.T + t - ca
    slack = _ROUNDING * (np.abs(cb) @ np.abs(R).T + np.abs(t) + np.abs(ca) + ha)
    meet = (np.abs(across) <= ha + hb @ np.abs(R).T + slack).all(axis=1)
    return meet & (np.abs(across @ S.T) <= hb + (ha + slack) @ np.abs(S).T + _ROUNDING * hb).all(axis=1)
