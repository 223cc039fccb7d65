"""A hierarchy P_1 ⊇ P_2 ⊇ … ⊇ P_k as kernels walk it, and the one step down that Lemma 4.2 allows.

L. Barba and S. Langerman, "Optimal detection of intersections between convex polyhedra", sections 4 and 5. Kernels
read the arrays of `geometry.hierarchies.hierarchy.Hierarchy` where they stand; levels count from 0, the body itself
(the paper's P_1). A vertex of a level has a row there: row[v] + level − birth[v].
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, kernel, view_f64, view_i32, view_i64

_POINTS_AT, _POINTS, _BIRTH_AT, _PARENT_AT, _ROW_AT, _ROWS = range(6)
_NEIGHBOUR_START_AT, _NEIGHBOURS_AT, _NEIGHBOURS, _REMOVED_START_AT, _REMOVED_AT, _REMOVED = range(6, 12)
_LEVEL_START_AT, _LEVEL_VERTICES_AT, _DEPTH = range(12, 15)
#: Integers of a header.
HEADER = 15


class Ladder:
    """A hierarchy held for kernels: where its arrays stand.

    hierarchy : a `Hierarchy`. Its arrays are kept alive here, and must not change.
    """

    def __init__(self, hierarchy):
        self.hierarchy = hierarchy
        arrays = (
            hierarchy.points, hierarchy.birth, hierarchy.parent, hierarchy.row, hierarchy.neighbour_start,
            hierarchy.neighbours, hierarchy.removed_start, hierarchy.removed, hierarchy.level_start,
            hierarchy.level_vertices,
        )  # fmt: skip
        kinds = np.float64, np.int32, np.int32, np.int64, np.int64, np.int32, np.int64, np.int32, np.int64, np.int32
        self._held = tuple(np.ascontiguousarray(array, dtype=kind) for array, kind in zip(arrays, kinds))
        points, birth, parent, row, starts, neighbours, removed_start, removed, level_start, vertices = self._held
        self.header = np.array(
            [
                address_of(points), len(points), address_of(birth), address_of(parent), address_of(row), len(starts) - 1,
                address_of(starts), address_of(neighbours), len(neighbours), address_of(removed_start),
                address_of(removed), len(removed), address_of(level_start), address_of(vertices), len(level_start) - 1,
            ],
            dtype=np.int64,
        )  # fmt: skip
        self.depth = len(level_start) - 1
        self.bytes = sum(array.nbytes for array in self._held)

    @property
    def address(self) -> int:
        return address_of(self.header)


@kernel
def ladder_at(address):
    """The arrays of a ladder, and its depth, as one tuple that the functions below take."""
    header = view_i64(address, HEADER)
    count = header[_POINTS]
    rows = header[_ROWS]
    return (
        view_f64(header[_POINTS_AT], 3 * count), view_i32(header[_BIRTH_AT], count), view_i32(header[_PARENT_AT], count),
        view_i64(header[_ROW_AT], count), view_i64(header[_NEIGHBOUR_START_AT], rows + 1),
        view_i32(header[_NEIGHBOURS_AT], header[_NEIGHBOURS]), view_i64(header[_REMOVED_START_AT], rows + 1),
        view_i32(header[_REMOVED_AT], header[_REMOVED]), view_i64(header[_LEVEL_START_AT], header[_DEPTH] + 1),
        view_i32(header[_LEVEL_VERTICES_AT], rows), header[_DEPTH],
    )  # fmt: skip


@kernel(inline=True)
def height_of(points, v, dx, dy, dz):
    return points[3 * v] * dx + points[3 * v + 1] * dy + points[3 * v + 2] * dz


@kernel
def lowest_of_level(ladder, level, dx, dy, dz):
    """(vertex, height, tests): the lowest vertex along d of a whole level."""
    points, _, _, _, _, _, _, _, level_start, level_vertices, _ = ladder
    start = level_start[level]
    end = level_start[level + 1]
    best = level_vertices[start]
    least = height_of(points, best, dx, dy, dz)
    for k in range(start + 1, end):
        v = level_vertices[k]
        height = height_of(points, v, dx, dy, dz)
        if height < least:
            least = height
            best = v
    return best, least, end - start


@kernel
def one_level_finer(ladder, level, v, dx, dy, dz):
    """(vertex, height, tests): v, the lowest vertex along d of ``level``, becomes the lowest of ``level`` − 1.

    Lemma 4.2: at most one vertex of the finer level lies below v, and it is one of those that went with the step
    and were v's neighbours. A vertex that a cut added is not in the finer level (property A3 fails): the vertex
    that was cut off is on the plane or beyond, and takes its place.
    """
    points, birth, parent, row, _, _, removed_start, removed, _, _, _ = ladder
    if birth[v] == level:
        v = parent[v]
        return v, height_of(points, v, dx, dy, dz), 1
    height = height_of(points, v, dx, dy, dz)
    own = row[v] + level - birth[v]
    start = removed_start[own]
    end = removed_start[own + 1]
    best = v
    for k in range(start, end):
        other = height_of(points, removed[k], dx, dy, dz)
        if other < height:
            height = other
            best = removed[k]
    return best, height, end - start


@kernel
def lowest_at(ladder, level, dx, dy, dz):
    """(vertex, height, tests): the lowest vertex along d of any level, from the coarsest down; O(depth)."""
    depth = ladder[10]
    v, height, tests = lowest_of_level(ladder, depth - 1, dx, dy, dz)
    for k in range(depth - 1, level, -1):
        v, height, more = one_level_finer(ladder, k, v, dx, dy, dz)
        tests += more
    return v, height, tests
