"""Which facets of a mesh share which edge, worked out once and kept with it; and the parts that uncut facets make."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.mesh.mesh_survey import NO_AREA
from collide.mesh.mesh_topology import COLLAPSED
from collide.numerics.lowest_bits import lowest_exponents
from collide.shapes.mesh import Mesh
from collide.shapes.shape import kept_with_shape


class FacetEdges(NamedTuple):
    """Edges of the facets of a mesh that have an area, numbered among themselves.

    rows : (n,) which facets of the mesh these are.   place : their numbers here, −1 for facets without area.
    corners : (n, 3) int64 welded vertex ids.   edge : (n, 3) the edge from corner k to corner k + 1.
    sides : (e, 2) the facets at an edge where there are two, else −1.
    links : (2, m) int32 the same of edges with two.
    lower_neighbour : (n,) int32 of a facet's neighbours the least, itself where it is less than all.
    lowest_bit : exponent of the lowest bit set in any coordinate.
    """

    rows: np.ndarray
    place: np.ndarray
    corners: np.ndarray
    edge: np.ndarray
    sides: np.ndarray
    links: np.ndarray
    lower_neighbour: np.ndarray
    lowest_bit: int


@kept_with_shape("_facet_edges")
def facet_edges(mesh: Mesh) -> FacetEdges:
    """The edges of a mesh's facets; O(n log n) when first asked for."""
    flags = mesh.survey.flags
    rows = np.flatnonzero((flags & (NO_AREA | COLLAPSED)) == 0)
    place = np.full(len(flags), -1, dtype=np.int64)
    place[rows] = np.arange(len(rows))
    corners = mesh.survey.corners[rows].astype(np.int64)
    starts, ends = corners, np.roll(corners, -1, axis=1)
    keys = (np.minimum(starts, ends) * len(mesh.vertices) + np.maximum(starts, ends)).ravel()
    order = np.argsort(keys, kind="stable")
    new = np.concatenate([[True], np.diff(keys[order]) != 0]) if len(keys) else np.zeros(0, dtype=bool)
    first = np.flatnonzero(new)
    edge = np.empty(len(keys), dtype=np.int64)
    edge[order] = np.cumsum(new) - 1
    two = first[np.diff(np.append(first, len(keys))) == 2]
    sides = np.full((len(first), 2), -1, dtype=np.int64)
    sides[edge[order[two]]] = np.stack([order[two], order[two + 1]], axis=1) // 3
    numbers = np.arange(len(rows))
    of_facet = edge.reshape(-1, 3)
    beyond = sides[of_facet].sum(axis=2) - numbers[:, None]
    beyond[sides[of_facet][:, :, 0] < 0] = len(rows)
    lower = np.minimum(beyond.min(axis=1, initial=len(rows)), numbers)
    lowest = int(lowest_exponents(mesh.vertices.ravel()))
    links = np.ascontiguousarray(sides[sides[:, 0] >= 0].T.astype(np.int32))
    return FacetEdges(rows, place, corners, of_facet, sides, links, lower.astype(np.int32), lowest)


def uncut_parts(edges: FacetEdges, whole: np.ndarray) -> np.ndarray:
    """(n,) numbers of the parts into which whole facets fall, joined along edges of two; −1 for the others.

    whole : (n,) bool. O(n log n) in a few operations on arrays.
    """
    numbers = np.arange(len(whole), dtype=np.int32)
    root = np.where(whole & whole[edges.lower_neighbour], edges.lower_neighbour, numbers)
    while True:
        higher = root[root]
        if (higher == root).all():
            break
        root = higher
    a, b = edges.links
    of_a, of_b = root[a], root[b]
    across = np.flatnonzero(of_a != of_b)
    across = across[whole[a[across]] & whole[b[across]]]
    of_a, of_b = of_a[across], of_b[across]
    is_top = np.zeros(len(whole), dtype=bool)
    is_top[of_a] = is_top[of_b] = True
    tops = np.flatnonzero(is_top)
    number = np.empty(len(whole), dtype=np.int32)
    number[tops] = np.arange(len(tops))
    joined = np.arange(len(whole), dtype=np.int32)
    joined[tops] = tops[components(len(tops), number[of_a], number[of_b])]
    return np.where(whole, joined[root], -1)


def components(n: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) the least number of each component of a graph with edges a[k] – b[k]; O((n + k) log n)."""
    root = np.arange(n)
    while True:
        ra, rb = root[a], root[b]
        low, high = np.minimum(ra, rb), np.maximum(ra, rb)
        open_edges = low != high
        if not open_edges.any():
            return root
        a, b = a[open_edges], b[open_edges]
        np.minimum.at(root, high[open_edges], low[open_edges])
        while True:
            shorter = root[root]
            if (shorter == root).all():
                break
            root = shorter
