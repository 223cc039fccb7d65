"""Two posed trees in relation: B's frame seen from A's, A's from B's, and how wrong that can be.

A world vertex is R v + t, all doubles exact reals. Whether surfaces meet does not change under an invertible
affine map, so everything happens in A's frame: y = C (R_B w + t_B − t_A) with C ≈ R_A⁻¹. Write u = 2⁻⁵³,
C R_A = I + F. Then what R_A⁻¹ would have given differs from what C gives by |F|/(1 − |F|) of its size, and rounding
adds at most 12u of the terms summed (t_B − t_A: 1, C R_B: 3, times w: 3, sums: 3). No rotation is assumed.

Boxes are compared in floats, v = 2⁻²⁴: eight roundings on either side of the comparison, 32 v = 2⁻¹⁹ of the terms hold
them twice over.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import kernel
from collide.mesh.bvh import CENTRE, EXPONENT, RADIUS, REACH
from collide.numerics.error_free import two_sum
from collide.numerics.vec3 import Vec3, add, cross, dot, put_vec3, rotate, vec3_at

# A placing, doubles: M (9) and m (3) take points of B's frame to A's, M w + m; N (9) and n (3) take A's to B's.
M, SHIFT, N = 0, 9, 12
#: Bound of the error of a coordinate of M w + m; of N v + n.
ERROR, N_ERROR = 24, 25
#: 1 where M w + m is exact, so far as its sums are.
PLAIN = 26
#: Unit of A's boxes over that of B's.
UNITS = 27
#: For probes of A's boxes [0] and of B's [1]: the matrix from the other tree's boxes to their own (9), shift (3), the
#: bound of what rounding adds to a half length (3), and that without the rounding to floats (3).
FRAMES, FRAME_SIZE = 28, 18
# Inverses of both matrices (9 each), each followed by a bound of the largest row sum of |C R − I|.
INVERSE_A, INVERSE_B = 64, 74
PLACING = 84

_U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: What sums of doubles round of a probe, of the terms; a tree's origins and facets are as good.
_DOUBLE_ERROR = 2.0**-47
#: Boxes of a tree stay within this, in its units.
EXTENT = 1.001
#: Trees that reach less far are points: of others the unit is their size.
_POINT = 2.0**-20
#: Added to half lengths: products of floats may vanish.
_TINY = 2.0**-110
#: Trees whose units differ by more powers of two than this are compared in the larger one's only.
MAX_UNIT_EXPONENT = 90
#: Largest deviation from a rotation at which balls stand for bodies; lengths whose squares might underflow.
_MAX_DEVIATION, _MIN_LENGTH = 2.0**-10, 1e-140
#: A matrix whose computed inverse is worse than this is refused.
_MAX_RESIDUAL = 2.0**-10


class Extent(NamedTuple):
    """Where a tree's boxes are: its numbers (centre, reach; `mesh/bvh.py`), the exponent of its unit, and how far boxes
    reach from the centre, at most, in that unit."""

    numbers: np.ndarray
    exponent: int
    reach: float


@kernel(inline=True)
def extent_of(tree):
    """The `Extent` of a tree.

    A point has no size to be its unit, which may be far larger than the other tree: its boxes stay in the ball.
    """
    exponent = tree.header[EXPONENT]
    of_ball = EXTENT * tree.numbers[RADIUS] * math.ldexp(1.0, int(-exponent))
    return Extent(tree.numbers, exponent, of_ball if of_ball < _POINT else EXTENT)


@kernel
def place(A, XA, B, XB, placing, frame_a, frame_b):
    """Relate two bodies, given as `Extent` and pose (16 doubles); False where a matrix is not clearly invertible.

    placing : PLACING doubles out.   frame_a, frame_b : 9 floats out each, the matrices of the probes of A and of B.
    """
    if not (_inverse(XA, placing, INVERSE_A) <= _MAX_RESIDUAL and _inverse(XB, placing, INVERSE_B) <= _MAX_RESIDUAL):
        return False
    same_rotation = True
    for i in range(3):
        for j in range(3):
            same_rotation = same_rotation and XA[4 * i + j] == XB[4 * i + j]
    placing[ERROR] = _compose(XA, XB, B.numbers, placing, INVERSE_A, M, same_rotation)
    placing[N_ERROR] = _compose(XB, XA, A.numbers, placing, INVERSE_B, N, same_rotation)
    placing[PLAIN] = 1.0 if _is_exact(XA, XB, same_rotation) else 0.0
    placing[UNITS] = math.ldexp(1.0, int(A.exponent - B.exponent))
    _set_frame(A, B, placing, M, placing[ERROR], FRAMES, frame_a)
    _set_frame(B, A, placing, N, placing[N_ERROR], FRAMES + FRAME_SIZE, frame_b)
    return True


@kernel
def balls_apart(XA, numbers_a, XB, numbers_b, margin):
    """Whether the balls around two bodies are certainly farther apart than a margin [m].

    False of matrices that are not close to rotations. With d the largest row sum of |RᵀR − I|, lengths grow by a factor
    of at most 1 + d.
    """
    stretch_a = deviation_from_rotation(XA)
    stretch_b = deviation_from_rotation(XB)
    if not (stretch_a <= _MAX_DEVIATION and stretch_b <= _MAX_DEVIATION):
        return False
    square = 0.0
    size = 0.0
    for i in range(3):
        gap = XB[4 * i + 3] - XA[4 * i + 3]
        size += abs(XB[4 * i + 3]) + abs(XA[4 * i + 3])
        for j in range(3):
            gap += XB[4 * i + j] * numbers_b[CENTRE + j] - XA[4 * i + j] * numbers_a[CENTRE + j]
        size += 2.0 * (abs(numbers_a[CENTRE + i]) + abs(numbers_b[CENTRE + i]))
        square += gap * gap
    reach = numbers_a[RADIUS] * (1.0 + stretch_a) + numbers_b[RADIUS] * (1.0 + stretch_b)
    reach += margin
    reach += 2.0**-40 * (reach + size)
    return square > reach * reach and reach > _MIN_LENGTH


@kernel(inline=True)
def deviation_from_rotation(X):
    """Largest row sum of |RᵀR − I|, rounded upwards; infinite where R mirrors."""
    x = Vec3(X[0], X[4], X[8])
    y = Vec3(X[1], X[5], X[9])
    z = Vec3(X[2], X[6], X[10])
    if not dot(vec3_at(X, 0), cross(vec3_at(X, 4), vec3_at(X, 8))) > 0.0:
        return math.inf
    xx = abs(dot(x, x) - 1.0)
    yy = abs(dot(y, y) - 1.0)
    zz = abs(dot(z, z) - 1.0)
    xy = abs(dot(x, y))
    xz = abs(dot(x, z))
    yz = abs(dot(y, z))
    return max(xx + xy + xz, yy + xy + yz, zz + xz + yz) + 2.0**-48


@kernel
def is_swapped_order(XA, XB):
    """Whether the pose XB comes before XA in the order of poses, in which two equal trees are taken."""
    for k in range(12):
        if XA[k] != XB[k]:
            return XA[k] > XB[k]
    return False


@kernel
def _inverse(X, out, at):
    """Write the inverse C of a pose's matrix R (9) and the bound of the largest row sum of |C R − I|; returns the
    bound, infinite unless det R > 0."""
    for i in range(3):
        for j in range(3):
            a = 4 * ((j + 1) % 3)
            b = 4 * ((j + 2) % 3)
            k = (i + 1) % 3
            m = (i + 2) % 3
            out[at + 3 * i + j] = X[a + k] * X[b + m] - X[a + m] * X[b + k]
    det = X[0] * out[at] + X[1] * out[at + 3] + X[2] * out[at + 6]
    if not det > 0.0:  # signs of doubles are A's, exact ones the world's: a mirror would mix them
        return math.inf
    worst = 0.0
    for k in range(9):
        out[at + k] /= det
    for i in range(3):
        total = 0.0
        for j in range(3):
            value = 0.0
            size = 0.0
            for k in range(3):
                term = out[at + 3 * i + k] * X[4 * k + j]
                value += term
                size += abs(term)
            total += abs(value - (1.0 if i == j else 0.0)) + 6.0 * _U * size
        worst = max(worst, total)
    out[at + 9] = worst
    return worst


@kernel
def _compose(XA, XB, numbers_b, out, inverse, matrix, same_rotation):
    """Matrix and shift from B's frame to A's; returns the bound of the error of what they give."""
    residual = out[inverse + 9]
    error = 0.0
    for i in range(3):
        rotated = 0.0
        shifted = 0.0
        for j in range(3):
            value = 0.0
            size = 0.0
            for k in range(3):
                term = out[inverse + 3 * i + k] * XB[4 * k + j]
                value += term
                size += abs(term)
            if same_rotation:
                value = 1.0 if i == j else 0.0
                size = value
            out[matrix + 3 * i + j] = value
            rotated += size * numbers_b[REACH + j]
        total = 0.0
        for k in range(3):
            term = out[inverse + 3 * i + k] * (XB[4 * k + 3] - XA[4 * k + 3])
            total += term
            shifted += abs(term)
        out[matrix + 9 + i] = total
        size = shifted if same_rotation else rotated + shifted
        error = max(error, 12.0 * _U * (rotated + shifted) + 2.0 * residual * size)
    return error


@kernel
def _is_exact(XA, XB, same_rotation):
    """Whether matrix and shift are exact, and a vertex is rotated without rounding."""
    if same_rotation and XA[3] == XB[3] and XA[7] == XB[7] and XA[11] == XB[11]:
        return True
    for i in range(3):
        ones_a = 0
        ones_b = 0
        for j in range(3):
            a = abs(XA[4 * i + j])
            b = abs(XB[4 * i + j])
            if not (a == 0.0 or a == 1.0) or not (b == 0.0 or b == 1.0):
                return False
            ones_a += a == 1.0
            ones_b += b == 1.0
        if ones_a != 1 or ones_b != 1 or not sum_is_exact(XB[4 * i + 3], -XA[4 * i + 3]):
            return False
    return True


@kernel(inline=True)
def sum_is_exact(x, y):
    """Whether x + y is a double."""
    return two_sum(x, y)[1] == 0.0


@kernel
def _set_frame(probe, node, placing, matrix, error, at, frame):
    """From the boxes of the nodes' tree to those of the probe's: FRAME_SIZE doubles at ``at``, and the matrix as
    floats."""
    if node.exponent - probe.exponent > MAX_UNIT_EXPONENT:  # floats might overflow: nothing is culled in this frame
        for k in range(9):
            placing[at + k] = 0.0
            frame[k] = np.float32(0.0)
        for i in range(3):
            placing[at + 9 + i] = 0.0
            placing[at + 12 + i] = 1e30
            placing[at + 15 + i] = 1e30
        return
    units = math.ldexp(1.0, int(node.exponent - probe.exponent))
    scale = math.ldexp(1.0, int(-probe.exponent))
    for i in range(3):
        shift = placing[matrix + 9 + i]
        centre = probe.numbers[CENTRE + i]
        moved = shift - centre
        size = abs(shift) + abs(centre)
        spread = 0.0
        for j in range(3):
            entry = placing[matrix + 3 * i + j]
            moved += entry * node.numbers[CENTRE + j]
            size += abs(entry * node.numbers[CENTRE + j])
            spread += abs(entry * units) * node.reach
            placing[at + 3 * i + j] = entry * units
            frame[3 * i + j] = np.float32(entry * units)
        moved *= scale
        placing[at + 9 + i] = moved
        terms = abs(moved) + spread + probe.reach
        of_pose = 2.0 * scale * (error + 8.0 * _U * size)
        placing[at + 12 + i] = _FLOAT_ERROR * terms + _TINY + of_pose
        placing[at + 15 + i] = _DOUBLE_ERROR * terms + _TINY + of_pose


@kernel(inline=True)
def put_in_frame_of_a(placing, points, at, out, to):
    """Three points of B's frame, as A's frame has them."""
    for k in range(0, 9, 3):
        put_vec3(out, to + k, add(rotate(placing, M, vec3_at(points, at + k)), vec3_at(placing, SHIFT)))


@kernel(inline=True)
def shift_between(XA, XB):
    """t_B − t_A of two poses."""
    return Vec3(XB[3] - XA[3], XB[7] - XA[7], XB[11] - XA[11])


@kernel(inline=True)
def rotate_by_pose(X, a):
    """R a, for a pose whose rows of R and t are four doubles each."""
    return Vec3(dot(vec3_at(X, 0), a), dot(vec3_at(X, 4), a), dot(vec3_at(X, 8), a))


@kernel(inline=True)
def put_in_world(X, shift, points, at, out, to):
    """Three points, rotated by a pose X into the world's axes, and shifted."""
    for k in range(0, 9, 3):
        put_vec3(out, to + k, add(rotate_by_pose(X, vec3_at(points, at + k)), shift))
