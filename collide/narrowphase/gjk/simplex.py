"""The point of a simplex nearest the origin, by looking at all faces.

Every candidate is a convex combination, so the best candidate is an upper bound of the distance however thin the
simplex is. All faces and edges are tried: leaving out faces without the newest vertex gave errors of many lengths in a
prototype and no speed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.gjk.minkowski_difference import NEAREST_POINT, point_at
from collide.numerics.vec3 import Vec3, add, cross, dot, max_abs, neg, norm1, put_vec3, scale, sub

#: How often the weights of a point within a tetrahedron are corrected at most, and by how much of its size the weighted
#: point may miss.
_MAX_CORRECTIONS = 6
_MISS = 2.0**-51


class OnEdge(NamedTuple):
    """A candidate on an edge from a to b: its squared distance from the origin, the weight of b, and the point."""

    square: float
    wb: float
    v: Vec3


class OnFace(NamedTuple):
    """A candidate on a triangle: its squared distance from the origin, the weights of b and c, and the point."""

    square: float
    wb: float
    wc: float
    v: Vec3


@kernel(inline=True)
def _inside_edge(a, b):
    """The `OnEdge` nearest the origin inside an edge; infinitely far where that is an end."""
    e = sub(b, a)
    along = -dot(a, e)
    length = dot(e, e)
    if 0.0 < along < length:
        w = along / length
        v = add(a, scale(w, e))
        return OnEdge(dot(v, v), w, v)
    return OnEdge(math.inf, 0.0, Vec3(0.0, 0.0, 0.0))


@kernel(inline=True)
def _inside_triangle(a, b, c):
    """The `OnFace` nearest the origin inside a triangle; infinitely far where that is on its border."""
    wa, wb, wc = face_weights(a, b, c, Vec3(0.0, 0.0, 0.0))
    if wa > 0.0 and wb > 0.0 and wc > 0.0:
        v = add(add(scale(wa, a), scale(wb, b)), scale(wc, c))
        return OnFace(dot(v, v), wb, wc, v)
    return OnFace(math.inf, wb, wc, Vec3(0.0, 0.0, 0.0))


@kernel(inline=True)
def _on_triangle(a, b, c):
    """The `OnFace` of a triangle nearest the origin: of its inside, its edges and its corners."""
    best = _inside_triangle(a, b, c)
    edge = _inside_edge(a, b)
    if edge.square < best.square:
        best = OnFace(edge.square, edge.wb, 0.0, edge.v)
    edge = _inside_edge(a, c)
    if edge.square < best.square:
        best = OnFace(edge.square, 0.0, edge.wb, edge.v)
    edge = _inside_edge(b, c)
    if edge.square < best.square:
        best = OnFace(edge.square, 1.0 - edge.wb, edge.wb, edge.v)
    square = dot(a, a)
    if square <= best.square:
        best = OnFace(square, 0.0, 0.0, a)
    square = dot(b, b)
    if square <= best.square:
        best = OnFace(square, 1.0, 0.0, b)
    square = dot(c, c)
    if square <= best.square:
        best = OnFace(square, 0.0, 1.0, c)
    return best


@kernel(inline=True)
def _on_segment(points, n):
    """The `OnEdge` of one or two points nearest the origin."""
    a = point_at(points, 0)
    best = OnEdge(dot(a, a), 0.0, a)
    if n == 2:
        b = point_at(points, 1)
        inside = _inside_edge(a, b)
        if inside.square < best.square:
            best = inside
        square = dot(b, b)
        if square < best.square:
            best = OnEdge(square, 1.0, b)
    return best


@kernel(inline=True)
def nearest_in_simplex(points, n, weights, faces):
    """Squared distance of the origin from the hull of the first n ≤ 4 points.

    weights : 7 doubles out: a weight for each point (0 beyond n), then the nearest point.
    faces : of four points, the candidate faces (`faces_in_sight`): bit k is the face across point k. Ignored for fewer.
    """
    for k in range(4):
        weights[k] = 0.0
    if n < 3:
        on_edge = _on_segment(points, n)
        weights[0] = 1.0 - on_edge.wb
        weights[1] = on_edge.wb
        put_vec3(weights, NEAREST_POINT, on_edge.v)
        return on_edge.square
    best = OnFace(math.inf, 0.0, 0.0, Vec3(0.0, 0.0, 0.0))
    a, b, c = 0, 1, 2
    for across in range(3 if n == 3 else 0, 4):
        if n == 4 and faces & (1 << across) == 0:
            continue
        i = 1 if across == 0 else 0
        j = 2 if across < 2 else 1
        k = 2 if across == 3 else 3
        on_face = _on_triangle(point_at(points, i), point_at(points, j), point_at(points, k))
        if on_face.square < best.square:
            best = on_face
            a, b, c = i, j, k
    weights[a] = max(1.0 - best.wb - best.wc, 0.0)
    weights[b] = best.wb
    weights[c] = best.wc
    put_vec3(weights, NEAREST_POINT, best.v)
    return best.square


@kernel(cold=True)
def nearest_of_all(points, n, weights, faces):
    """`nearest_in_simplex`, called: few ways through GJK lead here."""
    return nearest_in_simplex(points, n, weights, faces)


@kernel(inline=True)
def across_simplex(points, n, v):
    """The direction v made orthogonal to the edge or face of the first n = 2 or 3 points.

    Where the gap is tiny beside the bodies, v is a difference of large numbers and its direction is
    off by their rounding over the gap; edges give the same direction to full precision. Not
    normalised; v itself for other n, or where the points are collinear.
    """
    a = point_at(points, 0)
    e = sub(point_at(points, 1), a)
    if n == 2:
        square = dot(e, e)
        v = sub(v, scale(dot(v, e) / square, e))
        return sub(v, scale(dot(v, e) / square, e))  # once more: the first pass rounds at |v|
    if n != 3:
        return v
    normal = cross(e, sub(point_at(points, 2), a))
    if dot(normal, normal) == 0.0:
        return v
    return neg(normal) if dot(normal, v) < 0.0 else normal


@kernel(inline=True)
def face_weights(a, b, c, p):
    """Barycentric coordinates of the projection of p on the plane of three points.

    All zero where the three are collinear. Measured from a, so the error is the points' error over the height of the
    triangle.
    """
    e, f = sub(b, a), sub(c, a)
    from_p = sub(a, p)
    n = cross(e, f)
    square = dot(n, n)
    if square == 0.0:
        return 0.0, 0.0, 0.0
    # p − a = λ e + μ f within the plane.
    lam = dot(n, cross(f, from_p)) / square
    mu = dot(n, cross(from_p, e)) / square
    return 1.0 - lam - mu, lam, mu


@kernel(inline=True)
def height_behind(n, p, q, r, error):
    """(h, |n|²): the origin lies h / |n| behind the plane of a triangle; (−1, 0) unless it provably does.

    n : the computed normal (q − p) × (r − p), outwards.   error : how far each point may be from its true place.

    The side is the sign of det(p, q, r) = p·(e × f), e = q − p, f = r − p. Moving the three points by ``error`` moves
    it by at most error·(|e||f| + 2|p|(|e| + |f|)) in first order, doubled here for the rest. Without this
    test a tetrahedron as thin as rounding "contained" an origin 0.29 m outside it. h / |n| is the least of
    the three corners' distances along the computed normal, a lower bound for any unit normal. Lengths are
    bounded by sums: no roots.
    """
    height = dot(p, n)
    e, f = norm1(sub(q, p)), norm1(sub(r, p))
    if not height > 2.0 * error * (e * f + 2.0 * norm1(p) * (e + f)):
        return -1.0, 0.0
    return min(height, dot(n, q), dot(n, r)), dot(n, n)


@kernel(inline=True)
def faces_in_sight(points, error):
    """(faces, clearance): faces of the first four points with the origin possibly in front.

    Bit k of ``faces`` is the face across point k; a face provably in front of the origin cannot hold the nearest point.
    Where the origin lies behind all four, clearance is its proven depth in the hull, else −1.
    """
    i = 1 if signed_volume(points, 0) < 0.0 else 2  # vertex 3 lies behind (0, i, j)
    j = 3 - i
    faces = 0
    least = math.inf
    for k in range(4):
        # Across 3: (0, i, j); across j: (0, 3, i); across 0: (i, 3, j); across i: (j, 3, 0).
        a = 0 if k < 2 else (i if k == 2 else j)
        b = i if k == 0 else 3
        c = j if k == 0 or k == 2 else (i if k == 1 else 0)
        p, q, r = point_at(points, a), point_at(points, b), point_at(points, c)
        height, square = height_behind(cross(sub(q, p), sub(r, p)), p, q, r, error)
        if height <= 0.0:
            faces |= 1 << (6 - a - b - c)
        elif faces == 0:
            least = min(least, height * height / square if square > 0.0 else 0.0)
    if faces != 0:
        return faces, -1.0
    clearance = math.sqrt(least)
    return (15, -1.0) if clearance <= error else (0, clearance)


@kernel(inline=True)
def signed_volume(points, first):
    """Six times the signed volume of four points in a row: positive where the last lies in front of the first three."""
    a = point_at(points, first)
    e, f, g = (
        sub(point_at(points, first + 1), a),
        sub(point_at(points, first + 2), a),
        sub(point_at(points, first + 3), a),
    )
    return dot(g, cross(e, f))


@kernel
def weigh_enclosed(points, weights):
    """Weights of the first four points at the origin, which lies among them: ratios of volumes.

    In a thin tetrahedron they are off by rounding over its height. The weighted point's miss of the origin is therefore
    weighed again. In a tetrahedron as thin as rounding this second step does not help: but then all of it is near its
    faces.

    Returns the final distance of the weighted point from the origin (infinite if the four are flat), and the
    tetrahedron's size.
    """
    a = point_at(points, 0)
    e, f, g = sub(point_at(points, 1), a), sub(point_at(points, 2), a), sub(point_at(points, 3), a)
    fg, ge, ef = cross(f, g), cross(g, e), cross(e, f)
    volume = dot(e, fg)
    size = max(max_abs(e), max_abs(f), max_abs(g))
    if volume == 0.0:
        return math.inf, size
    p = q = r = 0.0
    miss = neg(a)
    for _ in range(_MAX_CORRECTIONS):
        p += dot(miss, fg) / volume
        q += dot(miss, ge) / volume
        r += dot(miss, ef) / volume
        miss = neg(add(a, _combination(p, e, q, f, r, g)))
        if norm1(miss) <= _MISS * size:
            break
    p, q, r = max(p, 0.0), max(q, 0.0), max(r, 0.0)
    o = max(1.0 - p - q - r, 0.0)
    total = o + p + q + r
    weights[0] = o / total
    weights[1] = p / total
    weights[2] = q / total
    weights[3] = r / total
    return norm1(add(a, _combination(weights[1], e, weights[2], f, weights[3], g))), size


@kernel(inline=True)
def _combination(p, e, q, f, r, g):
    """p e + q f + r g."""
    return add(add(scale(p, e), scale(q, f)), scale(r, g))
