"""Vertices tied for the least of A ⊖ B along a direction: told apart in doubles where these suffice, else in
double-doubles."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64
from collide.narrowphase.gap.hull_descent import descend, direction_in_body, lowest_of_all
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.exact_dot_sign import PRODUCT_TERMS
from collide.numerics.vec3 import Vec3, column_at, dot, norm1, rotate_back, scale, vec3_at
from collide.support.block_scan import count_level
from collide.support.support_tree_query import rings_of

#: Tied vertices that `tied_vertices` lists at most.
MAX_TIES = 24
#: Vertices scanned in the time that a visit of one neighbour takes, about.
_SCANNED_PER_NEIGHBOUR = 16


class Vertices(NamedTuple):
    """Points of one body: coords, n and padded as in `PosedBody`; tree : address of the support tree, or 0."""

    coords: Any
    n: int
    padded: int
    tree: int


@kernel(inline=True)
def vertices_of(body):
    """Those of a `PosedBody`."""
    return Vertices(body.coords, body.n, body.padded, body.tree)


@kernel(inline=True)
def is_unique_minimiser(pair, ids, n, direction, slack):
    """Whether n ≤ 3 points, the least of A ⊖ B along a direction, are tied only with pairs of their own vertices.

    ids : their vertex pairs.   slack : error of doubles along |direction| = 1. False also where a pair of their
    vertices might not be tied with them: n pairs over n + 1 vertices form a connected graph, so the pair must be tied.
    """
    n_of_a, n_of_b = distinct_vertices(ids, n)
    if n_of_a + n_of_b != n + 1:
        return False
    largest = max(abs(direction[0]), abs(direction[2]), abs(direction[4]))
    d = Vec3(direction[0] / largest, direction[2] / largest, direction[4] / largest)
    slack *= norm1(d)
    for which in range(2):
        body = pair.A if which == 0 else pair.B
        g = scale(1.0 if which == 0 else -1.0, rotate_back(pair.poses, body.pose_at, d))
        least = math.inf
        for k in range(n):
            least = min(least, dot(column_at(body.coords, body.padded, ids[2 * k + which]), g))
        n_distinct = n_of_a if which == 0 else n_of_b
        if not no_other_is_tied(vertices_of(body), ids, n, which, n_distinct, g, least + slack):
            return False
    return True


@kernel(inline=True)
def distinct_vertices(ids, n):
    """How many different vertices of A, and of B, n ≤ 3 pairs have."""
    last = 2 * (n - 1)
    middle = min(last, 2)
    n_of_a = 1 + (1 if ids[middle] != ids[0] else 0)
    n_of_a += 1 if ids[last] != ids[0] and ids[last] != ids[middle] else 0
    n_of_b = 1 + (1 if ids[middle + 1] != ids[1] else 0)
    n_of_b += 1 if ids[last + 1] != ids[1] and ids[last + 1] != ids[middle + 1] else 0
    return n_of_a, n_of_b


@kernel
def no_other_is_tied(body, ids, n_pairs, which, n_distinct, g, limit):
    """Whether those of a body's vertices in some vertex pairs, and no others, have a product with g of at most the
    limit.

    body : `Vertices`.   ids : at most three pairs, with ``n_distinct`` different vertices of body ``which``, 0 for A, 1
        for B.

    A scan; or, where there is a support tree, a visit of their neighbours: the vertices of a hull below a level hang
    together. Also a scan where they have very many, as the tip of a cone has.
    """
    i = ids[which]
    j = ids[2 * min(n_pairs - 1, 1) + which]
    k = ids[2 * (n_pairs - 1) + which]
    coords, padded = body.coords, body.padded
    # Vertices of a facet as thin as rounding need not be tied themselves, and then they must not be counted for others.
    if (
        dot(column_at(coords, padded, i), g) > limit
        or dot(column_at(coords, padded, j), g) > limit
        or dot(column_at(coords, padded, k), g) > limit
    ):
        return False
    if body.tree == 0 or _has_many_neighbours(body.tree, padded, i, j, k):
        # What fills up the last block are copies of vertex 0.
        copies = padded - body.n if dot(column_at(coords, padded, 0), g) <= limit else 0
        return count_level(coords, padded, padded, g.x, g.y, g.z, limit) - copies == n_distinct
    starts, ring, corners = rings_of(body.tree)
    for k_distinct in range(n_distinct):
        # The last is a new one if the one in the middle is not.
        v = i if k_distinct == 0 else (k if k_distinct == 2 or j == i else j)
        for at in range(starts[v], starts[v + 1]):
            w = ring[at]
            if dot(vec3_at(corners, 3 * w), g) <= limit and w != i and w != j and w != k:
                return False
    return True


@kernel(inline=True)
def _has_many_neighbours(tree, padded, i, j, k):
    """Whether a scan of all vertices, in vectors, takes less time than a visit of the neighbours of three."""
    starts, _, _ = rings_of(tree)
    degree = max(starts[i + 1] - starts[i], starts[j + 1] - starts[j], starts[k + 1] - starts[k])
    return _SCANNED_PER_NEIGHBOUR * degree > padded


@kernel
def tied_vertices(body, ties, g, slack):
    """(number of vertices whose product with g is at most the limit, the limit).

    body : `Vertices`.   ties : the first is given; all are written, unless more than MAX_TIES. The limit is ``slack``
    above the first.

    Along hull edges with a support tree: the vertices of a hull below a level are connected by edges.
    """
    coords, padded = body.coords, body.padded
    limit = dot(column_at(coords, padded, ties[0]), g) + slack
    count = 1
    if body.tree != 0:
        starts, ring, corners = rings_of(body.tree)
        k = 0
        while k < count:
            for at in range(starts[ties[k]], starts[ties[k] + 1]):
                i = ring[at]
                if dot(vec3_at(corners, 3 * i), g) <= limit:
                    count = _with_tie(ties, count, i)
                    if count > MAX_TIES:
                        return count, limit
            k += 1
        return count, limit
    n_tied = 0
    for i in range(body.n):
        n_tied += 1 if dot(column_at(coords, padded, i), g) <= limit else 0
    if 1 < n_tied <= MAX_TIES:
        for i in range(body.n):
            if dot(column_at(coords, padded, i), g) <= limit:
                count = _with_tie(ties, count, i)
    return max(n_tied, count), limit


@kernel(inline=True)
def _with_tie(ties, count, i):
    """Add vertex i to the ties unless already listed; returns their number."""
    for k in range(count):
        if ties[k] == i:
            return count
    ties[count] = i
    return count + 1


class LowestPair(NamedTuple):
    """Vertices i of A and j of B that are the least of A ⊖ B along a direction: ``excess`` ≤ 0 over a first pair."""

    excess: DD
    i: int
    j: int


@kernel
def lowest_pair(pair, low, ids, direction, terms_at, scale):
    """Height of the least of A ⊖ B along a direction over the first of points nearly the least: ``excess`` ≤ 0.

    low : low parts of both poses, or no doubles where both are as given.   ids : the first point's vertex pair.
    terms_at : workspace of PRODUCT_TERMS doubles.   scale : factor of the heights, a power of two.

    For the error, less than `HEIGHT_ERROR` with the error of the first point's own height, see `hull_descent.py`.
    Called where the points are not alone (`is_unique_minimiser`). O(log n) with support trees, but for vertices of very
    many neighbours; else O(n).
    """
    of_a = _lowest(pair.A, pair.poses, ids[0], low, 0, direction, 1.0, terms_at)
    of_b = _lowest(pair.B, pair.poses, ids[1], low, 12, direction, -1.0, terms_at)
    return LowestPair(dd.scale(scale, dd.add(of_a.height, of_b.height)), of_a.vertex, of_b.vertex)


@kernel
def _lowest(body, poses, first, low, low_at, direction, sign, terms_at):
    """The lowest vertex of a body along ±direction."""
    g = direction_in_body(poses, body.pose_at, low, low_at, direction, sign)
    if body.tree != 0:
        lowest = descend(body.tree, first, g, view_f64(terms_at, PRODUCT_TERMS))
        if lowest.proven:
            return lowest
    return lowest_of_all(body.coords, body.n, body.padded, first, g)
