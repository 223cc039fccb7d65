"""Whether a point belongs to a shape, by the shape's definition, in fractions: no rounding, and no kernel decides.

For the few points left open by the engine: next to curved surfaces, and on surfaces of parts whose poses were
multiplied and rounded. ``poses`` lead from the world inwards; each matrix is inverted exactly to see a point from the
last frame.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.errors import UnsupportedQuery
from collide.lowering.facet_bodies import body_of, has_facets
from collide.narrowphase.facets.facet_geometry import RAY_DIRECTIONS, ray_crossing
from collide.numerics.exact_vectors import cross, inner, minus
from collide.shapes.compound import Compound
from collide.shapes.hpolytope import HPolytope
from collide.shapes.primitives import Cone, Cylinder, Ellipsoid, Halfspace
from collide.shapes.shape import Shape

#: A facet this much farther than it may be, in units of the largest coordinate, is not looked at in fractions.
_SLACK = 1e-9

_Point = tuple[Fraction, Fraction, Fraction]


def holds(shape: Shape, poses: list[np.ndarray], point: np.ndarray) -> bool:
    """Whether a point (3,) of the world is in a shape."""
    if isinstance(shape, Compound):
        return any(holds(part, [*poses, X], point) for part, X in shape.items)
    world = _fractions(point)
    x, y, z = local = _seen_from(world, poses)
    if isinstance(shape, Cylinder):
        return x * x + y * y <= Fraction(shape.radius) ** 2 and 2 * abs(z) <= Fraction(shape.length)
    if isinstance(shape, Cone):
        length = Fraction(shape.length)
        up = z / length + Fraction(1, 2)  # 0 at the base, 1 at the apex
        return 0 <= up <= 1 and x * x + y * y <= (Fraction(shape.radius) * (1 - up)) ** 2
    if isinstance(shape, Ellipsoid):
        return sum((v / Fraction(r)) ** 2 for v, r in zip(local, shape.radii.tolist())) <= 1
    if isinstance(shape, Halfspace):
        return inner(_fractions(shape.normal), local) <= Fraction(shape.offset)
    if isinstance(shape, HPolytope):
        planes = zip(shape.normals, shape.offsets.tolist())
        return all(inner(_fractions(n), local) <= Fraction(offset) for n, offset in planes)
    if has_facets(shape):
        return _in_facets(shape, poses, world, local)
    raise UnsupportedQuery(f"contains: rounding leaves open whether {point.tolist()} is in a {type(shape).__name__}")


def _in_facets(shape: Shape, poses: list[np.ndarray], world: _Point, local: _Point) -> bool:
    """In a mesh or the hull of points, swept by a ball."""
    body = body_of(shape)
    corners = body.tree.triangles.reshape(-1, 3, 3)
    rotation, shift = np.eye(3), np.zeros(3)
    for X in reversed(poses):
        rotation, shift = X[:3, :3] @ rotation, X[:3, :3] @ shift + X[:3, 3]
    placed = corners @ rotation.T + shift
    here = np.array([float(v) for v in world])
    size = np.abs(placed).max() + np.abs(here).max() + sum(np.abs(X[:3, 3]).max() for X in poses)
    away = np.maximum(placed.min(axis=1) - here, here - placed.max(axis=1)).max(axis=1)
    square = Fraction(body.radius) ** 2
    for k in np.flatnonzero(away <= body.radius + _SLACK * size).tolist():
        if _square_from_facet(world, *(_moved(_fractions(corner), poses) for corner in corners[k])) <= square:
            return True
    return body.solid and _winds_around(corners, local)


def _winds_around(corners: np.ndarray, point: _Point) -> bool:
    """Whether facets (m, 3, 3) wind around a point on none of them, in their own frame."""
    away = corners - np.array([float(v) for v in point])
    for direction in RAY_DIRECTIONS:
        d = np.array(direction, dtype=float)
        sides = np.stack([(np.cross(away[:, i], away[:, (i + 1) % 3]) * d).sum(axis=1) for i in range(3)])
        slack = _SLACK * np.abs(d).max() * (np.square(np.abs(away).max(axis=(1, 2))) + np.square(np.abs(corners).max()))
        missed = (sides > slack).any(axis=0) & (sides < -slack).any(axis=0)
        near = np.flatnonzero(~missed).tolist()
        crossings = [ray_crossing(direction, *(minus(_fractions(p), point) for p in corners[k])) for k in near]
        certain = [crossing for crossing in crossings if crossing is not None]
        if len(certain) == len(crossings):
            return sum(certain) > 0
    raise UnsupportedQuery("contains: every ray tried passes an edge of the facets; please report it")


def _fractions(point: np.ndarray) -> _Point:
    x, y, z = (Fraction(v) for v in point.tolist())
    return x, y, z


def _moved(point: _Point, poses: list[np.ndarray]) -> _Point:
    for X in reversed(poses):
        x, y, z = (inner(_fractions(row[:3]), point) + Fraction(float(row[3])) for row in X[:3])
        point = x, y, z
    return point


def _seen_from(point: _Point, poses: list[np.ndarray]) -> _Point:
    """The point in the frame of the last pose: each matrix inverted exactly."""
    for X in poses:
        a, b, c = (_fractions(X[:3, k]) for k in range(3))
        w = minus(point, _fractions(X[:3, 3]))
        det = inner(a, cross(b, c))
        x, y, z = (inner(w, cross(p, q)) / det for p, q in ((b, c), (c, a), (a, b)))
        point = x, y, z
    return point


def _square_from_facet(p: _Point, a: _Point, b: _Point, c: _Point) -> Fraction:
    """Square of the distance of a point from a triangle, which may be a segment or a point."""
    normal = cross(minus(b, a), minus(c, a))
    if any(normal):
        ends = ((a, b), (b, c), (c, a))
        if all(inner(normal, cross(minus(head, tail), minus(p, tail))) >= 0 for tail, head in ends):
            return inner(normal, minus(p, a)) ** 2 / inner(normal, normal)
    return min(_square_from_segment(p, tail, head) for tail, head in ((a, b), (b, c), (c, a)))


def _square_from_segment(p: _Point, a: _Point, b: _Point) -> Fraction:
    e, w = minus(b, a), minus(p, a)
    length, along = inner(e, e), inner(w, e)
    t = min(max(along / length, Fraction(0)), Fraction(1)) if length else Fraction(0)
    rest = [y - t * x for x, y in zip(e, w)]
    return inner(rest, rest)
