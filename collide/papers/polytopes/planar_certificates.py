"""Proofs about two convex polygons, as plain data: made from what the search found, and checked from the input alone.

Both are in fractions: a vertex of A lies at R_WA a + p_WA, every number as it stands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from typing import NamedTuple

import numpy as np

from collide.certificates.certificate import CertificateRefused
from collide.papers.polytopes.convex_polygon import ConvexPolygon, planar_poses
from collide.papers.polytopes.planar_layout import (
    HIT,
    HOW,
    LINE,
    OF_P,
    OF_Q,
    ONE_LINE,
    SECOND_LINE,
    SWAPPED,
    TANGENT,
    TWO_POINTS,
)
from collide.papers.polytopes.verified_arguments import as_answer

#: Coordinates in W [m].
PlanarPoint = tuple[Fraction, Fraction]
#: Vertices and the weights, positive and of sum 1, that make a point of them.
Weights = tuple[tuple[int, Fraction], ...]


class PlanarCertificate(NamedTuple):
    """Proof that two polygons meet or do not.

    Parameters
    ----------
    hit : whether they meet.
    point : a common point in W [m]; ``None`` for polygons apart.
    weights_a, weights_b : ((vertex, weight), …), at most three each: both combinations give the point. Empty for
        polygons apart.
    normal, offset : the line normal·x = offset, A on its lower side and B on its upper, A or B without a point on the
        line. ``None`` for a hit. The normal points from A to B and has any length.
    """

    hit: bool
    point: PlanarPoint | None
    weights_a: Weights
    weights_b: Weights
    normal: PlanarPoint | None
    offset: Fraction | None


# --- checking ------------------------------------------------------------------------------------


def verify_polygons(A: ConvexPolygon, B: ConvexPolygon, X_WA, X_WB, certificate: PlanarCertificate) -> None:
    """Check a certificate in fractions, from polygons and poses alone.

    Parameters
    ----------
    A, B : ConvexPolygon
        The pair.
    X_WA, X_WB : (3, 3) float64
        Their poses in W [m].
    certificate : PlanarCertificate
        The claim on the pair.

    Raises
    ------
    CertificateRefused
        For a certificate without a proof of its claim, with the reason.

    Notes
    -----
    O(1) for a hit; O(n + m) for a line, checked against every vertex.
    """
    for name, polygon in (("A", A), ("B", B)):
        as_answer("verify_polygons", name, polygon, ConvexPolygon)
    X_WA, X_WB = (planar_poses(X, name)[0][0] for name, X in (("X_WA", X_WA), ("X_WB", X_WB)))
    as_answer("verify_polygons", "certificate", certificate, PlanarCertificate)
    if certificate.hit:
        points = [
            _combination(polygon, np.asarray(X), weights, name)
            for polygon, X, weights, name in (
                (A, X_WA, certificate.weights_a, "A"), (B, X_WB, certificate.weights_b, "B"),
            )
        ]
        for name, point in zip("AB", points):
            if point != certificate.point:
                raise CertificateRefused(f"the weights of {name}'s vertices make another point than the one named")
        return
    if certificate.normal is None or certificate.offset is None:
        raise CertificateRefused("apart, but no line is named")
    nx, ny = certificate.normal
    greatest = max(nx * x + ny * y for x, y in placed_vertices(A, X_WA))
    least = min(nx * x + ny * y for x, y in placed_vertices(B, X_WB))
    if not greatest <= certificate.offset <= least:
        raise CertificateRefused(f"{'A' if greatest > certificate.offset else 'B'} has a vertex beyond the line")
    if greatest == least:
        raise CertificateRefused("both polygons touch the line: it does not part them")


def gap_across(A: ConvexPolygon, B: ConvexPolygon, X_WA, X_WB, certificate: PlanarCertificate) -> float:
    """A lower bound, as a double, of the gap of two polygons, from their separating line [m]; O(n + m), in
    fractions.
    """
    assert certificate.normal is not None
    nx, ny = certificate.normal
    greatest = max(nx * x + ny * y for x, y in placed_vertices(A, X_WA))
    least = min(nx * x + ny * y for x, y in placed_vertices(B, X_WB))
    square = (least - greatest) ** 2 / (nx * nx + ny * ny)
    # The root to 64 digits, between two neighbouring integers.
    bits = max(0, square.denominator.bit_length() - square.numerator.bit_length()) + 128
    gap = float(Fraction(math.isqrt(square.numerator * 4**bits // square.denominator), 2**bits))
    while gap > 0.0 and Fraction(gap) ** 2 > square:
        gap = math.nextafter(gap, 0.0)
    return gap


def _combination(polygon: ConvexPolygon, X: np.ndarray, weights: Weights, name: str) -> PlanarPoint:
    if not 1 <= len(weights) <= 3:
        raise CertificateRefused(f"one to three vertices of {name} make a point, not {len(weights)}")
    if any(not 0 <= vertex < len(polygon.vertices) for vertex, _ in weights):
        raise CertificateRefused(f"{name} has no such vertex: {[vertex for vertex, _ in weights]}")
    if any(weight <= 0 for _, weight in weights) or sum(weight for _, weight in weights) != 1:
        raise CertificateRefused(f"the weights of {name}'s vertices are not positive, or their sum is not 1")
    vertices = placed_vertices(polygon, X, [vertex for vertex, _ in weights])
    return (
        sum((w * x for (_, w), (x, _) in zip(weights, vertices)), Fraction(0)),
        sum((w * y for (_, w), (_, y) in zip(weights, vertices)), Fraction(0)),
    )


def placed_vertices(polygon: ConvexPolygon, X, vertices: Sequence[int] | None = None) -> list[PlanarPoint]:
    """Vertices, all or some, under a pose (3, 3), as fractions [m]."""
    (a, b, x), (c, d, y) = ([Fraction(float(entry)) for entry in row] for row in np.asarray(X)[:2])
    points = polygon.vertices if vertices is None else polygon.vertices[list(vertices)]
    local = [(Fraction(u), Fraction(v)) for u, v in points.tolist()]
    return [(a * u + b * v + x, c * u + d * v + y) for u, v in local]


# --- making --------------------------------------------------------------------------------------


class _Body(NamedTuple):
    """A polygon and where it stands, (3, 3)."""

    polygon: ConvexPolygon
    X: np.ndarray


def certificate_of_row(A: ConvexPolygon, B: ConvexPolygon, X_WA, X_WB, row: list[int]) -> PlanarCertificate:
    """The certificate of a row of `planar_layout.py`."""
    bodies = [_Body(A, X_WA), _Body(B, X_WB)]
    swapped = row[SWAPPED] == 1
    if swapped:
        bodies.reverse()
    if row[HIT]:
        ids = [list(dict.fromkeys(v for v in row[at:end] if v >= 0)) for at, end in ((OF_P, OF_Q), (OF_Q, LINE))]
        points = [placed_vertices(body.polygon, body.X, vertices) for body, vertices in zip(bodies, ids)]
        common, of_p, of_q = _common_point(*points)
        weights = [tuple((i[k], w) for k, w in made) for i, made in zip(ids, (of_p, of_q))]
        if swapped:
            weights.reverse()
        return PlanarCertificate(True, common, weights[0], weights[1], None, None)
    normal, vertex = _normal_of_row(bodies, row)
    x, y = placed_vertices(bodies[0].polygon, bodies[0].X, [vertex])[0]
    # The normal points from P to Q, and P touches the line.
    offset = normal[0] * x + normal[1] * y
    if swapped:
        normal, offset = (-normal[0], -normal[1]), -offset
    return PlanarCertificate(False, None, (), (), normal, offset)


def _normal_of_row(bodies: list[_Body], row: list[int]) -> tuple[PlanarPoint, int]:
    """(a normal from P to Q, a vertex of P nearest to Q along the normal)."""
    if row[HOW] == TWO_POINTS:
        p, q = (placed_vertices(body.polygon, body.X)[0] for body in bodies)
        return (q[0] - p[0], q[1] - p[1]), 0
    normal = _line_normal(bodies, row[LINE : LINE + 3])
    if row[HOW] == ONE_LINE:
        return normal, row[LINE + 3]
    second = _line_normal(bodies, row[SECOND_LINE : SECOND_LINE + 3])
    on_lines = [row[TANGENT], row[LINE + 3], row[SECOND_LINE + 3]]
    w, on_first, on_second = placed_vertices(bodies[0].polygon, bodies[0].X, on_lines)
    f = normal[0] * (w[0] - on_first[0]) + normal[1] * (w[1] - on_first[1])
    g = second[0] * (w[0] - on_second[0]) + second[1] * (w[1] - on_second[1])
    return (f * second[0] - g * normal[0], f * second[1] - g * normal[1]), row[TANGENT]


def _line_normal(bodies: list[_Body], line: list[int]) -> PlanarPoint:
    """The normal to the left of a line's direction, which Q lies on."""
    body = bodies[line[0] % 2]
    start, end = placed_vertices(body.polygon, body.X, line[1:3])
    x, y = end[0] - start[0], end[1] - start[1]
    return (-x, -y) if line[0] >= 2 else (-y, x)


def _cross(o: PlanarPoint, a: PlanarPoint, b: PlanarPoint) -> Fraction:
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])


def _common_point(P: list[PlanarPoint], Q: list[PlanarPoint]) -> tuple[PlanarPoint, list, list]:
    """(a point of both hulls, its weights in points of P, and of Q), of at most four and six points that do meet."""
    for k, p in enumerate(P):
        if (weights := _weights_in(Q, p)) is not None:
            return p, [(k, Fraction(1))], weights
    for k, q in enumerate(Q):
        if (weights := _weights_in(P, q)) is not None:
            return q, weights, [(k, Fraction(1))]
    for i, j in combinations(range(len(P)), 2):
        for k, m in combinations(range(len(Q)), 2):
            s, t = _cross(Q[k], Q[m], P[i]), _cross(Q[k], Q[m], P[j])
            u, v = _cross(P[i], P[j], Q[k]), _cross(P[i], P[j], Q[m])
            if s * t < 0 and u * v < 0:
                a, b = s / (s - t), u / (u - v)
                x, y = (P[i][c] + a * (P[j][c] - P[i][c]) for c in range(2))
                return (x, y), [(i, 1 - a), (j, a)], [(k, 1 - b), (m, b)]
    raise AssertionError("hulls that are known to meet have no common point")


def _weights_in(points: list[PlanarPoint], x: PlanarPoint) -> list[tuple[int, Fraction]] | None:
    """Positive weights of one to three points with x as their combination; ``None`` for x outside the points' hull."""
    for k, p in enumerate(points):
        if p == x:
            return [(k, Fraction(1))]
    for i, j in combinations(range(len(points)), 2):
        p, q = points[i], points[j]
        if p != q and _cross(p, q, x) == 0:
            c = 0 if p[0] != q[0] else 1
            t = (x[c] - p[c]) / (q[c] - p[c])
            if 0 < t < 1:
                return [(i, 1 - t), (j, t)]
    for i, j, k in combinations(range(len(points)), 3):
        area = _cross(points[i], points[j], points[k])
        if area:
            a = _cross(x, points[j], points[k]) / area
            b = _cross(points[i], x, points[k]) / area
            if a > 0 and b > 0 and a + b < 1:
                return [(i, a), (j, b), (k, 1 - a - b)]
    return None
