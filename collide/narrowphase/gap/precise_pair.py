"""A pair of cores of points in double-doubles: posed differences and planes across them.

Doubles find the deciding feature; here its numbers get their last digits. Points are taken straight from the
shapes and the poses as given, so nothing that doubles rounded before has a say. Everything is scaled by a power
of two to pairs of size about 1.

Error of a point, in units of S (`bounds.py`): a coordinate is eight terms, each an exact sum of two doubles, whose
upper halves are added without error and whose lower ones are rounded: 16u of at most 9u·ΣT, ΣT ≤ S. Across three
coordinates less than 2⁻⁹⁸ S. The height of a point along a direction, as a double-double an exact vector, is good to
2⁻¹⁰⁰·√3 of the product of lengths besides: `HEIGHT_ERROR` covers both.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64
from collide.kernels.lanes import any_of, root_of, select
from collide.lowering.shape_table import LOW_PARTS, POSE_SLOP, POSE_TERMS, TERM_ROW
from collide.numerics.double_double import cross, multiply, product_of_vectors, square_root, subtract
from collide.numerics.error_free import two_product, two_sum

#: Doubles stored a point: three double-doubles.
FINE = 6
#: Error of a height over the length of its direction, in units of S, and what composed poses add to it in units of
#: their slop.
HEIGHT_ERROR, SLOP_ERROR = 2.0**-97, 2.0**-49
#: Pairs beyond these sizes are left to integers: products of products would overflow or vanish.
SMALLEST_FINE, LARGEST_FINE = 2.0**-300, 2.0**300
#: Directions shorter than this, of a pair of size 1, say nothing.
_SHORTEST = 2.0**-200



@kernel(inline=True)
def larger(a, b):
    return select(b > a, b, a)


@kernel(inline=True)
def smaller(a, b):
    return select(b < a, b, a)


@kernel(inline=True)
def scale_of(size):
    """A power of two that brings the pair to a size between ½ and 1."""
    return math.ldexp(1.0, -math.frexp(size)[1])


@kernel
def low_parts(poses, p, terms, low, at):
    """What the twelve entries of a pose are more than the row says, into low[at:]; for a pose as given, zeros."""
    at_terms = TERM_ROW * int(poses[p + POSE_TERMS]) + LOW_PARTS
    for k in range(12):
        low[at + k] = terms[at_terms + k] if at_terms >= 0 else 0.0


@kernel(inline=True)
def is_composed(poses, p):
    """Whether a pose is a product, its row only near what is meant."""
    return poses[p + POSE_SLOP] != 0.0


@kernel(inline=True)
def add_turned(total, rest, rx, ry, rz, x, y, z):
    """(total, rest) with a row of a rotation times a vector added: the total without error, the rest rounded."""
    term, e = two_product(rx, x)
    total, f = two_sum(total, term)
    rest += e + f
    term, e = two_product(ry, y)
    total, f = two_sum(total, term)
    rest += e + f
    term, e = two_product(rz, z)
    total, f = two_sum(total, term)
    rest += e + f
    return total, rest


@kernel(inline=True)
def fine_points(pair, low, fine, ids, n, scale):
    """Points 0 … n − 1 become the differences of these vertex pairs, times ``scale``."""
    for k in range(n):
        fine_point(pair, low, fine, k, ids[2 * k], ids[2 * k + 1], scale)


@kernel(inline=True)
def fine_point(pair, low, fine, k, i, j, scale):
    """Point k becomes the difference of vertex i of A and vertex j of B, times ``scale``.

    low : `write_low_parts` of both poses, or no doubles where both are as given.
    """
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    ax = A.coords[i]
    ay = A.coords[A.padded + i]
    az = A.coords[2 * A.padded + i]
    bx = B.coords[j]
    by = B.coords[B.padded + j]
    bz = B.coords[2 * B.padded + j]
    for axis in range(3):
        r = p + 3 * axis
        s = q + 3 * axis
        total, rest = two_sum(poses[p + 9 + axis], -poses[q + 9 + axis])
        total, rest = add_turned(total, rest, poses[r], poses[r + 1], poses[r + 2], ax, ay, az)
        total, rest = add_turned(total, rest, poses[s], poses[s + 1], poses[s + 2], -bx, -by, -bz)
        if len(low) > 0:
            at = 3 * axis
            rest += low[9 + axis] - low[21 + axis]
            rest += low[at] * ax + low[at + 1] * ay + low[at + 2] * az
            rest -= low[12 + at] * bx + low[13 + at] * by + low[14 + at] * bz
        total, rest = two_sum(total, rest)
        fine[FINE * k + 2 * axis] = total * scale
        fine[FINE * k + 2 * axis + 1] = rest * scale


@kernel
def fine_edge(fine, k, j):
    """Point k minus point j, as three double-doubles."""
    at = FINE * k
    to = FINE * j
    x, x_low = subtract(fine[at], fine[at + 1], fine[to], fine[to + 1])
    y, y_low = subtract(fine[at + 2], fine[at + 3], fine[to + 2], fine[to + 3])
    z, z_low = subtract(fine[at + 4], fine[at + 5], fine[to + 4], fine[to + 5])
    return x, x_low, y, y_low, z, z_low


@kernel
def fine_height(fine, k, direction):
    """Point k along a direction of six doubles."""
    at = FINE * k
    return product_of_vectors(
        fine[at], fine[at + 1], fine[at + 2], fine[at + 3], fine[at + 4], fine[at + 5],
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
    )  # fmt: skip


@kernel
def set_plane(fine, i, j, k, direction):
    """The normal of three points, as long as twice their area, into ``direction``."""
    ex, ex_low, ey, ey_low, ez, ez_low = fine_edge(fine, j, i)
    fx, fx_low, fy, fy_low, fz, fz_low = fine_edge(fine, k, i)
    x, x_low, y, y_low, z, z_low = normal_of_edges(ex, ex_low, ey, ey_low, ez, ez_low, fx, fx_low, fy, fy_low, fz, fz_low)
    direction[0] = x
    direction[1] = x_low
    direction[2] = y
    direction[3] = y_low
    direction[4] = z
    direction[5] = z_low


@kernel
def normal_of_edges(ex, ex_low, ey, ey_low, ez, ez_low, fx, fx_low, fy, fy_low, fz, fz_low):
    """e × f, of two edges e and f from a corner of a triangle, as three double-doubles.

    From the two shorter of its three edges: long ones that are nearly parallel would leave little of it.
    """
    gx, gx_low = subtract(fx, fx_low, ex, ex_low)
    gy, gy_low = subtract(fy, fy_low, ey, ey_low)
    gz, gz_low = subtract(fz, fz_low, ez, ez_low)
    ee = ex * ex + ey * ey + ez * ez
    ff = fx * fx + fy * fy + fz * fz
    gg = gx * gx + gy * gy + gz * gz
    without_e = (ee >= ff) & (ee >= gg)
    without_f = (ff > ee) & (ff >= gg)
    # e × f = f × g = g × −e, with g from e's end to f's.
    ux = select(without_e, fx, select(without_f, gx, ex))
    ux_low = select(without_e, fx_low, select(without_f, gx_low, ex_low))
    uy = select(without_e, fy, select(without_f, gy, ey))
    uy_low = select(without_e, fy_low, select(without_f, gy_low, ey_low))
    uz = select(without_e, fz, select(without_f, gz, ez))
    uz_low = select(without_e, fz_low, select(without_f, gz_low, ez_low))
    vx = select(without_e, gx, select(without_f, -ex, fx))
    vx_low = select(without_e, gx_low, select(without_f, -ex_low, fx_low))
    vy = select(without_e, gy, select(without_f, -ey, fy))
    vy_low = select(without_e, gy_low, select(without_f, -ey_low, fy_low))
    vz = select(without_e, gz, select(without_f, -ez, fz))
    vz_low = select(without_e, gz_low, select(without_f, -ez_low, fz_low))
    return cross(ux, ux_low, uy, uy_low, uz, uz_low, vx, vx_low, vy, vy_low, vz, vz_low)


@kernel
def across_edge(x, x_low, y, y_low, z, z_low, ex, ex_low, ey, ey_low, ez, ez_low):
    """The part of a point across an edge from it, three double-doubles, lengthened by the edge's square.

    Taken twice where that is short: the first time leaves what rounding at |w| makes, the second what rounding at the
    result makes. Where the edge is not much nearer than its length, once is enough.
    """
    square, square_low = product_of_vectors(ex, ex_low, ey, ey_low, ez, ez_low, ex, ex_low, ey, ey_low, ez, ez_low)
    full = abs(x) + abs(y) + abs(z)
    x, x_low, y, y_low, z, z_low = _less_along(
        x, x_low, y, y_low, z, z_low, ex, ex_low, ey, ey_low, ez, ez_low, square, square_low
    )
    left = abs(x) + abs(y) + abs(z)
    again = left <= 2.0**-20 * square * (full + root_of(square))
    if any_of(again):
        u, u_low, v, v_low, w, w_low = _less_along(
            x, x_low, y, y_low, z, z_low, ex, ex_low, ey, ey_low, ez, ez_low, square, square_low
        )
        x = select(again, u, x)
        x_low = select(again, u_low, x_low)
        y = select(again, v, y)
        y_low = select(again, v_low, y_low)
        z = select(again, w, z)
        z_low = select(again, w_low, z_low)
    return x, x_low, y, y_low, z, z_low


@kernel
def _less_along(x, x_low, y, y_low, z, z_low, ex, ex_low, ey, ey_low, ez, ez_low, square, square_low):
    """w |e|² − e (w·e)."""
    along, along_low = product_of_vectors(x, x_low, y, y_low, z, z_low, ex, ex_low, ey, ey_low, ez, ez_low)
    p, p_low = multiply(x, x_low, square, square_low)
    q, q_low = multiply(ex, ex_low, along, along_low)
    x, x_low = subtract(p, p_low, q, q_low)
    p, p_low = multiply(y, y_low, square, square_low)
    q, q_low = multiply(ey, ey_low, along, along_low)
    y, y_low = subtract(p, p_low, q, q_low)
    p, p_low = multiply(z, z_low, square, square_low)
    q, q_low = multiply(ez, ez_low, along, along_low)
    z, z_low = subtract(p, p_low, q, q_low)
    return x, x_low, y, y_low, z, z_low


@kernel
def fine_length(direction):
    """(|d|, low), or zeros where the direction says nothing."""
    square, square_low = product_of_vectors(
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
    )  # fmt: skip
    length, length_low = square_root(square, square_low)
    some = abs(direction[0]) + abs(direction[2]) + abs(direction[4]) > _SHORTEST
    return select(some, length, 0.0), select(some, length_low, 0.0)


@kernel
def _write_low_parts(pair, terms_at, low_at):
    poses = pair.poses
    rows = int(max(poses[pair.A.pose_at + POSE_TERMS], poses[pair.B.pose_at + POSE_TERMS])) + 1
    low = view_f64(low_at, 24)
    terms = view_f64(terms_at, TERM_ROW * rows)
    low_parts(poses, pair.A.pose_at, terms, low, 0)
    low_parts(poses, pair.B.pose_at, terms, low, 12)
    return 24


@kernel(inline=True)
def write_low_parts(pair, terms_at, low_at):
    """Put the low parts of both poses at an address; returns their number, none where both poses are as given."""
    if not (is_composed(pair.poses, pair.A.pose_at) or is_composed(pair.poses, pair.B.pose_at)):
        return 0
    return _write_low_parts(pair, terms_at, low_at)
