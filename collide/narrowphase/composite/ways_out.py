"""Ways out of half-spaces: the shortest translation of B that clears the half-spaces among the parts of a union.

A body reaching d deep into a half-space with outward normal m is clear once m·x ≥ d; a translation x clears all
half-spaces where every inequality holds. The shortest x lies on one, two or three of the planes m·x = d, at their
nearest point to 0. With λ ≥ 0 every translation y out of all half-spaces is at least Σ λ d / |Σ λ m| long, since
Σ λ d ≤ (Σ λ m)·y.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import INTS, KIND
from collide.narrowphase.halfspace_convex import plane_gap
from collide.narrowphase.posed_pair import OrderedPair, in_order, posed_pair, size_and_slop
from collide.numerics.vec3 import Vec3, add, cross, dot, neg, norm, put_vec3, scale, vec3_at

#: Half-spaces that are taken into account, those into which a body reaches deepest; the others are left to the proof.
MAX_PLANES = 16
#: Of a plane: its normal, towards which B is to go; how deep the bodies overlap along it, and how far off that is [m].
DEPTH, ERROR, PLANE = 3, 4, 5
#: Inequalities of depths of 1 hold but for this part of a translation.
_SLACK = 2.0**-40
#: Normals whose cross product, or determinant, is below this have no common solution that doubles tell.
_DEGENERATE = 2.0**-30


class WayOut(NamedTuple):
    """x : a translation of B that clears all half-spaces, but for rounding; 0 where no translation was found [m].
    least : a proven lower bound of the length of every translation out of all half-spaces [m]."""

    x: Vec3
    least: float


@kernel
def is_halfspace(parts, part):
    return parts.ints[INTS * parts.shape_of[part] + KIND] == HALFSPACE


@kernel
def gather_planes(parts, first_a, n_a, first_b, n_b, planes):
    """Put what bars the way of B's parts on half-spaces among A's, and the other way round, into ``planes``; how many,
    −1 where both bodies have one: two half-spaces overlap without end.

    planes : view of MAX_PLANES · PLANE doubles.
    """
    n = 0
    for side in range(2):
        first_plane, n_planes = (first_a, n_a) if side == 0 else (first_b, n_b)
        first_body, n_bodies = (first_b, n_b) if side == 0 else (first_a, n_a)
        for part in range(first_plane, first_plane + n_planes):
            if not is_halfspace(parts, part):
                continue
            depth, error, m = -math.inf, 0.0, Vec3(0.0, 0.0, 0.0)
            for k in range(first_body, first_body + n_bodies):
                if is_halfspace(parts, k):
                    return -1
                near = gap_of_plane(parts, part, k)
                if -near.gap > depth:
                    depth, error, m = -near.gap, near.error, near.nhat
            n = _put_plane(planes, n, m if side == 0 else neg(m), depth, error)
    return n


@kernel
def gap_of_plane(parts, halfspace, part):
    """The `PlaneGap` of a half-space and another part."""
    ints, numbers, poses = parts.ints, parts.numbers, parts.poses
    sa, pa, sb, pb, flip = in_order(ints, poses, parts.shape_of[halfspace], halfspace, parts.shape_of[part], part)
    pair = posed_pair(ints, numbers, poses, sa, pa, sb, pb)
    size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
    return plane_gap(OrderedPair(pair, ints, flip, size, slop, False))


@kernel
def _put_plane(planes, n, m, depth, error):
    """Put a plane behind n others, or in the place of the least deep of MAX_PLANES; how many there are then."""
    at = n
    if n == MAX_PLANES:
        at = 0
        for k in range(1, n):
            if planes[PLANE * k + DEPTH] < planes[PLANE * at + DEPTH]:
                at = k
        if not depth > planes[PLANE * at + DEPTH]:
            return n
    put_vec3(planes, PLANE * at, m)
    planes[PLANE * at + DEPTH] = depth
    planes[PLANE * at + ERROR] = error
    return max(n, at + 1)


@kernel
def way_out(planes, n, with_depths):
    """The `WayOut` of n planes; of depths of 1 instead of their own unless ``with_depths``: a way that leads out of
    all of them, however far other parts have to be passed by."""
    best, least, square = Vec3(0.0, 0.0, 0.0), 0.0, math.inf
    for i in range(n):
        for j in range(i, n):
            for k in range(j, n):
                if i == j and j != k:
                    continue
                of = _Solution(i, j, k, 1 if k == i else 2 if k == j else 3)
                x, bound = _solution(planes, of, with_depths)
                along = dot(x, x)
                if 0.0 < along < square and _clears(planes, n, x, with_depths):
                    best, least, square = x, bound, along
    return WayOut(best, least)


class _Solution(NamedTuple):
    """The first n of the planes i, j, k."""

    i: Any
    j: Any
    k: Any
    n: int


@kernel(inline=True)
def _depth(planes, k, with_depths):
    """How far B is to go along a plane's normal [m]: the depth and twice the error, so that planes prove B clear; 1
    without depths."""
    return planes[PLANE * k + DEPTH] + 2.0 * planes[PLANE * k + ERROR] if with_depths else 1.0


@kernel
def _solution(planes, of, with_depths):
    """(the shortest x on all n planes, 0 of dependent planes; a lower bound of the length of any translation)."""
    zero = Vec3(0.0, 0.0, 0.0)
    m, d = vec3_at(planes, PLANE * of.i), _depth(planes, of.i, with_depths)
    if of.n == 1:
        return scale(d, m), _least(planes, of, d, 0.0, 0.0)
    o, e = vec3_at(planes, PLANE * of.j), _depth(planes, of.j, with_depths)
    if of.n == 2:
        c = dot(m, o)
        square = dot(cross(m, o), cross(m, o))
        if not square > _DEGENERATE * _DEGENERATE:
            return zero, 0.0
        p, q = (d - c * e) / square, (e - c * d) / square
        return add(scale(p, m), scale(q, o)), _least(planes, of, p, q, 0.0)
    w, f = vec3_at(planes, PLANE * of.k), _depth(planes, of.k, with_depths)
    across = dot(m, cross(o, w))
    if not abs(across) > _DEGENERATE:
        return zero, 0.0
    x = scale(1.0 / across, add(add(scale(d, cross(o, w)), scale(e, cross(w, m))), scale(f, cross(m, o))))
    p, q, r = dot(x, cross(o, w)) / across, dot(x, cross(w, m)) / across, dot(x, cross(m, o)) / across
    return x, _least(planes, of, p, q, r)


@kernel
def _least(planes, of, p, q, r):
    """What no translation that clears some planes is shorter than, by their multipliers; negative ones count as 0."""
    p, q, r = max(p, 0.0), max(q, 0.0), max(r, 0.0)
    at_i, at_j, at_k = PLANE * of.i, PLANE * of.j, PLANE * of.k
    total = add(add(scale(p, vec3_at(planes, at_i)), scale(q, vec3_at(planes, at_j))), scale(r, vec3_at(planes, at_k)))
    length = norm(total)
    if not length > 0.0:
        return 0.0
    # Normals are off by 2⁻⁴⁹ and move a depth by that much of what a body reaches beyond the plane: within its error.
    reached = p * (planes[at_i + DEPTH] - 2.0 * planes[at_i + ERROR])
    reached += q * (planes[at_j + DEPTH] - 2.0 * planes[at_j + ERROR])
    reached += r * (planes[at_k + DEPTH] - 2.0 * planes[at_k + ERROR])
    # Of the sum, 2⁻⁴⁸ of its terms may be rounding: they are longer than it by (p + q + r) / length.
    return max(reached / length * (1.0 - 2.0**-44 * (p + q + r) / length), 0.0)


@kernel
def _clears(planes, n, x, with_depths):
    """Whether a translation clears all planes, but for half an error of their depths."""
    length = norm(x)
    for k in range(n):
        slack = 0.5 * planes[PLANE * k + ERROR] if with_depths else _SLACK * length
        if dot(vec3_at(planes, PLANE * k), x) < _depth(planes, k, with_depths) - slack:
            return False
    return True
