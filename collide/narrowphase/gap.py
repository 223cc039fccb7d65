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

#: Rounding of a weight's numerator in doubles, with a dozen roundings to spare: points are good to u·|w|, and so are edges.
_WEIGHT_ERROR = 64 * 2.0**-53


@kernel(inline=True)
def _foot_is_inside_edge(fine):
    """Whether the foot of the origin certainly lies between points 0 and 1."""
    x = fine[0]
    y = fine[2]
    z = fine[4]
    ex = fine[FINE] - x
    ey = fine[FINE + 2] - y
    ez = fine[FINE + 4] - z
    square = ex * ex + ey * ey + ez * ez
    along = -(x * ex + y * ey + z * ez)
    w = abs(x) + abs(y) + abs(z)
    margin = _WEIGHT_ERROR * w * (w + abs(ex) + abs(ey) + abs(ez))
    return margin < along < square - margin


@kernel(inline=True)
def _foot_is_inside(fine, parallelogram):
    """Whether the foot of the origin certainly lies inside the triangle of points 0, 1 and 2, or their parallelogram."""
    x = fine[0]
    y = fine[2]
    z = fine[4]
    ex = fine[FINE] - x
    ey = fine[FINE + 2] - y
    ez = fine[FINE + 4] - z
    fx = fine[2 * FINE] - x
    fy = fine[2 * FINE + 2] - y
    fz = fine[2 * FINE + 4] - z
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    square = nx * nx + ny * ny + nz * nz
    beta = -(nx * (y * fz - z * fy) + ny * (z * fx - x * fz) + nz * (x * fy - y * fx))
    gamma = -(nx * (ey * z - ez * y) + ny * (ez * x - ex * z) + nz * (ex * y - ey * x))
    # (e × f)·(f × w): edges off by u·|w| move it by that times |w| and two edges; rounding by u times all four lengths.
    w = abs(x) + abs(y) + abs(z)
    longest = max(abs(ex) + abs(ey) + abs(ez), abs(fx) + abs(fy) + abs(fz))
    margin = _WEIGHT_ERROR * w * longest * longest * (w + longest)
    farther = max(beta, gamma) if parallelogram else beta + gamma
    return beta > margin and gamma > margin and farther < square - margin


@kernel
def polish_gap(pair, terms_at, doubles_at, ties_at, ids, n, parallelogram, size, slop, error):
    """The distance of two cores of points that are apart, from the vertex pairs of the n ≤ 3 points nearest the origin.

    parallelogram : the nearest point lies in that of three points, point 0 the corner between the others.
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
    inside = True
    if n == 1:
        for k in range(FINE):
            direction[k] = fine[k]
    elif n == 2:
        inside = _foot_is_inside_edge(fine)
        set_away_from_edge(fine, direction)
    else:
        inside = _foot_is_inside(fine, parallelogram)
        set_plane(fine, 0, 1, 2, direction)
    length, length_low = fine_length(direction)
    if not inside or length == 0.0:
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
