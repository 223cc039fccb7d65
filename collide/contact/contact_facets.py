"""Facets of a body as contacts need them: which share corners and edges, and where they are at a pose."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, kernel, view_f64, view_i32, view_i64
from collide.lowering.facet_bodies import Body
from collide.lowering.parts import convex_set_of
from collide.mesh.bvh import INTS, N_FACETS, TRIANGLES_AT
from collide.narrowphase.facets.posed_surfaces import rotate_by_pose
from collide.numerics.vec3 import Vec3, add, vec3_at
from collide.shapes.mesh import Mesh

# Header of a body's topology, 64-bit words: addresses of its arrays, how many corners there are, whether the facets are
# those of a convex hull.
CORNERS_AT, PLACES_AT, FANS_AT, FAN_STARTS_AT, EDGES_AT, N_CORNERS, IS_CONVEX = range(7)
TOPOLOGY = 7


class Topology(NamedTuple):
    """Which of a body's m facets share corners, int32.

    corners : (m, 3) numbers of points, equal for equal points: the first row of the shape's that is there.
    places : (m,) where facet k stands in the tree.   fans : (3 m,) facets around corner after corner.
    fan_starts : (n_corners + 1,) where the fan of a corner begins.
    edges : (m, 3) numbers of the edges from corner to corner, equal for equal edges.
    header : TOPOLOGY words for kernels.
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
    n_corners = int(corners.max()) + 1
    fans = (np.argsort(corners.ravel(), kind="stable") // 3).astype(np.int32)
    fan_starts = np.zeros(n_corners + 1, dtype=np.int32)
    fan_starts[1:] = np.cumsum(np.bincount(corners.ravel(), minlength=n_corners))
    ends = corners[:, [1, 2, 0]].astype(np.int64)
    keys = np.minimum(corners, ends) * n_corners + np.maximum(corners, ends)
    edges = np.unique(keys, return_inverse=True)[1].reshape(-1, 3).astype(np.int32)
    arrays = corners, places, fans, fan_starts, edges
    header = np.array([*(address_of(array) for array in arrays), n_corners, not is_mesh], dtype=np.int64)
    return Topology(*arrays, header)


def _rows_of_points(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(m, 3) the first row of ``points`` that is equal to each of 3 m corners."""
    row_of: dict[bytes, int] = {}
    for k, point in enumerate(points + 0.0):
        row_of.setdefault(point.tobytes(), k)
    return np.array([row_of[corner.tobytes()] for corner in corners + 0.0], dtype=np.int32).reshape(-1, 3)


class PosedFacets(NamedTuple):
    """A body's facets at a pose X (view of 16 doubles), seen from the origin of A.

    solid : facets have an outer side.   is_convex : what leaves all facets at a point leads outside.
    radius : of the ball swept over them [m].   shift : of its origin from A's [m].
    triangles : nine doubles a facet, in the order of the tree.   Other views are those of `Topology`.
    """

    solid: bool
    is_convex: bool
    radius: float
    X: Any
    shift: Vec3
    triangles: Any
    corners: Any
    places: Any
    fans: Any
    fan_starts: Any
    edges: Any
    n_corners: int


@kernel
def open_facets(body, topology_at, X_at, shift):
    """`PosedFacets` of a `FacetBody` whose topology's header stands at an address."""
    words = view_i64(topology_at, TOPOLOGY)
    tree = view_i64(body.tree_at, INTS)
    m, n_corners = tree[N_FACETS], words[N_CORNERS]
    return PosedFacets(
        body.solid != 0, words[IS_CONVEX] != 0, body.radius, view_f64(X_at, 16), shift,
        view_f64(tree[TRIANGLES_AT], 9 * m),
        view_i32(words[CORNERS_AT], 3 * m), view_i32(words[PLACES_AT], m), view_i32(words[FANS_AT], 3 * m),
        view_i32(words[FAN_STARTS_AT], n_corners + 1), view_i32(words[EDGES_AT], 3 * m), n_corners,
    )  # fmt: skip


@kernel(inline=True)
def posed_corner(facets, place, k):
    """Corner k of the triangle at a place of the tree."""
    return add(rotate_by_pose(facets.X, vec3_at(facets.triangles, 9 * place + 3 * k)), facets.shift)
