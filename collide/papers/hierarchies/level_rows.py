"""The levels of a hierarchy by vertex: all rows of one vertex together, finest level first."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_i32, view_i64


def by_vertex(levels, points: int, parent: np.ndarray):
    """Fields ``birth`` to ``level_vertices`` of a `Hierarchy`, without ``parent``, from its levels.

    levels : per level its vertices, where their neighbours start, and the neighbours.
    """
    birth = np.full(points, -1, dtype=np.int32)
    last = np.full(points, -1, dtype=np.int32)
    for level, (vertices, _, _) in enumerate(levels):
        birth[vertices[birth[vertices] < 0]] = level
        last[vertices] = level
    n_levels = np.where(birth >= 0, last - birth + 1, 0).astype(np.int64)
    row = np.cumsum(n_levels) - n_levels
    rows = int(n_levels.sum())
    start = np.zeros(rows + 1, dtype=np.int64)
    for level, (vertices, level_starts, _) in enumerate(levels):
        start[row[vertices] + level - birth[vertices] + 1] = np.diff(level_starts)
    np.cumsum(start, out=start)
    neighbours = np.empty(start[-1], dtype=np.int32)
    for level, (vertices, level_starts, values) in enumerate(levels):
        place = start[row[vertices] + level - birth[vertices]]
        copy_lists(
            address_of(level_starts), address_of(values), len(vertices), address_of(place), address_of(neighbours)
        )
    removed_start = np.zeros(rows + 1, dtype=np.int64)
    arguments = (
        points, address_of(birth), address_of(last), address_of(parent), address_of(row), rows, address_of(start),
        address_of(neighbours), address_of(removed_start),
    )
    write_removed(*arguments, 0, 0)
    np.cumsum(removed_start, out=removed_start)
    removed = np.empty(removed_start[-1], dtype=np.int32)
    write_removed(*arguments, address_of(removed), len(removed))
    level_start = np.cumsum([0, *(len(vertices) for vertices, _, _ in levels)])
    row[birth < 0] = -1
    return (
        birth, last, row, start, neighbours, removed_start, removed, level_start,
        np.concatenate([vertices for vertices, _, _ in levels]),
    )


@entry("void(int64, int64, int64, int64, int64)")
def copy_lists(start_at, values_at, count, place_at, out_at):
    """List k to its place."""
    start = view_i64(start_at, count + 1)
    values = view_i32(values_at, start[count])
    place = view_i64(place_at, count)
    for k in range(count):
        out = view_i32(out_at + 4 * place[k], start[k + 1] - start[k])
        for t in range(start[k + 1] - start[k]):
            out[t] = values[start[k] + t]


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def write_removed(
    points, birth_at, last_at, parent_at, row_at, rows, start_at, neighbours_at, removed_start_at, removed_at, n_removed
):
    """Write for each row the removed neighbours in the finer level; for a new vertex its parent.

    n_removed : 0 for a first pass, writing the length of each row behind the row; else the length of ``removed``.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    birth = view_i32(birth_at, points)
    last = view_i32(last_at, points)
    parent = view_i32(parent_at, points)
    row = view_i64(row_at, points)
    start = view_i64(start_at, rows + 1)
    neighbours = view_i32(neighbours_at, start[rows])
    removed_start = view_i64(removed_start_at, rows + 1)
    removed = view_i32(removed_at, n_removed)
    for v in range(points):
        if birth[v] < 0:
            continue
        for level in range(birth[v], last[v] + 1):
            this = row[v] + level - birth[v]
            at = removed_start[this]
            n_here = 0
            if level > 0 and level == birth[v]:
                n_here = 1
                if n_removed > 0:
                    removed[at] = parent[v]
            elif level > 0:
                for k in range(start[this - 1], start[this]):
                    if last[neighbours[k]] == level - 1:
                        if n_removed > 0:
                            removed[at + n_here] = neighbours[k]
                        n_here += 1
            if n_removed == 0:
                removed_start[this + 1] = n_here
