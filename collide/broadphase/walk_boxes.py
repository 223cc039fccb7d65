"""Walks through box-trees in preorder: pairs of near bodies, with filters, and bodies near boxes from outside.

A walk for all pairs starts from pairs of nodes: two siblings whose boxes meet are opened, the larger subtree
first, down to two leaves. A single box walks through the tree: after a node whose box meets the single box follows
the node's first child, after any other node the node behind its subtree. Filters are asked at leaves, and the
bodies' own boxes, at times smaller than their leaves'.

A pair is a key: i·2^32 + j of bodies i < j. Keys in ascending order are pairs in order.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.broadphase.allowed_rows import is_allowed
from collide.broadphase.graded_boxes import BODY, LINK, MAX_CHILDREN, MAX_DEPTH, SKIP
from collide.broadphase.tree_in_memory import (
    ALLOWED_AT,
    CHANGED_BIT,
    FLAGS,
    GROUP,
    MASK,
    N_CHANGED,
    STATIC_BIT,
    STILL_BIT,
    TRAITS,
    tree_in_memory,
)
from collide.kernels import entry, kernel, view_f64, view_i64

#: More than what two sums of a coordinate and a margin can be off, relatively.
_ROUNDING = 2.0**-50
#: Pairs of nodes that wait at once: two of one node's children, and on the way down from them all but one of what is
#: opened; twice the depth, since both are opened.
STACK_OF_PAIRS = MAX_CHILDREN * (MAX_CHILDREN - 1) // 2 + 2 * MAX_DEPTH * (MAX_CHILDREN - 1) + 2


class _Box(NamedTuple):
    """In registers."""

    low_x: float
    low_y: float
    low_z: float
    high_x: float
    high_y: float
    high_z: float


@kernel(inline=True)
def _meet(boxes, at, box):
    """Whether two boxes touch."""
    return (
        boxes[at] <= box.high_x and boxes[at + 3] >= box.low_x
        and boxes[at + 1] <= box.high_y and boxes[at + 4] >= box.low_y
        and boxes[at + 2] <= box.high_z and boxes[at + 5] >= box.low_z
    )


@kernel(inline=True)
def are_tested(tree, i, j, either):
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
    )


@kernel(inline=True)
def are_near(boxes, i, j, margin):
    """Whether two bodies' boxes come within a margin, i < j. All six are compared: a branch that is foreseen half of
    the time costs more.
    """
    a, b = 6 * i, 6 * j
    return (
        (boxes[a] - margin <= boxes[b + 3]) & (boxes[a + 3] + margin >= boxes[b])
        & (boxes[a + 1] - margin <= boxes[b + 4]) & (boxes[a + 4] + margin >= boxes[b + 1])
        & (boxes[a + 2] - margin <= boxes[b + 5]) & (boxes[a + 5] + margin >= boxes[b + 2])
    )


@kernel(inline=True)
def _lowered(x, margin):
    """x − margin, and what rounding may do."""
    return x - (margin + (abs(x) + margin) * _ROUNDING) if margin > 0.0 else x


@kernel(inline=True)
def raised(x, margin):
    return x + (margin + (abs(x) + margin) * _ROUNDING) if margin > 0.0 else x


@kernel(inline=True)
def _box_at(boxes, at, margin):
    """A box and a margin around it, and what rounding may do."""
    return _Box(
        _lowered(boxes[at], margin), _lowered(boxes[at + 1], margin), _lowered(boxes[at + 2], margin),
        raised(boxes[at + 3], margin), raised(boxes[at + 4], margin), raised(boxes[at + 5], margin),
    )


# --- all pairs ----------------------------------------------------------------------------------


@kernel(inline=True)
def _are_nodes_near(nodes, a, b, reach):
    """Whether the boxes of two nodes come within ``reach``, without branches."""
    a, b = 6 * a, 6 * b
    return (
        (nodes[a] - nodes[b + 3] <= reach) & (nodes[b] - nodes[a + 3] <= reach)
        & (nodes[a + 1] - nodes[b + 4] <= reach) & (nodes[b + 1] - nodes[a + 4] <= reach)
        & (nodes[a + 2] - nodes[b + 5] <= reach) & (nodes[b + 2] - nodes[a + 5] <= reach)
    )


@kernel(inline=True)
def _push_if_near(tree, stack, top, a, b, reach):
    """Put a pair of nodes on the stack, if it is near; the new height."""
    stack[2 * top] = a
    stack[2 * top + 1] = b
    return top + (1 if _are_nodes_near(tree.nodes, a, b, reach) else 0)


@kernel
def _pairs_below(tree, stack, top, reach, margin, of_leaves, keys, count):
    """Pairs of bodies below the pairs of nodes on the stack, behind the first ``count`` keys; how many keys there are.
    """
    links = tree.links
    either = STATIC_BIT if of_leaves else STILL_BIT
    while top > 0:
        top -= 1
        a, b = stack[2 * top], stack[2 * top + 1]
        end_a, end_b = links[LINK * a + SKIP], links[LINK * b + SKIP]
        if end_a - a == 1 and end_b - b == 1:
            i, j = links[LINK * a + BODY], links[LINK * b + BODY]
            i, j = min(i, j), max(i, j)
            is_pair = i >= 0 and (of_leaves or are_near(tree.boxes, i, j, margin))
            if is_pair and are_tested(tree, i, j, either):
                count = _note_pair(keys, count, i, j)
            continue
        if end_a - a < end_b - b:
            a, b, end_a = b, a, end_b
        child = a + 1
        while child < end_a:
            top = _push_if_near(tree, stack, top, child, b, reach)
            child = links[LINK * child + SKIP]
    return count


@kernel(inline=True)
def _note_pair(keys, count, i, j):
    """Store a pair where the capacity allows; returns the number of pairs."""
    if count < len(keys):
        keys[count] = (min(i, j) << 32) + max(i, j)
    return count + 1


@kernel
def _reach(tree, margin):
    """A margin, and what rounding may do to sums and differences of coordinates within the roots' boxes."""
    if margin <= 0.0:
        return 0.0
    largest = 0.0
    root = 0
    while root < tree.n_nodes:
        if tree.nodes[6 * root] <= tree.nodes[6 * root + 3]:
            for k in range(6):
                largest = max(largest, abs(tree.nodes[6 * root + k]))
        root = tree.links[LINK * root + SKIP]
    return margin + (largest + margin) * _ROUNDING


@entry("int64(int64, float64, boolean, int64, int64, int64)")
def pairs_of_all(tree_at, margin, of_leaves, stack_at, keys_at, capacity):
    """Keys of all pairs of bodies within a margin of each other; returns their number. The first ``capacity`` are
    stored.

    of_leaves : compare the boxes of leaves, not the bodies' own, and let sleeping bodies through: all possible
        pairs as long as no leaf's box changes.
    stack : 2 · STACK_OF_PAIRS integers.
    """
    tree = tree_in_memory(tree_at)
    stack = view_i64(stack_at, 2 * STACK_OF_PAIRS)
    keys = view_i64(keys_at, capacity)
    links, n = tree.links, tree.n_nodes
    reach = _reach(tree, margin)
    count = 0
    root = 0
    while root < n:
        following = links[LINK * root + SKIP]
        while following < n:
            top = _push_if_near(tree, stack, 0, root, following, reach)
            count = _pairs_below(tree, stack, top, reach, margin, of_leaves, keys, count)
            following = links[LINK * following + SKIP]
        root = links[LINK * root + SKIP]
    for node in range(tree.n_fixed, n):
        end = links[LINK * node + SKIP]
        top = 0
        a = node + 1
        while a < end:
            following = links[LINK * a + SKIP]
            b = following
            while b < end:
                top = _push_if_near(tree, stack, top, a, b, reach)
                b = links[LINK * b + SKIP]
            a = following
        if top > 0:
            count = _pairs_below(tree, stack, top, reach, margin, of_leaves, keys, count)
    return count


# --- single boxes -------------------------------------------------------------------------------


@kernel(inline=True)
def _next_leaf(tree, node, end, box):
    """The first leaf, from a node on, whose box meets another box; ``end`` where no leaf does."""
    while node < end:
        if not _meet(tree.nodes, 6 * node, box):
            node = tree.links[LINK * node + SKIP]
        elif tree.links[LINK * node + BODY] >= 0:
            return node
        else:
            node += 1
    return end


@entry("int64(int64, int64, int64, float64, int64, int64)")
def pairs_among(tree_at, begin, end, margin, keys_at, capacity):
    """Keys of pairs of bodies within a margin of each other, the first of each a leaf among the nodes begin … end − 1
    and the other behind it; the rest as of `pairs_of_all`.
    """
    tree = tree_in_memory(tree_at)
    keys = view_i64(keys_at, capacity)
    count = 0
    for k in range(begin, end):
        i = tree.links[LINK * k + BODY]
        if i < 0:
            continue
        box = _box_at(tree.boxes, 6 * i, margin)
        node = _next_leaf(tree, k + 1, tree.n_nodes, box)
        while node < tree.n_nodes:
            j = tree.links[LINK * node + BODY]
            if are_near(tree.boxes, min(i, j), max(i, j), margin) and are_tested(tree, i, j, STILL_BIT):
                count = _note_pair(keys, count, i, j)
            node = _next_leaf(tree, node + 1, tree.n_nodes, box)
    return count


@entry("int64(int64, int64, int64, int64)")
def first_pairs(tree_at, n_bodies, keys_at, capacity):
    """Keys, ascending, of pairs of the first n_bodies bodies with bodies of larger numbers whose boxes meet, filters
    applied; returns the number of keys.

    Body after body, until ``capacity`` keys are stored: of the last body the keys with the least partners. Boxes and
    filters alone decide which pairs are stored, not the shape of the tree.
    """
    tree = tree_in_memory(tree_at)
    keys = view_i64(keys_at, capacity)
    count = i = 0
    while i < n_bodies and count < capacity:
        begin = count
        node = tree.n_nodes
        box = _box_at(tree.boxes, 6 * i, 0.0)
        if tree.leaf_of[i] >= 0:
            node = _next_leaf(tree, 0, tree.n_nodes, box)
        while node < tree.n_nodes:
            j = tree.links[LINK * node + BODY]
            if j > i and _meet(tree.boxes, 6 * j, box) and are_tested(tree, i, j, STILL_BIT):
                count = _insert_key(keys, begin, count, (i << 32) + j)
            node = _next_leaf(tree, node + 1, tree.n_nodes, box)
        i += 1
    return count


@kernel(inline=True)
def _insert_key(keys, begin, count, key):
    """Put a key among the ascending keys begin … count − 1; without space the largest goes. The new count."""
    if count == len(keys):
        if keys[count - 1] <= key:
            return count
        count -= 1
    at = count
    while at > begin and keys[at - 1] > key:
        keys[at] = keys[at - 1]
        at -= 1
    keys[at] = key
    return count + 1


@entry("int64(int64, int64, int64, float64, int64, int64)")
def mended_pairs(tree_at, cached_at, n_cached, margin, keys_at, capacity):
    """Keys of pairs whose leaves' boxes come within a margin: cached keys less pairs of changed bodies, and the pairs
    of changed bodies as of now. Returns the number of keys; the first ``capacity`` are stored.

    Sleeping bodies count as if they were awake. A pair of two changed bodies appears once.
    """
    tree = tree_in_memory(tree_at)
    cached = view_i64(cached_at, n_cached)
    keys = view_i64(keys_at, capacity)
    count = 0
    for k in range(n_cached):
        i, j = cached[k] >> 32, cached[k] & 0xFFFFFFFF
        if (tree.traits[TRAITS * i + FLAGS] | tree.traits[TRAITS * j + FLAGS]) & CHANGED_BIT == 0:
            count = _note_pair(keys, count, i, j)
    for k in range(tree.header[N_CHANGED]):
        i = tree.changed[k]
        leaf = tree.leaf_of[i]
        if leaf < 0:
            continue
        box = _box_at(tree.nodes, 6 * leaf, margin)
        node = _next_leaf(tree, 0, tree.n_nodes, box)
        while node < tree.n_nodes:
            j = tree.links[LINK * node + BODY]
            has_changed = (tree.traits[TRAITS * j + FLAGS] & CHANGED_BIT) != 0
            if j != i and not (has_changed and node < leaf) and are_tested(tree, i, j, STATIC_BIT):
                count = _note_pair(keys, count, i, j)
            node = _next_leaf(tree, node + 1, tree.n_nodes, box)
    return count


@entry("int64(int64, int64, int64, float64, int64, int64)")
def boxes_met(tree_at, queries_at, n, margin, pairs_at, capacity):
    """Pairs (query, body) of n outside boxes within a margin of bodies'; returns how many there are, no filter applies.

    queries : 6 doubles each.   pairs : two integers each, of the first ``capacity``.
    """
    tree = tree_in_memory(tree_at)
    queries = view_f64(queries_at, 6 * n)
    pairs = view_i64(pairs_at, 2 * capacity)
    count = 0
    for k in range(n):
        at = 6 * k
        box = _Box(
            queries[at] - margin, queries[at + 1] - margin, queries[at + 2] - margin,
            queries[at + 3] + margin, queries[at + 4] + margin, queries[at + 5] + margin,
        )
        node = _next_leaf(tree, 0, tree.n_nodes, box)
        while node < tree.n_nodes:
            j = tree.links[LINK * node + BODY]
            if _meet(tree.boxes, 6 * j, box):
                if count < capacity:
                    pairs[2 * count] = k
                    pairs[2 * count + 1] = j
                count += 1
            node = _next_leaf(tree, node + 1, tree.n_nodes, box)
    return count


# --- pairs that are known -----------------------------------------------------------------------


@entry("int64(int64, int64, int64, float64, boolean, int64)")
def tested_pairs(tree_at, keys_at, n, margin, are_filtered, pairs_at):
    """Write the pairs of n keys whose bodies' boxes come within a margin, less filtered pairs; returns their number.

    are_filtered : only sleep is left to ask.   pairs : out, two integers each.
    """
    tree = tree_in_memory(tree_at)
    keys = view_i64(keys_at, n)
    pairs = view_i64(pairs_at, 2 * n)
    count = 0
    for k in range(n):
        i, j = keys[k] >> 32, keys[k] & 0xFFFFFFFF
        pairs[2 * count] = i
        pairs[2 * count + 1] = j
        is_awake = (tree.traits[TRAITS * i + FLAGS] & tree.traits[TRAITS * j + FLAGS] & STILL_BIT) == 0
        is_pair = is_awake & are_near(tree.boxes, i, j, margin)
        if not are_filtered:
            is_pair = is_pair and are_tested(tree, i, j, STILL_BIT)
        count += 1 if is_pair else 0
    return count


@entry("void(int64, int64, int64)")
def pairs_of_keys(keys_at, n, pairs_at):
    """n keys as pairs, two integers each."""
    keys = view_i64(keys_at, n)
    pairs = view_i64(pairs_at, 2 * n)
    for k in range(n):
        pairs[2 * k] = keys[k] >> 32
        pairs[2 * k + 1] = keys[k] & 0xFFFFFFFF
