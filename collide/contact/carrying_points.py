"""Points of a patch that may carry a body: corners of the lower convex hull of the gaps over their places.

A body at rest touches where a plane lies on the gaps from below. On a rough surface carrying points are inside the
patch, too, not only at its rim. A point reached by no plane from below touches first in no position nearby.
"""

from __future__ import annotations

import math

from collide.contact.manifold_points import GAP, POINT, V
from collide.kernels import kernel

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
    if n <= MAX_CLASSED:
        for i in range(n):
            if space.remaining[i] != ON_WALL:
                _mark(p, i, n, 1, n_corners, tolerance, space)
        return
    _find_lowest(p, n, space)
    stride = _stride_of(n)
    for c in range(CELLS):
        if space.cells[c] >= 0:
            _mark(p, space.cells[c], n, stride, n_corners, tolerance, space)


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

    tolerance : height above all points elsewhere [m].   stride : 1, or the order of looking at the others: the work
    grows with their number where neighbours come far from each other.

    Each point cuts a half-plane from the slopes (u, v). Where the gentlest slope remaining violates the next
    half-plane, the new gentlest slope is on its border (R. Seidel, "Small-dimensional linear programming and convex
    hulls made easy", 1991, section 3; here with the distance from the origin to minimise).
    """
    at_i = POINT * i
    u = v = 0.0
    walk = 0
    for k in range(n_corners + n):
        j, walk = _next_compared(space, k, n, stride, n_corners, walk)
        at = POINT * j
        du, dv, rise = p[at] - p[at_i], p[at + V] - p[at_i + V], p[at + GAP] - p[at_i + GAP]
        if abs(du) <= tolerance and abs(dv) <= tolerance:
            if rise < 0.0 or (rise == 0.0 and j < i):
                return -1.0
            continue
        rise -= tolerance
        if space.remaining[j] == ON_WALL or u * du + v * dv <= rise + 0.5 * tolerance:
            continue  # half of it is left to rounding, of points that are on the plane and asked again
        share = rise / (du * du + dv * dv)
        low, high = _span_on_border(
            p, at_i, k, n, stride, n_corners, tolerance, space, share * du, share * dv, -dv, du
        )
        if not low <= high:
            return -1.0
        step = min(max(0.0, low), high)
        u, v = share * du - step * dv, share * dv + step * du
        if not u * u + v * v <= _ROUNDING:
            return -1.0
    return u * u + v * v


@kernel(inline=True)
def _next_compared(space, k, n, stride, n_corners, walk):
    """(The k-th of the points to compare with, the next ``walk``, 0 before the first.)"""
    if k < n_corners:
        return space.corners[k], walk
    further = walk + stride
    return walk, further - n if further >= n else further


@kernel
def _span_on_border(
    p, at_i, n_before, n, stride, n_corners, tolerance, space, base_u, base_v, along_u, along_v
):
    """(low, high): bounds of t at which the earlier points leave the slope base + t · along; empty if low > high."""
    low, high = -math.inf, math.inf
    walk = 0
    for k in range(n_before):
        j, walk = _next_compared(space, k, n, stride, n_corners, walk)
        at = POINT * j
        du, dv = p[at] - p[at_i], p[at + V] - p[at_i + V]
        if space.remaining[j] == ON_WALL or (abs(du) <= tolerance and abs(dv) <= tolerance):
            continue
        clearance = p[at + GAP] - p[at_i + GAP] - tolerance - (base_u * du + base_v * dv)
        speed = along_u * du + along_v * dv
        if speed > 0.0:
            high = min(high, clearance / speed)
        elif speed < 0.0:
            low = max(low, clearance / speed)
        elif clearance < -0.5 * tolerance:
            return 1.0, -1.0
    return low, high


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
