"""Walks to the items nearest to a shape: down trees of facets, of points and of cells, and over blocks of terrain.

Items are taken nearest first, by the gaps between boxes along their axes and along the normal of the nearest item so
far; what is farther than the least upper bound is left out, and an item that meets the shape ends the walk. The bracket
of the whole is the least of the items'.
"""

from __future__ import annotations

import math

from collide.fields.cell_tree_kernel import (
    box_word,
    cells_along,
    child_of,
    is_solid,
    level_of,
    open_cells,
    plane_at,
    root_word,
    x_of,
    y_of,
    z_of,
)
from collide.fields.terrain_kernel import (
    ALONG,
    blocks_within,
    box_of_cells,
    open_terrain,
    top_of_cell,
)
from collide.kernels import kernel, view_f64, view_i64
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    NODE,
    NOTHING,
    WIDTH,
    box_at,
    float_column_at,
    link_of,
)
from collide.narrowphase.facets.item_questions import (
    BOUNDS_AT,
    CELLS,
    ITEMS_ARE,
    PRISMS,
    STACK_AT,
    TREE_AT,
    begin_nearest,
    box_of_item,
    gap_of_box,
    with_item,
)
from collide.numerics.vec3 import (
    Vec3,
    scale,
    vec3_at,
)


@kernel
def _push_children(walk, nearest, node, top):
    """Put what may be near enough of a node's boxes on the stack, the nearest on top; returns its height."""
    tree = walk.tree
    stack, bounds = view_i64(walk.words[STACK_AT], top + WIDTH), view_f64(walk.words[BOUNDS_AT], top + WIDTH)
    unit = math.ldexp(1.0, int(tree.header[EXPONENT]))
    middle = vec3_at(tree.numbers, CENTRE)
    first = top
    for slot in range(WIDTH):
        at = NODE * node + slot
        half = float_column_at(tree.boxes, at + 3 * WIDTH)
        if not half.x > NOTHING / 2:
            continue
        centre = box_at(tree, WIDTH * node + slot).centre
        centre = Vec3(middle.x + unit * centre.x, middle.y + unit * centre.y, middle.z + unit * centre.z)
        bound = gap_of_box(walk, nearest, centre, scale(unit, half))
        if bound > nearest.limit:
            continue
        k = top
        while k > first and bounds[k - 1] < bound:
            bounds[k] = bounds[k - 1]
            stack[k] = stack[k - 1]
            k -= 1
        bounds[k] = bound
        stack[k] = 8 * node + slot
        top += 1
    return top


@kernel(inline=True)
def _gap_along(walk_low, walk_high, low, high):
    return max(low - walk_high, walk_low - high, 0.0)


@kernel
def _push_cells(walk, nearest, word, node, top):
    """`_push_children` of a node of a tree of cells, the box of which is ``word``; two words a place on the stack."""
    cells = open_cells(walk.words[TREE_AT])
    stack, bounds = view_i64(walk.words[STACK_AT], 2 * (top + 64)), view_f64(walk.words[BOUNDS_AT], top + 64)
    level, bits, first = level_of(word) - 1, cells.bits[node], top
    n, reach = cells_along(level), nearest.limit + walk.slack
    least, o, s, low, high = cells.least, cells.origin, cells.sides, walk.low, walk.high
    for i in range(4):
        x = x_of(word) + n * i
        lx, hx = plane_at(o.x, s.x, least.x + x), plane_at(o.x, s.x, least.x + x + n)
        if bits >> (16 * i) & 0xFFFF == 0 or _gap_along(low.x, high.x, lx, hx) > reach:
            continue
        for j in range(4):
            y, row = y_of(word) + n * j, bits >> (16 * i + 4 * j) & 15
            ly, hy = plane_at(o.y, s.y, least.y + y), plane_at(o.y, s.y, least.y + y + n)
            if row == 0 or _gap_along(low.y, high.y, ly, hy) > reach:
                continue
            for k in range(4):
                if row >> k & 1 == 0:
                    continue
                z, bit = z_of(word) + n * k, 16 * i + 4 * j + k
                lz, hz = plane_at(o.z, s.z, least.z + z), plane_at(o.z, s.z, least.z + z + n)
                centre = scale(0.5, Vec3(lx + hx, ly + hy, lz + hz))
                bound = gap_of_box(walk, nearest, centre, scale(0.5, Vec3(hx - lx, hy - ly, hz - lz)))
                if bound > nearest.limit:
                    continue
                at = top
                while at > first and bounds[at - 1] < bound:
                    bounds[at], stack[2 * at], stack[2 * at + 1] = (
                        bounds[at - 1], stack[2 * at - 2], stack[2 * at - 1]
                    )
                    at -= 1
                bounds[at], stack[2 * at] = bound, box_word(level, x, y, z)
                stack[2 * at + 1] = -1 if is_solid(cells, node, bit) else child_of(cells, node, bit)
                top += 1
    return top


@kernel
def _walk_cells(walk, limit, enough, max_asked):
    """`walk_down` of a tree of cells: the place of an item is the word of its box."""
    words = walk.words
    nearest = begin_nearest(limit)
    top = _push_cells(walk, nearest, root_word(open_cells(words[TREE_AT])), 0, 0)
    while top > 0 and not nearest.failed and nearest.lower > enough and nearest.n_asked <= max_asked:
        top -= 1
        if view_f64(words[BOUNDS_AT], top + 1)[top] > nearest.limit:
            continue
        stack = view_i64(words[STACK_AT], 2 * top + 2)
        word, node = stack[2 * top], stack[2 * top + 1]
        if node < 0:
            nearest = with_item(walk, nearest, word, limit)
        else:
            top = _push_cells(walk, nearest, word, node, top)
    return nearest


@kernel
def _walk_block(walk, nearest, row, column, limit, enough, max_asked):
    """The `Nearest` with the prisms of a block of terrain, by its number along each axis."""
    terrain = open_terrain(walk.words[TREE_AT])
    bounds = box_of_cells(terrain, ALONG * row, ALONG * column, ALONG, terrain.tops[row * terrain.n_across + column])
    if not bounds.half.z >= 0.0 or gap_of_box(walk, nearest, bounds.centre, bounds.half) > nearest.limit:
        return nearest
    for i in range(ALONG * row, min(ALONG * (row + 1), terrain.rows)):
        for j in range(ALONG * column, min(ALONG * (column + 1), terrain.columns)):
            bounds = box_of_cells(terrain, i, j, 1, top_of_cell(terrain, i, j))
            if not bounds.half.z >= 0.0 or gap_of_box(walk, nearest, bounds.centre, bounds.half) > nearest.limit:
                continue
            for triangle in range(2):
                if nearest.failed or nearest.lower <= enough or nearest.n_asked > max_asked:
                    return nearest
                nearest = with_item(walk, nearest, 2 * (i * terrain.columns + j) + triangle, limit)
    return nearest


@kernel
def _walk_terrain(walk, limit, enough, max_asked):
    """`walk_down` of terrain: the blocks below the shape, then, for the least bound so far, the blocks around; blocks
    without a bound are looked at one after another.
    """
    terrain = open_terrain(walk.words[TREE_AT])
    nearest = begin_nearest(limit)
    inner = blocks_within(terrain, walk.low, walk.high, 0.0)
    for row in range(inner.row, inner.last_row + 1):
        for column in range(inner.column, inner.last_column + 1):
            nearest = _walk_block(walk, nearest, row, column, limit, enough, max_asked)
    outer = blocks_within(terrain, walk.low, walk.high, max(nearest.limit, 0.0) + walk.slack)
    for row in range(outer.row, outer.last_row + 1):
        for column in range(outer.column, outer.last_column + 1):
            is_below = inner.row <= row <= inner.last_row and inner.column <= column <= inner.last_column
            if not is_below and not (nearest.failed or nearest.lower <= enough or nearest.n_asked > max_asked):
                nearest = _walk_block(walk, nearest, row, column, limit, enough, max_asked)
    return nearest


@kernel
def walk_down(walk, limit, enough, max_asked):
    """The `Nearest` of all items that may be nearest, and no farther than a limit [m].

    enough : a lower bound of no more than this ends the walk [m].   max_asked : the walk is given up after so many
    items; `n_asked` is then larger.
    """
    tree, words = walk.tree, walk.words
    if words[ITEMS_ARE] == CELLS:
        return _walk_cells(walk, limit, enough, max_asked)
    if words[ITEMS_ARE] == PRISMS:
        return _walk_terrain(walk, limit, enough, max_asked)
    nearest = begin_nearest(limit)
    top = _push_children(walk, nearest, 0, 0)
    while top > 0 and not nearest.failed and nearest.lower > enough and nearest.n_asked <= max_asked:
        top -= 1
        if view_f64(words[BOUNDS_AT], top + 1)[top] > nearest.limit:
            continue
        link = link_of(tree.links, view_i64(words[STACK_AT], top + 1)[top])
        if link >= 0:
            top = _push_children(walk, nearest, link, top)
            continue
        run = ~link
        for place in range(run >> 3, (run >> 3) + (run & 7)):
            centre, half = box_of_item(walk, place)
            if not (nearest.failed or gap_of_box(walk, nearest, centre, half) > nearest.limit):
                nearest = with_item(walk, nearest, place, limit)
    return nearest


@kernel
def places_within(walk, limit, capacity, places):
    """The number of the facets whose boxes may come within a limit [m]; their places, of no more than ``capacity``."""
    tree, words = walk.tree, walk.words
    nearest = begin_nearest(limit)
    n, top = 0, _push_children(walk, nearest, 0, 0)
    while top > 0 and n <= capacity:
        top -= 1
        link = link_of(tree.links, view_i64(words[STACK_AT], top + 1)[top])
        if link >= 0:
            top = _push_children(walk, nearest, link, top)
            continue
        run = ~link
        for place in range(run >> 3, (run >> 3) + (run & 7)):
            centre, half = box_of_item(walk, place)
            if not gap_of_box(walk, nearest, centre, half) > limit:
                if n < capacity:
                    places[n] = place
                n += 1
    return n
