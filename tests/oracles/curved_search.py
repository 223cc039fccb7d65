"""Proposals for `curved_oracle.py`: GJK and EPA in decimal arithmetic.

Nothing here is trusted: bounds come from `separation`, `weighted` and `shell_depth`, whatever is proposed.
"""

from __future__ import annotations

import heapq
from decimal import Decimal
from typing import NamedTuple

from curved_cells import Cell, Vector, cross, dot, minus, norm, separation, shell_depth, times, vector, weighted

_ZERO, _INF = Decimal(0), Decimal("inf")
_NEGATIVE = Decimal(-1)
#: Of the size: gaps and depths of curved cells are known to this, where the search gets so far.
FINE = Decimal("1e-20")
#: Rounds of GJK, of EPA.
GJK_ROUNDS, EPA_ROUNDS = 120, 160


class Found(NamedTuple):
    """Of two cores: low ≤ signed distance ≤ high, n for low, and points of A ⊖ B about 0 with their pairs."""

    low: Decimal
    high: Decimal
    n: Vector
    corners: list


def search_cells(a: Cell, b: Cell, *, depths=True, enough=_ZERO, beyond=_INF, guesses=()):
    """(low, high, n) of two cells, radii included.   beyond : stop once they are proven farther apart than this."""
    reach = a.radius + b.radius
    found = gjk(a, b, enough=enough + reach if enough else _ZERO, beyond=beyond + reach)
    low, high, n = found.low, found.high, found.n
    for guess in guesses:
        guess = vector(guess)
        if any(guess) and (value := separation(a, b, guess)) > low:
            low, n = value, guess
    if low <= 0 and high <= (a.scale + b.scale) * Decimal("1e-40"):
        deep = epa(a, b, found.corners, rough=not depths)
        low, n = max((low, n), (deep.low, deep.n), key=lambda pair: pair[0])
        high = min(high, deep.high)
    return low - reach, high - reach, n


# --- apart --------------------------------------------------------------------------------------


def gjk(a: Cell, b: Cell, *, enough: Decimal, beyond: Decimal) -> Found:
    """The gap of two cores by the nearest point of a simplex of A ⊖ B, which one support point enters a round."""
    size = a.scale + b.scale
    fine = FINE * size if "points" != a.kind or "points" != b.kind else _ZERO
    start = (Decimal(1), Decimal("0.3"), Decimal("-0.2"))
    pair = a.support(start)[1], b.support(times(_NEGATIVE, start))[1]
    simplex, weights = [(minus(*pair), pair)], [Decimal(1)]
    v, low, best_n = simplex[0][0], -_INF, start
    for _ in range(GJK_ROUNDS):
        length = norm(v)
        if length <= size * Decimal("1e-70"):
            break
        n = times(_NEGATIVE, v)
        height_a, p = a.support(n)
        height_b, q = b.support(v)
        bound = -(height_a + height_b) / length
        if bound > low:
            low, best_n = bound, n
        if low > beyond or length <= enough or length - low <= max(fine, length * Decimal("1e-24")):
            break
        w = minus(p, q)
        nearer = nearest([*simplex, (w, (p, q))])
        if nearer is None or norm(nearer[2]) >= length:
            break
        simplex, weights, v = nearer
    p, q = weighted([pair for _, pair in simplex], weights)
    if low == -_INF:  # the cores share the point found first
        low = max(separation(a, b, n) for n in AXES)
    return Found(low, norm(minus(p, q)), best_n, simplex)


AXES: list[Vector] = [tuple(Decimal(s * (k == i)) for k in range(3)) for i in range(3) for s in (1, -1)]  # type: ignore[misc]


def nearest(points: list):
    """(points, weights, v): the point v of their hull nearest 0, of faces that have the last point as a corner."""
    last = points[-1]
    w = last[0]
    best = (dot(w, w), [last], [Decimal(1)], w)
    others = points[:-1]
    edges = [minus(p[0], w) for p in others]
    for i, e in enumerate(edges):  # edges
        square = dot(e, e)
        if square > 0:
            s = -dot(w, e) / square
            if 0 < s <= 1:
                best = _better(best, [last, others[i]], [1 - s, s])
    for i in range(len(edges)):  # triangles
        for j in range(i):
            n = cross(edges[i], edges[j])
            square = dot(n, n)
            if square > 0:
                s = dot(cross(edges[j], w), n) / square
                t = dot(cross(w, edges[i]), n) / square
                if s >= 0 and t >= 0 and s + t <= 1:
                    best = _better(best, [last, others[i], others[j]], [1 - s - t, s, t])
    if len(edges) == 3:
        volume = dot(edges[0], cross(edges[1], edges[2]))
        if volume:
            down = times(_NEGATIVE, w)
            s = [dot(down, cross(edges[(k + 1) % 3], edges[(k + 2) % 3])) / volume for k in range(3)]
            if min(s) >= 0 and sum(s) <= 1:
                best = _better(best, [last, *others], [1 - sum(s), *s])
    return best[1], best[2], best[3]


def _better(best, corners, weights):
    v = tuple(sum((s * c[0][k] for s, c in zip(weights, corners)), _ZERO) for k in range(3))
    square = dot(v, v)
    return (square, corners, weights, v) if square < best[0] else best


# --- overlapping --------------------------------------------------------------------------------


def epa(a: Cell, b: Cell, seed: list, *, rough: bool) -> Found:
    """The depth of two cores: a surface in A ⊖ B that grows where it is nearest 0.   rough : until 0 is inside."""
    size = a.scale + b.scale
    hull = _Surface(a, b, size)
    if not hull.begin([c[0] for c in seed]):
        return Found(-hull.least, _INF, hull.best_n, [])
    goal = _ZERO
    for _ in range(EPA_ROUNDS):
        facet = hull.lowest()
        if rough and facet[0] > 0:
            break
        goal = max(goal, facet[0])
        if not hull.grow(facet) or hull.least - facet[0] <= max(
            FINE * size * Decimal("1e-3"), hull.least * Decimal("1e-20")
        ):
            break
    depth = shell_depth(hull.corners, list(hull.facets), size)
    return Found(-hull.least, -depth if depth is not None else _INF, hull.best_n, [])


class _Surface:
    """Triangles with corners in A ⊖ B, closed and convex but for rounding; `least` the lowest support seen, over
    |n|."""

    def __init__(self, a: Cell, b: Cell, size: Decimal):
        self.a, self.b, self.size = a, b, size
        self.corners: list[Vector] = []
        self.facets: dict[tuple[int, int, int], tuple] = {}
        self.edges: dict[tuple[int, int], tuple[int, int, int]] = {}
        self.heap: list = []
        self.least, self.best_n = _INF, AXES[0]

    def support(self, n: Vector) -> Vector:
        height_a, p = self.a.support(n)
        height_b, q = self.b.support(times(_NEGATIVE, n))
        value = (height_a + height_b) / norm(n)
        if value < self.least:
            self.least, self.best_n = value, n
        return minus(p, q)

    def begin(self, seed: list[Vector]) -> bool:
        """Four corners that are no plane; False where A ⊖ B has no inside, and its normal is tried."""
        eps = Decimal("1e-60") * self.size
        found = [*seed, *(self.support(n) for n in AXES)]
        p = found[0]
        q = max(found, key=lambda c: dot(minus(c, p), minus(c, p)))
        e = minus(q, p)
        if norm(e) <= eps:
            return False
        r = max(found, key=lambda c: norm(cross(e, minus(c, p))))
        n = cross(e, minus(r, p))
        if norm(n) <= eps * norm(e):
            k = min(range(3), key=lambda k: abs(e[k]))
            for side in (cross(e, tuple(Decimal(int(i == k)) for i in range(3))),):
                for turned in (side, cross(e, side)):
                    found += [self.support(turned), self.support(times(_NEGATIVE, turned))]
            r = max(found, key=lambda c: norm(cross(e, minus(c, p))))
            n = cross(e, minus(r, p))
            if norm(n) <= eps * norm(e):
                return False
        found += [self.support(n), self.support(times(_NEGATIVE, n))]
        s = max(found, key=lambda c: abs(dot(n, minus(c, p))))
        height = dot(n, minus(s, p))
        if abs(height) <= eps * norm(n):
            return False
        self.corners = [p, q, r, s] if height < 0 else [p, r, q, s]
        for facet in ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)):
            self.add(facet)
        return True

    def add(self, facet: tuple[int, int, int]) -> None:
        i, j, k = facet
        p = self.corners[i]
        n = cross(minus(self.corners[j], p), minus(self.corners[k], p))
        length = norm(n)
        height = dot(n, p)
        self.facets[facet] = n, height, length
        for edge in ((i, j), (j, k), (k, i)):
            self.edges[edge] = facet
        heapq.heappush(self.heap, (height / length if length else -_INF, facet))

    def lowest(self):
        while self.heap[0][1] not in self.facets:
            heapq.heappop(self.heap)
        return self.heap[0]

    def grow(self, entry) -> bool:
        """Take in the support point beyond a facet; False where there is none."""
        n, height, length = self.facets[entry[1]]
        if not length:
            return False
        w = self.support(n)
        eps = Decimal("1e-70") * self.size
        if dot(n, w) - height <= eps * length:
            return False
        seen, todo = {entry[1]}, [entry[1]]
        while todo:
            i, j, k = todo.pop()
            for edge in ((j, i), (k, j), (i, k)):
                other = self.edges[edge]
                if other not in seen:
                    m, high, long = self.facets[other]
                    if dot(m, w) - high > eps * long:
                        seen.add(other)
                        todo.append(other)
        rim = []
        for i, j, k in seen:
            rim += [edge for edge in ((i, j), (j, k), (k, i)) if self.edges[edge[::-1]] not in seen]
        for facet in seen:
            del self.facets[facet]
            for edge in ((facet[0], facet[1]), (facet[1], facet[2]), (facet[2], facet[0])):
                del self.edges[edge]
        self.corners.append(w)
        for i, j in rim:
            self.add((i, j, len(self.corners) - 1))
        return True
