"""A half-space against anything convex, in closed form: one support query, and the last digits of a height."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.bounds import ERROR, PROMISE_GAP
from collide.narrowphase.gap.curved_features import ERROR as CURVED_ERROR
from collide.narrowphase.gap.curved_features import curved_reach, turned_back
from collide.narrowphase.gap.precise_pair import HEIGHT_ERROR, add_products, is_composed, is_refinable, unit_scale
from collide.narrowphase.gap.tied_vertices import MAX_TIES, tied_vertices, vertices_of
from collide.narrowphase.posed_pair import radius_of
from collide.narrowphase.rows import CERTIFIED, HOW, write_vectors, write_verdict, write_vertices
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, DDVec3
from collide.numerics.error_free import two_product, two_sum
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    cross,
    divide,
    dot,
    neg,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)
from collide.results import FORMULA, UNDECIDED
from collide.support.support_mapping import settled_vertex, support

#: Between which lengths of a normal double-doubles neither overflow nor vanish.
_SMALLEST, _LARGEST = 2.0**-300, 2.0**300


class Plane(NamedTuple):
    """A half-space {x : normal·(x − p_WA) ≤ offset} in the world's axes.   length : |normal|."""

    normal: Vec3
    offset: float
    length: float


@kernel
def plane_in_world(pair, body):
    """The `Plane` of a posed half-space.

    The image of {y : m·y ≤ b} under y ↦ R y + p is {x : m·R⁻¹(x − p) ≤ b}. R⁻¹ is the adjugate over
    the determinant, for the matrix as it stands, not its transpose: n = cof(R) m, offset = b·det R.
    """
    p = body.pose_at
    r0, r1, r2 = vec3_at(pair.poses, p), vec3_at(pair.poses, p + 3), vec3_at(pair.poses, p + 6)
    cofactors = cross(r1, r2)
    m = vec3_at(pair.numbers, body.params_at)
    n = Vec3(dot(cofactors, m), dot(cross(r2, r0), m), dot(cross(r0, r1), m))
    return Plane(n, pair.numbers[body.params_at + 3] * dot(r0, cofactors), math.sqrt(dot(n, n)))


@kernel
def reach_of_plane(pair, body):
    """(distance of the plane from the frame's origin, skew): the half-space's share of S, and the factor of its errors.

    n = cof(R) m is rounded at |row|²|m|, the offset at |row|³|b|; skew is |row|²|m| / |n|, at least 1, and large only
    for a matrix far from a rotation.
    """
    plane = plane_in_world(pair, body)
    row = 0.0
    for k in range(3):
        r = vec3_at(pair.poses, body.pose_at + 3 * k)
        row = max(row, dot(r, r))
    m = vec3_at(pair.numbers, body.params_at)
    skew = max(row * math.sqrt(dot(m, m)) / plane.length, 1.0)
    offset = pair.numbers[body.params_at + 3]
    return max(abs(plane.offset), abs(offset) * row * math.sqrt(row)) / plane.length, skew


class PlaneGap(NamedTuple):
    """Gap between a convex set and a plane, but for its last digits.

    nhat : out of the half-space.   gap, error : of the set with its radius, and a bound of its error [m].
    vertex : the deepest of the core, −1 of a curved core.   b : the deepest point, seen from the frame's origin.
    size, skew : inputs of the error.
    """

    nhat: Vec3
    gap: float
    error: float
    vertex: int
    b: Vec3
    size: float
    skew: float


@kernel
def plane_gap(ordered):
    """The `PlaneGap` of a half-space A and a convex set B."""
    pair = ordered.pair
    A, B, poses = pair.A, pair.B, pair.poses
    distance, skew = reach_of_plane(pair, A)
    size = ordered.size + distance
    error = ERROR * size * skew + ordered.slop
    plane = plane_in_world(pair, A)
    nhat = divide(plane.normal, plane.length)
    g = neg(rotate_back(poses, B.pose_at, nhat))
    k, corner, _ = support(B.kind, B.coords, B.padded, pair.numbers, B.params_at, B.tree, 0, -1, g)
    if B.tree != 0:
        k = settled_vertex(B.coords, B.padded, B.tree, k, g)
        corner = column_at(B.coords, B.padded, k)
    b = rotate(poses, B.pose_at, corner)
    gap = dot(add(b, pair.t), nhat) - plane.offset / plane.length - radius_of(pair, B)
    return PlaneGap(nhat, gap, error, k, b, size, skew)


@kernel(inline=True)
def write_plane_points(ordered, nearest, gap, row):
    """Normal and witness points of the row."""
    pair = ordered.pair
    p_WB = vec3_at(pair.poses, pair.B.pose_at + 9)
    p_WBb = add(nearest.b, sub(p_WB, scale(radius_of(pair, pair.B), nearest.nhat)))
    write_vectors(row, nearest.nhat, sub(p_WBb, scale(gap, nearest.nhat)), p_WBb, ordered.flip)


@kernel
def halfspace_convex(ordered, query, row, work):
    """Write the row of a half-space A and a convex set B: the point of B's core deepest behind the plane, moved by the
    radius."""
    pair = ordered.pair
    coarse = plane_gap(ordered)
    gap, error = coarse.gap, coarse.error
    lower = gap - error
    upper = gap + error
    decided = lower > 0.0 or upper <= 0.0
    exact_numbers = ordered.exact_numbers and pair.B.kind == POINTS
    if ordered.exact_numbers and lower <= query.limit and not query.boolean:
        if exact_numbers:
            refined = refine_height(pair, work.fine_at, work.ties_at, coarse.vertex, coarse.size, error, coarse.skew)
        else:
            refined = refine_curved_height(pair, work.fine_at, coarse.size, coarse.skew)
        if refined.proven:
            bracket = dd.bracket(dd.sub(refined.height, DD(radius_of(pair, pair.B), 0.0)), refined.error)
            # Of a curved core that nearly touches, integers know the sign and more digits.
            if exact_numbers or decided or bracket.upper - bracket.lower <= PROMISE_GAP * abs(bracket.nearest):
                gap = bracket.nearest
                lower = max(lower, bracket.lower)
                upper = min(upper, bracket.upper)
    width = 0.0 if exact_numbers and not query.boolean else math.inf
    write_verdict(row, gap, lower, upper, FORMULA, width, query.limit)
    if exact_numbers and (not decided or (row.flags[CERTIFIED] == 0 and not query.boolean)):
        row.flags[HOW] = UNDECIDED  # the exact stage settles the sign, or the last digits
    write_plane_points(ordered, coarse, gap, row)
    work.ids[0] = -1
    work.ids[1] = coarse.vertex
    write_vertices(row, work.ids, 1, ordered.flip)


@kernel(inline=True)
def _cofactor(poses, p, i, j):
    """Entry (i, j) of cof(R), a double-double."""
    r = p + 3 * ((i + 1) % 3)
    s = p + 3 * ((i + 2) % 3)
    c = (j + 1) % 3
    d = (j + 2) % 3
    return dd.sub(two_product(poses[r + c], poses[s + d]), two_product(poses[r + d], poses[s + c]))


@kernel
def _put_fine_plane(pair, plane):
    """`plane_in_world` of A in double-doubles: n and the offset, eight doubles."""
    numbers, at, poses, p = pair.numbers, pair.A.params_at, pair.poses, pair.A.pose_at
    for i in range(4):
        total = DD(0.0, 0.0)
        for j in range(3):
            # The offset's determinant is expanded along the first row.
            factor = numbers[at + j] if i < 3 else poses[p + j]
            total = dd.add(total, dd.mul(_cofactor(poses, p, i % 3, j), DD(factor, 0.0)))
        if i == 3:
            total = dd.mul(total, DD(numbers[at + 3], 0.0))
        plane[2 * i] = total.high
        plane[2 * i + 1] = total.low


@kernel(inline=True)
def _fine_coordinate(b, poses, p, q, axis):
    """A coordinate of R_B b + p_WB − p_WA, as good as those of `precise_pair.put_difference`."""
    total, rest = two_sum(poses[q + 9 + axis], -poses[p + 9 + axis])
    total, rest = add_products(total, rest, poses, q + 3 * axis, b)
    return two_sum(total, rest)


class RefinedHeight(NamedTuple):
    """Signed distance of a core from a half-space [m], within ``error``, if proven."""

    proven: bool
    height: DD
    error: float


@kernel
def refine_curved_height(pair, doubles_at, size, skew):
    """`refine_height` of a cylinder, cone or ellipsoid, by its reach along the normal."""
    B, poses = pair.B, pair.poses
    p, q = pair.A.pose_at, B.pose_at
    plane = view_f64(doubles_at, 8)
    _put_fine_plane(pair, plane)
    normal = dd.vec3_at(plane, 0)
    length = dd.sqrt(dd.inner(normal, normal))
    is_in_range = is_refinable(size) and _SMALLEST < length.high < _LARGEST
    if is_composed(poses, p) or is_composed(poses, q) or not is_in_range:
        return RefinedHeight(False, DD(0.0, 0.0), 0.0)
    reach = curved_reach(pair, B, turned_back(poses, q, dd.neg_vec3(normal)), 1.0)
    height = dd.sub(dd.inner(dd.difference(vec3_at(poses, q + 9), vec3_at(poses, p + 9)), normal), reach)
    distance = dd.div(dd.sub(height, DD(plane[6], plane[7])), length)
    return RefinedHeight(True, distance, 8.0 * skew * CURVED_ERROR / unit_scale(size))


@kernel
def refine_height(pair, doubles_at, ties_at, vertex, size, error, skew):
    """The signed distance of B's core from a half-space A, to its last digit.

    vertex : the deepest, as doubles say.   size, error, skew : as `reach_of_plane` makes them.
    doubles_at, ties_at : workspace of eight doubles, MAX_TIES + 1 integers.
    Composed poses are left to the exact stage.
    """
    B, poses = pair.B, pair.poses
    p, q = pair.A.pose_at, B.pose_at
    if is_composed(poses, p) or is_composed(poses, q) or not is_refinable(size):
        return RefinedHeight(False, DD(0.0, 0.0), 0.0)
    plane = view_f64(doubles_at, 8)
    ties = view_i64(ties_at, MAX_TIES + 1)
    _put_fine_plane(pair, plane)
    normal = dd.vec3_at(plane, 0)
    length = dd.sqrt(dd.inner(normal, normal))
    if not (_SMALLEST < length.high < _LARGEST):
        return RefinedHeight(False, DD(0.0, 0.0), 0.0)
    g = rotate_back(poses, q, divide(dd.leading(normal), length.high))
    ties[0] = vertex
    n_tied, limit = tied_vertices(vertices_of(B), ties, g, error)
    too_many = n_tied > MAX_TIES
    least = DD(math.inf, 0.0)
    for k in range(B.n if too_many else n_tied):
        b = column_at(B.coords, B.padded, k if too_many else ties[k])
        if too_many and dot(b, g) > limit:
            continue
        point = DDVec3(
            _fine_coordinate(b, poses, p, q, 0), _fine_coordinate(b, poses, p, q, 1),
            _fine_coordinate(b, poses, p, q, 2)
        )
        height = dd.inner(point, normal)
        if dd.less(height, least):
            least = height
    distance = dd.div(dd.sub(least, DD(plane[6], plane[7])), length)
    # The normal, too, is rounded here, to 2⁻¹⁰⁰·3 of |row|²|m|, and the offset to as much of |row|³ times it.
    return RefinedHeight(True, distance, 8.0 * skew * HEIGHT_ERROR / unit_scale(size))
