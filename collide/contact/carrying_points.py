"""Points of a patch that may carry a body: corners of the lower convex hull of the gaps over their places.

What rests touches where a plane lies on the gaps from below. On a rough surface such points are among the others, and
not only at the rim of the patch. What no plane reaches from below touches first in no position nearby.
"""

from __future__ import annotations

import math

from collide.contact.manifold_points import GAP, POINT, V
from collide.kernels import kernel

#: Classes of points: on a wall; that carry nothing; that a tilt of up to 45° lets carry, and so on, each class for a
#: quarter of the slope before, down to a millionth, below which all slopes are as good.
ON_WALL, PLAIN, STEEP = range(3)
GENTLEST = STEEP + 10
#: Squares of slopes are good to this.
_ROUNDING = 1.0 + 2.0**-40


@kernel
def mark_carrying(p, n, n_corners, tolerance, space):
    """Set ``space.remaining`` of each of n points that is on no wall to its class.

    space.corners : of the hull, ``n_corners``; they are asked first, since most points are far above them.
    """
    for i in range(n):
        if space.remaining[i] != ON_WALL:
            square = _slope_below(p, i, n, n_corners, tolerance, space)
            kind, limit = PLAIN, 1.0
            while kind < GENTLEST and 0.0 <= square <= _ROUNDING * limit:
                kind += 1
                limit *= 2.0**-4
            space.remaining[i] = kind


@kernel
def _slope_below(p, i, n, n_corners, tolerance, space):
    """The square of the slope of the gentlest plane through point i below all others; −1 where it is beyond 45°.

    tolerance : so far above, where they are not in the same place [m].

    Each point cuts a half-plane from the slopes (u, v). Where the gentlest slope that remains violates the next one,
    the gentlest of those that then remain is on its border (R. Seidel, "Small-dimensional linear programming and convex
    hulls made easy", 1991, section 3; here with the distance from the origin as what is least).
    """
    at_i = POINT * i
    u = v = 0.0
    for k in range(n_corners + n):
        j = _compared(space, k, n_corners)
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
        low, high = _span_on_border(p, at_i, k, n_corners, tolerance, space, share * du, share * dv, -dv, du)
        if not low <= high:
            return -1.0
        step = min(max(0.0, low), high)
        u, v = share * du - step * dv, share * dv + step * du
        if not u * u + v * v <= _ROUNDING:
            return -1.0
    return u * u + v * v


@kernel(inline=True)
def _compared(space, k, n_corners):
    """The k-th of the points that one is compared with."""
    return space.corners[k] if k < n_corners else k - n_corners


@kernel
def _span_on_border(p, at_i, n_before, n_corners, tolerance, space, base_u, base_v, along_u, along_v):
    """(low, high): for which t the slope base + t · along is left by the points before; low > high for none."""
    low, high = -math.inf, math.inf
    for k in range(n_before):
        j = _compared(space, k, n_corners)
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

    kinds : classes of the points; they are overwritten. Of the gentlest class first, one by one, the point farthest
    from all that are taken.
    """
    kinds[0] = -1
    for _ in range(n_wanted - 1):
        best, best_kind, farthest = -1, -1, -1.0
        for i in range(n):
            if kinds[i] < max(best_kind, 0):
                continue
            nearest = math.inf
            for j in range(n):
                if kinds[j] == -1:
                    du, dv = p[POINT * i] - p[POINT * j], p[POINT * i + V] - p[POINT * j + V]
                    nearest = min(nearest, du * du + dv * dv)
            if kinds[i] > best_kind or nearest > farthest:
                best, best_kind, farthest = i, kinds[i], nearest
        kinds[best] = -1
    n_taken = 0
    for i in range(n):
        if kinds[i] == -1:
            order[n_taken] = i
            n_taken += 1
    return n_taken
