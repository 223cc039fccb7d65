"""Distances from each point of a cloud, or others, to the nearest ones: a k-d tree with a tight box a node.

J. L. Bentley, "Multidimensional binary search trees used for associative searching" (1975); halved at the
median of the longest side of the box (Friedman, Bentley, Finkel 1977). The tree is implicit: on level l
node i holds the points n·i / 2^l … n·(i + 1) / 2^l of the order.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.numerics.vec3 import Vec3, dot, sub, vec3_at

#: Points a leaf holds at most.
_LEAF = 8
#: Points of one call, so that a long run can be watched and stopped.
CHUNK = 1 << 15
#: Neighbours of a point at most.
MAX_NEIGHBOURS = 32
#: The first query's place in the tree where queries are no points of it.
_FOREIGN = -1


class PointTree:
    """A k-d tree over points (n, 3), finite; O(n log n) to build, 24 bytes a point and 12 for its box."""

    def __init__(self, points: np.ndarray):
        n = len(points)
        self.levels = 0
        while n >> self.levels > _LEAF:
            self.levels += 1
        self.order = np.arange(n, dtype=np.int64)
        self.points = np.array(points, dtype=np.float64, order="C")
        self.boxes = np.empty((2 << self.levels, 6))
        build_tree(address_of(self.points), address_of(self.order), n, self.levels, address_of(self.boxes))

    def nearest(self, k: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """For all points, in chunks: their numbers (m,), and the squared distances (m, k) to their k nearest
        others, ascending; infinite where others are fewer. A point counts once for every row with its coordinates."""
        if not 1 <= k <= MAX_NEIGHBOURS:
            raise ValueError(f"k must lie within 1 … {MAX_NEIGHBOURS}, got {k}")
        n = len(self.points)
        for first in range(0, n, CHUNK):
            last = min(first + CHUNK, n)
            squares, _ = self._search(self.points[first:last], k, first)
            yield self.order[first:last], squares

    def nearest_to(self, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """The squared distances (m, k) from queries (m, 3) to their k nearest points, ascending, and the numbers (m, k)
        of these; infinite and −1 where there are not as many. O(log n) a query where points are spread evenly."""
        squares, places = self._search(np.array(queries, dtype=np.float64, order="C"), k, _FOREIGN)
        return squares, np.where(places < 0, -1, self.order[places])

    def _search(self, queries: np.ndarray, k: int, first: int) -> tuple[np.ndarray, np.ndarray]:
        """(m, k) squares and places in the tree; queries are its points ``first`` … and left out, or `_FOREIGN`."""
        squares, places = np.empty((len(queries), k)), np.empty((len(queries), k), dtype=np.int64)
        nearest_points(
            address_of(self.points), len(self.points), self.levels, address_of(self.boxes), address_of(queries),
            len(queries), first, k, address_of(squares), address_of(places),
        )
        return squares, places


@kernel
def _swap(points, order, i, j):
    order[i], order[j] = order[j], order[i]
    for k in range(3):
        points[3 * i + k], points[3 * j + k] = points[3 * j + k], points[3 * i + k]


@kernel
def split_at(points, order, low, high, middle, axis):
    """Order rows low … high − 1: rows before ``middle`` lie no farther along the axis than rows from ``middle`` on.

    Hoare's selection; equal coordinates go to both sides, so lattices do no harm.
    """
    high -= 1
    while low < high:
        a = points[3 * low + axis]
        b = points[3 * ((low + high) >> 1) + axis]
        c = points[3 * high + axis]
        pivot = max(min(a, b), min(max(a, b), c))
        i = low
        j = high
        while i <= j:
            while points[3 * i + axis] < pivot:
                i += 1
            while points[3 * j + axis] > pivot:
                j -= 1
            if i <= j:
                _swap(points, order, i, j)
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@kernel
def fit_box(points, low, high, boxes, node):
    for k in range(3):
        smallest = points[3 * low + k]
        largest = smallest
        for i in range(low + 1, high):
            smallest = min(smallest, points[3 * i + k])
            largest = max(largest, points[3 * i + k])
        boxes[6 * node + k] = smallest
        boxes[6 * node + 3 + k] = largest


@entry("void(int64, int64, int64, int64, int64)")
def build_tree(points_at, order_at, n, levels, boxes_at):
    """Order the points along the tree and box its nodes: node i of level l is row 2^l + i."""
    points = view_f64(points_at, 3 * n)
    order = view_i64(order_at, n)
    boxes = view_f64(boxes_at, 12 << levels)
    for level in range(levels + 1):
        for i in range(1 << level):
            low = (n * i) >> level
            high = (n * (i + 1)) >> level
            node = (1 << level) + i
            fit_box(points, low, high, boxes, node)
            if level < levels:
                axis = longest_axis(boxes, 6 * node)
                split_at(points, order, low, high, (n * (2 * i + 1)) >> (level + 1), axis)


@kernel
def longest_axis(boxes, at):
    size = sub(vec3_at(boxes, at + 3), vec3_at(boxes, at))
    axis = 1 if size.y > size.x else 0
    return 2 if size.z > (size.y if axis == 1 else size.x) else axis


@kernel
def _square_to_box(boxes, node, x):
    """Squared distance of a point from the box of a node."""
    low = sub(vec3_at(boxes, 6 * node), x)
    high = sub(x, vec3_at(boxes, 6 * node + 3))
    d = Vec3(max(max(low.x, high.x), 0.0), max(max(low.y, high.y), 0.0), max(max(low.z, high.z), 0.0))
    return dot(d, d)


@kernel
def _insert_leaf(points, low, high, left_out, x, squares, places, at, k):
    """Put points low … high − 1 but for ``left_out`` into the k nearest to x, ascending."""
    for i in range(low, high):
        if i != left_out:
            d = sub(vec3_at(points, 3 * i), x)
            square = dot(d, d)
            if square < squares[at + k - 1]:
                j = at + k - 1
                while j > at and squares[j - 1] > square:
                    squares[j] = squares[j - 1]
                    places[j] = places[j - 1]
                    j -= 1
                squares[j] = square
                places[j] = i


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def nearest_points(points_at, n, levels, boxes_at, queries_at, n_queries, first, k, squares_at, places_at):
    """Squared distances of queries to their k nearest points, and the places of these in the tree's order.

    first : the place of query 0, where queries are points of the tree in its order: each is left out of its own; −1.
    """
    points = view_f64(points_at, 3 * n)
    boxes = view_f64(boxes_at, 12 << levels)
    queries = view_f64(queries_at, 3 * n_queries)
    squares = view_f64(squares_at, k * n_queries)
    places = view_i64(places_at, k * n_queries)
    for query in range(n_queries):
        at = k * query
        left_out = first + query if first >= 0 else -1
        for j in range(k):
            squares[at + j] = np.inf
            places[at + j] = -1
        x = vec3_at(queries, 3 * query)
        # Depth first, the nearer child first: level by level the path is the bits of `node`, and a bit of
        # `done` says whether the sibling of the node there has been visited.
        node = 1
        level = 0
        done = 1
        while node > 0:
            if _square_to_box(boxes, node, x) < squares[at + k - 1]:
                if level == levels:
                    i = node - (1 << level)
                    low, high = (n * i) >> level, (n * (i + 1)) >> level
                    _insert_leaf(points, low, high, left_out, x, squares, places, at, k)
                else:
                    to_left = _square_to_box(boxes, 2 * node, x)
                    to_right = _square_to_box(boxes, 2 * node + 1, x)
                    node = 2 * node + (1 if to_right < to_left else 0)
                    done = 2 * done
                    level += 1
                    continue
            while done & 1:
                node >>= 1
                done >>= 1
                level -= 1
            if node > 0:
                node ^= 1
                done |= 1
