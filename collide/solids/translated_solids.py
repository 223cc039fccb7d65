"""Whether two solids meet when one is moved by an exact vector: in integers, for the vectors of any fractions."""

from __future__ import annotations

import numpy as np

from collide.numerics.exact_points import Point
from collide.numerics.exact_vectors import cross, inner, minus
from collide.solids.convolution import ExactSurface
from collide.solids.cut_points import Rational
from collide.solids.joined_parts import components
from collide.surface_queries.overlay import common_piece


class TranslatedSolids:
    """A and x − B, of two surfaces in units of one grid; B is given reflected, as −B would be."""

    def __init__(self, A: ExactSurface, minus_b: ExactSurface):
        self.A, self.minus_b = A, minus_b
        self._boxes_a, self._boxes_b = _boxes(A), _boxes(minus_b)
        self._starts_a, self._starts_b = _one_of_each_shell(A), _one_of_each_shell(minus_b)

    def meet(self, x: Rational) -> bool:
        """Whether A has a point in common with x − (−B)."""
        w = x[3]
        a = [_times(p, w) for p in self.A.points]
        b = [minus(x[:3], _times(p, w)) for p in self.minus_b.points]
        near = np.array([c / w for c in x[:3]])
        low, high = near - self._boxes_b[1], near - self._boxes_b[0]
        slack = 2.0**-48 * max(float(np.abs(self._boxes_a).max()), float(np.abs(low).max()), float(np.abs(high).max()))
        apart = (self._boxes_a[0][:, None] > high[None] + slack) | (low[None] > self._boxes_a[1][:, None] + slack)
        for f, g in np.argwhere(~apart.any(axis=2)).tolist():
            if common_piece([a[v] for v in self.A.faces[f]], [b[v] for v in self.minus_b.faces[g]]):
                return True
        faces_a, faces_b = self.A.faces.tolist(), self.minus_b.faces[:, ::-1].tolist()
        return any(_holds(b, faces_b, a[v]) for v in self._starts_a) or any(
            _holds(a, faces_a, b[v]) for v in self._starts_b
        )


def _holds(points: list[Point], faces: list[list[int]], p: Point) -> bool:
    """Whether closed facets wind around a point p off all facets: passages of a ray along x."""
    moved = [minus(q, p) for q in points]
    total = 0
    for face in faces:
        a, b, c = (moved[v] for v in face)
        n = cross(minus(b, a), minus(c, a))
        turns = sum(_passage(p_, q_) for p_, q_ in ((a, b), (b, c), (c, a)))
        if turns and inner(n, a) * n[0] > 0:
            total += 1 if n[0] > 0 else -1
    return total > 0


def _passage(a: Point, b: Point) -> int:
    """How an edge, seen along x, crosses the half-line y > 0: 1 upwards, −1 downwards; z = 0 counts as below."""
    up_a, up_b = a[2] > 0, b[2] > 0
    if up_a == up_b:
        return 0
    side = a[1] * b[2] - a[2] * b[1]
    return (1 if up_b else -1) if (side > 0) == up_b and side else 0


def _times(p: Point, w: int) -> Point:
    return p[0] * w, p[1] * w, p[2] * w


def _boxes(A: ExactSurface) -> np.ndarray:
    """(2, F, 3) lower and upper corners, rounded."""
    near = np.array([[float(x) for x in p] for p in A.points])[A.faces]
    return np.stack([near.min(axis=1), near.max(axis=1)])


def _one_of_each_shell(A: ExactSurface) -> list[int]:
    root = components(len(A.faces), *A.sides.T)
    return A.faces[np.flatnonzero(root == np.arange(len(root))), 0].tolist()
