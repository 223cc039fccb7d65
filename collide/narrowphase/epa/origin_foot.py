"""The foot of the origin on the deciding plane as a point of the surface, however its facets look.

A single facet is not enough where faces are flat but for a rounding, or as thin as a rounding: the foot may lie in a
level neighbour, and the area of a needle does not locate a point inside. But the ball as large as the depth lies within
the surface and touches the plane in the foot, so some facet of a closed surface passes the foot to within the width of
the bracket, and the nearest point of all facets is no farther.

Weights come from an edge and the remainder across the edge (Gram, Schmidt), each taken of the residual before: they may
be far off where a triangle is thin, their point is not (Björck 1967).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.epa.polytope_surface import FACET, corner
from collide.narrowphase.gjk.minkowski_difference import POINT, copy_coordinates
from collide.narrowphase.gjk.simplex import face_weights, weigh_enclosed
from collide.numerics.vec3 import dot, norm1, scale, sub, vec3_at

#: Facets whose box is farther from a point than this many tolerances are not weighed.
_FAR_FROM_BOX = 1024.0


class OnTriangle(NamedTuple):
    """The point of a triangle nearest another.   distance : a sum of three coordinates.   wa, wb, wc : its weights."""

    distance: float
    wa: float
    wb: float
    wc: float


@kernel
def nearest_of_triangle(a, b, c, p):
    """The `OnTriangle` nearest p, to a few roundings of the corners a, b, c."""
    best = _nearest_of_edges(a, b, c, p)
    e, f, d = sub(b, a), sub(c, a), sub(p, a)
    square = dot(e, e)
    if square == 0.0:
        return best
    g = sub(f, scale(dot(f, e) / square, e))
    g = sub(g, scale(dot(g, e) / square, e))
    width = dot(g, g)
    if width == 0.0:
        return best
    along = dot(d, e) / square
    across = min(max(dot(sub(d, scale(along, e)), g) / width, 0.0), 1.0)
    rest = sub(d, scale(across, f))
    along = min(max(dot(rest, e) / square, 0.0), 1.0 - across)
    distance = norm1(sub(rest, scale(along, e)))
    if distance < best.distance:
        return OnTriangle(distance, 1.0 - across - along, along, across)
    return best


@kernel
def _nearest_of_edges(a, b, c, p):
    """`nearest_of_triangle` of its edges alone."""
    ab, s_ab = _nearest_of_edge(a, b, p)
    bc, s_bc = _nearest_of_edge(b, c, p)
    ca, s_ca = _nearest_of_edge(c, a, p)
    if ca < bc and ca < ab:
        return OnTriangle(ca, s_ca, 0.0, 1.0 - s_ca)
    if bc < ab:
        return OnTriangle(bc, 0.0, 1.0 - s_bc, s_bc)
    return OnTriangle(ab, 1.0 - s_ab, s_ab, 0.0)


@kernel(inline=True)
def _nearest_of_edge(a, b, p):
    """(distance, share of b) of the edge's point nearest p."""
    e, d = sub(b, a), sub(p, a)
    square = dot(e, e)
    s = min(max(dot(d, e) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return norm1(sub(d, scale(s, e))), s


@kernel
def weigh_corners(points, stride, n, weights, p):
    """Weights of n ≤ 4 points where they come nearest p, which does not lie within a tetrahedron of them."""
    best = math.inf
    for across in range(4 if n == 4 else 1):
        i = 1 if n == 4 and across == 0 else 0
        j = min(i + 1 if i == 1 or across != 1 else 2, n - 1)
        k = n - 1 if n < 4 or across != 3 else 2
        nearest = nearest_of_triangle(
            vec3_at(points, stride * i), vec3_at(points, stride * j), vec3_at(points, stride * k), p
        )
        if nearest.distance < best:
            best = nearest.distance
            for v in range(n):
                weights[v] = 0.0
            weights[i] += nearest.wa
            weights[j] += nearest.wb
            weights[k] += nearest.wc
    return best


@kernel(inline=True)
def _copy_corners(surface, f, points, ids, first, with_ids):
    """The corners of a facet become points ``first`` … first + 2, with the vertices they are made of if
    ``with_ids``."""
    for k in range(3):
        v = corner(surface, f, k)
        copy_coordinates(surface.points, v, points, first + k)
        if with_ids:
            ids[2 * (first + k)] = surface.ids[2 * v]
            ids[2 * (first + k) + 1] = surface.ids[2 * v + 1]


@kernel
def load_facet(surface, f, points, ids, weights, with_ids, p):
    """The corners of a facet become points 0 … 2, weighted for the point p of it; returns the least weight."""
    _copy_corners(surface, f, points, ids, 0, with_ids)
    w0, w1, w2 = face_weights(vec3_at(points, 0), vec3_at(points, POINT), vec3_at(points, 2 * POINT), p)
    inside = min(w0, w1, w2)
    w0, w1, w2 = max(w0, 0.0), max(w1, 0.0), max(w2, 0.0)
    total = w0 + w1 + w2
    weights[0] = w0 / total if total > 0.0 else 1.0
    weights[1] = w1 / total if total > 0.0 else 0.0
    weights[2] = w2 / total if total > 0.0 else 0.0
    return inside


@kernel
def weigh_nearest(surface, n_facets, facet, points, ids, weights, with_ids, p, tolerance):
    """The facet nearest p becomes points 0 … 2, weighted for its point nearest p; returns the distance.

    ``facet`` is tried first, and taken if within the tolerance of p; else the first facet within the tolerance, or the
    nearest of all.
    """
    best = math.inf
    for step in range(n_facets + 1):
        f = facet if step == 0 else step - 1
        a = vec3_at(surface.points, POINT * corner(surface, f, 0))
        b = vec3_at(surface.points, POINT * corner(surface, f, 1))
        c = vec3_at(surface.points, POINT * corner(surface, f, 2))
        if step > 0 and _is_outside_box(a, b, c, p, min(best, _FAR_FROM_BOX * tolerance)):
            continue
        nearest = nearest_of_triangle(a, b, c, p)
        if nearest.distance < best:
            best = nearest.distance
            weights[0] = nearest.wa
            weights[1] = nearest.wb
            weights[2] = nearest.wc
            _copy_corners(surface, f, points, ids, 0, with_ids)
            if best <= tolerance:
                break
    return best


@kernel
def weigh_origin(surface, n_facets, points, ids, weights):
    """A vertex and the facet across the origin from it become points 0 … 3, weighted for the origin among them."""
    smallest_miss = math.inf
    nearest = -1
    for step in range(n_facets + 1):
        f = step if step < n_facets else nearest
        if f < 0:
            break
        copy_coordinates(surface.points, 0, points, 0)
        ids[0] = surface.ids[0]
        ids[1] = surface.ids[1]
        _copy_corners(surface, f, points, ids, 1, True)
        if surface.facets[FACET * f] == 0 or surface.facets[FACET * f + 1] == 0 or surface.facets[FACET * f + 2] == 0:
            continue
        miss, _ = weigh_enclosed(points, weights)
        if miss < smallest_miss:
            smallest_miss = miss
            nearest = f
    return nearest >= 0


@kernel(inline=True)
def _is_outside_box(a, b, c, p, slack):
    """Whether p lies outside the box of a triangle by more than the slack."""
    return (
        _is_outside(a.x, b.x, c.x, p.x, slack)
        or _is_outside(a.y, b.y, c.y, p.y, slack)
        or _is_outside(a.z, b.z, c.z, p.z, slack)
    )


@kernel(inline=True)
def _is_outside(a, b, c, p, slack):
    return p < min(a, b, c) - slack or p > max(a, b, c) + slack
