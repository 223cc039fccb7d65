"""Support mappings: the point of a convex set that lies farthest in a direction.

A direction is in the set's own frame and need not have unit length. Support values are good to a
few units in the last place of |direction|·reach, as `narrowphase/bounds.py` assumes.
"""

from __future__ import annotations

import numpy as np

from collide.curved.curved_kinds import curved_support
from collide.curved.shape_kinds import POINTS
from collide.kernels import kernel, view_f64, view_i64
from collide.numerics.vec3 import column_at
from collide.support.block_scan import farthest
from collide.support.coarse_points import COARSE
from collide.support.extreme_vertex import settle_vertex
from collide.support.support_tree_query import SupportPoint, extreme_vertex_listed


@kernel(inline=True)
def support_vertex(coordinates, m, g):
    """Id of a vertex with the largest product with g, by a scan over contiguous blocks.

    coordinates : 3·m doubles: all x, all y, all z, filled up to a multiple of BLOCK.
    m : number of stored ones. The filling repeats vertex 0 and never wins.
    """
    k, _ = farthest(coordinates, 0, m, m, g.x, g.y, g.z)
    return k


@kernel
def coarse_vertex(coarse_at, g, list_id):
    """The coarse point farthest in direction g, of the COARSE points of a cloud; list_id is handed through.

    The coarse points' hull lies in the cloud's hull: a body that overlaps the coarse hull overlaps the cloud's; a body
    apart from the coarse hull may still overlap the cloud's.
    """
    coordinates = view_f64(coarse_at, 3 * COARSE)
    k, _ = farthest(coordinates, 0, COARSE, COARSE, g.x, g.y, g.z)
    ids = view_i64(coarse_at + 24 * COARSE, COARSE)
    return SupportPoint(ids[k], column_at(coordinates, COARSE, k), list_id)


@kernel
def settled_vertex(coordinates, m, tree, vertex, g):
    """Id of a vertex proven farthest in direction g, from a vertex likely to be."""
    proven = settle_vertex(tree, vertex, g)
    return proven if proven >= 0 else support_vertex(coordinates, m, g)


@kernel(inline=True)
def support(kind, coordinates, m, params, at, tree, coarse, list_id, g):
    """The `SupportPoint` of a core farthest in direction g; its id is −1 on curved cores.

    tree : address of the points' support tree, whose vertex is then not proven (`settled_vertex`), or 0.
    coarse : address of the coarse points, to be asked alone (`coarse_vertex`), or 0.
    params : a view whose entries from ``at`` on are the shape's numbers (`PackedConvex.params`).
    list_id : see `extreme_vertex_listed`.
    """
    if coarse != 0:
        return coarse_vertex(coarse, g, list_id)
    if tree != 0:
        return extreme_vertex_listed(tree, list_id, g, view_i64(0, 0))
    if kind == POINTS:
        k = support_vertex(coordinates, m, g)
        return SupportPoint(np.int64(k), column_at(coordinates, m, k), list_id)
    return SupportPoint(np.int64(-1), curved_support(kind, params, at, g), list_id)
