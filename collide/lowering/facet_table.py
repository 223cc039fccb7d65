"""Triangles as convex sets, written straight into the tables that kernels read: no Python object each.

The triangles stand first, the convex set asked about stands last, also in rank: swapped questions are
worked out on the same numbers.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.lowering.lazy_structures import coarse_address, may_have_tree, support_tree_of
from collide.lowering.packed_convex import BLOCK, POINTS, PackedConvex, pack_points
from collide.lowering.shape_table import ADDRESS, INTS, LOWEST, NUMBERS, PARAMS, REACH, TREE
from collide.numerics.lowest_bits import lowest_exponents

_FACET = pack_points(np.zeros((1, 3)))


class Facets:
    """Triangles (k, 3, 3) as `ShapeTable` lays shapes out, and room for n_more rows behind them."""

    def __init__(self, corners: np.ndarray, n_more: int = 0):
        k = len(corners)
        self.coordinates = np.empty((k, 3, BLOCK))
        self.coordinates[:, :, :3] = corners.transpose(0, 2, 1)
        self.coordinates[:, :, 3:] = corners[:, 0, :, None]
        self.ints = np.zeros((k + n_more, INTS), dtype=np.int64)
        self.numbers = np.zeros((k + n_more, NUMBERS))
        first = address_of(self.coordinates)
        self.ints[:k] = POINTS, 3, BLOCK, 0, 0, 0, 0, 0
        self.ints[:k, ADDRESS] = first + self.coordinates.strides[0] * np.arange(k)
        self.ints[:k, LOWEST] = lowest_exponents(corners.reshape(k, 9))
        self.numbers[:k, REACH] = np.sqrt(np.square(corners).sum(axis=2).max(axis=1)) * (1 + 1e-15)
        self.addresses = address_of(self.ints), address_of(self.numbers)


class FacetTable(Facets):
    """Triangles (k, 3, 3) and behind them one convex set, as `ShapeTable` lays shapes out."""

    def __init__(self, corners: np.ndarray, packed: PackedConvex):
        k = len(corners)
        super().__init__(corners, 1)
        coarse = coarse_address(packed)
        self.ints[k] = (
            packed.kind, len(packed.points), packed.coordinates.shape[1], address_of(packed.coordinates), packed.lowest,
            1,
            0, coarse,
        )
        self.numbers[k, :PARAMS] = packed.radius, packed.reach, packed.slop
        self.numbers[k, PARAMS:] = packed.params
        self.packed = [_FACET] * k + [packed]

    def build_trees(self, rows: np.ndarray) -> None:
        """Build the support tree of the convex set, if large enough; triangles are scanned."""
        packed = self.packed[-1]
        if may_have_tree(packed):
            self.ints[-1, TREE] = support_tree_of(packed).address
