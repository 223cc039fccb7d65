"""The point of a simplex that is nearest the origin, by looking at all of its faces.

Every candidate is a convex combination, so the best one is an upper bound of the distance however
thin the simplex is. All faces and edges are tried: leaving out those without the newest vertex gave
errors of many lengths in a prototype and no speed.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.narrowphase.minkowski import POINT


@kernel
def _try(points, n, weights, best, w0, w1, w2, w3):
    """Keep the combination if it lies nearer the origin than the best one so far."""
    x = w0 * points[0]
    y = w0 * points[1]
    z = w0 * points[2]
    if n > 1:
        x += w1 * points[POINT]
        y += w1 * points[POINT + 1]
        z += w1 * points[POINT + 2]
    if n > 2:
        x += w2 * points[2 * POINT]
        y += w2 * points[2 * POINT + 1]
        z += w2 * points[2 * POINT + 2]
    if n > 3:
        x += w3 * points[3 * POINT]
        y += w3 * points[3 * POINT + 1]
        z += w3 * points[3 * POINT + 2]
    square = x * x + y * y + z * z
    if square < best:
        weights[0] = w0
        weights[1] = w1
        weights[2] = w2
        weights[3] = w3
        weights[4] = x
        weights[5] = y
        weights[6] = z
        return square
    return best


@kernel
def _weight(k, i, wi, j, wj, l, wl):
    """Weight of vertex k where i, j, l carry wi, wj, wl."""
    return wi if k == i else (wj if k == j else (wl if k == l else 0.0))


@kernel
def nearest_in_simplex(points, n, weights):
    """Squared distance of the origin from the hull of the first n ≤ 4 points.

    weights : 7 doubles out: a weight for each point (0 beyond n), then the nearest point.
    """
    best = math.inf
    for i in range(n):
        best = _try(
            points, n, weights, best,
            1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0, 1.0 if i == 3 else 0.0,
        )  # fmt: skip
    for i in range(n):
        a = POINT * i
        for j in range(i + 1, n):
            b = POINT * j
            ex = points[b] - points[a]
            ey = points[b + 1] - points[a + 1]
            ez = points[b + 2] - points[a + 2]
            along = -(points[a] * ex + points[a + 1] * ey + points[a + 2] * ez)
            square = ex * ex + ey * ey + ez * ez
            if 0.0 < along < square:
                wj = along / square
                wi = 1.0 - wj
                best = _try(
                    points, n, weights, best,
                    _weight(0, i, wi, j, wj, -1, 0.0), _weight(1, i, wi, j, wj, -1, 0.0),
                    _weight(2, i, wi, j, wj, -1, 0.0), _weight(3, i, wi, j, wj, -1, 0.0),
                )  # fmt: skip
    if n < 3:
        return best
    for left_out in range(4 if n == 4 else 1):
        # The face opposite one vertex; with three points, the only face.
        i = 0 if (n == 3 or left_out != 0) else 1
        j = 1 if (n == 3 or left_out > 1) else 2
        k = 2 if (n == 3 or left_out == 3) else 3
        wi, wj, wk = face_weights(points, POINT * i, POINT * j, POINT * k, 0.0, 0.0, 0.0)
        if wi > 0.0 and wj > 0.0 and wk > 0.0:
            best = _try(
                points, n, weights, best,
                _weight(0, i, wi, j, wj, k, wk), _weight(1, i, wi, j, wj, k, wk),
                _weight(2, i, wi, j, wj, k, wk), _weight(3, i, wi, j, wj, k, wk),
            )  # fmt: skip
    return best


@kernel
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


@kernel
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
    e = math.sqrt(ex * ex + ey * ey + ez * ez)
    f = math.sqrt(fx * fx + fy * fy + fz * fz)
    p = math.sqrt(px * px + py * py + pz * pz)
    if not px * nx + py * ny + pz * nz > 2.0 * error * (e * f + 2.0 * p * (e + f)):
        return -1.0
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return -1.0
    return (
        min(
            nx * px + ny * py + nz * pz,
            nx * points[b] + ny * points[b + 1] + nz * points[b + 2],
            nx * points[c] + ny * points[c + 1] + nz * points[c + 2],
        )
        / length
    )


@kernel
def clearance_in_tetrahedron(points, error):
    """How deep the origin provably lies in the hull of the first four points; −1 where it may not.

    The least clearance behind the four faces, which are oriented by the sign of the volume.
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
    least = math.inf
    for face in range(4):
        a = 0 if face < 2 else (one if face == 2 else other)
        b = one if face == 0 else 3 * POINT
        c = other if face == 0 or face == 2 else (one if face == 1 else 0)
        clearance = clearance_behind(points, a, b, c, error)
        if clearance <= error:
            return -1.0
        least = min(least, clearance)
    return least
