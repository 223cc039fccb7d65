"""Depths below rounding: planes of A ⊖ B that doubles cannot tell apart, exactly."""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.narrowphase.exact.exact_directions import scaled_by, set_normal, side_of
from collide.narrowphase.exact.exact_supports import support_pair
from collide.narrowphase.exact.exact_workspace import (
    LONGEST,
    direction_at,
    exact_pose,
    load_poses,
    point_at,
    scale_of,
    scratch_at,
    set_point,
)
from collide.numerics.digits import BITS, add_number, add_product, as_double_double, carry, clear
from collide.numerics.double_double import divide, square_root

#: Distances nearer to each other than this part are the same as far as is worked out.
_SAME = 2.0**-70


@kernel
def nearest_plane(pair, terms, digits, requests, at, lowest_a, lowest_b, reach_a, reach_b, size, error):
    """(proven, depth, low part) of cores that share a point, to EXACT_ERROR however small it is.

    requests, at : where an entry of `depth_requests.py` begins, or 0.   Other arguments as in `touch_exactly`.

    A plane through the origin that no vertex lies beyond settles it: nothing is less than 0. Otherwise the entry names
    all facets of a closed surface within A ⊖ B that may be nearest; the least of their exact distances is a
    lower bound of the depth, and an upper one if no vertex lies beyond that facet's plane.
    """
    if pair.A.n * pair.B.n <= 3:
        return True, 0.0, 0.0  # so few points span no volume
    if at == 0:
        return False, 0.0, 0.0
    pose_a = exact_pose(pair.poses, pair.A.pose_at, terms)
    pose_b = exact_pose(pair.poses, pair.B.pose_at, terms)
    scale = scale_of(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, 0.0, 0.0, size)
    if scale[0] > LONGEST:
        return False, 0.0, 0.0
    load_poses(digits, scale, pose_a, pose_b)
    complete = requests[at] == 1
    count = requests[at + 1]
    least = math.inf
    least_low = 0.0
    for k in range(count):
        side, distance, low = _distance_of(digits, scale, pair, requests, at + 2 + 6 * k)
        if side == 0 and distance == 0.0 and _is_last(digits, scale, pair, error, True):
            return True, 0.0, 0.0
        complete = complete and side > 0
        if distance < least or (distance == least and low < least_low):
            least = distance
            least_low = low
    if not complete:
        return False, 0.0, 0.0
    for k in range(count):
        _, distance, low = _distance_of(digits, scale, pair, requests, at + 2 + 6 * k)
        if (distance - least) + (low - least_low) <= _SAME * least and _is_last(digits, scale, pair, error, False):
            return True, least, least_low
    return False, 0.0, 0.0


@kernel
def _distance_of(digits, scale, pair, requests, at):
    """(side, distance, low part) of the plane of three points: on which side of it the origin lies, 1 behind it.

    The points are counter-clockwise from outside. Points in line are as far as can be, and behind.
    """
    d = scale[0]
    for k in range(3):
        set_point(digits, scale, pair, k, requests[at + 2 * k], requests[at + 2 * k + 1])
    n, side = set_normal(digits, d)
    square = scratch_at(d, 0)
    clear(digits, square, 2 * n)
    for axis in range(3):
        add_product(digits, square, direction_at(d, axis), n, direction_at(d, axis), n, 1)
    if carry(digits, square, 2 * n) == 0:
        return 1, math.inf, 0.0
    value, value_low, exponent = as_double_double(digits, square, 2 * n)
    odd = exponent & 1
    length, length_low = square_root(scaled_by(value, odd), scaled_by(value_low, odd))
    half = (exponent - odd) // 2
    side_of(digits, d, n, 0)
    value, value_low, exponent = as_double_double(digits, scratch_at(d, 0), n + d)
    distance, low = divide(value, value_low, length, length_low)
    shift = exponent - half + BITS * scale[1]
    return side, scaled_by(distance, shift), scaled_by(low, shift)


@kernel
def _is_last(digits, scale, pair, error, either):
    """Whether no vertex of A ⊖ B lies beyond the plane of points 0 … 2, whose normal is the direction.

    either : beyond it on one of its sides is enough, as for a plane through the origin.
    """
    d = scale[0]
    n = 2 * d
    for _ in range(2 if either else 1):
        for axis in range(3):
            at = direction_at(d, axis)
            for k in range(n):
                digits[at + k] = -digits[at + k]
            carry(digits, at, n)
        i, j, _, _, _ = support_pair(digits, scale, pair, n, error)
        set_point(digits, scale, pair, 3, i, j)
        for axis in range(3):
            add_number(digits, point_at(d, 3, axis), point_at(d, 0, axis), d, -1)
            carry(digits, point_at(d, 3, axis), d)
        if side_of(digits, d, n, 3) == 0:
            return True
    return False
