"""Facets of a body at a pose, as kernels of contacts see them."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i32, view_i64
from collide.mesh.bvh import INTS, N_FACETS, TRIANGLES_AT
from collide.narrowphase.facets.posed_surfaces import rotate_by_pose
from collide.numerics.vec3 import Vec3, add, vec3_at

# Header of a body's topology, 64-bit words: addresses of its arrays, how many corners there are, whether the facets are
# those of a convex hull.
CORNERS_AT, PLACES_AT, FANS_AT, FAN_STARTS_AT, EDGES_AT, N_CORNERS, IS_CONVEX = range(7)
TOPOLOGY = 7


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
    )


@kernel(inline=True)
def posed_corner(facets, place, k):
    """Corner k of the triangle at a place of the tree."""
    return add(rotate_by_pose(facets.X, vec3_at(facets.triangles, 9 * place + 3 * k)), facets.shift)
