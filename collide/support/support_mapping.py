"""Support mappings: the point of a convex set that lies farthest in a direction.

A direction is in the set's own frame and need not have unit length. Support values are good to a
few units in the last place of |direction|·reach, which is what `narrowphase/bounds.py` assumes.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.support.block_scan import farthest
from collide.support.coarse_points import COARSE
from collide.support.extreme_vertex import settle_vertex
from collide.support.shape_kinds import CYLINDER, ELLIPSOID, POINTS
from collide.support.support_tree_query import extreme_vertex_listed


@kernel(inline=True)
def support_vertex(coordinates, n, m, gx, gy, gz):
    """Id of a vertex with the largest product with g, by a scan over contiguous blocks.

    coordinates : 3·m doubles: all x, all y, all z, filled up to a multiple of BLOCK.
    n, m : number of vertices, and of stored ones. The filling repeats vertex 0 and never wins.
    """
    k, _ = farthest(coordinates, 0, m, m, gx, gy, gz)
    return k


@kernel
def coarse_vertex(coarse_at, gx, gy, gz):
    """(id, x, y, z): of the COARSE points that stand for many, the one farthest in direction g.

    Their hull lies in the whole one: what it overlaps is overlapped; what it misses may be hit.
    """
    coordinates = view_f64(coarse_at, 3 * COARSE)
    k, _ = farthest(coordinates, 0, COARSE, COARSE, gx, gy, gz)
    ids = view_i64(coarse_at + 24 * COARSE, COARSE)
    return ids[k], coordinates[k], coordinates[COARSE + k], coordinates[2 * COARSE + k]


@kernel
def settled_vertex(coordinates, n, m, tree, vertex, gx, gy, gz):
    """Id of a vertex that is farthest in direction g for certain, near one that is likely to be."""
    proven = settle_vertex(tree, vertex, gx, gy, gz)
    return proven if proven >= 0 else support_vertex(coordinates, n, m, gx, gy, gz)


@kernel(inline=True)
def support(kind, coordinates, n, m, params, at, tree, coarse, listed, gx, gy, gz):
    """(id, x, y, z, list): a point of the core farthest in direction g; id is −1 on curved cores.

    tree : address of the points' support tree, whose vertex is then not proven (`settled_vertex`), or 0.
    coarse : address of a few of the points, to be asked alone (`coarse_vertex`), or 0.
    params : a view whose entries from ``at`` on are the shape's numbers (`PackedConvex.params`).
    """
    if coarse != 0:
        k, x, y, z = coarse_vertex(coarse, gx, gy, gz)
        return k, x, y, z, listed
    if tree != 0:
        return extreme_vertex_listed(tree, listed, gx, gy, gz, view_i64(0, 0))
    if kind == POINTS:
        k = support_vertex(coordinates, n, m, gx, gy, gz)
        return k, coordinates[k], coordinates[m + k], coordinates[2 * m + k], listed
    p0 = params[at]
    p1 = params[at + 1]
    if kind == ELLIPSOID:
        # The gradient of |D g|, D the diagonal of the radii: D² g / |D g|.
        p2 = params[at + 2]
        ax = p0 * gx
        ay = p1 * gy
        az = p2 * gz
        largest = max(abs(ax), abs(ay), abs(az))
        if largest == 0.0:
            return -1, p0, 0.0, 0.0, listed
        ax /= largest
        ay /= largest
        az /= largest
        length = math.sqrt(ax * ax + ay * ay + az * az)
        return -1, p0 * (ax / length), p1 * (ay / length), p2 * (az / length), listed
    # Cylinder and cone: a disc of radius p0 across z, at ±p1.
    largest = max(abs(gx), abs(gy))
    x = 0.0
    y = 0.0
    across = 0.0
    if largest > 0.0:
        ux = gx / largest
        uy = gy / largest
        length = math.sqrt(ux * ux + uy * uy)
        x = p0 * (ux / length)
        y = p0 * (uy / length)
        across = p0 * (length * largest)
    if kind == CYLINDER:
        return -1, x, y, p1 if gz > 0.0 else -p1, listed
    if p1 * gz >= across - p1 * gz:  # cone: the apex, or the rim of the base
        return -1, 0.0, 0.0, p1, listed
    return -1, x, y, -p1, listed
