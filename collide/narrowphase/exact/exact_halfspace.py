"""The exact stage for a half-space against a swept hull: the sign of one polynomial a vertex.

The half-space at its pose is {x : n·(x − p_WA) ≤ b·det R} with n = cof(R) m (`halfspace_convex.py`).
A vertex q of B with radius r reaches it iff s ≤ r|n|, s = n·(R_B q + p_WB − p_WA) − b·det R: a sign
where r = 0, else s ≤ 0 or s² ≤ r²|n|². Everything is an integer of `numerics/digits.py`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.lowering.shape_table import INTS, LOWEST
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.exact.exact_gjk import SEPARATE, TOUCHING, UNDONE
from collide.narrowphase.exact.exact_workspace import (
    ExactPose,
    Span,
    add_entry,
    core_span,
    exact_pose,
    span_of,
    span_of_entries,
)
from collide.narrowphase.halfspace_convex import plane_in_world
from collide.narrowphase.posed_pair import PosedPair, radius_of, reach_of
from collide.numerics import double_double as dd
from collide.numerics.digits import (
    BITS,
    add_double,
    add_number,
    add_product,
    as_double_double,
    carry,
    copy,
    grid_of,
    lowest_bit,
    set_zero,
)
from collide.numerics.double_double import DD, ScaledDD
from collide.numerics.vec3 import add, column_at, dot, rotate

#: Most digits of any number that is multiplied once more; a slot holds twice as many.
_LONGEST = 64
_SLOT = 2 * _LONGEST
# Slots of the workspace: R_A, the normal m in A's frame, the normal n in W's axes, det R_A, a cofactor, −b·det R_A, b;
# R_B; of a vertex: s, a coordinate or r, a vertex's coordinate or r², s² − r²|n|² and r²|n|², two slots each, |n|².
_ROTATION_A, _NORMAL_A, _NORMAL, _DETERMINANT, _COFACTOR, _CONSTANT, _OFFSET = 0, 9, 12, 15, 16, 17, 18
_ROTATION_B, _HEIGHT, _FIRST, _SECOND, _DIFFERENCE, _SUBTRAHEND, _NORMAL_SQUARE = 20, 30, 31, 32, 33, 35, 37
#: Integers of workspace.
INTEGERS = 40 * _SLOT


class ExactPlane(NamedTuple):
    """A half-space A and a hull B in integers.

    digits : view of the workspace.   pair : in doubles.   pose_A, pose_B : exact.   radius : of B [m].
    rotation_A, normal, offset, rotation_B, core : `Span`s of R_A, m, b, R_B and B's vertices.
    coordinate : that of R_B q + p_WB − p_WA.   n_plane : digits of n.   height : the span of s.
    """

    digits: Any
    pair: PosedPair
    pose_A: ExactPose
    pose_B: ExactPose
    radius: float
    rotation_A: Span
    normal: Span
    offset: Span
    rotation_B: Span
    core: Span
    coordinate: Span
    n_plane: int
    height: Span


class PlaneContact(NamedTuple):
    """TOUCHING, SEPARATE or UNDONE; the deepest vertex of B; its signed distance minus the radius [m], to
    EXACT_ERROR."""

    verdict: int
    vertex: int
    excess: DD


@kernel(inline=True)
def _slot(k):
    return k * _SLOT


@kernel
def _exact_plane(ordered, terms, digits):
    pair = ordered.pair
    A, B, numbers = pair.A, pair.B, pair.numbers
    pose_a = exact_pose(pair.poses, A.pose_at, terms)
    pose_b = exact_pose(pair.poses, B.pose_at, terms)
    rotation_a = span_of_entries(pose_a, 0, 9)
    normal = span_of(numbers, A.params_at, 3, 0)
    offset = span_of(numbers, A.params_at + 3, 1, 0)
    rotation_b = span_of_entries(pose_b, 0, 9)
    shift_a = span_of_entries(pose_a, 9, 3)
    shift_b = span_of_entries(pose_b, 9, 3)
    core = core_span(ordered.ints[INTS * B.shape + LOWEST], reach_of(pair, B))
    grid = min(shift_a.grid, shift_b.grid)
    if core.n > 0:
        grid = min(grid, rotation_b.grid + core.grid)
    d = grid_of(math.frexp(ordered.size)[1]) - grid + 1
    d = max(d, shift_a.grid + shift_a.n - grid + 1, shift_b.grid + shift_b.n - grid + 1)
    if core.n > 0:
        d = max(d, rotation_b.n + core.n - 1 + rotation_b.grid + core.grid - grid)
    # Two terms of different degree meet in s: their digits are brought to the lower grid of both.
    n_plane = 2 * rotation_a.n + normal.n + 1
    low_product = 2 * rotation_a.grid + normal.grid + grid
    low_constant = 3 * rotation_a.grid + offset.grid
    low = min(low_product, low_constant)
    n_height = max(n_plane + d + low_product - low, 3 * rotation_a.n + 2 + offset.n + low_constant - low) + 1
    return ExactPlane(
        digits, pair, pose_a, pose_b, radius_of(pair, B), rotation_a, normal, offset, rotation_b, core, Span(grid, d),
        n_plane,
        Span(low, n_height),
    )


@kernel
def _load_plane(plane):
    """n = cof(R) m, det R and −b·det R, with what they are made of."""
    digits, n_rot, n_m = plane.digits, plane.rotation_A.n, plane.normal.n
    numbers, at = plane.pair.numbers, plane.pair.A.params_at
    set_zero(digits, 0, _slot(_OFFSET + 1))
    _load_rotation(digits, plane.pose_A, plane.rotation_A, _ROTATION_A)
    for k in range(3):
        add_double(digits, _slot(_NORMAL_A + k), numbers[at + k], plane.normal.grid)
    cofactor = _slot(_COFACTOR)
    for i in range(3):
        for j in range(3):
            set_zero(digits, cofactor, 2 * n_rot + 1)
            r1 = _ROTATION_A + 3 * ((i + 1) % 3)
            r2 = _ROTATION_A + 3 * ((i + 2) % 3)
            c1 = (j + 1) % 3
            c2 = (j + 2) % 3
            add_product(digits, cofactor, _slot(r1 + c1), n_rot, _slot(r2 + c2), n_rot, 1)
            add_product(digits, cofactor, _slot(r1 + c2), n_rot, _slot(r2 + c1), n_rot, -1)
            carry(digits, cofactor, 2 * n_rot + 1)
            add_product(digits, _slot(_NORMAL + i), cofactor, 2 * n_rot + 1, _slot(_NORMAL_A + j), n_m, 1)
            if i == 0:
                add_product(digits, _slot(_DETERMINANT), cofactor, 2 * n_rot + 1, _slot(_ROTATION_A + j), n_rot, 1)
        carry(digits, _slot(_NORMAL + i), plane.n_plane)
    carry(digits, _slot(_DETERMINANT), 3 * n_rot + 2)
    add_double(digits, _slot(_OFFSET), numbers[at + 3], plane.offset.grid)
    constant = _slot(_CONSTANT)
    shift = 3 * plane.rotation_A.grid + plane.offset.grid - plane.height.grid
    add_product(digits, constant + shift, _slot(_DETERMINANT), 3 * n_rot + 2, _slot(_OFFSET), plane.offset.n, -1)
    carry(digits, constant, plane.height.n)


@kernel
def _load_rotation(digits, pose, span, slot):
    set_zero(digits, _slot(slot), 9 * _SLOT)
    for k in range(9):
        add_entry(digits, _slot(slot + k), pose, k, span.grid, 1.0)
        carry(digits, _slot(slot + k), span.n)


@kernel
def reach_plane_exactly(ordered, terms, digits, skew):
    """The `PlaneContact` of an `OrderedPair`, a half-space A and a swept hull B.

    terms, digits : as in `exact_gjk.touch_exactly`.   skew : of `reach_of_plane`.
    """
    pair = ordered.pair
    plane = _exact_plane(ordered, terms, digits)
    if plane.height.n > _LONGEST or plane.coordinate.n > _LONGEST // 2:
        return PlaneContact(UNDONE, 0, DD(0.0, 0.0))
    _load_plane(plane)
    _load_rotation(digits, plane.pose_B, plane.rotation_B, _ROTATION_B)
    world = plane_in_world(pair, pair.A)
    lowest = math.inf
    for k in range(pair.B.n):
        lowest = min(lowest, _height(pair, k, world))
    # Only vertices that may be the lowest are looked at exactly: usually one.
    threshold = lowest + 2.0 * ((ERROR * ordered.size + ordered.slop) * skew) * world.length
    deepest = PlaneContact(SEPARATE, 0, DD(math.inf, 0.0))
    for k in range(pair.B.n):
        if _height(pair, k, world) > threshold:
            continue
        contact = _reach_of_vertex(plane, k)
        if contact.verdict == UNDONE:
            return contact
        if dd.less(contact.excess, deepest.excess):
            deepest = contact
    return deepest


@kernel
def _height(pair, k, world):
    """s of vertex k of B in doubles, for the half-space in the world."""
    q = add(rotate(pair.poses, pair.B.pose_at, column_at(pair.B.coords, pair.B.padded, k)), pair.t)
    return dot(world.normal, q) - world.offset


@kernel
def _reach_of_vertex(plane, k):
    """The `PlaneContact` of vertex k of B: whether it lies within the radius of the half-space, exactly."""
    digits, n_height = plane.digits, plane.height.n
    sign = _set_height(plane, k)
    square = _set_normal_square(plane)
    length = dd.scaled_sqrt(square)
    s = as_double_double(digits, _slot(_HEIGHT), n_height)
    height = dd.unscaled(dd.scaled_div(ScaledDD(s.value, s.exponent + BITS * plane.height.grid), length))
    radius = DD(plane.radius, 0.0)
    if plane.radius == 0.0 or sign <= 0:
        if height.high == 0.0 and sign != 0:  # vanished, but not 0
            height = DD(5e-324 * sign, height.low)
        return PlaneContact(TOUCHING if sign <= 0 else SEPARATE, k, dd.sub(height, radius))
    grid = _set_square_difference(plane)
    if grid.n > 2 * _SLOT:
        return PlaneContact(UNDONE, k, DD(0.0, 0.0))
    sign = carry(digits, _slot(_DIFFERENCE), grid.n)
    # (s² − r²|n|²) / |n|² over s/|n| + r, which is s/|n| − r without cancellation.
    difference = as_double_double(digits, _slot(_DIFFERENCE), grid.n)
    ratio = dd.scaled_div(ScaledDD(difference.value, difference.exponent + BITS * grid.grid), square)
    excess = dd.unscaled(dd.scaled_div(ratio, dd.normalized(dd.add(height, radius))))
    if excess.high == 0.0 and sign != 0:
        excess = DD(5e-324 * sign, excess.low)
    return PlaneContact(TOUCHING if sign <= 0 else SEPARATE, k, excess)


@kernel
def _set_height(plane, k):
    """s of vertex k; returns its sign."""
    digits, coords, padded = plane.digits, plane.pair.B.coords, plane.pair.B.padded
    grid, d = plane.coordinate
    total = _slot(_HEIGHT)
    copy(digits, total, _slot(_CONSTANT), plane.height.n)
    for axis in range(3):
        y = _slot(_FIRST)
        set_zero(digits, y, d)
        if plane.core.n > 0:
            product = y + plane.rotation_B.grid + plane.core.grid - grid
            for j in range(3):
                vertex = _slot(_SECOND)
                set_zero(digits, vertex, plane.core.n)
                add_double(digits, vertex, coords[j * padded + k], plane.core.grid)
                rotation = _slot(_ROTATION_B + 3 * axis + j)
                add_product(digits, product, rotation, plane.rotation_B.n, vertex, plane.core.n, 1)
        add_entry(digits, y, plane.pose_B, 9 + axis, grid, 1.0)
        add_entry(digits, y, plane.pose_A, 9 + axis, grid, -1.0)
        carry(digits, y, d)
        shift = 2 * plane.rotation_A.grid + plane.normal.grid + grid - plane.height.grid
        add_product(digits, total + shift, _slot(_NORMAL + axis), plane.n_plane, y, d, 1)
    return carry(digits, total, plane.height.n)


@kernel
def _set_normal_square(plane):
    """|n|², also as a `ScaledDD`."""
    digits, n = plane.digits, plane.n_plane
    out = _slot(_NORMAL_SQUARE)
    set_zero(digits, out, 2 * n + 1)
    for axis in range(3):
        add_product(digits, out, _slot(_NORMAL + axis), n, _slot(_NORMAL + axis), n, 1)
    carry(digits, out, 2 * n + 1)
    square = as_double_double(digits, out, 2 * n + 1)
    return ScaledDD(square.value, square.exponent + 2 * BITS * (2 * plane.rotation_A.grid + plane.normal.grid))


@kernel
def _set_square_difference(plane):
    """s² − r²|n|², before it is carried; its `Span`, of which more than two slots are too many: then nothing is
    written."""
    digits, n_height, n_square = plane.digits, plane.height.n, 2 * plane.n_plane + 1
    low_bit, high_bit = lowest_bit(plane.radius), math.frexp(plane.radius)[1] - 1
    radius = Span(grid_of(low_bit), grid_of(high_bit) - grid_of(low_bit) + 1)
    low_s = 2 * plane.height.grid
    low_r = 2 * (2 * plane.rotation_A.grid + plane.normal.grid) + 2 * radius.grid
    low = min(low_s, low_r)
    n_subtrahend = n_square + 2 * radius.n + 1 + low_r - low
    n = max(2 * n_height + low_s - low + 1, n_subtrahend) + 1
    if n > 2 * _SLOT:
        return Span(low, n)
    difference = _slot(_DIFFERENCE)
    subtrahend = _slot(_SUBTRAHEND)
    r = _slot(_FIRST)
    rr = _slot(_SECOND)
    set_zero(digits, difference, 2 * _SLOT)
    set_zero(digits, subtrahend, 2 * _SLOT)
    set_zero(digits, r, radius.n)
    set_zero(digits, rr, 2 * radius.n + 1)
    add_double(digits, r, plane.radius, radius.grid)
    add_product(digits, rr, r, radius.n, r, radius.n, 1)
    carry(digits, rr, 2 * radius.n + 1)
    add_product(digits, difference + low_s - low, _slot(_HEIGHT), n_height, _slot(_HEIGHT), n_height, 1)
    add_product(digits, subtrahend + low_r - low, _slot(_NORMAL_SQUARE), n_square, rr, 2 * radius.n + 1, 1)
    carry(digits, subtrahend, n)
    add_number(digits, difference, subtrahend, n, -1)
    return Span(low, n)
