"""Trees over the cells of a grid: 64 children a node, bits in the place of boxes, and walks to what is near.

A node of level L covers 4^(L+1) cells along each axis; bit 16 i + 4 j + k of its word stands for the child at i, j,
k, of 4^L cells along each axis. Nodes of level 0 are words alone. Of nodes above, a child whose cells are all
occupied and are one leaf of an octree is *solid*: a bit of a second word, and no node. Cells are boxes whose corners
are fl(fl(i · side) + origin) along each axis, i counted from the grid's own cell 0, so cells side by side share a
face to the last bit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.mesh.bvh import INTS, NUMBERS, NUMBERS_AT
from collide.numerics.vec3 import Vec3, vec3_at

#: Children of a node along an axis, and bits of a coordinate that number them.
SIDE, SIDE_BITS = 4, 2
#: Levels of nodes at most: 2¹⁶ cells along an axis.
MAX_LEVELS = 8
#: Cells along an axis at most.
MAX_CELLS = SIDE**MAX_LEVELS
#: Words of a stack: two for each box that may wait.
STACK = 2 * (64 * MAX_LEVELS + 1)

# Header behind the words of `mesh/bvh.py`: addresses of the nodes' bits, of the solid bits and of the first stored
# children of nodes above level 0; the number of those nodes, which stand first; levels; cells along each axis, and
# indices of the least cell, which cells here are numbered from.
BITS_AT, SOLID_AT, FIRST_AT, N_INNER, N_ALL, LEVELS, CELLS = range(INTS, INTS + 7)
LEAST = CELLS + 3
HEADER = LEAST + 3
# Numbers behind those of `mesh/bvh.py`: origin (3), sides of a cell (3).
ORIGIN, SIDES = NUMBERS, NUMBERS + 3
N_NUMBERS = NUMBERS + 6

# A box of cells as a word: its level, above its least cell's numbers, 16 bits each; of 4^level cells along each axis.
_LEVEL_SHIFT, _X_SHIFT, _Y_SHIFT, _AXIS = 48, 32, 16, 0xFFFF


class CellView(NamedTuple):
    """A tree of cells as kernels see it: words of the header's addresses, and what its numbers say."""

    bits: Any
    solid: Any
    first: Any
    n_inner: int
    levels: int
    nx: int
    ny: int
    nz: int
    least: Any
    origin: Vec3
    sides: Vec3


@kernel(inline=True)
def open_cells(header_at):
    """The tree whose header stands at an address."""
    header = view_i64(header_at, HEADER)
    numbers = view_f64(header[NUMBERS_AT], N_NUMBERS)
    n_inner = header[N_INNER]
    return CellView(
        view_i64(header[BITS_AT], header[N_ALL]), view_i64(header[SOLID_AT], n_inner),
        view_i64(header[FIRST_AT], n_inner), n_inner, header[LEVELS], header[CELLS], header[CELLS + 1],
        header[CELLS + 2], vec3_at(header, LEAST), vec3_at(numbers, ORIGIN), vec3_at(numbers, SIDES),
    )


@kernel(inline=True)
def box_word(level, x, y, z):
    """A box of cells as a word."""
    return level << _LEVEL_SHIFT | x << _X_SHIFT | y << _Y_SHIFT | z


@kernel(inline=True)
def level_of(word):
    return word >> _LEVEL_SHIFT


@kernel(inline=True)
def x_of(word):
    return word >> _X_SHIFT & _AXIS


@kernel(inline=True)
def y_of(word):
    return word >> _Y_SHIFT & _AXIS


@kernel(inline=True)
def z_of(word):
    return word & _AXIS


@kernel(inline=True)
def cells_along(level):
    """Cells along a side of a box of a level."""
    return 1 << (SIDE_BITS * level)


@kernel(inline=True)
def number_of(cells, word):
    """The number of a box's least cell, x slowest."""
    return (x_of(word) * cells.ny + y_of(word)) * cells.nz + z_of(word)


@kernel(inline=True)
def plane_at(origin, side, i):
    """Where the plane before the cells of index i stands along an axis [m]."""
    return float(i) * side + origin


@kernel
def corner_of(cells, x, y, z):
    """The least corner of a cell [m]."""
    least, o, s = cells.least, cells.origin, cells.sides
    return Vec3(
        plane_at(o.x, s.x, least.x + x), plane_at(o.y, s.y, least.y + y), plane_at(o.z, s.z, least.z + z)
    )


@kernel
def low_corner(cells, word):
    """The least corner of a box of cells [m]."""
    return corner_of(cells, x_of(word), y_of(word), z_of(word))


@kernel
def high_corner(cells, word):
    """The largest corner of a box of cells [m]."""
    n = cells_along(level_of(word))
    return corner_of(cells, x_of(word) + n, y_of(word) + n, z_of(word) + n)


@kernel(inline=True)
def is_solid(cells, node, bit):
    """Whether a child whose bit is set is a box without a node."""
    return node >= cells.n_inner or cells.solid[node] >> bit & 1 != 0


@kernel(inline=True)
def _count(word):
    """Bits that are set of 32."""
    word = word - (word >> 1 & 0x55555555)
    word = (word & 0x33333333) + (word >> 2 & 0x33333333)
    word = word + (word >> 4) & 0x0F0F0F0F
    return (word * 0x01010101 & 0xFFFFFFFF) >> 24


@kernel
def child_of(cells, node, bit):
    """The node of a child that is not solid."""
    stored = cells.bits[node] & ~cells.solid[node] & ((1 << bit) - 1)
    return cells.first[node] + _count(stored & 0xFFFFFFFF) + _count(stored >> 32 & 0xFFFFFFFF)


# --- making -------------------------------------------------------------------------------------


@kernel(inline=True)
def _axis_of(key, shift):
    """A node's coordinate along an axis, from its key: six bits a level, two of each axis."""
    x, bit, at = 0, 0, shift
    while bit < 2 * MAX_LEVELS:
        x |= (key >> at & 3) << bit
        bit += SIDE_BITS
        at += 3 * SIDE_BITS
    return x


@kernel(inline=True)
def _four_bits(word):
    """The lowest bits of the four bytes of a word."""
    return word & 1 | word >> 7 & 2 | word >> 14 & 4 | word >> 21 & 8


@kernel
def _whole_word_at(rows, ny, nz, x0, y0, z0):
    """`_word_at` of a node that lies within a grid whose rows of cells are whole words of 32 bits."""
    word = 0
    for i in range(SIDE):
        for j in range(SIDE):
            row = int(rows[(((x0 + i) * ny + y0 + j) * nz + z0) >> SIDE_BITS])
            word |= _four_bits(row) << (16 * i + SIDE * j)
    return word


@kernel
def _word_at(occupied, nx, ny, nz, x0, y0, z0):
    """The bits of the 4 × 4 × 4 cells from a cell on; cells outside of the grid are free."""
    word = 0
    for x in range(x0, min(x0 + SIDE, nx)):
        for y in range(y0, min(y0 + SIDE, ny)):
            at = (x * ny + y) * nz
            row = 0
            for z in range(z0, min(z0 + SIDE, nz)):
                row |= int(occupied[at + z]) << (z - z0)
            word |= row << (16 * (x - x0) + SIDE * (y - y0))
    return word


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def pack_cells(occupied_at, nx, ny, nz, levels, keys_at, words_at):
    """Keys and words of the nodes of level 0 with an occupied cell, by key; returns how many.

    occupied : a byte a cell, 0 or 1, x slowest.   keys, words : room for all nodes of level 0.
    """
    occupied, rows = view_u8(occupied_at, nx * ny * nz), view_i32(occupied_at, nx * ny * nz // SIDE)
    has_whole_rows = nz % SIDE == 0
    n_nodes = -(-nx // SIDE) * -(-ny // SIDE) * -(-nz // SIDE)
    keys, words = view_i64(keys_at, n_nodes), view_i64(words_at, n_nodes)
    n, key, end = 0, 0, 1 << (3 * SIDE_BITS * (levels - 1))
    while key < end:  # 64 nodes at once: those of a node of level 1
        x, y, z = SIDE * _axis_of(key, 4), SIDE * _axis_of(key, 2), SIDE * _axis_of(key, 0)
        if x >= nx or y >= ny or z >= nz:  # the largest node that begins here lies outside
            step = 64
            while key & (64 * step - 1) == 0 and step < end:
                step *= 64
            key += step
            continue
        for child in range(64):
            x0, y0, z0 = x + SIDE * (child >> 4), y + SIDE * (child >> 2 & 3), z + SIDE * (child & 3)
            if x0 >= nx or y0 >= ny or z0 >= nz:
                continue
            if has_whole_rows and x0 + SIDE <= nx and y0 + SIDE <= ny:
                word = _whole_word_at(rows, ny, nz, x0, y0, z0)
            else:
                word = _word_at(occupied, nx, ny, nz, x0, y0, z0)
            if word != 0:
                keys[n], words[n] = key + child, word
                n += 1
        key += 64
    return n


@entry("int64(int64, int64, int64, int64, int64)")
def merge_cells(occupied_at, nx, ny, nz, boxes_at):
    """Boxes with the union of the occupied cells of a block, six numbers each (least cell, cells along each axis);
    returns how many. Cells are marked free on the way.

    Greedy: from the first cell along z, then y, then x as far as all cells remain.   boxes : room for all cells.
    """
    remaining, boxes = view_u8(occupied_at, nx * ny * nz), view_i64(boxes_at, 6 * nx * ny * nz)
    n = 0
    for x in range(nx):
        for y in range(ny):
            for z in range(nz):
                if remaining[(x * ny + y) * nz + z] == 0:
                    continue
                x1, y1, z1 = x + 1, y + 1, z + 1
                while z1 < nz and _all_remain(remaining, ny, nz, x, x1, y, y1, z1, z1 + 1):
                    z1 += 1
                while y1 < ny and _all_remain(remaining, ny, nz, x, x1, y1, y1 + 1, z, z1):
                    y1 += 1
                while x1 < nx and _all_remain(remaining, ny, nz, x1, x1 + 1, y, y1, z, z1):
                    x1 += 1
                for i in range(x, x1):
                    for j in range(y, y1):
                        for k in range(z, z1):
                            remaining[(i * ny + j) * nz + k] = 0
                at = 6 * n
                boxes[at], boxes[at + 1], boxes[at + 2] = x, y, z
                boxes[at + 3], boxes[at + 4], boxes[at + 5] = x1 - x, y1 - y, z1 - z
                n += 1
    return n


@kernel
def _all_remain(remaining, ny, nz, x0, x1, y0, y1, z0, z1):
    for x in range(x0, x1):
        for y in range(y0, y1):
            for z in range(z0, z1):
                if remaining[(x * ny + y) * nz + z] == 0:
                    return False
    return True


# --- walks --------------------------------------------------------------------------------------


@kernel(inline=True)
def root_word(cells):
    return box_word(cells.levels, 0, 0, 0)


@kernel(inline=True)
def child_word(word, bit):
    """The box of a child of the node whose box is ``word``."""
    level = level_of(word) - 1
    n = cells_along(level)
    return box_word(level, x_of(word) + n * (bit >> 4), y_of(word) + n * (bit >> 2 & 3), z_of(word) + n * (bit & 3))


@kernel
def _meets_range(word, low, high, at):
    """Whether a box of cells has cells within a range, both ends included: three numbers each from ``at`` on."""
    n = cells_along(level_of(word)) - 1
    return (
        x_of(word) <= high[at] and x_of(word) + n >= low[at]
        and y_of(word) <= high[at + 1] and y_of(word) + n >= low[at + 1]
        and z_of(word) <= high[at + 2] and z_of(word) + n >= low[at + 2]
    )


@entry("int64(int64, int64, int64, int64, int64, int64)")
def cells_in_range(header_at, low_at, high_at, words_at, capacity, stack_at):
    """Write the first ``capacity`` occupied boxes with cells within a range, as words; returns the number of all.

    low, high : least and largest cell, three integers each, both included.   stack : STACK words.
    """
    cells, words, stack = open_cells(header_at), view_i64(words_at, capacity), view_i64(stack_at, STACK)
    low, high = view_i64(low_at, 3), view_i64(high_at, 3)
    stack[0], stack[1] = root_word(cells), 0
    n, top = 0, 1
    while top > 0:
        top -= 1
        word, node = stack[2 * top], stack[2 * top + 1]
        bits = cells.bits[node]
        for bit in range(64):
            if not bits >> bit & 1:
                continue
            child = child_word(word, bit)
            if not _meets_range(child, low, high, 0):
                continue
            if is_solid(cells, node, bit):
                if n < capacity:
                    words[n] = child
                n += 1
            else:
                stack[2 * top], stack[2 * top + 1] = child, child_of(cells, node, bit)
                top += 1
    return n


@kernel
def _enters(cells, word, way, slack, limit):
    """When a way from a place along a vector enters a box of cells, larger by a slack; ∞ for a way beside the box."""
    low, high, begin, end = low_corner(cells, word), high_corner(cells, word), 0.0, limit
    for axis in range(3):
        l, h = (low.x, high.x) if axis == 0 else (low.y, high.y) if axis == 1 else (low.z, high.z)
        l, h, v = l - slack - way[axis], h + slack - way[axis], way[3 + axis]
        if v == 0.0:
            if l > 0.0 or h < 0.0:
                return math.inf
            continue
        a, b = l / v, h / v
        begin, end = max(begin, min(a, b)), min(end, max(a, b))
    return begin * (1.0 - 2.0**-40) if begin <= end * (1.0 + 2.0**-40) else math.inf


@entry("int64(int64, int64, float64, float64, boolean, int64, int64, int64, int64)")
def cells_on_way(header_at, way_at, slack, limit, first, words_at, times_at, capacity, stack_at):
    """Write the first ``capacity`` occupied boxes on a way, as words, and when the way enters each at the earliest;
    returns the number of all boxes on the way.

    way : place and vector, t from 0 to a limit.   slack : how much larger boxes are [m].   first : whether boxes
    entered after the certain entry into a box may be left out.   stack : STACK words.
    """
    cells, words, times = open_cells(header_at), view_i64(words_at, capacity), view_f64(times_at, capacity)
    way, stack = view_f64(way_at, 6), view_i64(stack_at, STACK)
    stack[0], stack[1] = root_word(cells), 0
    n, top, until = 0, 1, limit
    while top > 0:
        top -= 1
        word, node = stack[2 * top], stack[2 * top + 1]
        if _enters(cells, word, way, slack, until) == math.inf:
            continue
        bits = cells.bits[node]
        for bit in range(64):
            if not bits >> bit & 1:
                continue
            child = child_word(word, bit)
            begin = _enters(cells, child, way, slack, until)
            if begin == math.inf:
                continue
            if not is_solid(cells, node, bit):
                stack[2 * top], stack[2 * top + 1] = child, child_of(cells, node, bit)
                top += 1
                continue
            if first and begin > 0.0:
                until = min(until, _enters(cells, child, way, -slack, until) * (1.0 + 2.0**-38))
            if n < capacity:
                words[n], times[n] = child, begin
            n += 1
    return n


@kernel
def _least_height(cells, word, n):
    """Of the corners of a box of cells along a normal [m]."""
    low, high = low_corner(cells, word), high_corner(cells, word)
    return min(n.x * low.x, n.x * high.x) + min(n.y * low.y, n.y * high.y) + min(n.z * low.z, n.z * high.z)


@entry("int64(int64, int64, float64, int64, int64, int64, int64)")
def lowest_cells(header_at, normal_at, slack, words_at, heights_at, capacity, stack_at):
    """Write the first ``capacity`` of some occupied boxes, as words, and their least heights along a normal; returns
    their number. All boxes higher than the lowest by no more than a slack [m] are among them.   stack : STACK words.
    """
    cells, words, heights = open_cells(header_at), view_i64(words_at, capacity), view_f64(heights_at, capacity)
    normal, stack = vec3_at(view_f64(normal_at, 3), 0), view_i64(stack_at, STACK)
    lowest_bit = (0x30 if normal.x < 0.0 else 0) | (0x0C if normal.y < 0.0 else 0) | (0x03 if normal.z < 0.0 else 0)
    stack[0], stack[1] = root_word(cells), 0
    n, top, least = 0, 1, math.inf
    while top > 0:
        top -= 1
        word, node = stack[2 * top], stack[2 * top + 1]
        if _least_height(cells, word, normal) > least + slack:
            continue
        bits = cells.bits[node]
        for k in range(63, -1, -1):
            bit = k ^ lowest_bit
            if not bits >> bit & 1:
                continue
            child = child_word(word, bit)
            height = _least_height(cells, child, normal)
            if height > least + slack:
                continue
            if not is_solid(cells, node, bit):
                stack[2 * top], stack[2 * top + 1] = child, child_of(cells, node, bit)
                top += 1
                continue
            least = min(least, height)
            if n < capacity:
                words[n], heights[n] = child, height
            n += 1
    return n
