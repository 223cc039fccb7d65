"""Whether two triangles meet, in doubles with proven error bounds: yes, no, or more than doubles can tell.

O. Devillers and P. Guigue, "Faster triangle-triangle intersection tests" (INRIA RR-4488, 2002): the sides of
one's corners of the other's plane, and two more orientations. Here a sign counts only beyond its error bound.

Bounds, with E the error of a coordinate of B's corners, u = 2⁻⁵³, L the largest component of an edge of the
plane's triangle and D that of w, from its first corner to one of the other triangle:
normal of A: edges are off by uL, so each component by 8uL²; sides: 3·(2L²(E + uD) + 8uL²D) + 18uL²D;
normal of B: edges are off by 2E + uL: 24·L·D·E more. Orientation of any four: `sign_error`. Products may vanish: `TINY`.
"""

from __future__ import annotations

from collide.kernels import kernel

APART, MEETING, UNSURE = 0, 1, -1

_U = 2.0**-53
#: Larger than anything that underflows in a product of three numbers below 1e50.
TINY = 1e-260


@kernel(inline=True)
def meeting_in_doubles(P, Q, b, a, error):
    """APART, MEETING or UNSURE for the triangles P[a:a + 9] and Q[b:b + 9], both in A's frame.

    error : bound of the error of every coordinate of Q.
    """
    # Sides of B's corners of A's plane.
    x0 = P[a]
    y0 = P[a + 1]
    z0 = P[a + 2]
    ux = P[a + 3] - x0
    uy = P[a + 4] - y0
    uz = P[a + 5] - z0
    vx = P[a + 6] - x0
    vy = P[a + 7] - y0
    vz = P[a + 8] - z0
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    w0x = Q[b] - x0
    w0y = Q[b + 1] - y0
    w0z = Q[b + 2] - z0
    w1x = Q[b + 3] - x0
    w1y = Q[b + 4] - y0
    w1z = Q[b + 5] - z0
    w2x = Q[b + 6] - x0
    w2y = Q[b + 7] - y0
    w2z = Q[b + 8] - z0
    s0 = nx * w0x + ny * w0y + nz * w0z
    s1 = nx * w1x + ny * w1y + nz * w1z
    s2 = nx * w2x + ny * w2y + nz * w2z
    edge = max(abs(ux), abs(uy), abs(uz), abs(vx), abs(vy), abs(vz))
    far = max(abs(w0x), abs(w0y), abs(w0z), abs(w1x), abs(w1y), abs(w1z), abs(w2x), abs(w2y), abs(w2z))
    bound = edge * edge * (8.0 * error + 64.0 * _U * far) + TINY
    if (s0 > bound and s1 > bound and s2 > bound) or (s0 < -bound and s1 < -bound and s2 < -bound):
        return APART
    # Sides of A's corners of B's plane.
    fx = w1x - w0x
    fy = w1y - w0y
    fz = w1z - w0z
    gx = w2x - w0x
    gy = w2y - w0y
    gz = w2z - w0z
    nx = fy * gz - fz * gy
    ny = fz * gx - fx * gz
    nz = fx * gy - fy * gx
    r0 = -(nx * w0x + ny * w0y + nz * w0z)
    r1 = nx * (ux - w0x) + ny * (uy - w0y) + nz * (uz - w0z)
    r2 = nx * (vx - w0x) + ny * (vy - w0y) + nz * (vz - w0z)
    reach = far + edge
    # Edges are differences of differences here: 2E + 3u(D + L) off.
    side = max(abs(fx), abs(fy), abs(fz), abs(gx), abs(gy), abs(gz))
    slack = 2.0 * error + 4.0 * _U * reach
    limit = side * (8.0 * side * slack + 32.0 * reach * slack + 64.0 * _U * side * reach) + TINY
    if (r0 > limit and r1 > limit and r2 > limit) or (r0 < -limit and r1 < -limit and r2 < -limit):
        return APART
    sure = (
        abs(s0) > bound and abs(s1) > bound and abs(s2) > bound
        and abs(r0) > limit and abs(r1) > limit and abs(r2) > limit
    )  # fmt: skip
    if not sure:
        return UNSURE
    return _crossing(P, Q, b, a, s0, s1, s2, r0, r1, r2, sign_error(reach, error))


@kernel(inline=True)
def sign_error(reach, error):
    """Error of the orientation of four corners, none farther than ``reach`` from one point along an axis.

    Differences are off by f = 2E + 2uD and at most 2D: 72 D²f, and 240 uD³ by rounding.
    """
    return reach * reach * (160.0 * error + 640.0 * _U * reach) + TINY


@kernel
def _crossing(P, Q, b, a, s0, s1, s2, r0, r1, r2, limit):
    """The planes cross, and both triangles cross the line: whether they overlap on it."""
    # The corner of A that is alone on its side of B's plane comes first; B is turned over so that it lies above.
    i = _alone(r0, r1, r2)
    above = (r0 if i == 0 else (r1 if i == 1 else r2)) > 0.0
    j = _alone(s0, s1, s2)
    over = (s0 if j == 0 else (s1 if j == 1 else s2)) > 0.0
    p1 = a + 3 * i
    q1 = a + 3 * ((i + 1) % 3)
    r1_at = a + 3 * ((i + 2) % 3)
    p2 = b + 3 * j
    q2 = b + 3 * ((j + 1) % 3)
    r2_at = b + 3 * ((j + 2) % 3)
    if not above:
        q2, r2_at = r2_at, q2
    if not over:
        q1, r1_at = r1_at, q1
    one = orientation(P, p1, P, q1, Q, p2, Q, q2)
    if one > limit:
        return APART
    two = orientation(P, p1, P, r1_at, Q, r2_at, Q, p2)
    if two > limit:
        return APART
    return MEETING if one < -limit and two < -limit else UNSURE


@kernel(inline=True)
def _alone(x, y, z):
    """Which of three numbers, none 0 and not all of one sign, has a sign of its own."""
    if (y > 0.0) == (z > 0.0):
        return 0
    return 1 if (x > 0.0) == (z > 0.0) else 2


@kernel
def orientation(A, a, B, b, C, c, D, d):
    """(b − a) × (c − a) · (d − a), rounded."""
    ux = B[b] - A[a]
    uy = B[b + 1] - A[a + 1]
    uz = B[b + 2] - A[a + 2]
    vx = C[c] - A[a]
    vy = C[c + 1] - A[a + 1]
    vz = C[c + 2] - A[a + 2]
    wx = D[d] - A[a]
    wy = D[d + 1] - A[a + 1]
    wz = D[d + 2] - A[a + 2]
    return (uy * vz - uz * vy) * wx + (uz * vx - ux * vz) * wy + (ux * vy - uy * vx) * wz
