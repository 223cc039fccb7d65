"""Whether two triangles meet, in doubles with proven error bounds: yes, no, or ambiguous.

O. Devillers and P. Guigue, "Faster triangle-triangle intersection tests" (INRIA RR-4488, 2002): on which sides of each
triangle's plane the other's corners are, and two more orientations. Here a sign counts only beyond its error bound.

Bounds, with E the error of a coordinate of B's corners, u = 2⁻⁵³, L the largest component of an edge of the
plane's triangle and D that of w, from its first corner to one of the other triangle:
normal of A: edges are off by uL, so each component by 8uL²; sides: 3·(2L²(E + uD) + 8uL²D) + 18uL²D;
normal of B: edges are off by 2E + uL: 24·L·D·E more. Orientation of any four: `sign_error`. Products may underflow:
`TINY`.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, component, cross, dot, max_abs, sub, vec3_at

#: Verdicts of `meeting_in_doubles`.
APART, MEETING, AMBIGUOUS = 0, 1, -1

_U = 2.0**-53
#: Larger than anything that underflows in a product of three numbers below 1e50.
TINY = 1e-260


@kernel(inline=True)
def same_side(signs, limit):
    """Whether three numbers are certainly of one sign, errors being at most the limit."""
    return (signs.x > limit and signs.y > limit and signs.z > limit) or (
        signs.x < -limit and signs.y < -limit and signs.z < -limit
    )


@kernel(inline=True)
def _all_certain(signs, limit):
    return abs(signs.x) > limit and abs(signs.y) > limit and abs(signs.z) > limit


@kernel(inline=True)
def meeting_in_doubles(A, a, B, b, error):
    """APART, MEETING or AMBIGUOUS for the triangles A[a:] and B[b:], both in A's frame.

    error : bound of the error of every coordinate of B's corners.
    """
    # Sides of B's corners of A's plane.
    first = vec3_at(A, a)
    u = sub(vec3_at(A, a + 3), first)
    v = sub(vec3_at(A, a + 6), first)
    w0 = sub(vec3_at(B, b), first)
    w1 = sub(vec3_at(B, b + 3), first)
    w2 = sub(vec3_at(B, b + 6), first)
    n = cross(u, v)
    sides_b = Vec3(dot(n, w0), dot(n, w1), dot(n, w2))
    edge = max(max_abs(u), max_abs(v))
    far = max(max_abs(w0), max_abs(w1), max_abs(w2))
    limit_b = edge * edge * (8.0 * error + 64.0 * _U * far) + TINY
    if same_side(sides_b, limit_b):
        return APART
    # Sides of A's corners of B's plane.
    f = sub(w1, w0)
    g = sub(w2, w0)
    n = cross(f, g)
    sides_a = Vec3(-dot(n, w0), dot(n, sub(u, w0)), dot(n, sub(v, w0)))
    reach = far + edge
    # Edges are differences of differences here: 2E + 3u(D + L) off.
    side = max(max_abs(f), max_abs(g))
    slack = 2.0 * error + 4.0 * _U * reach
    limit_a = side * (8.0 * side * slack + 32.0 * reach * slack + 64.0 * _U * side * reach) + TINY
    if same_side(sides_a, limit_a):
        return APART
    if not (_all_certain(sides_b, limit_b) and _all_certain(sides_a, limit_a)):
        return AMBIGUOUS
    return _intervals_overlap(A, a, sides_a, B, b, sides_b, sign_error(reach, error))


@kernel(inline=True)
def sign_error(reach, error):
    """Error of the orientation of four corners, all within ``reach`` of a common point along every axis.

    Differences are off by f = 2E + 2uD and at most 2D: 72 D²f, and 240 uD³ by rounding.
    """
    return reach * reach * (160.0 * error + 640.0 * _U * reach) + TINY


@kernel
def _intervals_overlap(A, a, sides_a, B, b, sides_b, limit):
    """APART, MEETING or AMBIGUOUS: whether triangles overlap on the line of their planes, which both cross.

    sides_a : the certain sides of A's corners at B's plane; sides_b likewise.
    """
    # The corner of A that is alone on its side of B's plane comes first; B is turned over so that it lies above.
    i = _alone(sides_a)
    j = _alone(sides_b)
    p1 = a + 3 * i
    q1 = a + 3 * ((i + 1) % 3)
    r1 = a + 3 * ((i + 2) % 3)
    p2 = b + 3 * j
    q2 = b + 3 * ((j + 1) % 3)
    r2 = b + 3 * ((j + 2) % 3)
    if not component(sides_a, i) > 0.0:
        q2, r2 = r2, q2
    if not component(sides_b, j) > 0.0:
        q1, r1 = r1, q1
    lower = orientation(A, p1, A, q1, B, p2, B, q2)
    if lower > limit:
        return APART
    upper = orientation(A, p1, A, r1, B, r2, B, p2)
    if upper > limit:
        return APART
    return MEETING if lower < -limit and upper < -limit else AMBIGUOUS


@kernel(inline=True)
def _alone(a):
    """Position of the number whose sign neither other has; all three are nonzero, and both signs occur."""
    if (a.y > 0.0) == (a.z > 0.0):
        return 0
    return 1 if (a.x > 0.0) == (a.z > 0.0) else 2


@kernel
def orientation(A, a, B, b, C, c, D, d):
    """(b − a) × (c − a) · (d − a), rounded."""
    first = vec3_at(A, a)
    return dot(cross(sub(vec3_at(B, b), first), sub(vec3_at(C, c), first)), sub(vec3_at(D, d), first))


@kernel(inline=True)
def opposed(x, y, limit):
    """Whether two numbers certainly have different signs, errors being at most the limit."""
    return (x > limit and y < -limit) or (x < -limit and y > limit)


@kernel(inline=True)
def segment_against_triangle(T, t, S, p, q, error):
    """(APART, MEETING or AMBIGUOUS, whether p is above the plane) for the segment S[p:], S[q:] and the triangle T[t:].

    MEETING : the segment crosses the inside of the triangle.   error : bound of the error of a coordinate of S.
    """
    first = vec3_at(T, t)
    far = max(max_abs(sub(vec3_at(T, t + 3), first)), max_abs(sub(vec3_at(T, t + 6), first)))
    limit = sign_error(max(far, max_abs(sub(vec3_at(S, p), first)), max_abs(sub(vec3_at(S, q), first))), error)
    start = orientation(T, t, T, t + 3, T, t + 6, S, p)
    end = orientation(T, t, T, t + 3, T, t + 6, S, q)
    above = start > 0.0
    if (start > limit and end > limit) or (start < -limit and end < -limit):
        return APART, above
    x = orientation(T, t, T, t + 3, S, p, S, q)
    y = orientation(T, t + 3, T, t + 6, S, p, S, q)
    if opposed(x, y, limit):
        return APART, above
    z = orientation(T, t + 6, T, t, S, p, S, q)
    if opposed(x, z, limit) or opposed(y, z, limit):
        return APART, above
    certain = abs(start) > limit and abs(end) > limit and _all_certain(Vec3(x, y, z), limit)
    return MEETING if certain else AMBIGUOUS, above
