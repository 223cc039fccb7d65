"""Two convex polygons judged in fractions, over all edges: the separating-axis theorem, and distances by brute force.

Shares no code with the engine. Polygons come as lists of corners in any cyclic order, of one corner, two or more; poses
as matrices (3, 3) whose entries are taken as they are.
"""

from __future__ import annotations

from fractions import Fraction


def world_corners(vertices, X) -> list[tuple[Fraction, Fraction]]:
    """Corners under a pose."""
    (a, b, x), (c, d, y) = ([Fraction(float(entry)) for entry in row] for row in list(X)[:2])
    exact = [(Fraction(float(u)), Fraction(float(v))) for u, v in vertices]
    return [(a * u + b * v + x, c * u + d * v + y) for u, v in exact]


def edges_of(corners) -> list[tuple[int, int]]:
    """Pairs of neighbouring corners; none of a point."""
    n = len(corners)
    return [(0, 1)] if n == 2 else [(k, (k + 1) % n) for k in range(n)] if n > 2 else []


def _axes(A, B):
    """Normals of all edges; for bodies without area also their directions and the line between two points."""
    for corners in (A, B):
        for i, j in edges_of(corners):
            d = corners[j][0] - corners[i][0], corners[j][1] - corners[i][1]
            yield -d[1], d[0]
            if len(corners) == 2:
                yield d
    if len(A) == 1 and len(B) == 1:
        yield B[0][0] - A[0][0], B[0][1] - A[0][1]


def polygons_meet_exactly(vertices_a, vertices_b, X_WA, X_WB) -> bool:
    """Whether the closed polygons have a common point."""
    A, B = world_corners(vertices_a, X_WA), world_corners(vertices_b, X_WB)
    # Denominators are powers of two: all times the largest are integers, which are faster.
    scale = max(number.denominator for corner in A + B for number in corner)
    A, B = ([(int(x * scale), int(y * scale)) for x, y in corners] for corners in (A, B))
    for x, y in _axes(A, B):
        a, b = [x * p + y * q for p, q in A], [x * p + y * q for p, q in B]
        if max(a) < min(b) or max(b) < min(a):
            return False
    return True


def squared_distance(vertices_a, vertices_b, X_WA, X_WB) -> Fraction:
    """Square of the distance of polygons that are apart: of all corners to all edges."""
    A, B = world_corners(vertices_a, X_WA), world_corners(vertices_b, X_WB)
    return min(min(_to_edges(p, B) for p in A), min(_to_edges(p, A) for p in B))


def _to_edges(p, corners) -> Fraction:
    best = min((p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 for q in corners)
    for i, j in edges_of(corners):
        (ax, ay), (bx, by) = corners[i], corners[j]
        ux, uy, vx, vy = bx - ax, by - ay, p[0] - ax, p[1] - ay
        along, length = ux * vx + uy * vy, ux * ux + uy * uy
        if 0 < along < length:
            best = min(best, (ux * vy - uy * vx) ** 2 / length)
    return best


def squared_depth(vertices_a, vertices_b, X_WA, X_WB) -> Fraction:
    """Square of the least translation that parts polygons that meet: over the normals of all edges.

    0 where both lie on parallel lines, or one is a point: their difference has no area.
    """
    A, B = world_corners(vertices_a, X_WA), world_corners(vertices_b, X_WB)
    best = None
    for x, y in list(_axes(A, B)):
        length = x * x + y * y
        if length:
            a, b = [x * p + y * q for p, q in A], [x * p + y * q for p, q in B]
            depth = min(max(a) - min(b), max(b) - min(a))
            square = depth * depth / length
            best = square if best is None else min(best, square)
    return Fraction(0) if best is None else best
