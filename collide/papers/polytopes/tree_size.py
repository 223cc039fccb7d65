"""Prediction of a hierarchical tree's size from a model to scale, before its boundary or a node is found.

The model is the tree of a sample of the points, with leaves smaller in the same proportion, so the model has as many
nets, cones and levels. Its boundary, and the boundary of half of the sample, give the growth of simplices with points;
some of its cones are drawn, each for all (Knuth 1975, "Estimating the efficiency of backtrack programs").
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.papers.polytopes.boundary_hull import boundary_hull
from collide.papers.polytopes.facet_tree import FLAT, FacetTree, Node, Sizes, sizes

#: The most simplices of a model's boundary, in the plane and in space, and above.
_MODEL = {2: 200_000, 3: 60_000}
_LARGE_MODEL = 30_000
#: The least points, and the least corners of a leaf of the model.
_SMALLEST, _SMALLEST_LEAF = 60, 12
#: Cones drawn of the root; a level below an eighth, at least one.
_CONES = 64


class TreeSize(NamedTuple):
    """Size of a whole tree.

    simplices : of the boundary (0 for a root that is a leaf).
    nodes, depth : nodes, and levels of them.
    n_bytes : of boundary and nodes.
    """

    simplices: int
    nodes: int
    depth: int
    n_bytes: int


def size_of(tree: FacetTree) -> TreeSize:
    """Of what was made of a tree so far."""
    nodes = tree.root.nodes()
    return TreeSize(tree.root.n_facets, len(nodes), max(node.depth for node in nodes), tree.n_bytes)


def max_simplices(n: int, d: int) -> int:
    """Facets of the cyclic polytope, which has the most (McMullen 1970, the upper bound theorem)."""
    k = d // 2
    if d % 2 == 0:
        return n * math.comb(n - k, k) // (n - k) if n > d else d + 1
    return 2 * math.comb(n - k - 1, k)


class _Growth(NamedTuple):
    """sample : rows.   simplices, corners : of its boundary.   factors : of both, from the sample to all points."""

    sample: np.ndarray
    simplices: int
    corners: int
    factors: tuple[float, float]


def growth_of(points: np.ndarray, limit: int) -> _Growth:
    """How the boundary grows, from samples that are doubled as long as they have at most ``limit`` simplices."""
    n, d = points.shape
    order = np.random.default_rng(n).permutation(n)
    count, before = min(n, _SMALLEST), (0, 0)
    while True:
        sample = order[:count]
        hull = boundary_hull(points[sample], with_planes=False)
        if hull is None and count == n:
            raise UnsupportedQuery(FLAT)
        numbers = (len(hull.facets), len(np.unique(hull.facets))) if hull is not None else (0, 0)
        rates = [math.log2(now / old) if old else 1.0 for now, old in zip(numbers, before)]
        if count == n or (hull is not None and before[0] and numbers[0] * 2.0 ** rates[0] > limit):
            break
        before, count = numbers, min(n, 2 * count)
    if count == n:
        return _Growth(sample, *numbers, (1.0, 1.0))
    scale = n / count
    simplices = min(numbers[0] * scale ** rates[0], max_simplices(n, d))
    corners = min(numbers[1] * scale ** rates[1], n)
    return _Growth(sample, *numbers, (simplices / numbers[0], corners / numbers[1]))


def predicted_simplices(points: np.ndarray) -> int:
    """Simplices that cover the boundary of the hull of integral points (n, d), from samples of them."""
    growth = growth_of(points, _MODEL.get(points.shape[1], _LARGE_MODEL))
    return round(growth.simplices * growth.factors[0])


def predicted_size(points: np.ndarray, limits: Sizes | None = None) -> TreeSize:
    """The size of the whole tree over integral points (n, d). Bytes came out within a factor of 3 of it so far."""
    n, d = points.shape
    limits = limits or sizes(d)
    if n <= limits.leaf:
        return size_of(FacetTree(points, 1 << 62, limits))
    growth = growth_of(points, _MODEL.get(d, _LARGE_MODEL))
    facet_scale, corner_scale = growth.factors
    leaf = max(round(limits.leaf / corner_scale), _SMALLEST_LEAF)
    model = FacetTree(points[growth.sample], 1 << 62, Sizes(limits.epsilon, limits.net, leaf))
    total = _Probe(model, facet_scale, corner_scale, np.random.default_rng(n)).total(model.root, _CONES)
    simplices = round(growth.simplices * facet_scale)
    return TreeSize(simplices, round(total.nodes), total.depth, round(total.n_bytes + 4.0 * d * simplices))


class _Probe:
    """Drawn cones of a model, each with the weight of the cones represented."""

    def __init__(self, tree: FacetTree, facet_scale: float, corner_scale: float, rng: np.random.Generator):
        self.tree, self.facet_scale, self.corner_scale, self.rng = tree, facet_scale, corner_scale, rng

    def total(self, node: Node, n_cones: int) -> _Total:
        """What a node and all below it would take."""
        if node.is_leaf:
            return _Total(node.n_bytes + (self.corner_scale - 1.0) * node.rows.nbytes, 1.0, node.depth)
        while True:
            below = self._below(node, n_cones)
            if below is not None:
                n_bytes = node.n_bytes + (self.facet_scale - 1.0) * node.facets.nbytes
                cones = sum(c.nbytes for c in node.cones.values())
                scale = len(np.unique(node.hull.facets)) / max(len(node.cones), 1)
                n_bytes += cones * (scale - 1.0)
                return _Total(n_bytes + below.n_bytes, 1.0 + below.nodes, max(node.depth, below.depth))

    def _below(self, node: Node, n_cones: int) -> _Total | None:
        vertices = np.unique(node.hull.facets)
        n_bytes = nodes = 0.0
        depth = node.depth
        for vertex in self.rng.choice(vertices, n_cones).tolist():
            cones = self.tree.cones(node, vertex)
            if not len(cones):
                continue
            n_draws = node.n_draws
            child = self.tree.child(node, vertex, int(self.rng.integers(len(cones))))
            if node.n_draws > n_draws:
                return None
            if child is not None:
                weight = len(vertices) * len(cones) / n_cones
                below = self.total(child, max(n_cones // 8, 1))
                n_bytes, nodes = n_bytes + weight * below.n_bytes, nodes + weight * below.nodes
                depth = max(depth, below.depth)
        return _Total(n_bytes, nodes, depth)


class _Total(NamedTuple):
    n_bytes: float
    nodes: float
    depth: int
