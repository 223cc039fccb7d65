"""Rays through a box-tree of posed parts: which parts may be the first that a ray meets.

Boxes are opened nearest first; a chord that is proven bounds how far it is worth looking. What comes of the candidates
is worked out by `ray_parts.py`, and by `ray_facets.py` for meshes.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.broadphase.boxes_ahead import downwards, slab_entry, upwards
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
from collide.casts.ray_chords import MET, MISSED
from collide.casts.silhouette import CAST_INTEGERS
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.narrowphase.posed_pair import Tables

#: Nodes that may wait: one a level, and some.
_STACK = 128
#: Doubles and integers of workspace: of a chord, its row, and of the nodes that wait.
TREE_RAY_DOUBLES = RAY_DOUBLES + RAY_ROW + _STACK + 3
TREE_RAY_INTEGERS = CAST_INTEGERS + _STACK

# Integers of a tree of parts in memory.
NODES_AT, LEAVES, ORDER_AT, N_ORDER, FIRST_AT, N_BODIES, SKIPPED_AT, MESHED_AT = range(8)
TREE_OF_PARTS = 8


class _Tree(NamedTuple):
    """A box-tree over bodies.   first : the first part of each body, and the number of all.
    skipped, meshed : 1 of bodies that are not asked, and of those whose parts are only bounds.
    """

    nodes: Any
    leaves: int
    order: Any
    first: Any
    skipped: Any
    meshed: Any


class _Walk(NamedTuple):
    """One ray on its way.

    inverse : of its direction, component by component; infinite of 0.
    stack, keys : nodes that wait, and where it comes to their boxes.   row : of a chord.
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
        view_f64(header[NODES_AT], 12 * header[LEAVES]), header[LEAVES], view_i64(header[ORDER_AT], header[N_ORDER]),
        view_i64(header[FIRST_AT], n + 1), view_i64(header[SKIPPED_AT], n), view_i64(header[MESHED_AT], n),
    )  # fmt: skip


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
def _push_children(tree, walk, node, top, best):
    """Put the children that the ray comes to onto the stack, the nearer one on top."""
    near, far = 2 * node, 2 * node + 1
    near_key = _entry_of(tree, near, walk.ray, walk.inverse, best)
    far_key = _entry_of(tree, far, walk.ray, walk.inverse, best)
    if far_key < near_key:
        near, far, near_key, far_key = far, near, far_key, near_key
    if far_key < math.inf:
        walk.stack[top] = far
        walk.keys[top] = far_key
        top += 1
    if near_key < math.inf:
        walk.stack[top] = near
        walk.keys[top] = near_key
        top += 1
    return top


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, boolean, int64, int64, int64, int64)")
def parts_on_rays(
    ints_at, numbers_at, poses_at, shape_of_at, tree_at, rays_at, limits_at, n, every, pairs_at, capacity, doubles_at,
    integers_at,
):  # fmt: skip
    """Pairs (ray, part) that may make the first wall of n rays, or any; returns how many there are.

    ints, numbers, poses, shape_of : as of `cut_parts`.   tree : TREE_OF_PARTS integers.   rays : RAY doubles each.
    limits : a double each, of t.   every : look at all walls up to the limit.
    pairs : out, the first ``capacity`` of them; of bodies that are meshes or hold one all parts, where their box is.
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
        )  # fmt: skip
        best = limits[k]
        top = 0
        for axis in range(3):
            walk.inverse[axis] = 1.0 / walk.ray[3 + axis] if walk.ray[3 + axis] != 0.0 else math.inf
        if _entry_of(tree, 1, walk.ray, walk.inverse, best) < math.inf:
            walk.stack[0] = 1
            walk.keys[0] = 0.0
            top = 1
        while top > 0:
            top -= 1
            node = walk.stack[top]
            if walk.keys[top] > best:
                continue
            if node < tree.leaves:
                top = _push_children(tree, walk, node, top, best)
                continue
            body = tree.order[node - tree.leaves]
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
