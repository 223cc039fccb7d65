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


@entry("void(int64, int64, int64, int64, int64, float64, int64, int64)")
def sum_triangles(corners_at, starts_at, n, faces_at, k, error, sums_at, areas_at):
    """Sum over k triangles (int32) of n corners off by ``error``: six volumes, a bound of the sum's own rounding, a
    bound of the terms' errors, and moments; areas, an area a triangle.

    starts_at : where the origin of each corner stands, the same for all corners of a closed part; moments are about
    the origin of the starts.

    Around a corner v of closed triangles v, q, r the edges out balance the edges in, Σ (q − r) = 0, so the gradient of
    six volumes by v is Σ q × r = Σ (q − v) × (r − v), at most Σ |e| |f|. Corners off by √3 δ, on the way from the exact
    corners to the rounded ones, move six volumes by less than 3 √3 δ |e| |f| a triangle, e and f longer by 2 √3 δ. By
    rounding a · (e × f) is off by 7 u of the sizes of six products, 42 u |a| |e| |f| in largest coordinates.
    What each addition rounds off is a double (Knuth's two-sum); k of them added up lose less than k u times their
    sizes.
    """
    corners = view_f64(corners_at, 3 * n)
    starts = view_f64(starts_at, 3 * n)
    faces = view_i32(faces_at, 3 * k)
    sums = view_f64(sums_at, SUMS)
    areas = view_f64(areas_at, k)
    six, bound, x, y, z = 0.0, 0.0, 0.0, 0.0, 0.0
    lost, sizes_lost = 0.0, 0.0
    for i in range(k):
        a = vec3_at(corners, 3 * faces[3 * i])
        b = vec3_at(corners, 3 * faces[3 * i + 1])
        c = vec3_at(corners, 3 * faces[3 * i + 2])
        e = sub(b, a)
        f = sub(c, a)
        normal = cross(e, f)
        areas[i] = 0.5 * norm(normal)
        volume = dot(a, normal)
        before = six
        six += volume
        taken = six - before
        rounding = (before - (six - taken)) + (volume - taken)
        lost += rounding
        sizes_lost += abs(rounding)
        start = vec3_at(starts, 3 * faces[3 * i])
        x += volume * (a.x + b.x + c.x + 4.0 * start.x)
        y += volume * (a.y + b.y + c.y + 4.0 * start.y)
        z += volume * (a.z + b.z + c.z + 4.0 * start.z)
        bound += 5.3 * error * (norm(e) + 4.0 * error) * (norm(f) + 4.0 * error)
        bound += 48.0 * _U * _largest(a) * _largest(e) * _largest(f)
    sums[0], sums[1], sums[2] = six, abs(lost) + 1.01 * k * _U * sizes_lost, bound
    sums[3], sums[4], sums[5] = x, y, z
