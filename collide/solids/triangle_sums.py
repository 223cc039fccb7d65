"""Volume, centroid and area within exact triangles: sums in doubles with a bound of their error, or in integers."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.numerics.exact_points import Point, rounded
from collide.numerics.exact_vectors import cross, inner
from collide.solids.cut_points import CutPoints
from collide.solids.joined_parts import components
from collide.solids.rounded_mesh import used_points
from collide.solids.rounded_points import rounded_points
from collide.solids.sum_kernel import SUMS, sum_triangles

#: Brackets of volumes wider than this share of them are worked out again in integers.
_WIDEST = 2.0**-33
_U = 2.0**-53
#: Above all that underflow may take away from sums of products of coordinates within 1e50.
_UNDERFLOW = 1e-250


class Volume(NamedTuple):
    """lower ≤ volume ≤ upper [m³], proven, and the centroid (3,) in W."""

    volume: float
    lower: float
    upper: float
    centroid: np.ndarray


def enclosed(points: CutPoints, triangles: np.ndarray, exact: bool = False) -> tuple[Volume, np.ndarray]:
    """(what closed triangles (k, 3) of points of an arrangement enclose, (k,) areas of them, rounded [m²]).

    exact : in integers, and not only where doubles leave too much open. A part of triangles joined by points is closed,
    since every edge is in one part, and sums about a corner of its own: the errors of a shell grow with its size, not
    with the size of the scene.
    """
    if not len(triangles):
        return Volume(0.0, 0.0, 0.0, np.zeros(3)), np.zeros(0)
    ids, faces = used_points(triangles, len(points))
    corners, _ = rounded_points(points, ids)
    part = components(len(ids), faces.ravel(), faces[:, [1, 2, 0]].ravel())
    starts = corners[part]
    corners -= starts
    # A start is a double, and exact. A corner x is off by u |x| ≤ u (|start| + |x − start|), the difference by u more.
    error = 1.01 * _U * float(np.abs(starts).max() + 2.0 * np.abs(corners).max())
    start = starts[0].copy()
    starts -= start
    sums, areas = np.empty(SUMS), np.empty(len(faces))
    sum_triangles(
        address_of(corners), address_of(starts), len(corners), address_of(faces), len(faces), error, address_of(sums),
        address_of(areas),
    )
    six, rounding, bound, *moments = sums.tolist()
    bound += rounding
    volume = six / 6.0
    bound = bound * (1.0 + 1e-9) / 6.0 + 4.0 * _U * abs(volume) + _UNDERFLOW
    if not exact and bound <= _WIDEST * volume:
        return Volume(volume, volume - bound, volume + bound, start + np.array(moments) / (4.0 * six)), areas
    return _exactly(points, triangles), areas


def _exactly(points: CutPoints, triangles: np.ndarray) -> Volume:
    """The same in integers, each tetrahedron's volume rounded down and up on one fine grid."""
    bits = 64
    while True:
        lower, n, moments = _fixed_point_sums(points, triangles, bits)
        if lower > n << 60 or bits > 1 << 14:
            break
        bits *= 2
    unit = 3 * points.facets.grid - bits
    volume, low, _ = rounded(Fraction(max(lower, 0), 6), unit)
    _, _, high = rounded(Fraction(lower + n, 6), unit)
    x, y, z, w = points.exact(int(triangles[0, 0]))
    centre = []
    for value, start, moment in zip((x, y, z), points.facets.origin, moments):
        at = Fraction(value, w) + start + (Fraction(moment, 4 * lower) if lower > 0 else 0)
        centre.append(rounded(at, points.facets.grid)[0])
    return Volume(volume, max(low, 0.0), high, np.array(centre))


def _fixed_point_sums(points: CutPoints, triangles: np.ndarray, bits: int) -> tuple[int, int, list[int]]:
    """(six volumes times 2^bits rounded down, by how many at most, their moments about the first corner)."""
    start = points.exact(int(triangles[0, 0]))
    total, moments = 0, [0, 0, 0]
    seen: dict[int, tuple[Point, int]] = {}
    for triangle in triangles.tolist():
        corners = []
        for p in triangle:
            if p not in seen:
                q = points.exact(p)
                seen[p] = tuple(q[k] * start[3] - start[k] * q[3] for k in range(3)), q[3] * start[3]  # type: ignore
            corners.append(seen[p])
        (a, wa), (b, wb), (c, wc) = corners
        six = (inner(a, cross(b, c)) << bits) // (wa * wb * wc)
        total += six
        for k in range(3):
            moments[k] += six * (a[k] * wb * wc + b[k] * wa * wc + c[k] * wa * wb) // (wa * wb * wc)
    return total, len(triangles), moments


def areas(points: CutPoints, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((k,) areas of triangles [m²], (k, 3) their centroids in W), rounded."""
    if not len(triangles):
        return np.zeros(0), np.zeros((0, 3))
    ids, faces = used_points(triangles, len(points))
    corners, _ = rounded_points(points, ids)
    a, b, c = (corners[k] for k in faces.T)
    n = np.cross(b - a, c - a)
    return 0.5 * np.sqrt(np.square(n).sum(axis=1)), (a + b + c) / 3.0


def mean_point(weights: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(3,) the weighted mean of points, 0 where weights are."""
    total = math.fsum(weights)
    return (places * weights[:, None]).sum(axis=0) / total if total > 0.0 else np.zeros(3)
