"""Whether a polytope, or a facet, meets a cylinder, cone or ellipsoid: rational signs alone.

Let P be the polytope, C the curved set. If they share a point, then one of these holds:

1. an edge of P meets C;
2. else, the plane of a facet of P meets C in the inside of the facet, as a whole: C cut by the plane is connected and
   meets no edge. So any single point of the cut decides;
3. else C misses the surface of P, and its centre lies in P.

An edge u + t e, 0 ≤ t ≤ 1, clipped by the ends of C (rational t), meets C iff q(t) = |side|² at that point is at most 0
somewhere: at an end of the interval, or at its least value −b/a, where the discriminant b² − a c ≥ 0. (Where a ≤ 0, in
a cone, {q ≤ 0} is a half-line, seen at an end.) A cut of a plane with C has a rational point: where the axis goes
through the plane, the point of its line in the plane of an end nearest the axis, the middle of an ellipsoid's cut.
(A cut of a cylinder's endless side is an ellipse around the axis's point; where that is beyond an end, a cut that
reaches the cylinder crosses the end's disc. A cone is the hull of its tip and disc.)

Degrees, with U a corner in C's frame, of degree 4 in the doubles given (adj R_C (R_P v + p_P − p_C)): an edge's q has
degree 2 in U, its discriminant 4; a facet's normal 2, a point of its cut 5, its side of an edge 8. No sign needs more
than 32 times the digits of a number given.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from collide.curved.shape_kinds import CYLINDER, ELLIPSOID
from collide.narrowphase.exact_curved.integer_bodies import (
    CurvedBody,
    SweptPoints,
    Vector,
    WorldPoint,
    is_left_of,
)
from collide.numerics.exact_vectors import cross, inner, minus

#: A number as numerator, denominator > 0.
Ratio = tuple[int, int]


def common_point(polytope: SweptPoints, C: CurvedBody, threshold: int, n: Vector) -> WorldPoint | None:
    """A point of a polytope without a radius and of C; None where both are apart.

    threshold, n : corners with n·x below the threshold, and facets and edges without others, are known to be outside C.
    """
    is_near = [inner(n, x) >= threshold for x in polytope.points]
    pose = C.pose
    local: list[Vector] = [pose.local((*x, 1))[:3] for x in polytope.points]
    for k, corner in enumerate(local):
        if is_near[k] and C.holds_local((*corner, pose.det)):
            return (*polytope.points[k], 1)
    for i, j in polytope.edges:
        if is_near[i] or is_near[j]:
            t = _on_edge(C, local[i], local[j])
            if t is not None:
                return _between(polytope.points[i], polytope.points[j], t)
    for triangle in polytope.triangles:
        if any(is_near[i] for i in triangle):
            u = _in_facet(C, [local[i] for i in triangle])
            if u is not None:
                return pose.placed(u[:3], u[3])
    return C.centre if polytope.holds_within(C.centre) else None


def _between(a: Vector, b: Vector, t: Ratio) -> WorldPoint:
    s, w = t
    return a[0] * (w - s) + b[0] * s, a[1] * (w - s) + b[1] * s, a[2] * (w - s) + b[2] * s, w


def _on_edge(C: CurvedBody, u: Vector, v: Vector) -> Ratio | None:
    """A t with u + t (v − u) in C, corners being in C's frame times det R."""
    e, det = minus(v, u), C.pose.det
    low, high = (0, 1), (1, 1)
    if C.kind == ELLIPSOID:
        weights, last = C.weights[:3], C.weights[3] * det * det
        a, b, c = (sum(g * x * y for g, x, y in zip(weights, p, q)) for p, q in ((e, e), (u, e), (u, u)))
        c -= last
    else:
        radius, half = C.sizes[0] * det, C.sizes[1] * det
        a, b, c = (p[0] * q[0] + p[1] * q[1] for p, q in ((e, e), (u, e), (u, u)))
        if C.kind == CYLINDER:
            c -= radius * radius
        else:
            s, scale = half - u[2], 4 * half * half
            a, b = scale * a - (radius * e[2]) ** 2, scale * b + radius * radius * s * e[2]
            c = scale * c - (radius * s) ** 2
        clipped = _clipped(u[2], e[2], half)
        if clipped is None:
            return None
        low, high = clipped
    for t in (low, high):
        if a * t[0] * t[0] + 2 * b * t[0] * t[1] + c * t[1] * t[1] <= 0:
            return t
    if a > 0 and low[0] * a < -b * low[1] and -b * high[1] < high[0] * a and b * b >= a * c:
        return -b, a
    return None


def _clipped(z: int, dz: int, half: int) -> tuple[Ratio, Ratio] | None:
    """The part of 0 ≤ t ≤ 1 with |z + t dz| ≤ half."""
    if dz == 0:
        return ((0, 1), (1, 1)) if abs(z) <= half else None
    first, last = ((-half - z, dz), (half - z, dz)) if dz > 0 else ((z - half, -dz), (z + half, -dz))
    low, high = max(first[0], 0), min(last[0], abs(dz))
    return ((low, abs(dz)), (high, abs(dz))) if low <= high else None


def _in_facet(C: CurvedBody, corners: Sequence[Vector]) -> WorldPoint | None:
    """A point of C in the inside of a facet, in C's frame; corners are in C's frame times det R."""
    a, b, c = corners
    normal = cross(minus(b, a), minus(c, a))
    if not any(normal):
        return None
    for x, y, z, w in _points_of_cut(C, normal, inner(normal, a)):
        p, v = ((x, y, z), w) if w > 0 else ((-x, -y, -z), -w)
        if all(is_left_of(p, v, s, e, normal) for s, e in ((a, b), (b, c), (c, a))):
            return (*p, v * C.pose.det)
    return None


def _points_of_cut(C: CurvedBody, n: Vector, d: int) -> Iterable[tuple[int, int, int, int]]:
    """Points (x, y, z, w), w ≠ 0, of C cut by the plane n·x = d, times det R: one at least where they meet."""
    det = C.pose.det
    if C.kind == ELLIPSOID:
        squares = [(a * det) ** 2 for a in C.sizes]
        total = sum(g * x * x for g, x in zip(squares, n))
        if d * d <= total:
            yield squares[0] * n[0] * d, squares[1] * n[1] * d, squares[2] * n[2] * d, total
        return
    radius, half = C.sizes[0] * det, C.sizes[1] * det
    if n[2] != 0 and abs(d) <= half * abs(n[2]):
        yield 0, 0, d, n[2]
    across = n[0] * n[0] + n[1] * n[1]
    for height in (-half, half) if C.kind == CYLINDER else (-half,):
        k = d - n[2] * height
        if across and k * k <= radius * radius * across:
            yield n[0] * k, n[1] * k, height * across, across
