"""The tree of a set of points: 23 bytes a point besides the points, built in linear time.

Nodes are laid out as in trees of meshes, with points in the place of facets: walks down both are the same kernels.
"""

from __future__ import annotations

import math

import numpy as np

from collide.fields.listings import listed
from collide.fields.point_tree_kernel import (
    CELLS,
    MAX_LEVELS,
    WORK,
    WORK_BESIDES,
    balls_on_way,
    build_point_tree,
    nearest_in_tree,
    order_along_curve,
    points_in_box,
)
from collide.kernels import address_of
from collide.mesh.bvh import MAX_LEAF, NODE, WIDTH

#: Words of a walk's stack.
_STACK = 2 * WIDTH * (MAX_LEVELS + 1)
#: Points within less keep their order: cells so small have no inverse [m].
_LEAST_WIDTH = 1e-300


class PointTree:
    """A tree over points (n, 3) float64, C-contiguous and finite, n ≥ 1, which are kept. O(n).

    ids : (n,) int32, numbers of the points in the order of the leaves.   depth : of nodes.
    low, high : (3,) corners of the box around the points [m].
    address : of the header for kernels (`mesh/bvh.py`), valid as long as the tree lives.
    """

    def __init__(self, points: np.ndarray):
        n = len(points)
        self.points, self.ids = points, np.empty(n, dtype=np.int32)
        self.low, self.high = points.min(axis=0), points.max(axis=0)
        centre = 0.5 * self.low + 0.5 * self.high
        reach = float(np.maximum(self.high - centre, centre - self.low).max())
        exponent = max(math.frexp(reach)[1], -900)
        firsts = _first_nodes(n)
        self.depth = len(firsts) - 1
        self._nodes = np.empty((firsts[-1], NODE), dtype=np.int32)
        corner = np.maximum(np.abs(self.low), np.abs(self.high))
        radius = math.sqrt(3.0) * math.ldexp(1.0, exponent)
        self._numbers = np.concatenate([centre, corner, [radius]])
        self._floats = np.empty((-(-n // MAX_LEAF), 3, WIDTH), dtype=np.float32)
        buffers, sizes = (self._nodes, points, self.ids, self._numbers), (len(self._nodes), n, self.depth, exponent)
        self._header = np.array([*map(address_of, buffers), *sizes, address_of(self._floats), 0], dtype=np.int64)
        self.address = address_of(self._header)
        work, first_nodes = np.empty(WORK * n + WORK_BESIDES, dtype=np.int64), np.array(firsts, dtype=np.int64)
        build_point_tree(self.address, address_of(work), address_of(first_nodes), self.depth)

    @property
    def nbytes(self) -> int:
        """Bytes of the tree, the points left out."""
        return self._nodes.nbytes + self.ids.nbytes + self._floats.nbytes

    def nearest(self, places: np.ndarray, k: int, largest: float) -> tuple[np.ndarray, np.ndarray]:
        """(squared distances (m, k), numbers (m, k)) of the k nearest points to places (m, 3), nearest first; ∞ and −1
        where fewer are within a squared distance of ``largest`` [m²]. Of points as near, those of least number.
        """
        squares, ids = np.empty((len(places), k)), np.empty((len(places), k), dtype=np.int64)
        stack = np.empty(_STACK, dtype=np.int64)
        nearest_in_tree(
            self.address, address_of(places), len(places), k, largest, address_of(squares), address_of(ids),
            address_of(stack),
        )
        return squares, ids

    def in_box(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(k,) numbers of the points within a box, ascending."""
        low, high = (np.array(corner, dtype=np.float64) for corner in (low, high))
        stack, corners = np.empty(_STACK, dtype=np.int64), (address_of(low), address_of(high))
        (ids,) = listed(lambda *out: points_in_box(self.address, *corners, *out, address_of(stack)), np.int64)
        return np.sort(ids)

    def on_way(
        self, radius, way: np.ndarray, limit: float, extra: float, slack: float, first: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """(numbers, earliest t) of the balls on a way, by t.

        radius : of all balls, or (n,) [m].   way : (6,) origin and vector.   limit, extra, slack, first : as of
        `balls_on_way`.
        """
        stack, largest = np.empty(_STACK, dtype=np.int64), float(np.max(radius))
        radii = 0 if np.ndim(radius) == 0 else address_of(radius)
        ids, times = listed(
            lambda *out: balls_on_way(
                self.address, radii, largest, address_of(way), limit, extra, slack, first, *out, address_of(stack)
            ),
            np.int64, np.float64,
        )
        order = np.lexsort((ids, times))
        return ids[order], times[order]


def numbers_along_curve(points: np.ndarray) -> np.ndarray:
    """(n,) int32 numbers of points (n, 3), C-contiguous and finite, in an order in which neighbours are near. O(n)."""
    n = len(points)
    ids, low = np.arange(n, dtype=np.int32), points.min(axis=0, initial=np.inf)
    width = float((points.max(axis=0, initial=-np.inf) - low).max())
    if width > _LEAST_WIDTH:
        work = np.empty(WORK * n + WORK_BESIDES, dtype=np.int64)
        order_along_curve(address_of(points), n, address_of(low), CELLS / width, address_of(ids), address_of(work))
    return ids


def _first_nodes(n: int) -> list[int]:
    """Where the nodes of each level begin, and the number of all: the root, then as many as hold the level below."""
    sizes = [-(-n // MAX_LEAF)]
    while sizes[0] > 1:
        sizes.insert(0, -(-sizes[0] // WIDTH))
    counts = [1, *sizes[:-1]]
    firsts = [0]
    for count in counts:
        firsts.append(firsts[-1] + count)
    return firsts
