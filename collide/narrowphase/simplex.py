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
        wi, wj, wk = face_weights(points, POINT * i, POINT * j, POINT * k)
        if wi > 0.0 and wj > 0.0 and wk > 0.0:
            best = _try(
                points, n, weights, best,
                _weight(0, i, wi, j, wj, k, wk), _weight(1, i, wi, j, wj, k, wk),
                _weight(2, i, wi, j, wj, k, wk), _weight(3, i, wi, j, wj, k, wk),
            )  # fmt: skip
    return best


@kernel
def face_weights(points, a, b, c):
    """Barycentric coordinates of the origin's projection on the plane of three points.

    All zero where the three are collinear. Measured from a, so that the error is that of the
    points over the height of the triangle.
    """
    ax = points[a]
    ay = points[a + 1]
    az = points[a + 2]
    ex = points[b] - ax
    ey = points[b + 1] - ay
    ez = points[b + 2] - az
    fx = points[c] - ax
    fy = points[c + 1] - ay
    fz = points[c + 2] - az
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
def clearance_of_origin(points):
    """How deep the origin lies in the tetrahedron of the first four points; −1 where it is outside.

    The least distance from the four face planes, each with the origin strictly on the side of the
    opposite vertex.
    """
    least = math.inf
    for left_out in range(4):
        i = 0 if left_out != 0 else 1
        j = 1 if left_out > 1 else 2
        k = 2 if left_out == 3 else 3
        a = POINT * i
        b = POINT * j
        c = POINT * k
        o = POINT * left_out
        ex = points[b] - points[a]
        ey = points[b + 1] - points[a + 1]
        ez = points[b + 2] - points[a + 2]
        fx = points[c] - points[a]
        fy = points[c + 1] - points[a + 1]
        fz = points[c + 2] - points[a + 2]
        nx = ey * fz - ez * fy
        ny = ez * fx - ex * fz
        nz = ex * fy - ey * fx
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if length == 0.0:
            return -1.0
        origin = -(nx * points[a] + ny * points[a + 1] + nz * points[a + 2]) / length
        other = (
            nx * (points[o] - points[a]) + ny * (points[o + 1] - points[a + 1]) + nz * (points[o + 2] - points[a + 2])
        ) / length
        if other < 0.0:
            origin = -origin
            other = -other
        if origin <= 0.0 or other <= 0.0:
            return -1.0
        least = min(least, origin)
    return least
