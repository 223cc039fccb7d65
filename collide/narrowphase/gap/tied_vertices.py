"""What is level with the least of A ⊖ B along a direction: told apart in doubles where that is enough, else finely."""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64
from collide.narrowphase.gap.hull_descent import descend, direction_in_body, lowest_of_all
from collide.numerics.double_double import add
from collide.numerics.exact_dot_sign import PRODUCT_TERMS
from collide.support.block_scan import count_level
from collide.support.support_tree_query import rings_of

#: Most level vertices that `tied_vertices` lists.
MOST_TIES = 24
#: Vertices scanned in the time of a look at one neighbour, about.
SCANNED_PER_NEIGHBOUR = 16


@kernel(inline=True)
def are_alone(pair, ids, n, direction, slack):
    """Whether n ≤ 3 points, being the least of A ⊖ B along a direction, are so with level pairs of theirs alone.

    ids : their vertex pairs.   slack : how far doubles may be wrong along |direction| = 1. False also where a pair of
    their vertices might not be level with them: n pairs over n + 1 vertices hang together, so that it must be.
    """
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    own_a, own_b = own_vertices(ids, n)
    if own_a + own_b != n + 1:
        return False
    largest = max(abs(direction[0]), abs(direction[2]), abs(direction[4]))
    dx = direction[0] / largest
    dy = direction[2] / largest
    dz = direction[4] / largest
    slack *= abs(dx) + abs(dy) + abs(dz)
    for body in range(2):
        coordinates = A.coords if body == 0 else B.coords
        m = A.padded if body == 0 else B.padded
        at = p if body == 0 else q
        sign = 1.0 if body == 0 else -1.0
        gx = sign * (poses[at] * dx + poses[at + 3] * dy + poses[at + 6] * dz)
        gy = sign * (poses[at + 1] * dx + poses[at + 4] * dy + poses[at + 7] * dz)
        gz = sign * (poses[at + 2] * dx + poses[at + 5] * dy + poses[at + 8] * dz)
        least = math.inf
        for k in range(n):
            least = min(least, _product(coordinates, m, ids[2 * k + body], gx, gy, gz))
        if not no_other_is_level(
            coordinates, A.n if body == 0 else B.n, m, A.tree if body == 0 else B.tree, ids, n, body,
            own_a if body == 0 else own_b, gx, gy, gz, least + slack,
        ):  # fmt: skip
            return False
    return True


@kernel(inline=True)
def own_vertices(ids, n):
    """How many different vertices of A, and of B, n ≤ 3 pairs have."""
    last = 2 * (n - 1)
    middle = min(last, 2)
    own_a = 1 + (1 if ids[middle] != ids[0] else 0)
    own_a += 1 if ids[last] != ids[0] and ids[last] != ids[middle] else 0
    own_b = 1 + (1 if ids[middle + 1] != ids[1] else 0)
    own_b += 1 if ids[last + 1] != ids[1] and ids[last + 1] != ids[middle + 1] else 0
    return own_a, own_b


@kernel(inline=True)
def _product(coordinates, m, i, gx, gy, gz):
    return coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz


@kernel
def no_other_is_level(coordinates, n, m, tree, ids, pairs, body, own, gx, gy, gz, limit):
    """Whether those of a body's vertices in some vertex pairs, and no others, have a product with g of at most the limit.

    ids : the pairs, at most three, with ``own`` different vertices of body 0 or 1.

    A scan; or, where there is a support tree, a look at their neighbours: the vertices of a hull below a level hang
    together. Also a scan where they have very many, as the tip of a cone has.
    """
    i = ids[body]
    j = ids[2 * min(pairs - 1, 1) + body]
    k = ids[2 * (pairs - 1) + body]
    # Vertices of a facet as thin as rounding need not be level themselves, and then they must not be counted for others.
    if (
        _product(coordinates, m, i, gx, gy, gz) > limit
        or _product(coordinates, m, j, gx, gy, gz) > limit
        or _product(coordinates, m, k, gx, gy, gz) > limit
    ):
        return False
    if tree == 0 or _has_many_neighbours(tree, m, i, j, k):
        # What fills up the last block are copies of vertex 0.
        copies = m - n if _product(coordinates, m, 0, gx, gy, gz) <= limit else 0
        return count_level(coordinates, m, m, gx, gy, gz, limit) - copies == own
    starts, ring, corners = rings_of(tree)
    for turn in range(own):
        # The last is a new one if the one in the middle is not.
        v = i if turn == 0 else (k if turn == 2 or j == i else j)
        for at in range(starts[v], starts[v + 1]):
            w = ring[at]
            height = corners[3 * w] * gx + corners[3 * w + 1] * gy + corners[3 * w + 2] * gz
            if height <= limit and w != i and w != j and w != k:
                return False
    return True


@kernel(inline=True)
def _has_many_neighbours(tree, m, i, j, k):
    """Whether a scan of all m vertices, in vectors, takes less time than a look at the neighbours of three."""
    starts, _, _ = rings_of(tree)
    degree = max(starts[i + 1] - starts[i], starts[j + 1] - starts[j], starts[k + 1] - starts[k])
    return SCANNED_PER_NEIGHBOUR * degree > m


@kernel
def tied_vertices(coordinates, n, m, tree, ties, gx, gy, gz, slack):
    """(number of vertices whose product with g is at most the limit, the limit).

    ties : the first is known in; all out, unless there are more than MOST_TIES. The limit is ``slack`` above the first.

    Along hull edges where there is a support tree: the vertices of a hull below a level hang together.
    """
    limit = _product(coordinates, m, ties[0], gx, gy, gz) + slack
    count = 1
    if tree != 0:
        starts, ring, corners = rings_of(tree)
        k = 0
        while k < count:
            for at in range(starts[ties[k]], starts[ties[k] + 1]):
                i = ring[at]
                if corners[3 * i] * gx + corners[3 * i + 1] * gy + corners[3 * i + 2] * gz <= limit:
                    count = _with_tie(ties, count, i)
                    if count > MOST_TIES:
                        return count, limit
            k += 1
        return count, limit
    level = 0
    for i in range(n):
        level += 1 if coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz <= limit else 0
    if 1 < level <= MOST_TIES:
        for i in range(n):
            if coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz <= limit:
                count = _with_tie(ties, count, i)
    return max(level, count), limit


@kernel(inline=True)
def _with_tie(ties, count, i):
    """Add vertex i to the ties unless it is one; returns their number."""
    for k in range(count):
        if ties[k] == i:
            return count
    ties[count] = i
    return count + 1


@kernel
def settle_level(pair, low, ids, direction, terms_at, scale):
    """How far the least of A ⊖ B along a direction lies beyond the first of points that nearly are the least.

    ids : the first one's vertex pair.
    low : low parts of both poses, or no doubles where both are as given.
    terms_at : workspace of PRODUCT_TERMS numbers.   scale : what heights are multiplied with, a power of two.

    Returns (excess, low, i, j): the least height is that of the first point plus the excess, ≤ 0, at vertices i, j. For
    the error, less than `HEIGHT_ERROR` with that of the first point's own height, see `hull_descent.py`.
    Asked where they are not alone (`are_alone`). O(log n) where there are support trees, but for vertices of very many
    neighbours; else O(n).
    """
    A, B, poses = pair.A, pair.B, pair.poses
    p, q = A.pose_at, B.pose_at
    i, excess, excess_low = _lowest(A.coords, A.n, A.padded, A.tree, ids[0], poses, p, low, 0, direction, 1.0, terms_at)
    j, more, more_low = _lowest(B.coords, B.n, B.padded, B.tree, ids[1], poses, q, low, 12, direction, -1.0, terms_at)
    excess, excess_low = add(excess, excess_low, more, more_low)
    return excess * scale, excess_low * scale, i, j


@kernel
def _lowest(coordinates, n, m, tree, first, poses, p, low, at, direction, sign, terms_at):
    """(vertex, height, low): the lowest vertex of a body along ±direction, and its height over the first one."""
    gx, gx_low, gy, gy_low, gz, gz_low = direction_in_body(poses, p, low, at, direction, sign)
    if tree != 0:
        terms = view_f64(terms_at, PRODUCT_TERMS)
        proven, vertex, height, height_low, _ = descend(tree, first, gx, gx_low, gy, gy_low, gz, gz_low, terms)
        if proven:
            return vertex, height, height_low
    vertex, height, height_low, _ = lowest_of_all(coordinates, n, m, first, gx, gx_low, gy, gy_low, gz, gz_low)
    return vertex, height, height_low
