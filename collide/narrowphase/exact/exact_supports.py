"""Support vertices of the exact stage: doubles propose a few, integers compare them."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.exact.exact_directions import direction_double
from collide.narrowphase.exact.exact_workspace import direction_at, scratch_at
from collide.numerics.digits import add_double, add_product, carry, set_zero
from collide.numerics.vec3 import Vec3, column_at, divide, dot, neg, norm, rotate_back, scale, sub
from collide.support.support_tree_query import extreme_vertex, rings_of


class SupportPair(NamedTuple):
    """Vertices i of A and j of B whose difference is extreme against the direction; v : the direction as a unit vector.
    """

    i: int
    j: int
    v: Vec3


@kernel
def support_pair(exact, n):
    """The `SupportPair` of the direction, whose components have n digits."""
    direction = direction_double(exact, n)
    length = norm(direction)
    i = _extreme_vertex(exact, exact.A, exact.pair.A, n, direction, length, 1.0)
    j = _extreme_vertex(exact, exact.B, exact.pair.B, n, direction, length, -1.0)
    return SupportPair(i, j, divide(direction, length))


@kernel
def _extreme_vertex(exact, body, hull, n, direction, length, sign):
    """The vertex with the least sign · (v·R a), v the exact direction; the first of equals.

    Doubles rule out all vertices farther than twice the slack from the best; the rest, usually a single vertex, are
    compared exactly. With a support tree, only the tree's proposal and its neighbours are looked at (the choice among
    equals is then the tree's).
    """
    slack = 2.0 * exact.error * length
    g = scale(sign, rotate_back(exact.pair.poses, hull.pose_at, direction))
    if hull.tree != 0:
        rotate_direction(exact, body, n)
        vertex = _climb(exact, body, hull, n, g, slack, sign)
        if vertex >= 0:
            return vertex
    least = math.inf
    for i in range(hull.n):
        least = min(least, dot(column_at(hull.coords, hull.padded, i), g))
    best = -1
    rotated = False
    for i in range(hull.n):
        if dot(column_at(hull.coords, hull.padded, i), g) > least + slack:
            continue
        if best < 0:
            best = i
            continue
        if not rotated:
            rotate_direction(exact, body, n)
            rotated = True
        if compare(exact, body, hull, n, i, best) * sign < 0:
            best = i
    return max(best, 0)


@kernel
def _climb(exact, body, hull, n, g, slack, sign):
    """The least vertex by steps along hull edges from the tree's proposal, compared exactly.

    −1 where all neighbours are level: a vertex within a face, which may be a face on the far side.
    """
    coords, padded = hull.coords, hull.padded
    best = extreme_vertex(hull.tree, neg(g)).id
    starts, ring, _ = rings_of(hull.tree)
    while True:
        better = best
        level = True
        for k in range(starts[best], starts[best + 1]):
            i = ring[k]
            if dot(sub(column_at(coords, padded, i), column_at(coords, padded, best)), g) > slack:
                level = False
                continue
            side = compare(exact, body, hull, n, i, better) * sign
            if side < 0:
                better = i
            level = level and side == 0
        if better == best:
            return -1 if level else best
        best = better


@kernel
def rotate_direction(exact, body, n):
    """Rᵀv into scratch 1: comparing vertices then takes three products each instead of twenty-one."""
    digits, d = exact.digits, exact.d
    for j in range(3):
        at = scratch_at(d, 1) + 5 * d * j
        set_zero(digits, at, n + body.rotation.n)
        for axis in range(3):
            rotation = (body.rotation_at + 3 * axis + j) * d
            add_product(digits, at, direction_at(d, axis), n, rotation, body.rotation.n, 1)
        carry(digits, at, n + body.rotation.n)


@kernel
def compare(exact, body, hull, n, i, j):
    """Sign of (Rᵀv)·(a_i − a_j), Rᵀv standing in scratch 1."""
    digits, d = exact.digits, exact.d
    length = n + body.rotation.n
    out = scratch_at(d, 2)
    at = scratch_at(d, 3)
    set_zero(digits, out, length + body.core.n)
    for axis in range(3):
        x = hull.coords[axis * hull.padded + i]
        y = hull.coords[axis * hull.padded + j]
        if x != y:
            set_zero(digits, at, body.core.n)
            add_double(digits, at, x, body.core.grid)
            add_double(digits, at, -y, body.core.grid)
            carry(digits, at, body.core.n)
            add_product(digits, out, scratch_at(d, 1) + 5 * d * axis, length, at, body.core.n, 1)
    return carry(digits, out, length + body.core.n)
