"""What two tetrahedra share, from the definition: corners are common points of three of the eight planes.

In integers and fractions, on the poses as they stand. Shares no code with the engine: nothing is cut, no shares of
volume are multiplied, no edge is looked at.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise
from math import lcm

import numpy as np


def placed_cell(X, corners):
    """Four corners in W as fractions."""
    R = [[Fraction(x) for x in row] for row in np.asarray(X, dtype=float).tolist()]
    points = [[Fraction(x) for x in p] for p in np.asarray(corners, dtype=float).tolist()]
    return [tuple(sum(R[i][k] * p[k] for k in range(3)) + R[i][3] for i in range(3)) for p in points]


def volume_of(cell):
    """The volume of a tetrahedron."""
    a, b, c = ([x - y for x, y in zip(p, cell[0])] for p in cell[1:])
    return Fraction(abs(_det(a, b, c))) / 6


def shared(A, B):
    """(volume, centroid or None) of the common part of two tetrahedra, corners in fractions."""
    for k in range(3):
        if max(p[k] for p in A) <= min(p[k] for p in B) or max(p[k] for p in B) <= min(p[k] for p in A):
            return Fraction(0), None
    unit = lcm(*(x.denominator for p in [*A, *B] for x in p))
    A, B = ([tuple(int(x * unit) for x in p) for p in cell] for cell in (A, B))
    planes = _planes(A) + _planes(B)
    points = {point for three in combinations(planes, 3) for point in _corner(three, planes)}
    if len(points) < 4:
        return Fraction(0), None
    middle = tuple(sum(p[k] for p in points) / len(points) for k in range(3))
    volume, moment = Fraction(0), [Fraction(0)] * 3
    for on, n in {frozenset(p for p in points if _dot(n, p) == d): n for n, d in planes}.items():
        ring = _ring(on, n) if len(on) > 2 else []
        for p, q in pairwise(ring[1:]):
            piece = volume_of([middle, ring[0], p, q])
            volume += piece
            moment = [m + piece * (a + b + c + d) / 4 for m, a, b, c, d in zip(moment, middle, ring[0], p, q)]
    return (volume / unit**3, tuple(m / volume / unit for m in moment)) if volume else (volume, None)


def _planes(cell):
    """Outward (normal, offset) of the four faces."""
    planes = []
    for k in range(4):
        p, q, r = (cell[i] for i in range(4) if i != k)
        n = _cross([b - a for a, b in zip(p, q)], [b - a for a, b in zip(p, r)])
        d = _dot(n, p)
        if _dot(n, cell[k]) > d:
            n, d = tuple(-x for x in n), -d
        planes.append((n, d))
    return planes


def _corner(three, planes):
    """The common point of three planes, if there is just one (Cramer's rule) and it is in all half-spaces."""
    rows, offsets = [n for n, _ in three], [d for _, d in three]
    whole = _det(*rows)
    if whole == 0:
        return
    sign = 1 if whole > 0 else -1
    columns = list(zip(*rows))
    point = [sign * _det(*(offsets if j == k else columns[j] for j in range(3))) for k in range(3)]
    if all(_dot(n, point) <= d * abs(whole) for n, d in planes):
        yield tuple(Fraction(x, abs(whole)) for x in point)


def _ring(points, n):
    """Points of a plane around their convex polygon (monotone chains, without the axis that n is largest along)."""
    drop = max(range(3), key=lambda k: abs(n[k]))
    u, v = (k for k in range(3) if k != drop)
    ordered = sorted(points, key=lambda p: (p[u], p[v]))

    def chain(run):
        out = []
        for p in run:
            while len(out) > 1 and (out[-1][u] - out[-2][u]) * (p[v] - out[-2][v]) <= (out[-1][v] - out[-2][v]) * (
                p[u] - out[-2][u]
            ):
                out.pop()
            out.append(p)
        return out[:-1]

    return chain(ordered) + chain(ordered[::-1])


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _det(a, b, c):
    return _dot(_cross(a, b), c)
