"""The triangles of the least total area with a given polygon in space as their border.

Dynamic programming over parts of the polygon (G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron",
1995). The polygon need not be plane, and the triangles may cross.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_f64, view_i32
from collide.numerics.vec3 import cross, norm, sub, vec3_at


def closing_triangles(points: np.ndarray) -> np.ndarray:
    """(n − 2, 3) corners, rows of points (n, 3), along the polygon; O(n³), 12 n² bytes."""
    n = len(points)
    points = np.ascontiguousarray(points, dtype=np.float64)
    cost, choice = np.zeros((n, n)), np.zeros((n, n), dtype=np.int32)
    put_choices(address_of(points), n, address_of(cost), address_of(choice))
    triangles: list[tuple[int, int, int]] = []
    waiting = [(0, n - 1)]
    while waiting:
        low, high = waiting.pop()
        if high - low >= 2:
            split = int(choice[low, high])
            triangles.append((low, split, high))
            waiting += [(low, split), (split, high)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


@entry("void(int64, int64, int64, int64)")
def put_choices(points_at, n, cost_at, choice_at):
    """For every part i … j of a polygon of n points the corner over the edge i j, and twice the area, (n, n) each.

    cost : all 0.   choice : int32 out. Of equal areas the first corner is taken.
    """
    points, cost, choice = view_f64(points_at, 3 * n), view_f64(cost_at, n * n), view_i32(choice_at, n * n)
    for gap in range(2, n):
        for i in range(n - gap):
            j = i + gap
            a = vec3_at(points, 3 * i)
            edge = sub(vec3_at(points, 3 * j), a)
            least = -1.0
            corner = i + 1
            for k in range(i + 1, j):
                total = cost[n * i + k] + cost[n * k + j] + norm(cross(sub(vec3_at(points, 3 * k), a), edge))
                if least < 0.0 or total < least:
                    least = total
                    corner = k
            cost[n * i + j] = least
            choice[n * i + j] = corner
