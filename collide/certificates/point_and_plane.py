"""Two facts about posed convex sets, in fractions: how far a set reaches along a direction, and whether a set holds a
point.

A set at a pose is the linear image of the set in its frame, by the matrix as given; balls of spheres, capsules and
rounded hulls are swept in the world. With R, t the placement of a part and w = Rᵀn:

=========== ======================================================= ==============================================
part        largest n·x of its points                               holds x, u = R⁻¹(x − t)
=========== ======================================================= ==============================================
points      max n·x_i + radius |n|                                  the hull comes within the radius of x
cylinder    n·t + h |w_z| + r √(w_x² + w_y²)                        |u_z| ≤ h and u_x² + u_y² ≤ r²
cone        n·t + max(h w_z, −h w_z + r √(w_x² + w_y²))             |u_z| ≤ h and 4 h² (u_x² + u_y²) ≤ r² (h − u_z)²
ellipsoid   n·t + √(Σ (r_i w_i)²)                                   Σ (u_i / r_i)² ≤ 1
half-space  offset, for n along its normal; else without a bound    n·x ≤ offset
=========== ======================================================= ==============================================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import chain
from typing import NamedTuple

import numpy as np

from collide.certificates.exact_parts import ExactPart
from collide.certificates.nearest_to_origin import nearest_to_origin, nearest_vertex_pairs
from collide.lowering.convex_sets import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.numerics.exact_points import PlacedPoints, Point, opposite
from collide.numerics.exact_vectors import cross, inner

#: x, y, z, w > 0: the point x/w, y/w, z/w of the world [m].
WeightedPoint = tuple[int, int, int, int]


class Reach(NamedTuple):
    """The number a + √b."""

    a: Fraction
    b: Fraction


def flaw_of_normal(A: ExactPart, B: ExactPart, normal: Point) -> str | None:
    """Why a normal fails to prove A beyond B, n·(a − b) > 0 for all of their points; ``None`` for a proof. O(vertices).
    """
    return flaw_of_normals([A], [B], normal)


def flaw_of_normals(A: Sequence[ExactPart], B: Sequence[ExactPart], normal: Point) -> str | None:
    """The same of two unions of parts."""
    backwards = [reaches(part, opposite(normal)) for part in A]
    forwards = [reaches(part, normal) for part in B]
    if not all(backwards + forwards):
        return "a half-space ends along its normal alone"
    # max n·b − min n·a is the sum of a reach of each.
    if all(sign_with_roots(p.a + q.a, p.b, q.b) < 0 for p in chain(*backwards) for q in chain(*forwards)):
        return None
    return "A and B are not on different sides of the plane"


def flaw_of_point(A: ExactPart, B: ExactPart, point: WeightedPoint) -> str | None:
    """Why a point fails to prove that A and B meet; ``None`` for a proof."""
    if point[3] <= 0:
        return "a point (x, y, z, w) needs w > 0"
    for part, name in ((A, "A"), (B, "B")):
        if not holds(part, point):
            return f"{name} does not hold the point"
    return None


def reaches(part: ExactPart, n: Point) -> list[Reach]:
    """n·x is at most the largest of these for x in a part, and as large somewhere; empty where n·x has no bound."""
    zero = Fraction(0)
    if part.kind == HALFSPACE:
        m, offset = part.plane
        if any(cross(m, [Fraction(c) for c in n])) or inner(m, n) <= 0:
            return []
        k = next(k for k in range(3) if n[k])
        return [Reach(offset * n[k] / m[k], zero)]
    if part.kind == POINTS:
        farthest = part.vertices[part.vertices.first_along(opposite(n))]
        return [Reach(inner(n, farthest) * Fraction(2) ** part.vertices.grid, part.radius**2 * inner(n, n))]
    rows, t = part.placement
    w = tuple(inner(n, column) for column in zip(*rows))
    at, sizes = inner(n, t), [Fraction(v) for v in part.params]
    if part.kind == ELLIPSOID:
        return [Reach(at, sum(((r * c) ** 2 for r, c in zip(sizes[:3], w)), zero))]
    radius, half = sizes[:2]
    rim = radius**2 * (w[0] ** 2 + w[1] ** 2)
    if part.kind == CYLINDER:
        return [Reach(at + half * abs(w[2]), rim)]
    return [Reach(at + half * w[2], zero), Reach(at - half * w[2], rim)]


def holds(part: ExactPart, point: WeightedPoint) -> bool:
    """Whether a part holds a point, w > 0; ``False`` of curved parts and half-spaces that a matrix makes flat."""
    w = point[3]
    if part.kind == HALFSPACE:
        n, offset = part.plane
        return any(n) and inner(n, point) <= offset * w
    if part.kind == POINTS:
        return _hull_is_near(part, point)
    (r0, r1, r2), t = part.placement
    adjugate = tuple(zip(cross(r1, r2), cross(r2, r0), cross(r0, r1)))
    det = inner(r0, cross(r1, r2))
    if det == 0:
        return False
    away = [Fraction(c, w) - s for c, s in zip(point, t)]
    x, y, z = (inner(row, away) / det for row in adjugate)
    sizes = [Fraction(v) for v in part.params]
    if part.kind == ELLIPSOID:
        return all(sizes[:3]) and (x / sizes[0]) ** 2 + (y / sizes[1]) ** 2 + (z / sizes[2]) ** 2 <= 1
    radius, half = sizes[:2]
    square = x * x + y * y
    if abs(z) > half or square > radius * radius:
        return False
    return part.kind != CONE or 4 * half * half * square <= (radius * (half - z)) ** 2


def _hull_is_near(part: ExactPart, point: WeightedPoint) -> bool:
    """Whether the point of the hull of vertices nearest a point is at most the radius away: O(vertices) a round."""
    seen = seen_from(part.vertices, point)
    pairs = nearest_vertex_pairs(seen, _ORIGIN.on_grid(seen.grid), [(0, 0)])
    v, scale, _ = nearest_to_origin([seen[i] for i, _ in pairs])
    radius = part.radius * point[3] / Fraction(2) ** seen.grid
    return inner(v, v) <= (radius * scale) ** 2


_ORIGIN = PlacedPoints(np.zeros((1, 3)), [])


def seen_from(points: PlacedPoints, point: WeightedPoint) -> PlacedPoints:
    """Points times w seen from a point of the world, in integers on their grid, which is made no coarser than 1 m."""
    finer = points.on_grid(min(points.grid, 0))
    x, y, z = (c << -finer.grid for c in point[:3])
    return finer.minus((x, y, z), point[3])


def sign_with_roots(a: Fraction, b: Fraction, c: Fraction) -> int:
    """The sign of a + √b + √c, b and c ≥ 0.

    For a < 0 both sides of √b + √c against −a are squared, 2 √(b c) against d = a² − b − c, and once more.
    """
    if a >= 0:
        return int(a > 0 or b > 0 or c > 0)
    d = a * a - b - c
    over = b * c * 4 - d * d
    return 1 if d < 0 else (over > 0) - (over < 0)


def in_lowest_terms(x: Sequence[Fraction]) -> WeightedPoint:
    """A point of fractions [m] as integers over the least common denominator."""
    w = math.lcm(*(c.denominator for c in x))
    return (*(int(c * w) for c in x), w)  # type: ignore[return-value]


def root_no_less(square: Fraction, digits: int) -> Fraction:
    """√square where the root is a fraction, else a fraction above the root, by less than 2^-digits of the root."""
    p, q = square.numerator, square.denominator
    if math.isqrt(p) ** 2 == p and math.isqrt(q) ** 2 == q:
        return Fraction(math.isqrt(p), math.isqrt(q))
    shift = max(digits + q.bit_length() - p.bit_length(), digits)
    return Fraction(math.isqrt((p << 2 * shift) // q) + 1, 1 << shift)
