"""The closed surface of terrain: two triangles a cell, walls around it and around holes, and a bottom."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Surface(NamedTuple):
    """Vertices (n, 3) and faces (m, 3), read-only: first two faces for each of the ``cells`` (k,), numbered row by
    row.
    """

    vertices: np.ndarray
    faces: np.ndarray
    cells: np.ndarray


def surface_of(
    heights: np.ndarray, x: np.ndarray, y: np.ndarray, bottom: float, holes: np.ndarray | None = None,
    around: np.ndarray | None = None,
) -> Surface:
    """The surface over heights (r, c) at y (r,) and x (c,), down to a bottom; cells with a corner of NaN are holes.

    holes : (r − 1, c − 1) bool, further cells to leave out.   around : (r + 1, c + 1) bool, the cells of the terrain,
    with a row and a column more on each side. Walls stand only beside cells missing from ``around``, and the surface
    need not close.
    """
    is_hole = np.isnan(heights)
    is_hole = is_hole[:-1, :-1] | is_hole[:-1, 1:] | is_hole[1:, :-1] | is_hole[1:, 1:]
    if holes is not None:
        is_hole |= holes
    if around is None and not is_hole.any():
        vertices, faces = _whole(x, y, heights, bottom)
    else:
        cells = ~is_hole
        vertices, faces = _with_holes(x, y, heights, bottom, cells, np.pad(cells, 1) if around is None else around)
    vertices.flags.writeable = faces.flags.writeable = False
    return Surface(vertices, faces, np.flatnonzero(~is_hole))


def _tops(at: np.ndarray) -> np.ndarray:
    """The triangles (…, 2, 3) of cells, of the numbers (r, c) of grid points: cut from a point to that of the next
    row and column.
    """
    here, right, across, up = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    return np.stack([here, right, across, here, across, up], axis=-1).reshape(*here.shape, 2, 3)


def _whole(x: np.ndarray, y: np.ndarray, heights: np.ndarray, bottom: float) -> tuple[np.ndarray, np.ndarray]:
    """Of a rectangle: grid points and cells, then walls, then the fan of the bottom.

    Every point of the rim has a point below, so walls are two triangles an edge and vertical in doubles; the bottom
    is a fan around the point below the middle, on no edge of the rim.
    """
    row_count, columns = heights.shape
    n = row_count * columns
    at = np.arange(n, dtype=np.int32).reshape(row_count, columns)
    # Counter-clockwise seen from above: along −y, +x, +y and −x.
    rim = np.concatenate([at[0, :-1], at[:-1, -1], at[-1, :0:-1], at[:0:-1, 0]])
    below = np.arange(n, n + len(rim), dtype=np.int32)
    middle = np.full(len(rim), n + len(rim), dtype=np.int32)
    following, below_following = np.roll(rim, -1), np.roll(below, -1)

    vertices = np.empty((n + len(rim) + 1, 3))
    vertices[:n, 0], vertices[:n, 1], vertices[:n, 2] = np.tile(x, row_count), np.repeat(y, columns), heights.ravel()
    vertices[n:-1, :2] = vertices[rim, :2]
    vertices[-1, :2] = 0.5 * x[0] + 0.5 * x[-1], 0.5 * y[0] + 0.5 * y[-1]
    vertices[n:, 2] = bottom

    walls = _walls(rim, following, below, below_following)
    fan = np.stack([middle, below_following, below], axis=-1)
    return vertices, np.concatenate([_tops(at).reshape(-1, 3), walls, fan])


def _walls(rim: np.ndarray, following: np.ndarray, below: np.ndarray, below_following: np.ndarray) -> np.ndarray:
    """Two triangles an edge of the rim, along which the surface lies to the left."""
    return np.stack([below, below_following, following, below, following, rim], axis=-1).reshape(-1, 3)


def _with_holes(
    x: np.ndarray, y: np.ndarray, heights: np.ndarray, bottom: float, cells: np.ndarray, around: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of some cells (r − 1, c − 1): every grid point of theirs has a point below, and every cell its own bottom, unless
    they are a whole rectangle, whose surface is open (see ``around`` of `surface_of`)."""
    used = np.zeros(heights.shape, dtype=bool)
    for rows in (slice(None, -1), slice(1, None)):
        for columns in (slice(None, -1), slice(1, None)):
            used[rows, columns] |= cells
    n = int(np.count_nonzero(used))
    at = np.full(heights.shape, -1, dtype=np.int32)
    at[used] = np.arange(n, dtype=np.int32)
    row, column = np.nonzero(used)
    above = np.stack([x[column], y[row], heights[used]], axis=1)
    vertices = np.concatenate([above, np.column_stack([above[:, :2], np.full(n, bottom)])])
    tops = _tops(at)[cells].reshape(-1, 3)
    edges = [  # the cell lies to the left: its lower edge runs along +x, its right one along +y
        (at[:-1, :-1], at[:-1, 1:], around[:-2, 1:-1]), (at[:-1, 1:], at[1:, 1:], around[1:-1, 2:]),
        (at[1:, 1:], at[1:, :-1], around[2:, 1:-1]), (at[1:, :-1], at[:-1, :-1], around[1:-1, :-2]),
    ]
    begin = np.concatenate([a[cells & ~beside] for a, _, beside in edges])
    end = np.concatenate([b[cells & ~beside] for _, b, beside in edges])
    if cells.all():
        a, b, c, d = (at[corner] + n for corner in ((0, 0), (0, -1), (-1, -1), (-1, 0)))
        bottoms = np.array([[a, c, b], [a, d, c]], dtype=np.int32)
    else:
        bottoms = tops[:, ::-1] + n
    return vertices, np.concatenate([tops, _walls(begin, end, begin + n, end + n), bottoms])
