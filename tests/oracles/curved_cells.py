"""Convex cells and the three proofs of `curved_oracle.py`: all that has to be right, in decimals of 80 digits."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Context, Decimal
from fractions import Fraction
from typing import NamedTuple

import numpy as np

#: Use it wherever these functions are called.
CONTEXT = Context(prec=80)
_ZERO, _INF = Decimal(0), Decimal("inf")

Vector = tuple[Decimal, Decimal, Decimal]


# --- vectors ------------------------------------------------------------------------------------


def dot(a: Vector, b: Vector) -> Decimal:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(s: Decimal, a: Vector) -> Vector:
    return s * a[0], s * a[1], s * a[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def norm(a: Vector) -> Decimal:
    return dot(a, a).sqrt()


def exact(x) -> Decimal:
    """A double or an integer as it is; a Fraction rounded to 80 digits."""
    if isinstance(x, Fraction):
        return Decimal(x.numerator) / Decimal(x.denominator)
    return x if isinstance(x, Decimal) else Decimal(float(x))


def vector(values) -> Vector:
    return tuple(exact(x) for x in values)  # type: ignore[return-value]


class Pose(NamedTuple):
    """p ↦ rows · p + shift."""

    rows: tuple[Vector, Vector, Vector]
    shift: Vector

    def image(self, p: Vector) -> Vector:
        r, t = self
        return dot(r[0], p) + t[0], dot(r[1], p) + t[1], dot(r[2], p) + t[2]

    def pulled_back(self, n: Vector) -> Vector:
        """rowsᵀ n: the direction in the body's frame whose support is that along n in the world."""
        return tuple(self.rows[0][k] * n[0] + self.rows[1][k] * n[1] + self.rows[2][k] * n[2] for k in range(3))

    def after(self, inner: Pose) -> Pose:
        columns = [[dot(row, vector(row_in[k] for row_in in inner.rows)) for k in range(3)] for row in self.rows]
        return Pose(tuple(tuple(row) for row in columns), self.image(inner.shift))  # type: ignore[arg-type]


def make_pose(X) -> Pose:
    """A (4, 4) matrix of doubles, entry by entry; a `Pose` as it is."""
    if isinstance(X, Pose):
        return X
    X = np.asarray(X, dtype=np.float64).tolist()
    return Pose(tuple(vector(row[:3]) for row in X[:3]), vector(row[3] for row in X[:3]))  # type: ignore[arg-type]


# --- convex cells -------------------------------------------------------------------------------


class Cell:
    """One convex core at its pose, and the radius around it.

    kind : "points", "cylinder", "cone", "ellipsoid".   sizes : (radius, half length), or semi-axes.
 
    pose : of the others; points : of the first kind, in the world.   low, high : (3,) doubles, a box rounded outwards.
    """

    def __init__(self, kind: str, pose: Pose | None = None, sizes: tuple = (), points=(), radius: Decimal = _ZERO):
        self.kind, self.pose, self.sizes, self.radius = kind, pose, sizes, radius
        self.points: list[Vector] = list(points)
        if self.points:
            self.rough = np.array(self.points, dtype=np.float64)
            ends = np.array([self.rough.min(axis=0), self.rough.max(axis=0)])
        else:
            ends = np.array([[float(self.support(_axis(k, s))[0]) * s for k in range(3)] for s in (-1, 1)])
        largest = float(np.abs(ends).max()) + float(radius)
        self.scale = Decimal(2 * largest + 1e-300)
        # What a sum of three products of such doubles may be off, for a direction of length 1.
        self.off = 1e-14 * (largest + 1e-300)
        self.low, self.high = ends[0] - (float(radius) + self.off), ends[1] + (float(radius) + self.off)

    def support(self, n: Vector) -> tuple[Decimal, Vector]:
        """The largest n·p over the core, radius left out, and a point p where it is taken."""
        if self.kind == "points":
            return self._farthest(n)
        p = self.pose.image(_SUPPORTS[self.kind](self.sizes, self.pose.pulled_back(n)))
        return dot(n, p), p

    def _farthest(self, n: Vector) -> tuple[Decimal, Vector]:
        if len(self.points) > 6:
            d = np.array([float(x) for x in n])
            d /= np.abs(d).max()
            along = self.rough @ d
            near = np.flatnonzero(along >= along.max() - 8 * self.off)
            found = [self.points[k] for k in near]
        else:
            found = self.points
        return max(((dot(n, p), p) for p in found), key=lambda pair: pair[0])

    def coarse(self, n: np.ndarray) -> float:
        """No less than the largest n·p over the cell with its radius, |n| = 1, in doubles."""
        value, _ = self.support(vector(n))
        return float(value + self.radius) + self.off


def _axis(k: int, sign: int) -> Vector:
    return tuple(Decimal(sign * (i == k)) for i in range(3))  # type: ignore[return-value]


def _cylinder(sizes, d: Vector) -> Vector:
    radius, half = sizes
    across = (d[0] * d[0] + d[1] * d[1]).sqrt()
    s = radius / across if across else _ZERO
    return s * d[0], s * d[1], half if d[2] > 0 else -half


def _cone(sizes, d: Vector) -> Vector:
    radius, half = sizes
    across = (d[0] * d[0] + d[1] * d[1]).sqrt()
    if d[2] * half >= radius * across - half * d[2]:
        return _ZERO, _ZERO, half
    s = radius / across if across else _ZERO
    return s * d[0], s * d[1], -half


def _ellipsoid(sizes, d: Vector) -> Vector:
    scaled = tuple(r * x for r, x in zip(sizes, d))
    length = norm(scaled)
    return tuple(r * x / length for r, x in zip(sizes, scaled)) if length else (_ZERO,) * 3


_SUPPORTS: dict[str, Callable] = {"cylinder": _cylinder, "cone": _cone, "ellipsoid": _ellipsoid}


# --- the three proofs ---------------------------------------------------------------------------


def separation(a: Cell, b: Cell, n: Vector) -> Decimal:
    """A lower bound of the signed distance of the cores: how far the planes across n are apart, from A to B."""
    return -(a.support(n)[0] + b.support(times(Decimal(-1), n))[0]) / norm(n)


def weighted(pairs: list[tuple[Vector, Vector]], weights: list[Decimal]) -> tuple[Vector, Vector]:
    """A point of A and a point of B: weights of any sum > 0, none below 0, of points of each."""
    assert min(weights) >= 0
    total = sum(weights)
    a, b = (
        tuple(sum((w * p[side][k] for w, p in zip(weights, pairs)), _ZERO) / total for k in range(3)) for side in (0, 1)
    )
    return a, b  # type: ignore[return-value]


def shell_depth(corners: list[Vector], facets: list[tuple[int, int, int]], size: Decimal) -> Decimal | None:
    """How far from 0 a closed surface is at least that 0 sees from inside everywhere; None where it is no such.

    Every edge has one facet on each side, and seen from 0 every facet is counter-clockwise: so the rays from 0 each
    cross the surface, in points of the hull of its corners, and that hull holds the ball of this radius.
    """
    sides = [edge for f in facets for edge in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))]
    once = set(sides)
    if not facets or len(once) != len(sides) or once != {(j, i) for i, j in once}:
        return None
    least = _INF
    for i, j, k in facets:
        p, e, f = corners[i], minus(corners[j], corners[i]), minus(corners[k], corners[i])
        n = cross(e, f)
        # Coordinates are good to 1e-76 of the size: the volume, and the plane, to that times the other two factors.
        blur = Decimal("1e-74") * size * size * (norm(e) + norm(f))
        volume = dot(n, p) - blur
        if volume <= 0:
            return None
        least = min(least, volume / norm(n))
    return least
