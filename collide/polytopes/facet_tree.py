"""The hierarchical tree of a polytope (Barba and Langerman 2015, section 6): nets, shell cones, what lies outside them.

A node stands for a set F of the simplices that cover the boundary. Its net is a sample of F with a first simplex of
the polytope; for each shell cone σ of the net's hull the child holds F_σ̄, the simplices of F with a corner outside σ.
A net is kept only as long as |F_σ̄| ≤ ε|F| for every cone that was looked at; else twice as many are drawn.

Simplices of the boundary, not faces of every dimension: a face is in a simplex, and one that leaves σ leaves it with
a corner. Sets are exact: planes are doubles, points integers, and what doubles leave open is decided in integers.
"""

from __future__ import annotations

import zlib
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.least_distance.homogeneous_rows import as_integers
from collide.polytopes.boundary_hull import Boundary, boundary_hull, first_simplex
from collide.polytopes.shell_cones import Cones, cones_at

_UNIT = 2.0**-53
#: Samples drawn for one node before it gives up.
_MAX_DRAWS = 12


class Sizes(NamedTuple):
    """ε; the simplices of a net; the most simplices of a leaf."""

    epsilon: float
    net: int
    leaf: int


#: By dimension, sampled by benchmarks/hierarchical_trees.py --sizes.
SIZES = {2: Sizes(0.5, 12, 24), 3: Sizes(0.5, 24, 48), 4: Sizes(0.5, 24, 96), 5: Sizes(0.5, 24, 160)}


def sizes(d: int) -> Sizes:
    """ε, net and leaf for a dimension."""
    return SIZES.get(d, Sizes(0.5, 24, 240))


class Node:
    """A set of boundary simplices with the hull of its net.

    Attributes
    ----------
    facets : (k,) int32
        Rows of the tree's simplices: F.
    net : (m,) int64
        Rows of the tree's points.
    hull : Boundary
        Of the net, in rows of ``net``; offsets raised so that no point of the net is outside.
    is_leaf : bool
        Whether the net holds all corners of F.
    children : dict
        (vertex, cone) → Node, or None where F_σ̄ is empty.
    depth, n_draws : int
    """

    __slots__ = ("children", "cones", "corners", "depth", "facets", "hull", "is_leaf", "n_draws", "net")

    def __init__(self, facets: np.ndarray, depth: int):
        self.facets, self.depth, self.n_draws = facets, depth, 0
        self.net = np.empty(0, dtype=np.int64)
        self.corners = np.empty((0, 0))
        self.hull = Boundary(np.empty((0, 0), dtype=np.int64), np.empty((0, 0)))
        self.is_leaf = False
        self.cones: dict[int, Cones] = {}
        self.children: dict[tuple[int, int], Node | None] = {}

    @property
    def n_bytes(self) -> int:
        """What the node keeps, without its children: net, hull, cones, and of a leaf its simplices."""
        n_held = self.net.nbytes + self.corners.nbytes + self.hull.facets.nbytes + self.hull.planes.nbytes
        return n_held + sum(c.facets.nbytes + c.inverses.nbytes for c in self.cones.values())


class FacetTree:
    """The tree over the boundary of a hull; nodes are made when they are first asked for.

    Parameters
    ----------
    points : (n, d) float64
        Integers of at most `boundary_hull.BITS` bits.
    memory : int
        The most bytes that nodes may take.
    limits : Sizes, optional
        `sizes` of the dimension by default.

    Attributes
    ----------
    points, facets : (n, d), (f, d)
        The points, and the simplices that cover the boundary of their hull.
    first : (d + 1,) rows of points that span R^d; they are in every net.
    reach : float
        max |x| over points and axes.
    root : Node
    n_bytes, n_nodes, n_redrawn : int
        Bytes of all nodes, how many, and samples that were drawn again.
    """

    def __init__(self, points: np.ndarray, memory: int, limits: Sizes | None = None):
        first = first_simplex(points)
        hull = None if first is None else boundary_hull(points, with_planes=False)
        if first is None or hull is None:
            raise UnsupportedQuery("a hierarchical tree needs a body with interior; ask polytopes.meets of flat ones")
        self.points, self.facets = points, hull.facets.astype(np.int32)
        self.first = first
        self.reach = float(np.abs(points).max(initial=1.0))
        self.limits, self.memory = limits or sizes(points.shape[1]), memory
        self.n_bytes, self.n_nodes, self.n_redrawn = 0, 0, 0
        self.root = self.make_node(np.arange(len(hull.facets), dtype=np.int32), 1)

    @property
    def dimension(self) -> int:
        """d."""
        return self.points.shape[1]

    # --- nodes --------------------------------------------------------------------------------------------------------

    def make_node(self, facets: np.ndarray, depth: int) -> Node:
        """A node for a set of simplices, with its net and the hull of it."""
        node = Node(facets, depth)
        self._draw(node, self.limits.net)
        self.n_nodes += 1
        return node

    def _draw(self, node: Node, n_net: int) -> None:
        sampled = node.facets
        if len(sampled) > max(self.limits.leaf, n_net):  # the same set has the same net, whatever was asked before
            rng = np.random.default_rng([n_net, zlib.crc32(sampled.tobytes())])
            sampled = sampled[rng.choice(len(sampled), n_net, replace=False)]
        else:
            node.is_leaf = True
        self.n_bytes -= node.n_bytes
        net = np.unique(np.concatenate((self.facets[sampled].ravel(), self.first)))
        hull = boundary_hull(self.points[net])
        if hull is None:
            raise AssertionError("a net that holds a first simplex is flat")
        planes = hull.planes.copy()
        planes[:, -1] += self._errors(planes)
        node.net, node.corners = net, self.points[net]
        node.hull = Boundary(hull.facets.astype(np.int32), planes)
        node.cones, node.children = {}, {}
        node.n_draws += 1
        self.n_bytes += node.n_bytes
        self._check_memory()

    def redraw(self, node: Node) -> None:
        """A net of twice as many simplices; the children of the old one go."""
        if node.n_draws >= _MAX_DRAWS:
            raise UnsupportedQuery(f"{_MAX_DRAWS} samples of a hierarchical tree were no nets; ask polytopes.meets")
        self.n_redrawn += 1
        self._draw(node, self.limits.net << node.n_draws)

    def _check_memory(self) -> None:
        if self.n_bytes > self.memory:
            raise UnsupportedQuery(
                f"HierarchicalTree: its nodes take {self.n_bytes:,} bytes, more than memory={self.memory:,}; "
                "raise it, or ask polytopes.meets, which needs none"
            )

    def cones(self, node: Node, vertex: int) -> Cones:
        """The shell cones at a vertex of a net's hull, made when first asked for."""
        cones = node.cones.get(vertex)
        if cones is None:
            cones = node.cones[vertex] = cones_at(vertex, node.hull.facets, node.hull.planes)
            self.n_bytes += cones.facets.nbytes + cones.inverses.nbytes
            self._check_memory()
        return cones

    def child(self, node: Node, vertex: int, cone: int) -> Node | None:
        """The child of a shell cone: None where nothing is outside it.

        Where more than ε|F| are, the node is drawn again, and the answer is the node itself.
        """
        key = vertex, cone
        if key not in node.children:
            outside = self.outside(node.facets, node.hull.planes[self.cones(node, vertex).facets[cone]])
            if len(outside) > self.limits.epsilon * len(node.facets):
                self.redraw(node)
                return node
            node.children[key] = self.make_node(outside, node.depth + 1) if len(outside) else None
        return node.children[key]

    # --- exact sets ---------------------------------------------------------------------------------------------------

    def outside(self, facets: np.ndarray, planes: np.ndarray) -> np.ndarray:
        """F_σ̄: those of some simplices that have a corner outside one of some half-spaces (a, b), exactly."""
        corners = self.facets[facets]
        rows = np.unique(corners)
        points = self.points[rows]
        is_outside = np.zeros(len(rows), dtype=bool)
        for plane, error in zip(planes, self._errors(planes)):
            heights = points @ plane[:-1] - plane[-1]
            is_outside |= heights > error
            near = np.flatnonzero((np.abs(heights) <= error) & ~is_outside)
            if len(near):
                is_outside[near] = exactly_outside(points[near], plane)
        if not is_outside.any():
            return facets[:0]
        return facets[is_outside[np.searchsorted(rows, corners)].any(axis=1)]

    def _errors(self, planes: np.ndarray) -> np.ndarray:
        """What heights above planes may be off by in doubles, with the rounding of the planes themselves."""
        d = self.dimension
        return (d + 8) * _UNIT * (np.abs(planes[:, :d]).sum(axis=1) * self.reach + np.abs(planes[:, d]))


def exactly_outside(points: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """Whether a·x > b, in integers, for points of integers."""
    (*a, b), _ = as_integers(plane.tolist())
    return np.array([sum(x * int(y) for x, y in zip(a, point)) > b for point in points.tolist()], dtype=bool)


def apex_height(node: Node, facets: np.ndarray, g: np.ndarray, coefficients: np.ndarray, reach: float) -> float:
    """A bound of g·x over a shell cone's points within reach: Σ λ b of its planes, and what λ leaves of g."""
    planes = node.hull.planes[facets]
    rest = g - coefficients @ planes[:, :-1]
    slack = (np.abs(rest).sum() + 16 * _UNIT * (np.abs(coefficients) @ np.abs(planes[:, :-1])).sum()) * reach
    height = coefficients @ planes[:, -1]
    return float(height + slack + 16 * _UNIT * (np.abs(coefficients) @ np.abs(planes[:, -1])))
