"""Which facets of a body share corners and edges: what contacts grow patches along."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.contact.facet_fans import lay_out_topology
from collide.kernels import address_of
from collide.lowering.facet_bodies import Body
from collide.lowering.parts import convex_set_of
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
