"""Common edges of facets of a mesh, worked out once and kept with the mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.mesh.mesh_survey import NO_AREA
from collide.mesh.mesh_topology import COLLAPSED
from collide.numerics.lowest_bits import lowest_exponents
from collide.shapes.mesh import Mesh
from collide.shapes.shape import kept_with_shape


class FacetEdges(NamedTuple):
    """Edges of the facets with an area of a mesh, numbered among themselves.

    rows : (n,) numbers in the mesh of facets with an area.   place : their numbers here, −1 for facets without area.
    corners : (n, 3) int64 welded vertex ids.   edge : (n, 3) the edge from corner k to corner k + 1.
    sides : (e, 2) the facets at an edge of two, else −1.
    links : (2, m) int32 the facets at edges of two.
    odd : half-edges 3 · facet + corner of all other edges.
    thin : (k, 3) welded vertex ids of facets with distinct collinear corners.
    lowest_bit : exponent of the lowest bit set in any coordinate.
    """

    rows: np.ndarray
    place: np.ndarray
    corners: np.ndarray
    edge: np.ndarray
    sides: np.ndarray
    links: np.ndarray
    odd: np.ndarray
    thin: np.ndarray
    lowest_bit: int


@kept_with_shape("_facet_edges")
def facet_edges(mesh: Mesh) -> FacetEdges:
    """The edges of a mesh's facets; O(n log n) when first asked for."""
    flags = mesh.survey.flags
    rows = np.flatnonzero((flags & (NO_AREA | COLLAPSED)) == 0)
    thin = mesh.survey.corners[(flags & NO_AREA != 0) & (flags & COLLAPSED == 0)].astype(np.int64)
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
    of_facet = edge.reshape(-1, 3)
    lowest = int(lowest_exponents(mesh.vertices.ravel()))
    links = np.ascontiguousarray(sides[sides[:, 0] >= 0].T.astype(np.int32))
    odd = np.flatnonzero(sides[edge, 0] < 0)
    return FacetEdges(rows, place, corners, of_facet, sides, links, odd, thin, lowest)
