"""GJK: the point of A ⊖ B nearest the origin, with a lower bound from every support plane.

Gilbert, Johnson and Keerthi 1988; the duality-gap stop after van den Bergen 1999. It stops on a
repeated vertex, on a gap below rounding, or when the distance no longer decreases: thin shapes
would otherwise spin to the cap.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.narrowphase.minkowski import (
    POINT,
    copy_point,
    difference_point,
    has_trees,
    inlined_difference_point,
    settle_point,
)
from collide.narrowphase.posed_pair import reach_of_both
from collide.narrowphase.simplex import across_simplex, faces_in_sight, nearest_in_simplex

#: How a run ends. NEAREST: the nearest point is known and clear of rounding. MEETING: nearer than
#: rounding can tell, or no plane separates and no tetrahedron encloses provably. ENCLOSED: the origin lies in a
#: tetrahedron of A ⊖ B, clear of rounding. APART: proven farther apart than the limit.
NEAREST, MEETING, ENCLOSED, APART = range(4)


@kernel(inline=True)
def gjk(pair, points, ids, weights, touch_suffices, radius, limit, error, rounds):
    """Run GJK on the cores of a pair.

    points, ids : workspace for five difference points; the simplex found stands first.
    weights : 10 doubles. In, the last three: a direction from A to B to begin with, or zeros. Out: weights of the simplex, its nearest point v, and the unit axis (along v,
        from the simplex's own edges where v is too short to have a direction).
    touch_suffices : stop as soon as an overlap is proven (a boolean is asked).
    radius : sum of the swept radii.   limit : stop once proven farther apart than this.
    error : absolute error of a bound, from `bounds.py`.

    Returns
    -------
    status, number of simplex points, best lower bound of the core distance (before ``error``),
    clearance of the origin in the tetrahedron (ENCLOSED only), rounds used.
    """
    status, n, lower, clearance, used = _approach(
        pair, points, ids, weights, touch_suffices, radius, limit, error, rounds
    )
    if status != ENCLOSED:
        length = math.sqrt(weights[4] * weights[4] + weights[5] * weights[5] + weights[6] * weights[6])
        for axis in range(3):
            weights[7 + axis] = weights[4 + axis] / length if length > 0.0 else 0.0
        if status != APART and length - lower > 0.5 * error and not (touch_suffices and length + error <= radius):
            dx, dy, dz = across_simplex(points, n, weights[4], weights[5], weights[6])
            along = math.sqrt(dx * dx + dy * dy + dz * dz)
            if along > 0.0:
                difference_point(pair, points, ids, 4, -dx, -dy, -dz)
                if has_trees(pair):
                    settle_point(pair, points, ids, 4, -dx, -dy, -dz)
                refined = _height(points, 4, dx, dy, dz) / along
                if refined > lower:
                    lower = refined
                    weights[7] = dx / along
                    weights[8] = dy / along
                    weights[9] = dz / along
        # Where no plane separates, the run is open whatever made it stop.
        if status != APART:
            status = NEAREST if lower > error or (touch_suffices and length + error <= radius) else MEETING
    return status, n, lower, clearance, used


@kernel(inline=True)
def _approach(pair, points, ids, weights, touch_suffices, radius, limit, error, rounds):
    """The rounds of GJK; see `gjk` for arguments and results."""
    tx = weights[7]
    ty = weights[8]
    tz = weights[9]
    if tx == 0.0 and ty == 0.0 and tz == 0.0:
        tx = pair[14]
        ty = pair[15]
        tz = pair[16]
    largest = max(abs(tx), abs(ty), abs(tz))
    between = touch_suffices and tx == pair[14] and ty == pair[15] and tz == pair[16]
    if largest == 0.0:
        tx = 1.0
    else:  # squares of tiny components would vanish
        tx /= largest
        ty /= largest
        tz /= largest
    if between and largest > 0.0:
        # Balls about the origins of the bodies' frames: no support is asked.
        span = math.sqrt(tx * tx + ty * ty + tz * tz)
        lower = largest * span - reach_of_both(pair)
        if lower - error - radius > limit:
            weights[4] = -tx * (lower / span)
            weights[5] = -ty * (lower / span)
            weights[6] = -tz * (lower / span)
            return APART, 0, lower, 0.0, 0
    inlined_difference_point(pair, points, ids, 0, tx, ty, tz, False)
    n = 1
    square = nearest_in_simplex(points, n, weights, 15)
    # The first support plane already parts most pairs that are farther apart than asked about.
    span = math.sqrt(tx * tx + ty * ty + tz * tz)
    trees = has_trees(pair)
    lower = -_height(points, 0, tx, ty, tz) / span
    if trees:
        if lower - error - radius > limit:
            settle_point(pair, points, ids, 0, tx, ty, tz)
            lower = -_height(points, 0, tx, ty, tz) / span
        else:
            lower = -math.inf  # not proven
    if lower - error - radius > limit:
        weights[4] = -tx * (lower / span)
        weights[5] = -ty * (lower / span)
        weights[6] = -tz * (lower / span)
        return APART, n, lower, 0.0, 0
    # Coarse hulls that overlap are a proof, at a tenth of the price.
    coarse = touch_suffices and (pair[19] != 0 or pair[20] != 0)
    for used in range(1, rounds + 1):
        length = math.sqrt(square)
        if length <= error:
            return MEETING, n, lower, 0.0, used
        if touch_suffices and length + error <= radius:
            return NEAREST, n, lower, 0.0, used
        vx = weights[4]
        vy = weights[5]
        vz = weights[6]
        inlined_difference_point(pair, points, ids, n, -vx, -vy, -vz, coarse)
        bound = _height(points, n, vx, vy, vz) / length
        if coarse and (bound > 0.0 or _repeated(ids, n)):
            coarse = False  # the coarse hulls are apart here, and tell no more
            difference_point(pair, points, ids, n, -vx, -vy, -vz)
            bound = _height(points, n, vx, vy, vz) / length
        if trees and (
            bound - error - radius > limit or length - bound <= 0.125 * error or _repeated(ids, n) or used == rounds
        ):
            settle_point(pair, points, ids, n, -vx, -vy, -vz)
            bound = _height(points, n, vx, vy, vz) / length
            lower = max(lower, bound)
        elif not trees and not coarse:
            lower = max(lower, bound)
        if lower - error - radius > limit:
            return APART, n, lower, 0.0, used
        if length - bound <= 0.125 * error or _repeated(ids, n):
            return NEAREST, n, lower, 0.0, used
        faces = 15
        if n == 3:
            faces, clearance = faces_in_sight(points, error)
            if faces == 0:
                return ENCLOSED, 4, lower, clearance, used
        before = (weights[0], weights[1], weights[2], weights[3])
        closer = nearest_in_simplex(points, n + 1, weights, faces)
        if not closer < square:
            weights[0], weights[1], weights[2], weights[3] = before
            weights[4] = vx
            weights[5] = vy
            weights[6] = vz
            if trees:
                settle_point(pair, points, ids, n, -vx, -vy, -vz)
                lower = max(lower, _height(points, n, vx, vy, vz) / length)
            return NEAREST, n, lower, 0.0, used
        square = closer
        n = _drop_unused(points, ids, weights, n + 1)
    return NEAREST, n, lower, 0.0, rounds


@kernel(inline=True)
def _height(points, k, dx, dy, dz):
    """Point k along a direction."""
    return points[POINT * k] * dx + points[POINT * k + 1] * dy + points[POINT * k + 2] * dz


@kernel(inline=True)
def _repeated(ids, n):
    """Whether point n is one of the n before it (curved cores have no ids and never repeat)."""
    if ids[2 * n] < 0 or ids[2 * n + 1] < 0:
        return False
    for k in range(n):
        if ids[2 * k] == ids[2 * n] and ids[2 * k + 1] == ids[2 * n + 1]:
            return True
    return False


@kernel(inline=True)
def _drop_unused(points, ids, weights, n):
    """Keep the points with a positive weight; returns their number."""
    kept = 0
    for k in range(n):
        if weights[k] > 0.0:
            if kept != k:
                copy_point(points, ids, k, kept)
                weights[kept] = weights[k]
            kept += 1
    for k in range(kept, 4):
        weights[k] = 0.0
    return kept
