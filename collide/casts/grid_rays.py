"""Rays and occupied cells: faces between occupied cells are no surface of their union.

A place where a ray enters or leaves a cell lies inside the union where all cells around the place are occupied: two at
a face, four at an edge, eight at a corner. A ray along the surface meets the surface where it begins and ends, and no
line between two cells. Where doubles do not tell which cells are around, fractions do.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np

from collide.casts.directions import Directions
from collide.casts.ray_hits import RayEvents
from collide.least_distance.posed_sets import exact_pose
from collide.narrowphase.fields.field_items import rounding_of_each
from collide.narrowphase.fields.occupied_cells import Cells
from collide.numerics.exact_vectors import cross, inner, minus

_Exact = tuple[Fraction, Fraction, Fraction]


def begin_in_cells(items: Cells, X_WA: np.ndarray, origins: np.ndarray) -> np.ndarray:
    """(n,) bool: False where the origin of a ray is outside of all cells for sure.   X_WA : (n, 4, 4) or (1, 4, 4)."""
    low, high = _cells_around(items, X_WA, origins, np.zeros(len(origins)))
    return _corners_occupied(items, low, high).any(axis=0) | (high - low > 1).any(axis=1)


def on_surface(
    items: Cells, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, events: RayEvents
) -> np.ndarray:
    """(k,) bool: which events of rays and cells, by number, are places on the surface of the union of the cells."""
    ray, (t, below, above) = events.ray, events.t.T
    steps = np.ldexp(directions.vectors[ray], directions.exponents[ray, None])
    X, places = X_WA[ray if len(X_WA) > 1 else ray * 0], origins[ray] + t[:, None] * steps
    width = np.where(np.isfinite(above), above - below, 0.0) * np.sqrt(np.square(steps).sum(axis=1))
    low, high = _cells_around(items, X, places, width)
    span = high - low
    is_outer = np.asarray(~_corners_occupied(items, low, high).all(axis=0))
    for k in np.flatnonzero((span > 1).any(axis=1) | is_outer & (span.sum(axis=1) > 1)).tolist():
        step = [Fraction(v) * Fraction(2) ** int(directions.exponents[ray[k]]) for v in directions.vectors[ray[k]]]
        p, v = _exact_place(items, X[k], origins[ray[k]], step, int(events.item[k]), float(t[k]))
        is_outer[k] = _changes(items, p, v, low[k], high[k])
    return is_outer


def _corners_occupied(items: Cells, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(8, n) bool: whether the cells at the corners of ranges of cells (n, 3) are occupied."""
    return np.array([items.are_occupied(np.where(corner, high, low)) for corner in product((False, True), repeat=3)])


def _cells_around(
    items: Cells, X_WA: np.ndarray, p_W: np.ndarray, width: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest cells (n, 3) of ranges with all cells that places of the world (n, 3), off by a width (n,) [m]
    at most, lie in or on.

    Rounding of a place and of planes between cells is less than what is added: `rounding_of_each` has 2⁻⁴⁰ of all
    lengths met, and of these each step here rounds a few units of 2⁻⁵³.
    """
    X_WG = items.pose(X_WA)
    p_G = np.linalg.solve(X_WG[:, :3, :3], (p_W - X_WG[:, :3, 3])[:, :, None])[:, :, 0]
    slack = (rounding_of_each(items, X_WG, p_W) + 2.0 * width)[:, None]
    return items.cells_at(p_G - slack), items.cells_at(p_G + slack)


def _exact_place(items: Cells, X_WA: np.ndarray, origin: np.ndarray, step: list, item: int, t: float):
    """(place, direction) where a ray enters or leaves an item, at the time nearest to t; in the frame of the items."""
    p, v = _in_frame(exact_pose(X_WA), [Fraction(x) for x in origin.tolist()], step)
    p, v = _in_frame(exact_pose(items.X_FG), p, v)
    low, high = items.corners_of(item)
    times = [
        sorted([(Fraction(low[k]) - p[k]) / v[k], (Fraction(high[k]) - p[k]) / v[k]]) for k in range(3) if v[k]
    ]
    ends = max(first for first, _ in times), min(last for _, last in times)
    at = min(ends, key=lambda end: abs(Fraction(t) - end))
    return tuple(a + at * b for a, b in zip(p, v)), v


def _in_frame(X: list[Fraction], p, v) -> tuple[_Exact, _Exact]:
    """A place and a vector in the frame at a pose of 12 numbers."""
    columns = [[X[i], X[i + 3], X[i + 6]] for i in range(3)]
    rows = cross(columns[1], columns[2]), cross(columns[2], columns[0]), cross(columns[0], columns[1])
    det = inner(columns[0], rows[0])
    away = minus(p, X[9:])
    return tuple(inner(row, away) / det for row in rows), tuple(inner(row, v) / det for row in rows)


def _changes(items: Cells, p: _Exact, v: _Exact, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether the union changes at an exact place on a way along v; the cells around are of a range of cells.

    Nothing changes where cells on all sides of the planes crossed there are occupied alike.
    """
    around, before = [], []
    for k in range(3):
        j = int(low[k])
        while j < high[k] and items.plane(k, j + 1) < p[k]:
            j += 1
        around.append([j, j + 1] if j < high[k] and items.plane(k, j + 1) == p[k] else [j])
        before.append(slice(0, 1) if v[k] else slice(None))
    occupied = items.are_occupied(np.array(list(product(*around)))).reshape([len(cells) for cells in around])
    return bool((occupied != occupied[tuple(before)]).any())
