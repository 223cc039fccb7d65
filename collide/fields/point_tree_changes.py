"""Changes of a tree over points: points are taken out of their leaves, renumbered, and put into leaves nearby.

A leaf losing points is made anew, and boxes above from the boxes below; a leaf without points leaves its slot. A new
point goes down to the boxes growing least. Full leaves are split across their longest side, and nodes above as in
B-trees, but no node of the tree as built, full from the beginning: in its slot a B-tree grows, so all ways past the
slot stay as short as before. New leaves and nodes stand at the ends of the arrays. The first place of a leaf stays a
multiple of MAX_LEAF; places without a point have the number −1. Nobody reads the tree during a change.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.fields.point_tree_kernel import (
    MAX_LEVELS,
    box_of_node,
    box_of_points,
    floats_of,
    higher_of,
    lower_of,
    place_in_units,
    points_of,
    put_box,
    put_floats,
)
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    MAX_LEAF,
    N_FACETS,
    N_NODES,
    NODE,
    NOTHING,
    WIDTH,
    TreeView,
    box_at,
    leaf_link,
    link_of,
    open_tree,
)
from collide.numerics.vec3 import Vec3, absolute, component, max_abs, norm1, sub, vec3_at

#: Words that say how much of a tree's arrays is used: nodes, places, levels of nodes; the nodes of the tree as built.
NODES, PLACES, LEVELS, BUILT = range(4)
#: A way down, three words a level; what is split, and the keys of their order.
_SPLIT = WIDTH + 1
_WAY = 3 * (MAX_LEVELS + 1)
WORK = _WAY + 2 * _SPLIT
#: Corners of boxes within 2 units are rounded by half of this at most.
_CORNER_ERROR = 2.0**-52


class _Patch(NamedTuple):
    """A tree under change.

    used : as the words above say, of the room that the tree's header names.   way : references from the root's box to a
    leaf's.   split, keys : numbers of points or references, and their order.
    """

    tree: TreeView
    points: Any
    floats: Any
    centre: Vec3
    unit: float
    used: Any
    way: Any
    split: Any
    keys: Any


@entry("boolean(int64, int64, int64, int64, int64, int64, int64)")
def change_point_tree(header_at, numbers_at, n_before, first, end, used_at, work_at):
    """Renumber the points of a tree and put points first … end − 1 into leaves; whether room, levels and the range of
    units sufficed: if not, the tree is of no use.

    header : of the copy; its points are those after the change, N_NODES and N_FACETS the room for nodes and places.
    numbers : (n_before,) as of `copy_remaining`; not read where no point is removed.
    used : of the words above before the change, and after.   work : WORK words.
    """
    return change_tree(header_at, numbers_at, n_before, first, end, used_at, work_at)


@kernel
def change_tree(header_at, numbers_at, n_before, first, end, used_at, work_at):
    """As `change_point_tree`."""
    tree = open_tree(header_at)
    patch = _Patch(
        tree, points_of(tree), floats_of(tree), vec3_at(tree.numbers, CENTRE),
        math.ldexp(1.0, int(tree.header[EXPONENT])), view_i64(used_at, 4), view_i64(work_at, _WAY),
        view_i64(work_at + 8 * _WAY, _SPLIT), view_f64(work_at + 8 * (_WAY + _SPLIT), _SPLIT),
    )
    if n_before > first:
        _renumber(patch, view_i32(numbers_at, n_before))
    for number in range(first, end):
        if not _put_in(patch, number):
            return False
    return True


@entry("void(int64, int64, int64, int64, int64, int64)")
def copy_remaining(points_at, n, removed_at, n_removed, to_at, numbers_at):
    """Copy n points but for removed points, and write the new numbers (n,) int32, −1 of removed points.

    removed : (n_removed,) numbers, ascending.   to : room for n − n_removed points.
    """
    points, to = view_f64(points_at, 3 * n), view_f64(to_at, 3 * (n - n_removed))
    removed, numbers = view_i64(removed_at, n_removed), view_i32(numbers_at, n)
    begin = 0
    for k in range(n_removed + 1):
        end = removed[k] if k < n_removed else n
        for i in range(begin, end):
            numbers[i] = i - k
        for i in range(3 * begin, 3 * end):
            to[i - 3 * k] = points[i]
        if end < n:
            numbers[end] = -1
        begin = end + 1


@kernel(inline=True)
def _is_used(patch, ref):
    return patch.tree.boxes[NODE * (ref >> 3) + (ref & 7) + 3 * WIDTH] > NOTHING / 2


@kernel
def _put_link(patch, ref, link):
    """Let a reference lead to a node or a leaf with its box; to nothing where leaf or node are empty."""
    tree = patch.tree
    if link >= 0:
        low, high = box_of_node(tree.boxes, NODE * link)
    else:
        low, high = box_of_points(patch.points, tree.ids, patch.centre, patch.unit, ~link >> 3, ~link & 7)
    at, is_used = NODE * (ref >> 3) + (ref & 7), low.x <= high.x
    put_box(tree.boxes, at, low, high, is_used)
    tree.links[at + 6 * WIDTH] = link if is_used else 0


# --- taking out ---------------------------------------------------------------------------------


@kernel
def _renumber(patch, numbers):
    """Walk through all leaves; boxes above leaves that lose points shrink on the way up."""
    way, level = patch.way, 0
    way[0] = way[1] = way[2] = 0  # of each level the node, its next slot, whether a box changed
    while level >= 0:
        at = 3 * level
        ref = WIDTH * way[at] + way[at + 1]
        if way[at + 1] == WIDTH:
            level -= 1
            if level >= 0 and way[at + 2] != 0:
                above = WIDTH * way[at - 3] + way[at - 2] - 1
                _put_link(patch, above, way[at])
                way[at - 1] = 1
            continue
        way[at + 1] += 1
        if not _is_used(patch, ref):
            continue
        link = link_of(patch.tree.links, ref)
        if link >= 0:
            level += 1
            way[at + 3], way[at + 4], way[at + 5] = link, 0, 0
        elif _renumber_leaf(patch, ref, ~link >> 3, ~link & 7, numbers):
            way[at + 2] = 1


@kernel
def _renumber_leaf(patch, ref, first, count, numbers):
    """Whether a leaf loses points."""
    ids, end = patch.tree.ids, first
    for place in range(first, first + count):
        number = numbers[ids[place]]
        if number >= 0:
            ids[end] = number
            end += 1
    if end == first + count:
        return False
    _end_leaf(patch, ref, first, end)
    return True


@kernel
def _end_leaf(patch, ref, first, end):
    """Let a reference lead to the leaf of the points at places first … end − 1."""
    for place in range(end, first + MAX_LEAF):
        patch.tree.ids[place] = -1
    if end > first:
        put_floats(patch.floats, patch.points, patch.tree.ids, patch.centre, patch.unit, first, end - first)
    _put_link(patch, ref, leaf_link(first, end - first))


# --- putting in ---------------------------------------------------------------------------------


@kernel
def _put_in(patch, number):
    """Whether a point found a place."""
    tree, way = patch.tree, patch.way
    p = place_in_units(patch.points, number, patch.centre, patch.unit)
    if not max_abs(p) < 1.0:  # FLOAT_ERROR counts on it; √3 · (1 − 2⁻⁵³) units are within RADIUS, which is rounded
        return False
    ref, level = 0, 0
    _widen(tree, ref, p)
    while link_of(tree.links, ref) >= 0:
        way[level] = ref
        ref = _slot_growing_least(patch, link_of(tree.links, ref), p)
        _widen(tree, ref, p)
        level += 1
    way[level], run = ref, ~link_of(tree.links, ref)
    first, count = run >> 3, run & 7
    if count == MAX_LEAF:
        return _split_leaf(patch, first, number, level)
    tree.ids[first + count] = number
    put_floats(patch.floats, patch.points, tree.ids, patch.centre, patch.unit, first, count + 1)
    tree.links[NODE * (ref >> 3) + 6 * WIDTH + (ref & 7)] = leaf_link(first, count + 1)
    return True


@kernel
def _slot_growing_least(patch, node, p):
    """The reference of a node's box whose sides grow least to hold a place; of those as good the smallest box."""
    best, least, smallest = WIDTH * node, math.inf, math.inf
    for ref in range(WIDTH * node, WIDTH * node + WIDTH):
        if not _is_used(patch, ref):
            continue
        box = box_at(patch.tree, ref)
        out = sub(absolute(sub(p, box.centre)), box.half)
        growth, size = max(out.x, 0.0) + max(out.y, 0.0) + max(out.z, 0.0), norm1(box.half)
        if growth < least or (growth == least and size < smallest):
            best, least, smallest = ref, growth, size
    return best


@kernel
def _widen(tree, ref, p):
    """Let the box of a reference hold a place. Corners c ± h, |c ± h| < 2, round by 2⁻⁵³ at most: moved out by twice as
    much they hold what the box held, however often a box grows."""
    box = box_at(tree, ref)
    c, h, away = box.centre, box.half, absolute(sub(p, box.centre))
    if away.x <= h.x and away.y <= h.y and away.z <= h.z:
        return
    reach = Vec3(h.x + _CORNER_ERROR, h.y + _CORNER_ERROR, h.z + _CORNER_ERROR)
    low, high = lower_of(sub(c, reach), p), higher_of(Vec3(c.x + reach.x, c.y + reach.y, c.z + reach.z), p)
    put_box(tree.boxes, NODE * (ref >> 3) + (ref & 7), low, high, True)


@kernel
def _sort_split(patch, n):
    """Sort the first n of what is split by their keys."""
    split, keys = patch.split, patch.keys
    for i in range(1, n):
        item, key, j = split[i], keys[i], i
        while j > 0 and keys[j - 1] > key:
            split[j], keys[j] = split[j - 1], keys[j - 1]
            j -= 1
        split[j], keys[j] = item, key


@kernel(inline=True)
def _longest(low, high):
    """The axis of the longest side of a box."""
    side = sub(high, low)
    return 0 if side.x >= max(side.y, side.z) else 1 if side.y >= side.z else 2


@kernel
def _split_leaf(patch, first, number, level):
    """Put a point into a full leaf at the end of a way: half of its points go to a leaf more."""
    ids, split, used = patch.tree.ids, patch.split, patch.used
    new = used[PLACES]
    if new + MAX_LEAF > patch.tree.header[N_FACETS]:
        return False
    used[PLACES] = new + MAX_LEAF
    for i in range(MAX_LEAF):
        split[i] = ids[first + i]
    split[MAX_LEAF] = number
    low = high = place_in_units(patch.points, number, patch.centre, patch.unit)
    for i in range(MAX_LEAF):
        p = place_in_units(patch.points, split[i], patch.centre, patch.unit)
        low, high = lower_of(low, p), higher_of(high, p)
    axis, half = _longest(low, high), (MAX_LEAF + 1) // 2
    for i in range(MAX_LEAF + 1):
        patch.keys[i] = component(vec3_at(patch.points, 3 * split[i]), axis)
    _sort_split(patch, MAX_LEAF + 1)
    for i in range(half):
        ids[first + i], ids[new + i] = split[i], split[half + i]
    _end_leaf(patch, patch.way[level], first, first + half)
    for place in range(new + half, new + MAX_LEAF):
        ids[place] = -1
    put_floats(patch.floats, patch.points, ids, patch.centre, patch.unit, new, half)
    return _add_link(patch, level, leaf_link(new, half))


@kernel
def _add_link(patch, level, link):
    """Put a node or a leaf beside the reference of a way at a level: into a slot without a box, or with a split of the
    node, or, where the node was built, into a node of both in the slot of the reference."""
    tree, used, way, n_levels = patch.tree, patch.used, patch.way, level + 2
    while True:
        ref = way[level]
        node = ref >> 3
        for slot in range(WIDTH if node > 0 else 0):  # the root has a single box
            if not _is_used(patch, WIDTH * node + slot):
                _put_link(patch, WIDTH * node + slot, link)
                return True
        if used[NODES] == tree.header[N_NODES]:
            return False
        if node < used[BUILT]:
            break
        link = _split_node(patch, node, link)
        level -= 1
        _put_link(patch, way[level], node)
    both = _new_node(patch)
    _put_link(patch, WIDTH * both, link_of(tree.links, ref))
    _put_link(patch, WIDTH * both + 1, link)
    _put_link(patch, ref, both)
    used[LEVELS] = max(used[LEVELS], n_levels)
    return n_levels <= MAX_LEVELS


@kernel
def _new_node(patch):
    """A node without boxes."""
    node = patch.used[NODES]
    patch.used[NODES] = node + 1
    for slot in range(WIDTH):
        _put_nothing(patch, WIDTH * node + slot)
    return node


@kernel
def _put_nothing(patch, ref):
    at, zero = NODE * (ref >> 3) + (ref & 7), Vec3(0.0, 0.0, 0.0)
    put_box(patch.tree.boxes, at, zero, zero, False)
    patch.tree.links[at + 6 * WIDTH] = 0


@kernel
def _move(patch, ref, to):
    """Move a box and its link to another place."""
    at, to_at = NODE * (ref >> 3) + (ref & 7), NODE * (to >> 3) + (to & 7)
    for row in range(7):
        patch.tree.links[to_at + WIDTH * row] = patch.tree.links[at + WIDTH * row]
    _put_nothing(patch, ref)


@kernel
def _split_node(patch, node, link):
    """Split the boxes of a full node and a newcomer by their centres; returns the new node, with the newcomer's half.
    """
    tree, split = patch.tree, patch.split
    new = _new_node(patch)
    newcomer = WIDTH * new
    _put_link(patch, newcomer, link)
    low = high = box_at(tree, newcomer).centre
    for slot in range(WIDTH):
        split[slot] = WIDTH * node + slot
        c = box_at(tree, split[slot]).centre
        low, high = lower_of(low, c), higher_of(high, c)
    split[WIDTH] = newcomer
    axis = _longest(low, high)
    for i in range(_SPLIT):
        patch.keys[i] = component(box_at(tree, split[i]).centre, axis)
    _sort_split(patch, _SPLIT)
    half, at = _SPLIT // 2, 0
    while split[at] != newcomer:
        at += 1
    to = newcomer
    for i in range(0 if at < half else half, half if at < half else _SPLIT):
        if i != at:
            to += 1
            _move(patch, split[i], to)
    return new
