"""The point of a hull of integer points nearest the origin: Johnson's subalgorithm by definition, and GJK on it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from collide.certificates.certificate import VertexPair
from collide.numerics.exact_points import PlacedPoints, Point, opposite
from collide.numerics.exact_vectors import determinant, inner, minus


class NearestPoint(NamedTuple):
    """The nearest point is vector / scale, scale > 0.

    carrier : ascending indices of the first of the smallest sets of points whose hull holds it.
    """

    vector: Point
    scale: int
    carrier: tuple[int, ...]


def nearest_to_origin(points: Sequence[Point]) -> NearestPoint:
    """The point nearest the origin of the hull of 1 to 4 points.

    The search takes the subset whose affine hull's nearest point v has positive weights and no point is an
    improvement: v·p ≥ v·v for all points p (Johnson's subalgorithm).
    """
    for count in range(1, len(points) + 1):
        for carrier in combinations(range(len(points)), count):
            corners = [points[k] for k in carrier]
            weights = weights_towards_origin(corners)
            if weights is None or any(w <= 0 for w in weights):
                continue
            scale = sum(weights)
            x, y, z = (sum(w * p[axis] for w, p in zip(weights, corners)) for axis in range(3))
            v = x, y, z
            if all(inner(v, p) * scale >= inner(v, v) for p in points):
                return NearestPoint(v, scale, carrier)
    raise AssertionError("some subset holds the nearest point")


def nearest_vertex_pairs(A: PlacedPoints, B: PlacedPoints, pairs: Sequence[VertexPair]) -> list[VertexPair]:
    """Index pairs (i, j) whose points A_i − B_j span the simplex of A ⊖ B nearest the origin: GJK in integers.

    pairs : where the search begins; of more than four the first four.
    """
    simplex = list(dict.fromkeys(pairs))[:4]
    while True:
        v, scale, carrier = nearest_to_origin([minus(A[i], B[j]) for i, j in simplex])
        simplex = [simplex[k] for k in carrier]
        if not any(v):
            return simplex
        i, j = A.first_along(v), B.first_along(opposite(v))
        if inner(v, minus(A[i], B[j])) * scale >= inner(v, v):
            return simplex
        simplex.append((i, j))


def weights_towards_origin(points: Sequence[Point]) -> list[int] | None:
    """Integer weights of the point of the affine hull nearest the origin; None for affinely dependent points."""
    base, edges = points[0], [minus(p, points[0]) for p in points[1:]]
    gram = [[inner(e, f) for f in edges] for e in edges]
    right = [-inner(e, base) for e in edges]
    whole = determinant(gram)
    if whole == 0:
        return None
    tail = [  # Cramer's rule
        determinant([[right[i] if c == k else row[c] for c in range(len(edges))] for i, row in enumerate(gram)])
        for k in range(len(edges))
    ]
    return [whole - sum(tail), *tail]
