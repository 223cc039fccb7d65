"""The convex hull of points in the plane, exactly: Andrew's monotone chain (1979) with exact signs."""

from __future__ import annotations

from threading import local

import numpy as np

from collide.kernels import address_of, entry, view_f64, view_i64
from collide.papers.polytopes.planar_layout import DOUBLES, INTEGERS, Line
from collide.papers.polytopes.planar_predicates import PolygonPair, read_vertex, set_planar_poses, side_of


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def chain_hull(points, n_points, order, n, hull, doubles, integers):
    """Write the rows of the hull's vertices, counter-clockwise from the first of ``order``; returns how many.

    points : address of coordinates, two a point.   order : address of n ≥ 2 rows of different points, sorted by x,
    then y.   hull : address of space for 2 n rows.
    doubles : workspace of DOUBLES, of which the first nine are the unit matrix (3, 3).
    """
    rows = view_i64(order, n)
    stack = view_i64(hull, 2 * n)
    coordinates = view_f64(points, 2 * n_points)
    work = view_f64(doubles + 72, DOUBLES)
    unit = view_f64(doubles, 9)
    set_planar_poses(work, unit, unit)
    pair = PolygonPair(coordinates, n_points, coordinates, n_points, work, view_i64(integers, INTEGERS))
    line = Line(0, 1, 0, False)
    size = 0
    for turn_back in range(2):  # the lower chain from left to right, the upper one from right to left
        bottom = size if turn_back == 1 else 1
        for k in range(n):
            row = rows[n - 1 - k] if turn_back == 1 else rows[k]
            if turn_back == 1 and k == 0:
                continue
            read_vertex(pair, 2, 0, row)
            while size > bottom:
                read_vertex(pair, 0, 0, stack[size - 2])
                read_vertex(pair, 1, 0, stack[size - 1])
                if side_of(pair, line, 2) > 0:
                    break
                size -= 1
            stack[size] = row
            size += 1
    return size - 1


def hull_of_points(points: np.ndarray) -> np.ndarray:
    """Rows of the vertices of the hull of points (n, 2), counter-clockwise from the leftmost, of these the lowest.

    Points between others on an edge are left out; of equal points the first stays. O(n log n).
    """
    order = np.lexsort((points[:, 1], points[:, 0]))
    in_order = points[order]
    differs = np.ones(len(points), dtype=bool)
    differs[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    order = np.ascontiguousarray(order[differs], dtype=np.int64)
    if len(order) == 1:
        return order
    hull = np.empty(2 * len(order), dtype=np.int64)
    n = chain_hull(
        address_of(points), len(points), address_of(order), len(order), address_of(hull), *_of_thread.addresses
    )
    return hull[:n].copy()


class _OfThread(local):
    """The workspace of one thread, made when the thread first asks."""

    def __init__(self) -> None:
        self.doubles = np.zeros(9 + DOUBLES)
        self.doubles[:9] = np.eye(3).ravel()
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_of_thread = _OfThread()
