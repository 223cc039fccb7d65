"""Boxes relative to their nodes, for meshes whose details are small beside the whole.

Floats relative to a mesh's middle tell places 2⁻²⁴ of its width apart, and queries enlarge boxes by some 2⁻¹⁸ of the
width. Ordinary meshes lose nothing: a million facets around a body are still 2⁻¹⁰ of its width wide. The loss counts
where strings of a worst case lie side by side, or where a whole plant is a single mesh. The boxes of such trees are
computed anew, from the facets' doubles, relative to an origin of their node near its middle.

Then the excess of a box does not depend on the size of the mesh: with the box c ± h of a node and v = 2⁻²⁴ the
half length stored is at least h + 16 v (h + |c|), which covers the rounding of comparisons in floats
(`narrowphase/facets/fine_probes.py`).
"""

from __future__ import annotations

import math

import numpy as np

from collide.mesh.bvh import ORIGIN_STEP, WIDTH, MeshTree, leaf_runs

#: What queries enlarge boxes by, of the unit, where a tree has no origins.
_ENLARGED = 2.0**-18
#: A tree gets origins where more than this share of the pairs of leaves that stand in one node, and meet so enlarged,
#: do not meet as they are; none of the meshes at hand has more than a thousandth.
_MAX_FALSE_PAIRS = 2.0**-4
#: Or where more than this share of the leaves is less than so many units wide: enlarging is over a hundredth of that.
_MAX_SMALL, _SMALL = 2.0**-3, 2.0**-12
#: Nodes that are judged, about; and of a tree that is judged at all.
_SAMPLE, _MIN_NODES = 256, 64
#: Added to half lengths: for the floats of a comparison, for doubles, and for what the lowest byte takes away.
_FLOATS, _DOUBLES, _BYTE = 2.0**-20, 2.0**-50, 2.0**-14


def with_origins_if_needed(tree: MeshTree) -> MeshTree:
    """The tree, or, where floats from the mesh's middle are too coarse, a tree with the same nodes and finer boxes.

    Judged by a sample of its nodes; trees of a few hundred facets have little to visit, and stay as they are.
    """
    step = max(1, len(tree.nodes) // _SAMPLE)
    return with_origins(tree) if len(tree.nodes) >= _MIN_NODES and _is_too_coarse(tree, slice(1, None, step)) else tree


def with_origins(tree: MeshTree) -> MeshTree:
    """A tree of the same facets, nodes and links, whose boxes are relative to an origin of their node. O(m + depth)."""
    low, high = _leaf_boxes(tree)
    links, used = tree.links(), tree.used()
    low_of, high_of = np.full((len(links), 3), np.inf), np.full((len(links), 3), -np.inf)
    for nodes in _levels(links, used)[::-1]:
        inner = used[nodes] & (links[nodes] >= 0)
        below = links[nodes][inner]
        rows = np.broadcast_to(nodes[:, None], inner.shape)[inner], np.nonzero(inner)[1]
        low[rows], high[rows] = low_of[below], high_of[below]
        low_of[nodes], high_of[nodes] = low[nodes].min(axis=1), high[nodes].max(axis=1)
    numbers = np.rint(0.5 * (low_of + high_of) / ORIGIN_STEP).astype(np.int32)
    numbers[0] = 0  # of the whole mesh
    origins = numbers[:, None] * ORIGIN_STEP
    low, high = np.where(used[..., None], low - origins, 0.0), np.where(used[..., None], high - origins, 0.0)
    centres = (0.5 * (low + high)).astype(np.float32)
    half_lengths = np.maximum(high - centres, centres - low)
    half_lengths = (half_lengths + (half_lengths + np.abs(centres)) * _FLOATS + _DOUBLES) * (1.0 + _BYTE)
    nodes = tree.nodes.copy()
    floats = nodes[:, : 6 * WIDTH].view(np.float32).reshape(-1, 2, 3, WIDTH)
    floats[:, 0] = centres.transpose(0, 2, 1)
    floats[:, 1] = np.where(used[:, None], half_lengths.transpose(0, 2, 1), floats[:, 1])
    words = nodes[:, 3 * WIDTH : 6 * WIDTH].reshape(-1, 3, WIDTH)[:, :, :4]
    words[:] = (words & ~0xFF) | numbers.astype("<i4").view(np.uint8).reshape(-1, 3, 4)
    nodes[:, 3 * WIDTH : 6 * WIDTH].reshape(-1, 3, WIDTH)[:, :, :4] = words
    return MeshTree(nodes, tree.triangles, tree.ids, tree.centre, tree.exponent, tree.depth, True, False)


def _leaf_boxes(tree: MeshTree, nodes=slice(None)) -> tuple[np.ndarray, np.ndarray]:
    """(low, high), (k, 8, 3) each, in the tree's units from its centre: around the leaves of nodes; others hold inf."""
    links, used = tree.links()[nodes], tree.used(nodes)
    is_leaf = used & (links < 0)
    first, count = leaf_runs(links[is_leaf])
    low, high = np.full((*links.shape, 3), np.inf), np.full((*links.shape, 3), -np.inf)
    low_of, high_of = np.full((len(first), 3), np.inf), np.full((len(first), 3), -np.inf)
    for k in range(count.max(initial=0)):
        leaves = np.flatnonzero(count > k)
        corners = tree.triangles[first[leaves] + k].reshape(-1, 3, 3)
        low_of[leaves] = np.minimum(low_of[leaves], corners.min(axis=1))
        high_of[leaves] = np.maximum(high_of[leaves], corners.max(axis=1))
    unit = math.ldexp(1.0, -tree.exponent)
    low[is_leaf], high[is_leaf] = (low_of - tree.centre) * unit, (high_of - tree.centre) * unit
    return low, high


def _levels(links: np.ndarray, used: np.ndarray) -> list[np.ndarray]:
    """Nodes by depth, the root first."""
    levels = [np.zeros(1, dtype=np.int64)]
    while len(levels[-1]):
        below = links[levels[-1]]
        levels.append(below[used[levels[-1]] & (below >= 0)].astype(np.int64))
    return levels[:-1]


def _is_too_coarse(tree: MeshTree, nodes) -> bool:
    low, high = _leaf_boxes(tree, nodes)
    is_leaf = np.isfinite(low[..., 0])
    if not is_leaf.any():
        return False
    if ((high - low)[is_leaf].max(axis=1) < _SMALL).mean() > _MAX_SMALL:
        return True
    i, j = np.triu_indices(WIDTH, 1)
    with np.errstate(invalid="ignore"):
        gaps = np.maximum(low[:, i] - high[:, j], low[:, j] - high[:, i]).max(axis=2)[is_leaf[:, i] & is_leaf[:, j]]
    enlarged, meeting = np.count_nonzero(gaps <= _ENLARGED), np.count_nonzero(gaps <= 0.0)
    return enlarged - meeting > _MAX_FALSE_PAIRS * enlarged
