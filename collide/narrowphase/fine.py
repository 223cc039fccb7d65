"""A pair of cores of points in double-doubles: posed differences, planes across them, what else is level.

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

from collide._jit import kernel, view_f64, view_i64
from collide.geometry.double_double import add, cross, multiply, product_of_vectors, square_root, subtract
from collide.geometry.error_free import two_product, two_sum
from collide.geometry.scan import count_level
from collide.geometry.support_tree.query import rings_of
from collide.geometry.tables import POSE_SLOP, POSE_TERMS, TERMS

#: Doubles stored a point: three double-doubles.
FINE = 6
#: Error of a height over the length of its direction, in units of S, and what composed poses add to it in units of
#: their slop.
HEIGHT_ERROR, SLOP_ERROR = 2.0**-97, 2.0**-49
#: Pairs beyond these sizes are left to integers: products of products would overflow or vanish.
SMALLEST_FINE, LARGEST_FINE = 2.0**-300, 2.0**300
#: Directions shorter than this, of a pair of size 1, say nothing.
_SHORTEST = 2.0**-200
#: Most level vertices of a body that are listed; where there are more, all vertices are looked through.
MOST_TIES = 24


@kernel(inline=True)
def scale_of(size):
    """A power of two that brings the pair to a size between ½ and 1."""
    return math.ldexp(1.0, -math.frexp(size)[1])


@kernel
def low_parts(poses, p, terms, low, at):
    """What the twelve entries of a pose are more than the row says, into low[at:]; for a pose as given, zeros."""
    row = int(poses[p + POSE_TERMS])
    for k in range(12):
        total = poses[p + k]
        rest = 0.0
        if row >= 0:
            total = 0.0
            for i in range(TERMS):
                total, e = two_sum(total, terms[TERMS * (12 * row + k) + i])
                rest += e
            rest += total - poses[p + k]
        low[at + k] = rest


@kernel(inline=True)
def is_composed(poses, p):
    """Whether a pose is a product, its row only near what is meant."""
    return poses[p + POSE_SLOP] != 0.0


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
    (coords_a, _, m_a, _, _, p, coords_b, _, m_b, _, _, q, _, poses, _, _, _, _, _, _, _) = pair
    ax = coords_a[i]
    ay = coords_a[m_a + i]
    az = coords_a[2 * m_a + i]
    bx = coords_b[j]
    by = coords_b[m_b + j]
    bz = coords_b[2 * m_b + j]
    for axis in range(3):
        r = p + 3 * axis
        s = q + 3 * axis
        total, rest = two_sum(poses[p + 9 + axis], -poses[q + 9 + axis])
        term, e = two_product(poses[r], ax)
        total, f = two_sum(total, term)
        rest += e + f
        term, e = two_product(poses[r + 1], ay)
        total, f = two_sum(total, term)
        rest += e + f
        term, e = two_product(poses[r + 2], az)
        total, f = two_sum(total, term)
        rest += e + f
        term, e = two_product(poses[s], -bx)
        total, f = two_sum(total, term)
        rest += e + f
        term, e = two_product(poses[s + 1], -by)
        total, f = two_sum(total, term)
        rest += e + f
        term, e = two_product(poses[s + 2], -bz)
        total, f = two_sum(total, term)
        rest += e + f
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
    """The normal of three points, as long as twice their area, into ``direction``.

    From the two shorter edges: long ones that are nearly parallel would leave little of it.
    """
    ex = fine[FINE * j] - fine[FINE * i]
    ey = fine[FINE * j + 2] - fine[FINE * i + 2]
    ez = fine[FINE * j + 4] - fine[FINE * i + 4]
    fx = fine[FINE * k] - fine[FINE * j]
    fy = fine[FINE * k + 2] - fine[FINE * j + 2]
    fz = fine[FINE * k + 4] - fine[FINE * j + 4]
    gx = fine[FINE * i] - fine[FINE * k]
    gy = fine[FINE * i + 2] - fine[FINE * k + 2]
    gz = fine[FINE * i + 4] - fine[FINE * k + 4]
    ij = ex * ex + ey * ey + ez * ez
    jk = fx * fx + fy * fy + fz * fz
    ki = gx * gx + gy * gy + gz * gz
    if ij >= jk and ij >= ki:
        i, j, k = k, i, j
    elif ki >= jk:
        i, j, k = j, k, i
    ex, ex_low, ey, ey_low, ez, ez_low = fine_edge(fine, j, i)
    fx, fx_low, fy, fy_low, fz, fz_low = fine_edge(fine, k, i)
    x, x_low, y, y_low, z, z_low = cross(ex, ex_low, ey, ey_low, ez, ez_low, fx, fx_low, fy, fy_low, fz, fz_low)
    direction[0] = x
    direction[1] = x_low
    direction[2] = y
    direction[3] = y_low
    direction[4] = z
    direction[5] = z_low


@kernel
def set_away_from_edge(fine, direction):
    """The part of point 0 across the edge to point 1, into ``direction``, lengthened by the edge's square.

    Taken twice where that is short: the first time leaves what rounding at |w| makes, the second what rounding at the
    result makes.
    """
    ex, ex_low, ey, ey_low, ez, ez_low = fine_edge(fine, 1, 0)
    square, square_low = product_of_vectors(ex, ex_low, ey, ey_low, ez, ez_low, ex, ex_low, ey, ey_low, ez, ez_low)
    x = fine[0]
    x_low = fine[1]
    y = fine[2]
    y_low = fine[3]
    z = fine[4]
    z_low = fine[5]
    for turn in range(2):
        # Where the edge is not much nearer than its length, once is enough.
        left = abs(x) + abs(y) + abs(z)
        if turn == 1 and left > 2.0**-20 * square * (abs(fine[0]) + abs(fine[2]) + abs(fine[4]) + math.sqrt(square)):
            break
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
    direction[0] = x
    direction[1] = x_low
    direction[2] = y
    direction[3] = y_low
    direction[4] = z
    direction[5] = z_low


@kernel
def fine_length(direction):
    """(|d|, low), or zeros where the direction says nothing."""
    if not abs(direction[0]) + abs(direction[2]) + abs(direction[4]) > _SHORTEST:
        return 0.0, 0.0
    square, square_low = product_of_vectors(
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
    )  # fmt: skip
    return square_root(square, square_low)


# --- what else is level -------------------------------------------------------------------------


@kernel(inline=True)
def are_alone(pair, ids, n, direction, slack):
    """Whether n ≤ 3 points, being the least of A ⊖ B along a direction, are so with level pairs of theirs alone.

    ids : their vertex pairs.   slack : how far doubles may be wrong along |direction| = 1. False also where a pair of
    their vertices might not be level with them: n pairs over n + 1 vertices hang together, so that it must be.
    """
    (coords_a, n_a, m_a, _, _, p, coords_b, n_b, m_b, _, _, q, _, poses, _, _, _, tree_a, tree_b, _, _) = pair
    last = n - 1
    middle = min(last, 1)
    own_a = 1 + (1 if ids[2 * middle] != ids[0] else 0)
    own_a += 1 if ids[2 * last] != ids[0] and ids[2 * last] != ids[2 * middle] else 0
    own_b = 1 + (1 if ids[2 * middle + 1] != ids[1] else 0)
    own_b += 1 if ids[2 * last + 1] != ids[1] and ids[2 * last + 1] != ids[2 * middle + 1] else 0
    if own_a + own_b != n + 1:
        return False
    largest = max(abs(direction[0]), abs(direction[2]), abs(direction[4]))
    dx = direction[0] / largest
    dy = direction[2] / largest
    dz = direction[4] / largest
    slack *= abs(dx) + abs(dy) + abs(dz)
    if not _no_other_is_level(
        coords_a, n_a, m_a, tree_a, ids[0], ids[2 * middle], ids[2 * last], own_a,
        poses[p] * dx + poses[p + 3] * dy + poses[p + 6] * dz,
        poses[p + 1] * dx + poses[p + 4] * dy + poses[p + 7] * dz,
        poses[p + 2] * dx + poses[p + 5] * dy + poses[p + 8] * dz,
        slack,
    ):  # fmt: skip
        return False
    return _no_other_is_level(
        coords_b, n_b, m_b, tree_b, ids[1], ids[2 * middle + 1], ids[2 * last + 1], own_b,
        -(poses[q] * dx + poses[q + 3] * dy + poses[q + 6] * dz),
        -(poses[q + 1] * dx + poses[q + 4] * dy + poses[q + 7] * dz),
        -(poses[q + 2] * dx + poses[q + 5] * dy + poses[q + 8] * dz),
        slack,
    )  # fmt: skip


@kernel(inline=True)
def _product(coordinates, m, i, gx, gy, gz):
    return coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz


@kernel(inline=True)
def _no_other_is_level(coordinates, n, m, tree, i, j, k, own, gx, gy, gz, slack):
    """Whether no vertex but i, j, k (``own`` different ones) has a product with g within the slack of theirs.

    A scan; or, where there is a support tree, a look at their neighbours: the vertices of a hull below a level hang
    together.
    """
    limit = _product(coordinates, m, i, gx, gy, gz)
    limit = min(limit, _product(coordinates, m, j, gx, gy, gz), _product(coordinates, m, k, gx, gy, gz)) + slack
    if tree == 0:
        # What fills up the last block are copies of vertex 0.
        copies = m - n if _product(coordinates, m, 0, gx, gy, gz) <= limit else 0
        return count_level(coordinates, m, m, gx, gy, gz, limit) - copies == own
    starts, ring = rings_of(tree)
    for turn in range(3):
        v = i if turn == 0 else (j if turn == 1 else k)
        for at in range(starts[v], starts[v + 1]):
            w = ring[at]
            if _product(coordinates, m, w, gx, gy, gz) <= limit and w != i and w != j and w != k:
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
        starts, ring = rings_of(tree)
        k = 0
        while k < count:
            for at in range(starts[ties[k]], starts[ties[k] + 1]):
                i = ring[at]
                if coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz <= limit:
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
    first, spare : index in ``fine`` of the first of them, and of a point to be used.   slack : how far doubles may be wrong, times |d̂| = 1.
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
    best = ids[0]
    other = ids[1]
    excess = 0.0
    excess_low = 0.0
    more = 0.0
    more_low = 0.0
    for turn in range(2):
        many = (count_a if turn == 0 else count_b) > MOST_TIES
        for k in range((n_a if turn == 0 else n_b) if many else (count_a if turn == 0 else count_b)):
            i = ids[0]
            j = ids[1]
            if turn == 0:
                i = k if many else ties_a[k]
                if many and coords_a[k] * ax + coords_a[m_a + k] * ay + coords_a[2 * m_a + k] * az > limit_a:
                    continue
            else:
                j = k if many else ties_b[k]
                if many and coords_b[k] * bx + coords_b[m_b + k] * by + coords_b[2 * m_b + k] * bz > limit_b:
                    continue
            fine_point(pair, low, fine, spare, i, j, scale)
            height, height_low = fine_height(fine, spare, direction)
            height, height_low = subtract(height, height_low, base, base_low)
            if turn == 0 and (height < excess or (height == excess and height_low < excess_low)):
                best = i
                excess = height
                excess_low = height_low
            elif turn == 1 and (height < more or (height == more and height_low < more_low)):
                other = j
                more = height
                more_low = height_low
    excess, excess_low = add(excess, excess_low, more, more_low)
    return excess, excess_low, best, other


@kernel
def _write_low_parts(pair, terms_at, low_at):
    poses = pair[13]
    rows = int(max(poses[pair[5] + POSE_TERMS], poses[pair[11] + POSE_TERMS])) + 1
    low = view_f64(low_at, 24)
    terms = view_f64(terms_at, 12 * TERMS * rows)
    low_parts(poses, pair[5], terms, low, 0)
    low_parts(poses, pair[11], terms, low, 12)
    return 24


@kernel(inline=True)
def write_low_parts(pair, terms_at, low_at):
    """Put the low parts of both poses at an address; returns their number, none where both poses are as given."""
    if not (is_composed(pair[13], pair[5]) or is_composed(pair[13], pair[11])):
        return 0
    return _write_low_parts(pair, terms_at, low_at)
