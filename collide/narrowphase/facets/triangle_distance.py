"""The nearest points of two triangles in doubles, and a proven lower bound of how far apart they are.

Features first: nine pairs of edges, then six corners over the other's face (E. Larsen, S. Gottschalk, M. C. Lin,
D. Manocha, "Fast proximity queries with swept sphere volumes", 1999). Whatever rounding did to them, the points
found are points of the triangles, so their distance is an upper bound; the slab between the triangles across
the line that joins them is a lower one, since triangles are convex.

Two triangles T are 18 doubles: the corners of A's, then of B's.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.mesh.triangle import normal_of, triangle_at
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, neg, put_vec3, scale, sub, vec3_at

#: A slab at least so many times as wide as two points are apart is that wide but for rounding.
_AS_WIDE = 1.0 - 2.0**-44
#: A barycentric coordinate that rounding may have made of 0.
_INSIDE = 2.0**-30


@kernel
def nearest_points(T, out):
    """(distance, slab) of two triangles that do not meet; out becomes a point of A's and a point of B's (6 doubles).

    The slab is the width of the slab across the line between the points; a slab as wide as the points are apart proves
    them nearest.
    """
    best = _over_face(T, 9, 0, _over_face(T, 0, 9, math.inf, out), out)
    length = math.sqrt(best)
    width = _slab_between(T, out, length) if best < math.inf else -math.inf
    if width >= length * _AS_WIDE:
        return length, width
    for i in range(3):
        a = vec3_at(T, 3 * i)
        e = sub(vec3_at(T, 3 * ((i + 1) % 3)), a)
        ee = dot(e, e)
        for j in range(3):
            b = vec3_at(T, 9 + 3 * j)
            f = sub(vec3_at(T, 9 + 3 * ((j + 1) % 3)), b)
            w = sub(a, b)
            s, t = _nearest_on_segments(ee, dot(f, f), dot(e, f), dot(e, w), dot(f, w))
            d = sub(add(w, scale(s, e)), scale(t, f))
            square = dot(d, d)
            if square < best:
                best = square
                length = math.sqrt(square)
                put_vec3(out, 0, add(a, scale(s, e)))
                put_vec3(out, 3, add(b, scale(t, f)))
                width = _slab_between(T, out, length)
                if width >= length * _AS_WIDE:
                    return length, width
    return length, width


@kernel(inline=True)
def _slab_between(T, points, length):
    """Width of the slab across the line between two points."""
    if not length > 0.0:
        return 0.0
    return slab(T, scale((1.0 - 2.0**-50) / length, sub(vec3_at(points, 3), vec3_at(points, 0))))


@kernel(inline=True)
def separated_by(T, bound):
    """Whether a slab between the triangles is wider than the bound: across the line between their middles, or across
    the normal of either. A quick test that spares three of four pairs `nearest_points`."""
    a = triangle_at(T, 0)
    b = triangle_at(T, 9)
    n = sub(add(add(b.p, b.q), b.r), add(add(a.p, a.q), a.r))
    width = slab(T, n)
    if width > 0.0 and width * width > bound * bound * dot(n, n):
        return True
    return _face_separates(T, 0, 9, bound) or _face_separates(T, 9, 0, bound)


@kernel
def common_point(T, length, out):
    """A common point of two meeting triangles, so far as doubles can tell, in either half of ``out``.

    ``out`` holds nearest points of their features, ``length`` apart: right for triangles that touch or lie in a common
    plane. Elsewhere an edge of either goes through the inside of the other.
    """
    best = -_INSIDE
    for face in range(0, 18, 9):
        triangle = triangle_at(T, face)
        n = normal_of(triangle)
        square = dot(n, n)
        for k in range(3):
            a = vec3_at(T, 9 - face + 3 * k)
            b = vec3_at(T, 9 - face + 3 * ((k + 1) % 3))
            height_a = dot(n, sub(a, triangle.p))
            height_b = dot(n, sub(b, triangle.p))
            if not (height_a * height_b <= 0.0 and height_a != height_b and square > 0.0):
                continue
            x = add(a, scale(height_a / (height_a - height_b), sub(b, a)))
            beta, gamma = _barycentric(triangle, n, square, x)
            inside = min(beta, gamma, 1.0 - beta - gamma)
            if length > 0.0 and inside > best:
                best = inside
                put_vec3(out, 0, x)
                put_vec3(out, 3, x)


@kernel(inline=True)
def _barycentric(triangle, n, square, x):
    """Coordinates along q − p and r − p of the point of the plane below x: (w × v)·n and (u × w)·n over n·n."""
    w = sub(x, triangle.p)
    beta = dot(cross(w, sub(triangle.r, triangle.p)), n) / square
    return beta, dot(cross(sub(triangle.q, triangle.p), w), n) / square


@kernel(inline=True)
def _face_separates(T, face, corners, bound):
    """Whether the slab across the normal of one triangle is wider than the bound."""
    triangle = triangle_at(T, face)
    n = normal_of(triangle)
    # Seen across a computed normal the face itself has a width, of slivers no small one.
    height_q = dot(n, sub(triangle.q, triangle.p))
    height_r = dot(n, sub(triangle.r, triangle.p))
    low = math.inf
    high = -math.inf
    for k in range(corners, corners + 9, 3):
        height = dot(n, sub(vec3_at(T, k), triangle.p))
        low = min(low, height)
        high = max(high, height)
    width = max(low - max(height_q, height_r, 0.0), min(height_q, height_r, 0.0) - high)
    return width > 0.0 and width * width > bound * bound * dot(n, n)


@kernel(inline=True)
def _nearest_on_segments(ee, ff, ef, ew, fw):
    """Where the nearest points of two segments are, each from 0 to 1 along its segment; a segment may be a point.

    e, f : the segments.   w : from the start of f to the start of e; the arguments are products of these.
    """
    if ee <= 0.0:
        return 0.0, (min(max(fw / ff, 0.0), 1.0) if ff > 0.0 else 0.0)
    if ff <= 0.0:
        return min(max(-ew / ee, 0.0), 1.0), 0.0
    denominator = ee * ff - ef * ef
    s = min(max((ef * fw - ff * ew) / denominator, 0.0), 1.0) if denominator > 0.0 else 0.0
    t = (ef * s + fw) / ff
    if t < 0.0:
        return min(max(-ew / ee, 0.0), 1.0), 0.0
    if t > 1.0:
        return min(max((ef - ew) / ee, 0.0), 1.0), 1.0
    return s, t


@kernel
def _over_face(T, face, corners, best, out):
    """The least squared distance, and its points, of corners of one triangle over the inside of the other.

    best : the least so far.   face, corners : where both triangles start, 0 or 9.
    """
    triangle = triangle_at(T, face)
    n = normal_of(triangle)
    square = dot(n, n)
    if not square > 0.0:
        return best
    for k in range(corners, corners + 9, 3):
        x = vec3_at(T, k)
        height = dot(n, sub(x, triangle.p))
        if height * height >= best * square:
            continue
        beta, gamma = _barycentric(triangle, n, square, x)
        if beta < 0.0 or gamma < 0.0 or beta + gamma > 1.0:
            continue
        along = add(scale(beta, sub(triangle.q, triangle.p)), scale(gamma, sub(triangle.r, triangle.p)))
        foot = add(triangle.p, along)
        d = sub(x, foot)
        if dot(d, d) < best:
            best = dot(d, d)
            put_vec3(out, 0 if face == 0 else 3, foot)
            put_vec3(out, 3 if face == 0 else 0, x)
    return best


@kernel(inline=True)
def slab(T, n):
    """Width of the slab across n between the triangles, n pointing from A's to B's: least minus largest product."""
    high = dot(n, vec3_at(T, 0))
    low = dot(n, vec3_at(T, 9))
    for k in range(3, 9, 3):
        high = max(high, dot(n, vec3_at(T, k)))
        low = min(low, dot(n, vec3_at(T, 9 + k)))
    return low - high


@kernel
def widest_slab(T):
    """(width, unit vector from A's to B's) of the widest slab across a normal of either triangle or of a pair of edges.

    For pairs whose nearest points came out badly. (−∞, 0) where nothing has a direction.
    """
    best = -math.inf
    n = Vec3(0.0, 0.0, 0.0)
    for i in range(3):
        a = 3 * i
        b = 3 * ((i + 1) % 3)
        for j in range(5):
            # Edge i of A with the three edges of B; then edges 0 and 1 of A, and of B.
            if j < 3:
                c = 9 + 3 * j
                d = 9 + 3 * ((j + 1) % 3)
            else:
                if i > 0:
                    break
                a = 9 * (j - 3)
                b = a + 3
                c = a
                d = a + 6
            width, across = _slab_across(T, a, b, c, d)
            if width > best:
                best = width
                n = across
    return best, n


@kernel
def _slab_across(T, a, b, c, d):
    """(width, unit vector) of the slab across the edges from a to b and from c to d."""
    n = cross(sub(vec3_at(T, b), vec3_at(T, a)), sub(vec3_at(T, d), vec3_at(T, c)))
    length = math.sqrt(dot(n, n))
    if not length > 0.0:
        return -math.inf, Vec3(0.0, 0.0, 0.0)
    n = divide(n, length)
    width = slab(T, n)
    opposite = slab(T, neg(n))
    if opposite > width:
        return opposite, neg(n)
    return width, n
