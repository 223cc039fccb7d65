"""Rays through a box-tree of posed parts: the parts a ray may meet first.

Boxes are opened nearest first; a proven chord bounds how far the search goes. `ray_parts.py` decides the candidates,
`ray_facets.py` meshes among them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.broadphase.boxes_ahead import downwards, slab_entry, upwards
from collide.broadphase.graded_boxes import BODY, LINK, MAX_CHILDREN, MAX_DEPTH, SKIP
from collide.casts.cut_parts import (
    FIRST_LOWER,
    FIRST_UPPER,
    LAST_LOWER,
    LAST_UPPER,
    RAY,
    RAY_DOUBLES,
    RAY_ROW,
    STATE,
    cut_part,
)
from collide.casts.silhouette import CAST_INTEGERS
from collide.curved.chords import MET, MISSED
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.narrowphase.posed_pair import Tables

#: Nodes that may wait: all children of a node but one, at every level.
_STACK = MAX_CHILDREN * MAX_DEPTH
#: Doubles and integers of workspace: of a chord, its row, and of the nodes that wait.
TREE_RAY_DOUBLES = RAY_DOUBLES + RAY_ROW + _STACK + 3
TREE_RAY_INTEGERS = CAST_INTEGERS + _STACK

# Integers of a tree of parts in memory.
NODES_AT, LINKS_AT, N_NODES, FIRST_AT, N_BODIES, SKIPPED_AT, MESHED_AT = range(7)
TREE_OF_PARTS = 7


class _Tree(NamedTuple):
    """Box-trees over bodies in a row, as of `graded_boxes.py`.   first : the first part of each body, and the number of
    all.
    skipped, meshed : 1 of bodies not asked, and of bodies whose parts are only bounds.
    """

    nodes: Any
    links: Any
    n_nodes: int
    first: Any
    skipped: Any
    meshed: Any


class _Walk(NamedTuple):
    """A ray on its way.

    inverse : of its direction, component by component; infinite of 0.
    stack, keys : waiting nodes, and t of the entry into their boxes.   row : of a chord.
    """

    ray: Any
    inverse: Any
    stack: Any
    keys: Any
    row: Any
    doubles_at: int
    integers_at: int


@kernel(inline=True)
def _tree_at(header_at):
    header = view_i64(header_at, TREE_OF_PARTS)
    n = header[N_BODIES]
    return _Tree(
        view_f64(header[NODES_AT], 6 * header[N_NODES]), view_i64(header[LINKS_AT], LINK * header[N_NODES]),
        header[N_NODES], view_i64(header[FIRST_AT], n + 1), view_i64(header[SKIPPED_AT], n),
        view_i64(header[MESHED_AT], n),
    )


@kernel(inline=True)
def _entry_of(tree, node, ray, inverse, best):
    """Where the ray comes to the box of a node, from below; infinite where it does not before ``best``."""
    first = 0.0
    last = best
    for axis in range(3):
        low = tree.nodes[6 * node + axis] - ray[axis]
        high = tree.nodes[6 * node + 3 + axis] - ray[axis]
        first, last = slab_entry(downwards(low), upwards(high), inverse[axis], first, last)
    return first if first <= last else math.inf


@kernel(inline=True)
def _nearest_wall(row, best):
    """The least t that bounds the first wall of a row from above, or ``best``."""
    if row[STATE] != MET:
        return best
    if row[FIRST_LOWER] >= 0.0:
        return min(best, row[FIRST_UPPER])
    return min(best, row[LAST_UPPER]) if row[LAST_LOWER] >= 0.0 else best


@kernel(inline=True)
def _push_met(tree, walk, node, end, top, best):
    """Put a node and its following siblings up to ``end`` onto the stack where the ray enters their boxes, the nearest
    on top. Returns its new height.
    """
    count = 0
    while node < end:
        key = _entry_of(tree, node, walk.ray, walk.inverse, best)
        if key < math.inf:
            k = count
            while k > 0 and walk.keys[top + k - 1] < key:
                walk.stack[top + k] = walk.stack[top + k - 1]
                walk.keys[top + k] = walk.keys[top + k - 1]
                k -= 1
            walk.stack[top + k] = node
            walk.keys[top + k] = key
            count += 1
        node = tree.links[LINK * node + SKIP]
    return top + count


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, int64, int64, int64, int64)")
def parts_on_rays(
    ints_at, numbers_at, poses_at, shape_of_at, tree_at, rays_at, limits_at, n, every, pairs_at, capacity, doubles_at,
    integers_at,
):
    """Pairs (ray, part) with the possible first walls of n rays, or all walls; returns their number.

    ints, numbers, poses, shape_of : as of `cut_parts`.   tree : TREE_OF_PARTS integers.   rays : RAY doubles each.
    limits : a double each, of t.   every : look at all walls up to the limit.
    pairs : out, the first ``capacity``; of bodies with meshes all parts whose box is met.
    """
    tree = _tree_at(tree_at)
    tables = Tables(ints_at, numbers_at, poses_at, shape_of_at)
    limits = view_f64(limits_at, n)
    pairs = view_i64(pairs_at, 2 * capacity)
    count = 0
    for k in range(n):
        walk = _Walk(
            view_f64(rays_at + 8 * RAY * k, RAY),
            view_f64(doubles_at + 8 * (RAY_DOUBLES + RAY_ROW + _STACK), 3),
            view_i64(integers_at + 8 * CAST_INTEGERS, _STACK),
            view_f64(doubles_at + 8 * (RAY_DOUBLES + RAY_ROW), _STACK), view_f64(doubles_at + 8 * RAY_DOUBLES, RAY_ROW),
            doubles_at, integers_at,
        )
        best = limits[k]
        for axis in range(3):
            walk.inverse[axis] = 1.0 / walk.ray[3 + axis] if walk.ray[3 + axis] != 0.0 else math.inf
        top = _push_met(tree, walk, 0, tree.n_nodes, 0, best)
        while top > 0:
            top -= 1
            node = walk.stack[top]
            if walk.keys[top] > best:
                continue
            body = tree.links[LINK * node + BODY]
            if body < 0:
                top = _push_met(tree, walk, node + 1, tree.links[LINK * node + SKIP], top, best)
                continue
            if tree.skipped[body] != 0:
                continue
            for part in range(tree.first[body], tree.first[body + 1]):
                if tree.meshed[body] == 0:
                    cut_part(tables, part, walk.ray, every, walk.row, doubles_at, integers_at)
                    if walk.row[STATE] == MISSED or walk.row[FIRST_LOWER] > best or walk.row[LAST_UPPER] < 0.0:
                        continue
                    if not every:
                        best = _nearest_wall(walk.row, best)
                if count < capacity:
                    pairs[2 * count] = k
                    pairs[2 * count + 1] = part
                count += 1
    return count
