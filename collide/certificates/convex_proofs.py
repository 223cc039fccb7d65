"""Whether vertex pairs prove a hit of two convex parts, or a gap between them. Every vertex is evaluated in doubles:
vertices possibly farthest along a normal are compared in integers (`PlacedPoints.first_along`).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from collide.certificates.certificate import VertexPair
from collide.certificates.exact_parts import ExactPart, common_vertices
from collide.certificates.nearest_to_origin import nearest_to_origin
from collide.lowering.convex_sets import HALFSPACE, POINTS
from collide.numerics.exact_points import in_integers, opposite
from collide.numerics.exact_vectors import inner, minus


def flaw_of_proof(A: ExactPart, B: ExactPart, pairs: Sequence[VertexPair], *, hit: bool) -> str | None:
    """Why vertex pairs fail to prove a hit (hit) or gap of A and B; ``None`` for a proof. O(vertices)."""
    if not all(part.kind in (POINTS, HALFSPACE) for part in (A, B)):
        return "vertices prove nothing of a cylinder, cone or ellipsoid"
    if HALFSPACE in (A.kind, B.kind):
        return flaw_of_plane_proof(A, B, pairs, hit=hit)
    if not 1 <= len(pairs) <= 4:
        return f"one to four vertex pairs are needed, not {len(pairs)}"
    for i, j in pairs:
        if not (0 <= i < len(A) and 0 <= j < len(B)):
            return f"there is no vertex pair {i}, {j}"
    points_a, points_b, grid = common_vertices(A, B)
    radius = (A.radius + B.radius) / Fraction(2) ** grid  # in units of the grid, as all that follows
    v, scale, _ = nearest_to_origin([minus(points_a[i], points_b[j]) for i, j in pairs])
    square = inner(v, v)
    if hit:
        return None if square <= radius**2 * scale**2 else "the points named do not come within the radii of the origin"
    if square == 0:
        return "the points named contain the origin, so they give no axis"
    i, j = points_a.first_along(v), points_b.first_along(opposite(v))
    gap = inner(v, minus(points_a[i], points_b[j]))
    if gap > 0 and gap**2 > radius**2 * square:
        return None
    return f"vertex {i} of A and vertex {j} of B are not apart along the axis"


def flaw_of_plane_proof(A: ExactPart, B: ExactPart, pairs: Sequence[VertexPair], *, hit: bool) -> str | None:
    """As `flaw_of_proof`, for a pair with a half-space {x : n·x ≤ offset}.

    A vertex p reaches the half-space where n·p − offset ≤ radius·|n|.
    """
    if A.kind == B.kind:
        return "two half-spaces have no certificate"
    halfspace, body = (A, B) if A.kind == HALFSPACE else (B, A)
    n, offset = halfspace.plane
    points, unit = body.vertices, Fraction(2) ** body.vertices.grid
    limit = (body.radius / unit) ** 2 * inner(n, n)

    def is_clear(vertex: int) -> bool:
        height = inner(n, points[vertex]) - offset / unit
        return height > 0 and height**2 > limit

    if hit:
        vertices = [j if halfspace is A else i for i, j in pairs]
        if any(0 <= k < len(points) and not is_clear(k) for k in vertices):
            return None
        return "no vertex named reaches the half-space"
    lowest = points.first_along(in_integers(n))
    return None if is_clear(lowest) else f"vertex {lowest} reaches the half-space"
