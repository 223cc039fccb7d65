"""The walk of a ray from cell to cell: each step goes along the axis whose next plane is nearest."""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64


@kernel(inline=True)
def _planes(begin, end, first):
    """(step, t of the first plane on the way, t between planes) along an axis, t being 1 at the end."""
    v = end - begin
    if v > 0.0:
        return 1, (first + 1.0 - begin) / v, 1.0 / v
    if v < 0.0:
        return -1, (first - begin) / v, -1.0 / v
    return 0, math.inf, math.inf


@entry("void(int64, int64, int64, int64)")
def walk_rays(begins_at, ends_at, n, cells_at):
    """Cells from each place of ``begins`` up to before the cell of ``ends``, in sides of a cell.

    Their number is the difference of the cells' indices, added up over the axes: every ray ends in the right cell,
    whatever rounds.
    """
    begins, ends = view_f64(begins_at, 3 * n), view_f64(ends_at, 3 * n)
    total = 0
    for i in range(3 * n):
        total += int(abs(math.floor(ends[i]) - math.floor(begins[i])))
    cells, at = view_i64(cells_at, 3 * total), 0
    for i in range(n):
        k = 3 * i
        x, y, z = math.floor(begins[k]), math.floor(begins[k + 1]), math.floor(begins[k + 2])
        last_x, last_y, last_z = math.floor(ends[k]), math.floor(ends[k + 1]), math.floor(ends[k + 2])
        step_x, next_x, each_x = _planes(begins[k], ends[k], x)
        step_y, next_y, each_y = _planes(begins[k + 1], ends[k + 1], y)
        step_z, next_z, each_z = _planes(begins[k + 2], ends[k + 2], z)
        while x != last_x or y != last_y or z != last_z:
            cells[at], cells[at + 1], cells[at + 2] = int(x), int(y), int(z)
            at += 3
            to_x = next_x if x != last_x else math.inf
            to_y = next_y if y != last_y else math.inf
            to_z = next_z if z != last_z else math.inf
            if x != last_x and to_x <= to_y and to_x <= to_z:
                x, next_x = x + step_x, next_x + each_x
            elif y != last_y and to_y <= to_z:
                y, next_y = y + step_y, next_y + each_y
            else:
                z, next_z = z + step_z, next_z + each_z
