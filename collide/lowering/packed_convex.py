"""A convex set as the kernels read it: a kind, a few numbers, a block of coordinates.

Every convex shape is a core (points, or one of three curved sets) swept by a ball, or a
half-space. Spheres are one point, capsules two, boxes eight: one kernel answers them all.
"""

from __future__ import annotations

import hashlib
import math
from typing import Any, NamedTuple

import numpy as np

from collide.curved.shape_kinds import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS
from collide.kernels import address_of
from collide.numerics.lowest_bits import NO_BITS
from collide.support.point_columns import lay_out_points

__all__ = [
    "BLOCK", "CONE", "CYLINDER", "ELLIPSOID", "HALFSPACE", "POINTS", "PackedConvex", "on_cache_lines", "pack_curved",
    "pack_halfspace", "pack_points",
]

#: Coordinates stand in blocks of this many doubles, so that a scan needs no remainder loop.
BLOCK = 8


class PreparedStructures:
    """What `prepared_structures.py` makes of the points when first needed; shared by all copies of a packed set.

    with_tree : whether a support tree may be made, if the points are many.   made : by name, what has been made.
    """

    __slots__ = ("made", "with_tree")

    def __init__(self, with_tree: bool):
        self.with_tree = with_tree
        self.made: dict[str, Any] = {}


class PackedConvex(NamedTuple):
    """One convex set, in its own frame.

    kind : POINTS, CYLINDER, CONE, ELLIPSOID or HALFSPACE.
    radius : of the ball swept over the core, in the world [m].
    reach : proven upper bound of the distance of a core point from the frame's origin [m].
    slop : proven upper bound of the distance between the set described and the set stored [m];
        0 where the numbers given are stored as they are.
    params : (4,) cylinder, cone: radius and half length; ellipsoid: three radii; half-space: normal and offset; boxes,
        which are POINTS: half sizes; unused entries are 0.
    points : (n, 3) core points for POINTS; their number is what ids in results refer to.
    coordinates : (3, m) the same points, axis by axis, m the next multiple of BLOCK,
        filled up with copies of the first point.
    prepared : what is made of the points when a query first needs it.
    lowest : exponent of the lowest bit set in any coordinate (2000 where all are 0): the points are
        integers times 2 to it.
    content : digest of the numbers above; equal for equal sets, in every process. It orders the
        bodies of a pair, so that swapped questions are worked out on the same numbers.
    """

    kind: int
    radius: float
    reach: float
    slop: float
    params: np.ndarray
    points: np.ndarray
    coordinates: np.ndarray
    prepared: PreparedStructures
    lowest: int
    content: bytes


def pack_points(points: np.ndarray, radius: float = 0.0, slop: float = 0.0, with_tree: bool = False) -> PackedConvex:
    """The hull of ``points`` (n, 3), swept by a ball of ``radius``.

    with_tree : whether many points get a support tree when a query first needs it.
    """
    rows, n = np.ascontiguousarray(points, dtype=np.float64), len(points)
    columns, reach = on_cache_lines(3, -(-n // BLOCK) * BLOCK), np.empty(1)
    lowest = lay_out_points(address_of(rows), n, address_of(columns), columns.shape[1], address_of(reach))
    return _packed(
        POINTS, float(radius), float(reach[0]), slop, (), _frozen(points), _frozen(columns), int(lowest), with_tree
    )


def pack_curved(kind: int, params, reach: float) -> PackedConvex:
    """A cylinder, cone or ellipsoid by its numbers."""
    return _packed(kind, 0.0, float(reach) * (1 + 1e-15), 0.0, params, *_NO_POINTS)


def pack_halfspace(normal, offset: float) -> PackedConvex:
    """{x : normal·x ≤ offset}; the normal keeps the length it was given."""
    return _packed(HALFSPACE, 0.0, 0.0, 0.0, (*normal, offset), *_NO_POINTS)


def _packed(kind, radius, reach, slop, params, points, coordinates, lowest=NO_BITS, with_tree=False) -> PackedConvex:
    row = np.zeros(4)
    row[: len(params)] = params
    digest = hashlib.blake2b(np.array([kind, radius, *row]).tobytes(), digest_size=16)
    digest.update((points + 0.0).tobytes())
    return PackedConvex(
        kind,
        radius,
        reach,
        slop,
        _frozen(row),
        points,
        coordinates,
        PreparedStructures(with_tree),
        lowest,
        digest.digest(),
    )


def on_cache_lines(*shape: int) -> np.ndarray:
    """An empty array of doubles that begins where a cache line does.

    A block of eight is then read from one line. Where two are touched, as numpy's own arrays mostly have it, a scan of
    128 points takes a quarter longer.
    """
    size = math.prod(shape)
    block = np.empty(size + BLOCK - 1)
    first = -(block.ctypes.data // block.itemsize) % BLOCK
    return block[first : first + size].reshape(shape)


def _frozen(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


_NO_POINTS = (_frozen(np.zeros((0, 3))), _frozen(np.zeros((3, 0))))
