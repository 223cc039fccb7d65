"""Structures of the walk for a polytope, built at the first query: its hierarchy, and its polar with a hierarchy.

Barba and Langerman, section 5, "Preprocessing". The origin of the polar is a point inside R, fixed in R's own frame,
so that a motion of R changes nothing.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from collide.base.fork_safe_lock import ForkSafeLock
from collide.hull.exact_hull import Hull, convex_hull
from collide.kernels import address_of
from collide.numerics.exact_vectors import cross, inner, minus
from collide.papers.hierarchies.flat_hierarchy import flat_hierarchy
from collide.papers.hierarchies.hierarchy import build_hierarchy
from collide.papers.hierarchies.merged_facets import facet_of_triangles
from collide.papers.hierarchies.packed_hierarchy import PackedHierarchy
from collide.papers.hierarchies.polar_hull import polar_of_hull
from collide.papers.hierarchies.true_facets import Cloud, twins_of


class WalkBody:
    """A polytope, with structures built when first asked for: each costs O(n log n) once.

    points : (n, 3) of a polytope, in its own frame.   hull : theirs, where it is known already.
    """

    def __init__(self, points: np.ndarray, hull: Hull | None = None):
        self.points = np.ascontiguousarray(points, dtype=np.float64)
        self._hull = hull
        self._hierarchy: PackedHierarchy | None = None
        self._polar: PolarSide | None = None
        self._has_no_polar = False

    @property
    def hull(self) -> Hull:
        if self._hull is None:
            self._hull = convex_hull(self.points)
        return self._hull

    @property
    def has_interior(self) -> bool:
        """Whether the body can play R."""
        return self.hull.dimension == 3

    @property
    def hierarchy(self) -> PackedHierarchy:
        """For the part of P, and for distances."""
        if self._hierarchy is None:
            with _build_lock():
                if self._hierarchy is None:
                    build = build_hierarchy if self.has_interior else flat_hierarchy
                    self._hierarchy = PackedHierarchy(build(self.points, self.hull))
        return self._hierarchy

    @property
    def polar(self) -> PolarSide | None:
        """The body as R of the walk. A body without interior, or too thin for a polar in doubles, is
        thickened by 2⁻¹² of its size; ``None`` for sizes without a polar in ordinary doubles.
        """
        if self._polar is None and not self._has_no_polar:
            with _build_lock():
                if self._polar is None and not self._has_no_polar:
                    try:
                        self._polar = self._new_polar()
                    except ValueError:
                        self._has_no_polar = True
        return self._polar

    def _new_polar(self) -> PolarSide:
        """Build the polar side; raises ValueError for a body without a polar in doubles."""
        if self.has_interior:
            try:
                return PolarSide(self.points, self.hull)
            except ValueError:
                pass
        thick = thickened(self.points)
        return PolarSide(thick, convex_hull(thick), len(self.points))

    @property
    def has_own_polar(self) -> bool:
        """Whether the body plays R as it is, not thickened."""
        return self.has_interior and self.polar is not None and not self.polar.is_thickened

    @property
    def depth_of_polar(self) -> int:
        """Levels of the hierarchy of the polar; 0 without a polar."""
        return self.polar.hierarchy.depth if self.polar is not None else 0


class PolarSide:
    """R as the walk reads it: the hierarchy of its polar, a ball inside, and the triangles of each facet.

    points : (n, 3), with their hull.   count : number of the body's own points, before the points of a thickened body.

    body : the `PolarBody` of R.   hierarchy : of Q = ρ0(R − origin), packed.   origin : (3,), inside R.
    radius : of a ball about the origin inside R, proven [m]; 0 where rounding leaves no ball, without proofs
        by a ball.
    starts, triangles : the facets of R merged in vertex k of Q are triangles[starts[k]:starts[k + 1]].
    """

    def __init__(self, points: np.ndarray, hull: Hull, count: int | None = None):
        polar = polar_of_hull(points, hull)
        self.is_thickened = count is not None
        self.body = polar
        self.hierarchy = PackedHierarchy(polar.hierarchy)
        self.origin = np.asarray(polar.origin, dtype=np.float64)
        facets = np.ascontiguousarray(hull.facets, dtype=np.int32)
        self.radius = 0.0 if self.is_thickened else _inner_radius(points, facets, self.origin)
        patch = polar.groups[facet_of_triangles(Cloud(points), facets, twins_of(facets))]
        order = np.argsort(patch, kind="stable")
        self.triangles = np.ascontiguousarray(facets[order])
        if count is not None:  # vertices of the thickened body alone are replaced by the first vertex
            self.triangles[self.triangles >= count] = 0
        self.starts = np.searchsorted(patch[order], np.arange(len(polar.points) + 1)).astype(np.int64)
        self._centre = np.array([*self.origin, self.radius])
        self._ball = np.array(
            [
                address_of(self._centre), address_of(self.starts), len(self.starts) - 1, address_of(self.triangles),
                len(self.triangles),
            ],
            dtype=np.int64,
        )

    @property
    def address(self) -> int:
        """Address of the ball and the facets, as `walk_proof.ball_at` reads them."""
        return address_of(self._ball)


#: By how much of its size a body without a polar of its own is thickened.
_THICKENED = 2.0**-12


def thickened(points: np.ndarray) -> np.ndarray:
    """Points (n, 3), and behind them the six corners of a small octahedron about their middle."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * low + 0.5 * high
    size = max(float((high - low).max()), 2.0**-20 * float(np.abs(middle).max())) or 1.0
    offsets = _THICKENED * size * np.eye(3)
    return np.ascontiguousarray(np.concatenate([points, middle + offsets, middle - offsets]))


#: Rounding of a distance to a facet's plane, in units of the largest coordinate: some twenty operations, and
#: a thin triangle's normal is as good as its shortest height is long.
_ROUNDING = 64 * 2.0**-53
#: At most so many facets, those of the largest error bounds first, are measured in fractions, some 20 µs each.
_MAX_EXACT_FACETS = 20_000


def _inner_radius(points: np.ndarray, facets: np.ndarray, origin: np.ndarray) -> float:
    """A lower bound of the distance from the origin to the planes of all facets."""
    a, b, c = (points[facets[:, k]] - origin for k in range(3))
    e, f = b - a, c - a
    normal = np.cross(e, f)
    length = np.sqrt(np.square(normal).sum(axis=1))
    volume = (a * normal).sum(axis=1)
    largest = float(np.abs(points).max() + np.abs(origin).max())
    # Corners moved by u·largest move the determinant by at most that times the doubled areas around.
    spans = [np.sqrt(np.square(v).sum(axis=1)) for v in (a, b, c, e, f)]
    areas = spans[3] * spans[4] + (spans[0] + spans[1] + spans[2]) * (spans[3] + spans[4])
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = (volume - 4 * _ROUNDING * largest * areas) / (length + _ROUNDING * largest * (spans[3] + spans[4]))
        inexact = ~(bound > 0.99 * volume / length)
    bound[np.isnan(bound)] = -np.inf
    least = float(bound[~inexact].min(initial=np.inf))
    order = np.flatnonzero(inexact)[np.argsort(bound[inexact], kind="stable")]
    for count, k in enumerate(order.tolist()):
        if bound[k] >= least or count == _MAX_EXACT_FACETS:  # the others are farther away, or too many
            least = min(least, float(bound[k]))
            break
        least = min(least, _exact_distance(points[facets[k]], origin))
    return max(0.0, least * (1 - 1e-12))


def _exact_distance(corners: np.ndarray, origin: np.ndarray) -> float:
    """Distance from the origin to the plane of a facet, from rational numbers, rounded downwards."""
    a, b, c = ([Fraction(v) - Fraction(o) for v, o in zip(p, origin.tolist())] for p in corners.tolist())
    normal = cross(minus(b, a), minus(c, a))
    height = inner(a, normal)
    if height <= 0:
        return 0.0
    return math.sqrt(float(height * height / inner(normal, normal))) * (1 - 1e-12)


#: Held while a hierarchy is built: a single build at a time, since a hierarchy of 100,000 points takes seconds.
_build_lock = ForkSafeLock()
