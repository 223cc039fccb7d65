"""The gap of two cores of points to its last digit, from the feature that GJK found.

In double-doubles: a direction across the feature, whose least height over A ⊖ B is a lower bound of the distance, and
the heights of the feature's own points, whose greatest is an upper bound if the foot of the origin lies within
the feature (the Karush-Kuhn-Tucker conditions of the nearest point). Nearly always they are the same number.
Where they are not, doubles stopped at the wrong one of several nearly level features: that is left to integers.
"""

from __future__ import annotations

from collide._jit import kernel, view_f64
from collide.geometry.double_double import add, divide
from collide.narrowphase.fine import (
    FINE,
    HEIGHT_ERROR,
    LARGEST_FINE,
    SLOP_ERROR,
    SMALLEST_FINE,
    fine_edge,
    fine_height,
    fine_length,
    fine_points,
    scale_of,
    set_away_from_edge,
    set_plane,
    write_low_parts,
)
from collide.narrowphase.level import MOST_TIES, are_alone, settle_level

#: Doubles of workspace: four points, a direction, low parts of two poses. Integers: ties.
GAP_DOUBLES, GAP_INTEGERS = 4 * FINE + FINE + 24, 2 * (MOST_TIES + 1)

#: Rounding of a weight's numerator in doubles, of points and edges rounded once, with a dozen roundings to spare.
_WEIGHT_ERROR = 64 * 2.0**-53


@kernel
def weigh_foot(fine, n, parallelogram, weights):
    """Weights of n ≤ 3 points at the foot of the origin, brought among the points; whether it certainly lies there.

    Edges are taken finely and rounded once, so that weights are good to u·|w| over the feature's length, and the
    foot to a few ulps of the pair's size.
    """
    weights[0] = 1.0
    weights[1] = 0.0
    weights[2] = 0.0
    if n == 1:
        return True
    x = fine[0]
    y = fine[2]
    z = fine[4]
    ex, _, ey, _, ez, _ = fine_edge(fine, 1, 0)
    w = abs(x) + abs(y) + abs(z)
    e = abs(ex) + abs(ey) + abs(ez)
    if n == 2:
        square = ex * ex + ey * ey + ez * ez
        along = -(x * ex + y * ey + z * ez)
        margin = _WEIGHT_ERROR * w * e
        if square > 0.0:
            weights[1] = min(max(along / square, 0.0), 1.0)
            weights[0] = 1.0 - weights[1]
        return margin < along < square - margin
    fx, _, fy, _, fz, _ = fine_edge(fine, 2, 0)
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    square = nx * nx + ny * ny + nz * nz
    beta = -(nx * (y * fz - z * fy) + ny * (z * fx - x * fz) + nz * (x * fy - y * fx))
    gamma = -(nx * (ey * z - ez * y) + ny * (ez * x - ex * z) + nz * (ex * y - ey * x))
    f = abs(fx) + abs(fy) + abs(fz)
    # A product of four lengths, each as good as doubles are, and the normal off by as much of |e||f|.
    margin = _WEIGHT_ERROR * w * max(e, f) * e * f
    farther = max(beta, gamma) if parallelogram else beta + gamma
    if square > 0.0:
        weights[1] = max(beta / square, 0.0)
        weights[2] = max(gamma / square, 0.0)
        weights[0] = 1.0 - weights[1] - weights[2]
        if weights[0] < 0.0 and not parallelogram:
            weights[1] /= 1.0 - weights[0]
            weights[2] /= 1.0 - weights[0]
            weights[0] = 0.0
    return beta > margin and gamma > margin and farther < square - margin


@kernel
def polish_gap(pair, terms_at, doubles_at, ties_at, ids, n, parallelogram, weights, size, slop, error):
    """The distance of two cores of points that are apart, from the vertex pairs of the n ≤ 3 points nearest the origin.

    parallelogram : the nearest point lies in that of three points, point 0 the corner between the others.
    weights : of the points at the foot, out where proven.
    terms_at, doubles_at, ties_at : terms of the `PoseTable`, workspace.   size, slop, error : as for the pair.

    Returns (proven, distance, low part, error of it, nx, ny, nz): the last three the unit vector from B to A.
    """
    if n > 3 or not (SMALLEST_FINE < size < LARGEST_FINE):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    fine = view_f64(doubles_at, 4 * FINE)
    direction = view_f64(doubles_at + 8 * 4 * FINE, FINE)
    low_at = doubles_at + 8 * 5 * FINE
    low = view_f64(low_at, write_low_parts(pair, terms_at, low_at))
    scale = scale_of(size)
    fine_points(pair, low, fine, ids, n, scale)
    if not weigh_foot(fine, n, parallelogram, weights):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if n == 1:
        for k in range(FINE):
            direction[k] = fine[k]
    elif n == 2:
        set_away_from_edge(fine, direction)
    else:
        set_plane(fine, 0, 1, 2, direction)
    length, length_low = fine_length(direction)
    if length == 0.0:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    height, height_low = fine_height(fine, 0, direction)
    if height < 0.0:
        for k in range(FINE):
            direction[k] = -direction[k]
        height = -height
        height_low = -height_low
    spread = 0.0
    for k in range(1, n):
        other, other_low = fine_height(fine, k, direction)
        other, other_low = add(other, other_low, -height, -height_low)
        spread = max(spread, abs(other))
    excess = 0.0
    if not are_alone(pair, ids, n, direction, error):
        excess, _, _, _ = settle_level(pair, low, fine, 0, 3, ids, n, direction, error, ties_at, scale)
    # Level pairs of the feature's vertices, and the foot, are within the spread of the first point's height; and
    # so is what lies beyond it.
    unsure = 3.0 * (spread + abs(excess)) / length + HEIGHT_ERROR + SLOP_ERROR * slop * scale
    distance, distance_low = divide(height, height_low, length, length_low)
    over = 1.0 / scale
    return (
        unsure < 2.0**-54 * distance, distance * over, distance_low * over, unsure * over,
        direction[0] / length, direction[2] / length, direction[4] / length,
    )  # fmt: skip
