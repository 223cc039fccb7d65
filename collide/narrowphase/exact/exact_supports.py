"""Support vertices of the exact stage: doubles propose a few, integers compare them."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.exact.exact_directions import direction_double
from collide.narrowphase.exact.exact_workspace import direction_at, scratch_at
from collide.numerics.digits import add_double, add_product, carry, clear
from collide.support.support_tree_query import extreme_vertex, rings_of


@kernel
def support_pair(digits, scale, pair, length, error):
    """(vertex of A, vertex of B) whose difference is the last one against the direction; unit v in doubles."""
    d, _, _, digits_rot_a, core_a, digits_a, _, digits_rot_b, core_b, digits_b = scale
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    vx, vy, vz = direction_double(digits, d, length)
    along = math.sqrt(vx * vx + vy * vy + vz * vz)
    slack = 2.0 * error * along
    i = _extreme_vertex(
        digits, d, length, A.coords, A.n, A.padded, A.tree, poses, p, 0, digits_rot_a, core_a, digits_a, vx, vy, vz, slack, 1.0
    )
    j = _extreme_vertex(
        digits, d, length, B.coords, B.n, B.padded, B.tree, poses, q, 9, digits_rot_b, core_b, digits_b, vx, vy, vz, slack, -1.0
    )
    return i, j, vx / along, vy / along, vz / along


@kernel
def _extreme_vertex(
    digits, d, n, coordinates, count, m, tree, poses, p, rotation, digits_rot, core, digits_core, vx, vy, vz, slack, sign
):
    """The vertex with the least sign · (v·R a), v the exact direction; the first of equals.

    Doubles rule out all that are farther than twice the slack from the best; what is left, usually
    one vertex, is compared exactly. Where there is a support tree, only what it proposes and its
    neighbours are looked at (which of equals is then up to the tree).
    """
    gx = sign * (poses[p] * vx + poses[p + 3] * vy + poses[p + 6] * vz)
    gy = sign * (poses[p + 1] * vx + poses[p + 4] * vy + poses[p + 7] * vz)
    gz = sign * (poses[p + 2] * vx + poses[p + 5] * vy + poses[p + 8] * vz)
    if tree != 0:
        turn_direction(digits, d, n, rotation, digits_rot)
        found = _climb(digits, d, n + digits_rot, coordinates, m, tree, core, digits_core, gx, gy, gz, slack, sign)
        if found >= 0:
            return found
    least = math.inf
    for i in range(count):
        least = min(least, coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz)
    best = -1
    turned = False
    for i in range(count):
        value = coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz
        if value > least + slack:
            continue
        if best < 0:
            best = i
            continue
        if not turned:
            turn_direction(digits, d, n, rotation, digits_rot)
            turned = True
        if compare(digits, d, n + digits_rot, coordinates, m, core, digits_core, i, best) * sign < 0:
            best = i
    return max(best, 0)


@kernel
def _climb(digits, d, n, coordinates, m, tree, core, digits_core, gx, gy, gz, slack, sign):
    """The least vertex by steps along hull edges from what the tree proposes, compared exactly.

    −1 where all neighbours are level: a vertex within a face, which may be a face on the far side.
    """
    best, _, _, _ = extreme_vertex(tree, -gx, -gy, -gz)
    starts, ring, _ = rings_of(tree)
    while True:
        better = best
        level = True
        for k in range(starts[best], starts[best + 1]):
            i = ring[k]
            value = (
                (coordinates[i] - coordinates[best]) * gx
                + (coordinates[m + i] - coordinates[m + best]) * gy
                + (coordinates[2 * m + i] - coordinates[2 * m + best]) * gz
            )
            if value > slack:
                level = False
                continue
            side = compare(digits, d, n, coordinates, m, core, digits_core, i, better) * sign
            if side < 0:
                better = i
            level = level and side == 0
        if better == best:
            return -1 if level else best
        best = better


@kernel
def turn_direction(digits, d, n, rotation, digits_rot):
    """Rᵀv into scratch 1: comparing vertices then takes three products each instead of twenty-one."""
    for j in range(3):
        at = scratch_at(d, 1) + 5 * d * j
        clear(digits, at, n + digits_rot)
        for axis in range(3):
            add_product(digits, at, direction_at(d, axis), n, (rotation + 3 * axis + j) * d, digits_rot, 1)
        carry(digits, at, n + digits_rot)


@kernel
def compare(digits, d, n, coordinates, m, core, digits_core, i, j):
    """Sign of (Rᵀv)·(a_i − a_j), Rᵀv of n digits standing in scratch 1."""
    out = scratch_at(d, 2)
    at = scratch_at(d, 3)
    clear(digits, out, n + digits_core)
    for axis in range(3):
        if coordinates[axis * m + i] != coordinates[axis * m + j]:
            clear(digits, at, digits_core)
            add_double(digits, at, coordinates[axis * m + i], core)
            add_double(digits, at, -coordinates[axis * m + j], core)
            carry(digits, at, digits_core)
            add_product(digits, out, scratch_at(d, 1) + 5 * d * axis, n, at, digits_core, 1)
    return carry(digits, out, n + digits_core)
