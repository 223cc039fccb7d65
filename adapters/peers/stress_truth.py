"""The exact answer to a hard case: hulls and meshes by the oracles, half-spaces by one exact formula."""

from __future__ import annotations

import math
from decimal import Context, Decimal
from fractions import Fraction
from typing import NamedTuple

from collide.adapters.peers import exact, exact_meshes
from collide.scenes.families import HALFSPACE, Case, MeshCase

#: Digits of the signed distance.
DIGITS = 30
_GUARD = Context(prec=2 * DIGITS)
#: What those digits leave open, as a part of the value.
_OPEN = Decimal(10) ** (2 - DIGITS)


class Truth(NamedTuple):
    """hit, the signed distance to `DIGITS` digits [m], and L: what a gap is measured against [m].

    Of meshes that meet the distance is None: nobody knows how deep they are. Gaps of meshes are doubles, rounded once.
    """

    hit: bool
    distance: Decimal | None
    size: float
    #: What rounding the distance left open, as a part of it.
    open: Decimal = _OPEN
    #: No surfaces meet: it is a hit because one mesh lies inside the other.
    inside: bool = False

    def off(self, value: float) -> Decimal | None:
        """By how much a distance [m] is off, 0 or more; None where the exact one is not known."""
        return None if self.distance is None else abs(Decimal(value) - self.distance)

    def misses(self, lower: float, upper: float) -> bool:
        """Whether a bracket [m] does not hold the exact value; not-a-number holds nothing."""
        if math.isnan(lower) or math.isnan(upper):
            return True
        if self.distance is None:
            return lower > 0
        slack = abs(self.distance) * self.open
        return not (Decimal(lower) <= self.distance + slack and Decimal(upper) >= self.distance - slack)


def truth(case: Case | MeshCase) -> Truth:
    """The exact answer; nothing is rounded but the digits read off."""
    if isinstance(case, MeshCase):
        return _mesh_truth(case)
    if case.kind == HALFSPACE:
        hit, distance = halfspace_distance(case)
        return Truth(hit, distance, case.b.diagonal() + 2 * case.radius_b or 1.0)
    pair, radii = case[2:8], {"radius_a": case.radius_a, "radius_b": case.radius_b}
    distance = exact.signed_distance(*pair, digits=DIGITS, **radii)
    return Truth(exact.hit(*pair, **radii), distance, _size(case))


def _mesh_truth(case: MeshCase) -> Truth:
    A, B = (exact_meshes.mesh_cells(s.vertices, s.faces, s.solid, s.X) for s in (case.a, case.b))
    verdict = exact_meshes.judge(A, B)
    size = min((d for d in (case.a.diagonal(), case.b.diagonal()) if d > 0), default=1.0)
    distance = None if verdict.distance is None else Decimal(verdict.distance)
    return Truth(verdict.hit, distance, size, Decimal(2) ** -52, verdict.hit and not verdict.surfaces)


def gap_along(case: Case | MeshCase, normal) -> Decimal | None:
    """How far the hulls are apart along a direction (3,) from A to B [m]: at most their signed distance,
    and equal to it for the right normal. None for a half-space or meshes, and where there is no direction.
    """
    if isinstance(case, MeshCase) or case.kind == HALFSPACE or not all(map(math.isfinite, normal)) or not any(normal):
        return None
    n = [Fraction(float(x)) for x in normal]
    (A, e_a), (B, e_b) = exact.world_points(*case[2:5]), exact.world_points(*case[5:8])
    nearest = min(exact.dot(n, p) for p in B) * Fraction(2) ** e_b
    farthest = max(exact.dot(n, p) for p in A) * Fraction(2) ** e_a
    length = _GUARD.sqrt(_decimal(exact.dot(n, n)))
    return _GUARD.divide(_decimal(nearest - farthest), length) - _decimal(
        Fraction(case.radius_a) + Fraction(case.radius_b)
    )


def _size(case: Case) -> float:
    """The diagonal of the smaller body that has one, radii included; 1 for two points."""
    diagonals = (case.a.diagonal() + 2 * case.radius_a, case.b.diagonal() + 2 * case.radius_b)
    return min((d for d in diagonals if d > 0), default=1.0)


def halfspace_distance(case: Case) -> tuple[bool, Decimal]:
    """(hit, signed distance) of a half-space A and a swept hull B.

    The image of {x : m·x ≤ b} under x ↦ R x + t is {w : n·(w − t) ≤ b det R} with n = cof(R) m, for R
    as it stands. The swept hull is (min n·(w − t) − b det R) / |n| − r away, below 0 too: A − B is
    itself a half-space.
    """
    R = [[Fraction(x) for x in row] for row in case.R1.tolist()]
    m = [Fraction(x) for x in case.P[0].tolist()]
    cofactors = [exact.cross(R[1], R[2]), exact.cross(R[2], R[0]), exact.cross(R[0], R[1])]
    n = [exact.dot(row, m) for row in cofactors]
    height = Fraction(case.offset) * exact.dot(R[0], cofactors[0]) + exact.dot(n, _fractions(case.t1))
    points, e = exact.world_points(case.Q, case.R2, case.t2)
    excess = min(exact.dot(n, p) for p in points) * Fraction(2) ** e - height
    return _less_radius(excess, exact.dot(n, n), Fraction(case.radius_b))


def _less_radius(excess: Fraction, squared: Fraction, radius: Fraction) -> tuple[bool, Decimal]:
    """excess / √squared − radius, and whether it is at most 0, without cancellation."""
    length = _GUARD.sqrt(_decimal(squared))
    if excess <= 0:
        distance = _GUARD.divide(_decimal(excess), length) - _decimal(radius)
    else:
        # (x − r√s)/√s = (x² − r²s) / (√s (x + r√s)), and the numerator is exact
        numerator = excess**2 - radius**2 * squared
        whole = _GUARD.add(_decimal(excess), _GUARD.multiply(_decimal(radius), length))
        distance = _GUARD.divide(_decimal(numerator), _GUARD.multiply(length, whole))
    return distance <= 0, Context(prec=DIGITS).plus(distance)


def _fractions(v) -> list[Fraction]:
    return [Fraction(x) for x in v.tolist()]


def _decimal(x: Fraction) -> Decimal:
    return _GUARD.divide(Decimal(x.numerator), Decimal(x.denominator))
