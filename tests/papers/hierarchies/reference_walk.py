"""The walk of Barba and Langerman (section 5) in rational numbers: slow, plain, and checked in every round.

L. Barba and S. Langerman, "Optimal detection of intersections between convex polyhedra". Nothing here is
shared with the kernels of `collide.papers.hierarchies`: hulls, hierarchies, the polar and the small
linear programs are made from `Fraction`, and only for bodies of a few dozen vertices.

The words of the paper become numbers so. A plane that takes part in an invariant is ρ(z) for a point z of Q_j
(primal) or ρ(x) for a point x of P_i (polar), and "separates" is an inequality of scalar products:

separation          z ∈ Q_j with ⟨p, z⟩ > 1 for every vertex p of P_i
inverse separation  x ∈ P_i with ⟨x, q⟩ ≤ 1 for every vertex q of Q_j
star, primal        z_φ ∈ Q_j with ⟨p, z_φ⟩ > 1 for every vertex p ≠ p* of P_i
star, polar         x_γ ∈ P_i with ⟨x_γ, q⟩ ≤ 1 for every vertex q ≠ q* of Q_j

The first and third are strict here, weak in the paper: at touching both of its invariants hold, and a walk that
ends with the weak first one cannot tell touching from apart. Strict against weak is exactly the two cases of a
matrix game, and the steps keep the strictness (see `_across`).
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from typing import NamedTuple

Vector = tuple[Fraction, Fraction, Fraction]
ONE = Fraction(1)


def dot(a, b) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a, b) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def cross(a, b) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def blend(weights, points) -> Vector:
    return tuple(sum((w * p[k] for w, p in zip(weights, points)), Fraction(0)) for k in range(3))  # type: ignore[return-value]


def between(a, b, t) -> Vector:
    """The point a + t (b − a)."""
    return tuple(x + t * (y - x) for x, y in zip(a, b))  # type: ignore[return-value]


def exact(points) -> list[Vector]:
    return [tuple(Fraction(float(c)) for c in p) for p in points]  # type: ignore[misc]


# --- hulls, hierarchies, polars -----------------------------------------------------------------


def triangles(points: list[Vector], ids) -> list[tuple[int, int, int]]:
    """Facets of the hull of points[ids], counter-clockwise from outside, coplanar ones in several triangles.

    Empty where the points are flat. A point joins where it is strictly beyond a triangle; a triangle it is level
    with stays, and new ones continue it.
    """
    ids = list(ids)
    start = _spanning(points, ids)
    if len(start) < 4:
        return []
    a, b, c, d = start
    if dot(cross(minus(points[b], points[a]), minus(points[c], points[a])), minus(points[d], points[a])) > 0:
        b, c = c, b
    faces = {(a, b, c), (a, c, d), (a, d, b), (b, d, c)}
    for v in ids:
        if v in start:
            continue
        seen = {f for f in faces if _above(points, f, points[v]) > 0}
        edges = {e for x, y, z in seen for e in ((x, y), (y, z), (z, x))}
        faces -= seen
        faces |= {(x, y, v) for x, y in edges if (y, x) not in edges}
    return sorted(faces)


def _above(points, face, p) -> Fraction:
    a, b, c = (points[k] for k in face)
    return dot(cross(minus(b, a), minus(c, a)), minus(p, a))


def _spanning(points, ids) -> list[int]:
    chosen = [ids[0]]
    for v in ids[1:]:
        edges = [minus(points[k], points[chosen[0]]) for k in (*chosen[1:], v)]
        if len(edges) == 1:
            independent = any(edges[0])
        elif len(edges) == 2:
            independent = any(cross(*edges))
        else:
            independent = dot(cross(edges[0], edges[1]), edges[2]) != 0
        if independent:
            chosen.append(v)
            if len(chosen) == 4:
                break
    return chosen


class Level(NamedTuple):
    """One polyhedron of a hierarchy: its vertices, and for each its neighbours in the 1-skeleton."""

    points: list[Vector]
    ring: dict[int, list[int]]

    def vertices(self) -> list[Vector]:
        return [self.points[v] for v in self.ring]


def level_of(points: list[Vector], ids) -> Level:
    ring: dict[int, set[int]] = {}
    for a, b, c in triangles(points, ids):
        for x, y in ((a, b), (b, c), (c, a)):
            ring.setdefault(x, set()).add(y)
            ring.setdefault(y, set()).add(x)
    return Level(points, {v: sorted(ring[v]) for v in sorted(ring)})


def hierarchy(points: list[Vector], degree: int = 8, ids=None) -> list[Level]:
    """P_1 ⊇ P_2 ⊇ … ⊇ P_k, a tetrahedron (A1–A4): independent sets of small degree are taken away.

    ids : of the points that count. [] where they are flat.
    """
    level = level_of(points, range(len(points)) if ids is None else ids)
    if not level.ring:
        return []
    levels = [level]
    while len(level.ring) > 4:
        taken: set[int] = set()
        for bound in (degree, len(points)):
            for v in sorted(level.ring, key=lambda v: len(level.ring[v])):
                if len(level.ring[v]) > bound or taken & set(level.ring[v]) or len(level.ring) - len(taken) <= 4:
                    continue
                if len(_spanning(points, [u for u in level.ring if u not in taken and u != v])) == 4:
                    taken.add(v)
            if taken:
                break
        level = level_of(points, [v for v in level.ring if v not in taken])
        levels.append(level)
    return levels


def inner_point(points: list[Vector]) -> Vector:
    """The centroid of a tetrahedron of the body's vertices: an interior point."""
    chosen = [points[k] for k in _spanning(points, list(range(len(points))))]
    return blend([Fraction(1, 4)] * 4, chosen)


def polar(points: list[Vector]) -> list[Vector]:
    """Vertices of ρ0 of a body with the origin inside: n/b for every facet plane ⟨n, x⟩ = b (section 3)."""
    found = {}
    for a, b, c in triangles(points, range(len(points))):
        n = cross(minus(points[b], points[a]), minus(points[c], points[a]))
        height = dot(n, points[a])
        assert height > 0, "the origin lies inside"
        found[tuple(x / height for x in n)] = True
    return list(found)  # type: ignore[arg-type]


# --- the small linear program -------------------------------------------------------------------


def game(P: list[Vector], Q: list[Vector]) -> tuple[Fraction, Vector, Vector]:
    """(value, x, z): the value of min over x ∈ CH(P) of max over z ∈ CH(Q) of ⟨x, z⟩, with optimal x and z.

    CH(P) and ρ0(Q) meet if and only if the value is at most 1. It proves itself, and is checked here: every
    column against x and every row against z give the value.
    """
    rows = [[dot(p, q) for p in P] for q in Q]
    shift = 1 - min(min(row) for row in rows)
    n = len(P)
    # Maximise Σ y, (M + shift) y ≤ 1, y ≥ 0, by the simplex method with Bland's rule.
    table = [
        [c + shift for c in row] + [ONE if r == k else Fraction(0) for r in range(len(Q))] + [ONE]
        for k, row in enumerate(rows)
    ]
    costs = [-ONE] * n + [Fraction(0)] * (len(Q) + 1)
    basis = [n + k for k in range(len(Q))]
    while True:
        entering = next((c for c in range(n + len(Q)) if costs[c] < 0), None)
        if entering is None:
            break
        ratios = [(row[-1] / row[entering], basis[k], k) for k, row in enumerate(table) if row[entering] > 0]
        _, _, k = min(ratios)
        pivot = table[k][entering]
        table[k] = [c / pivot for c in table[k]]
        for r, row in enumerate(table):
            if r != k and row[entering]:
                factor = row[entering]
                table[r] = [c - factor * d for c, d in zip(row, table[k])]
        factor = costs[entering]
        costs = [c - factor * d for c, d in zip(costs, table[k])]
        basis[k] = entering
    total = costs[-1]
    weights = [Fraction(0)] * n
    for k, b in enumerate(basis):
        if b < n:
            weights[b] = table[k][-1] / total
    prices = [c / total for c in costs[n:-1]]
    x, z, value = blend(weights, P), blend(prices, Q), 1 / total - shift
    assert sum(weights) == sum(prices) == 1 and min(weights) >= 0 and min(prices) >= 0
    assert max(dot(x, q) for q in Q) == value == min(dot(p, z) for p in P)
    return value, x, z


# --- the walk -----------------------------------------------------------------------------------


class Round(NamedTuple):
    """What one round did: level indices after it (1 is the body itself), the case, and what it compared."""

    space: str
    case: str
    i: int
    j: int
    tests: int
    x: Vector | None
    z: Vector | None


class Walk:
    """P = P_levels[0] against R = ρ0(Q), Q = Q_levels[0]; both hierarchies end with a tetrahedron.

    refine : add ρ(γ) to P_i* and ρ(φ) to Q_j* as Case 2.2 of the paper does. The walk also works without: the
        invariants need z ∈ Q_j and x ∈ P_i, not z ∈ Q_j* and x ∈ P_i*.
    early : Case 1 already where the next level is beyond φ (⟨p, z⟩ > 1), not only where it is beyond π.
    weak : the separation invariant with ≥ 1, as the paper words it. Then a walk that ends with it may be at touching.
    check : assert all invariants in all rounds, against all vertices of the levels.
    """

    def __init__(
        self, P_levels: list[Level], Q_levels: list[Level], *, refine=True, early=False, weak=False, check=True
    ):
        self.P, self.Q, self.refine, self.early, self.weak, self.check = P_levels, Q_levels, refine, early, weak, check
        self.rounds: list[Round] = []
        self.missing = 0
        self.hit = self._walk()

    # Levels count from 1 in the paper; the lists from 0.
    def _walk(self) -> bool:
        self.i, self.j = len(self.P) - 1, len(self.Q) - 1
        self.P_star, self.Q_star = self.P[self.i].vertices(), self.Q[self.j].vertices()
        self.p_star = self.q_star = self.z_star = self.x_star = None
        self.z = self.x = None
        value, x, z = game(self.P_star, self.Q_star)
        self.separated = self._parts(value)
        if self.separated:
            self._set_plane(z, _lowest(self.P[self.i], z))
        else:
            self._set_inverse(x, _highest(self.Q[self.j], x))
        self._note("base", "", len(self.P_star) * len(self.Q_star))
        while True:
            if self.separated and self.i == 0:
                return False
            if not self.separated and self.j == 0:
                return True
            if self.separated:
                self._primal()
            else:
                self._polar()

    def _parts(self, value) -> bool:
        return value > 1 or (self.weak and value == 1)

    def _set_plane(self, z, v):
        self.separated, self.z, self.v, self.x = True, z, v, None

    def _set_inverse(self, x, w):
        self.separated, self.x, self.w, self.z = False, x, w, None

    def _primal(self):
        """Section 5, "A walk in the primal space"."""
        z, v = self.z, self.v
        height = dot(self.P[self.i].points[v], z)
        self.i -= 1
        level = self.P[self.i]
        v = self._in_level(level, v, z)
        beyond = [u for u in (v, *level.ring[v]) if dot(level.points[u], z) < height]
        assert len(beyond) <= 1, "Lemma 4.2: one vertex at most lies beyond the plane"
        tests = len(level.ring[v])
        p = beyond[0] if beyond else v
        self.p_star, self.z_star = p, z
        self.P_star = [level.points[p], *(level.points[u] for u in level.ring[p])]
        if not beyond or (self.early and self._parts(dot(level.points[p], z))):  # Case 1
            self.v = p
            self._note("primal", "1", tests)
            return
        value, x, z_best = game(self.P_star, self.Q_star)
        tests += len(self.P_star) * len(self.Q_star)
        if self._parts(value):  # Case 2.1
            self._set_plane(_across(z, z_best, level.points[p], self.P_star[1:], 1), p)
            self._note("primal", "2.1", tests)
            return
        # Case 2.2: P_i* meets ρ0(Q_j*). The inverse separation, at q* of Q_j.
        if self.j == len(self.Q) - 1:
            self._set_inverse(x, _highest(self.Q[self.j], x))
        else:
            if self.refine:
                self.P_star.append(self.x_star)
            q = self.q_star
            ring = [self.Q[self.j].points[u] for u in self.Q[self.j].ring[q]]
            self._set_inverse(_across(self.x_star, x, self.Q[self.j].points[q], ring, -1), q)
        self._note("primal", "2.2", tests)

    def _polar(self):
        """The mirror image: Q for P, ≤ for >."""
        x, w = self.x, self.w
        height = dot(self.Q[self.j].points[w], x)
        self.j -= 1
        level = self.Q[self.j]
        w = self._in_level(level, w, tuple(-c for c in x))
        beyond = [u for u in (w, *level.ring[w]) if dot(level.points[u], x) > height]
        assert len(beyond) <= 1, "Lemma 4.2: one vertex at most lies beyond the plane"
        tests = len(level.ring[w])
        q = beyond[0] if beyond else w
        self.q_star, self.x_star = q, x
        self.Q_star = [level.points[q], *(level.points[u] for u in level.ring[q])]
        if not beyond or (self.early and dot(level.points[q], x) <= 1):
            self.w = q
            self._note("polar", "1", tests)
            return
        value, x_best, z = game(self.P_star, self.Q_star)
        tests += len(self.P_star) * len(self.Q_star)
        if not self._parts(value):
            self._set_inverse(_across(x, x_best, level.points[q], self.Q_star[1:], -1), q)
            self._note("polar", "2.1", tests)
            return
        if self.i == len(self.P) - 1:
            self._set_plane(z, _lowest(self.P[self.i], z))
        else:
            if self.refine:
                self.Q_star.append(self.z_star)
            p = self.p_star
            ring = [self.P[self.i].points[u] for u in self.P[self.i].ring[p]]
            self._set_plane(_across(self.z_star, z, self.P[self.i].points[p], ring, 1), p)
        self._note("polar", "2.2", tests)

    def _in_level(self, level: Level, v: int, z):
        """The vertex itself; where it is in no finer level (A3 does not hold) the lowest one there is."""
        if v in level.ring:
            return v
        self.missing += 1
        return _lowest(level, z)

    def _note(self, space: str, case: str, tests: int):
        self.rounds.append(Round(space, case, self.i + 1, self.j + 1, tests, self.x, self.z))
        if self.check:
            self._check()

    def _check(self):
        """Every invariant of the round, against every vertex of the levels reached."""
        P_i, Q_j = self.P[self.i], self.Q[self.j]
        if self.separated:
            assert in_hull(Q_j.vertices(), self.z), "separation: ρ(π) ∈ Q_j"
            if self.refine:
                assert in_hull(self.Q_star, self.z), "separation: π parts P_i from ρ0(Q_j*)"
            heights = [dot(p, self.z) for p in P_i.vertices()]
            assert self._parts(min(heights)), "separation: P_i lies beyond π"
            assert dot(P_i.points[self.v], self.z) == min(heights), "separation: π is tangent at v"
        else:
            assert in_hull(P_i.vertices(), self.x), "inverse separation: ρ(μ) ∈ P_i"
            if self.refine:
                assert in_hull(self.P_star, self.x), "inverse separation: μ parts Q_j from ρ∞(P_i*)"
            heights = [dot(self.x, q) for q in Q_j.vertices()]
            assert max(heights) <= 1, "inverse separation: Q_j lies on the inner side of μ"
            assert dot(self.x, Q_j.points[self.w]) == max(heights), "inverse separation: μ is tangent at w"
        if self.i < len(self.P) - 1:
            assert in_hull(Q_j.vertices(), self.z_star), "star: ρ(φ) ∈ Q_j"
            assert all(self._parts(dot(P_i.points[p], self.z_star)) for p in P_i.ring if p != self.p_star), "star: φ"
            assert P_i.points[self.p_star] in self.P_star
        if self.j < len(self.Q) - 1:
            assert in_hull(P_i.vertices(), self.x_star), "star: ρ(γ) ∈ P_i"
            assert all(dot(self.x_star, Q_j.points[q]) <= 1 for q in Q_j.ring if q != self.q_star), "star: γ"
            assert Q_j.points[self.q_star] in self.Q_star
        assert all(in_hull(P_i.vertices(), p) for p in self.P_star) and all(
            in_hull(Q_j.vertices(), q) for q in self.Q_star
        )


def _lowest(level: Level, z) -> int:
    return min(level.ring, key=lambda v: dot(level.points[v], z))


def _highest(level: Level, x) -> int:
    return max(level.ring, key=lambda v: dot(level.points[v], x))


def _across(start, end, apex, ring, sign):
    """A point of the segment from start to end for which the apex is extreme among its ring, as far as it goes.

    sign 1: lowest, and all of apex and ring stay above 1 where they are at the end, and the ring at the start.
    sign −1: highest, and at most 1. This is the plane tangent to the cone κ at its apex that the paper computes
    "in constant time": at the start the apex is extreme (it is the one beyond the old plane), at the end the level
    is right, and where the apex meets the first of its ring both hold. The ring's level is concave along the
    segment (sign −1: convex), so it keeps its bound, strictly where both ends have it strictly.
    """
    t = ONE
    a, b = sign * dot(apex, start), sign * dot(apex, end)
    for u in ring:
        # sign·⟨u − apex, ·⟩ must not become negative.
        c, d = sign * dot(u, start) - a, sign * dot(u, end) - b
        assert c >= 0, "the apex is extreme at the start"
        if d < 0:
            t = min(t, c / (c - d))
    return between(start, end, t)


def in_hull(points: list[Vector], x: Vector) -> bool:
    """Whether x ∈ CH(points), by Carathéodory: some simplex of the points holds it. Flat sets as well."""
    distinct = sorted(set(points))
    for count in (1, 2, 3, 4):
        for corners in combinations(distinct, count):
            if _in_simplex(corners, x):
                return True
    return False


def _in_simplex(corners, x) -> bool:
    edges = [minus(c, corners[0]) for c in corners[1:]]
    y = minus(x, corners[0])
    if not edges:
        return not any(y)
    gram = [[dot(e, f) for f in edges] for e in edges]
    whole = _determinant(gram)
    if whole == 0:
        return False
    right = [dot(e, y) for e in edges]
    weights = [
        _determinant([[right[r] if c == k else row[c] for c in range(len(edges))] for r, row in enumerate(gram)])
        / whole
        for k in range(len(edges))
    ]
    return min(weights) >= 0 and sum(weights) <= 1 and blend(weights, edges) == y


def _determinant(m):
    if len(m) == 1:
        return m[0][0]
    return sum((-1) ** k * m[0][k] * _determinant([row[:k] + row[k + 1 :] for row in m[1:]]) for k in range(len(m)))


def walk(P: list[Vector], R: list[Vector], **options) -> Walk | None:
    """The walk of two point sets in one frame; None where one of them is flat. R plays the paper's R."""
    if len(_spanning(P, list(range(len(P))))) < 4 or len(_spanning(R, list(range(len(R))))) < 4:
        return None
    centre = inner_point(R)
    moved_R, moved_P = [minus(r, centre) for r in R], [minus(p, centre) for p in P]
    return Walk(hierarchy(moved_P), hierarchy(polar(moved_R)), **options)
