"""Rays through a box-tree of posed parts: the first wall on a ray, or the parts a ray may meet first.

Boxes are opened nearest first; a proven chord bounds how far the search goes. A first wall nearer than all others by
their brackets is the answer; else `ray_parts.py` decides between the candidates, `ray_facets.py` meshes among them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.broadphase.boxes_ahead import downwards, slab_entry, upwards
from collide.broadphase.graded_boxes import BODY, LINK, MAX_CHILDREN, MAX_DEPTH, SKIP
from collide.casts.cut_parts import (
    FIRST,
    FIRST_LOWER,
    FIRST_NORMAL,
    FIRST_SIDE,
    FIRST_UPPER,
    LAST_LOWER,
    LAST_UPPER,
    MAX_WIDTH,
    RAY,
    RAY_DOUBLES,
    RAY_ROW,
    STATE,
    cut_part,
)
from collide.casts.ray_hits import WORLD_HIT_DTYPE
from collide.casts.silhouette import CAST_INTEGERS
from collide.curved.chords import MET, MISSED
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.narrowphase.posed_pair import Tables
from collide.numerics.vec3 import put_vec3, vec3_at

#: Nodes that may wait: all children of a node but one, at every level.
_STACK = MAX_CHILDREN * MAX_DEPTH
# Doubles of the first wall so far: its bracket and value, t in units of the ray's vector; side, normal; body and part;
# and the least t at which any other wall may be.
_WALL_LOWER, _WALL, _WALL_UPPER, _WALL_SIDE, _WALL_NORMAL, _WALL_BODY, _WALL_PART, _NEXT_LOWER = 0, 1, 2, 3, 4, 7, 8, 9
_WALL_DOUBLES = 10
#: Doubles and integers of workspace: of a chord, its row, of the nodes that wait, and of a wall.
TREE_RAY_DOUBLES = RAY_DOUBLES + RAY_ROW + _STACK + 3 + _WALL_DOUBLES
TREE_RAY_INTEGERS = CAST_INTEGERS + _STACK

# Integers of a tree of parts in memory; the last two: bodies without a box.
NODES_AT, LINKS_AT, N_NODES, FIRST_AT, N_BODIES, SKIPPED_AT, MESHED_AT, UNBOUNDED_AT, N_UNBOUNDED = range(9)
TREE_OF_PARTS = 9

# A row of `WORLD_HIT_DTYPE`: doubles, 32-bit integers, bytes.
_OFFSETS = {name: place[1] for name, place in (WORLD_HIT_DTYPE.fields or {}).items()}
_DISTANCE, _LOWER, _UPPER, _NORMAL, _POINT = (
    _OFFSETS[name] // 8 for name in ("distance", "lower", "upper", "normal", "point")
)
_RAY, _BODY, _ITEM, _FACET = (_OFFSETS[name] // 4 for name in ("ray", "body", "item", "facet"))
_HIT, _CERTIFIED = _OFFSETS["hit"], _OFFSETS["certified"]
HIT_ROW = WORLD_HIT_DTYPE.itemsize


class _Tree(NamedTuple):
    """Box-trees over bodies in a row, as of `graded_boxes.py`.

    first : the first part of each body, and the number of all.
    skipped, meshed : 1 of bodies not asked, and of bodies whose parts are only bounds.
    unbounded : bodies without a box.
    """

    nodes: Any
    links: Any
    n_nodes: int
    first: Any
    skipped: Any
    meshed: Any
    unbounded: Any


class _Walk(NamedTuple):
    """A ray on its way.

    inverse : of its direction, component by component; infinite of 0.
    stack, keys : waiting nodes, and t of the entry into their boxes.   row : of a chord.   wall : the first so far.
    """

    ray: Any
    inverse: Any
    stack: Any
    keys: Any
    row: Any
    wall: Any
    doubles_at: int
    integers_at: int


class _Listed(NamedTuple):
    """Pairs (ray, part), the first ``capacity``.   every : all walls count, not only the first."""

    pairs: Any
    capacity: int
    every: bool


@kernel(inline=True)
def _tree_at(header_at):
    header = view_i64(header_at, TREE_OF_PARTS)
    n = header[N_BODIES]
    return _Tree(
        view_f64(header[NODES_AT], 6 * header[N_NODES]), view_i64(header[LINKS_AT], LINK * header[N_NODES]),
        header[N_NODES], view_i64(header[FIRST_AT], n + 1), view_i64(header[SKIPPED_AT], n),
        view_i64(header[MESHED_AT], n), view_i64(header[UNBOUNDED_AT], header[N_UNBOUNDED]),
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


@kernel(inline=True)
def _open_walk(ray_at, doubles_at, integers_at):
    """A ray at its origin, with no wall met."""
    keys_at = doubles_at + 8 * (RAY_DOUBLES + RAY_ROW)
    walk = _Walk(
        view_f64(ray_at, RAY), view_f64(keys_at + 8 * _STACK, 3), view_i64(integers_at + 8 * CAST_INTEGERS, _STACK),
        view_f64(keys_at, _STACK), view_f64(doubles_at + 8 * RAY_DOUBLES, RAY_ROW),
        view_f64(keys_at + 8 * (_STACK + 3), _WALL_DOUBLES), doubles_at, integers_at,
    )
    for axis in range(3):
        walk.inverse[axis] = 1.0 / walk.ray[3 + axis] if walk.ray[3 + axis] != 0.0 else math.inf
    walk.wall[_WALL_LOWER] = walk.wall[_WALL_UPPER] = walk.wall[_NEXT_LOWER] = math.inf
    return walk


@kernel
def _take_ends(row, body, part, limit, wall):
    """Take both ends of a chord into account for the first wall of a ray.

    A chord with an end that doubles leave open (behind the origin or beyond the limit, or not; or bracketed too widely)
    has no wall, and keeps others from being the first unless they are nearer than its brackets begin.
    """
    far = 0.0
    for end in range(2):
        value = row[FIRST + 3 * end]
        if math.isfinite(value):
            far = max(far, abs(value))
    is_open = False
    for end in range(2):
        lower, upper = row[FIRST_LOWER + 3 * end], row[FIRST_UPPER + 3 * end]
        is_wide = math.isfinite(lower) and math.isfinite(upper) and not upper - lower <= MAX_WIDTH * far
        is_open = is_open or (upper >= 0.0 and lower <= limit and (lower <= 0.0 or upper > limit or is_wide))
    if row[STATE] != MET:
        wall[_NEXT_LOWER] = -math.inf
    for end in range(2):
        lower, value, upper = row[FIRST_LOWER + 3 * end], row[FIRST + 3 * end], row[FIRST_UPPER + 3 * end]
        if not (upper >= 0.0 and lower <= limit):
            continue
        if is_open or (math.isfinite(value) and not upper < wall[_WALL_UPPER]):
            wall[_NEXT_LOWER] = min(wall[_NEXT_LOWER], lower)
        elif math.isfinite(value):
            wall[_NEXT_LOWER] = min(wall[_NEXT_LOWER], wall[_WALL_LOWER])
            wall[_WALL_LOWER], wall[_WALL], wall[_WALL_UPPER] = lower, value, upper
            wall[_WALL_SIDE] = row[FIRST_SIDE + end]
            put_vec3(wall, _WALL_NORMAL, vec3_at(row, FIRST_NORMAL + 3 * end))
            wall[_WALL_BODY], wall[_WALL_PART] = body, part


@kernel(inline=True)
def _look_at_body(tree, tables, walk, body, k, limit, best, listed, count):
    """Cut the parts of a body with ray k; returns the least t that bounds the first wall, and how many pairs are
    listed."""
    for part in range(tree.first[body], tree.first[body + 1]):
        if tree.meshed[body] == 0:
            cut_part(tables, part, walk.ray, listed.every, walk.row, walk.doubles_at, walk.integers_at)
            if walk.row[STATE] == MISSED or walk.row[FIRST_LOWER] > best or walk.row[LAST_UPPER] < 0.0:
                continue
            if not listed.every:
                best = _nearest_wall(walk.row, best)
                _take_ends(walk.row, body, part, limit, walk.wall)
        if count < listed.capacity:
            listed.pairs[2 * count] = k
            listed.pairs[2 * count + 1] = part
        count += 1
    return best, count


@kernel
def _walk_ray(tree, tables, walk, k, limit, listed, count):
    """List the parts that ray k may meet first, or any, from ``count`` on; returns how many are listed then."""
    best = limit
    for i in range(len(tree.unbounded)):
        if tree.skipped[tree.unbounded[i]] == 0:
            best, count = _look_at_body(tree, tables, walk, tree.unbounded[i], k, limit, best, listed, count)
            if tree.meshed[tree.unbounded[i]] != 0:
                walk.wall[_NEXT_LOWER] = -math.inf
    top = _push_met(tree, walk, 0, tree.n_nodes, 0, best)
    while top > 0:
        top -= 1
        node = walk.stack[top]
        if walk.keys[top] > best:
            continue
        body = tree.links[LINK * node + BODY]
        if body < 0:
            top = _push_met(tree, walk, node + 1, tree.links[LINK * node + SKIP], top, best)
        elif tree.skipped[body] == 0:
            if tree.meshed[body] != 0:  # no nearer than its box
                walk.wall[_NEXT_LOWER] = min(walk.wall[_NEXT_LOWER], walk.keys[top])
            best, count = _look_at_body(tree, tables, walk, body, k, limit, best, listed, count)
    return count


@kernel
def _put_row(tree, walk, k, exponent, row_at):
    """Write the row of ray k, if its first wall, or that nothing is met, is proven; returns whether.

    A wall is the first where its bracket ends before the bracket of any other begins.   exponent : of the ray's vector.
    """
    wall, ray = walk.wall, walk.ray
    doubles, integers, flags = view_f64(row_at, HIT_ROW // 8), view_i32(row_at, HIT_ROW // 4), view_u8(row_at, HIT_ROW)
    for i in range(HIT_ROW // 8):
        doubles[i] = 0.0
    integers[_RAY] = k
    integers[_BODY] = integers[_ITEM] = integers[_FACET] = -1
    doubles[_DISTANCE] = doubles[_LOWER] = doubles[_UPPER] = math.inf
    flags[_CERTIFIED] = 1
    if wall[_WALL_UPPER] == math.inf:
        return wall[_NEXT_LOWER] == math.inf
    if not wall[_WALL_UPPER] < wall[_NEXT_LOWER]:
        return False
    body, part = int(wall[_WALL_BODY]), int(wall[_WALL_PART])
    for i, t in ((_DISTANCE, wall[_WALL]), (_LOWER, wall[_WALL_LOWER]), (_UPPER, wall[_WALL_UPPER])):
        doubles[i] = math.ldexp(t, -exponent)
    put_vec3(doubles, _NORMAL, vec3_at(wall, _WALL_NORMAL))
    for axis in range(3):
        doubles[_POINT + axis] = ray[axis] + doubles[_DISTANCE] * math.ldexp(ray[3 + axis], exponent)
    integers[_BODY], integers[_ITEM], integers[_FACET] = body, part - tree.first[body], int(wall[_WALL_SIDE])
    flags[_HIT] = 1
    return True


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def parts_on_rays(
    ints_at, numbers_at, poses_at, shape_of_at, tree_at, rays_at, limits_at, exponents_at, n, rows_at, pairs_at,
    capacity, doubles_at, integers_at,
):
    """Rows of n rays with a proven first wall, or none; of the others pairs (ray, part) with the possible first walls.
    Returns the number of pairs.

    ints, numbers, poses, shape_of : as of `cut_parts`.   tree : TREE_OF_PARTS integers.   rays : RAY doubles each.
    limits : a double each, of t.   exponents : an integer each, of the rays' vectors.
    rows : n rows of `WORLD_HIT_DTYPE`, out, the body a position; or 0: all walls up to the limit are asked for.
    pairs : out, the first ``capacity``; of bodies with meshes all parts whose box is met.
    """
    tree = _tree_at(tree_at)
    tables = Tables(ints_at, numbers_at, poses_at, shape_of_at)
    limits, exponents = view_f64(limits_at, n), view_i64(exponents_at, n)
    listed = _Listed(view_i64(pairs_at, 2 * capacity), capacity, rows_at == 0)
    count = 0
    for k in range(n):
        walk = _open_walk(rays_at + 8 * RAY * k, doubles_at, integers_at)
        end = _walk_ray(tree, tables, walk, k, limits[k], listed, count)
        if rows_at == 0 or not _put_row(tree, walk, k, int(exponents[k]), rows_at + HIT_ROW * k):
            count = end
    return count
