"""Rows of convex sets as kernels read them: what stands where, and a packed set's row."""

from __future__ import annotations

from struct import Struct

import numpy as np

from collide.lowering.lazy_structures import coarse_address
from collide.lowering.packed_convex import PackedConvex

# One row of integers a shape.
KIND, COUNT, PADDED, ADDRESS, LOWEST, RANK, TREE, COARSE_AT = range(8)
INTS = 8
# One row of doubles a shape; PARAMS is the first of four.
RADIUS, REACH, SLOP, PARAMS = range(4)
NUMBERS = 7

#: The same two rows as Python writes them: a third of the time that numpy takes to read a tuple.
_INT_ROW, _NUMBER_ROW = Struct(f"={INTS}q"), Struct(f"={NUMBERS}d")


def write_row(ints: np.ndarray, numbers: np.ndarray, k: int, packed: PackedConvex, rank: int) -> None:
    """Row k of a set, of (n, INTS) and (n, NUMBERS)."""
    _INT_ROW.pack_into(
        ints.data, _INT_ROW.size * k, packed.kind, len(packed.points), packed.padded, packed.address, packed.lowest,
        rank, 0, coarse_address(packed),
    )
    _NUMBER_ROW.pack_into(
        numbers.data, _NUMBER_ROW.size * k, packed.radius, packed.reach, packed.slop, *packed.numbers
    )
