"""`HierarchicalTree` and `trees_meet`: preprocessed polytopes in R^d, asked whether they meet where they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from collide.argument_checks import integer
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.input_rows import InputRows, read_halfspaces, read_points
from collide.least_distance.interior_point import interior_point
from collide.least_distance.nearest_pair import nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.polytopes.exact_answers import make_meeting
from collide.polytopes.exact_planes import BITS
from collide.polytopes.facet_tree import FacetTree, Sizes
from collide.polytopes.meeting import MeetingCertificate
from collide.polytopes.recentred_polars import recentred_spaces
from collide.polytopes.relative_pose import Rows, affine_map, as_doubles, homogeneous_integers, inverse, product
from collide.polytopes.tree_walk import HIT, MISS, OPEN, Grid, Plane, Relative, TreeWalk

_UNIT = 2.0**-53
#: Bytes that the nodes of one tree may take, where nothing is said.
MEMORY = 1 << 30


class HierarchicalTree:
    """A polytope in R^d, 2 ≤ d ≤ 8, by its points or its half-spaces, with the tree of section 6 of the paper.

    Parameters
    ----------
    points : (n, d) array_like, float64, optional
        The body is their hull, which must have interior [any unit of length].
    normals, offsets : (m, d), (m,) array_like, float64, optional
        The body is {x : normals @ x ≤ offsets}, which must have interior; unbounded is allowed.
    memory : int
        The most bytes that the nodes of the tree may take.
    limits : Sizes, optional
        ε, net and leaf; chosen by dimension.

    Attributes
    ----------
    tree : FacetTree
        Over the boundary of the points' hull, or of the hull of the polars w of the half-spaces, {x : ⟨w, x⟩ ≤ 1}.
    grid : Grid
        What the tree's integers stand for.
    interior : (d,) float64 or None
        Of half-spaces, the point of which they are polars.

    Raises
    ------
    InvalidArgument
        Where both or neither are given, or numbers are not finite, out of range or of the wrong shape.
    UnsupportedQuery
        Where the body is flat or empty, or nodes would take more than ``memory``.

    Notes
    -----
    L. Barba and S. Langerman, "Optimal detection of intersections between convex polyhedra" (2015), section 6. The
    boundary is found at once: as many simplices as the hull has facets, up to n^⌊d/2⌋. Nodes are made when a query
    first comes to them, and are the same whatever was asked before. All nodes together are n^(⌊d/2⌋ + δ) in the
    paper, for n faces of all dimensions. Not for several threads at once.
    """

    def __init__(
        self,
        points: ArrayLike | None = None,
        *,
        normals: ArrayLike | None = None,
        offsets: ArrayLike | None = None,
        memory: int = MEMORY,
        limits: Sizes | None = None,
    ):
        limit = integer("HierarchicalTree: memory", memory, 1)
        self.points: np.ndarray | None = None
        self.normals: np.ndarray | None = None
        self.offsets: np.ndarray | None = None
        self.interior: np.ndarray | None = None
        if points is not None and normals is None and offsets is None:
            cloud, _ = read_points(points)
            self.points = cloud
        elif points is not None or normals is None or offsets is None:
            raise InvalidArgument("HierarchicalTree: give either points, or normals with offsets")
        else:
            shape = np.asarray(normals).shape
            self.normals, self.offsets, _ = read_halfspaces(normals, offsets, shape[1] if len(shape) == 2 else 0)
            self.interior, cloud = _polars(self.normals, self.offsets)
        if not 2 <= cloud.shape[1] <= 8:
            raise InvalidArgument(f"HierarchicalTree: 2 ≤ d ≤ 8, got d = {cloud.shape[1]}")
        self.grid = as_grid(cloud)
        self.tree = FacetTree(self.grid.whole, limit, limits)

    @property
    def dimension(self) -> int:
        """d."""
        return self.grid.points.shape[1]

    def __repr__(self) -> str:
        kind = "points" if self.points is not None else "half-spaces"
        return f"HierarchicalTree(<{len(self.grid.points)} {kind} in R^{self.dimension}, {self.tree.n_nodes} nodes>)"


@dataclass(frozen=True)
class TreeMeeting:
    """Whether two preprocessed bodies meet.

    Attributes
    ----------
    hit : bool
        They have a point in common; touching is a hit.
    settled : bool
        Whether the trees left it open (within some 1e-13 of touching) and integers over all rows decided it.
    certificate : MeetingCertificate or None
        Where it was asked for: weights of the points and multipliers of the half-spaces, checked by `verify_trees`.
    planes : tuple of Plane
        Of a miss found by the trees, O(log n + log m) planes: each has the region on one side, and together they
        leave out every point of the hull.
    counters : mapping
        ``origin_rounds``, ``rounds``, ``simplices_read``, ``net_rows``; of the certificate ``rows_read``.
    """

    hit: bool
    settled: bool
    certificate: MeetingCertificate | None
    planes: tuple[Plane, ...]
    counters: Mapping[str, int]

    def __bool__(self) -> bool:
        return self.hit


def trees_meet(
    A: HierarchicalTree,
    B: HierarchicalTree,
    X_WA: ArrayLike | None = None,
    X_WB: ArrayLike | None = None,
    *,
    certificate: bool = True,
) -> TreeMeeting:
    """Whether two bodies meet, in O(log n + log m) rounds down their trees.

    Parameters
    ----------
    A, B : HierarchicalTree
        One of points, the other of half-spaces.
    X_WA : (k, k) array_like, float64, optional
    X_WB : (k, k) array_like, float64, optional
        Their poses, k = d + 1: any invertible affine maps, entries taken as exact; the identity by default.
    certificate : bool
        Whether to make one: an exact search over all rows, begun with those that the trees found.

    Returns
    -------
    TreeMeeting

    Raises
    ------
    InvalidArgument
        Where both are of points or both of half-spaces, or dimensions differ.
    InvalidPose
        Where a map is not finite, not affine or not invertible.
    UnsupportedQuery
        Where a tree would need more memory than it may take.
    """
    if A.points is None:
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    if A.points is None or B.points is not None:
        raise InvalidArgument("trees_meet: one body must be made from points and the other from half-spaces")
    if A.dimension != B.dimension:
        raise InvalidArgument(f"trees_meet: A has {A.dimension} dimensions, B {B.dimension}: give both the same")
    d = A.dimension
    X_BA = product(inverse("X_WB", affine_map("X_WB", X_WB, d)), affine_map("X_WA", X_WA, d))
    X_AB = inverse("X_WA", X_BA)
    walk = TreeWalk(A.tree, B.tree, B.grid, relative_of(A, B, X_BA, X_AB)).run()
    counters = {
        "origin_rounds": walk.origin_rounds, "rounds": walk.rounds, "simplices_read": walk.simplices_read,
        "net_rows": walk.net_rows,
    }  # fmt: skip
    planes = tuple(walk.planes) if walk.status == MISS else ()
    if walk.status != OPEN and not certificate:
        return TreeMeeting(walk.status == HIT, False, None, planes, counters)
    rows = posed_rows(A, B, X_BA)
    start = walk.points[-2 * (d + 1) :], walk.halfspaces[-2 * (d + 1) :]
    pair = nearest_pair(rows.points, rows.halfspaces, Work(), start=start)
    meeting = make_meeting(pair, rows, {})
    if walk.status != OPEN and meeting.hit != (walk.status == HIT):
        raise AssertionError(f"trees_meet: the trees say {walk.status}, the exact search hit={meeting.hit}")
    counters["rows_read"] = rows.points.n_read + rows.halfspaces.n_read
    proof = meeting.certificate if certificate else None
    return TreeMeeting(meeting.hit, walk.status == OPEN, proof, planes, counters)


# --- grids, poses -----------------------------------------------------------------------------------------------------


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


def relative_of(A: HierarchicalTree, B: HierarchicalTree, X_BA: Rows, X_AB: Rows) -> Relative:
    """The relative pose on grids, with what rounding may do."""
    d, grid, polar = A.dimension, A.grid, B.grid
    assert B.interior is not None
    inside = [Fraction(x) for x in B.interior.tolist()]
    centre = [Fraction(x) for x in grid.centre.tolist()]
    M = as_doubles(X_BA)[:d, :d]
    a = np.array([
        float(sum((x * y for x, y in zip(row, centre)), row[d]) - c) for row, c in zip(X_BA[:d], inside)
    ])  # fmt: skip
    unit = Fraction(grid.unit)
    o = np.array([
        float((sum((x * y for x, y in zip(row, inside)), row[d]) - c) / unit) for row, c in zip(X_AB[:d], centre)
    ])  # fmt: skip
    map_of_unit = M * grid.unit
    size = float((np.abs(map_of_unit).sum(axis=1) * A.tree.reach + np.abs(a)).max())
    shift = float(np.abs(map_of_unit).sum(axis=1).max())  # what a point is off by
    largest = float(np.abs(polar.points).max())
    eta = 4.0 * d * (size * (polar.unit + 16.0 * _UNIT * largest) + largest * (shift + 32.0 * d * _UNIT * size))
    zeta = 64.0 * d * _UNIT * (float(np.abs(o).max()) + A.tree.reach) + 4.0 * d
    return Relative(map_of_unit, a, o, eta, zeta)


def posed_rows(A: HierarchicalTree, B: HierarchicalTree, X_BA: Rows) -> InputRows:
    """All points in the frame of B and all half-spaces, with exact integers behind them."""
    points, normals, offsets = A.points, B.normals, B.offsets
    assert points is not None and normals is not None and offsets is not None
    d, whole, doubles = A.dimension, homogeneous_integers(X_BA), as_doubles(X_BA)
    values = points @ doubles[:d, :d].T + doubles[:d, d]
    size = float((np.abs(points).max(axis=0) @ np.abs(doubles[:d, :d]).T + np.abs(doubles[:d, d])).max())
    magnitude = float(np.abs(values).max()) or 1.0

    def point(row: int) -> list[int]:
        numerators, denominator = as_integers(points[row].tolist())
        vector = [*numerators, denominator]
        return [sum(x * y for x, y in zip(line, vector)) for line in whole]

    def halfspace(row: int) -> list[int]:
        return as_integers([*normals[row].tolist(), float(offsets[row])])[0]

    error = (2 * d + 6) * _UNIT * max(size / magnitude, 1.0)
    return InputRows(
        HomogeneousRows(values, 1.0, point, error), HomogeneousRows(normals, offsets, halfspace), 0, normals
    )
