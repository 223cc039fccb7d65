"""The nearest points of two triangles in doubles, and a proven lower bound of how far apart they are.

Features first: nine pairs of edges, then six corners over the other's face (E. Larsen, S. Gottschalk, M. C. Lin,
D. Manocha, "Fast proximity queries with swept sphere volumes", 1999). Whatever rounding did to them, the points
found are points of the triangles, so their distance is an upper bound; the slab between the triangles across
the line that joins them is a lower one, since triangles are convex.
"""

from __future__ import annotations

import math

from collide.kernels import kernel

#: A slab is as wide as two points are apart where it is so but for rounding.
_AS_WIDE = 1.0 - 2.0**-44

#: A barycentric coordinate that rounding may have made of 0.
_INSIDE = 2.0**-30


@kernel
def nearest_points(T, out):
    """(distance, slab) of the triangles T[0:9] and T[9:18] that do not meet; out becomes a point of either (6).

    The slab is the width of the one across the line between the points; once it is as wide as they are apart,
    nothing nearer can be found.
    """
    best = _over_face(T, 9, 0, _over_face(T, 0, 9, math.inf, out), out)
    length = math.sqrt(best)
    width = _slab_between(T, out, length) if best < math.inf else -math.inf
    if width >= length * _AS_WIDE:
        return length, width
    for i in range(3):
        a = 3 * i
        ex = T[3 * ((i + 1) % 3)] - T[a]
        ey = T[3 * ((i + 1) % 3) + 1] - T[a + 1]
        ez = T[3 * ((i + 1) % 3) + 2] - T[a + 2]
        ee = ex * ex + ey * ey + ez * ez
        for j in range(3):
            b = 9 + 3 * j
            c = 9 + 3 * ((j + 1) % 3)
            fx = T[c] - T[b]
            fy = T[c + 1] - T[b + 1]
            fz = T[c + 2] - T[b + 2]
            wx = T[a] - T[b]
            wy = T[a + 1] - T[b + 1]
            wz = T[a + 2] - T[b + 2]
            ff = fx * fx + fy * fy + fz * fz
            s, t = _along_edges(
                ee, ff, ex * fx + ey * fy + ez * fz, ex * wx + ey * wy + ez * wz, fx * wx + fy * wy + fz * wz
            )
            dx = wx + s * ex - t * fx
            dy = wy + s * ey - t * fy
            dz = wz + s * ez - t * fz
            square = dx * dx + dy * dy + dz * dz
            if square < best:
                best = square
                length = math.sqrt(square)
                out[0] = T[a] + s * ex
                out[1] = T[a + 1] + s * ey
                out[2] = T[a + 2] + s * ez
                out[3] = T[b] + t * fx
                out[4] = T[b + 1] + t * fy
                out[5] = T[b + 2] + t * fz
                width = _slab_between(T, out, length)
                if width >= length * _AS_WIDE:
                    return length, width
    return length, width


@kernel(inline=True)
def _slab_between(T, new, length):
    """Width of the slab across the line between two points."""
    if not length > 0.0:
        return 0.0
    share = (1.0 - 2.0**-50) / length
    return slab(T, (new[3] - new[0]) * share, (new[4] - new[1]) * share, (new[5] - new[2]) * share)


@kernel(inline=True)
def beyond(T, bound):
    """Whether a slab between the triangles is wider than the bound: across the line between their middles, or across
    the normal of either. A quick look that spares three of four the long one."""
    x = (T[9] + T[12] + T[15]) - (T[0] + T[3] + T[6])
    y = (T[10] + T[13] + T[16]) - (T[1] + T[4] + T[7])
    z = (T[11] + T[14] + T[17]) - (T[2] + T[5] + T[8])
    width = slab(T, x, y, z)
    if width > 0.0 and width * width > bound * bound * (x * x + y * y + z * z):
        return True
    return _face_slab(T, 0, 9, bound) or _face_slab(T, 9, 0, bound)


@kernel
def common_point(T, length, out):
    """A point of both of two triangles that meet, so far as doubles can tell, in either half of ``out``.

    ``out`` holds nearest points of their features, ``length`` apart: right for triangles that touch or lie in one
    plane. Elsewhere an edge of one goes through the inside of the other.
    """
    best = -_INSIDE
    for face in range(0, 18, 9):
        ux = T[face + 3] - T[face]
        uy = T[face + 4] - T[face + 1]
        uz = T[face + 5] - T[face + 2]
        vx = T[face + 6] - T[face]
        vy = T[face + 7] - T[face + 1]
        vz = T[face + 8] - T[face + 2]
        nx = uy * vz - uz * vy
        ny = uz * vx - ux * vz
        nz = ux * vy - uy * vx
        square = nx * nx + ny * ny + nz * nz
        for k in range(3):
            a = 9 - face + 3 * k
            b = 9 - face + 3 * ((k + 1) % 3)
            one = nx * (T[a] - T[face]) + ny * (T[a + 1] - T[face + 1]) + nz * (T[a + 2] - T[face + 2])
            two = nx * (T[b] - T[face]) + ny * (T[b + 1] - T[face + 1]) + nz * (T[b + 2] - T[face + 2])
            if not (one * two <= 0.0 and one != two and square > 0.0):
                continue
            s = one / (one - two)
            x = T[a] + s * (T[b] - T[a])
            y = T[a + 1] + s * (T[b + 1] - T[a + 1])
            z = T[a + 2] + s * (T[b + 2] - T[a + 2])
            wx = x - T[face]
            wy = y - T[face + 1]
            wz = z - T[face + 2]
            beta = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / square
            gamma = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / square
            inside = min(beta, gamma, 1.0 - beta - gamma)
            if length > 0.0 and inside > best:
                best = inside
                out[0] = x
                out[1] = y
                out[2] = z
                out[3] = x
                out[4] = y
                out[5] = z


@kernel(inline=True)
def _face_slab(T, face, corners, bound):
    ux = T[face + 3] - T[face]
    uy = T[face + 4] - T[face + 1]
    uz = T[face + 5] - T[face + 2]
    vx = T[face + 6] - T[face]
    vy = T[face + 7] - T[face + 1]
    vz = T[face + 8] - T[face + 2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    # Seen across a computed normal the face itself has a width, of slivers no small one.
    one = nx * ux + ny * uy + nz * uz
    two = nx * vx + ny * vy + nz * vz
    low = math.inf
    high = -math.inf
    for k in range(3):
        p = corners + 3 * k
        height = nx * (T[p] - T[face]) + ny * (T[p + 1] - T[face + 1]) + nz * (T[p + 2] - T[face + 2])
        low = min(low, height)
        high = max(high, height)
    height = max(low - max(one, two, 0.0), min(one, two, 0.0) - high)
    return height > 0.0 and height * height > bound * bound * (nx * nx + ny * ny + nz * nz)


@kernel(inline=True)
def _along_edges(ee, ff, ef, ew, fw):
    """Where on two edges, 0 to 1 each, their nearest points are; either may be a point."""
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
    """The corners of one triangle that lie over the inside of the other, the sides of its edges decided in doubles."""
    ux = T[face + 3] - T[face]
    uy = T[face + 4] - T[face + 1]
    uz = T[face + 5] - T[face + 2]
    vx = T[face + 6] - T[face]
    vy = T[face + 7] - T[face + 1]
    vz = T[face + 8] - T[face + 2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if not square > 0.0:
        return best
    for k in range(3):
        p = corners + 3 * k
        wx = T[p] - T[face]
        wy = T[p + 1] - T[face + 1]
        wz = T[p + 2] - T[face + 2]
        height = nx * wx + ny * wy + nz * wz
        if height * height >= best * square:
            continue
        # Barycentric: (u × w)·n and (w × v)·n over n·n.
        beta = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / square
        gamma = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / square
        if beta < 0.0 or gamma < 0.0 or beta + gamma > 1.0:
            continue
        qx = T[face] + (beta * ux + gamma * vx)
        qy = T[face + 1] + (beta * uy + gamma * vy)
        qz = T[face + 2] + (beta * uz + gamma * vz)
        dx = T[p] - qx
        dy = T[p + 1] - qy
        dz = T[p + 2] - qz
        length = dx * dx + dy * dy + dz * dz
        if length < best:
            best = length
            first = 0 if face == 0 else 3
            out[first] = qx
            out[first + 1] = qy
            out[first + 2] = qz
            out[3 - first] = T[p]
            out[4 - first] = T[p + 1]
            out[5 - first] = T[p + 2]
    return best


@kernel(inline=True)
def slab(T, nx, ny, nz):
    """Width of the slab across n between the triangles, n pointing from the first: least minus largest product."""
    high = nx * T[0] + ny * T[1] + nz * T[2]
    low = nx * T[9] + ny * T[10] + nz * T[11]
    for k in range(1, 3):
        high = max(high, nx * T[3 * k] + ny * T[3 * k + 1] + nz * T[3 * k + 2])
        low = min(low, nx * T[9 + 3 * k] + ny * T[10 + 3 * k] + nz * T[11 + 3 * k])
    return low - high


@kernel
def widest_slab(T):
    """(width, nx, ny, nz): the widest slab across a normal of either triangle or of a pair of edges, its unit vector from the
    first to the second: for pairs whose nearest points came out badly. (−∞, 0, 0, 0) where nothing has a direction."""
    best = -math.inf
    nx = 0.0
    ny = 0.0
    nz = 0.0
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
            width, x, y, z = _across(T, a, b, c, d)
            if width > best:
                best = width
                nx = x
                ny = y
                nz = z
    return best, nx, ny, nz


@kernel
def _across(T, a, b, c, d):
    ex = T[b] - T[a]
    ey = T[b + 1] - T[a + 1]
    ez = T[b + 2] - T[a + 2]
    fx = T[d] - T[c]
    fy = T[d + 1] - T[c + 1]
    fz = T[d + 2] - T[c + 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 0.0:
        return -math.inf, 0.0, 0.0, 0.0
    nx /= length
    ny /= length
    nz /= length
    width = slab(T, nx, ny, nz)
    opposite = slab(T, -nx, -ny, -nz)
    if opposite > width:
        return opposite, -nx, -ny, -nz
    return width, nx, ny, nz
