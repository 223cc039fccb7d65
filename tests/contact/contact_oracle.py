"""Contacts judged in rational arithmetic: facets of both bodies as posed, and what is true of them along a normal."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from naive_triangles import cross, inner, minus, world_points


def facet(vertices, faces, X, number) -> list[list[Fraction]]:
    """Corners of one facet in the world."""
    return world_points(np.asarray(vertices)[np.asarray(faces)[number]], X)


def gaps_along(P, Q, n) -> list[tuple[list[Fraction], Fraction]]:
    """(place, gap) of every corner over the other facet and every crossing of edges, seen along n.

    gap : what n is to be multiplied with to lead from P to Q there.   place : the point of P's side.
    """
    n = [Fraction(x) for x in n]
    found = []
    for face, points, sign in ((P, Q, 1), (Q, P, -1)):
        normal = cross(minus(face[1], face[0]), minus(face[2], face[0]))
        slope = inner(normal, n)
        if slope == 0:
            continue
        for p in points:
            away = inner(normal, minus(p, face[0])) / slope
            foot = [x - away * d for x, d in zip(p, n)]
            sides = [inner(normal, cross(minus(face[(k + 1) % 3], face[k]), minus(foot, face[k]))) for k in range(3)]
            if min(sides) >= -Fraction(1, 10**6) * inner(normal, normal):
                found.append((foot if sign == 1 else p, sign * away))
    for i in range(3):
        for j in range(3):
            e, f, w = minus(P[(i + 1) % 3], P[i]), minus(Q[(j + 1) % 3], Q[j]), minus(Q[j], P[i])
            normal = cross(e, f)
            slope = inner(normal, n)
            if slope == 0:
                continue
            gap = inner(w, normal) / slope
            # Where both lines, the second moved back by the gap, meet: s along the first.
            v = [x - gap * d for x, d in zip(w, n)]
            square = inner(normal, normal)
            s, t = inner(cross(v, f), normal) / square, inner(cross(v, e), normal) / square
            if -Fraction(1, 10**6) <= min(s, t) and max(s, t) <= 1 + Fraction(1, 10**6):
                found.append(([x + s * d for x, d in zip(P[i], e)], gap))
    return found


def away_from(P, p) -> float:
    """How far a point of doubles is from the triangle P, about: the least distance from its plane, edges and
    corners."""
    T = np.array([[float(x) for x in q] for q in P])
    p = np.asarray(p, dtype=float)
    n = np.cross(T[1] - T[0], T[2] - T[0])
    best = min(np.linalg.norm(p - _clamped(T[k], T[(k + 1) % 3], p)) for k in range(3))
    square = n @ n
    if square > 0 and all(n @ np.cross(T[(k + 1) % 3] - T[k], p - T[k]) >= 0 for k in range(3)):
        best = min(best, abs(n @ (p - T[0])) / square**0.5)
    return float(best)


def _clamped(a, b, p):
    e = b - a
    square = e @ e
    return a + (min(max((p - a) @ e / square, 0.0), 1.0) if square > 0 else 0.0) * e


def check_row(row, a, b, X_WA, X_WB, radii=(0.0, 0.0), nearest=False, tolerance=1e-9) -> None:
    """That a row is what `contacts` promises of it. a, b : (vertices, faces); radii of balls swept over them.

    nearest : the row may be one of nearest points, whose gap is the distance of the two facets.
    """
    n = row["normal"]
    assert abs(np.linalg.norm(n) - 1) < 1e-12
    assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * n).max() < tolerance * 1e-3
    assert row["lower"] <= row["distance"] <= row["upper"]
    P, Q = facet(*a, X_WA, row["facet_a"]), facet(*b, X_WB, row["facet_b"])
    core_a, core_b = row["point_a"] - radii[0] * n, row["point_b"] + radii[1] * n
    assert away_from(P, core_a) < tolerance, ("A", away_from(P, core_a))
    assert away_from(Q, core_b) < tolerance, ("B", away_from(Q, core_b))
    low, high = (Fraction(float(row[name])) + Fraction(sum(radii)) for name in ("lower", "upper"))
    there = [
        g
        for place, g in gaps_along(P, Q, n.tolist())
        if max(abs(float(x) - y) for x, y in zip(place, core_a)) < tolerance
    ]
    slack = Fraction(1, 2**48) * (1 + abs(low))  # the normal's own length
    if any(low - slack <= g <= high + slack for g in there):
        return
    assert nearest, (float(low), float(high), [float(g) for g in there])
