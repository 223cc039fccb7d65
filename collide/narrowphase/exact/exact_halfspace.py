"""The exact stage for a half-space against a convex set: the sign of one polynomial a vertex, or of a curved set.

The half-space at its pose is {x : n·x ≤ b·det R + n·p} with n = cof(R) m (`halfspace_convex.py`). A vertex q of B with
radius r reaches it iff s ≤ r|n|, s = n·(R_B q + p_WB) − b·det R − n·p: a sign where r = 0, else s ≤ 0 or s² ≤ r²|n|².
Supports of curved sets are of the same form, s ≤ √q.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import CYLINDER, ELLIPSOID, POINTS
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
    """TOUCHING, SEPARATE or UNDONE; the deepest vertex of B, −1 of a curved set; its signed distance minus the radius
    [m], to EXACT_ERROR."""

    verdict: int
    vertex: int
    excess: DD


@kernel
def exact_half_space(pair, body, terms, digits):
    """The half-space {y : m·y ≤ b} of a body at its pose.

    terms : of the `PoseTable`.   digits : workspace of `exact_numbers.py`.
    """
    m = vector_of(digits, pair.numbers, body.params_at, 1)
    b = number_of(digits, pair.numbers[body.params_at + 3])
    return posed_half_space(rows_of_pose(pair, body, terms, digits), m, b, digits)


@kernel
def posed_half_space(pose, m, b, digits):
    """{y : m·y ≤ b} at a pose (`rows_of_pose`): n = cof(R) m, offset = b·det R + n·p (`plane_in_world`)."""
    r0, r1, r2, p = pose
    c0 = cross(digits, r1, r2)
    n = NumberVec3(
        inner(digits, c0, m), inner(digits, cross(digits, r2, r0), m), inner(digits, cross(digits, r0, r1), m)
    )
    return ExactHalfSpace(n, plus(digits, times(digits, b, inner(digits, r0, c0)), inner(digits, n, p), 1), p)


@kernel
def rows_of_pose(pair, body, terms, digits):
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
    """The `PlaneContact` of an `OrderedPair`, a half-space A and another convex set B.

    terms, digits : as in `exact_gjk.touch_exactly`.   skew : of `reach_of_plane`.
    """
    pair = ordered.pair
    begin_numbers(digits)
    half_space, pose_B = exact_half_space(pair, pair.A, terms, digits), rows_of_pose(pair, pair.B, terms, digits)
    square = inner(digits, half_space.n, half_space.n)
    if pair.B.kind != POINTS:
        contact = reach_of_curved(pair, pair.B, half_space, square, pose_B, digits)
        return PlaneContact(UNDONE, -1, DD(0.0, 0.0)) if are_worthless(digits) else contact
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
            contact = reach_of_vertex(pair, pair.B, half_space, square, pose_B, k, digits)
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
def reach_of_vertex(pair, B, half_space, square, pose_B, k, digits):
    """The `PlaneContact` of vertex k of a body B: whether it lies within the radius of the half-space, exactly.

    square : |n|².   pose_B : of `rows_of_pose`.
    """
    r0, r1, r2, p = pose_B
    q = vector_of(digits, B.coords, k, B.padded)
    x = plus(digits, inner(digits, r0, q), p.x, 1)
    y = plus(digits, inner(digits, r1, q), p.y, 1)
    z = plus(digits, inner(digits, r2, q), p.z, 1)
    s = plus(digits, inner(digits, half_space.n, NumberVec3(x, y, z)), half_space.offset, -1)
    radius = radius_of(pair, B)
    r = number_of(digits, radius)
    return _contact(digits, s, times(digits, times(digits, r, r), square), square, DD(radius, 0.0), k)


@kernel
def reach_of_curved(pair, B, half_space, square, pose_B, digits):
    """The `PlaneContact` of a cylinder, cone or ellipsoid B, by its point farthest against n: w = R_Bᵀ n.

    A cylinder of half length h and radius r reaches h|w_z| + r √(w_x² + w_y²) beyond its centre, a cone the larger one
    of −h w_z and h w_z + r √(w_x² + w_y²), an ellipsoid √(Σ (a_i w_i)²).
    """
    s = plus(digits, inner(digits, half_space.n, pose_B[3]), half_space.offset, -1)
    w = turned_back(pose_B, half_space.n, digits)
    sizes = vector_of(digits, pair.numbers, B.params_at, 1)
    if B.kind == ELLIPSOID:
        w = NumberVec3(times(digits, sizes.x, w.x), times(digits, sizes.y, w.y), times(digits, sizes.z, w.z))
        return _curved_contact(digits, s, inner(digits, w, w), square)
    across = plus(digits, times(digits, w.x, w.x), times(digits, w.y, w.y), 1)
    rim = times(digits, times(digits, sizes.x, sizes.x), across)
    along = times(digits, sizes.y, w.z)
    is_up = sign_of(digits, along) > 0
    if B.kind == CYLINDER:
        return _curved_contact(digits, plus(digits, s, along, -1 if is_up else 1), rim, square)
    base = _curved_contact(digits, plus(digits, s, along, -1), rim, square)
    tip = _curved_contact(digits, plus(digits, s, along, 1), number_of(digits, 0.0), square)
    return base if dd.less(base.excess, tip.excess) else tip


@kernel
def turned_back(pose, n, digits):
    """Rᵀ n; pose : of `rows_of_pose`."""
    r0, r1, r2, _ = pose
    return NumberVec3(
        inner(digits, NumberVec3(r0.x, r1.x, r2.x), n), inner(digits, NumberVec3(r0.y, r1.y, r2.y), n),
        inner(digits, NumberVec3(r0.z, r1.z, r2.z), n)
    )


@kernel
def side_of_tip(pair, B, w, digits):
    """1 where the tip of a cone B is deeper against w (in the frame) than its rim, −1 where the rim is, 0 where both
    are as deep: the sign of −2 h w_z − r √(w_x² + w_y²)."""
    sizes = vector_of(digits, pair.numbers, B.params_at, 1)
    along = times(digits, number_of(digits, -2.0), times(digits, sizes.y, w.z))
    if sign_of(digits, along) < 0:
        return -1
    across = plus(digits, times(digits, w.x, w.x), times(digits, w.y, w.y), 1)
    rim = times(digits, times(digits, sizes.x, sizes.x), across)
    return sign_of(digits, plus(digits, times(digits, along, along), rim, -1))


@kernel
def _curved_contact(digits, s, q, square):
    reach = dd.unscaled(dd.scaled_div(dd.scaled_sqrt(scaled_dd(digits, q)), dd.scaled_sqrt(scaled_dd(digits, square))))
    return _contact(digits, s, q, square, reach, -1)


@kernel
def _contact(digits, s, q, square, reach, vertex):
    """The `PlaneContact` of a point at the height s/|n|, with a ball of √q/|n| = reach around the point."""
    sign = sign_of(digits, s)
    height = dd.unscaled(dd.scaled_div(scaled_dd(digits, s), dd.scaled_sqrt(scaled_dd(digits, square))))
    if sign <= 0 or sign_of(digits, q) == 0:
        if height.high == 0.0 and sign != 0:  # vanished, but not 0
            height = DD(5e-324 * sign, height.low)
        return PlaneContact(TOUCHING if sign <= 0 else SEPARATE, vertex, dd.sub(height, reach))
    difference = plus(digits, times(digits, s, s), q, -1)
    sign = sign_of(digits, difference)
    # (s² − q) / |n|² over (s + √q) / |n|, which is (s − √q) / |n| without cancellation.
    ratio = dd.scaled_div(scaled_dd(digits, difference), scaled_dd(digits, square))
    excess = dd.unscaled(dd.scaled_div(ratio, dd.normalized(dd.add(height, reach))))
    if excess.high == 0.0 and sign != 0:
        excess = DD(5e-324 * sign, excess.low)
    return PlaneContact(TOUCHING if sign <= 0 else SEPARATE, vertex, excess)
