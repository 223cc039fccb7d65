"""Walks through box-trees in preorder: who meets whom among the bodies, with filters, and who meets boxes from outside.

A node whose box is met is followed by its first child, one whose box is not by what comes after its subtree. Filters
are asked at leaves, before the bodies' own boxes, which may be smaller than those of their leaves.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.broadphase.allowed_rows import is_allowed
from collide.broadphase.graded_boxes import BODY, LINK, SKIP
from collide.kernels import entry, kernel, view_f64, view_i64

#: Integers of a body: bits (below), group, mask, and where its row of allowed pairs begins (−1: it has none).
FLAGS, GROUP, MASK, ALLOWED_AT = range(4)
TRAITS = 4
#: Bits of FLAGS: static; static or asleep: pairs of these are not tested; changed: since the last pairs were looked
#: for.
STATIC_BIT, STILL_BIT, CHANGED_BIT = 1, 2, 4

#: More than what two sums of a coordinate and a margin can be off, relatively.
_ROUNDING = 2.0**-50

# Integers of a tree in memory.
NODES_AT, LINKS_AT, N_NODES, N_FIXED, BOXES_AT, N_BOXES, TRAITS_AT, ALLOWED_ROWS_AT, N_ALLOWED = range(9)
TREE = 9


class _Tree(NamedTuple):
    """A forest in preorder.   n_fixed : nodes of the tree of bodies that stay, which comes first.
    boxes, traits : of bodies.   allowed : as of `allowed_rows.py`.
    """

    nodes: Any
    links: Any
    n_nodes: int
    n_fixed: int
    boxes: Any
    traits: Any
    allowed: Any


class _Box(NamedTuple):
    """In registers."""

    low_x: float
    low_y: float
    low_z: float
    high_x: float
    high_y: float
    high_z: float


@kernel(inline=True)
def _tree_at(header_at):
    header = view_i64(header_at, TREE)
    n, n_boxes = header[N_NODES], header[N_BOXES]
    return _Tree(
        view_f64(header[NODES_AT], 6 * n), view_i64(header[LINKS_AT], LINK * n), n, header[N_FIXED],
        view_f64(header[BOXES_AT], 6 * n_boxes), view_i64(header[TRAITS_AT], TRAITS * n_boxes),
        view_i64(header[ALLOWED_ROWS_AT], header[N_ALLOWED]),
    )  # fmt: skip


@kernel(inline=True)
def _meet(boxes, at, box):
    """Whether two boxes touch."""
    return (
        boxes[at] <= box.high_x and boxes[at + 3] >= box.low_x
        and boxes[at + 1] <= box.high_y and boxes[at + 4] >= box.low_y
        and boxes[at + 2] <= box.high_z and boxes[at + 5] >= box.low_z
    )  # fmt: skip


@kernel(inline=True)
def _are_tested(tree, i, j, either):
    """Whether filters let a pair through.   either : bits of FLAGS that the two must not share."""
    a, b = TRAITS * i, TRAITS * j
    traits = tree.traits
    if traits[a + FLAGS] & traits[b + FLAGS] & either:
        return False
    if (traits[a + GROUP] & traits[b + MASK]) == 0 or (traits[b + GROUP] & traits[a + MASK]) == 0:
        return False
    return (
        traits[a + ALLOWED_AT] < 0 or traits[b + ALLOWED_AT] < 0
        or not is_allowed(tree.allowed, traits[a + ALLOWED_AT], j)
    )  # fmt: skip


@kernel(inline=True)
def _are_near(boxes, i, j, margin):
    """Whether two bodies' boxes come within a margin, rounded the same whichever is asked first."""
    a, b = 6 * min(i, j), 6 * max(i, j)
    return (
        boxes[a] - margin <= boxes[b + 3] and boxes[a + 3] + margin >= boxes[b]
        and boxes[a + 1] - margin <= boxes[b + 4] and boxes[a + 4] + margin >= boxes[b + 1]
        and boxes[a + 2] - margin <= boxes[b + 5] and boxes[a + 5] + margin >= boxes[b + 2]
    )  # fmt: skip


@kernel(inline=True)
def _lowered(x, margin):
    """x − margin, and what rounding may do."""
    return x - (margin + (abs(x) + margin) * _ROUNDING) if margin > 0.0 else x


@kernel(inline=True)
def _raised(x, margin):
    return x + (margin + (abs(x) + margin) * _ROUNDING) if margin > 0.0 else x


@kernel(inline=True)
def _box_at(boxes, at, margin):
    """A box and a margin around it, and what rounding may do."""
    return _Box(
        _lowered(boxes[at], margin), _lowered(boxes[at + 1], margin), _lowered(boxes[at + 2], margin),
        _raised(boxes[at + 3], margin), _raised(boxes[at + 4], margin), _raised(boxes[at + 5], margin),
    )  # fmt: skip


@entry("int64(int64, int64, int64, float64, boolean, int64, int64)")
def pairs_among(tree_at, begin, end, margin, of_leaves, pairs_at, capacity):
    """Pairs of bodies within a margin of each other, the first of each a leaf among the nodes begin … end − 1.

    Returns how many there are; only the first ``capacity`` are stored. Over all nodes but those of the fixed tree every
    pair is met once.
    of_leaves : compare the boxes of leaves, not the bodies' own, and let sleeping bodies through: what may become a
        pair while no leaf is given another box.
    """
    tree = _tree_at(tree_at)
    pairs = view_i64(pairs_at, 2 * capacity)
    either = STATIC_BIT if of_leaves else STILL_BIT
    count = 0
    for k in range(begin, end):
        i = tree.links[LINK * k + BODY]
        if i < 0:
            continue
        box = _box_at(tree.nodes, 6 * k, margin) if of_leaves else _box_at(tree.boxes, 6 * i, margin)
        node = 0 if tree.n_fixed > 0 else k + 1
        while node < tree.n_nodes:
            if not _meet(tree.nodes, 6 * node, box):
                node = tree.links[LINK * node + SKIP]
            else:
                j = tree.links[LINK * node + BODY]
                if j >= 0 and (of_leaves or _are_near(tree.boxes, i, j, margin)) and _are_tested(tree, i, j, either):
                    if count < capacity:
                        pairs[2 * count] = i
                        pairs[2 * count + 1] = j
                    count += 1
                node += 1
            if node == tree.n_fixed:
                node = k + 1
    return count


@entry("int64(int64, int64, int64, float64, int64, int64)")
def pairs_of_leaves(tree_at, leaves_at, n, margin, pairs_at, capacity):
    """Pairs of n leaves' bodies, whose CHANGED_BIT is set, with all others whose leaves' boxes come within a margin.

    A pair of two of them is met once. Sleeping bodies count as if they were awake. The rest as of `pairs_among`.
    """
    tree = _tree_at(tree_at)
    leaves = view_i64(leaves_at, n)
    pairs = view_i64(pairs_at, 2 * capacity)
    count = 0
    for k in range(n):
        leaf = leaves[k]
        i = tree.links[LINK * leaf + BODY]
        box = _box_at(tree.nodes, 6 * leaf, margin)
        node = 0
        while node < tree.n_nodes:
            if not _meet(tree.nodes, 6 * node, box):
                node = tree.links[LINK * node + SKIP]
                continue
            j = tree.links[LINK * node + BODY]
            if j >= 0 and j != i:
                is_second = (tree.traits[TRAITS * j + FLAGS] & CHANGED_BIT) != 0 and node < leaf
                if not is_second and _are_tested(tree, i, j, STATIC_BIT):
                    if count < capacity:
                        pairs[2 * count] = i
                        pairs[2 * count + 1] = j
                    count += 1
            node += 1
    return count


@entry("int64(int64, int64, int64, float64, int64)")
def tested_pairs(tree_at, pairs_at, n, margin, tested_at):
    """Those of n pairs that filters let through and whose own boxes come within a margin; how many these are.

    pairs, tested : two integers each.
    """
    tree = _tree_at(tree_at)
    pairs = view_i64(pairs_at, 2 * n)
    tested = view_i64(tested_at, 2 * n)
    count = 0
    for k in range(n):
        i, j = pairs[2 * k], pairs[2 * k + 1]
        if _are_near(tree.boxes, i, j, margin) and _are_tested(tree, i, j, STILL_BIT):
            tested[2 * count] = i
            tested[2 * count + 1] = j
            count += 1
    return count


@entry("int64(int64, int64, int64, float64, int64, int64)")
def boxes_met(tree_at, queries_at, n, margin, pairs_at, capacity):
    """Pairs (query, body) of n outside boxes within a margin of bodies'; returns how many there are, no filter applies.

    queries : 6 doubles each.   The rest as of `pairs_among`.
    """
    tree = _tree_at(tree_at)
    queries = view_f64(queries_at, 6 * n)
    pairs = view_i64(pairs_at, 2 * capacity)
    count = 0
    for k in range(n):
        at = 6 * k
        box = _Box(
            queries[at] - margin, queries[at + 1] - margin, queries[at + 2] - margin,
            queries[at + 3] + margin, queries[at + 4] + margin, queries[at + 5] + margin,
        )  # fmt: skip
        node = 0
        while node < tree.n_nodes:
            if not _meet(tree.nodes, 6 * node, box):
                node = tree.links[LINK * node + SKIP]
                continue
            j = tree.links[LINK * node + BODY]
            if j >= 0 and _meet(tree.boxes, 6 * j, box):
                if count < capacity:
                    pairs[2 * count] = k
                    pairs[2 * count + 1] = j
                count += 1
            node += 1
    return count
