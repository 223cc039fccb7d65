"""The facets of a mesh nearest to points, from Python: tables of facets, pieces for threads."""

from __future__ import annotations

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from collide.base.threads import share
from collide.fields.point_tree import numbers_along_curve
from collide.kernels import address_of
from collide.mesh.bvh import WIDTH, MeshTree
from collide.mesh.bvh_slabs import make_slabs
from collide.narrowphase.facets.nearest_facet_kernel import (
    BALLS,
    COLUMNS,
    ERROR,
    WORK,
    group_by_balls,
    lay_out_facets,
    nearest_facets,
)

#: Points of a piece of work: its first point finds its facet without a neighbour's.
_PIECE = 1 << 13


class FacetTable(NamedTuple):
    """Facets as the walk reads them.   table : (COLUMNS, stride) float64.   side : the longest side, in units."""

    table: np.ndarray
    side: float


_tables: WeakKeyDictionary[MeshTree, FacetTable] = WeakKeyDictionary()


class NearestFacets(NamedTuple):
    """Of n points.

    distance : (n,) off by at most ``error`` [m].   facet : (n,) int64 numbers.   point : (n, 3) the nearest places.
    error : (n,).   order : (n,) int32 numbers of the points along a curve.
    """

    distance: np.ndarray
    facet: np.ndarray
    point: np.ndarray
    error: np.ndarray
    order: np.ndarray


def table_of(tree: MeshTree) -> FacetTable:
    """The table of a tree, made when first asked for and kept as long as the tree. O(m)."""
    known = _tables.get(tree)
    if known is None:
        tree.need_slabs(make_slabs)
        table = np.empty((COLUMNS, len(tree.ids) + WIDTH))
        side = lay_out_facets(tree.address, address_of(table), table.shape[1])
        known = _tables[tree] = FacetTable(table, side)
    return known


def facets_nearest(tree: MeshTree, points: np.ndarray, workers: int) -> NearestFacets:
    """The nearest facets of points (n, 3) in the mesh's frame, C-contiguous, in ``workers`` threads."""
    n, facets, order = len(points), table_of(tree), numbers_along_curve(points)
    distance, facet, place = np.empty(n), np.empty(n, dtype=np.int64), np.empty((n, 3))

    def look(piece: slice) -> None:
        some, work = order[piece], np.empty(WORK)
        stack = np.empty(WIDTH * (tree.depth + 2), dtype=np.int64)
        nearest_facets(
            tree.address, address_of(facets.table), facets.table.shape[1], facets.side, address_of(points), n,
            address_of(some), len(some), address_of(distance), address_of(facet), address_of(place), address_of(stack),
            address_of(work),
        )

    share(pieces_of(n), look, workers)
    error = ERROR * (distance + math.ldexp(facets.side, tree.exponent))
    return NearestFacets(distance, facet, place, error, order)


def leaders_of(points: np.ndarray, near: NearestFacets, workers: int) -> np.ndarray:
    """(n,) int64 rows: a point's leader is joined to the point by a way off all facets.

    Their balls, which hold no facet, overlap: O(n), and few lead.
    """
    n, lower = len(points), near.distance - near.error
    leaders = np.empty(n, dtype=np.int64)

    def group(piece: slice) -> None:
        some, last = near.order[piece], np.empty(BALLS, dtype=np.int64)
        group_by_balls(
            address_of(points), address_of(lower), n, address_of(some), len(some), address_of(leaders),
            address_of(last),
        )

    share(pieces_of(n), group, workers)
    return leaders


def pieces_of(n: int) -> list[slice]:
    """n points in pieces of work for threads."""
    return [slice(k, min(k + _PIECE, n)) for k in range(0, n, _PIECE)]
