"""What is level with the least of A ⊖ B along a direction: told apart in doubles where that is enough, else finely."""

from __future__ import annotations

import math

from collide._jit import kernel, view_i64
from collide.geometry.double_double import add, subtract
from collide.geometry.scan import count_level
from collide.geometry.support_tree.query import rings_of
from collide.narrowphase.fine import fine_height, fine_point

#: Most level vertices of a body that are listed; where there are more, all vertices are looked through.
MOST_TIES = 24


@kernel(inline=True)
def are_alone(pair, ids, n, direction, slack):
    """Whether n ≤ 3 points, being the least of A ⊖ B along a direction, are so with level pairs of theirs alone.

    ids : their vertex pairs.   slack : how far doubles may be wrong along |direction| = 1. False also where a pair of
    their vertices might not be level with them: n pairs over n + 1 vertices hang together, so that it must be.
    """
    (coords_a, n_a, m_a, _, _, p, coords_b, n_b, m_b, _, _, q, _, poses, _, _, _, tree_a, tree_b, _, _) = pair
    own_a, own_b = own_vertices(ids, n)
    if own_a + own_b != n + 1:
        return False
    largest = max(abs(direction[0]), abs(direction[2]), abs(direction[4]))
    dx = direction[0] / largest
    dy = direction[2] / largest
    dz = direction[4] / largest
    slack *= abs(dx) + abs(dy) + abs(dz)
    for body in range(2):
        coordinates = coords_a if body == 0 else coords_b
        m = m_a if body == 0 else m_b
        at = p if body == 0 else q
        sign = 1.0 if body == 0 else -1.0
        gx = sign * (poses[at] * dx + poses[at + 3] * dy + poses[at + 6] * dz)
        gy = sign * (poses[at + 1] * dx + poses[at + 4] * dy + poses[at + 7] * dz)
        gz = sign * (poses[at + 2] * dx + poses[at + 5] * dy + poses[at + 8] * dz)
        least = math.inf
        for k in range(n):
            least = min(least, _product(coordinates, m, ids[2 * k + body], gx, gy, gz))
        if not no_other_is_level(
            coordinates, n_a if body == 0 else n_b, m, tree_a if body == 0 else tree_b, ids, n, body,
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
    """Whether no vertices have a product with g of at most the limit, but those of a body's in some vertex pairs.

    ids : the pairs, at most three, with ``own`` different vertices of body 0 or 1; these are below the limit.

    A scan; or, where there is a support tree, a look at their neighbours: the vertices of a hull below a level hang
    together.
    """
    if tree == 0:
        # What fills up the last block are copies of vertex 0.
        copies = m - n if _product(coordinates, m, 0, gx, gy, gz) <= limit else 0
        return count_level(coordinates, m, m, gx, gy, gz, limit) - copies == own
    i = ids[body]
    j = ids[2 * min(pairs - 1, 1) + body]
    k = ids[2 * (pairs - 1) + body]
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


@kernel
def tied_vertices(coordinates, n, m, tree, ties, own, gx, gy, gz, slack):
    """(number of vertices whose product with g is at most the limit, the limit).

    ties : its first ``own`` are known in; all out, unless there are more than MOST_TIES. The limit is ``slack`` above
        the least of the first ones. Along hull edges where there is a support tree: the vertices of a hull below a
        level hang together.
    """
    limit = math.inf
    for k in range(own):
        i = ties[k]
        limit = min(limit, coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz)
    limit += slack
    count = own
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
    if level > own and level <= MOST_TIES:
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
def settle_level(pair, low, fine, first, spare, ids, n, direction, slack, ties_at, scale):
    """How far the least of A ⊖ B along a direction lies beyond points that nearly are the least.

    ids : their vertex pairs, n of them.
    first, spare : index in ``fine`` of the first of them, and of a point to be used.
    slack : how far doubles may be wrong along |direction| = 1.
    ties_at : integer workspace of 2·(MOST_TIES + 1).

    Returns (excess, low, i, j): the least height is that of the first point plus the excess, ≤ 0, at vertices i, j.
    Asked where they are not alone (`are_alone`).
    """
    (coords_a, n_a, m_a, _, _, p, coords_b, n_b, m_b, _, _, q, _, poses, _, _, _, tree_a, tree_b, _, _) = pair
    own_a = 0
    own_b = 0
    ties_a = view_i64(ties_at, MOST_TIES + 1)
    ties_b = view_i64(ties_at + 8 * (MOST_TIES + 1), MOST_TIES + 1)
    for k in range(n):
        own_a = _with_tie(ties_a, own_a, ids[2 * k])
        own_b = _with_tie(ties_b, own_b, ids[2 * k + 1])
    largest = max(abs(direction[0]), abs(direction[2]), abs(direction[4]))
    dx = direction[0] / largest
    dy = direction[2] / largest
    dz = direction[4] / largest
    slack *= abs(dx) + abs(dy) + abs(dz)
    ax = poses[p] * dx + poses[p + 3] * dy + poses[p + 6] * dz
    ay = poses[p + 1] * dx + poses[p + 4] * dy + poses[p + 7] * dz
    az = poses[p + 2] * dx + poses[p + 5] * dy + poses[p + 8] * dz
    bx = -(poses[q] * dx + poses[q + 3] * dy + poses[q + 6] * dz)
    by = -(poses[q + 1] * dx + poses[q + 4] * dy + poses[q + 7] * dz)
    bz = -(poses[q + 2] * dx + poses[q + 5] * dy + poses[q + 8] * dz)
    count_a, limit_a = tied_vertices(coords_a, n_a, m_a, tree_a, ties_a, own_a, ax, ay, az, slack)
    count_b, limit_b = tied_vertices(coords_b, n_b, m_b, tree_b, ties_b, own_b, bx, by, bz, slack)
    base, base_low = fine_height(fine, first, direction)
    i, excess, excess_low = _lowest(
        pair, low, fine, spare, ids[1], True, ties_a, count_a, limit_a, ax, ay, az, direction, scale, base, base_low
    )
    j, more, more_low = _lowest(
        pair, low, fine, spare, ids[0], False, ties_b, count_b, limit_b, bx, by, bz, direction, scale, base, base_low
    )
    excess, excess_low = add(excess, excess_low, more, more_low)
    return excess, excess_low, i, j


@kernel
def _lowest(pair, low, fine, spare, other, of_a, ties, count, limit, gx, gy, gz, direction, scale, base, base_low):
    """(vertex, height, low): the lowest of a body's level vertices, with a vertex of the other; heights above the base.

    ties, count : what is level; of more than MOST_TIES all vertices are looked through that are below the limit.
    """
    coordinates = pair[0] if of_a else pair[6]
    n = pair[1] if of_a else pair[7]
    m = pair[2] if of_a else pair[8]
    many = count > MOST_TIES
    best = ties[0]
    least = 0.0
    least_low = 0.0
    for k in range(n if many else count):
        i = k if many else ties[k]
        if many and _product(coordinates, m, i, gx, gy, gz) > limit:
            continue
        fine_point(pair, low, fine, spare, i if of_a else other, other if of_a else i, scale)
        height, height_low = fine_height(fine, spare, direction)
        height, height_low = subtract(height, height_low, base, base_low)
        if height < least or (height == least and height_low < least_low):
            best = i
            least = height
            least_low = height_low
    return best, least, least_low
