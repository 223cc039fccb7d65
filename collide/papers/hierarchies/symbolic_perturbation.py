"""The side of a plane of a vertex, without ties: general position by symbolic perturbation.

Every vertex x is moved by e(x, k)·(centre k − x) for four centres spanning space. The e are
infinitesimals, all larger than any product of two of them (as 1/N^(1 + θ), θ < 1, are for huge N), the e of centre
0 larger than the e of centre 1 and so on, and, for each centre, in a pseudo-random order. A zero
determinant then gets the sign of the first nonzero determinant with a
point replaced by a centre: no minor is needed, only the exact test itself.

The rule decides whenever three of the four points are not collinear: they and some centre span space.
The rule is Simulation of Simplicity (Edelsbrunner, Mücke 1990) with directions chosen for hulls: centre 0 is in
the middle, vertices move inwards, and strictly extreme vertices stay strictly extreme. A flat facet is
triangulated by cutting off its vertices, the largest move first; a
random order leaves O(log k) triangles at a corner of a facet with k.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.numerics.orientation import one_of_four, orientation

#: Points the perturbation moves vertices towards.
CENTRES = 4


@kernel
def rank_of(i):
    """Place of vertex i in the order of the perturbation: the larger, the further it moves. No two are equal."""
    x = (i * 1103515245 + 12345) & 0x7FFFFFFF
    x = x ^ (x >> 15)
    x = (x * 1103515245 + 12345) & 0x7FFFFFFF
    x = x ^ (x >> 13)
    return x * 134217728 + i  # below 2⁵⁸ for i < 2²⁷


@kernel
def exact_side(cloud, a, b, c, d):
    """1 where d lies above the plane of a, b, c (counter-clockwise from above), 0 on it, −1 below; exact."""
    return orientation(cloud, a, b, c, d, -1)


@kernel
def side(cloud, a, b, c, d):
    """`exact_side` of the perturbed points; 0 only where the four are in line or two are the same."""
    sign = orientation(cloud, a, b, c, d, -1)
    if sign != 0:
        return sign
    return tie(cloud, a, b, c, d)


@kernel
def tie(cloud, a, b, c, d):
    """`side` of four points in one plane."""
    for centre in range(cloud.centres, cloud.centres + CENTRES):
        before = 1 << 60
        for _ in range(4):
            largest = -1
            for corner in range(4):
                rank = rank_of(one_of_four(corner, a, b, c, d))
                if largest < rank < before:
                    largest = rank
            before = largest
            p = centre if rank_of(a) == largest else a
            q = centre if rank_of(b) == largest else b
            r = centre if rank_of(c) == largest else c
            s = centre if rank_of(d) == largest else d
            sign = orientation(cloud, p, q, r, s, -1)
            if sign != 0:
                return sign
    return 0
