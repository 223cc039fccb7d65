"""Sums over triangles: volumes with a bound of their error, moments and areas, in one pass."""

from __future__ import annotations

from collide.kernels import entry, kernel, view_f64, view_i32
from collide.numerics.vec3 import cross, dot, norm, sub, vec3_at

#: Numbers that `sum_triangles` gives.
SUMS = 6
_U = 2.0**-53


@kernel
def _largest(a):
    return max(abs(a.x), abs(a.y), abs(a.z))


@entry("void(int64, int64, int64, int64, float64, int64, int64)")
def sum_triangles(corners_at, n, faces_at, k, error, sums_at, areas_at):
    """Sum over k triangles (int32) of n corners off by ``error``: six volumes, their sizes, a bound of the terms'
    errors (without the sum's own rounding), and moments; areas, an area a triangle.

    a · (e × f) with a off by δ, e and f by 2δ: 6 δ |e| |f| + 12 |a| δ (|e| + |f|), and 24 u |a| |e| |f| by rounding.
    """
    corners = view_f64(corners_at, 3 * n)
    faces = view_i32(faces_at, 3 * k)
    sums = view_f64(sums_at, SUMS)
    areas = view_f64(areas_at, k)
    six, size, bound, x, y, z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(k):
        a = vec3_at(corners, 3 * faces[3 * i])
        b = vec3_at(corners, 3 * faces[3 * i + 1])
        c = vec3_at(corners, 3 * faces[3 * i + 2])
        e = sub(b, a)
        f = sub(c, a)
        normal = cross(e, f)
        areas[i] = 0.5 * norm(normal)
        volume = dot(a, normal)
        six += volume
        size += abs(volume)
        x += volume * (a.x + b.x + c.x)
        y += volume * (a.y + b.y + c.y)
        z += volume * (a.z + b.z + c.z)
        far = _largest(a) + 2.0 * error
        long_e = _largest(e) + 2.0 * error
        long_f = _largest(f) + 2.0 * error
        bound += 6.0 * error * long_e * long_f + 12.0 * far * error * (long_e + long_f)
        bound += 24.0 * _U * far * long_e * long_f
    sums[0], sums[1], sums[2] = six, size, bound
    sums[3], sums[4], sums[5] = x, y, z
