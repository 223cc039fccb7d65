"""The tree of a set of points: 23 bytes a point besides the points, built in linear time.

Nodes are laid out as in trees of meshes, with points in the place of facets: walks down both are the same kernels.
"""

from __future__ import annotations

import math

import numpy as np

from collide.fields.listings import listed
from collide.fields.point_tree_changes import WORK as CHANGE_WORK
from collide.fields.point_tree_changes import change_point_tree, copy_remaining
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
from collide.mesh.bvh import EXPONENT, MAX_FACETS, MAX_LEAF, NODE, WIDTH

#: Words of a walk's stack.
_STACK = 2 * WIDTH * (MAX_LEVELS + 1)
#: A tree is made anew when a larger share of all points came or went since the last was. At a tenth, questions take at
#: most 1.3 times as long as after building (spheres among points in a cube; on walls 1.18), at four tenths 1.6 times.
_MAX_CHANGED = 0.1
#: Where a larger share comes at once, building takes less time: 0.04 of 10⁵ points, 0.08 of 10⁶.
_MAX_ADDED = 1.0 / 32.0
#: Points within less keep their order: cells so small have no inverse [m].
_LEAST_WIDTH = 1e-300


class PointTree:
    """A tree over points (n, 3) float64, C-contiguous and finite, n ≥ 1, which are kept. O(n).

    ids : (m,) int32, numbers of the points in the order of the leaves, −1 at empty places.   depth : of nodes.
    low, high : (3,) corners of the box around the points [m].
    address : of the header for kernels (`mesh/bvh.py`), valid as long as the tree lives.
    """

    def __init__(self, points: np.ndarray):
        n = len(points)
        corners = low, high = _corners_of(points)
        centre = 0.5 * low + 0.5 * high
        reach = float(np.maximum(high - centre, centre - low).max())
        firsts = _first_nodes(n)
        nodes, ids = np.empty((firsts[-1], NODE), dtype=np.int32), np.empty(n, dtype=np.int32)
        floats = np.empty((-(-n // MAX_LEAF), 3, WIDTH), dtype=np.float32)
        exponent = max(math.frexp(reach)[1], -900)
        self._lay(points, corners, nodes, ids, floats, centre, len(firsts) - 1, exponent)
        work, first_nodes = np.empty(WORK * n + WORK_BESIDES, dtype=np.int64), np.array(firsts, dtype=np.int64)
        build_point_tree(self.address, address_of(work), address_of(first_nodes), self.depth)
        self._n_changed, self._n_built = 0, len(nodes)  # points that came or went since, and nodes

    def _lay(self, points, corners, nodes, ids, floats, centre, depth: int, exponent: int) -> None:
        """Keep the arrays, and name them in the header."""
        self.points, (self.low, self.high), self.ids, self.depth = points, corners, ids, depth
        self._nodes, self._floats = nodes, floats
        corner = np.maximum(np.abs(self.low), np.abs(self.high))
        self._numbers = np.concatenate([centre, corner, [math.sqrt(3.0) * math.ldexp(1.0, exponent)]])
        buffers, sizes = (nodes, points, ids, self._numbers), (len(nodes), len(ids), depth, exponent)
        self._header = np.array([*map(address_of, buffers), *sizes, address_of(floats), 0], dtype=np.int64)
        self.address = address_of(self._header)

    def changed(self, points: np.ndarray, removed: np.ndarray, numbers: np.ndarray) -> PointTree:
        """The tree over the points of this tree after a change.

        points, removed, numbers : of `remaining_points`.

        A patched copy: O(n) of copying, O(log n) a new point. Where much has changed since a tree was made of all
        points, or points leave the range of its units, another is made.
        """
        n, n_added = len(points), len(points) - len(numbers) + len(removed)
        n_changed = self._n_changed + n_added + len(removed)
        made = None
        if n_changed <= _MAX_CHANGED * n and n_added <= _MAX_ADDED * n:
            made = self._patched(points, removed, numbers)
        if made is None:
            return PointTree(points)
        made._n_changed, made._n_built = n_changed, self._n_built
        return made

    def _patched(self, points: np.ndarray, removed: np.ndarray, numbers: np.ndarray) -> PointTree | None:
        """The patched copy; None where room, levels or the range of units do not suffice."""
        n, n_leaves, n_nodes = len(numbers), len(self._floats), len(self._nodes)
        n_added = len(points) - n + len(removed)
        # A point makes a leaf at most, and seldom more than a node: full nodes over full nodes are few.
        floats = _longer(self._floats, n_leaves + n_added)
        nodes, ids = _longer(self._nodes, n_nodes + 2 * n_added + MAX_LEVELS), _longer(self.ids, MAX_LEAF * len(floats))
        if len(ids) > MAX_FACETS:
            return None
        ids[len(self.ids) : MAX_LEAF * n_leaves] = -1
        corners, centre, exponent = self._corners_after(points, removed), self._numbers[:3], int(self._header[EXPONENT])
        made, used = PointTree.__new__(PointTree), np.array(
            [n_nodes, MAX_LEAF * n_leaves, self.depth, self._n_built], dtype=np.int64
        )
        made._lay(points, corners, nodes, ids, floats, centre, self.depth, exponent)
        work = np.empty(CHANGE_WORK, dtype=np.int64)
        if not change_point_tree(
            made.address, address_of(numbers), n, n - len(removed), len(points), address_of(used), address_of(work)
        ):
            return None
        n_nodes, n_places, depth, _ = used.tolist()
        floats = floats[: n_places // MAX_LEAF]
        made._lay(points, corners, nodes[:n_nodes], ids[:n_places], floats, centre, depth, exponent)
        return made

    def _corners_after(self, points: np.ndarray, removed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`_corners_of` points as of `changed`: all are looked at only where a removed point stood on the box."""
        gone, new = self.points[removed], points[len(self.points) - len(removed) :]
        if (gone == self.low).any() or (gone == self.high).any():
            return _corners_of(points)
        low, high = np.min(new, axis=0, initial=np.inf), np.max(new, axis=0, initial=-np.inf)
        return np.minimum(self.low, low), np.maximum(self.high, high)

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


def _corners_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corners (3,) of the box around points (n, 3): column by column, a tenth of the time of ``min(axis=0)``."""
    columns = points.T
    return np.array([x.min() for x in columns]), np.array([x.max() for x in columns])


def _longer(rows: np.ndarray, n: int) -> np.ndarray:
    """A copy with room for n rows."""
    copy = np.empty((n, *rows.shape[1:]), dtype=rows.dtype)
    copy[: len(rows)] = rows
    return copy


def remaining_points(points: np.ndarray, removed: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(points after a change, read-only; (n,) int32 new numbers of the points before, −1 of removed points). O(n)

    points : (n, 3) before.   removed : (r,) int64, numbers of points to leave out, ascending.   more : (k, 3) points to
    put behind.
    """
    n, first = len(points), len(points) - len(removed)
    made, numbers = np.empty((first + len(more), 3)), np.empty(n, dtype=np.int32)
    copy_remaining(address_of(points), n, address_of(removed), len(removed), address_of(made), address_of(numbers))
    made[first:] = more
    made.setflags(write=False)
    return made, numbers


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
