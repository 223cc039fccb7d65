"""A hierarchy P_1 ⊇ P_2 ⊇ … ⊇ P_k as kernels read it, and the step down a level by Lemma 4.2.

L. Barba and S. Langerman, "Optimal detection of intersections between convex polyhedra", sections 4 and 5. Kernels read
the arrays of `hierarchy.Hierarchy` in place; levels count from 0, the body itself (the paper's P_1). The row of a
vertex v of a level is row[v] + level − birth[v].
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, kernel, view_f64, view_i32, view_i64
from collide.numerics.vec3 import dot, vec3_at

_POINTS_AT, _POINTS, _BIRTH_AT, _PARENT_AT, _ROW_AT, _ROWS = range(6)
_NEIGHBOUR_START_AT, _NEIGHBOURS_AT, _NEIGHBOURS, _REMOVED_START_AT, _REMOVED_AT, _REMOVED = range(6, 12)
_LEVEL_START_AT, _LEVEL_VERTICES_AT, _DEPTH = range(12, 15)
#: Integers of a header.
HEADER = 15


class PackedHierarchy:
    """A hierarchy packed for kernels: a header with the addresses and lengths of its arrays.

    hierarchy : a `Hierarchy` or a `FlatHierarchy`. Its arrays are kept alive here, and must not change.
    """

    def __init__(self, hierarchy):
        self.hierarchy = hierarchy
        arrays = (
            hierarchy.points, hierarchy.birth, hierarchy.parent, hierarchy.row, hierarchy.neighbour_start,
            hierarchy.neighbours, hierarchy.removed_start, hierarchy.removed, hierarchy.level_start,
            hierarchy.level_vertices,
        )
        kinds = np.float64, np.int32, np.int32, np.int64, np.int64, np.int32, np.int64, np.int32, np.int64, np.int32
        self._arrays = tuple(np.ascontiguousarray(array, dtype=kind) for array, kind in zip(arrays, kinds))
        points, birth, parent, row, starts, neighbours, removed_start, removed, level_start, vertices = self._arrays
        self.header = np.array(
            [
                address_of(points), len(points), address_of(birth), address_of(parent), address_of(row),
                len(starts) - 1,
                address_of(starts), address_of(neighbours), len(neighbours), address_of(removed_start),
                address_of(removed), len(removed), address_of(level_start), address_of(vertices), len(level_start) - 1,
            ],
            dtype=np.int64,
        )
        self.depth = len(level_start) - 1
        self.max_degree = int(np.diff(starts).max())
        self.bytes = sum(array.nbytes for array in self._arrays)

    @property
    def address(self) -> int:
        """Address of the header: what kernels take."""
        return address_of(self.header)


class Levels(NamedTuple):
    """The arrays of a packed hierarchy in kernels, as `hierarchy.Hierarchy` names them, and its number of levels."""

    points: Any
    birth: Any
    parent: Any
    row: Any
    neighbour_start: Any
    neighbours: Any
    removed_start: Any
    removed: Any
    level_start: Any
    level_vertices: Any
    depth: int


@kernel
def levels_at(address):
    """The `Levels` of a packed hierarchy."""
    header = view_i64(address, HEADER)
    count = header[_POINTS]
    rows = header[_ROWS]
    return Levels(
        view_f64(header[_POINTS_AT], 3 * count), view_i32(header[_BIRTH_AT], count),
        view_i32(header[_PARENT_AT], count),
        view_i64(header[_ROW_AT], count), view_i64(header[_NEIGHBOUR_START_AT], rows + 1),
        view_i32(header[_NEIGHBOURS_AT], header[_NEIGHBOURS]), view_i64(header[_REMOVED_START_AT], rows + 1),
        view_i32(header[_REMOVED_AT], header[_REMOVED]), view_i64(header[_LEVEL_START_AT], header[_DEPTH] + 1),
        view_i32(header[_LEVEL_VERTICES_AT], rows), header[_DEPTH],
    )


@kernel(inline=True)
def row_at(levels, v, level):
    """Where the neighbours of v in a level, and what was removed beside it, are listed."""
    return levels.row[v] + level - levels.birth[v]


@kernel(inline=True)
def height_of(points, v, d):
    """The height of a vertex along d."""
    return dot(vec3_at(points, 3 * v), d)


@kernel
def lowest_of_level(levels, level, d):
    """(vertex, height, tests): the lowest vertex along d of a whole level."""
    start = levels.level_start[level]
    end = levels.level_start[level + 1]
    best = levels.level_vertices[start]
    least = height_of(levels.points, best, d)
    for k in range(start + 1, end):
        v = levels.level_vertices[k]
        height = height_of(levels.points, v, d)
        if height < least:
            least = height
            best = v
    return best, least, end - start


@kernel
def one_level_finer(levels, level, v, d):
    """(vertex, height, tests): v, the lowest vertex along d of ``level``, becomes the lowest of ``level`` − 1.

    Lemma 4.2: at most a single vertex of the finer level lies below v, among v's neighbours removed with the
    step. A vertex added by a cut is not in the finer level (property A3 fails): the vertex
    cut off is on the plane or beyond, and takes its place.
    """
    if levels.birth[v] == level:
        v = levels.parent[v]
        return v, height_of(levels.points, v, d), 1
    height = height_of(levels.points, v, d)
    row = row_at(levels, v, level)
    start = levels.removed_start[row]
    end = levels.removed_start[row + 1]
    best = v
    for k in range(start, end):
        lower = height_of(levels.points, levels.removed[k], d)
        if lower < height:
            height = lower
            best = levels.removed[k]
    return best, height, end - start


@kernel
def lowest_at(levels, level, d):
    """(vertex, height, tests): the lowest vertex along d of any level, from the coarsest down; O(depth)."""
    v, height, tests = lowest_of_level(levels, levels.depth - 1, d)
    for k in range(levels.depth - 1, level, -1):
        v, height, more = one_level_finer(levels, k, v, d)
        tests += more
    return v, height, tests
