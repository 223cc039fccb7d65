"""The exact stage for a half-space against a swept hull: the sign of one polynomial a vertex.

The half-space at its pose is {x : n·x ≤ b·det R + n·p} with n = cof(R) m (`halfspace_convex.py`). A vertex q of B with
radius r reaches it iff s ≤ r|n|, s = n·(R_B q + p_WB) − b·det R − n·p: a sign where r = 0, else s ≤ 0 or s² ≤ r²|n|².
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, UNDONE
from collide.narrowphase.exact.exact_workspace import exact_pose
from collide.narrowphase.halfspace_convex import plane_in_world
from collide.narrowphase.posed_pair import radius_of
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.exact_numbers import (
    Number,
    NumberVec3,
    are_worthless,
    begin_numbers,
    compacted,
    cross,
    filled,
    inner,
    number_of,
    plus,
    scaled_dd,
    sign_of,
    times,
    vector_of,
)
from collide.numerics.vec3 import add, column_at, dot, rotate


class ExactHalfSpace(NamedTuple):
    """{x : n·x ≤ offset} in the world; p is its frame's origin."""

    n: NumberVec3
    offset: Number
    p: NumberVec3


class PlaneContact(NamedTuple):
    """TOUCHING, SEPARATE or UNDONE; the deepest vertex of B; its signed distance minus the radius [m], to
    EXACT_ERROR."""

    verdict: int
    vertex: int
    excess: DD


@kernel
def exact_half_space(pair, body, terms, digits):
    """The half-space {y : m·y ≤ b} at its pose: n = cof(R) m, offset = b·det R + n·p (`plane_in_world`).

    terms : of the `PoseTable`.   digits : workspace of `exact_numbers.py`.
    """
    r0, r1, r2, p = _rows_of_pose(pair, body, terms, digits)
    m, c0 = vector_of(digits, pair.numbers, body.params_at, 1), cross(digits, r1, r2)
    n = NumberVec3(
        inner(digits, c0, m), inner(digits, cross(digits, r2, r0), m), inner(digits, cross(digits, r0, r1), m)
    )
    height = times(digits, number_of(digits, pair.numbers[body.params_at + 3]), inner(digits, r0, c0))
    return ExactHalfSpace(n, plus(digits, height, inner(digits, n, p), 1), p)


@kernel
def _rows_of_pose(pair, body, terms, digits):
    """The rows of R, and p."""
    pose = exact_pose(pair.poses, body.pose_at, terms)
    return _row(digits, pose, 0), _row(digits, pose, 3), _row(digits, pose, 6), _row(digits, pose, 9)


@kernel
def _row(digits, pose, first):
    return NumberVec3(_entry(digits, pose, first), _entry(digits, pose, first + 1), _entry(digits, pose, first + 2))


@kernel
def _entry(digits, pose, j):
    """Entry j of an exact pose."""
    mark, at = filled(digits), pose.at + pose.stride * j
    total = number_of(digits, pose.numbers[at])
    for i in range(1, pose.stride):
        total = plus(digits, total, number_of(digits, pose.numbers[at + i]), 1)
    return compacted(digits, mark, total)


@kernel
def reach_plane_exactly(ordered, terms, digits, skew):
    """The `PlaneContact` of an `OrderedPair`, a half-space A and a swept hull B.

    terms, digits : as in `exact_gjk.touch_exactly`.   skew : of `reach_of_plane`.
    """
    pair = ordered.pair
    begin_numbers(digits)
    half_space, pose_B = exact_half_space(pair, pair.A, terms, digits), _rows_of_pose(pair, pair.B, terms, digits)
    square = inner(digits, half_space.n, half_space.n)
    world = plane_in_world(pair, pair.A)
    lowest = math.inf
    for k in range(pair.B.n):
        lowest = min(lowest, _height(pair, k, world))
    # Only vertices that may be the lowest are looked at exactly: usually one.
    threshold = lowest + 2.0 * ((ERROR * ordered.size + ordered.slop) * skew) * world.length
    deepest = PlaneContact(SEPARATE, 0, DD(math.inf, 0.0))
    mark = filled(digits)
    for k in range(pair.B.n):
        if _height(pair, k, world) <= threshold:
            contact = _reach_of_vertex(pair, half_space, square, pose_B, k, digits)
            if dd.less(contact.excess, deepest.excess):
                deepest = contact
            if are_worthless(digits):
                return PlaneContact(UNDONE, 0, DD(0.0, 0.0))
            compacted(digits, mark, Number(mark, 0, 0))
    return deepest


@kernel
def _height(pair, k, world):
    """s of vertex k of B in doubles, for the half-space in the world."""
    q = add(rotate(pair.poses, pair.B.pose_at, column_at(pair.B.coords, pair.B.padded, k)), pair.t)
    return dot(world.normal, q) - world.offset


@kernel
def _reach_of_vertex(pair, half_space, square, pose_B, k, digits):
    """The `PlaneContact` of vertex k of B: whether it lies within the radius of the half-space, exactly.

    square : |n|².
    """
    r0, r1, r2, p = pose_B
    q = vector_of(digits, pair.B.coords, k, pair.B.padded)
    x = plus(digits, inner(digits, r0, q), p.x, 1)
    y = plus(digits, inner(digits, r1, q), p.y, 1)
    z = plus(digits, inner(digits, r2, q), p.z, 1)
    s = plus(digits, inner(digits, half_space.n, NumberVec3(x, y, z)), half_space.offset, -1)
    sign = sign_of(digits, s)
    height = dd.unscaled(dd.scaled_div(scaled_dd(digits, s), dd.scaled_sqrt(scaled_dd(digits, square))))
    radius = radius_of(pair, pair.B)
    if radius == 0.0 or sign <= 0:
        if height.high == 0.0 and sign != 0:  # vanished, but not 0
            height = DD(5e-324 * sign, height.low)
        return PlaneContact(TOUCHING if sign <= 0 else SEPARATE, k, dd.sub(height, DD(radius, 0.0)))
    r = number_of(digits, radius)
    difference = plus(digits, times(digits, s, s), times(digits, times(digits, r, r), square), -1)
    sign = sign_of(digits, difference)
    # (s² − r²|n|²) / |n|² over s/|n| + r, which is s/|n| − r without cancellation.
    ratio = dd.scaled_div(scaled_dd(digits, difference), scaled_dd(digits, square))
    excess = dd.unscaled(dd.scaled_div(ratio, dd.normalized(dd.add(height, DD(radius, 0.0)))))
    if excess.high == 0.0 and sign != 0:
        excess = DD(5e-324 * sign, excess.low)
    return PlaneContact(TOUCHING if sign <= 0 else SEPARATE, k, excess)
