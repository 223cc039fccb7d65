"""What each shell encloses, with its sign proven, and which facets have no area: doubles first, integers where they cannot tell."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32

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


def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Cross products of rows, of doubles or of Python integers."""
    a, b = u.T, v.T
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]], axis=-1)


def inner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Inner products of rows."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


class Shells:
    """Facets by shell: sorted once, so that asking for one shell does not look at the others."""

    def __init__(self, corners: np.ndarray, shells: np.ndarray, many: int):
        self.corners, self.shells, self.many = corners, shells, many
        self.order = np.argsort(shells, kind="stable")
        self.starts = np.searchsorted(shells[self.order], np.arange(many + 1))

    def __getitem__(self, shell: int) -> np.ndarray:
        """(k, 3) corners of a shell's facets, in the order of the facets."""
        return self.corners[self.order[self.starts[shell] : self.starts[shell + 1]]]


def shell_volumes(vertices: np.ndarray, parts: Shells) -> tuple[np.ndarray, np.ndarray]:
    """(volumes, signs) of closed shells, (many,) each; the signs are exact.

    vertices : (n, 3).   parts : facets with int32 corners and shells, −1 for those that belong to none.
    """
    corners, shells, many = parts.corners, parts.shells, parts.many
    scaled, exponent = scaled_to_one(vertices)
    six, sizes = np.zeros(many), np.zeros(many)
    members, first = np.zeros(many, dtype=np.int32), np.full(many, -1, dtype=np.int32)
    sum_volumes(
        address_of(scaled), len(vertices), address_of(corners), len(corners), address_of(shells), many,
        address_of(first), address_of(members), address_of(six), address_of(sizes),
    )  # fmt: skip
    margin = sizes * 2.0 * (_TERM_ERROR + _UNIT * members) + _UNDERFLOW * members
    signs = np.sign(six).astype(np.int8)
    for shell in np.flatnonzero(np.abs(six) <= margin).tolist():
        signs[shell] = _exact_sign(vertices, parts[shell])
    with np.errstate(over="ignore", under="ignore"):
        volumes = np.ldexp(six / 6.0, 3 * exponent)
    return np.where(signs == 0, 0.0, volumes), signs


def _exact_sign(vertices: np.ndarray, corners: np.ndarray) -> int:
    """Sign of the volume that closed facets enclose, in Python integers."""
    rows, ids = np.unique(corners, return_inverse=True)
    exact = exact_integers(vertices[rows])
    a, b, c = (exact[ids.reshape(-1, 3)[:, k]] for k in range(3))
    total = int(inner(a, cross(b, c)).sum())
    return (total > 0) - (total < 0)


def without_area(vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(f,) bool: facets whose corners lie on one line, exactly decided."""
    scaled, _ = scaled_to_one(vertices)
    thin = np.zeros(len(corners), dtype=np.int32)
    mark_thin(address_of(scaled), len(vertices), address_of(corners), len(corners), address_of(thin))
    result = np.zeros(len(corners), dtype=bool)
    suspects = np.flatnonzero(thin)
    if len(suspects):
        rows, ids = np.unique(corners[suspects], return_inverse=True)
        exact = exact_integers(vertices[rows])
        a, b, c = (exact[ids.reshape(-1, 3)[:, k]] for k in range(3))
        result[suspects] = (cross(b - a, c - a) == 0).all(axis=1)
    return result


@kernel
def _term(points, o, a, b, c):
    """The determinant of a − o, b − o, c − o, and the sum of its terms' magnitudes."""
    ax = points[3 * a] - points[3 * o]
    ay = points[3 * a + 1] - points[3 * o + 1]
    az = points[3 * a + 2] - points[3 * o + 2]
    bx = points[3 * b] - points[3 * o]
    by = points[3 * b + 1] - points[3 * o + 1]
    bz = points[3 * b + 2] - points[3 * o + 2]
    cx = points[3 * c] - points[3 * o]
    cy = points[3 * c + 1] - points[3 * o + 1]
    cz = points[3 * c + 2] - points[3 * o + 2]
    value = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    size = abs(ax) * (abs(by * cz) + abs(bz * cy))
    size += abs(ay) * (abs(bz * cx) + abs(bx * cz))
    size += abs(az) * (abs(bx * cy) + abs(by * cx))
    return value, size


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def sum_volumes(points_at, n, corners_at, facets, shells_at, many, first_at, members_at, six_at, sizes_at):
    """Six times the volume of every shell, seen from a corner of its first facet, and the magnitudes summed."""
    points = view_f64(points_at, 3 * n)
    corners = view_i32(corners_at, 3 * facets)
    shells = view_i32(shells_at, facets)
    first = view_i32(first_at, many)
    members = view_i32(members_at, many)
    six = view_f64(six_at, many)
    sizes = view_f64(sizes_at, many)
    for f in range(facets):
        s = shells[f]
        if s >= 0:
            if first[s] < 0:
                first[s] = corners[3 * f]
            value, size = _term(points, first[s], corners[3 * f], corners[3 * f + 1], corners[3 * f + 2])
            six[s] += value
            sizes[s] += size
            members[s] += 1


@entry("void(int64, int64, int64, int64, int64)")
def mark_thin(points_at, n, corners_at, facets, thin_at):
    """1 for facets whose area doubles cannot tell from 0."""
    points = view_f64(points_at, 3 * n)
    corners = view_i32(corners_at, 3 * facets)
    thin = view_i32(thin_at, facets)
    for f in range(facets):
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
