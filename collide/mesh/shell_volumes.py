"""The volume of each shell, its sign proven, and which facets have no area.

Both are computed in doubles with an error bound, and in integers where that leaves a sign open.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32
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


class Shells:
    """Facets by shell: sorted once, so that the facets of one shell are found without a look at the others.

    corners : (f, 3) int32.   shells : (f,) int32, the shell of each facet, −1 for none.   n : how many shells.
    """

    def __init__(self, corners: np.ndarray, shells: np.ndarray, n: int):
        self.corners, self.shells, self.n = corners, shells, n
        self.order = np.argsort(shells, kind="stable")
        self.starts = np.searchsorted(shells[self.order], np.arange(n + 1))

    def __getitem__(self, shell: int) -> np.ndarray:
        """(k, 3) corners of a shell's facets, in the order of the facets."""
        return self.corners[self.order[self.starts[shell] : self.starts[shell + 1]]]


def shell_volumes(vertices: np.ndarray, parts: Shells) -> tuple[np.ndarray, np.ndarray]:
    """(volumes, signs) of closed shells, (parts.n,) each; the signs are exact.   vertices : (n, 3)."""
    n = parts.n
    scaled, exponent = scaled_to_one(vertices)
    six, sizes = np.zeros(n), np.zeros(n)
    members, first = np.zeros(n, dtype=np.int32), np.full(n, -1, dtype=np.int32)
    sum_volumes(
        address_of(scaled), len(vertices), address_of(parts.corners), len(parts.corners), address_of(parts.shells), n,
        address_of(first), address_of(members), address_of(six), address_of(sizes),
    )
    margin = sizes * 2.0 * (_TERM_ERROR + _UNIT * members) + _UNDERFLOW * members
    signs = np.sign(six).astype(np.int8)
    for shell in np.flatnonzero(np.abs(six) <= margin).tolist():
        signs[shell] = _exact_sign(vertices, parts[shell])
    with np.errstate(over="ignore", under="ignore"):
        volumes = np.ldexp(six / 6.0, 3 * exponent)
    return np.where(signs == 0, 0.0, volumes), signs


def _exact_sign(vertices: np.ndarray, corners: np.ndarray) -> int:
    """Sign of the volume that closed facets enclose, in Python integers."""
    a, b, c = _exact_corners(vertices, corners)
    total = int((a * np.cross(b, c)).sum())
    return (total > 0) - (total < 0)


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


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def sum_volumes(points_at, n, corners_at, n_facets, shells_at, n_shells, first_at, members_at, six_at, sizes_at):
    """Six times the volume of every shell, seen from a corner of its first facet, and its terms' magnitudes summed.

    first, six, sizes : of every shell that corner, −1 at first; the volume and the magnitudes, 0 at first.
    members : out, the facets of every shell counted.
    """
    points = view_f64(points_at, 3 * n)
    corners = view_i32(corners_at, 3 * n_facets)
    shells = view_i32(shells_at, n_facets)
    first = view_i32(first_at, n_shells)
    members = view_i32(members_at, n_shells)
    six = view_f64(six_at, n_shells)
    sizes = view_f64(sizes_at, n_shells)
    for f in range(n_facets):
        s = shells[f]
        if s >= 0:
            if first[s] < 0:
                first[s] = corners[3 * f]
            origin = vec3_at(points, 3 * first[s])
            a = sub(vec3_at(points, 3 * corners[3 * f]), origin)
            b = sub(vec3_at(points, 3 * corners[3 * f + 1]), origin)
            c = sub(vec3_at(points, 3 * corners[3 * f + 2]), origin)
            six[s] += dot(a, cross(b, c))
            sizes[s] += permanent(a, b, c)
            members[s] += 1


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
