"""The nearest point of a simplex just grown by a point.

Before, the origin's nearest point lay in the relative interior of all the old points; so the new nearest point is the
newest point, or lies on an edge or a face at the newest. Looking at these alone takes two thirds of the time of
`simplex.nearest_in_simplex` over all faces, but by rounding another face may hold the nearest point: a prototype
without a check was wrong by many lengths. So the result is checked: a point v of the simplex is its nearest point if no
corner p has p·v < v·v. Where the check fails, or where the origin may lie inside, the caller looks at all faces.

Points are passed as values: numbers kept in registers need no store and load.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.gjk.simplex import height_behind
from collide.numerics.vec3 import Vec3, add, cross, dot, scale, sub

#: How far, relatively, the square of a length may be from the least product of a corner with it.
_OPTIMAL = 1.0 - 2.0**-40


class Nearest(NamedTuple):
    """The nearest point of a simplex of old points A, B, C and the newest, D.

    n_kept : points that stay, D and the first ones of (A, B, C), (B, C, A) or (C, A, B), as ``rotation`` = 0, 1, 2
        says. NOT_FOUND: look at all faces. INSIDE: the origin lies in the tetrahedron; ``w0`` is how deep, at least.
    w0, w1, w2 : weights of D and of the other two.   v : the point.
    """

    n_kept: int
    rotation: int
    w0: float
    w1: float
    w2: float
    v: Vec3


#: Values of ``n_kept`` besides 1 … 3.
NOT_FOUND, INSIDE = 0, 4


@kernel(inline=True)
def nearest_with_newest(n, A, B, C, D, error, slack):
    """The `Nearest` for n old points of A, B, C and the newest, D, and its squared distance.

    error : how far each point may be from its true place.   slack : how far a square may be off.
    """
    if n == 1:
        nearest = _on_segment(A, D)
    elif n == 2:
        nearest = _on_triangle(A, B, D)
    else:
        nearest = _on_tetrahedron(A, B, C, D, error)
    v = nearest.v
    square = dot(v, v)
    least = min(dot(v, D), dot(v, A))
    if n > 1:
        least = min(least, dot(v, B))
    if n > 2:
        least = min(least, dot(v, C))
    n_kept = nearest.n_kept
    if n_kept < INSIDE and not least >= square * _OPTIMAL - slack:
        n_kept = NOT_FOUND
    return Nearest(n_kept, nearest.rotation, nearest.w0, nearest.w1, nearest.w2, v), square


@kernel(inline=True)
def select(rotation, a, b, c):
    """One of three, as ``rotation`` says."""
    return a if rotation == 0 else (b if rotation == 1 else c)


@kernel(inline=True)
def _at_newest(D):
    return Nearest(1, 0, 1.0, 0.0, 0.0, D)


@kernel(inline=True)
def _along_edge(rotation, along, square, D, e):
    """The point of the edge from D along e, whose share is along / square."""
    w = min(along / square, 1.0)
    return Nearest(2, rotation, 1.0 - w, w, 0.0, add(D, scale(w, e)))


@kernel(inline=True)
def _on_segment(A, D):
    """`nearest_with_newest` of a segment."""
    e = sub(A, D)
    along = -dot(D, e)
    if along <= 0.0:
        return _at_newest(D)
    return _along_edge(0, along, dot(e, e), D, e)


@kernel(inline=True)
def _on_triangle(A, B, D):
    """`nearest_with_newest` of a triangle."""
    e, f = sub(A, D), sub(B, D)
    within, w1, w2 = _foot_shares(cross(e, f), cross(D, e), cross(D, f))
    if within:
        return _on_face(0, w1, w2, D, e, f)
    p, q = -dot(D, e), -dot(D, f)
    if p <= 0.0 and q <= 0.0:
        return _at_newest(D)
    ee, ff = dot(e, e), dot(f, f)
    if q <= 0.0 or (p > 0.0 and p * p * ff >= q * q * ee):
        return _along_edge(0, p, ee, D, e)
    return _along_edge(1, q, ff, D, f)


@kernel(inline=True)
def _on_tetrahedron(A, B, C, D, error):
    """`nearest_with_newest` of a tetrahedron."""
    e, f, g = sub(A, D), sub(B, D), sub(C, D)
    # Normals of the faces (A, B), (B, C), (C, A) at D.
    ab, bc, ca = cross(e, f), cross(f, g), cross(g, e)
    volume = dot(ab, g)
    outwards = -1.0 if volume < 0.0 else 1.0
    sees_ab = outwards * dot(ab, D) > 0.0
    sees_bc = outwards * dot(bc, D) > 0.0
    sees_ca = outwards * dot(ca, D) > 0.0
    if not (sees_ab or sees_bc or sees_ca):
        least = _squared_clearance(-outwards, ab, D, A, B, error)
        least = min(least, _squared_clearance(-outwards, bc, D, B, C, error))
        least = min(least, _squared_clearance(-outwards, ca, D, C, A, error))
        opposite = cross(sub(f, e), sub(g, e))
        least = min(least, _squared_clearance(outwards, opposite, A, B, C, error))
        clearance = math.sqrt(max(least, 0.0))
        return Nearest(INSIDE if clearance > error else NOT_FOUND, 0, clearance, 0.0, 0.0, D)
    if volume == 0.0:
        return Nearest(NOT_FOUND, 0, 0.0, 0.0, 0.0, D)
    de, df, dg = cross(D, e), cross(D, f), cross(D, g)
    if sees_ab:
        within, w1, w2 = _foot_shares(ab, de, df)
        if within:
            return _on_face(0, w1, w2, D, e, f)
    if sees_bc:
        within, w1, w2 = _foot_shares(bc, df, dg)
        if within:
            return _on_face(1, w1, w2, D, f, g)
    if sees_ca:
        within, w1, w2 = _foot_shares(ca, dg, de)
        if within:
            return _on_face(2, w1, w2, D, g, e)
    return _on_best_edge(D, e, f, g)


@kernel(inline=True)
def _on_best_edge(D, e, f, g):
    """The nearest point of the three edges from D: on the edge of the greatest descent along² / |edge|²."""
    along, square, rotation = max(-dot(D, e), 0.0), dot(e, e), 0
    p, q = max(-dot(D, f), 0.0), dot(f, f)
    if p * p * square > along * along * q:
        along, square, rotation = p, q, 1
    p, q = max(-dot(D, g), 0.0), dot(g, g)
    if p * p * square > along * along * q:
        along, square, rotation = p, q, 2
    if along == 0.0:
        return _at_newest(D)
    return _along_edge(rotation, along, square, D, select(rotation, e, f, g))


@kernel(inline=True)
def _squared_clearance(outwards, n, a, b, c, error):
    """h² / |n|² for the normal n of a triangle, turned outwards: see `height_behind`; −1 unless the origin lies
    behind."""
    height, square = height_behind(scale(outwards, n), a, b, c, error)
    return height * height / square if height > 0.0 else -1.0


@kernel(inline=True)
def _foot_shares(n, de, df):
    """(whether the origin's foot lies within a triangle at D, weights of its second and third corner).

    n : e × f, of the edges from D to the others.   de, df : D × e and D × f.
    """
    square = dot(n, n)
    w1 = -dot(n, df)
    w2 = dot(n, de)
    return w1 > 0.0 and w2 > 0.0 and w1 + w2 < square, w1 / square, w2 / square


@kernel(inline=True)
def _on_face(rotation, w1, w2, D, e, f):
    v = add(add(D, scale(w1, e)), scale(w2, f))
    return Nearest(3, rotation, 1.0 - w1 - w2, w1, w2, v)
