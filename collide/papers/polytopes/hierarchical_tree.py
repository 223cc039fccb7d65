"""`HierarchicalTree`: a polytope in R^d, by its points or its half-spaces, preprocessed for `trees_meet`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from collide.base.argument_checks import integer, true_or_false
from collide.errors import InvalidArgument, UnsupportedQuery, brief
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.input_rows import read_halfspaces, read_points
from collide.least_distance.interior_point import interior_point
from collide.least_distance.pair_proposals import Work
from collide.papers.polytopes.exact_planes import BITS
from collide.papers.polytopes.facet_tree import FacetTree, Sizes, sizes
from collide.papers.polytopes.incremental_hull import bytes_a_slot
from collide.papers.polytopes.recentred_polars import recentred_spaces
from collide.papers.polytopes.tree_size import TreeSize, max_simplices, predicted_simplices, predicted_size, size_of
from collide.papers.polytopes.tree_walk import Grid
from collide.papers.polytopes.whole_tree import build_whole

#: Bytes of a tree by default.
MEMORY = 1 << 30


class HierarchicalTree:
    """A polytope in R^d, 2 ≤ d ≤ 8, by its points or its half-spaces, with the tree of section 6 of the paper.

    Parameters
    ----------
    points : (n, d) array_like, float64, optional
        The body is their hull, with interior [any unit of length].
    normals, offsets : (m, d), (m,) array_like, float64, optional
        The body is {x : normals @ x ≤ offsets}, with interior; unbounded is allowed.
    whole : bool
        Whether to make all nodes now, as `build` does; else each is made at the first visit of a query.
    memory : int
        The most bytes of the boundary and the nodes of the tree.
    limits : Sizes, optional
        ε, net and leaf; chosen by dimension.

    Attributes
    ----------
    tree : FacetTree
        Over the boundary of the points' hull, or of the hull of the polars w of the half-spaces, {x : ⟨w, x⟩ ≤ 1}.
    grid : Grid
        Scale and origin of the tree's integers.
    interior : (d,) float64 or ``None``
        Of half-spaces, the origin of their polars.
    predicted : TreeSize or ``None``
        The prediction of `build`.

    Raises
    ------
    InvalidArgument
        Where both or neither are given, or numbers are not finite, out of range or of the wrong shape.
    UnsupportedQuery
        Where the body is flat or empty, or the tree takes more than ``memory``, or is predicted to.

    Notes
    -----
    L. Barba and S. Langerman, "Optimal detection of intersections between convex polyhedra" (2015), section 6. The
    boundary has as many simplices as the hull has facets, up to n^⌊d/2⌋; a single leaf for all points
    needs no boundary. Where the upper bound theorem allows more than ``memory`` holds, their number is predicted first,
    and a body beyond ``memory`` is refused. All nodes together are n^(⌊d/2⌋ + δ) in the paper, for n faces of all
    dimensions. Not for several threads at once.
    """

    def __init__(
        self,
        points: ArrayLike | None = None,
        *,
        normals: ArrayLike | None = None,
        offsets: ArrayLike | None = None,
        whole: bool = False,
        memory: int = MEMORY,
        limits: Sizes | None = None,
    ):
        limit, whole = integer("HierarchicalTree: memory", memory, 1), true_or_false("HierarchicalTree: whole", whole)
        self.points: np.ndarray | None = None
        self.normals: np.ndarray | None = None
        self.offsets: np.ndarray | None = None
        self.interior: np.ndarray | None = None
        if points is not None and normals is None and offsets is None:
            cloud, _ = read_points(points)
            self.points = cloud
        elif points is not None or normals is None or offsets is None:
            arguments = {"points": points, "normals": normals, "offsets": offsets}
            raise InvalidArgument(
                "HierarchicalTree: give either points, or normals with offsets, got "
                + ", ".join(f"{name} {brief(value)}" for name, value in arguments.items())
            )
        else:
            shape = np.asarray(normals).shape
            self.normals, self.offsets, _ = read_halfspaces(normals, offsets, shape[1] if len(shape) == 2 else 0)
            self.interior, cloud = _polars(self.normals, self.offsets)
        if not 2 <= cloud.shape[1] <= 8:
            raise InvalidArgument(f"HierarchicalTree: 2 ≤ d ≤ 8, got d = {cloud.shape[1]}")
        self.grid = as_grid(cloud)
        self.memory, self.limits = limit, limits
        self.predicted: TreeSize | None = None
        if whole:
            self._refuse_beyond_memory()
        self._refuse_large_boundary()
        self.tree = FacetTree(self.grid.whole, limit, limits)
        if whole:
            build_whole(self.tree)

    def build(self) -> TreeSize:
        """Make all nodes that are not made yet; their number, depth and bytes.

        Returns
        -------
        TreeSize
            Of the whole tree.

        Raises
        ------
        UnsupportedQuery
            Where the tree is predicted to take more than ``memory``, with the bytes predicted, or does.
        """
        self._refuse_beyond_memory()
        build_whole(self.tree)
        return self.size

    @property
    def size(self) -> TreeSize:
        """What was made so far: simplices, nodes, levels, bytes."""
        return size_of(self.tree)

    def _refuse_beyond_memory(self) -> None:
        self.predicted = predicted_size(self.grid.whole, self.limits)
        if self.predicted.n_bytes > self.memory:
            raise UnsupportedQuery(
                f"HierarchicalTree: the whole tree is predicted to take {self.predicted.n_bytes:,} bytes "
                f"({self.predicted.simplices:,} boundary simplices, {self.predicted.nodes:,} nodes), more than "
                f"memory={self.memory:,}; raise it, or leave whole=False: nodes are then made as queries need them"
            )

    def _refuse_large_boundary(self) -> None:
        n, d = self.grid.whole.shape
        if n <= (self.limits or sizes(d)).leaf or max_simplices(n, d) * bytes_a_slot(d) <= self.memory:
            return
        simplices = predicted_simplices(self.grid.whole)
        if simplices * bytes_a_slot(d) > self.memory:
            raise UnsupportedQuery(
                f"HierarchicalTree: the boundary is predicted to have {simplices:,} simplices, "
                f"{simplices * bytes_a_slot(d):,} bytes while it grows, more than memory={self.memory:,}; raise it, "
                "or ask polytopes.meets, which needs none"
            )

    @property
    def dimension(self) -> int:
        """d."""
        return self.grid.points.shape[1]

    def __repr__(self) -> str:
        kind = "points" if self.points is not None else "half-spaces"
        return f"HierarchicalTree(<{len(self.grid.points)} {kind} in R^{self.dimension}, {self.tree.n_nodes} nodes>)"


def as_grid(points: np.ndarray) -> Grid:
    """Points on a grid of 2^(BITS − 1) units to either side of the middle."""
    if float(np.abs(points).max()) > 1e50:
        raise InvalidArgument("HierarchicalTree: coordinates must be within ±1e50: scale the body")
    centre = (points.max(axis=0) + points.min(axis=0)) / 2.0
    extent = float(np.abs(points - centre).max())
    unit = math.ldexp(1.0, math.frexp(extent)[1] - (BITS - 1)) if extent > 0.0 else 1.0
    whole = np.rint((points - centre) / unit)
    return Grid(points, whole, centre, unit)


def _polars(normals: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(a point inside, the polars of the half-spaces seen from it)."""
    rows = HomogeneousRows(
        normals, offsets, lambda row: as_integers([*normals[row].tolist(), float(offsets[row])])[0]
    )
    centre = HomogeneousRows(np.zeros((1, normals.shape[1])), 1.0, lambda row: [0] * normals.shape[1] + [1])
    for exactly in (False, True):
        inside = interior_point(rows, Work(), exactly)
        spaces = None if inside is None else recentred_spaces(centre, rows, inside)
        if inside is not None and spaces is not None:
            return inside, spaces[1].points.values
    raise UnsupportedQuery("HierarchicalTree: the half-spaces have no interior in common; ask polytopes.meets")
