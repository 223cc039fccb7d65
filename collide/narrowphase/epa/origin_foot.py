"""The foot of the origin on the deciding plane as a point of the surface, whatever its facets look like.

One facet is not enough where faces are flat but for a rounding, or as thin as one: the foot may lie in a neighbour that
is as level, and the area of a needle says nothing about where in it a point lies. But the ball as large as the depth
lies within the surface and touches the plane in the foot, so some facet of a closed surface passes it to within the
width of the bracket, and the nearest point of all of them is no farther.

Weights come from an edge and what is left across it (Gram, Schmidt), each taken of what the last one left: they may be
far off where a triangle is thin, their point is not (Björck 1967).
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.epa.polytope_surface import FACET, number
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.narrowphase.gjk.simplex import weigh_enclosed


@kernel
def nearest_of_triangle(points, a, b, c, x, y, z):
    """(distance, wa, wb, wc): the point of a triangle that is nearest (x, y, z), to a few roundings of its corners.

    points : coordinates; a, b, c : where the three corners begin. The distance is a sum of three coordinates.
    """
    best, wa, wb, wc = _on_edges(points, a, b, c, x, y, z)
    ex = points[b] - points[a]
    ey = points[b + 1] - points[a + 1]
    ez = points[b + 2] - points[a + 2]
    fx = points[c] - points[a]
    fy = points[c + 1] - points[a + 1]
    fz = points[c + 2] - points[a + 2]
    dx = x - points[a]
    dy = y - points[a + 1]
    dz = z - points[a + 2]
    square = ex * ex + ey * ey + ez * ez
    if square == 0.0:
        return best, wa, wb, wc
    turn = (fx * ex + fy * ey + fz * ez) / square
    gx = fx - turn * ex
    gy = fy - turn * ey
    gz = fz - turn * ez
    turn = (gx * ex + gy * ey + gz * ez) / square
    gx -= turn * ex
    gy -= turn * ey
    gz -= turn * ez
    width = gx * gx + gy * gy + gz * gz
    if width == 0.0:
        return best, wa, wb, wc
    along = (dx * ex + dy * ey + dz * ez) / square
    across = ((dx - along * ex) * gx + (dy - along * ey) * gy + (dz - along * ez) * gz) / width
    across = min(max(across, 0.0), 1.0)
    along = ((dx - across * fx) * ex + (dy - across * fy) * ey + (dz - across * fz) * ez) / square
    along = min(max(along, 0.0), 1.0 - across)
    away = (
        abs(dx - across * fx - along * ex) + abs(dy - across * fy - along * ey) + abs(dz - across * fz - along * ez)
    )
    if away < best:
        return away, 1.0 - across - along, along, across
    return best, wa, wb, wc


@kernel
def _on_edges(points, a, b, c, x, y, z):
    """`nearest_of_triangle` of its edges alone."""
    best = math.inf
    chosen = 0
    share = 0.0
    for k in range(3):
        p = a if k == 0 else (b if k == 1 else c)
        q = b if k == 0 else (c if k == 1 else a)
        ex = points[q] - points[p]
        ey = points[q + 1] - points[p + 1]
        ez = points[q + 2] - points[p + 2]
        dx = x - points[p]
        dy = y - points[p + 1]
        dz = z - points[p + 2]
        square = ex * ex + ey * ey + ez * ez
        s = min(max((dx * ex + dy * ey + dz * ez) / square, 0.0), 1.0) if square > 0.0 else 0.0
        away = abs(dx - s * ex) + abs(dy - s * ey) + abs(dz - s * ez)
        if away < best:
            best = away
            chosen = k
            share = s
    rest = 1.0 - share
    if chosen == 0:
        return best, rest, share, 0.0
    if chosen == 1:
        return best, 0.0, rest, share
    return best, share, 0.0, rest


@kernel
def weigh_corners(points, stride, n, weights, x, y, z):
    """Weights of n ≤ 4 points where they come nearest (x, y, z), which does not lie within a tetrahedron of them."""
    best = math.inf
    for across in range(4 if n == 4 else 1):
        i = 1 if n == 4 and across == 0 else 0
        j = min(i + 1 if i == 1 or across != 1 else 2, n - 1)
        k = n - 1 if n < 4 or across != 3 else 2
        away, wi, wj, wk = nearest_of_triangle(points, stride * i, stride * j, stride * k, x, y, z)
        if away < best:
            best = away
            for corner in range(n):
                weights[corner] = 0.0
            weights[i] += wi
            weights[j] += wj
            weights[k] += wk
    return best


@kernel
def weigh_nearest(surface, count, facet, points, ids, weights, with_ids, x, y, z, enough):
    """The facet that comes nearest (x, y, z) becomes points 0 … 2, weighted for its point there; returns the distance.

    The facet given is tried first, and is good if it comes within ``enough``; else the first that does, or the best.
    """
    source, _, _, _, source_ids, facets, _, _, _ = surface
    best = math.inf
    for turn in range(count + 1):
        f = facet if turn == 0 else turn - 1
        a = POINT * number(facets[FACET * f])
        b = POINT * number(facets[FACET * f + 1])
        c = POINT * number(facets[FACET * f + 2])
        if turn > 0 and _is_outside(source, a, b, c, x, y, z, min(best, 1024.0 * enough)):
            continue
        away, wa, wb, wc = nearest_of_triangle(source, a, b, c, x, y, z)
        if away < best:
            best = away
            weights[0] = wa
            weights[1] = wb
            weights[2] = wc
            for j in range(POINT):
                points[j] = source[a + j]
                points[POINT + j] = source[b + j]
                points[2 * POINT + j] = source[c + j]
            if with_ids:
                for k in range(3):
                    v = number(facets[FACET * f + k])
                    ids[2 * k] = source_ids[2 * v]
                    ids[2 * k + 1] = source_ids[2 * v + 1]
            if best <= enough:
                break
    return best


@kernel
def weigh_origin(surface, count, points, ids, weights):
    """A vertex and the facet across the origin from it become points 0 … 3, weighted for the origin among them."""
    source, _, _, _, source_ids, facets, _, _, _ = surface
    best = math.inf
    chosen = -1
    for turn in range(count + 1):
        f = turn if turn < count else chosen
        if f < 0:
            break
        for k in range(4):
            v = 0 if k == 0 else number(facets[FACET * f + k - 1])
            for j in range(POINT):
                points[POINT * k + j] = source[POINT * v + j]
            ids[2 * k] = source_ids[2 * v]
            ids[2 * k + 1] = source_ids[2 * v + 1]
        if facets[FACET * f] == 0 or facets[FACET * f + 1] == 0 or facets[FACET * f + 2] == 0:
            continue
        away, _ = weigh_enclosed(points, weights)
        if away < best:
            best = away
            chosen = f
    return chosen >= 0


@kernel(inline=True)
def _is_outside(points, a, b, c, x, y, z, slack):
    """Whether a point lies outside the box of a triangle by more than the slack."""
    for axis in range(3):
        p = points[a + axis]
        q = points[b + axis]
        r = points[c + axis]
        at = x if axis == 0 else (y if axis == 1 else z)
        if at < min(p, q, r) - slack or at > max(p, q, r) + slack:
            return True
    return False
