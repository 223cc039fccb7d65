"""Fans and edges of a surface: the facets around each corner, and the sides of facets that are the same edge."""

from __future__ import annotations

from collide.kernels import entry, view_i32, view_i64
from collide.numerics.counting_sort import order_by_key


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def lay_out_topology(corners_at, m, n_corners, fans_at, fan_starts_at, edges_at, memory_at):
    """Write the fans and edges of `Topology` of m facets; returns how many edges there are. O(m).

    memory : 15 m + n_corners + 1 integers to work in.
    """
    corners, fans = view_i32(corners_at, 3 * m), view_i32(fans_at, 3 * m)
    fan_starts, edges = view_i32(fan_starts_at, n_corners + 1), view_i32(edges_at, 3 * m)
    items, by_end = view_i64(memory_at, 3 * m), view_i64(memory_at + 24 * m, 3 * m)
    order, low = view_i64(memory_at + 48 * m, 3 * m), view_i64(memory_at + 72 * m, 3 * m)
    high, starts = view_i64(memory_at + 96 * m, 3 * m), view_i64(memory_at + 120 * m, n_corners + 1)
    for k in range(3 * m):
        end = 3 * (k // 3) + (k + 1) % 3
        items[k] = k
        low[k], high[k] = min(corners[k], corners[end]), max(corners[k], corners[end])
    order_by_key(high, items, 3 * m, n_corners, starts, by_end)
    order_by_key(low, by_end, 3 * m, n_corners, starts, order)
    number = -1
    for i in range(3 * m):
        k = order[i]
        if i == 0 or low[k] != low[order[i - 1]] or high[k] != high[order[i - 1]]:
            number += 1
        edges[k] = number
    for k in range(3 * m):
        low[k] = corners[k]
    order_by_key(low, items, 3 * m, n_corners, starts, order)
    for k in range(3 * m):
        fans[k] = order[k] // 3
    for corner in range(n_corners + 1):
        fan_starts[corner] = starts[corner]
    return number + 1
