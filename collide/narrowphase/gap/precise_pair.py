"""A pair of cores of points in double-doubles: differences of posed vertices, planes across them, and heights along
these.

Doubles find the deciding feature; here its numbers get their last digits. Points are taken straight from the
shapes and the poses as given, so nothing that doubles rounded before has a say. Everything is scaled by a power
of two to pairs of size about 1.

Error of a point, in units of S (`bounds.py`): a coordinate is eight terms, each an exact sum of two doubles, whose
upper halves are added without error and whose lower ones are rounded: 16u of at most 9u·ΣT, ΣT ≤ S. Across three
coordinates less than 2⁻⁹⁸ S. The height of a point along a direction, as a double-double an exact vector, is good to
2⁻¹⁰⁰·√3 of the product of lengths besides: `HEIGHT_ERROR` covers both.

Points and directions are `DDVec3`s; ``fine`` is a workspace of points, dd.STRIDE doubles each.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64
from collide.kernels.lanes import any_of, root_of, select
from collide.lowering.shape_table import LOW_PARTS, POSE_SLOP, POSE_TERMS, TERM_ROW
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, DDVec3
from collide.numerics.error_free import two_product, two_sum
from collide.numerics.vec3 import column_at, dot, neg, norm1

#: Error of a height over the length of its direction, in units of S, and what composed poses add to it in units of
#: their slop.
HEIGHT_ERROR, SLOP_ERROR = 2.0**-97, 2.0**-49
#: Doubles of the low parts of two poses.
LOW_PARTS_OF_PAIR = 24
# Pairs beyond these sizes are left to integers: products of products would overflow or vanish.
_SMALLEST_SIZE, _LARGEST_SIZE = 2.0**-300, 2.0**300
#: Directions shorter than this, of a pair of size 1, say nothing.
_SHORTEST = 2.0**-200


@kernel(inline=True)
def larger(a, b):
    return select(b > a, b, a)


@kernel(inline=True)
def smaller(a, b):
    return select(b < a, b, a)


@kernel(inline=True)
def is_refinable(size):
    """Whether double-doubles can work on a pair of this size [m] without overflow or underflow."""
    return _SMALLEST_SIZE < size < _LARGEST_SIZE


@kernel(inline=True)
def unit_scale(size):
    """A power of two that brings the pair to a size between ½ and 1."""
    return math.ldexp(1.0, -math.frexp(size)[1])


# --- poses ----------------------------------------------------------------------------------------


@kernel(inline=True)
def is_composed(poses, p):
    """Whether a pose is a product of two, its row only near what is meant."""
    return poses[p + POSE_SLOP] != 0.0


@kernel(inline=True)
def put_low_parts(pair, terms_at, low_at):
    """Write the low parts of both poses, exact pose minus its row, to an address: LOW_PARTS_OF_PAIR doubles, A's first.

    terms_at : of the `PoseTable`.   Returns the number of doubles written: 0 where both poses are as given.
    """
    if not (is_composed(pair.poses, pair.A.pose_at) or is_composed(pair.poses, pair.B.pose_at)):
        return 0
    return _put_low_parts(pair, terms_at, low_at)


@kernel
def _put_low_parts(pair, terms_at, low_at):
    rows = int(max(pair.poses[pair.A.pose_at + POSE_TERMS], pair.poses[pair.B.pose_at + POSE_TERMS])) + 1
    low = view_f64(low_at, LOW_PARTS_OF_PAIR)
    terms = view_f64(terms_at, TERM_ROW * rows)
    for body in range(2):
        at_terms = (
            TERM_ROW * int(pair.poses[(pair.A.pose_at if body == 0 else pair.B.pose_at) + POSE_TERMS]) + LOW_PARTS
        )
        for k in range(12):
            low[12 * body + k] = terms[at_terms + k] if at_terms >= 0 else 0.0
    return LOW_PARTS_OF_PAIR


class PosedDifference(NamedTuple):
    """Two poses, for points of A ⊖ B.

    poses, A_at, B_at : where their rows begin.   low, low_A_at, low_B_at : where their low parts do, if composed.
    """

    poses: Any
    A_at: int
    B_at: int
    low: Any
    low_A_at: int
    low_B_at: int
    composed: bool


@kernel(inline=True)
def posed_difference(pair, low):
    """low : of `put_low_parts`, or no doubles where both poses are as given."""
    return PosedDifference(pair.poses, pair.A.pose_at, pair.B.pose_at, low, 0, 12, len(low) > 0)


# --- points ---------------------------------------------------------------------------------------


@kernel(inline=True)
def add_products(total, rest, matrix, row, v):
    """(total, rest) with a row of a rotation times a vector added: the total without error, the rest rounded."""
    x = two_product(matrix[row], v.x)
    total, error = two_sum(total, x.high)
    rest += x.low + error
    y = two_product(matrix[row + 1], v.y)
    total, error = two_sum(total, y.high)
    rest += y.low + error
    z = two_product(matrix[row + 2], v.z)
    total, error = two_sum(total, z.high)
    rest += z.low + error
    return DD(total, rest)


@kernel(inline=True)
def put_difference(out, k, X, a, b, scale):
    """R_A a + p_A − R_B b − p_B times a power of two, six numbers at ``k``; of doubles or of Lanes.

    X : the `PosedDifference`.   a, b : points in their bodies' frames.
    """
    for axis in range(3):
        r = X.A_at + 3 * axis
        s = X.B_at + 3 * axis
        total, rest = two_sum(X.poses[X.A_at + 9 + axis], -X.poses[X.B_at + 9 + axis])
        total, rest = add_products(total, rest, X.poses, r, a)
        total, rest = add_products(total, rest, X.poses, s, neg(b))
        if X.composed:
            r = X.low_A_at + 3 * axis
            s = X.low_B_at + 3 * axis
            rest += X.low[X.low_A_at + 9 + axis] - X.low[X.low_B_at + 9 + axis]
            rest += X.low[r] * a.x + X.low[r + 1] * a.y + X.low[r + 2] * a.z
            rest -= X.low[s] * b.x + X.low[s + 1] * b.y + X.low[s + 2] * b.z
        total, rest = two_sum(total, rest)
        out[k + 2 * axis] = total * scale
        out[k + 2 * axis + 1] = rest * scale


@kernel(inline=True)
def fine_point(pair, low, fine, k, i, j, scale):
    """Point k of ``fine`` becomes the difference of vertex i of A and vertex j of B, times ``scale``.

    low : of `put_low_parts`, or no doubles where both poses are as given.
    """
    a = column_at(pair.A.coords, pair.A.padded, i)
    b = column_at(pair.B.coords, pair.B.padded, j)
    put_difference(fine, dd.STRIDE * k, posed_difference(pair, low), a, b, scale)


@kernel(inline=True)
def fine_points(pair, low, fine, ids, n, scale):
    """Points 0 … n − 1 become the differences of these vertex pairs, times ``scale``."""
    for k in range(n):
        fine_point(pair, low, fine, k, ids[2 * k], ids[2 * k + 1], scale)


@kernel
def fine_edge(fine, k, j):
    """Point k minus point j."""
    return dd.sub_vec3(dd.vec3_at(fine, dd.STRIDE * k), dd.vec3_at(fine, dd.STRIDE * j))


@kernel
def fine_height(fine, k, direction):
    """Point k along a direction, both stored."""
    return dd.inner(dd.vec3_at(fine, dd.STRIDE * k), dd.vec3_at(direction, 0))


# --- directions -----------------------------------------------------------------------------------


@kernel(inline=True)
def direction_length(d):
    """|d|, or 0 where the direction says nothing."""
    length = dd.sqrt(dd.inner(d, d))
    return dd.dd_select(norm1(dd.leading(d)) > _SHORTEST, length, DD(0.0, 0.0))


@kernel
def fine_length(direction):
    """`direction_length` of a stored direction."""
    return direction_length(dd.vec3_at(direction, 0))


@kernel
def set_plane(fine, i, j, k, direction):
    """The normal of three points, as long as twice their area, into ``direction``."""
    dd.put_vec3(direction, 0, normal_of_edges(fine_edge(fine, j, i), fine_edge(fine, k, i)))


@kernel
def normal_of_edges(e, f):
    """e × f, of two edges e and f from a corner of a triangle.

    From the two shorter of its three edges: the product of long, nearly parallel edges would cancel.
    """
    g = dd.sub_vec3(f, e)
    ee = dot(dd.leading(e), dd.leading(e))
    ff = dot(dd.leading(f), dd.leading(f))
    gg = dot(dd.leading(g), dd.leading(g))
    without_e = (ee >= ff) & (ee >= gg)
    without_f = (ff > ee) & (ff >= gg)
    # e × f = f × g = g × −e, with g from e's end to f's.
    u = dd.select_vec3(without_e, f, dd.select_vec3(without_f, g, e))
    v = dd.select_vec3(without_e, g, dd.select_vec3(without_f, dd.neg_vec3(e), f))
    return dd.cross(u, v)


@kernel
def across_edge(w, e):
    """The part of a point w across an edge e from the point, lengthened by the edge's square.

    Computed twice where the part is short: the first time leaves an error of rounding at |w|, the second of rounding at
    the result. Where the edge is not much nearer than its length, once is enough.
    """
    square = dd.inner(e, e)
    across = _reject(w, e, square)
    once = norm1(dd.leading(across))
    again = once <= 2.0**-20 * square.high * (norm1(dd.leading(w)) + root_of(square.high))
    if any_of(again):
        across = dd.select_vec3(again, _reject(across, e, square), across)
    return across


@kernel
def _reject(w, e, square):
    """w |e|² − e (w·e)."""
    along = dd.inner(w, e)
    return DDVec3(
        dd.sub(dd.mul(w.x, square), dd.mul(e.x, along)),
        dd.sub(dd.mul(w.y, square), dd.mul(e.y, along)),
        dd.sub(dd.mul(w.z, square), dd.mul(e.z, along)),
    )
