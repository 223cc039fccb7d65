"""Manifold reduction: of more points than are wanted the deepest, and points spanning the greatest area."""

from __future__ import annotations

from collide.contact.manifold_points import POINT, V
from collide.kernels import kernel


@kernel
def select_points(manifold, n, first, max_points, order):
    """Numbers of at most ``max_points`` of n points around a polygon, beginning with ``first``; how many.

    order : becomes the numbers, counter-clockwise. Beyond ``max_points``: the first, the farthest from the first, then
    point by point the largest added area. O(n · max_points²).
    """
    if n <= max_points:
        for k in range(n):
            order[k] = first + k if first + k < n else first + k - n
        return n
    n_taken = 1
    order[0] = 0
    while n_taken < max_points:
        best, place, taken_at = -1.0, -1, 0
        # Numbers count from the first here; those taken stand in order, so that they are a ring.
        for k in range(n):
            begin = -1
            is_taken = False
            for j in range(n_taken):
                if order[j] == k:
                    is_taken = True
                if order[j] < k:
                    begin = j
            if is_taken:
                continue
            area = _added_area(manifold.points, n, first, order, n_taken, k)
            if area > best:
                best, place, taken_at = area, k, begin + 1
        for j in range(n_taken - taken_at):
            order[n_taken - j] = order[n_taken - j - 1]
        order[taken_at] = place
        n_taken += 1
    for j in range(n_taken):
        k = first + order[j]
        order[j] = k if k < n else k - n
    return n_taken


@kernel(inline=True)
def _added_area(points, n, first, order, n_taken, k):
    """Area between a point and the side of a ring with the point outside; its squared distance from a single point."""
    p = POINT * _wrapped(first + k, n)
    if n_taken == 1:
        q = POINT * _wrapped(first, n)
        du, dv = points[p] - points[q], points[p + V] - points[q + V]
        return du * du + dv * dv
    area_beyond = 0.0
    for j in range(n_taken):
        i = POINT * _wrapped(first + order[j], n)
        o = POINT * _wrapped(first + order[j + 1 if j + 1 < n_taken else 0], n)
        du, dv = points[o] - points[i], points[o + V] - points[i + V]
        area = du * (points[p + V] - points[i + V]) - dv * (points[p] - points[i])
        area_beyond = max(area_beyond, abs(area) if n_taken == 2 else -area)
    return area_beyond


@kernel(inline=True)
def _wrapped(k, n):
    return k if k < n else k - n
