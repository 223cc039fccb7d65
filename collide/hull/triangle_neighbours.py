"""The triangle across each side of a surface, without sorting: by the vertices at which sides begin and end."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_i64
from collide.numerics.counting_sort import order_by_key

#: 64-bit integers of `SideWorkspace`, of a triangle and of a point, and besides.
SIDE_WORDS_OF_TRIANGLE, SIDE_WORDS_OF_POINT, SIDE_WORDS_FIXED = 9, 2, 1


class SideWorkspace(NamedTuple):
    """Workspace and result of a search for neighbours.

    beside : by side (from corner k of a triangle to the next) the triangle across, −1 at a border.
    corners, sides, starts : corners by their vertices.   mark : by vertex.
    """

    beside: Any
    corners: Any
    sides: Any
    starts: Any
    mark: Any


@kernel
def side_workspace(at, n, n_triangles):
    """Views of a workspace for n points and n_triangles."""
    m = 24 * n_triangles
    return SideWorkspace(
        view_i64(at, 3 * n_triangles), view_i64(at + m, 3 * n_triangles), view_i64(at + 2 * m, 3 * n_triangles),
        view_i64(at + 3 * m, n + 1), view_i64(at + 3 * m + 8 * n + 8, n),
    )


@kernel
def find_neighbours(facets, n, n_triangles, space):
    """Fill ``space.beside`` for the first n_triangles of a surface whose directed sides are distinct. O(n)."""
    starts, sides, mark, beside = space.starts, space.sides, space.mark, space.beside
    for k in range(3 * n_triangles):
        space.corners[k] = k
    order_by_key(facets, space.corners, 3 * n_triangles, n, starts, sides)
    for vertex in range(n):
        mark[vertex] = -1
    for vertex in range(n):
        for k in range(starts[vertex], starts[vertex + 1]):  # sides that begin here, by where they end
            mark[facets[sides[k] - sides[k] % 3 + (sides[k] + 1) % 3]] = sides[k]
        for k in range(starts[vertex], starts[vertex + 1]):  # sides of the same triangles that end here
            side = sides[k] - sides[k] % 3 + (sides[k] + 2) % 3
            twin = mark[facets[side]]
            beside[side] = twin // 3 if twin >= 0 and facets[twin] == vertex else -1
