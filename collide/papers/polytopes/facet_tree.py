"""The hierarchical tree of a polytope (Barba and Langerman 2015, section 6): nets, shell cones, simplices outside the
cones.

A node holds a set F of the simplices covering the boundary. Its net is a sample of F with a first simplex of
the polytope; for each shell cone σ of the net's hull the child holds F_σ̄, the simplices of F with a corner outside σ.
A net is kept only as long as |F_σ̄| ≤ ε|F| for every visited cone; else a net twice as large is drawn. A leaf
keeps the corners of its simplices alone: CH(F).

Simplices of the boundary, not faces of every dimension: a face is in a simplex, and a simplex not inside σ has
a corner outside. Sets are exact: planes are doubles, points integers, and signs open in doubles are decided in
integers.
"""

from __future__ import annotations

import math
import zlib
from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.least_distance.homogeneous_rows import as_integers
from collide.papers.polytopes.boundary_hull import Boundary, boundary_hull, first_simplex
from collide.papers.polytopes.exact_planes import nearby_planes, rounding_errors, whole_numbers
from collide.papers.polytopes.incremental_hull import BoundaryTooLarge, bytes_a_slot
from collide.papers.polytopes.shell_cones import cones_at

_UNIT = 2.0**-53
#: Why there is no tree of a flat body.
FLAT = "a hierarchical tree needs points or normals of a body with interior; ask polytopes.meets of flat ones"
#: The most samples drawn for a node.
_MAX_DRAWS = 12
#: Simplices of the smallest net; how many a net has, times d − 1, for each leaf that its node's corners would fill.
_SMALLEST_NET, _SIMPLICES_A_LEAF = 12, 6.0
#: What Python takes for a node beside its arrays.
_BYTES_A_NODE = 600


class Sizes(NamedTuple):
    """ε; the most simplices that a net is first drawn with; the most corners of a leaf."""

    epsilon: float
    net: int
    leaf: int


#: By dimension: nets and leaves that numpy looks at in some ten microseconds.
SIZES = {2: Sizes(0.5, 200, 200), 3: Sizes(0.5, 1000, 1000), 4: Sizes(0.5, 200, 2000), 5: Sizes(0.5, 64, 1500)}


def sizes(d: int) -> Sizes:
    """ε, net and leaf for a dimension."""
    return SIZES.get(d, Sizes(0.5, 48, 1500))


_NOTHING = np.empty(0, dtype=np.int32)
_NO_HULL = Boundary(np.empty((0, 0), dtype=np.int32), np.empty((0, 0)))


class Node:
    """A set of boundary simplices with the hull of its net; a leaf has their corners.

    Attributes
    ----------
    n_facets : int
        |F|; 0 for a root without children, whose boundary is not needed.
    facets : (k,) int32
        Rows of the tree's simplices: F. Empty for a leaf.
    rows : (m,) int32
        Rows of the tree's points: of the net, or of a leaf the corners of F.
    hull : Boundary
        Of the net, in places of ``rows``; offsets raised so that no point of the net is outside. Empty for a leaf.
    is_leaf : bool
    cones : dict
        vertex → (c, d) rows of planes: the shell cones asked for.
    children : dict
        (vertex, cone) → Node, or ``None`` for an empty F_σ̄.
    depth, n_draws : int
    """

    __slots__ = ("children", "cones", "depth", "facets", "hull", "is_leaf", "n_draws", "n_facets", "rows")

    def __init__(self, n_facets: int, depth: int, *, facets: np.ndarray = _NOTHING, leaf: np.ndarray | None = None):
        self.n_facets, self.depth, self.n_draws, self.facets, self.hull = n_facets, depth, 0, facets, _NO_HULL
        self.is_leaf, self.rows = leaf is not None, _NOTHING if leaf is None else leaf
        self.cones: dict[int, np.ndarray] = {}
        self.children: dict[tuple[int, int], Node | None] = {}

    @property
    def n_bytes(self) -> int:
        """What the node keeps, without its children."""
        n_held = self.facets.nbytes + self.rows.nbytes + self.hull.facets.nbytes + self.hull.planes.nbytes
        return _BYTES_A_NODE + n_held + sum(cones.nbytes for cones in self.cones.values())

    def nodes(self) -> list[Node]:
        """This node and all nodes made below."""
        everything: list[Node] = [self]
        for node in everything:
            everything.extend(child for child in node.children.values() if child is not None)
        return everything


class FacetTree:
    """The tree over the boundary of a hull; nodes are made at their first visit.

    Parameters
    ----------
    points : (n, d) float64
        Integers of at most `exact_planes.BITS` bits.
    memory : int
        The most bytes of boundary and nodes.
    limits : Sizes, optional
        `sizes` of the dimension by default.

    Attributes
    ----------
    points : (n, d)
    first : (d + 1,) rows of points spanning R^d, in every net.
    centre, inner_radius : (d,), float
        The middle of the first simplex; points at most the radius away along each axis are in the simplex.
    reach : float
        max |x| over points and axes.
    root : Node
    n_bytes, n_nodes, n_redrawn : int
        Bytes of boundary and nodes, number of nodes, and of samples drawn again.
    """

    def __init__(self, points: np.ndarray, memory: int, limits: Sizes | None = None):
        first = first_simplex(points)
        if first is None:
            raise UnsupportedQuery(FLAT)
        self.points, self.first = points, first
        self.centre = points[first].mean(axis=0)
        self.reach = float(np.abs(points).max(initial=1.0))
        self.inner_radius = self._inner_radius()
        self.limits, self.memory = limits or sizes(points.shape[1]), memory
        self.n_bytes, self.n_nodes, self.n_redrawn = 0, 0, 0
        self._facets: np.ndarray | None = None
        if len(points) <= self.limits.leaf:
            self.root = self._count(Node(0, 1, leaf=np.arange(len(points), dtype=np.int32)))
        else:
            self.root = self.make_node(np.arange(len(self.facets), dtype=np.int32), 1)

    @property
    def dimension(self) -> int:
        """d."""
        return self.points.shape[1]

    @property
    def facets(self) -> np.ndarray:
        """(f, d) int32, rows of points: the simplices that cover the boundary, found when first asked for."""
        if self._facets is None:
            d = self.dimension
            try:
                hull = boundary_hull(self.points, with_planes=False, max_simplices=self.memory // bytes_a_slot(d))
            except BoundaryTooLarge as large:
                raise UnsupportedQuery(
                    f"HierarchicalTree: after {large.n_points:,} of {len(self.points):,} points the boundary has "
                    f"{large.n_facets:,} simplices, {large.n_facets * bytes_a_slot(d):,} bytes while it grows, more "
                    f"than memory={self.memory:,}; raise it, or ask polytopes.meets, which needs none"
                ) from None
            assert hull is not None
            self._facets = hull.facets.astype(np.int32)
            self.n_bytes += self._facets.nbytes
            self._check_memory()
        return self._facets

    def _inner_radius(self) -> float:
        d = self.dimension
        faces = np.array([np.delete(self.first, k) for k in range(d + 1)])
        planes, errors, _ = nearby_planes(
            self.points, faces, whole_numbers(self.points[self.first]).sum(axis=0), self.reach
        )
        depths = planes[:, d] - planes[:, :d] @ self.centre - 2.0 * errors
        return max(float((depths / np.abs(planes[:, :d]).sum(axis=1)).min()), 0.0)

    # --- nodes --------------------------------------------------------------------------------------------------------

    def make_node(self, facets: np.ndarray, depth: int, corners: np.ndarray | None = None) -> Node:
        """A node for a set of simplices, with its net and the hull of it; ``corners`` are theirs where known."""
        if corners is None:
            corners = np.unique(self.facets[facets])
        if len(corners) <= self.limits.leaf:
            return self._count(Node(len(facets), depth, leaf=corners.astype(np.int32)))
        node = self._count(Node(len(facets), depth, facets=facets))
        self._draw(node, self._net_for(len(corners)))
        return node

    def _net_for(self, n_corners: int) -> int:
        wanted = math.ceil(_SIMPLICES_A_LEAF * (self.dimension - 1) * n_corners / self.limits.leaf)
        return min(max(wanted, _SMALLEST_NET), self.limits.net)

    def _count(self, node: Node) -> Node:
        self.n_nodes += 1
        self.n_bytes += node.n_bytes
        self._check_memory()
        return node

    def _draw(self, node: Node, n_net: int) -> None:
        """A net of n simplices, the same whenever the same set has one; what hung from an older net goes."""
        sampled = node.facets
        if len(sampled) > n_net:
            rng = np.random.default_rng([n_net, zlib.crc32(sampled.tobytes())])
            sampled = sampled[rng.choice(len(sampled), n_net, replace=False)]
        dropped = node.nodes()
        self.n_nodes -= len(dropped) - 1
        self.n_bytes -= sum(old.n_bytes for old in dropped)
        net = np.unique(np.concatenate((self.facets[sampled].ravel(), self.first)))
        corners = self.points[net]
        hull = boundary_hull(corners)
        if hull is None:
            raise AssertionError("a net that holds a first simplex is flat")
        planes = hull.planes.copy()
        planes[:, -1] = (planes[:, :-1] @ corners.T).max(axis=1)
        planes[:, -1] += 4.0 * rounding_errors(planes, self.reach)
        used, facets = np.unique(hull.facets, return_inverse=True)  # not points within flat faces
        node.rows = net[used].astype(np.int32)
        node.hull = Boundary(facets.reshape(hull.facets.shape).astype(np.int32), planes)
        node.cones, node.children = {}, {}
        node.n_draws += 1
        self.n_bytes += node.n_bytes
        self._check_memory()

    def redraw(self, node: Node) -> None:
        """A net of twice as many simplices; the children of the old one go."""
        if node.n_draws >= _MAX_DRAWS:
            raise UnsupportedQuery(f"{_MAX_DRAWS} samples of a hierarchical tree were no nets; ask polytopes.meets")
        self.n_redrawn += 1
        self._draw(node, self._net_for(len(np.unique(self.facets[node.facets]))) << node.n_draws)

    def _check_memory(self) -> None:
        if self.n_bytes > self.memory:
            raise UnsupportedQuery(
                f"HierarchicalTree: its boundary and nodes take {self.n_bytes:,} bytes, more than "
                f"memory={self.memory:,}; raise it, or ask polytopes.meets, which needs none"
            )

    def cones(self, node: Node, vertex: int) -> np.ndarray:
        """The shell cones at a vertex of a net's hull, made when first asked for."""
        cones = node.cones.get(vertex)
        if cones is None:
            cones = node.cones[vertex] = cones_at(vertex, node.hull.facets, node.hull.planes)
            self.n_bytes += cones.nbytes
            self._check_memory()
        return cones

    def child(self, node: Node, vertex: int, cone: int) -> Node | None:
        """The child of a shell cone: ``None`` where no simplex has a corner outside.

        Where more than ε|F| have, the net is drawn again, and the node itself is returned.
        """
        key = vertex, cone
        if key not in node.children:
            outside = self.outside(node.facets, node.hull.planes[self.cones(node, vertex)[cone]])
            if len(outside) > self.limits.epsilon * node.n_facets:
                self.redraw(node)
                return node
            node.children[key] = self.make_node(outside, node.depth + 1) if len(outside) else None
        return node.children[key]

    # --- exact sets ---------------------------------------------------------------------------------------------------

    def outside(self, facets: np.ndarray, planes: np.ndarray) -> np.ndarray:
        """F_σ̄: the given simplices with a corner outside at least a half-space (a, b), exactly."""
        corners = self.facets[facets]
        marks = np.zeros(len(self.points), dtype=bool)
        marks[corners] = True
        rows = np.flatnonzero(marks)
        marks[rows] = self.beyond(self.points[rows], planes).any(axis=0)
        return facets[marks[corners].any(axis=1)]

    def beyond(self, points: np.ndarray, planes: np.ndarray) -> np.ndarray:
        """(planes, points) bool: a·x > b, exactly."""
        is_beyond = np.zeros((len(planes), len(points)), dtype=bool)
        for line, plane, error in zip(is_beyond, planes, rounding_errors(planes, self.reach)):
            heights = points @ plane[:-1] - plane[-1]
            line[:] = heights > error
            near = np.flatnonzero(np.abs(heights) <= error)
            if len(near):
                line[near] = exactly_outside(points[near], plane)
        return is_beyond


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
