"""The point of a simplex that is nearest the origin, by looking at all of its faces.

Every candidate is a convex combination, so the best one is an upper bound of the distance however
thin the simplex is. All faces and edges are tried: leaving out those without the newest vertex gave
errors of many lengths in a prototype and no speed.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.narrowphase.minkowski import POINT


@kernel(inline=True)
def nearest_in_simplex(points, n, weights, faces):
    """Squared distance of the origin from the hull of the first n ≤ 4 points.

    weights : 7 doubles out: a weight for each point (0 beyond n), then the nearest point.
    faces : of four points, the faces that may hold the nearest one (`faces_in_sight`): bit k is the one
        across point k. Ignored for fewer.
    """
    best = math.inf
    i0 = 0
    i1 = -1
    i2 = -1
    w1 = 0.0
    w2 = 0.0
    x = 0.0
    y = 0.0
    z = 0.0
    for i in range(n):
        a = POINT * i
        square = points[a] * points[a] + points[a + 1] * points[a + 1] + points[a + 2] * points[a + 2]
        if square < best:
            best = square
            i0 = i
            x = points[a]
            y = points[a + 1]
            z = points[a + 2]
    for i in range(n - 1):
        a = POINT * i
        for j in range(i + 1, n):
            if n == 4 and faces & ~((1 << i) | (1 << j)) == 0:
                continue
            b = POINT * j
            ex = points[b] - points[a]
            ey = points[b + 1] - points[a + 1]
            ez = points[b + 2] - points[a + 2]
            along = -(points[a] * ex + points[a + 1] * ey + points[a + 2] * ez)
            length = ex * ex + ey * ey + ez * ez
            if 0.0 < along < length:
                w = along / length
                px = points[a] + w * ex
                py = points[a + 1] + w * ey
                pz = points[a + 2] + w * ez
                square = px * px + py * py + pz * pz
                if square < best:
                    best = square
                    i0 = i
                    i1 = j
                    w1 = w
                    x = px
                    y = py
                    z = pz
    if n > 2:
        for across in range(4 if n == 4 else 1):
            if n == 4 and faces & (1 << across) == 0:
                continue
            # The face across one point; with three points, the only face.
            i = 0 if (n == 3 or across != 0) else 1
            j = 1 if (n == 3 or across > 1) else 2
            k = 2 if (n == 3 or across == 3) else 3
            wi, wj, wk = face_weights(points, POINT * i, POINT * j, POINT * k, 0.0, 0.0, 0.0)
            if wi > 0.0 and wj > 0.0 and wk > 0.0:
                px = wi * points[POINT * i] + wj * points[POINT * j] + wk * points[POINT * k]
                py = wi * points[POINT * i + 1] + wj * points[POINT * j + 1] + wk * points[POINT * k + 1]
                pz = wi * points[POINT * i + 2] + wj * points[POINT * j + 2] + wk * points[POINT * k + 2]
                square = px * px + py * py + pz * pz
                if square < best:
                    best = square
                    i0 = i
                    i1 = j
                    i2 = k
                    w1 = wj
                    w2 = wk
                    x = px
                    y = py
                    z = pz
    weights[0] = 0.0
    weights[1] = 0.0
    weights[2] = 0.0
    weights[3] = 0.0
    weights[i0] = 1.0 - w1 - w2 if i1 >= 0 else 1.0
    if i1 >= 0:
        weights[i1] = w1
    if i2 >= 0:
        weights[i2] = w2
    weights[4] = x
    weights[5] = y
    weights[6] = z
    return best


@kernel(inline=True)
def across_simplex(points, n, vx, vy, vz):
    """The direction v made orthogonal to the edge or face of the first n = 2 or 3 points.

    Where the gap is tiny beside the bodies, v is a difference of large numbers and its direction is
    off by their rounding over the gap; edges give the same direction to full precision. Not
    normalised; v itself for other n, or where the points are collinear.
    """
    ex = points[POINT] - points[0]
    ey = points[POINT + 1] - points[1]
    ez = points[POINT + 2] - points[2]
    if n == 2:
        square = ex * ex + ey * ey + ez * ez
        along = (vx * ex + vy * ey + vz * ez) / square
        vx -= along * ex
        vy -= along * ey
        vz -= along * ez
        along = (vx * ex + vy * ey + vz * ez) / square  # once more: the first pass rounds at |v|
        return vx - along * ex, vy - along * ey, vz - along * ez
    if n != 3:
        return vx, vy, vz
    fx = points[2 * POINT] - points[0]
    fy = points[2 * POINT + 1] - points[1]
    fz = points[2 * POINT + 2] - points[2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    if nx * nx + ny * ny + nz * nz == 0.0:
        return vx, vy, vz
    if nx * vx + ny * vy + nz * vz < 0.0:
        return -nx, -ny, -nz
    return nx, ny, nz


@kernel(inline=True)
def face_weights(points, a, b, c, x, y, z):
    """Barycentric coordinates of the projection of (x, y, z) on the plane of three points.

    All zero where the three are collinear. Measured from a, so that the error is that of the
    points over the height of the triangle.
    """
    ex = points[b] - points[a]
    ey = points[b + 1] - points[a + 1]
    ez = points[b + 2] - points[a + 2]
    fx = points[c] - points[a]
    fy = points[c + 1] - points[a + 1]
    fz = points[c + 2] - points[a + 2]
    ax = points[a] - x
    ay = points[a + 1] - y
    az = points[a + 2] - z
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    square = nx * nx + ny * ny + nz * nz
    if square == 0.0:
        return 0.0, 0.0, 0.0
    # −a = λ e + μ f within the plane.
    lam = (nx * (az * fy - ay * fz) + ny * (ax * fz - az * fx) + nz * (ay * fx - ax * fy)) / square
    mu = (nx * (ay * ez - az * ey) + ny * (az * ex - ax * ez) + nz * (ax * ey - ay * ex)) / square
    return 1.0 - lam - mu, lam, mu


@kernel
def clearance_behind(points, a, b, c, error):
    """Distance of the origin behind the plane of a triangle, or −1 unless it is provably behind it.

    a, b, c : starts of three points, counter-clockwise as seen from outside.
    error : how far each point may be from its true place.

    The side is the sign of det(p, q, r) = p·(e × f). Moving the three points by ``error`` moves it by
    at most error·(|e||f| + 2|p|(|e| + |f|)) in first order, doubled here for the rest. Without this
    test a tetrahedron as thin as rounding "contained" an origin 0.29 m outside it. The distance is
    the least of the three corners' along the computed normal, a lower bound for any unit normal.
    """
    height, square = _height_behind(points, a, b, c, error)
    return height / math.sqrt(square) if height > 0.0 and square > 0.0 else -1.0


@kernel(inline=True)
def _height_behind(points, a, b, c, error):
    """(clearance·|n|, |n|²) of `clearance_behind`, or (−1, 0). Lengths are bounded by sums: no roots."""
    px = points[a]
    py = points[a + 1]
    pz = points[a + 2]
    ex = points[b] - px
    ey = points[b + 1] - py
    ez = points[b + 2] - pz
    fx = points[c] - px
    fy = points[c + 1] - py
    fz = points[c + 2] - pz
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    height = px * nx + py * ny + pz * nz
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    p = abs(px) + abs(py) + abs(pz)
    if not height > 2.0 * error * (e * f + 2.0 * p * (e + f)):
        return -1.0, 0.0
    height = min(
        height,
        nx * points[b] + ny * points[b + 1] + nz * points[b + 2],
        nx * points[c] + ny * points[c + 1] + nz * points[c + 2],
    )
    return height, nx * nx + ny * ny + nz * nz


@kernel(inline=True)
def faces_in_sight(points, error):
    """(faces, clearance): which faces of the first four points the origin may lie in front of.

    Bit k of ``faces`` is the face across point k; a face the origin provably lies behind cannot hold the
    nearest point. Where it lies behind all four, clearance is how deep it provably is in the hull, else −1.
    """
    ex = points[POINT] - points[0]
    ey = points[POINT + 1] - points[1]
    ez = points[POINT + 2] - points[2]
    fx = points[2 * POINT] - points[0]
    fy = points[2 * POINT + 1] - points[1]
    fz = points[2 * POINT + 2] - points[2]
    gx = points[3 * POINT] - points[0]
    gy = points[3 * POINT + 1] - points[1]
    gz = points[3 * POINT + 2] - points[2]
    volume = gx * (ey * fz - ez * fy) + gy * (ez * fx - ex * fz) + gz * (ex * fy - ey * fx)
    one = POINT if volume < 0.0 else 2 * POINT  # vertex 3 behind (0, one, other)
    other = 2 * POINT if volume < 0.0 else POINT
    faces = 0
    least = math.inf
    for k in range(4):
        # Across 3: (0, one, other); across other: (0, 3, one); across 0: (one, 3, other); across one: (other, 3, 0).
        a = 0 if k < 2 else (one if k == 2 else other)
        b = one if k == 0 else 3 * POINT
        c = other if k == 0 or k == 2 else (one if k == 1 else 0)
        height, square = _height_behind(points, a, b, c, error)
        if height <= 0.0:
            across = 3 if k == 0 else (other // POINT if k == 1 else (0 if k == 2 else one // POINT))
            faces |= 1 << across
        elif faces == 0:
            least = min(least, height * height / square if square > 0.0 else 0.0)
    if faces != 0:
        return faces, -1.0
    clearance = math.sqrt(least)
    return (15, -1.0) if clearance <= error else (0, clearance)
