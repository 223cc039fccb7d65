"""The volume of each shell, its sign proven, and the facets without area.

Both are computed in doubles with an error bound, and in integers where the bound leaves a sign open.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32
from collide.numerics.digits import BITS, add_determinant, add_double, carry, grid_of, lowest_bit, set_zero
from collide.numerics.vec3 import absolute, cross, dot, sub, vec3_at

#: A term of a volume is the product of three rounded differences, eight roundings deep at most; twice that.
_TERM_ERROR = 2.0**-49
_UNIT = 2.0**-53
#: Covers what underflows in the scaling and in products of numbers below 4.
_UNDERFLOW = 2.0**-1000


def exact_integers(values: np.ndarray) -> np.ndarray:
    """Doubles as Python integers in one common unit, a power of two."""
    fraction, exponent = np.frexp(values)
    mantissa = (fraction * 2.0**53).astype(np.int64)
    lowest = exponent[mantissa != 0].min() if mantissa.any() else 0
    return mantissa.astype(object) << np.where(mantissa == 0, 0, exponent - lowest).astype(object)


def scaled_to_one(vertices: np.ndarray) -> tuple[np.ndarray, int]:
    """The vertices times 2^-e with the largest coordinate in [1/2, 1), and e."""
    exponent = int(np.frexp(np.abs(vertices).max())[1])
    return np.ascontiguousarray(np.ldexp(vertices, -exponent)), exponent


def _exact_corners(vertices: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """The three corners of facets, (f, 3) each, in Python integers."""
    rows, ids = np.unique(corners, return_inverse=True)
    exact = exact_integers(vertices[rows])
    return [exact[ids.reshape(-1, 3)[:, k]] for k in range(3)]


def without_area(vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(f,) bool: facets whose corners lie on one line, exactly decided."""
    scaled, _ = scaled_to_one(vertices)
    thin = np.zeros(len(corners), dtype=np.int32)
    mark_thin(address_of(scaled), len(vertices), address_of(corners), len(corners), address_of(thin))
    result = np.zeros(len(corners), dtype=bool)
    suspects = np.flatnonzero(thin)
    if len(suspects):
        a, b, c = _exact_corners(vertices, corners[suspects])
        result[suspects] = (np.cross(b - a, c - a) == 0).all(axis=1)
    return result


@kernel(inline=True)
def permanent(u, v, w):
    """The terms of the determinant of three vectors, all taken positive, summed."""
    u = absolute(u)
    size = u.x * (abs(v.y * w.z) + abs(w.y * v.z))
    size += u.y * (abs(v.z * w.x) + abs(w.z * v.x))
    return size + u.z * (abs(v.x * w.y) + abs(w.x * v.y))


@kernel
def put_volumes(points, scaled, corners, parts, digits, six, signs):
    """Six times the volume of each shell, of the scaled points, and its exact sign.

    A volume is summed in doubles, seen from a corner of the shell's first facet, and in integers where an error bound
    leaves its sign open.   parts : facets by shell: their order, and where each shell begins there.
    """
    for shell in range(len(signs)):
        first, end = parts.starts[shell], parts.starts[shell + 1]
        origin = vec3_at(scaled, 3 * corners[3 * parts.order[first]])
        total = 0.0
        size = 0.0
        for k in range(first, end):
            f = 3 * parts.order[k]
            a = sub(vec3_at(scaled, 3 * corners[f]), origin)
            b = sub(vec3_at(scaled, 3 * corners[f + 1]), origin)
            c = sub(vec3_at(scaled, 3 * corners[f + 2]), origin)
            total += dot(a, cross(b, c))
            size += permanent(a, b, c)
        n = end - first
        six[shell] = total
        signs[shell] = 1 if total > 0.0 else -1 if total < 0.0 else 0
        if abs(total) <= size * 2.0 * (_TERM_ERROR + _UNIT * n) + _UNDERFLOW * n:
            signs[shell] = _exact_sign(points, corners, parts, first, end, digits)


@kernel
def _exact_sign(points, corners, parts, first, end, digits):
    """Sign of the volume that closed facets enclose, in integers of digits."""
    lowest = 2000
    highest = -2000
    for k in range(first, end):
        for j in range(3):
            lowest, highest = span_of(points, corners[3 * parts.order[k] + j], lowest, highest)
    if lowest == 2000:
        return 0
    grid = grid_of(lowest)
    n = (highest - BITS * grid) // BITS + 2
    minor, total = 9 * n, 11 * n
    n_total = 3 * n + 3  # a sum of up to 2²⁸ facets
    set_zero(digits, total, n_total)
    for k in range(first, end):
        for cell in range(9):
            set_zero(digits, cell * n, n)
            vertex = corners[3 * parts.order[k] + cell // 3]
            add_double(digits, cell * n, points[3 * vertex + cell % 3], grid)
            carry(digits, cell * n, n)
        add_determinant(digits, 0, 3 * n, 6 * n, n, minor, total)
        carry(digits, total, n_total)
    return carry(digits, total, n_total)


@kernel
def span_of(points, vertex, lowest, highest):
    """(lowest, highest) exponent of a bit of a point's coordinates and of what came before."""
    for axis in range(3):
        x = points[3 * vertex + axis]
        lowest = min(lowest, lowest_bit(x))
        if x != 0.0:
            highest = max(highest, math.frexp(x)[1])
    return lowest, highest


@entry("void(int64, int64, int64, int64, int64)")
def mark_thin(points_at, n, corners_at, n_facets, thin_at):
    """thin : out, 1 for facets whose area doubles cannot tell from 0."""
    points = view_f64(points_at, 3 * n)
    corners = view_i32(corners_at, 3 * n_facets)
    thin = view_i32(thin_at, n_facets)
    for f in range(n_facets):
        a = corners[3 * f]
        b = corners[3 * f + 1]
        c = corners[3 * f + 2]
        thin[f] = 1
        for k in range(3):
            i = (k + 1) % 3
            j = (k + 2) % 3
            p = (points[3 * b + i] - points[3 * a + i]) * (points[3 * c + j] - points[3 * a + j])
            q = (points[3 * b + j] - points[3 * a + j]) * (points[3 * c + i] - points[3 * a + i])
            if abs(p - q) > _TERM_ERROR * (abs(p) + abs(q)) + _UNDERFLOW:
                thin[f] = 0
