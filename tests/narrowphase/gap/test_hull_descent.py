"""Gaps across caps, where thousands of vertices are level: judged in fractions, and what they cost counted.

The oracle is Gilbert's algorithm in whole numbers: the nearest point of a simplex of vertex differences, exactly, and
the exactly lowest vertices along it, until none is lower. It shares nothing with the kernels but the problem.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from naive import rotation

import collide
from collide.kernels import address_of, entry, view_f64
from collide.narrowphase.gap.hull_descent import MAX_NEIGHBOURS, descend, lowest_of_all
from collide.numerics import double_double as dd
from collide.numerics.exact_dot_sign import PRODUCT_TERMS, exact_sign_of_dot
from collide.support.build_support_tree import build_support_tree
from collide.support.lazy_support_tree import LazySupportTree

EYE = np.eye(4)
TILTS = (0.0, 1e-17, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-9)


def prism(n: int, height: float = 1.0) -> np.ndarray:
    angle = np.arange(n // 2) * (2 * np.pi / (n // 2))
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.full(n // 2, 0.5 * height)])
    return np.concatenate([ring * (1.0, 1.0, -1.0), ring])


def body(kind: str, n: int) -> np.ndarray:
    """Points of a body whose lower side is level."""
    if kind == "cylinder":
        return prism(n)
    if kind == "plate":
        return prism(n, 0.02)
    if kind == "pyramids":  # two, base to base, the lower one cut off
        return np.concatenate([prism(n)[: n // 2], prism(n)[: n // 2] * 1.5 + (0, 0, 0.5), [[0, 0, 1.0]]])
    assert kind == "frustum"
    return prism(n) * np.where(np.arange(n)[:, None] < n // 2, (1.0, 1.0, 1.0), (0.4, 0.4, 1.0))


def tilted(angle: float, rng) -> np.ndarray:
    """A turn by the angle about an axis across z; the sine is the angle itself."""
    a = rng.uniform(0, 2 * np.pi)
    x, y = angle * np.cos(a), angle * np.sin(a)
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [-x, -y, 1.0]])


def placed(R: np.ndarray, p) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X


# --- the oracle -----------------------------------------------------------------------------------


def whole(points: np.ndarray, X: np.ndarray, bits: int = 400):
    """Posed points times 2^bits, as lists of Python integers."""
    one = 1 << bits // 2
    of_pose, of_points = ([[c.as_integer_ratio() for c in row] for row in rows.tolist()] for rows in (X[:3], points))
    assert all(one % denominator == 0 for rows in (of_pose, of_points) for row in rows for _, denominator in row)
    exact, given = ([[i * (one // n) for i, n in row] for row in rows] for rows in (of_pose, of_points))
    return [tuple(r[0] * x + r[1] * y + r[2] * z + r[3] * one for r in exact) for x, y, z in given]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def nearest_of(points):
    """(numerators, denominator, used): the point of a simplex nearest the origin, and the corners it takes."""
    for size in range(1, 5):
        for chosen in combinations(points, size):
            edges = [tuple(c - d for c, d in zip(w, chosen[0])) for w in chosen[1:]]
            found = weights_of(chosen[0], edges)
            if found is None:
                continue
            weights, total = found
            v = tuple(total * chosen[0][k] + sum(w * e[k] for w, e in zip(weights, edges)) for k in range(3))
            if all(dot(w, v) * total >= dot(v, v) for w in points):
                return v, total, list(chosen)
    raise AssertionError("no nearest point")


def weights_of(w, edges):
    """(numerators of the edges' weights, their denominator > 0) of the foot of the origin, if all weights are above
    0."""
    n = len(edges)
    G = [[dot(a, b) for b in edges] for a in edges]
    right = [-dot(w, e) for e in edges]
    total = determinant(G)
    if n and total == 0:
        return None
    weights = [determinant([[right[i] if j == k else G[i][j] for j in range(n)] for i in range(n)]) for k in range(n)]
    if any(x <= 0 for x in weights) or (n and sum(weights) >= total):
        return None
    return weights, total


def determinant(M):
    if not M:
        return 1
    return sum((-1) ** k * M[0][k] * determinant([row[:k] + row[k + 1 :] for row in M[1:]]) for k in range(len(M)))


def squared_gap(A: np.ndarray, X_WA: np.ndarray, B: np.ndarray, X_WB: np.ndarray, bits: int = 400) -> Fraction:
    """The square of the distance of two hulls that are apart."""
    a, b = whole(A, X_WA, bits), whole(B, X_WB, bits)
    size = float(1 << 60)
    rough_a, rough_b = (np.array([[c / (1 << bits) for c in p] for p in q]) for q in (a, b))
    d = rough_a.mean(axis=0) - rough_b.mean(axis=0)
    simplex = [tuple(x - y for x, y in zip(a[(rough_a @ d).argmin()], b[(rough_b @ d).argmax()]))]
    while True:
        v, total, simplex = nearest_of(simplex)
        assert any(v), "not apart"
        shift = max(max(abs(c) for c in v).bit_length() - 60, 0)
        d = np.array([float(c >> shift) for c in v]) / size
        lowest = []
        for exact, rough, sign in ((a, rough_a, 1), (b, rough_b, -1)):
            heights = sign * (rough @ d)
            near = np.flatnonzero(heights <= heights.min() + 1e-12 * np.abs(rough).max() * np.abs(d).max())
            lowest.append(min((exact[i] for i in near), key=lambda p: sign * dot(p, v)))
        w = tuple(x - y for x, y in zip(*lowest))
        if dot(w, v) * total >= dot(v, v):
            return Fraction(dot(v, v), (total << bits) ** 2)
        simplex.append(w)


def judge(r, square: Fraction, told: str) -> None:
    lower, middle, upper = (Fraction(float(x)) for x in (r.lower, r.distance, r.upper))
    assert 0 <= lower <= middle <= upper and lower**2 <= square <= upper**2, f"{told}: bracket missed, {r}"
    if r.certified:
        assert upper - lower <= 4 * Fraction(float(np.spacing(r.distance))), f"{told}: {r}"


# --- gaps -----------------------------------------------------------------------------------------


def pairs(kind_a: str, kind_b: str, turned: bool, n: int, seed: int):
    """(what, A, X_WA, B, X_WB): the lower side of A over the upper side of B, turned against it by next to nothing.

    turned : both bodies stand askew in their frames, so that rounding takes the vertices of caps out of their planes.
    """
    rng = np.random.default_rng([seed, n])
    for k, tilt in enumerate(TILTS):
        A, B = body(kind_a, n), body(kind_b, n + 2 * (k % 3)) * (1.0, 1.0, -1.0)
        spin = rng.uniform(0, 2 * np.pi)
        Z = np.array([[np.cos(spin), -np.sin(spin), 0.0], [np.sin(spin), np.cos(spin), 0.0], [0.0, 0.0, 1.0]])
        W = np.eye(3) if k % 2 else rotation(rng)
        gap = float(rng.choice([1e-3, 0.1, 3.0]))
        lowest, highest = A[:, 2].min(), B[:, 2].max()
        above = np.array([*rng.uniform(-0.7, 0.7, 2), highest + gap - lowest])
        Q, S = (rotation(rng), rotation(rng)) if turned else (np.eye(3), np.eye(3))
        X_WA, X_WB = placed(W @ tilted(tilt, rng) @ Z @ Q.T, W @ above), placed(W @ S.T, np.zeros(3))
        yield f"{kind_a}, {kind_b}, turned = {turned}, n = {n}, tilt {tilt}", A @ Q.T, X_WA, B @ S.T, X_WB


@pytest.mark.many(6)
@pytest.mark.parametrize(
    ("kind_a", "kind_b", "turned", "sizes"),
    [("cylinder", "cylinder", False, (40, 128, 512, 2048)), ("cylinder", "cylinder", True, (40, 128, 512, 2048)),
     ("plate", "cylinder", False, (40, 512)), ("pyramids", "plate", False, (128, 600)),
     ("frustum", "pyramids", False, (40, 512)), ("plate", "frustum", True, (128, 600))],
)
def test_gaps_across_caps(kind_a, kind_b, turned, sizes):
    for n in sizes:
        for what, A, X_WA, B, X_WB in pairs(kind_a, kind_b, turned, n, seed=3):
            shape_a, shape_b = collide.ConvexHull(A), collide.ConvexHull(B)
            r = collide.distance(shape_a, shape_b, X_WA, X_WB, signed=False)
            judge(r, squared_gap(A, X_WA, B, X_WB), what)
            assert r.certified, what


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_gaps_across_caps_of_thousands(turned):
    for what, A, X_WA, B, X_WB in list(pairs("cylinder", "cylinder", turned, 8192, seed=4))[::4]:
        r = collide.distance(collide.ConvexHull(A), collide.ConvexHull(B), X_WA, X_WB, signed=False)
        judge(r, squared_gap(A, X_WA, B, X_WB), what)
        assert r.certified, what


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "turned"), [("cylinder", False), ("cylinder", True), ("plate", False), ("pyramids", True)]
)
def test_gaps_of_a_cap_and_what_stands_askew_over_it(kind, turned):
    """Where the cap is level to the last bit doubles find the feature, and double-doubles the last digits: integers are
    not asked. Of a cap that is a hull of roundings doubles do not find the facet."""
    rng = np.random.default_rng(13)
    for n in (40, 128, 512, 2048, 8192):
        Q = rotation(rng) if turned else np.eye(3)
        A, B = body(kind, n) @ Q.T, prism(n) @ Q.T
        W = rotation(rng)
        X_WA, X_WB = placed(W @ Q.T, rng.normal(size=3)), []
        for _ in range(3):
            below = (*rng.uniform(-0.5, 0.5, 2), A[:, 2].min() - 3.0 if not turned else -4.0)
            X_WB.append(placed(rotation(rng), X_WA[:3, 3] + W @ below))
        r = collide.distance(collide.ConvexHull(A), collide.ConvexHull(B), X_WA, np.array(X_WB), signed=False)
        assert r.certified.all() and (turned or not r.rows["exact"].any()), f"n = {n}: {r.rows['exact']}"
        for k, X in enumerate(X_WB):
            judge(r[k], squared_gap(A, X_WA, B, X), f"{kind}, turned = {turned}, n = {n}, pose {k}")


def test_gaps_of_composed_poses():
    """Parts with poses of their own, whose products are not rounded: here the factors are such that they are exact."""
    rng = np.random.default_rng(7)
    for n in (40, 600):
        for tilt in TILTS[::2]:
            A, B = body("cylinder", n), body("frustum", n) * (1.0, 1.0, -1.0)
            parts = [
                collide.Compound([(collide.ConvexHull(p), placed(np.eye(3), (0, 0, h)))])
                for p, h in ((A, 1.0), (B, -0.5))
            ]
            W, p = rotation(rng), rng.normal(size=3)
            X_WA = placed(W @ tilted(tilt, rng), p + W @ (0.2, 0.1, 0.25))
            X_WB = placed(W, p)
            r = collide.distance(*parts, X_WA, X_WB)
            square = squared_gap(A + np.array([0, 0, 1.0]), X_WA, B - np.array([0, 0, 0.5]), X_WB)
            judge(r, square, f"n = {n}, tilt {tilt}")
            assert r.certified


# --- what it costs --------------------------------------------------------------------------------


@entry("int64(int64, int64, int64, int64, int64)")
def _descend(tree_at, first, direction_at, terms_at, out_at):
    out = view_f64(out_at, 2)
    g = dd.vec3_at(view_f64(direction_at, dd.STRIDE), 0)
    lowest = descend(tree_at, first, g, view_f64(terms_at, PRODUCT_TERMS))
    out[0], out[1] = lowest.height
    visited = int(lowest.n_visited)
    return (1 << 40) * visited + int(lowest.vertex) if lowest.proven else -1 - visited


@entry("int64(int64, int64, int64, int64, int64)")
def _lowest_of_all(coordinates_at, n, first, direction_at, out_at):
    out = view_f64(out_at, 2)
    g = dd.vec3_at(view_f64(direction_at, dd.STRIDE), 0)
    lowest = lowest_of_all(view_f64(coordinates_at, 3 * n), n, n, first, g)
    out[0], out[1] = lowest.height
    return (1 << 40) * int(lowest.n_visited) + int(lowest.vertex)


def directions(Q, rng):
    """Double-doubles nearly along z, or exactly, of a body that stands askew by Q."""
    for tilt in TILTS:
        a = rng.uniform(0, 2 * np.pi)
        g = Q @ (tilt * np.cos(a), tilt * np.sin(a), 1.0)
        low = g * rng.uniform(-1, 1, 3) * 2.0**-54
        yield np.stack([g, low], axis=1).ravel()


def exact_heights(points, g, first):
    g = [Fraction(g[2 * k]) + Fraction(g[2 * k + 1]) for k in range(3)]
    start = points[first].tolist()
    return [sum((Fraction(c) - Fraction(d)) * e for c, d, e in zip(p, start, g)) for p in points.tolist()]


@pytest.mark.own_kernels
@pytest.mark.parametrize("turned", [False, True])
def test_the_lowest_of_level_vertices(turned):
    """Exactly the lowest, for a number of neighbours that grows as the logarithm of the number of vertices."""
    rng = np.random.default_rng(11)
    terms, out = np.zeros(PRODUCT_TERMS), np.zeros(2)
    costs = {}
    for n in (400, 2048, 8192, 32768):
        Q = rotation(rng) if turned else np.eye(3)
        points = np.ascontiguousarray(prism(n) @ Q.T)
        tree = LazySupportTree(points).tree
        looked = []
        for g in directions(Q, rng):
            for first in rng.integers(n // 2, size=8).tolist():
                code = _descend(tree.address, first, address_of(g), address_of(terms), address_of(out))
                assert code >= 0, f"not proven after {-1 - code} neighbours: n = {n}, from {first} along {g.tolist()}"
                looked.append(code >> 40)
            if n > 8192:
                continue
            heights = exact_heights(points, g, first)
            vertex = code & ((1 << 40) - 1)
            assert heights[vertex] == min(heights), f"n = {n}, from {first} along {g.tolist()}"
            assert abs(sum(map(Fraction, out.tolist())) - heights[vertex]) <= Fraction(2.0**-98)
            columns = np.ascontiguousarray(points.T)
            code = _lowest_of_all(address_of(columns), n, first, address_of(g), address_of(out))
            assert abs(heights[code & ((1 << 40) - 1)] - min(heights)) <= Fraction(2.0**-98)
            assert abs(sum(map(Fraction, out.tolist())) - min(heights)) <= Fraction(2.0**-98)
        costs[n] = np.mean(looked), max(looked)
    for n, (mean, most) in costs.items():
        assert mean <= 14 * np.log2(n) and most <= 30 * np.log2(n) <= MAX_NEIGHBOURS, costs
    assert costs[32768][0] < 4 * costs[400][0], costs


@pytest.mark.own_kernels
def test_a_vertex_in_the_middle_of_a_facet_is_left_open():
    """All its neighbours are level, and edges do not lead to the other side. `quickhull` hardly makes any: this one
    does."""
    m = 20
    points = np.concatenate([prism(2 * m), [[0.0, 0.0, 0.5]]])
    k = np.arange(m)
    after = (k + 1) % m
    sides = [np.column_stack([k, after, after + m]), np.column_stack([k, after + m, k + m])]
    bottom = np.column_stack([np.zeros(m - 2, int), k[2:], k[1:-1]])
    facets = np.concatenate([*sides, bottom, np.column_stack([k + m, after + m, np.full(m, 2 * m)])])
    tree = build_support_tree(points, np.arange(2 * m + 1), facets)
    out, terms = np.zeros(2), np.zeros(PRODUCT_TERMS)
    for sign in (1.0, -1.0):
        g = np.array([0.0, 0.0, 0.0, 0.0, sign, 0.0])
        heights = exact_heights(points, g, 0)
        for first in range(2 * m + 1):
            code = _descend(tree.address, first, address_of(g), address_of(terms), address_of(out))
            assert code < 0 if first == 2 * m else heights[code & ((1 << 40) - 1)] == min(heights)


@pytest.mark.own_kernels
def test_products_that_vanish_are_left_open():
    points = prism(400)
    points[200:, :2] *= 1.0 - 2.0**-30
    tree, out, terms = LazySupportTree(points).tree, np.zeros(2), np.zeros(PRODUCT_TERMS)
    for g in (
        [0.0, 0.0, 1e-290, 0.0, 1e-300, 0.0],
        [0.0, 0.0, 1e-310, 0.0, 0.0, 0.0],
        [1e-200, 1e-220, -1e-310, 0.0, 1.0, 0.0],
    ):
        direction = np.array(g)
        heights = exact_heights(points, direction, 0)
        code = _descend(tree.address, 0, address_of(direction), address_of(terms), address_of(out))
        assert code < 0 or heights[code & ((1 << 40) - 1)] == min(heights), g


@pytest.mark.own_kernels
def test_exact_signs_of_sums_that_cancel():
    rng = np.random.default_rng(5)
    zeros = 0
    for k in range(400):
        a, g = (rng.normal(size=3) * 2.0 ** rng.integers(-40, 40, 3) for _ in range(2))
        if k % 2:  # a·g is nearly, or exactly, 0
            a[2] = -(a[0] * g[0] + a[1] * g[1]) / g[2]
        if k % 4 == 3:
            a, g = np.round(rng.normal(size=(2, 3)) * 8)
            a = np.cross(a, g)
        low = [v * rng.uniform(-1, 1, 3) * 2.0**-54 * (k % 4 != 3) for v in (a, g)]
        pairs = np.ascontiguousarray(np.concatenate([np.stack([a, low[0]], 1), np.stack([g, low[1]], 1)]).ravel())
        terms = np.zeros(PRODUCT_TERMS)
        sign = _exact_sign(address_of(pairs), address_of(terms))
        exact = [Fraction(pairs[2 * j]) + Fraction(pairs[2 * j + 1]) for j in range(6)]
        value = sum(x * y for x, y in zip(exact[:3], exact[3:]))
        assert sign == (value > 0) - (value < 0), pairs.tolist()
        zeros += value == 0
    assert zeros >= 50


@entry("int64(int64, int64)")
def _exact_sign(pairs_at, terms_at):
    p = view_f64(pairs_at, 12)
    certain, sign = exact_sign_of_dot(dd.vec3_at(p, 0), dd.vec3_at(p, dd.STRIDE), view_f64(terms_at, PRODUCT_TERMS))
    return sign if certain else 2
