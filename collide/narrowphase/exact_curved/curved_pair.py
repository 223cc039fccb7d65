"""Whether two posed convex sets share a point, A or B curved: cheap arguments first, in a fixed order."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from collide.narrowphase.exact_curved.corners_and_facets import common_point
from collide.narrowphase.exact_curved.integer_bodies import (
    CurvedBody,
    IntegerBody,
    SweptPoints,
    Vector,
    WorldPoint,
    is_apart_along,
    least_height,
    opposite,
    sign_of_overlap,
)
from collide.narrowphase.exact_curved.precise_gjk import search
from collide.narrowphase.exact_curved.tangent_points import tangent_points
from collide.numerics.exact_vectors import inner


class Decision(NamedTuple):
    """Proof of a sign.

    point : common to A and B, of bodies in contact.
    normal : of bodies apart, a direction with all of A before all of B; of bodies in contact, a direction with A not
        beyond B: A and B touch, without depth. An unknown point or direction is None.
    is_open : without a proof.
    """

    point: WorldPoint | None
    normal: Vector | None
    is_open: bool = False


def settle_pair(A: IntegerBody, B: IntegerBody, n: Vector, near: WorldPoint) -> Decision:
    """n : a direction from A to B, near : a point beside both; proposals of doubles.

    1. n, or the normal of a flat end or facet, separates strictly: apart.
    2. ``near``, a corner, or a point of touching ends lies in both: they meet.
    3. A polytope without a radius: `corners_and_facets.py` is a full decision.
    4. A point of touching sides (`tangent_points.py`) lies in both.
    5. Decimals (`precise_gjk.py`).
    Open stay pairs that touch in points that are no fractions, and gaps or depths below 10⁻¹²⁰ of the size.
    """
    normals = [n, *A.normals, *(opposite(m) for m in B.normals)]
    for m in normals:
        if is_apart_along(A, B, m):
            return Decision(None, m)
    point = next((x for x in _candidates(A, B, near) if A.holds(x) and B.holds(x)), None)
    if point is None:
        for polytope, C, m in ((A, B, n), (B, A, opposite(n))):
            if isinstance(polytope, SweptPoints) and polytope.radius == 0 and isinstance(C, CurvedBody):
                point = common_point(polytope, C, least_height(C, m), m)
                if point is None:
                    return Decision(None, search(A, B, n).normal)
                break
    if point is None:
        point = next((x for x in _touching(A, B, normals, near) if A.holds(x) and B.holds(x)), None)
    if point is None:
        point, normal = search(A, B, n)
        if point is None:
            return Decision(None, normal, normal is None)
    return Decision(point, _touching_normal(A, B, normals, point))


def _candidates(A: IntegerBody, B: IntegerBody, near: WorldPoint) -> Iterable[WorldPoint]:
    yield near
    for body in (A, B):
        yield from body.corners
        for disc in body.discs:
            x, y, _, w = body.pose.local(near)  # type: ignore[union-attr]
            yield disc.pose.placed((x, y, disc.height * w), w)


def _touching(A: IntegerBody, B: IntegerBody, normals: Iterable[Vector], near: WorldPoint) -> Iterable[WorldPoint]:
    middles = [near, *(disc.pose.placed((0, 0, disc.height)) for body in (A, B) for disc in body.discs)]
    for m in normals:
        for middle in middles if any(m) else ():
            yield from A.supports(m, middle)
            yield from B.supports(opposite(m), middle)
    yield from tangent_points(A, B, near)


def _touching_normal(A: IntegerBody, B: IntegerBody, normals: Iterable[Vector], x: WorldPoint) -> Vector | None:
    """A direction along which A is not beyond B: a normal of the list, or of a side at the common point x."""
    for m in (*normals, *_gradients(A, x), *(opposite(g) for g in _gradients(B, x))):
        if any(m) and all(sign_of_overlap(r, s) <= 0 for r in A.reaches(m) for s in B.reaches(opposite(m))):
            return m
    return None


def _gradients(body: IntegerBody, x: WorldPoint) -> Iterable[Vector]:
    for Q in body.quadrics:
        g = [sum(q * c for q, c in zip(row, x)) for row in Q]
        if inner(g, x) + g[3] * x[3] == 0:
            yield g[0], g[1], g[2]
