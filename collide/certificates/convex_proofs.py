"""Whether vertex pairs prove that two convex parts meet, or that they are apart. Every vertex is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from collide.certificates.certificate import VertexPair
from collide.certificates.exact_parts import ExactPart, common_vertices
from collide.certificates.nearest_to_origin import nearest_to_origin
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.numerics.exact_points import Point
from collide.numerics.exact_vectors import inner, minus


def flaw_of_proof(A: ExactPart, B: ExactPart, pairs: Sequence[VertexPair], *, hit: bool) -> str | None:
    """Why vertex pairs do not prove that A and B meet (hit) or are apart; None where they do. O(vertices)."""
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
    along_a, along_b = [inner(v, p) for p in points_a], [inner(v, q) for q in points_b]
    gap = min(along_a) - max(along_b)
    if gap > 0 and gap**2 > radius**2 * square:
        return None
    i, j = along_a.index(min(along_a)), along_b.index(max(along_b))
    return f"vertex {i} of A and vertex {j} of B are not apart along the axis"


def flaw_of_plane_proof(A: ExactPart, B: ExactPart, pairs: Sequence[VertexPair], *, hit: bool) -> str | None:
    """The same where one part is a half-space {x : n·x ≤ offset}.

    A vertex p reaches it where n·p − offset ≤ radius·|n|.
    """
    if A.kind == B.kind:
        return "two half-spaces have no certificate"
    halfspace, body = (A, B) if A.kind == HALFSPACE else (B, A)
    n, offset = halfspace.plane
    points, grid = body.vertices
    denominator = max(c.denominator for c in n)  # powers of two
    normal = tuple(int(c * denominator) for c in n)
    limit = (body.radius / Fraction(2) ** grid) ** 2 * inner(normal, normal)
    offset = offset * denominator / Fraction(2) ** grid
    heights = [inner(normal, p) - offset for p in points]
    is_clear = [height > 0 and height**2 > limit for height in heights]
    if hit:
        vertices = [j if halfspace is A else i for i, j in pairs]
        if any(0 <= k < len(points) and not is_clear[k] for k in vertices):
            return None
        return "no vertex named reaches the half-space"
    return None if all(is_clear) else f"vertex {is_clear.index(False)} reaches the half-space"


def flaw_of_normal(A: ExactPart, B: ExactPart, normal: Point) -> str | None:
    """Why a normal does not prove that A lies beyond B along it; None where it does. O(vertices)."""
    if not (A.kind == B.kind == POINTS and A.radius == B.radius == 0):
        return "a plane proves something of convex bodies of vertices without radii alone"
    points_a, points_b, _ = common_vertices(A, B)
    along_a, along_b = [inner(normal, p) for p in points_a], [inner(normal, q) for q in points_b]
    if min(along_a) > max(along_b):
        return None
    i, j = along_a.index(min(along_a)), along_b.index(max(along_b))
    return f"vertex {i} of A and vertex {j} of B are not on different sides of the plane"
