"""GJK in decimals, with more digits until A and B have a common point or a strictly separating direction.

Doubles stop at 2⁻⁵³ of the size. Here the same search (Gilbert, Johnson and Keerthi 1988) goes on in 40, 80 and 160
digits d, with supports of bodies that are smaller by 10^(−d/2), so that convex combinations of supports lie within
the bodies though they are rounded. A direction is rounded to integers, and `integer_bodies.is_apart_along` says
exactly whether the direction separates; a point counts where both bodies hold the point. Bodies touching exactly give
neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Context, Decimal, localcontext
from itertools import combinations
from typing import NamedTuple

from collide.curved.shape_kinds import CYLINDER, ELLIPSOID
from collide.narrowphase.exact_curved.integer_bodies import (
    CurvedBody,
    IntegerBody,
    SweptPoints,
    Vector,
    WorldPoint,
    is_apart_along,
    opposite,
)

#: Supports for each number of digits: a rim at a pole gains a digit in ten supports.
_ROUNDS = {40: 160, 80: 500, 160: 1500}
_ZERO, _ASIDE = Decimal(0), Decimal(2) ** -26
Point = tuple[Decimal, Decimal, Decimal]


class Proposal(NamedTuple):
    """A common point, or a separating direction from A to B; neither."""

    point: WorldPoint | None
    normal: Vector | None


def search(A: IntegerBody, B: IntegerBody, n: Vector) -> Proposal:
    """n : a direction from A to B, to begin with."""
    for digits in _ROUNDS:
        with localcontext(Context(prec=digits)):
            proposal = _search(A, B, n, digits)
        if proposal.point or proposal.normal:
            return proposal
    return Proposal(None, None)


def _search(A: IntegerBody, B: IntegerBody, n: Vector, digits: int) -> Proposal:
    shrink = 1 - Decimal(10) ** (-digits // 2)
    sides = _Supports(A, shrink), _Supports(B, shrink)
    v: Point = tuple(Decimal(-x) for x in n)  # type: ignore[assignment]
    if not any(v):
        v = (Decimal(1), _ZERO, _ZERO)
    pairs = list({(sides[0].support(_negative(u)), sides[1].support(u)) for u in _beside(v)})
    for k in range(_ROUNDS[digits]):
        direction = _integers_of(v, digits)
        if is_apart_along(A, B, opposite(direction)):
            return Proposal(None, opposite(direction))
        a, b = sides[0].support(_negative(v)), sides[1].support(v)
        if (a, b) in pairs:
            if k:
                break
            pairs.remove((a, b))
        pairs.append((a, b))
        pairs, weights = _nearest(pairs)
        v = _mixed([_minus(p, q) for p, q in pairs], weights)
        if len(pairs) >= 3 or not any(v):
            point = _world_point(_mixed([p for p, _ in pairs], weights), digits)
            if A.holds(point) and B.holds(point):
                return Proposal(point, None)
            if len(pairs) == 4 or not any(v):
                break
    return Proposal(None, None)


def _beside(v: Point) -> list[Point]:
    """Two directions as far beside v as doubles may be: supports along them begin a small simplex about the optimum."""
    i = min(range(3), key=lambda k: abs(v[k]))
    across = [_ZERO] * 3
    across[(i + 1) % 3], across[(i + 2) % 3] = v[(i + 2) % 3], -v[(i + 1) % 3]
    return [tuple(x + s * y for x, y in zip(v, across)) for s in (_ASIDE, -_ASIDE)]  # type: ignore[misc]


class _Supports:
    """Supports of a body, in decimals, moved a little to its middle."""

    def __init__(self, body: IntegerBody, shrink: Decimal):
        self.body, self.shrink = body, shrink
        self.middle = tuple(Decimal(x) / body.centre[3] for x in body.centre[:3])

    def support(self, n: Point) -> Point:
        x = _support_of_points(self.body, n) if isinstance(self.body, SweptPoints) else _support_of_curved(self.body, n)
        return tuple(m + (c - m) * self.shrink for m, c in zip(self.middle, x))  # type: ignore[return-value]


def _support_of_points(body: SweptPoints, n: Point) -> Point:
    best = max(body.points, key=lambda x: _dot(n, x))
    share = Decimal(body.radius) / _dot(n, n).sqrt()
    return tuple(Decimal(x) + share * c for x, c in zip(best, n))  # type: ignore[return-value]


def _support_of_curved(body: CurvedBody, n: Point) -> Point:
    pose = body.pose
    w = [_dot(n, column) for column in pose.columns]
    sizes = [Decimal(s) for s in body.sizes]
    if body.kind == ELLIPSOID:
        u = [a * a * x for a, x in zip(sizes, w)]
        length = _dot(u, w).sqrt()
        u = [x / length if length else _ZERO for x in u]
    else:
        radius, half = sizes[:2]
        across = (w[0] * w[0] + w[1] * w[1]).sqrt()
        rim = [radius * x / across if across else _ZERO for x in w[:2]]
        if body.kind == CYLINDER:
            u = [*rim, half if w[2] > 0 else -half]
        else:
            u = [_ZERO, _ZERO, half] if half * w[2] >= radius * across - half * w[2] else [*rim, -half]
    return tuple(_dot(row, u) + p for row, p in zip(pose.rows, pose.p))  # type: ignore[return-value]


def _nearest(pairs: list[tuple[Point, Point]]) -> tuple[list[tuple[Point, Point]], list[Decimal]]:
    """The subset of pairs whose hull of differences is nearest 0, and its weights: by all subsets, the last pair in."""
    points = [_minus(p, q) for p, q in pairs]
    best: tuple[Decimal, tuple[int, ...], list[Decimal]] | None = None
    last = len(pairs) - 1
    for size in range(1, len(pairs) + 1):
        for subset in combinations(range(len(pairs)), size):
            if last not in subset and size < len(pairs):
                continue
            weights = _weights([points[i] for i in subset])
            if weights is None or min(weights) < 0:
                continue
            v = _mixed([points[i] for i in subset], weights)
            square = _dot(v, v)
            if best is None or square < best[0]:
                best = square, subset, weights
    assert best is not None  # a single point has the weight 1
    return [pairs[i] for i in best[1]], best[2]


def _weights(points: Sequence[Point]) -> list[Decimal] | None:
    """Weights of the point nearest 0 of the flat through points; None where these are no simplex."""
    n = len(points)
    if n == 1:
        return [Decimal(1)]
    edges = [_minus(p, points[0]) for p in points[1:]]
    rows = [[_dot(e, f) for f in edges] + [-_dot(e, points[0])] for e in edges]
    for k in range(n - 1):
        pivot = max(range(k, n - 1), key=lambda i: abs(rows[i][k]))
        if not rows[pivot][k]:
            return None
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(n - 1):
            if i != k:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k])]
    shares = [rows[k][-1] / rows[k][k] for k in range(n - 1)]
    return [1 - sum(shares, _ZERO), *shares]


def _mixed(points: Sequence[Point], weights: Sequence[Decimal]) -> Point:
    return tuple(sum((w * p[i] for w, p in zip(weights, points)), _ZERO) for i in range(3))  # type: ignore[return-value]


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _negative(v: Point) -> Point:
    return -v[0], -v[1], -v[2]


def _dot(a, b) -> Decimal:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _integers_of(v: Point, digits: int) -> Vector:
    """The direction of v, rounded to integers of so many digits."""
    exponent = digits - max(x.adjusted() for x in v if x)
    return tuple(int(x.scaleb(exponent)) for x in v)  # type: ignore[return-value]


def _world_point(p: Point, digits: int) -> WorldPoint:
    """A point, rounded to a decimal of so many digits."""
    exponent = max(digits - max((x.adjusted() for x in p if x), default=0), 0)
    return (*(int(x.scaleb(exponent)) for x in p), 10**exponent)  # type: ignore[return-value]
