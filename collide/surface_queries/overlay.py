"""The overlay of two surfaces: pairs of facets with a common point, and the piece each pair shares.

J. Erickson, "Local polyhedra and geometric graphs" (2005), section 3.3: transferring fields between meshes of one
domain begins with the pairs of overlapping elements. Pairs are found by the exact walk. A pair shares a point, a
segment, or, of coplanar facets, a polygon: signs proven in doubles tell the kind, otherwise clipping a facet with the
other in integers.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cmp_to_key
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collide.narrowphase.facets.facet_crossings import facet_crossings
from collide.narrowphase.facets.facet_geometry import FacetCorners
from collide.narrowphase.facets.facet_queries import all_hits
from collide.numerics.exact_points import Point, on_one_grid, placed, rounded
from collide.numerics.exact_vectors import cross, inner, minus
from collide.shapes.shape import Shape
from collide.surface_queries.checked_arguments import two_bodies

#: What a pair of facets shares.
POINT, SEGMENT, POLYGON = 1, 2, 3


class Overlay(NamedTuple):
    """What the facets of two surfaces share, at N pairs of poses.

    pairs : (k, 2) int64 facet numbers of A and of B; those of a pose stand together, sorted.
    starts : (N + 1,) int64: the pairs of pose i are rows starts[i] to starts[i + 1].
    kind : (k,) int8: 1 a point, 2 a segment, 3 a polygon of facets in one plane; decided exactly.
    corners : (m, 3) in W [m]: the point, both ends of the segment, or the polygon's corners in order, counter-clockwise
        as seen from outside A. Off by at most 2⁻⁴⁰ of the largest coordinate of the two facets in W.
    corner_starts : (k + 1,) int64: the corners of pair j are rows corner_starts[j] to corner_starts[j + 1].
    size : (k,) 0 of points, the length of segments [m], the area of polygons [m²].
    """

    pairs: np.ndarray
    starts: np.ndarray
    kind: np.ndarray
    corners: np.ndarray
    corner_starts: np.ndarray
    size: np.ndarray


def overlay(A: Shape, B: Shape, X_WA, X_WB, *, check_poses: bool = True) -> Overlay:
    """Overlay of two surfaces: every pair of facets with a common point, and the point, segment or polygon they share.

    Parameters
    ----------
    A, B : shapes, at least a `Mesh` among them; a `Box` or a `ConvexHull` without a radius takes part with the
        triangles of its hull.
    X_WA, X_WB : (4, 4) poses in the world W [m], or batches (N, 4, 4); a single pose goes with every pose of the
        other's batch.
    check_poses : refuse matrices other than rotations.

    Returns
    -------
    Overlay. Pairs and kinds are exact; coordinates are rounded, with the bound in the fields of `Overlay`. Lengths and
    areas of pieces worked out in integers are good to 4 units in the last place; others to what the bound of their ends
    allows. Touching facets count: neighbours of a common edge of two triangulations share segments of no area. Swapped
    arguments give the same pieces; their polygons run the other way round where the facets face each other.

    Raises
    ------
    InvalidArgument : no mesh among the shapes, batches of different lengths.
    InvalidPose : matrices other than poses.
    UnsupportedQuery : shapes without facets, by name.

    Notes
    -----
    For the transfer of fields between two triangulations of a surface take the polygons: their areas add up to the area
    of the common part (J. Erickson, "Local polyhedra and geometric graphs" (2005), section 3.3). Only exactly coplanar
    facets, as handed in, share polygons. Costs what `facet_pairs` does, 1 µs a pair settled in doubles
    (two of three clearly crossing pairs), and some 0.2 ms for any other pair.
    """
    body_a, body_b, X_WA, X_WB = two_bodies("overlay", A, B, X_WA, X_WB, check_poses)
    hits = all_hits(body_a.tree, body_b.tree, X_WA, X_WB)
    pose = np.repeat(np.arange(len(X_WA)), np.diff(hits.starts))
    facets_a, facets_b = FacetCorners(body_a.tree)[hits.pairs[:, 0]], FacetCorners(body_b.tree)[hits.pairs[:, 1]]
    crossings = facet_crossings(facets_a, facets_b, X_WA[pose], X_WB[pose])
    ends, proven = crossings.place, crossings.is_segment
    kind = np.where(proven, SEGMENT, 0).astype(np.int8)
    counts = np.where(proven, 2, 0)
    size = np.where(proven, np.sqrt(np.square(ends[:, 1] - ends[:, 0]).sum(axis=1)), 0.0)
    exact_pieces = {}
    for k in np.flatnonzero(~proven).tolist():
        (a, b), grid = on_one_grid(placed(X_WA[pose[k]], facets_a[k]), placed(X_WB[pose[k]], facets_b[k]))
        exact_pieces[k], size[k] = _rounded_piece(common_piece(a, b), grid)
        counts[k] = len(exact_pieces[k])
        kind[k] = min(counts[k], POLYGON)
    starts = np.concatenate([[0], np.cumsum(counts)])
    corners = np.zeros((starts[-1], 3))
    segments = starts[:-1][proven]
    corners[segments], corners[segments + 1] = ends[proven, 0], ends[proven, 1]
    for k, piece in exact_pieces.items():
        corners[starts[k] : starts[k + 1]] = piece
    return Overlay(hits.pairs, hits.starts.copy(), kind, corners, starts, size)


# --- what doubles leave open, in integers -----------------------------------------------------------

#: A point as x, y, z over a common w > 0.
_Rational = tuple[int, int, int, int]
#: {p : normal · p ≤ offset}.
_Side = tuple[Point, int]


def common_piece(A: list[Point], B: list[Point]) -> list[_Rational]:
    """What two closed triangles share: no point, a point, two ends, or the corners of a polygon in order, A's way
    round.

    A is cut by half-spaces with B as their common part; where only B has an area, B by the half-spaces of A.
    """
    if cross(minus(A[1], A[0]), minus(A[2], A[0])) == (0, 0, 0) != cross(minus(B[1], B[0]), minus(B[2], B[0])):
        A, B = B, A
    piece = list(dict.fromkeys((*p, 1) for p in A))
    if len(piece) == 3 and cross(minus(A[1], A[0]), minus(A[2], A[0])) == (0, 0, 0):
        piece = _ends(piece)
    for side in _half_spaces(B):
        piece = _cut(piece, side)
    return _without_flat_corners(piece)


def _half_spaces(T: list[Point]) -> list[_Side]:
    """Those whose common part a triangle is, with or without an area."""
    n = cross(minus(T[1], T[0]), minus(T[2], T[0]))
    if n != (0, 0, 0):
        sides = [(n, T[0]), (_negated(n), T[0])]
        sides += [(cross(minus(T[(k + 1) % 3], T[k]), n), T[k]) for k in range(3)]
    else:
        ends = _ends([(*p, 1) for p in T])
        a, b = ends[0][:3], ends[-1][:3]
        e = minus(b, a)
        axes: list[Point] = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
        flats = [cross(e, axis) for axis in axes] if e != (0, 0, 0) else axes
        sides = [(normal, a) for flat in flats if flat != (0, 0, 0) for normal in (flat, _negated(flat))]
        if e != (0, 0, 0):
            sides += [(e, b), (_negated(e), a)]
    return [(normal, inner(normal, through)) for normal, through in sides]


def _negated(n: Point) -> Point:
    return -n[0], -n[1], -n[2]


def _cut(piece: list[_Rational], side: _Side) -> list[_Rational]:
    """A convex piece within a half-space."""
    (nx, ny, nz), offset = side
    heights = [nx * x + ny * y + nz * z - offset * w for x, y, z, w in piece]
    if max(heights, default=0) <= 0:
        return piece
    remaining: list[_Rational] = []
    for k, (p, s) in enumerate(zip(piece, heights)):
        if s <= 0:
            remaining.append(p)
        q, t = piece[(k + 1) % len(piece)], heights[(k + 1) % len(piece)]
        if s * t < 0:
            # Both heights are over their own w: weights |t| and |s| of the homogeneous points meet at height 0.
            remaining.append(_reduced(*(abs(t) * x + abs(s) * y for x, y in zip(p, q))))
    return list(dict.fromkeys(remaining))


def _reduced(x: int, y: int, z: int, w: int) -> _Rational:
    common = math.gcd(x, y, z, w)
    return x // common, y // common, z // common, w // common


def _ends(piece: list[_Rational]) -> list[_Rational]:
    """The ends of points on one line, in the order of their coordinates."""
    order = sorted(piece, key=_by_coordinates)
    return list(dict.fromkeys((order[0], order[-1])))


def _compare(p: _Rational, q: _Rational) -> int:
    """−1, 0 or 1 as p comes before q by coordinates, is q, or comes after it."""
    for x, y in zip(p[:3], q[:3]):
        difference = x * q[3] - y * p[3]
        if difference:
            return -1 if difference < 0 else 1
    return 0


_by_coordinates = cmp_to_key(_compare)


def _without_flat_corners(piece: list[_Rational]) -> list[_Rational]:
    """The polygon's true corners, first the least; of points on one line the ends."""
    if len(piece) < 3:
        return _ends(piece) if len(piece) == 2 else piece
    sides = [_along(piece[k - 1], p) for k, p in enumerate(piece)]
    true = [p for p, e, f in zip(piece, sides, [*sides[1:], sides[0]]) if cross(e, f) != (0, 0, 0)]
    if len(true) < 3:
        return _ends(piece)
    first = true.index(min(true, key=_by_coordinates))
    return true[first:] + true[:first]


def _along(p: _Rational, q: _Rational) -> Point:
    """A vector along q − p."""
    return q[0] * p[3] - p[0] * q[3], q[1] * p[3] - p[1] * q[3], q[2] * p[3] - p[2] * q[3]


def _rounded_piece(piece: list[_Rational], exponent: int) -> tuple[np.ndarray, float]:
    """((corners, 3) rounded to the nearest doubles, length or area)."""
    exact = [[Fraction(v, p[3]) for v in p[:3]] for p in piece]
    corners = np.array([[rounded(v, exponent)[0] for v in p] for p in exact])
    edges = [[x - y for x, y in zip(p, exact[0])] for p in exact[1:]]
    if len(edges) == 1:
        return corners, _length(edges[0], exponent)
    total = [Fraction(0)] * 3
    for e, f in pairwise(edges):
        total = [x + y for x, y in zip(total, cross(e, f))]  # type: ignore[arg-type]
    return corners, 0.5 * _length(total, 2 * exponent)


def _length(vector: list[Fraction], exponent: int) -> float:
    """Of vector · 2^exponent, components rounded once."""
    x, y, z = (rounded(v, exponent)[0] for v in vector)
    return math.hypot(x, y, z)
