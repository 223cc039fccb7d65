"""Two posed trees in relation: B's frame seen from A's, A's from B's, and how wrong that can be.

A world vertex is R v + t, all doubles exact reals. Whether surfaces meet does not change under an invertible
affine map, so everything happens in A's frame: y = C (R_B w + t_B − t_A) with C ≈ R_A⁻¹. Write u = 2⁻⁵³,
C R_A = I + F. Then what R_A⁻¹ would have given differs from what C gives by |F|/(1 − |F|) of its size, and rounding
adds at most 12u of the terms summed (t_B − t_A: 1, C R_B: 3, times w: 3, sums: 3). No rotation is assumed.

Boxes are compared in floats, v = 2⁻²⁴: eight roundings on either side of the comparison, 32 v = 2⁻¹⁹ of the terms hold them twice over.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import kernel
from collide.mesh.bvh import CENTRE, EXPONENT, RADIUS, REACH

# A placing, doubles: M (9) and m (3) take B's frame to A's; N (9) and n (3) take A's to B's.
M, SHIFT, N, N_SHIFT = 0, 9, 12, 21
#: Largest error of a coordinate of M w + m; of N v + n.
ERROR, N_ERROR = 24, 25
#: 1 where M w + m is exact, so far as its sums are.
PLAIN = 26
#: A's unit of boxes over B's.
UNITS = 27
#: For the boxes of A [0] and of B [1] as probes: matrix from the other tree's boxes to the own ones (9), shift (3),
#: what rounding can add to a half length (3).
FRAMES, FRAME_SIZE = 28, 15
# Inverses of both matrices (9 each), each with a bound of |C R − I| behind it.
INVERSE_A, INVERSE_B = 58, 68
PLACING = 78

_U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: Boxes of a tree stay within this, in its units.
_EXTENT = 1.001
#: Added to half lengths: products of floats may vanish.
_TINY = 2.0**-110
#: Trees whose units differ by more powers of two than this are compared in the larger one's only.
MOST_UNLIKE = 90
#: How far from a rotation a matrix may be for balls to stand for bodies, and lengths whose squares might vanish.
_LITTLE, _VANISHING = 2.0**-10, 1e-140
#: A matrix whose computed inverse is worse than this is refused.
_WORST_INVERSE = 2.0**-10


@kernel
def place(header_a, numbers_a, XA, header_b, numbers_b, XB, out, frames):
    """The placing of B (pose XB, 16 doubles) from A; False where a matrix is not clearly invertible.

    frames : 18 floats out, the matrices of both kinds of probe.
    """
    worst_a = _inverse(XA, out, INVERSE_A)
    worst_b = _inverse(XB, out, INVERSE_B)
    if not (worst_a <= _WORST_INVERSE and worst_b <= _WORST_INVERSE):
        return False
    same = True
    for i in range(3):
        for j in range(3):
            same = same and XA[4 * i + j] == XB[4 * i + j]
    out[ERROR] = _compose(XA, XB, numbers_b, out, INVERSE_A, M, SHIFT, worst_a, same)
    out[N_ERROR] = _compose(XB, XA, numbers_a, out, INVERSE_B, N, N_SHIFT, worst_b, same)
    out[PLAIN] = 1.0 if _plain(XA, XB, same) else 0.0
    ea = header_a[EXPONENT]
    eb = header_b[EXPONENT]
    out[UNITS] = math.ldexp(1.0, int(ea - eb))
    _frame(out, frames, 0, M, SHIFT, out[ERROR], numbers_a, numbers_b, ea, eb)
    _frame(out, frames, 1, N, N_SHIFT, out[N_ERROR], numbers_b, numbers_a, eb, ea)
    return True


@kernel
def balls_apart(XA, numbers_a, XB, numbers_b, margin):
    """Whether balls around two bodies are certainly farther apart than a margin [m]; False unless matrices are close to rotations.

    For a rotation but for d, the largest row sum of |RᵀR − I|, lengths grow by no more than 1 + d.
    """
    stretch_a = off_rotation(XA)
    stretch_b = off_rotation(XB)
    if not (stretch_a <= _LITTLE and stretch_b <= _LITTLE):
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
    return square > reach * reach and reach > _VANISHING


@kernel(inline=True)
def off_rotation(X):
    """Largest row sum of |RᵀR − I|, rounded upwards; infinite where R mirrors."""
    xx = X[0] * X[0] + X[4] * X[4] + X[8] * X[8]
    yy = X[1] * X[1] + X[5] * X[5] + X[9] * X[9]
    zz = X[2] * X[2] + X[6] * X[6] + X[10] * X[10]
    xy = abs(X[0] * X[1] + X[4] * X[5] + X[8] * X[9])
    xz = abs(X[0] * X[2] + X[4] * X[6] + X[8] * X[10])
    yz = abs(X[1] * X[2] + X[5] * X[6] + X[9] * X[10])
    det = (
        X[0] * (X[5] * X[10] - X[6] * X[9]) - X[1] * (X[4] * X[10] - X[6] * X[8]) + X[2] * (X[4] * X[9] - X[5] * X[8])
    )
    if not det > 0.0:
        return math.inf
    return max(abs(xx - 1.0) + xy + xz, abs(yy - 1.0) + xy + yz, abs(zz - 1.0) + xz + yz) + 2.0**-48


@kernel
def later(XA, XB):
    """Whether, of two bodies alike, the one at XB is to be taken first: by the numbers of the poses."""
    for k in range(12):
        if XA[k] != XB[k]:
            return XA[k] > XB[k]
    return False


@kernel
def _inverse(X, out, at):
    """Inverse of the matrix of a pose; returns a bound of the largest row sum of |C R − I|."""
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
def _compose(XA, XB, reach_of_b, out, inverse, matrix, shift, worst, same):
    """Matrix and shift from B's frame to A's; returns the bound of the error of what they give."""
    error = 0.0
    for i in range(3):
        turned = 0.0
        moved = 0.0
        for j in range(3):
            value = 0.0
            size = 0.0
            for k in range(3):
                term = out[inverse + 3 * i + k] * XB[4 * k + j]
                value += term
                size += abs(term)
            if same:
                value = 1.0 if i == j else 0.0
                size = value
            out[matrix + 3 * i + j] = value
            turned += size * reach_of_b[REACH + j]
        total = 0.0
        for k in range(3):
            term = out[inverse + 3 * i + k] * (XB[4 * k + 3] - XA[4 * k + 3])
            total += term
            moved += abs(term)
        out[shift + i] = total
        error = max(error, 12.0 * _U * (turned + moved) + 2.0 * worst * (moved if same else turned + moved))
    return error


@kernel
def _plain(XA, XB, same):
    """Whether matrix and shift are exact, and a vertex is turned without rounding."""
    if same and XA[3] == XB[3] and XA[7] == XB[7] and XA[11] == XB[11]:
        return True
    for i in range(3):
        in_row_a = 0
        in_row_b = 0
        for j in range(3):
            a = abs(XA[4 * i + j])
            b = abs(XB[4 * i + j])
            if not (a == 0.0 or a == 1.0) or not (b == 0.0 or b == 1.0):
                return False
            in_row_a += a == 1.0
            in_row_b += b == 1.0
        if in_row_a != 1 or in_row_b != 1:
            return False
        # Knuth's sum: the difference of the shifts is a double where nothing is left over.
        s = XB[4 * i + 3]
        t = -XA[4 * i + 3]
        total = s + t
        other = total - s
        if (s - (total - other)) + (t - other) != 0.0:
            return False
    return True


@kernel
def _frame(out, frames, which, matrix, shift, error, own, other, own_exponent, other_exponent):
    """From the other tree's boxes to the own ones, in units of either."""
    at = FRAMES + FRAME_SIZE * which
    if other_exponent - own_exponent > MOST_UNLIKE:  # floats might overflow: nothing is parted in this frame
        for k in range(9):
            out[at + k] = 0.0
            frames[9 * which + k] = np.float32(0.0)
        for i in range(3):
            out[at + 9 + i] = 0.0
            out[at + 12 + i] = 1e30
        return
    units = math.ldexp(1.0, int(other_exponent - own_exponent))
    scale = math.ldexp(1.0, int(-own_exponent))
    for i in range(3):
        moved = out[shift + i] - own[CENTRE + i]
        size = abs(out[shift + i]) + abs(own[CENTRE + i])
        spread = 0.0
        for j in range(3):
            entry = out[matrix + 3 * i + j]
            moved += entry * other[CENTRE + j]
            size += abs(entry * other[CENTRE + j])
            spread += abs(entry * units) * _EXTENT
            out[at + 3 * i + j] = entry * units
            frames[9 * which + 3 * i + j] = np.float32(entry * units)
        moved *= scale
        out[at + 9 + i] = moved
        rounding = _FLOAT_ERROR * (abs(moved) + spread + _EXTENT) + _TINY
        out[at + 12 + i] = rounding + 2.0 * scale * (error + 8.0 * _U * size)
    return


@kernel(inline=True)
def transform(placing, w, at, out, to):
    """Three corners of B, seen from A."""
    for k in range(3):
        x = w[at + 3 * k]
        y = w[at + 3 * k + 1]
        z = w[at + 3 * k + 2]
        for i in range(3):
            out[to + 3 * k + i] = (
                placing[3 * i] * x + placing[3 * i + 1] * y + placing[3 * i + 2] * z
            ) + placing[SHIFT + i]


@kernel(inline=True)
def to_world(X, sx, sy, sz, V, at, out, to):
    """Three corners in the world's axes."""
    for k in range(3):
        x = V[at + 3 * k]
        y = V[at + 3 * k + 1]
        z = V[at + 3 * k + 2]
        out[to + 3 * k] = (X[0] * x + X[1] * y + X[2] * z) + sx
        out[to + 3 * k + 1] = (X[4] * x + X[5] * y + X[6] * z) + sy
        out[to + 3 * k + 2] = (X[8] * x + X[9] * y + X[10] * z) + sz
