"""Boxes of a `BoxTree` in the way of a moved box or a ray, and boxes near a point: candidates, with bounds.

A moved box meets another where a ray meets their Minkowski difference, a box as well: three slabs.
"""

from __future__ import annotations

import math

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.broadphase.graded_boxes import BODY, LINK, SKIP
from collide.kernels import address_of, entry, kernel, view_f64, view_i64

#: Doubles of a question: low and high corner of the box that moves, the direction, and the largest t that counts.
SWEEP = 10
#: Relative error of a t where a slab begins or ends, a product with an inverse, with a margin.
_ROUNDING = 2.0**-50
#: Coordinates are smaller than this bound; empty boxes have infinite coordinates.
_LARGEST = 1e300


@kernel(inline=True)
def downwards(x):
    """A difference of two coordinates, moved down by more than it is off; infinities stay."""
    return x - min(abs(x), _LARGEST) * _ROUNDING


@kernel(inline=True)
def upwards(x):
    return x + min(abs(x), _LARGEST) * _ROUNDING


@kernel(inline=True)
def slab_entry(low, high, inverse, first, last):
    """(first, last) of the t in [first, last] with low ≤ t step ≤ high, rounded outwards.

    inverse : of the step, infinite where it is 0.
    """
    if abs(inverse) == math.inf:
        return (first, last) if low <= 0.0 <= high else (math.inf, -math.inf)
    near = low * inverse
    far = high * inverse
    if inverse < 0.0:
        near, far = far, near
    return max(first, downwards(near)), min(last, upwards(far))


@kernel(inline=True)
def box_entry(nodes, node, sweep, at, limit):
    """The t at which a swept box first meets a node's box, from below; infinite beyond the limit."""
    first = 0.0
    last = limit
    for axis in range(3):
        # Sums of two coordinates are rounded: outwards by an ulp of the larger.
        low = nodes[6 * node + axis] - sweep[at + 3 + axis]
        high = nodes[6 * node + 3 + axis] - sweep[at + axis]
        step = sweep[at + 6 + axis]
        inverse = 1.0 / step if step != 0.0 else math.inf
        first, last = slab_entry(downwards(low), upwards(high), inverse, first, last)
    return first if first <= last else math.inf


@kernel(inline=True)
def box_gap(nodes, node, point, at):
    """The distance of a point from the box of a node, from below."""
    square = 0.0
    for axis in range(3):
        x = point[at + axis]
        out = max(nodes[6 * node + axis] - x, x - nodes[6 * node + 3 + axis], 0.0)
        square += out * out
    return math.sqrt(square) * (1.0 - _ROUNDING)


@kernel(inline=True)
def _farthest_corner(nodes, node, point, at):
    """The distance of a point from the farthest corner of the box of a node, from above."""
    square = 0.0
    for axis in range(3):
        x = point[at + axis]
        out = max(nodes[6 * node + 3 + axis] - x, x - nodes[6 * node + axis])
        square += out * out
    return math.sqrt(square) * (1.0 + _ROUNDING)


@kernel(inline=True)
def _nearest_sibling(nodes, links, node, end, point, at):
    """The nearest to a point among a node and its later siblings, up to node number ``end``."""
    nearest = node
    least = math.inf
    while node < end:
        gap = box_gap(nodes, node, point, at)
        if gap < least:
            nearest, least = node, gap
        node = links[LINK * node + SKIP]
    return nearest


@kernel
def _nearest_of_all(nodes, links, n_nodes, point, at):
    """An upper bound of the distance to the nearest body: down to a near leaf, then through all nodes nearer than the
    bound.
    """
    node = _nearest_sibling(nodes, links, 0, n_nodes, point, at)
    while links[LINK * node + SKIP] > node + 1:
        node = _nearest_sibling(nodes, links, node + 1, links[LINK * node + SKIP], point, at)
    best = _farthest_corner(nodes, node, point, at)
    node = 0
    while node < n_nodes:
        following = links[LINK * node + SKIP]
        if box_gap(nodes, node, point, at) < best:
            if following == node + 1:
                best = min(best, _farthest_corner(nodes, node, point, at))
            following = node + 1
        node = following
    return best


@entry("int64(int64, int64, boolean, int64, int64, int64, int64, int64, int64)")
def boxes_ahead(questions_at, n, of_points, nodes_at, links_at, n_nodes, pairs_at, bounds_at, capacity):
    """Pairs (question, body) of boxes met, with lower bounds of t; returns the number of pairs.

    questions : SWEEP doubles each. Under ``of_points`` the low corner is a point, every box at a distance up to the
        limit makes a pair, and bounds are distances.
    nodes, links : of a tree, or of several in sequence (`graded_boxes.py`).
    pairs : out, two integers each, of the first ``capacity``.   bounds : out, a double each.
    """
    questions = view_f64(questions_at, SWEEP * n)
    nodes = view_f64(nodes_at, 6 * n_nodes)
    links = view_i64(links_at, LINK * n_nodes)
    pairs = view_i64(pairs_at, 2 * capacity)
    bounds = view_f64(bounds_at, capacity)
    count = 0
    for k in range(n):
        at = SWEEP * k
        limit = questions[at + 9]
        if of_points and n_nodes > 0:
            limit = min(limit, _nearest_of_all(nodes, links, n_nodes, questions, at))
        node = 0
        while node < n_nodes:
            if of_points:
                bound = box_gap(nodes, node, questions, at)
                bound = bound if bound <= limit else math.inf
            else:
                bound = box_entry(nodes, node, questions, at, limit)
            if bound == math.inf:
                node = links[LINK * node + SKIP]
                continue
            if links[LINK * node + BODY] >= 0:
                if count < capacity:
                    pairs[2 * count] = k
                    pairs[2 * count + 1] = links[LINK * node + BODY]
                    bounds[count] = bound
                count += 1
            node += 1
    return count


def bodies_ahead(tree: BoxTree, questions: np.ndarray, of_points: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """((k, 2) questions and bodies, (k,) bounds of t or distance from below), by question and bound.

    questions : (n, SWEEP) float64.   Bodies without end are with every question, at 0.
    """
    capacity = 64 + 16 * len(questions)
    while True:
        pairs, bounds = np.empty((capacity, 2), dtype=np.int64), np.empty(capacity)
        count = boxes_ahead(
            address_of(questions), len(questions), of_points, address_of(tree.nodes), address_of(tree.links),
            tree.n_nodes, address_of(pairs), address_of(bounds), capacity,
        )
        if count <= capacity:
            break
        capacity = count
    pairs, bounds = pairs[:count], bounds[:count]
    if len(tree.unbounded):
        n, m = len(questions), len(tree.unbounded)
        unbounded = np.stack([np.repeat(np.arange(n), m), np.tile(tree.unbounded, n)], axis=1)
        pairs, bounds = np.concatenate([pairs, unbounded]), np.concatenate([bounds, np.zeros(n * m)])
    order = np.lexsort((pairs[:, 1], bounds, pairs[:, 0]))
    return pairs[order], bounds[order]
