"""The point of a simplex that is nearest the origin, by looking at all of its faces.

Every candidate is a convex combination, so the best one is an upper bound of the distance however
thin the simplex is. All faces and edges are tried: leaving out those without the newest vertex gave
errors of many lengths in a prototype and no speed.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.gjk.minkowski_difference import POINT

#: How often a point within a tetrahedron is weighed at most, and by how much of its size it may be missed.
_WEIGHED = 6
_MISSED = 2.0**-51


@kernel(inline=True)
def _on_edge(ax, ay, az, bx, by, bz):
    """(square, weight of b, x, y, z) of the point nearest the origin inside an edge; infinite where it is an end."""
    ex = bx - ax
    ey = by - ay
    ez = bz - az
    along = -(ax * ex + ay * ey + az * ez)
    length = ex * ex + ey * ey + ez * ez
    if 0.0 < along < length:
        w = along / length
        x = ax + w * ex
        y = ay + w * ey
        z = az + w * ez
        return x * x + y * y + z * z, w, x, y, z
    return math.inf, 0.0, 0.0, 0.0, 0.0


@kernel(inline=True)
def _on_triangle(points, a, b, c):
    """(square, weights of b and c, x, y, z) of the point of a triangle nearest the origin."""
    ax = points[a]
    ay = points[a + 1]
    az = points[a + 2]
    bx = points[b]
    by = points[b + 1]
    bz = points[b + 2]
    cx = points[c]
    cy = points[c + 1]
    cz = points[c + 2]
    wa, wb, wc = face_weights(points, a, b, c, 0.0, 0.0, 0.0)
    if wa > 0.0 and wb > 0.0 and wc > 0.0:
        x = wa * ax + wb * bx + wc * cx
        y = wa * ay + wb * by + wc * cy
        z = wa * az + wb * bz + wc * cz
        best = x * x + y * y + z * z
    else:
        best = math.inf
        x = y = z = 0.0
    square, w, px, py, pz = _on_edge(ax, ay, az, bx, by, bz)
    if square < best:
        best, wb, wc, x, y, z = square, w, 0.0, px, py, pz
    square, w, px, py, pz = _on_edge(ax, ay, az, cx, cy, cz)
    if square < best:
        best, wb, wc, x, y, z = square, 0.0, w, px, py, pz
    square, w, px, py, pz = _on_edge(bx, by, bz, cx, cy, cz)
    if square < best:
        best, wb, wc, x, y, z = square, 1.0 - w, w, px, py, pz
    square = ax * ax + ay * ay + az * az
    if square <= best:
        best, wb, wc, x, y, z = square, 0.0, 0.0, ax, ay, az
    square = bx * bx + by * by + bz * bz
    if square <= best:
        best, wb, wc, x, y, z = square, 1.0, 0.0, bx, by, bz
    square = cx * cx + cy * cy + cz * cz
    if square <= best:
        best, wb, wc, x, y, z = square, 0.0, 1.0, cx, cy, cz
    return best, wb, wc, x, y, z


@kernel(inline=True)
def nearest_in_simplex(points, n, weights, faces):
    """Squared distance of the origin from the hull of the first n ≤ 4 points.

    weights : 7 doubles out: a weight for each point (0 beyond n), then the nearest point.
    faces : of four points, the faces that may hold the nearest one (`faces_in_sight`): bit k is the one
        across point k. Ignored for fewer.
    """
    weights[0] = 0.0
    weights[1] = 0.0
    weights[2] = 0.0
    weights[3] = 0.0
    if n < 3:
        x = points[0]
        y = points[1]
        z = points[2]
        best = x * x + y * y + z * z
        w = 0.0
        if n == 2:
            bx = points[POINT]
            by = points[POINT + 1]
            bz = points[POINT + 2]
            square, w, px, py, pz = _on_edge(x, y, z, bx, by, bz)
            if square < best:
                best, x, y, z = square, px, py, pz
            else:
                w = 0.0
            square = bx * bx + by * by + bz * bz
            if square < best:
                best, w, x, y, z = square, 1.0, bx, by, bz
        weights[0] = 1.0 - w
        weights[1] = w
    else:
        best = math.inf
        x = y = z = 0.0
        first = 0
        second = 1
        third = 2
        wb = 0.0
        wc = 0.0
        for across in range(3 if n == 3 else 0, 4):
            if n == 4 and faces & (1 << across) == 0:
                continue
            i = 1 if across == 0 else 0
            j = 2 if across < 2 else 1
            k = 2 if across == 3 else 3
            square, ub, uc, px, py, pz = _on_triangle(points, POINT * i, POINT * j, POINT * k)
            if square < best:
                best, first, second, third, wb, wc, x, y, z = square, i, j, k, ub, uc, px, py, pz
        weights[first] = max(1.0 - wb - wc, 0.0)
        weights[second] = wb
        weights[third] = wc
    weights[4] = x
    weights[5] = y
    weights[6] = z
    return best


@kernel(cold=True)
def nearest_of_all(points, n, weights, faces):
    """`nearest_in_simplex`, called: it is asked for at two places, and seldom."""
    return nearest_in_simplex(points, n, weights, faces)


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


@kernel(inline=True)
def _height_behind(points, a, b, c, error):
    """`height_behind` of three points, whose starts are given counter-clockwise as seen from outside."""
    px = points[a]
    py = points[a + 1]
    pz = points[a + 2]
    qx = points[b]
    qy = points[b + 1]
    qz = points[b + 2]
    rx = points[c]
    ry = points[c + 1]
    rz = points[c + 2]
    ex = qx - px
    ey = qy - py
    ez = qz - pz
    fx = rx - px
    fy = ry - py
    fz = rz - pz
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    return height_behind(nx, ny, nz, px, py, pz, qx, qy, qz, rx, ry, rz, error)


@kernel(inline=True)
def height_behind(nx, ny, nz, px, py, pz, qx, qy, qz, rx, ry, rz, error):
    """(h, |n|²): the origin lies h / |n| behind the plane of a triangle; (−1, 0) unless it provably does.

    nx, ny, nz : the computed normal e × f of the corners p, q = p + e and r = p + f, outwards.
    error : how far each point may be from its true place.

    The side is the sign of det(p, q, r) = p·(e × f). Moving the three points by ``error`` moves it by
    at most error·(|e||f| + 2|p|(|e| + |f|)) in first order, doubled here for the rest. Without this
    test a tetrahedron as thin as rounding "contained" an origin 0.29 m outside it. h / |n| is the least of
    the three corners' distances along the computed normal, a lower bound for any unit normal. Lengths are
    bounded by sums: no roots.
    """
    height = px * nx + py * ny + pz * nz
    e = abs(qx - px) + abs(qy - py) + abs(qz - pz)
    f = abs(rx - px) + abs(ry - py) + abs(rz - pz)
    p = abs(px) + abs(py) + abs(pz)
    if not height > 2.0 * error * (e * f + 2.0 * p * (e + f)):
        return -1.0, 0.0
    height = min(height, nx * qx + ny * qy + nz * qz, nx * rx + ny * ry + nz * rz)
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


@kernel
def weigh_enclosed(points, weights):
    """Weights of the first four points at the origin, which lies among them: ratios of volumes.

    In a thin tetrahedron they are off by rounding over its height. What the weighted point misses the origin by is
    therefore weighed again. In one as thin as rounding that does not help: but then all of it is near its faces.

    Returns what the weighted point misses the origin by in the end (infinite if the four are flat), and the
    tetrahedron's size.
    """
    ax = points[0]
    ay = points[1]
    az = points[2]
    ex = points[POINT] - ax
    ey = points[POINT + 1] - ay
    ez = points[POINT + 2] - az
    fx = points[2 * POINT] - ax
    fy = points[2 * POINT + 1] - ay
    fz = points[2 * POINT + 2] - az
    gx = points[3 * POINT] - ax
    gy = points[3 * POINT + 1] - ay
    gz = points[3 * POINT + 2] - az
    volume = ex * (fy * gz - fz * gy) + ey * (fz * gx - fx * gz) + ez * (fx * gy - fy * gx)
    size = max(abs(ex), abs(ey), abs(ez), abs(fx), abs(fy), abs(fz), abs(gx), abs(gy), abs(gz))
    if volume == 0.0:
        return math.inf, size
    p = q = r = 0.0
    x = -ax
    y = -ay
    z = -az
    for _ in range(_WEIGHED):
        p += (x * (fy * gz - fz * gy) + y * (fz * gx - fx * gz) + z * (fx * gy - fy * gx)) / volume
        q += (x * (gy * ez - gz * ey) + y * (gz * ex - gx * ez) + z * (gx * ey - gy * ex)) / volume
        r += (x * (ey * fz - ez * fy) + y * (ez * fx - ex * fz) + z * (ex * fy - ey * fx)) / volume
        x = -(ax + (p * ex + q * fx + r * gx))
        y = -(ay + (p * ey + q * fy + r * gy))
        z = -(az + (p * ez + q * fz + r * gz))
        if abs(x) + abs(y) + abs(z) <= _MISSED * size:
            break
    p = max(p, 0.0)
    q = max(q, 0.0)
    r = max(r, 0.0)
    o = max(1.0 - p - q - r, 0.0)
    whole = o + p + q + r
    weights[0] = o / whole
    weights[1] = p / whole
    weights[2] = q / whole
    weights[3] = r / whole
    x = ax + (weights[1] * ex + weights[2] * fx + weights[3] * gx)
    y = ay + (weights[1] * ey + weights[2] * fy + weights[3] * gy)
    z = az + (weights[1] * ez + weights[2] * fz + weights[3] * gz)
    return abs(x) + abs(y) + abs(z), size
