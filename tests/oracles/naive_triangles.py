"""Triangles in Python integers: the reference for mesh queries, sharing nothing with the kernels.

Two hulls of three points share a point exactly if 0 is in the hull of their nine differences, and then, by
Carathéodory's theorem, in the hull of at most four of them that are affinely independent.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from math import lcm

import numpy as np


def world_points(points: np.ndarray, X: np.ndarray) -> list[list[Fraction]]:
    """R v + t of every point, as exact numbers."""
    exact = [[Fraction(v) for v in row] for row in X[:3].tolist()]
    given = [[Fraction(v) for v in point] for point in np.asarray(points, dtype=float).tolist()]
    of_pose = lcm(*(v.denominator for row in exact for v in row))
    of_points = lcm(*(v.denominator for point in given for v in point))
    rows = [[v.numerator * (of_pose // v.denominator) for v in row] for row in exact]
    shift = [row[3] * of_points for row in rows]
    whole = [[v.numerator * (of_points // v.denominator) for v in point] for point in given]
    return [[Fraction(inner(r, p) + t, of_pose * of_points) for r, t in zip(rows, shift)] for p in whole]


def as_integers(*lists: list[list[Fraction]]) -> list[list[list[int]]]:
    """All coordinates times one power of two."""
    denominator = max((x.denominator for points in lists for point in points for x in point), default=1)
    return [[[x.numerator * denominator // x.denominator for x in p] for p in points] for points in lists]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def inner(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def triangles_meet(P, Q) -> bool:
    """Whether the hulls of three integer points each share a point."""
    for k in range(3):
        if max(p[k] for p in P) < min(q[k] for q in Q) or max(q[k] for q in Q) < min(p[k] for p in P):
            return False
    if _beyond_the_plane(P, Q) or _beyond_the_plane(Q, P):
        return False
    d = [minus(p, q) for p in P for q in Q]
    return _holds_zero(d)


def _beyond_the_plane(P, Q) -> bool:
    """Whether all of Q is strictly on one side of the plane through P."""
    n = cross(minus(P[1], P[0]), minus(P[2], P[0]))
    heights = [inner(n, minus(q, P[0])) for q in Q]
    return min(heights) > 0 or max(heights) < 0


def _holds_zero(d) -> bool:
    if any(x == [0, 0, 0] for x in d):
        return True
    n = len(d)
    crosses = {(i, j): cross(d[i], d[j]) for i, j in combinations(range(n), 2)}
    for (i, j), c in crosses.items():
        if c == [0, 0, 0] and inner(d[i], d[j]) < 0:
            return True
    triple = {(i, j, k): inner(crosses[i, j], d[k]) for i, j, k in combinations(range(n), 3)}
    for (i, j, k), volume in triple.items():
        if volume == 0:
            normal = [a + b - c for a, b, c in zip(crosses[i, j], crosses[j, k], crosses[i, k])]
            if normal != [0, 0, 0] and (
                inner(normal, crosses[i, j]) >= 0
                and inner(normal, crosses[j, k]) >= 0
                and inner(normal, crosses[i, k]) <= 0
            ):
                return True
    for i, j, k, m in combinations(range(n), 4):
        parts = (triple[j, k, m], -triple[i, k, m], triple[i, j, m], -triple[i, j, k])
        whole = sum(parts)
        if (whole > 0 and min(parts) >= 0) or (whole < 0 and max(parts) <= 0):
            return True
    return False


def facet_pairs(vertices_a, faces_a, X_WA, vertices_b, faces_b, X_WB) -> list[tuple[int, int]]:
    """Sorted pairs of facets of two posed meshes that share a point, by brute force."""
    a, b = as_integers(world_points(vertices_a, X_WA), world_points(vertices_b, X_WB))
    return [
        (i, j)
        for i, f in enumerate(np.asarray(faces_a).tolist())
        for j, g in enumerate(np.asarray(faces_b).tolist())
        if triangles_meet([a[v] for v in f], [b[v] for v in g])
    ]


# --- distances ----------------------------------------------------------------------------------


def squared_distance(P, Q) -> Fraction:
    """Of the hulls of three integer points each, exactly: the least over pairs of features."""
    return Fraction(*_squared_distance(P, Q))


def _squared_distance(P, Q) -> tuple[int, int]:
    """The same as (numerator, denominator > 0)."""
    if triangles_meet(P, Q):
        return 0, 1
    found = [_point_segment(p, Q[j], Q[(j + 1) % 3]) for p in P for j in range(3)]
    found += [_point_segment(q, P[i], P[(i + 1) % 3]) for q in Q for i in range(3)]
    for i in range(3):
        for j in range(3):
            found.append(_segment_segment(P[i], P[(i + 1) % 3], Q[j], Q[(j + 1) % 3]))
    found += [_point_face(p, Q) for p in P] + [_point_face(q, P) for q in Q]
    best = found[0]
    for other in found[1:]:
        if other is not None and other[0] * best[1] < best[0] * other[1]:
            best = other
    return best


def _point_segment(p, a, b) -> tuple[int, int]:
    e, w = minus(b, a), minus(p, a)
    along, length = inner(w, e), inner(e, e)
    if along <= 0 or length == 0:
        return inner(w, w), 1
    if along >= length:
        w = minus(p, b)
        return inner(w, w), 1
    return inner(w, w) * length - along * along, length


def _segment_segment(a, b, c, d) -> tuple[int, int] | None:
    """Where the nearest points are inside both; None elsewhere."""
    e, f, w = minus(b, a), minus(d, c), minus(a, c)
    ee, ff, ef, ew, fw = inner(e, e), inner(f, f), inner(e, f), inner(e, w), inner(f, w)
    determinant = ee * ff - ef * ef
    if determinant == 0:
        return None
    s, t = ef * fw - ff * ew, ee * fw - ef * ew
    if not (0 <= s <= determinant and 0 <= t <= determinant):
        return None
    n = cross(e, f)
    return inner(n, w) ** 2, inner(n, n)


def _point_face(p, T) -> tuple[int, int] | None:
    u, v, w = minus(T[1], T[0]), minus(T[2], T[0]), minus(p, T[0])
    n = cross(u, v)
    square = inner(n, n)
    beta, gamma = inner(cross(w, v), n), inner(cross(u, w), n)
    if square == 0 or beta < 0 or gamma < 0 or beta + gamma > square:
        return None
    return inner(n, w) ** 2, square


def _box(P):
    return [(min(x), max(x)) for x in zip(*P)]


def _boxes_apart(one, other) -> int:
    """The squared distance of two boxes, no more than that of what is in them."""
    gaps = (max(c - b, a - d, 0) for (a, b), (c, d) in zip(one, other))
    return sum(gap * gap for gap in gaps)


def surface_distance(vertices_a, faces_a, X_WA, vertices_b, faces_b, X_WB) -> tuple[Fraction, list[tuple[int, int]]]:
    """(squared distance, pairs of facets that are so near), by brute force over pairs whose boxes are near enough."""
    exact_a, exact_b = world_points(vertices_a, X_WA), world_points(vertices_b, X_WB)
    a, b = as_integers(exact_a, exact_b)
    scale = max((x.denominator for points in (exact_a, exact_b) for point in points for x in point), default=1)
    facets_a = [[a[v] for v in f] for f in np.asarray(faces_a).tolist()]
    facets_b = [[b[v] for v in f] for f in np.asarray(faces_b).tolist()]
    boxes_a, boxes_b = [_box(P) for P in facets_a], [_box(Q) for Q in facets_b]
    order = sorted((_boxes_apart(p, q), i, j) for i, p in enumerate(boxes_a) for j, q in enumerate(boxes_b))
    best, pairs = None, []
    for least, i, j in order:
        if best is not None and least * best[1] > best[0]:
            break
        square = _squared_distance(facets_a[i], facets_b[j])
        sign = -1 if best is None else square[0] * best[1] - best[0] * square[1]
        if sign < 0:
            best, pairs = square, []
        if sign <= 0:
            pairs.append((i, j))
    assert best is not None
    return Fraction(best[0], best[1] * scale**2), sorted(pairs)


def winding(corners, p) -> int | None:
    """How often a closed surface of integer triangles winds around an integer point; None on the surface."""
    for a, b, c in corners:
        n = cross(minus(b, a), minus(c, a))
        if inner(n, minus(p, a)) == 0:
            sides = [inner(n, cross(minus(y, x), minus(p, x))) for x, y in ((a, b), (b, c), (c, a))]
            if min(sides) >= 0:
                return None
    for direction in ([7919, 104729, 1299709], [-15485863, 32452843, 49979687], [86028121, -3, 17]):
        passed = 0
        for a, b, c in corners:
            w = [minus(x, p) for x in (a, b, c)]
            sides = [inner(cross(w[k], w[(k + 1) % 3]), direction) for k in range(3)]
            n = cross(minus(b, a), minus(c, a))
            slope = inner(n, direction)
            if (min(sides) > 0 or max(sides) < 0) and inner(n, w[0]) * slope > 0:
                passed += 1 if slope > 0 else -1
            elif (min(sides) >= 0 or max(sides) <= 0) and 0 in sides:
                break
        else:
            return passed
    raise AssertionError("choose other directions")
