"""Samples of a distance function on a regular grid, and the brackets between samples that a slope of 1 proves.

A distance d changes by no more than the way between two points. With d_i at nodes x_i around a point p, e off at most,

    max (d_i − |p − x_i|) − e  ≤  d(p)  ≤  min (d_i + |p − x_i|) + e.

Where two samples differ by more than the way between their nodes, the samples are no distances (`steepest_step`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f32, view_f64, view_i64
from collide.numerics.vec3 import Vec3, dot, sub, vec3_at

#: Of the numbers met: what distances from nodes, sums and differences round by.
_ROUNDING = 2.0**-50


class Samples:
    """Values (nx, ny, nz), float32 or float64, C-contiguous, at ``origin + cell · (i, j, k)``, as doubles round this.

    cell, origin : (3,) float64 [m].   error : how far a value may be off [m].
    """

    def __init__(self, values: np.ndarray, cell: np.ndarray, origin: np.ndarray, error: float):
        self.values, self.cell, self.origin, self.error = values, cell, origin, error
        ends = np.abs(np.stack([origin, origin + cell * (np.array(values.shape) - 1)])).max(axis=0)
        # Nodes as doubles are not quite a cell apart.
        self._numbers = np.concatenate([origin, cell, [error + 2.0 * _ROUNDING * float(ends.sum())]])
        self._header = np.array(
            [address_of(values), *values.shape, values.itemsize == 4, address_of(self._numbers)], dtype=np.int64
        )

    def nodes(self, first: int, last: int) -> np.ndarray:
        """((last − first) · ny · nz, 3) places of the nodes of some layers across x, in the order of the values."""
        axes = [self.origin[k] + self.cell[k] * np.arange(n) for k, n in enumerate(self.values.shape)]
        axes[0] = axes[0][first:last]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def bracket(self, points: np.ndarray) -> np.ndarray:
        """(3, n) distances, lower and upper bounds at points (n, 3), C-contiguous."""
        out = np.empty((3, len(points)))
        bracket_at(address_of(self._header), address_of(points), len(points), address_of(out))
        return out

    def steepest_step(self) -> tuple[float, list[int], list[int]]:
        """(by how much two neighbouring values differ more than their nodes are apart and errors allow, the nodes)."""
        where = np.zeros(2, dtype=np.int64)
        excess = steepest_step(address_of(self._header), address_of(where))
        return (excess, *([int(i) for i in np.unravel_index(k, self.values.shape)] for k in where.tolist()))


class _Grid(NamedTuple):
    """Samples as kernels see them.   singles, doubles : the values, one of the two views is empty."""

    singles: Any
    doubles: Any
    is_single: Any
    nx: int
    ny: int
    nz: int
    origin: Vec3
    cell: Vec3
    error: float


@kernel
def _open(header_at):
    header = view_i64(header_at, 6)
    numbers = view_f64(header[5], 7)
    n = header[1] * header[2] * header[3]
    return _Grid(
        view_f32(header[0], n), view_f64(header[0], n), header[4] != 0, header[1], header[2], header[3],
        vec3_at(numbers, 0), vec3_at(numbers, 3), numbers[6],
    )


@kernel(inline=True)
def _value(grid, at):
    if grid.is_single:
        return np.float64(grid.singles[at])
    return grid.doubles[at]


@kernel(inline=True)
def _cell_along(x, origin, cell, n):
    """The cell along an axis that holds a coordinate, or is nearest."""
    place = (x - origin) / cell
    if not place > 0.0:
        return 0
    return n - 2 if place >= float(n - 1) else min(int(place), n - 2)


@kernel(inline=True)
def _share(x, low, high):
    return min(max((x - low) / (high - low), 0.0), 1.0)


@entry("void(int64, int64, int64, int64)")
def bracket_at(header_at, points_at, n, out_at):
    """(3, n) at points (n, 3): values between nodes, linear along each axis, within bounds; lower and upper bounds."""
    grid, points, out = _open(header_at), view_f64(points_at, 3 * n), view_f64(out_at, 3 * n)
    for point in range(n):
        p = vec3_at(points, 3 * point)
        i, j, k = (
            _cell_along(p.x, grid.origin.x, grid.cell.x, grid.nx),
            _cell_along(p.y, grid.origin.y, grid.cell.y, grid.ny),
            _cell_along(p.z, grid.origin.z, grid.cell.z, grid.nz),
        )
        low = Vec3(
            grid.origin.x + grid.cell.x * float(i), grid.origin.y + grid.cell.y * float(j),
            grid.origin.z + grid.cell.z * float(k),
        )
        high = Vec3(
            grid.origin.x + grid.cell.x * float(i + 1), grid.origin.y + grid.cell.y * float(j + 1),
            grid.origin.z + grid.cell.z * float(k + 1),
        )
        sx, sy, sz = _share(p.x, low.x, high.x), _share(p.y, low.y, high.y), _share(p.z, low.z, high.z)
        between, lower, upper = 0.0, -math.inf, math.inf
        for corner in range(8):
            a, b, c = corner >> 2, corner >> 1 & 1, corner & 1
            value = _value(grid, ((i + a) * grid.ny + (j + b)) * grid.nz + (k + c))
            away = sub(p, Vec3(high.x if a else low.x, high.y if b else low.y, high.z if c else low.z))
            distance = math.sqrt(dot(away, away))
            off = grid.error + _ROUNDING * (abs(value) + distance)
            lower, upper = max(lower, value - distance - off), min(upper, value + distance + off)
            between += value * (sx if a else 1.0 - sx) * (sy if b else 1.0 - sy) * (sz if c else 1.0 - sz)
        out[point] = min(max(between, lower), upper)
        out[n + point], out[2 * n + point] = lower, upper


@entry("float64(int64, int64)")
def steepest_step(header_at, where_at):
    """The largest excess of the difference of two values of a cell over the distance of their nodes and their errors.

    where : (2,) the numbers of these nodes. Not above 0 where values are those of a distance.
    """
    grid, where = _open(header_at), view_i64(where_at, 2)
    worst = -math.inf
    for da in range(2):
        for db in range(-1, 2):
            for dc in range(-1, 2):
                if (da == 0 and db < 0) or (da == 0 and db == 0 and dc <= 0):
                    continue
                along = Vec3(da * grid.cell.x, db * grid.cell.y, dc * grid.cell.z)
                length = math.sqrt(dot(along, along))
                step = (da * grid.ny + db) * grid.nz + dc
                for i in range(grid.nx - da):
                    for j in range(max(-db, 0), grid.ny - max(db, 0)):
                        begin = (i * grid.ny + j) * grid.nz
                        for at in range(begin + max(-dc, 0), begin + grid.nz - max(dc, 0)):
                            a, b = _value(grid, at), _value(grid, at + step)
                            allowed = length + 2.0 * grid.error + 0.5 * _ROUNDING * (length + abs(a) + abs(b))
                            excess = abs(a - b) - allowed
                            if excess > worst:
                                worst, where[0], where[1] = excess, at, at + step
    return worst
