"""Which facets of a body share corners and edges: what contacts grow patches along."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, entry, view_i32, view_i64
from collide.lowering.facet_bodies import Body
from collide.lowering.parts import convex_set_of
from collide.numerics.counting_sort import order_by_key
from collide.shapes.mesh import Mesh


class Topology(NamedTuple):
    """Which of a body's m facets share corners, int32.

    corners : (m, 3) numbers of points, equal for equal points: the shape's first row of the point.
    places : (m,) where facet k stands in the tree.   fans : (3 m,) facets around corner after corner.
    fan_starts : (n_corners + 1,) where the fan of a corner begins.
    edges : (m, 3) numbers of edges from corner to corner, equal for equal edges.
    header : words for kernels, as `contact_facets.py` numbers them.
    """

    corners: np.ndarray
    places: np.ndarray
    fans: np.ndarray
    fan_starts: np.ndarray
    edges: np.ndarray
    header: np.ndarray


def topology_of(body: Body) -> Topology:
    """Made when first asked for, and kept with the shape. O(m log m)."""
    shape = body.shape
    try:
        return shape._topology
    except AttributeError:
        made = _topology(body)
        shape._store(_topology=made)
        return made


def _topology(body: Body) -> Topology:
    tree = body.tree
    places = np.empty(len(tree.ids), dtype=np.int32)
    places[tree.ids] = np.arange(len(places))
    shape = body.shape
    is_mesh = isinstance(shape, Mesh)
    if isinstance(shape, Mesh):
        corners = np.ascontiguousarray(shape.survey.corners, dtype=np.int32)
    else:
        corners = _rows_of_points(convex_set_of(shape).points, tree.triangles[places].reshape(-1, 3))
    m, n_corners = len(corners), int(corners.max()) + 1
    fans, fan_starts = np.empty(3 * m, dtype=np.int32), np.empty(n_corners + 1, dtype=np.int32)
    edges, memory = np.empty((m, 3), dtype=np.int32), np.empty(15 * m + n_corners + 1, dtype=np.int64)
    lay_out_topology(
        address_of(corners), m, n_corners, address_of(fans), address_of(fan_starts), address_of(edges),
        address_of(memory),
    )
    arrays = corners, places, fans, fan_starts, edges
    header = np.array([*(address_of(array) for array in arrays), n_corners, not is_mesh], dtype=np.int64)
    return Topology(*arrays, header)


def _rows_of_points(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(m, 3) the first row of ``points`` that is equal to each of 3 m corners."""
    row_of: dict[bytes, int] = {}
    for k, point in enumerate(points + 0.0):
        row_of.setdefault(point.tobytes(), k)
    return np.array([row_of[corner.tobytes()] for corner in corners + 0.0], dtype=np.int32).reshape(-1, 3)


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
