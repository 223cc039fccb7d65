"""The search for a proof about two parts: a normal between them, or a common point. Doubles propose,
`point_and_plane.py` decides; gaps and depths too small for doubles go to the algebra of curved pairs, or to GJK in
integers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import reduce
from itertools import combinations, permutations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.certificates.exact_parts import Exact3, ExactPart, common_vertices
from collide.certificates.nearest_to_origin import nearest_to_origin, nearest_vertex_pairs, weights_towards_origin
from collide.certificates.point_and_plane import (
    WeightedPoint,
    flaw_of_normal,
    flaw_of_normals,
    flaw_of_point,
    in_lowest_terms,
    root_no_less,
)
from collide.lowering.convex_sets import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.numerics.exact_points import PlacedPoints, Point, in_integers, leading_digits, opposite
from collide.numerics.exact_vectors import cross, inner, minus

if TYPE_CHECKING:
    from collide.hull import exact_hull
    from collide.narrowphase.exact_curved import curved_pair, integer_bodies
else:  # needed for making certificates, not for checking
    curved_pair = lazy_module("collide.narrowphase.exact_curved.curved_pair")
    integer_bodies = lazy_module("collide.narrowphase.exact_curved.integer_bodies")
    exact_hull = lazy_module("collide.hull.exact_hull")

#: Bits of a normal's components: few where the gap is wide.
_BITS = (6, 20, 53)
#: Bits of roots rounded up, in turn.
_ROOT_BITS = (64, 512, 4096)
#: Shares of the way between two points of an end that are tried, and vertices of a face.
_SHARES = (Fraction(0), *(Fraction(1, 1 << bits) for bits in (45, 20, 8, 2, 1)))
_TIED, _ZERO = 8, Fraction(0)
#: Bits of the supports that GJK of proposals works with, and its rounds.
_GRID, _ROUNDS = 30, 40

# --- a normal -----------------------------------------------------------------------------------


def parting_normal(A: ExactPart, B: ExactPart, guesses: Sequence[np.ndarray] = ()) -> Point | None:
    """A normal n in integers with n·(a − b) > 0 for all points of A and B; ``None`` where none is found.

    guesses : (3,) doubles from B to A, tried first.
    """
    return quick_normal(A, B, guesses) or exact_normal(A, B, guesses)


def quick_normal(A: ExactPart, B: ExactPart, guesses: Iterable[np.ndarray] = ()) -> Point | None:
    """The same by doubles alone: it may miss a normal where the gap is below 2^-30 of the size."""
    return parting_of_unions([A], [B], RoughUnion([A]), RoughUnion([B]), guesses)


def parting_of_unions(
    A: Sequence[ExactPart], B: Sequence[ExactPart], a: RoughUnion, b: RoughUnion, guesses: Iterable[np.ndarray] = ()
) -> Point | None:
    """The same of the hulls of unions of parts; a, b : the same in doubles."""
    planes = [opposite(in_integers(part.plane[0])) for part in A if part.kind == HALFSPACE]
    planes += [in_integers(part.plane[0]) for part in B if part.kind == HALFSPACE]
    for n in planes:
        return n if flaw_of_normals(A, B, n) is None else None
    for v in _proposals(a, b, guesses):
        for n in _rounded(v):
            if flaw_of_normals(A, B, n) is None:
                return n
    return None


def exact_normal(A: ExactPart, B: ExactPart, guesses: Sequence[np.ndarray] = ()) -> Point | None:
    """The same in integers: decides for vertices without a radius, and for curved parts as docs/curved-signs.md says.
    """
    if HALFSPACE in (A.kind, B.kind):
        return None
    if A.kind == B.kind == POINTS:
        points_a, points_b, _ = common_vertices(A, B)
        pairs = nearest_vertex_pairs(points_a, points_b, [(0, 0)])
        n = nearest_to_origin([minus(points_a[i], points_b[j]) for i, j in pairs]).vector
    else:
        n = opposite(_settled(A, B, guesses, weighted(RoughPart(A).middle)).normal or (0, 0, 0))
    return n if flaw_of_normal(A, B, n) is None else None


def _rounded(v: Sequence[float]) -> Iterator[Point]:
    largest = max(abs(float(x)) for x in v)
    if not 0.0 < largest < math.inf:
        return
    for bits in _BITS:
        yield tuple(round(float(x) / largest * (1 << bits)) for x in v)  # type: ignore[misc]


def _proposals(a: RoughUnion, b: RoughUnion, guesses: Iterable[np.ndarray]) -> Iterator[Sequence[float]]:
    """Directions from B to A: of the widest gap of boxes, the guesses, and of each round of GJK, on supports rounded to
    a grid, its direction where the supports along it are apart.
    """
    gaps = np.array([a.low - b.high, b.low - a.high])
    if gaps.max() > 0.0:
        side, axis = divmod(int(np.argmax(gaps)), 3)
        yield ((1.0 - 2.0 * side) * np.eye(3)[axis]).tolist()
    for guess in guesses:
        if float(_product(guess, a.support(-guess) - b.support(guess))) > 0.0:
            yield guess.tolist()
    unit = float(max((a.high - a.low).max(), (b.high - b.low).max(), np.abs(a.low - b.low).max())) / (1 << _GRID)
    if not 0.0 < unit < math.inf:
        return
    v = 0.5 * (a.low + a.high - b.low - b.high)
    simplex: list[Point] = []
    for _ in range(_ROUNDS):
        away = a.support(-v) - b.support(v)
        if float(_product(v, away)) > 0.0:
            yield v.tolist()
        x, y, z = np.rint(away / unit).tolist()
        new = int(x), int(y), int(z)
        if new in simplex:
            return
        nearest, _, carrier = nearest_to_origin([*simplex, new])
        simplex = [[*simplex, new][k] for k in carrier]
        if not any(nearest):
            return
        v = np.array(leading_digits(nearest))


class RoughUnion:
    """A union of parts without half-spaces in doubles, for proposals: its supports and its box, about.

    low, high : (3,).
    """

    def __init__(self, parts: Sequence[ExactPart]):
        self.parts = [RoughPart(part) for part in parts if part.kind != HALFSPACE]
        ends = [[part.support(d)[k] for part in self.parts] for s in (-1.0, 1.0) for k, d in enumerate(s * np.eye(3))]
        self.low = np.array([min(values, default=0.0) for values in ends[:3]])
        self.high = np.array([max(values, default=0.0) for values in ends[3:]])

    def support(self, n: np.ndarray) -> np.ndarray:
        """(3,) a point farthest along n."""
        return max((part.support(n) for part in self.parts), key=lambda x: float(_product(n, x)))


def _product(columns: Iterable[np.ndarray], factors: Iterable) -> np.ndarray:
    """Σ columns · factors, each product and sum rounded by itself: the same bits on every machine, unlike BLAS."""
    return reduce(np.add, (column * factor for column, factor in zip(columns, factors)))


class RoughPart:
    """A part in doubles."""

    def __init__(self, part: ExactPart):
        self.kind, self.radius = part.kind, float(part.radius)
        X = reduce(lambda inner_pose, X: _product(X.T[:, :, None], inner_pose), part.poses)
        self.R, self.t = X[:3, :3], X[:3, 3]
        if part.kind == POINTS:
            self.points = _product(part.points_P.T[:, :, None], self.R.T) + self.t
        else:
            self.sizes = np.array(part.params[:3], dtype=float)

    @property
    def middle(self) -> np.ndarray:
        return 0.5 * (self.points.min(axis=0) + self.points.max(axis=0)) if self.kind == POINTS else self.t

    def support(self, n: np.ndarray) -> np.ndarray:
        """(3,) a point farthest along n."""
        if self.kind == POINTS:
            length = math.hypot(*n.tolist())
            farthest = self.points[int(np.argmax(_product(self.points.T, n)))]
            return farthest + (n * (self.radius / length) if length else 0.0)
        w = _product(self.R, n)
        if self.kind == ELLIPSOID:
            u = self.sizes**2 * w
            return self.t + _product(self.R.T, u / (math.sqrt(float(_product(u, w))) or 1.0))
        radius, half = self.sizes[:2].tolist()
        across = math.hypot(w[0], w[1])
        x, y = (radius * float(c) / across if across else 0.0 for c in w[:2])
        if self.kind == CONE and 2.0 * half * w[2] >= radius * across:
            x, y, z = 0.0, 0.0, half
        else:
            z = half if w[2] > 0.0 and self.kind == CYLINDER else -half
        return self.t + _product(self.R.T, (x, y, z))


# --- a point ------------------------------------------------------------------------------------


def common_point(
    A: ExactPart, B: ExactPart, points: Sequence[np.ndarray] = (), normals: Sequence[np.ndarray] = ()
) -> WeightedPoint | None:
    """A common point of A and B; ``None`` where the search ends without a point.

    points, normals : (3,) doubles, a point near both and directions from B to A, tried first.
    """
    if any(part.kind == HALFSPACE and not any(part.plane[0]) for part in (A, B)):
        return None
    near = [weighted(x) for x in points if np.isfinite(x).all()]
    return next((x for x in _candidates(A, B, near, normals) if flaw_of_point(A, B, x) is None), None)


def _candidates(
    A: ExactPart, B: ExactPart, near: list[WeightedPoint], normals: Sequence[np.ndarray]
) -> Iterator[WeightedPoint]:
    yield from near
    if A.kind == B.kind == HALFSPACE:
        yield from _points_of_planes(A, B)
        return
    if A.kind == B.kind == POINTS:
        yield _between(A, B)
        return
    middles = [weighted(RoughPart(part).middle) for part in (A, B) if part.kind != HALFSPACE]
    yield from middles
    if HALFSPACE in (A.kind, B.kind):
        yield from _deepest(A, B) if A.kind == HALFSPACE else _deepest(B, A)
        return
    point = _settled(A, B, normals, (near or middles)[0]).point
    if point is not None:
        yield point
    yield from _on_ends(A, B, (near or middles)[0])
    yield from _on_ends(B, A, (near or middles)[0])


def _on_ends(A: ExactPart, B: ExactPart, near: WeightedPoint) -> Iterator[WeightedPoint]:
    """Points in the planes of the ends of a cylinder or cone A, for a flat contact without a point of its own: between
    any two of ``near``, the middles of ends, the vertices of B nearest the plane, and the feet of ``near`` on the edges
    between these, all projected along A's axis.
    """
    if A.kind not in (CYLINDER, CONE):
        return
    for height in _heights(A):
        outwards = in_integers([c * (1 if height > 0 else -1) for c in _inverse_rows(A)[2]])
        x: list[Exact3] = [_exact(near), A.at((_ZERO, _ZERO, height))]
        if B.kind == POINTS:
            lowest = [_in_metres(B.vertices, k) for k in B.vertices.lowest_along(outwards)[:_TIED]]
            x += lowest + [_foot(x[0], p, q) for p, q in combinations(lowest, 2)]
        elif B.kind in (CYLINDER, CONE):
            x += [B.at((_ZERO, _ZERO, h)) for h in _heights(B)]
        ends = [_projected(A, point, height) for point in x]
        shares = list(_SHARES)
        if B.kind != POINTS:
            shares.append(Fraction(A.params[0]) / (Fraction(A.params[0]) + Fraction(B.params[0])))
        for p, q in permutations(ends, 2):
            for share in shares:
                yield in_lowest_terms([a + share * (b - a) for a, b in zip(p, q)])


def _heights(part: ExactPart) -> list[Fraction]:
    """Of the ends along the axis of a cylinder or cone."""
    half = Fraction(part.params[1])
    return [-half, half] if part.kind == CYLINDER else [-half]


def _inverse_rows(part: ExactPart) -> list[Exact3]:
    """Rows of R⁻¹, times det R."""
    (r0, r1, r2), _ = part.placement
    return list(zip(cross(r1, r2), cross(r2, r0), cross(r0, r1)))


def _projected(part: ExactPart, x: Exact3, height: Fraction) -> Exact3:
    """The point of the plane at a height of a part's axis below or above x, along the axis."""
    rows, t = part.placement
    inverse, det = _inverse_rows(part), inner(rows[0], cross(rows[1], rows[2]))
    away = minus(x, t)
    return part.at((inner(inverse[0], away) / det, inner(inverse[1], away) / det, height)) if det else x


def _foot(x: Exact3, p: Exact3, q: Exact3) -> Exact3:
    """The point of the line through p and q nearest x."""
    d = minus(q, p)
    share = inner(minus(x, p), d) / (inner(d, d) or 1)
    return p[0] + share * d[0], p[1] + share * d[1], p[2] + share * d[2]


def _exact(x: WeightedPoint) -> Exact3:
    return Fraction(x[0], x[3]), Fraction(x[1], x[3]), Fraction(x[2], x[3])


def _points_of_planes(A: ExactPart, B: ExactPart) -> Iterator[WeightedPoint]:
    """On the plane of a half-space, and on both: s m + t n, s and t by Cramer's rule."""
    (m, c), (n, d) = A.plane, B.plane
    mm, mn, nn = inner(m, m), inner(m, n), inner(n, n)
    yield in_lowest_terms([c * x / mm for x in m])
    yield in_lowest_terms([d * x / nn for x in n])
    det = mm * nn - mn * mn
    if det:
        s, t = (c * nn - d * mn) / det, (d * mm - c * mn) / det
        yield in_lowest_terms([s * x + t * y for x, y in zip(m, n)])


def _deepest(halfspace: ExactPart, body: ExactPart) -> Iterator[WeightedPoint]:
    """Points of a body nearer and nearer the point deepest in a half-space; roots rounded up keep the points inside.

    Where the body touches exactly, the reach is a fraction, so the root is a fraction, too.
    """
    if body.kind == POINTS:
        yield _lowest(halfspace, body)
        return
    rows, t = body.placement
    w = tuple(-inner(halfspace.plane[0], column) for column in zip(*rows))
    sizes = [Fraction(v) for v in body.params]
    stretched = [(a * a * x, (a * x) ** 2) for a, x in zip(sizes, w)]
    if body.kind != ELLIPSOID:
        stretched = [(sizes[0] * x, x * x) for x in w[:2]]
    square = sum((square for _, square in stretched), Fraction(0))
    for digits in _ROOT_BITS:
        root = root_no_less(square, digits)
        rim = [x / root if root else Fraction(0) for x, _ in stretched]
        heights = [Fraction(0)] if body.kind == ELLIPSOID else [sizes[1], -sizes[1]]
        for height in heights:
            tip = body.kind == CONE and height > 0
            u = rim if body.kind == ELLIPSOID else [*((Fraction(0),) * 2 if tip else rim), height]
            yield in_lowest_terms([inner(row, u) + s for row, s in zip(rows, t)])


def _lowest(halfspace: ExactPart, body: ExactPart) -> WeightedPoint:
    """The lowest vertex; of a vertex above the plane its foot on the plane."""
    n, offset = halfspace.plane
    x = _in_metres(body.vertices, body.vertices.first_along(in_integers(n)))
    above = max(inner(n, x) - offset, Fraction(0)) / inner(n, n)
    return in_lowest_terms([c - above * m for c, m in zip(x, n)])


def _between(A: ExactPart, B: ExactPart) -> WeightedPoint:
    """The point that cuts the segment between the nearest points of two hulls as their radii are."""
    points_a, points_b, _ = common_vertices(A, B)
    pairs = nearest_vertex_pairs(points_a, points_b, [(0, 0)])
    away = [minus(points_a[i], points_b[j]) for i, j in pairs]
    carrier = nearest_to_origin(away).carrier
    weights = weights_towards_origin([away[k] for k in carrier]) or [1]
    near_a, near_b = (
        [
            sum((w * _in_metres(points, pairs[k][side])[axis] for w, k in zip(weights, carrier)), Fraction(0))
            / sum(weights)
            for axis in range(3)
        ]
        for side, points in enumerate((points_a, points_b))
    )
    radii = A.radius + B.radius
    share = A.radius / radii if radii else radii
    return in_lowest_terms([a + share * (b - a) for a, b in zip(near_a, near_b)])


def _in_metres(points: PlacedPoints, k: int) -> tuple[Fraction, Fraction, Fraction]:
    x, y, z = (c * Fraction(2) ** points.grid for c in points[k])
    return x, y, z


# --- the algebra of curved pairs ----------------------------------------------------------------


class _Settled(NamedTuple):
    """What the exact search proposes: a common point, or a direction from A to B that parts them."""

    point: WeightedPoint | None
    normal: Point | None


def _settled(A: ExactPart, B: ExactPart, normals: Sequence[np.ndarray], near: WeightedPoint) -> _Settled:
    entries = [[c for row in part.placement[0] for c in row] + list(part.placement[1]) for part in (A, B)]
    lengths = [x for row in entries for x in row[9:]]
    for part in (A, B):
        lengths += [part.radius, *(Fraction(v) for v in (part.params if part.kind != POINTS else ()))]
        lengths += [Fraction(v) for v in part.points_P.ravel().tolist()]
    units = integer_bodies.units_of(lengths, [x for row in entries for x in row[:9]])
    a, b = (_integer_body(part, row, units) for part, row in zip((A, B), entries))
    v = next((-n for n in normals if np.any(n) and np.isfinite(n).all()), RoughPart(B).middle - RoughPart(A).middle)
    i, j, k = (int(c) for c in np.rint(v / (np.abs(v).max() or 1.0) * 2.0**60))
    p, q, r = (c << units.world for c in near[:3])
    decision = curved_pair.settle_pair(a, b, (i, j, k), (p, q, r, near[3]))
    x = decision.point
    point = x and in_lowest_terms([Fraction(c, x[3] << units.world) for c in x[:3]])
    return _Settled(point, decision.normal)


def _integer_body(part: ExactPart, entries: list[Fraction], units):
    pose = integer_bodies.IntegerPose(entries, units)
    if part.kind != POINTS:
        count = 3 if part.kind == ELLIPSOID else 2
        sizes = [integer_bodies.whole(Fraction(v), units.length) for v in part.params[:count]]
        return integer_bodies.CurvedBody(part.kind, sizes, pose)
    points = [
        pose.placed([integer_bodies.whole(Fraction(x), units.length) for x in p])[:3] for p in part.points_P.tolist()
    ]
    hull = exact_hull.convex_hull(part.points_P)
    triangles = hull.facets.tolist()
    edges = {(min(i, j), max(i, j)) for corners in triangles for i, j in zip(corners, corners[1:] + corners[:1])}
    if hull.dimension == 1:
        ends = hull.vertices[np.lexsort(part.points_P[hull.vertices].T)[[0, -1]]]
        edges = {(int(ends[0]), int(ends[1]))}
    radius = integer_bodies.whole(part.radius, units.length) << units.rotation
    return integer_bodies.SweptPoints(points, radius, triangles, sorted(edges), hull.dimension == 3)


# --- points as integers -------------------------------------------------------------------------


def weighted(x: Sequence[float] | np.ndarray) -> WeightedPoint:
    """Doubles as integers over their common denominator."""
    return in_lowest_terms([Fraction(float(c)) for c in x])
