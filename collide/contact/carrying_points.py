"""Points of a patch that may carry a body: corners of the lower convex hull of the gaps over their places.

A body at rest touches where a plane lies on the gaps from below. On a rough surface carrying points are inside the
patch, too, not only at its rim. A point reached by no plane from below touches first in no position nearby.
"""

from __future__ import annotations

import math

from collide.contact.eight_places import (
    BLOCK,
    TO_GAP,
    TO_V,
    blocks_of,
    fill_last_block,
    place_in_columns,
    put_in_columns,
)
from collide.contact.manifold_points import GAP, POINT, V
from collide.kernels import kernel, view_f64
from collide.kernels.lanes import LANES, any_of, select, view_lanes
from collide.numerics.vec3 import Vec3

#: Classes of points: on a wall; that carry nothing; that a tilt of up to 45° lets carry, and so on, each class for a
#: quarter of the slope before, down to a millionth, below which all slopes are as good.
ON_WALL, PLAIN, STEEP = range(3)
GENTLEST = STEEP + 10
#: Of more points only the lowest of each cell of a grid over them are asked whether they may carry.
MAX_CLASSED, _ACROSS = 256, 8
CELLS = _ACROSS * _ACROSS
#: Squares of slopes are good to this.
_ROUNDING = 1.0 + 2.0**-40


@kernel
def mark_carrying(p, n, n_corners, tolerance, space):
    """Set ``space.remaining`` of points on no wall to their classes.

    Of more than MAX_CLASSED points only the lowest of each of CELLS cells are classed, the others count as PLAIN: each
    is compared with all n: the work grows with n, not with n².
    space.corners : of the hull, ``n_corners``; they are asked first, since most points are far above them.
    """
    stride = _stride_of(n)
    _put_in_order(p, n, stride, n_corners, space)
    if n <= MAX_CLASSED:
        for i in range(n):
            if space.remaining[i] != ON_WALL:
                _mark(p, i, n, stride, n_corners, tolerance, space)
        return
    _find_lowest(p, n, space)
    for c in range(CELLS):
        if space.cells[c] >= 0:
            _mark(p, space.cells[c], n, stride, n_corners, tolerance, space)


@kernel
def _put_in_order(p, n, stride, n_corners, space):
    """Put the points into columns in the order of comparison, with NaN as the gap of points on a wall, which cut
    nothing.
    """
    columns = view_f64(space.columns, BLOCK * blocks_of(n_corners + n))
    for k in range(n_corners + n):
        j = _compared(space, k, n, stride, n_corners)
        gap = math.nan if space.remaining[j] == ON_WALL else p[POINT * j + GAP]
        put_in_columns(columns, k, p[POINT * j], p[POINT * j + V], gap)
    fill_last_block(space.columns, n_corners + n)


@kernel(inline=True)
def _compared(space, k, n, stride, n_corners):
    """Number of the k-th of the points to compare with: corners, then all, ``stride`` from each to the next."""
    return space.corners[k] if k < n_corners else (k - n_corners) * stride % n


@kernel
def _find_lowest(p, n, space):
    """Put the lowest point on no wall of each cell of a grid over all points into ``space.cells``; −1 for none."""
    low_u = low_v = math.inf
    high_u = high_v = -math.inf
    for i in range(n):
        u, v = p[POINT * i], p[POINT * i + V]
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
    per_u, per_v = _per_cell(high_u - low_u), _per_cell(high_v - low_v)
    for c in range(CELLS):
        space.cells[c] = -1
    for i in range(n):
        if space.remaining[i] == ON_WALL:
            continue
        at = POINT * i
        row, column = int(per_v * (p[at + V] - low_v)), int(per_u * (p[at] - low_u))
        c = _ACROSS * min(row, _ACROSS - 1) + min(column, _ACROSS - 1)
        if space.cells[c] < 0 or p[at + GAP] < p[POINT * space.cells[c] + GAP]:
            space.cells[c] = i


@kernel(inline=True)
def _per_cell(width):
    return _ACROSS / width if width > 1e-290 else 0.0


@kernel
def _stride_of(n):
    """A number without common divisors with n, near n over the golden ratio: its multiples go through all n, neighbours
    far from each other."""
    stride = int(0.6180339887498949 * n)
    while True:
        a, b = n, stride
        while b != 0:
            a, b = b, a % b
        if a == 1:
            return stride
        stride += 1


@kernel
def _mark(p, i, n, stride, n_corners, tolerance, space):
    """Set the class of point i."""
    square = _slope_below(p, i, n, stride, n_corners, tolerance, space)
    kind, limit = PLAIN, 1.0
    while kind < GENTLEST and 0.0 <= square <= _ROUNDING * limit:
        kind += 1
        limit *= 2.0**-4
    space.remaining[i] = kind


@kernel
def _slope_below(p, i, n, stride, n_corners, tolerance, space):
    """The square of the slope of the gentlest plane through point i below all others; −1 for slopes beyond 45°.

    tolerance : height above all points elsewhere [m].   stride : from point to point in the order of comparison: the
    work grows with their number where neighbours come far from each other.

    Each point cuts a half-plane from the slopes (u, v). Where the gentlest slope remaining violates the next
    half-plane, the new gentlest slope is on its border (R. Seidel, "Small-dimensional linear programming and convex
    hulls made easy", 1991, section 3; here with the distance from the origin to minimise).
    """
    n_compared = n_corners + n
    columns = view_f64(space.columns, BLOCK * blocks_of(n_compared))
    at_i = Vec3(p[POINT * i], p[POINT * i + V], p[POINT * i + GAP])
    u = v = 0.0
    k = 0
    while True:
        k = _next_cut(space.columns, n_compared, k, at_i, u, v, tolerance)
        if k == n_compared:
            return u * u + v * v
        at = place_in_columns(k)
        du, dv = columns[at] - at_i.x, columns[at + TO_V] - at_i.y
        if abs(du) <= tolerance and abs(dv) <= tolerance:
            j = _compared(space, k, n, stride, n_corners)
            rise = p[POINT * j + GAP] - at_i.z
            if rise < 0.0 or (rise == 0.0 and j < i):
                return -1.0
        else:
            share = (columns[at + TO_GAP] - at_i.z - tolerance) / (du * du + dv * dv)
            low, high = _span_on_border(
                space.columns, at_i, k, tolerance, share * du, share * dv, -dv, du
            )
            if not low <= high:
                return -1.0
            step = min(max(0.0, low), high)
            u, v = share * du - step * dv, share * dv + step * du
            if not u * u + v * v <= _ROUNDING:
                return -1.0
        k += 1


@kernel
def _next_cut(columns_at, n, first, at_i, u, v, tolerance):
    """The next of n points, from ``first`` on, in the place of point i or cutting off the slope (u, v); n without."""
    rows = view_lanes(columns_at, 3 * blocks_of(n))
    columns = view_f64(columns_at, BLOCK * blocks_of(n))
    for b in range(first // LANES, blocks_of(n)):
        du, dv = rows[3 * b] - at_i.x, rows[3 * b + 1] - at_i.y
        if not any_of(_cuts(du, dv, rows[3 * b + 2] - at_i.z, u, v, tolerance)):
            continue
        for k in range(max(first, LANES * b), min(n, LANES * b + LANES)):
            at = place_in_columns(k)
            du_k, dv_k = columns[at] - at_i.x, columns[at + TO_V] - at_i.y
            if _cuts(du_k, dv_k, columns[at + TO_GAP] - at_i.z, u, v, tolerance):
                return k
    return n


@kernel(inline=True)
def _cuts(du, dv, rise, u, v, tolerance):
    """Whether a point away by (du, dv) is in the same place, or cuts off the slope: of half the tolerance is left to
    rounding, of points that are on the plane and asked again.
    """
    return _in_place(du, dv, tolerance) | (u * du + v * dv > rise - tolerance + 0.5 * tolerance)


@kernel(inline=True)
def _in_place(du, dv, tolerance):
    return (du <= tolerance) & (du >= -tolerance) & (dv <= tolerance) & (dv >= -tolerance)


@kernel
def _span_on_border(columns_at, at_i, n_before, tolerance, base_u, base_v, along_u, along_v):
    """(low, high): bounds of t at which the earlier points leave the slope base + t · along; empty if low > high."""
    rows = view_lanes(columns_at, 3 * blocks_of(n_before))
    columns = view_f64(columns_at, BLOCK * blocks_of(n_before))
    low, high = -math.inf, math.inf
    for b in range(blocks_of(n_before)):
        du, dv = rows[3 * b] - at_i.x, rows[3 * b + 1] - at_i.y
        clearance = rows[3 * b + 2] - at_i.z - tolerance - (base_u * du + base_v * dv)
        speed = along_u * du + along_v * dv
        # Quotients below high, or above low, are of clearances below the products, but for rounding.
        factor = select(speed == 0.0, 1.0, speed)
        lowers, raises = (clearance <= _above(high, factor)), (clearance <= _above(low, factor))
        narrows = ((speed > 0.0) & lowers) | ((speed < 0.0) & raises)
        if not any_of((narrows | ((speed == 0.0) & (clearance < -0.5 * tolerance))) & ~_in_place(du, dv, tolerance)):
            continue
        for k in range(LANES * b, min(n_before, LANES * b + LANES)):
            at = place_in_columns(k)
            du_k, dv_k = columns[at] - at_i.x, columns[at + TO_V] - at_i.y
            of_k = columns[at + TO_GAP] - at_i.z - tolerance - (base_u * du_k + base_v * dv_k)
            speed_k = along_u * du_k + along_v * dv_k
            if _in_place(du_k, dv_k, tolerance) or math.isnan(of_k):
                continue
            if speed_k > 0.0:
                high = min(high, of_k / speed_k)
            elif speed_k < 0.0:
                low = max(low, of_k / speed_k)
            elif of_k < -0.5 * tolerance:
                return 1.0, -1.0
    return low, high


@kernel(inline=True)
def _above(bound, factor):
    """An upper bound of their product, whatever rounding did to it."""
    product = bound * factor
    return select(product > 0.0, (1.0 + 2.0**-50) * product, (1.0 - 2.0**-50) * product)


@kernel
def choose_carrying(p, n, n_wanted, kinds, order):
    """Numbers of ``n_wanted`` of n > n_wanted points, ascending, the first among them.

    kinds : classes of the points; they are overwritten. Of the gentlest class first, point by point, the farthest from
    all points taken. The work grows with n times ``n_wanted``: ``order`` holds each point's nearest taken point.
    """
    kinds[0] = -1
    for i in range(n):
        order[i] = 0
    for _ in range(n_wanted - 1):
        best, best_kind, farthest = -1, -1, -1.0
        for i in range(n):
            if kinds[i] < max(best_kind, 0):
                continue
            nearest = _square_apart(p, i, order[i])
            if kinds[i] > best_kind or nearest > farthest:
                best, best_kind, farthest = i, kinds[i], nearest
        kinds[best] = -1
        for i in range(n):
            if _square_apart(p, i, best) < _square_apart(p, i, order[i]):
                order[i] = best
    n_taken = 0
    for i in range(n):
        if kinds[i] == -1:
            order[n_taken] = i
            n_taken += 1
    return n_taken


@kernel(inline=True)
def _square_apart(p, i, j):
    du, dv = p[POINT * i] - p[POINT * j], p[POINT * i + V] - p[POINT * j + V]
    return du * du + dv * dv
