"""The lowest vertex of a body along a direction of double-doubles: down the edges of its hull, each step exact.

A hull is convex: a vertex none of whose neighbours is lower is the lowest of all. That is no truth of rounded heights.
Where edges nearly are opposite, as on a cap of thousands of vertices, rounding at two neighbours is a thousand times as
much across the cap. So the direction is rounded once, to two doubles a component in the frame of the body, and along
that one every step is certain: by doubles, by double-doubles, or by the exact sum of all products. What is found is then
the lowest along a direction off by 2⁻¹⁰⁰, wherever the vertices lie.

Steps on level vertices: those of the hull that `quickhull` makes of a cap, logarithmic in their number.

Errors, with S, ρ and σ the sizes of `bounds.py`, d the direction in the world, g = Rᵀd, g′ as rounded, u = 2⁻⁵³:

* a component of g′ is a sum of three products of double-doubles, good to 25u²·Σ|R||d|: over an edge no longer than 2ρ
  that is 25u²·√3·2ρσ|d|, as |R| entry by entry stretches by √3·σ at most;
* the height of a vertex v over the first one v₀ is (v − v₀)·g′, where v − v₀ is exact: 25u²·2ρσ|d|.

No vertex is lower over the first one of its body than is said, by more than the sum of both; of both bodies together,
as ρσ adds up to S at most, 2.2·2⁻¹⁰⁰ S|d|. With what the first points are off by, 1.25·2⁻⁹⁸ S|d| (`refine_gap.py`), that is
less than `HEIGHT_ERROR`.
"""

from __future__ import annotations

from collide.kernels import kernel, view_i64
from collide.numerics.double_double import product_of_vectors
from collide.numerics.error_free import two_sum
from collide.numerics.exact_dot_sign import exact_sign_of_pairs
from collide.support.support_tree import FLAT, HEADER
from collide.support.support_tree_query import rings_of

#: Neighbours that may be looked at on the way down; those left are for `lowest_of_all`.
MOST_NEIGHBOURS = 768
#: Error of a product of vectors in doubles, in units of Σ|products|: both factors, the product and two sums round once.
_ROUGH = 8.0 * 2.0**-53
#: The same of `product_of_vectors`; and of either, products below the smallest normal double.
_FINE, _TINY = 2.0**-101, 2.0**-960


@kernel
def direction_in_body(poses, p, low, at, direction, sign):
    """(gx, low, gy, low, gz, low): Rᵀ times a direction of the world, six doubles, times ±1.

    p : row of the pose.   low, at : where what it is more than the row says begins; no doubles where it is as given.
    """
    gx, gx_low = _component(poses, p, low, at, direction)
    gy, gy_low = _component(poses, p + 1, low, at + 1, direction)
    gz, gz_low = _component(poses, p + 2, low, at + 2, direction)
    return sign * gx, sign * gx_low, sign * gy, sign * gy_low, sign * gz, sign * gz_low


@kernel
def _component(poses, p, low, at, direction):
    """A column of R times the direction."""
    x_low = 0.0
    y_low = 0.0
    z_low = 0.0
    if len(low) > 0:
        x_low = low[at]
        y_low = low[at + 3]
        z_low = low[at + 6]
    return product_of_vectors(
        poses[p], x_low, poses[p + 3], y_low, poses[p + 6], z_low,
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
    )  # fmt: skip


@kernel
def descend(tree, first, gx, gx_low, gy, gy_low, gz, gz_low, terms):
    """(proven, vertex, height, low, looked): a lowest vertex of a hull, exactly, and its height over the first one.

    tree : address of a support tree.   first : the row to start from.   terms : PRODUCT_TERMS doubles to work in.
    looked : neighbours looked at, O(log n) of a level cap.

    Not proven: too many neighbours, or products too small to be exact, or a vertex in the middle of a facet, from which
    edges do not lead to the other side.
    """
    starts, ring, corners = rings_of(tree)
    vertex = first
    looked = 0
    while True:
        begin = starts[vertex]
        end = starts[vertex + 1]
        looked += end - begin
        if end == begin or looked > MOST_NEIGHBOURS:
            return False, first, 0.0, 0.0, looked
        best = vertex
        lowest = 0.0
        plateau = True
        certain = True
        for at in range(begin, end):
            sure, sign, height = _compare(corners, ring[at], vertex, gx, gx_low, gy, gy_low, gz, gz_low, terms)
            certain = certain and sure
            plateau = plateau and sign == 0
            if sign < 0 and (best == vertex or height < lowest):
                best = ring[at]
                lowest = height
        if best == vertex:
            break
        vertex = best
    if not certain or (plateau and view_i64(tree, HEADER)[FLAT] == 0):
        return False, first, 0.0, 0.0, looked
    v = 3 * first
    w = 3 * vertex
    x, x_low = two_sum(corners[w], -corners[v])
    y, y_low = two_sum(corners[w + 1], -corners[v + 1])
    z, z_low = two_sum(corners[w + 2], -corners[v + 2])
    height, height_low = product_of_vectors(x, x_low, y, y_low, z, z_low, gx, gx_low, gy, gy_low, gz, gz_low)
    if height > 0.0:  # rounded: it is not higher
        return True, vertex, 0.0, 0.0, looked
    return True, vertex, height, height_low, looked


@kernel(inline=True)
def _compare(corners, i, j, gx, gx_low, gy, gy_low, gz, gz_low, terms):
    """(certain, sign, height): of (corner i − corner j)·g the sign, and what it is, nearly."""
    v = 3 * j
    w = 3 * i
    x = corners[w] - corners[v]
    y = corners[w + 1] - corners[v + 1]
    z = corners[w + 2] - corners[v + 2]
    height = x * gx + y * gy + z * gz
    size = abs(x * gx) + abs(y * gy) + abs(z * gz)
    if height > _ROUGH * size + _TINY:
        return True, 1, height
    if height < -(_ROUGH * size + _TINY):
        return True, -1, height
    if (x == 0.0 or gx == 0.0) and (y == 0.0 or gy == 0.0) and (z == 0.0 or gz == 0.0):
        return True, 0, 0.0
    return _compare_finely(
        corners[w], corners[w + 1], corners[w + 2], corners[v], corners[v + 1], corners[v + 2],
        gx, gx_low, gy, gy_low, gz, gz_low, _FINE * size + _TINY, terms,
    )  # fmt: skip


@kernel
def _compare_finely(ax, ay, az, bx, by, bz, gx, gx_low, gy, gy_low, gz, gz_low, bound, terms):
    """`_compare` of points a and b, where doubles do not tell."""
    x, x_low = two_sum(ax, -bx)
    y, y_low = two_sum(ay, -by)
    z, z_low = two_sum(az, -bz)
    height, _ = product_of_vectors(x, x_low, y, y_low, z, z_low, gx, gx_low, gy, gy_low, gz, gz_low)
    if height > bound:
        return True, 1, height
    if height < -bound:
        return True, -1, height
    certain, sign = exact_sign_of_pairs(x, x_low, y, y_low, z, z_low, gx, gx_low, gy, gy_low, gz, gz_low, terms)
    return certain, sign, height


@kernel
def lowest_of_all(coordinates, n, m, first, gx, gx_low, gy, gy_low, gz, gz_low):
    """(vertex, height, low, fine): the lowest of all n vertices, and its height over the first one.

    fine : how many heights were taken in double-doubles: those that doubles do not tell from the lowest so far. O(n).
    """
    vx = coordinates[first]
    vy = coordinates[m + first]
    vz = coordinates[2 * m + first]
    best = first
    least = 0.0
    least_low = 0.0
    fine = 0
    for i in range(n):
        x = (coordinates[i] - vx) * gx
        y = (coordinates[m + i] - vy) * gy
        z = (coordinates[2 * m + i] - vz) * gz
        # Level is as good: where all heights are exactly 0 none is taken again.
        if x + y + z - _ROUGH * (abs(x) + abs(y) + abs(z)) >= least:
            continue
        fine += 1
        ex, ex_low = two_sum(coordinates[i], -vx)
        ey, ey_low = two_sum(coordinates[m + i], -vy)
        ez, ez_low = two_sum(coordinates[2 * m + i], -vz)
        height, low = product_of_vectors(ex, ex_low, ey, ey_low, ez, ez_low, gx, gx_low, gy, gy_low, gz, gz_low)
        if height < least or (height == least and low < least_low):
            best = i
            least = height
            least_low = low
    return best, least, least_low, fine
