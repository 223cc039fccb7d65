"""A convex set in the layout of the kernels: a kind, a few numbers, a block of coordinates.

Every convex shape is a core (points, or a curved set of three kinds) swept by a ball, or a
half-space. Spheres are one point, capsules two, boxes eight: the same kernel answers them all.
"""

from __future__ import annotations

import math
from hashlib import blake2b
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.kernels import address_of
from collide.numerics.lowest_bits import NO_BITS
from collide.support.point_columns import lay_out_points

__all__ = [
    "BLOCK", "CONE", "CYLINDER", "ELLIPSOID", "HALFSPACE", "NO_POINTS", "POINTS", "PackedConvex", "PreparedStructures",
    "on_cache_lines", "pack_curved", "pack_halfspace", "pack_points",
]

#: Coordinates stand in blocks of this many doubles, so that a scan needs no remainder loop.
BLOCK = 8


class PreparedStructures:
    """What `lazy_structures.py` makes of the points when first needed; shared by all copies of a packed set.

    with_tree : whether a support tree may be made, if the points are many.   made : by name, what has been made.
    """

    __slots__ = ("made", "with_tree")

    def __init__(self, with_tree: bool):
        self.with_tree = with_tree
        self.made: dict[str, Any] = {}


class PackedConvex(NamedTuple):
    """A convex set, in its own frame.

    kind : POINTS, CYLINDER, CONE, ELLIPSOID or HALFSPACE.
    radius : of the ball swept over the core, in the world [m].
    reach : proven upper bound of the distance of a core point from the frame's origin [m].
    slop : proven upper bound of the distance between the set described and the set stored [m];
        0 where the numbers given are stored unchanged.
    numbers : four; cylinder, cone: radius and half length; ellipsoid: three radii; half-space: normal and offset;
        boxes, which are POINTS: half sizes; unused entries are 0.
    points : (n, 3) core points for POINTS; their number is what ids in results refer to.
    block, address, padded : memory with the same points axis by axis, read-only; where they begin there; how many each
        axis has, the next multiple of BLOCK, filled up with copies of the first point.
    prepared : structures made of the points when a query first needs them.
    lowest : exponent of the lowest bit set in any coordinate (2000 where all are 0): the points are
        integers times 2 to this power.
    content : digest of the numbers above; equal for equal sets, in every process. The digest orders the
        bodies of a pair, so swapped questions are worked out on the same numbers.

    Shapes asked about once pay for what is made here: views that few callers read are properties.
    """

    kind: int
    radius: float
    reach: float
    slop: float
    numbers: tuple[float, ...]
    points: np.ndarray
    block: np.ndarray
    address: int
    padded: int
    prepared: PreparedStructures
    lowest: int
    content: bytes

    @property
    def params(self) -> np.ndarray:
        """(4,) the numbers."""
        return np.array(self.numbers)

    @property
    def coordinates(self) -> np.ndarray:
        """(3, padded) the points, axis by axis."""
        first = (self.address - address_of(self.block)) // self.block.itemsize
        return self.block[first : first + 3 * self.padded].reshape(3, self.padded)


def pack_points(
    points: np.ndarray, radius: float = 0.0, slop: float = 0.0, with_tree: bool = False, params: tuple[float, ...] = ()
) -> PackedConvex:
    """The hull of ``points`` (n, 3), swept by a ball of ``radius``.

    with_tree : whether many points get a support tree when a query first needs it.   params : half sizes of a box; the
    digest leaves these out, since the points tell.
    """
    rows, n = np.ascontiguousarray(points, dtype=np.float64), len(points)
    padded = -(-n // BLOCK) * BLOCK
    block, first = _block_and_first(3 * padded + 1)  # the columns, then the reach
    address = address_of(block) + _DOUBLE * first
    lowest = lay_out_points(address_of(rows), n, address, padded, address + _DOUBLE * 3 * padded)
    points.setflags(write=False)
    block.setflags(write=False)
    return PackedConvex(
        POINTS, float(radius), block.item(first + 3 * padded), slop, _four(params), points, block, address, padded,
        PreparedStructures(with_tree), lowest, _digest(POINTS, radius, _NO_NUMBERS, points),
    )


def pack_curved(kind: int, params, reach: float) -> PackedConvex:
    """A cylinder, cone or ellipsoid by its numbers."""
    return _without_points(kind, float(reach), params)


def pack_halfspace(normal, offset: float) -> PackedConvex:
    """{x : normal·x ≤ offset}; the normal keeps the length it was given."""
    return _without_points(HALFSPACE, 0.0, (*normal, offset))


def _without_points(kind: int, reach: float, params: tuple[float, ...]) -> PackedConvex:
    numbers = _four(params)
    return PackedConvex(
        kind, 0.0, reach, 0.0, numbers, NO_POINTS, NO_POINTS, address_of(NO_POINTS), 0, PreparedStructures(False),
        NO_BITS, _digest(kind, 0.0, numbers, NO_POINTS),
    )


def _four(numbers: tuple[float, ...]) -> tuple[float, ...]:
    return (*numbers, *_NO_NUMBERS[len(numbers) :])


def _digest(kind: int, radius: float, numbers: tuple[float, ...], points: np.ndarray) -> bytes:
    """Digest of the numbers of a set; −0 and 0 are the same coordinate of a point."""
    data = points.tobytes()
    if _MINUS_ZERO in data:  # or the same eight bytes across two doubles: adding 0 then changes nothing
        data = (points + 0.0).tobytes()
    return blake2b(_HEAD.pack(kind, radius, *numbers) + data, digest_size=16).digest()


#: Kind, radius and four numbers, as doubles.
_HEAD = Struct("=6d")
_NO_NUMBERS = (0.0, 0.0, 0.0, 0.0)
_MINUS_ZERO = Struct("=d").pack(-0.0)
_DOUBLE = 8
NO_POINTS = np.frombuffer(b"").reshape(0, 3)  # read-only


def on_cache_lines(*shape: int) -> np.ndarray:
    """An empty array of doubles, aligned to a cache line.

    A block of eight is then read from a single line. Blocks across two lines, as mostly in numpy's own arrays, make a
    scan of 128 points take a quarter longer.
    """
    size = math.prod(shape)
    block, first = _block_and_first(size)
    return block[first : first + size].reshape(shape)


def _block_and_first(size: int) -> tuple[np.ndarray, int]:
    """An empty array with space for so many doubles from where a cache line begins, and that place."""
    block = np.empty(size + BLOCK - 1)
    return block, -(address_of(block) // _DOUBLE) % BLOCK
