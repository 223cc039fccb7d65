"""Boxes of leaves whose bodies move, and of the nodes above them."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.broadphase.graded_boxes import LINK, PARENT, SKIP
from collide.broadphase.tree_in_memory import CHANGED_BIT, FLAGS, N_CHANGED, TRAITS, tree_in_memory
from collide.kernels import entry, kernel, view_f64, view_i64

#: A moved leaf's box gets room for _STEPS steps of its body, at most _MAX_SLACK times its largest side or the free
#: distance around; no room if fewer than _LEAST_STEPS steps would fit.
_STEPS, _MAX_SLACK, _LEAST_STEPS = 4.0, 0.125, 2.0


class Sides(NamedTuple):
    """A box in registers."""

    low_x: float
    low_y: float
    low_z: float
    high_x: float
    high_y: float
    high_z: float


@kernel(inline=True)
def _around_children(links, nodes, node):
    """The box around the boxes of a node's children."""
    low_x, low_y, low_z, high_x, high_y, high_z = math.inf, math.inf, math.inf, -math.inf, -math.inf, -math.inf
    child = node + 1
    while child < links[LINK * node + SKIP]:
        at = 6 * child
        low_x, low_y, low_z = min(low_x, nodes[at]), min(low_y, nodes[at + 1]), min(low_z, nodes[at + 2])
        high_x, high_y, high_z = max(high_x, nodes[at + 3]), max(high_y, nodes[at + 4]), max(high_z, nodes[at + 5])
        child = links[LINK * child + SKIP]
    return Sides(low_x, low_y, low_z, high_x, high_y, high_z)


@kernel(inline=True)
def _sum_of_sides(nodes, node):
    """Sum of the sides of a node's box; 0 for the empty box, which meets nothing."""
    at = 6 * node
    x, y, z = nodes[at + 3] - nodes[at], nodes[at + 4] - nodes[at + 1], nodes[at + 5] - nodes[at + 2]
    return max(x, 0.0) + max(y, 0.0) + max(z, 0.0)


@kernel(inline=True)
def _set_box(nodes, node, box):
    at = 6 * node
    nodes[at], nodes[at + 1], nodes[at + 2] = box.low_x, box.low_y, box.low_z
    nodes[at + 3], nodes[at + 4], nodes[at + 5] = box.high_x, box.high_y, box.high_z


@kernel(inline=True)
def _is_box(nodes, node, box):
    at = 6 * node
    return (
        nodes[at] == box.low_x and nodes[at + 1] == box.low_y and nodes[at + 2] == box.low_z
        and nodes[at + 3] == box.high_x and nodes[at + 4] == box.high_y and nodes[at + 5] == box.high_z
    )


@entry("float64(int64, int64, int64, int64)")
def fit_inner_nodes(links_at, nodes_at, begin, end):
    """Boxes of the inner nodes of whole trees, of those of their leaves; the sum of their sides.

    nodes : 6 doubles a node: low x, y, z, high x, y, z.
    """
    return fit_nodes(view_i64(links_at, LINK * end), view_f64(nodes_at, 6 * end), begin, end)


@kernel(inline=True)
def fit_nodes(links, nodes, begin, end):
    """`fit_inner_nodes` of views, from the last node to the first: children stand behind their parents."""
    sides = 0.0
    for node in range(end - 1, begin - 1, -1):
        if links[LINK * node + SKIP] > node + 1:
            _set_box(nodes, node, _around_children(links, nodes, node))
            sides += _sum_of_sides(nodes, node)
    return sides


@entry("float64(int64, int64, int64, int64, int64, int64)")
def fit_paths(leaves_at, n, links_at, nodes_at, n_nodes, out_at):
    """Boxes of the nodes above n leaves, as far up as any changes; by how much their sides have grown.

    out : a double, the number of nodes that were looked at.
    """
    leaves = view_i64(leaves_at, n)
    links = view_i64(links_at, LINK * n_nodes)
    nodes = view_f64(nodes_at, 6 * n_nodes)
    out = view_f64(out_at, 1)
    grown = 0.0
    out[0] = 0.0
    for k in range(n):
        node = links[LINK * leaves[k] + PARENT]
        while node >= 0:
            box = _around_children(links, nodes, node)
            out[0] += 1.0
            if _is_box(nodes, node, box):
                node = -1
            else:
                grown -= _sum_of_sides(nodes, node)
                _set_box(nodes, node, box)
                grown += _sum_of_sides(nodes, node)
                node = links[LINK * node + PARENT]
    return grown


@kernel(inline=True)
def _free_around(tree, leaf, spacing):
    """The largest side of the second node above a leaf, at most ``spacing``: two bodies that happen to be near each
    other may be alone in the first.
    """
    above = tree.links[LINK * leaf + PARENT]
    if above < 0:
        return 0.0
    second = tree.links[LINK * above + PARENT]
    at = 6 * (second if second >= 0 else above)
    x, y = tree.nodes[at + 3] - tree.nodes[at], tree.nodes[at + 4] - tree.nodes[at + 1]
    return max(0.0, min(spacing, max(x, y, tree.nodes[at + 5] - tree.nodes[at + 2])))


@kernel(inline=True)
def _place_leaf(tree, body, leaf, step, side, spacing):
    """Give a leaf a box with room for its body's next steps, and note that the body has changed."""
    max_slack = _MAX_SLACK * max(side, _free_around(tree, leaf, spacing))
    slack = min(_STEPS * step, max_slack) if _LEAST_STEPS * step <= max_slack else 0.0
    for axis in range(3):
        tree.nodes[6 * leaf + axis] = tree.boxes[6 * body + axis] - slack
        tree.nodes[6 * leaf + 3 + axis] = tree.boxes[6 * body + 3 + axis] + slack
    if tree.traits[TRAITS * body + FLAGS] & CHANGED_BIT == 0:
        tree.traits[TRAITS * body + FLAGS] |= CHANGED_BIT
        tree.changed[tree.header[N_CHANGED]] = body
        tree.header[N_CHANGED] += 1


@kernel(inline=True)
def take_box(tree, body, moved, at, spacing):
    """Store a moved body's box, six of the doubles ``moved``: 1 where the body's leaf has another box, 0 where not, −1
    for an unbounded box of a body with a leaf, or a bounded box of a body without.

    A box with a NaN becomes the unbounded box: walks skip boxes whose comparisons fail, and comparisons with NaN fail.
    A leaf's box holds its body's. A body whose step is small against its size or its distance from others gets room for
    several steps of this length, so that most of its steps change no node.
    """
    boxes, nodes = tree.boxes, tree.nodes
    to, leaf = 6 * body, tree.leaf_of[body]
    step = 0.0
    side = 0.0
    is_within = True
    is_bounded = True
    for axis in range(3):
        low, high = moved[at + axis], moved[at + 3 + axis]
        step = max(step, abs(low - boxes[to + axis]), abs(high - boxes[to + 3 + axis]))
        side = max(side, high - low)
        is_bounded = is_bounded & (low > -math.inf) & (high < math.inf)  # NaN is neither
        boxes[to + axis] = low
        boxes[to + 3 + axis] = high
        if leaf >= 0:
            is_within = is_within & (low >= nodes[6 * leaf + axis]) & (high <= nodes[6 * leaf + 3 + axis])
    if not is_bounded:
        _open_where_unknown(boxes, to)
    if is_bounded != (leaf >= 0):
        return -1
    if leaf < 0 or is_within:
        return 0
    _place_leaf(tree, body, leaf, step, side, spacing)
    return 1


@kernel(inline=True)
def _open_where_unknown(boxes, at):
    """Make a box that holds a NaN the unbounded box."""
    is_unknown = False
    for k in range(6):
        is_unknown = is_unknown | (boxes[at + k] != boxes[at + k])
    if is_unknown:
        for axis in range(3):
            boxes[at + axis], boxes[at + 3 + axis] = -math.inf, math.inf


@entry("int64(int64, int64, int64, int64, float64, int64)")
def take_boxes(tree_at, bodies_at, n, moved_at, spacing, escaped_at):
    """Store the boxes of n moved bodies; returns the number of leaves whose boxes had to grow or shrink, or −1, as of
    `take_box`.

    moved : 6 doubles each, their new boxes.   spacing : typical distance of bodies from each other [m].
    escaped : out, the bodies whose leaves changed; they are noted as changed.
    """
    tree = tree_in_memory(tree_at)
    bodies = view_i64(bodies_at, n)
    moved = view_f64(moved_at, 6 * n)
    escaped = view_i64(escaped_at, n)
    count = 0
    for k in range(n):
        state = take_box(tree, bodies[k], moved, 6 * k, spacing)
        if state < 0:
            return -1
        if state > 0:
            escaped[count] = bodies[k]
            count += 1
    return count


@entry("void(int64)")
def forget_changes(tree_at):
    """No body has changed any more."""
    tree = tree_in_memory(tree_at)
    for k in range(tree.header[N_CHANGED]):
        tree.traits[TRAITS * tree.changed[k] + FLAGS] &= ~CHANGED_BIT
    tree.header[N_CHANGED] = 0
