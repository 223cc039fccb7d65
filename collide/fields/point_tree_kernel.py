"""Trees over points: sorted along a curve, seven to a leaf, boxes bottom up, and walks to what is near a place.

The curve is D. Hilbert's over a grid of 2¹⁰ cells a side, each of 2⁶ a side by interleaved bits; cells are sorted by
counting. Boxes of leaves have half the area of those along interleaved bits alone, and a tree of medians, with boxes as
small, takes twice as long to build. Nodes are those of meshes' trees (`mesh/bvh.py`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i32, view_i64
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    IDS_AT,
    INTS,
    MAX_LEAF,
    N_FACETS,
    NODE,
    NODES_AT,
    NOTHING,
    NUMBERS,
    NUMBERS_AT,
    SLABS_AT,
    TRIANGLES_AT,
    WIDTH,
    box_at,
    leaf_link,
    link_of,
    open_tree,
)
from collide.numerics.vec3 import Vec3, add, dot, norm1, scale, sub, vec3_at

#: Bits of a cell's number along each axis, the upper of which are put along the curve; digits sorted at once, and their
#: values. Passes are even: keys go to and fro.
_BITS, _CURVED = 16, 10
_DIGIT, _PASSES = 12, 4
_VALUES = 1 << _DIGIT
#: Cells a side.
CELLS = float(1 << _BITS)
#: Rounding of half lengths to floats, and of coordinates before.
_WIDER, _LEAST = 1.0 + 2.0**-22, 2.0**-100
#: Words of workspace a point: two keys and two numbers; besides them the counts.
WORK = 3
WORK_BESIDES = _VALUES
#: Levels of nodes at most.
MAX_LEVELS = 16
#: How far a point may be from its coordinates in floats, in units: √3 · 2⁻²⁴, and what taking off the centre rounds.
FLOAT_ERROR = 2.0**-23
#: Floats of a leaf.
LEAF_FLOATS = 3 * WIDTH


@kernel(inline=True)
def _spread(x):
    """21 bits, two zeros between each and the next."""
    x &= 0x1FFFFF
    x = (x | x << 32) & 0x1F00000000FFFF
    x = (x | x << 16) & 0x1F0000FF0000FF
    x = (x | x << 8) & 0x100F00F00F00F00F
    x = (x | x << 4) & 0x10C30C30C30C30C3
    return (x | x << 2) & 0x1249249249249249


@kernel(inline=True)
def _interleaved(x, y, z):
    return _spread(x) << 2 | _spread(y) << 1 | _spread(z)


@kernel(inline=True)
def _along_curve(x, y, z):
    """The number along the curve of a cell of _CURVED bits: J. Skilling, "Programming the Hilbert curve" (2004)."""
    q = 1 << (_CURVED - 1)
    while q > 1:
        p = q - 1
        x ^= p if x & q else 0
        t = (x ^ y) & p
        if y & q:
            x ^= p
        else:
            x, y = x ^ t, y ^ t
        t = (x ^ z) & p
        if z & q:
            x ^= p
        else:
            x, z = x ^ t, z ^ t
        q >>= 1
    y ^= x
    z ^= y
    t, q = 0, 1 << (_CURVED - 1)
    while q > 1:
        t ^= q - 1 if z & q else 0
        q >>= 1
    return _interleaved(x ^ t, y ^ t, z ^ t)


@kernel(inline=True)
def _cell(x, low, per_metre):
    return min(max(int((x - low) * per_metre), 0), (1 << _BITS) - 1)


@kernel
def _sort(points, n, low, per_metre, ids, keys, other_keys, other_ids, counts):
    """Number the points along the curve, into ``ids``: counting sorts of the cells' digits, the lowest first."""
    shift, mask = _BITS - _CURVED, (1 << (_BITS - _CURVED)) - 1
    for i in range(n):
        p = vec3_at(points, 3 * i)
        x, y, z = _cell(p.x, low.x, per_metre), _cell(p.y, low.y, per_metre), _cell(p.z, low.z, per_metre)
        upper = _along_curve(x >> shift, y >> shift, z >> shift)
        keys[i] = upper << (3 * shift) | _interleaved(x & mask, y & mask, z & mask)
        ids[i] = i
    for step in range(0, _PASSES, 2):
        _sort_digit(n, _DIGIT * step, keys, ids, other_keys, other_ids, counts)
        _sort_digit(n, _DIGIT * (step + 1), other_keys, other_ids, keys, ids, counts)


@entry("void(int64, int64, int64, float64, int64, int64)")
def order_along_curve(points_at, n, low_at, per_metre, ids_at, work_at):
    """Numbers (n,) int32 of points along the curve.   work : WORK · n + WORK_BESIDES words.

    low : (3,) the least coordinates.   per_metre : cells.
    """
    keys, others, other_ids, counts = _sorting_space(n, work_at)
    low = vec3_at(view_f64(low_at, 3), 0)
    _sort(view_f64(points_at, 3 * n), n, low, per_metre, view_i32(ids_at, n), keys, others, other_ids, counts)


@kernel
def _sorting_space(n, work_at):
    """(keys, other keys, other ids, counts) of a workspace."""
    return (
        view_i64(work_at, n), view_i64(work_at + 8 * n, n), view_i32(work_at + 16 * n, n),
        view_i64(work_at + 24 * n, _VALUES),
    )


@kernel
def _sort_digit(n, shift, keys, ids, to_keys, to_ids, counts):
    for value in range(_VALUES):
        counts[value] = 0
    for i in range(n):
        counts[keys[i] >> shift & _VALUES - 1] += 1
    begin = 0
    for value in range(_VALUES):
        count = counts[value]
        counts[value] = begin
        begin += count
    for i in range(n):
        digit = keys[i] >> shift & _VALUES - 1
        to = counts[digit]
        counts[digit] = to + 1
        to_keys[to] = keys[i]
        to_ids[to] = ids[i]


@entry("int64(int64, int64, int64, int64)")
def build_point_tree(header_at, work_at, first_nodes_at, n_levels):
    """Fill in the ids, the nodes and the floats of a tree of points; returns how many nodes.

    header : as of `mesh/bvh.py`, with the points (n, 3) in the place of the triangles, in their own order, and floats
    in the place of the slabs: three rows of eight coordinates a leaf, in units from the centre, the last repeated.
    work : WORK · n + WORK_BESIDES words.   first_nodes : of each level, the root's first; the last level has leaves.
    """
    header = view_i64(header_at, INTS)
    n = header[N_FACETS]
    points, ids = view_f64(header[TRIANGLES_AT], 3 * n), view_i32(header[IDS_AT], n)
    numbers = view_f64(header[NUMBERS_AT], NUMBERS)
    centre, unit = vec3_at(numbers, CENTRE), math.ldexp(1.0, int(header[EXPONENT]))
    keys, others, other_ids, counts = _sorting_space(n, work_at)
    low = Vec3(centre.x - unit, centre.y - unit, centre.z - unit)
    _sort(points, n, low, 0.5 * CELLS / unit, ids, keys, others, other_ids, counts)
    first_nodes = view_i64(first_nodes_at, n_levels + 1)
    for level in range(n_levels - 1, -1, -1):
        for node in range(first_nodes[level], first_nodes[level + 1]):
            _fill_node(header, points, ids, centre, unit, node, node - first_nodes[level], level, first_nodes, n_levels)
    floats = view_f32(header[SLABS_AT], LEAF_FLOATS * leaves_of(n))
    for first in range(0, n, MAX_LEAF):
        put_floats(floats, points, ids, centre, unit, first, min(MAX_LEAF, n - first))
    return first_nodes[n_levels]


@kernel(inline=True)
def place_in_units(points, number, centre, unit):
    """A point by number, in units from the centre."""
    return scale(1.0 / unit, sub(vec3_at(points, 3 * int(number)), centre))


@kernel
def put_floats(floats, points, ids, centre, unit, first, count):
    """The floats of a leaf of points at places first … first + count − 1."""
    at = LEAF_FLOATS * (first // MAX_LEAF)
    for i in range(WIDTH):
        p = place_in_units(points, ids[first + min(i, count - 1)], centre, unit)
        floats[at + i], floats[at + WIDTH + i], floats[at + 2 * WIDTH + i] = p.x, p.y, p.z


@kernel
def box_of_points(points, ids, centre, unit, first, count):
    """(least, largest corner) of the points at places first … first + count − 1, in units."""
    low, high = Vec3(math.inf, math.inf, math.inf), Vec3(-math.inf, -math.inf, -math.inf)
    for place in range(first, first + count):
        p = place_in_units(points, ids[place], centre, unit)
        low, high = lower_of(low, p), higher_of(high, p)
    return low, high


@kernel(inline=True)
def leaves_of(n):
    """How many leaves n points have."""
    return (n + MAX_LEAF - 1) // MAX_LEAF


@kernel
def _fill_node(header, points, ids, centre, unit, node, number, level, first_nodes, n_levels):
    """Boxes and links of a node, the ``number``th of its level."""
    n = header[N_FACETS]
    n_leaves = leaves_of(n)
    n_words = NODE * first_nodes[n_levels]
    boxes, links = view_f32(header[NODES_AT], n_words), view_i32(header[NODES_AT], n_words)
    at = NODE * node
    for slot in range(WIDTH):
        child, link = WIDTH * number + slot, 0
        low, high = Vec3(math.inf, math.inf, math.inf), Vec3(-math.inf, -math.inf, -math.inf)
        is_used = level > 0 or slot == 0  # the root has a single box
        if level == n_levels - 1:
            is_used = is_used and child < n_leaves
            if is_used:
                first = MAX_LEAF * child
                count = min(MAX_LEAF, n - first)
                low, high = box_of_points(points, ids, centre, unit, first, count)
                link = leaf_link(first, count)
        else:
            is_used = is_used and first_nodes[level + 1] + child < first_nodes[level + 2]
            if is_used:
                link = first_nodes[level + 1] + child
                low, high = box_of_node(boxes, NODE * link)
        put_box(boxes, at + slot, low, high, is_used)
        links[at + 6 * WIDTH + slot] = link


@kernel(inline=True)
def lower_of(a, b):
    return Vec3(min(a.x, b.x), min(a.y, b.y), min(a.z, b.z))


@kernel(inline=True)
def higher_of(a, b):
    return Vec3(max(a.x, b.x), max(a.y, b.y), max(a.z, b.z))


@kernel
def box_of_node(boxes, at):
    """(least, largest corner) of all boxes of a node, in units: doubles, as corners in floats would cut boxes off."""
    low, high = Vec3(math.inf, math.inf, math.inf), Vec3(-math.inf, -math.inf, -math.inf)
    for i in range(at, at + WIDTH):
        if boxes[i + 3 * WIDTH] > NOTHING / 2:
            c, h = _doubles_at(boxes, i), _doubles_at(boxes, i + 3 * WIDTH)
            low, high = lower_of(low, sub(c, h)), higher_of(high, add(c, h))
    return low, high


@kernel(inline=True)
def _doubles_at(boxes, at):
    """A centre or half lengths; ``float`` of a float stays a float in kernels."""
    return Vec3(np.float64(boxes[at]), np.float64(boxes[at + WIDTH]), np.float64(boxes[at + 2 * WIDTH]))


@kernel
def put_box(boxes, at, low, high, is_used):
    """A box as centre and half lengths in floats, rounded outwards; of nothing where it is not used."""
    for axis in range(3):
        l, h = (low.x, high.x) if axis == 0 else (low.y, high.y) if axis == 1 else (low.z, high.z)
        if not is_used:
            boxes[at + WIDTH * axis], boxes[at + WIDTH * (3 + axis)] = np.float32(0.0), np.float32(NOTHING)
            continue
        c = np.float32(0.5 * (l + h))
        half = max(h - float(c), float(c) - l)
        boxes[at + WIDTH * axis] = c
        boxes[at + WIDTH * (3 + axis)] = np.float32(half * _WIDER + _LEAST)


# --- walks --------------------------------------------------------------------------------------


@kernel(inline=True)
def points_of(tree):
    """The points of a tree, in their own order: as many as the tree has places, of which some may be empty."""
    return view_f64(tree.header[TRIANGLES_AT], 3 * tree.header[N_FACETS])


@kernel(inline=True)
def _square_to_box(tree, ref, x):
    """A lower bound of the squared distance of a place, in units from the centre, from the box of a reference."""
    box = box_at(tree, ref)
    dx = max(abs(x.x - box.centre.x) - box.half.x, 0.0)
    dy = max(abs(x.y - box.centre.y) - box.half.y, 0.0)
    dz = max(abs(x.z - box.centre.z) - box.half.z, 0.0)
    return dx * dx + dy * dy + dz * dz


@kernel
def _push_near(tree, node, x, limit, stack, squares, top):
    """Put boxes of a node that are no farther than a limit (squared, in units) on the stack, the nearest on top."""
    first = top
    for slot in range(WIDTH):
        ref = WIDTH * node + slot
        if not tree.boxes[NODE * node + slot + 3 * WIDTH] > NOTHING / 2:
            continue
        square = _square_to_box(tree, ref, x)
        if square > limit:
            continue
        k = top
        while k > first and squares[k - 1] < square:
            squares[k], stack[k] = squares[k - 1], stack[k - 1]
            k -= 1
        squares[k], stack[k] = square, ref
        top += 1
    return top


@kernel
def _in_units(tree, p):
    """A place of the points' frame, in units from the centre."""
    return scale(math.ldexp(1.0, -int(tree.header[EXPONENT])), sub(p, vec3_at(tree.numbers, CENTRE)))


@kernel(inline=True)
def floats_of(tree):
    """The points of a tree as floats, in units from the centre, leaf by leaf."""
    return view_f32(tree.header[SLABS_AT], LEAF_FLOATS * leaves_of(tree.header[N_FACETS]))


@entry("void(int64, int64, int64, int64, float64, int64, int64, int64)")
def nearest_in_tree(header_at, queries_at, n, k, largest, squares_at, ids_at, stack_at):
    """The k nearest points of each of n places, nearest first: squared distances [m²] and numbers; ∞ and −1 beyond.

    largest : squared, points farther away do not count [m²].   squares, ids : k a place.   stack : two words for each
    of WIDTH · (MAX_LEVELS + 1) boxes.   Of points as near those of least number.
    """
    tree = open_tree(header_at)
    points, floats, queries = points_of(tree), floats_of(tree), view_f64(queries_at, 3 * n)
    squares, ids = view_f64(squares_at, k * n), view_i64(ids_at, k * n)
    n_stack = WIDTH * (MAX_LEVELS + 1)
    stack, bounds = view_i64(stack_at, n_stack), view_f64(stack_at + 8 * n_stack, n_stack)
    unit = math.ldexp(1.0, int(tree.header[EXPONENT]))
    for i in range(n):
        p = vec3_at(queries, 3 * i)
        x, at = _in_units(tree, p), k * i
        slack = FLOAT_ERROR + 2.0**-48 * norm1(x)
        for j in range(k):
            squares[at + j], ids[at + j] = math.inf, -1
        limit = _limit_of(largest, unit, slack)
        top = _push_near(tree, 0, x, limit, stack, bounds, 0)
        while top > 0:
            top -= 1
            if bounds[top] > limit:
                continue
            link = link_of(tree.links, stack[top])
            if link >= 0:
                top = _push_near(tree, link, x, limit, stack, bounds, top)
                continue
            run = ~link
            first = run >> 3
            leaf = LEAF_FLOATS * (first // MAX_LEAF)
            for i in range(run & 7):
                dx = x.x - float(floats[leaf + i])
                dy = x.y - float(floats[leaf + WIDTH + i])
                dz = x.z - float(floats[leaf + 2 * WIDTH + i])
                if dx * dx + dy * dy + dz * dz > limit:
                    continue
                number = int(tree.ids[first + i])
                d = sub(vec3_at(points, 3 * number), p)
                if _insert(squares, ids, at, k, dot(d, d), number, largest):
                    limit = _limit_of(min(largest, squares[at + k - 1]), unit, slack)


@kernel(inline=True)
def _limit_of(square, unit, slack):
    """A squared distance [m²] in square units, of places that may be off by a slack."""
    reach = math.sqrt(square) / unit * (1.0 + 2.0**-48) + slack
    return reach * reach * (1.0 + 2.0**-48)


@kernel
def _insert(squares, ids, at, k, square, number, largest):
    """Put a point among the k nearest, unless k are nearer; whether it was put."""
    last = at + k - 1
    if square > largest or square > squares[last] or (square == squares[last] and number > ids[last] >= 0):
        return False
    j = last
    while j > at and (squares[j - 1] > square or (squares[j - 1] == square and ids[j - 1] > number)):
        squares[j], ids[j] = squares[j - 1], ids[j - 1]
        j -= 1
    squares[j], ids[j] = square, number
    return True


@entry("int64(int64, int64, int64, int64, int64, int64)")
def points_in_box(header_at, low_at, high_at, ids_at, capacity, stack_at):
    """Numbers of the points within a box, its faces included; how many, of which no more than ``capacity`` are written.

    low, high : corners, 3 doubles each [m].   stack : as of `nearest_in_tree`, words of numbers alone.
    """
    tree = open_tree(header_at)
    points, ids = points_of(tree), view_i64(ids_at, capacity)
    low, high = vec3_at(view_f64(low_at, 3), 0), vec3_at(view_f64(high_at, 3), 0)
    stack = view_i64(stack_at, WIDTH * (MAX_LEVELS + 1))
    least, largest = _in_units(tree, low), _in_units(tree, high)
    slack = 2.0**-46 * (1.0 + max(norm1(least), norm1(largest)))
    stack[0] = 0
    n, top = 0, 1
    while top > 0:
        top -= 1
        link = link_of(tree.links, stack[top])
        if link >= 0:
            for slot in range(WIDTH):
                ref = WIDTH * link + slot
                box = box_at(tree, ref)
                if (
                    box.half.x > NOTHING / 2
                    and box.centre.x - box.half.x <= largest.x + slack and box.centre.x + box.half.x >= least.x - slack
                    and box.centre.y - box.half.y <= largest.y + slack and box.centre.y + box.half.y >= least.y - slack
                    and box.centre.z - box.half.z <= largest.z + slack and box.centre.z + box.half.z >= least.z - slack
                ):
                    stack[top] = ref
                    top += 1
            continue
        run = ~link
        for place in range(run >> 3, (run >> 3) + (run & 7)):
            number = int(tree.ids[place])
            p = vec3_at(points, 3 * number)
            if (
                low.x <= p.x <= high.x and low.y <= p.y <= high.y and low.z <= p.z <= high.z
            ):
                if n < capacity:
                    ids[n] = number
                n += 1
    return n


class _Way(NamedTuple):
    """From a place along a vector, t from 0 to a limit.

    extra : added to the radii of balls [m].   slack : rounding of places [m].   first : whether balls behind a ball met
    for sure may be left out.
    """

    o: Vec3
    v: Vec3
    square: float
    limit: float
    extra: float
    slack: float
    first: bool


@kernel
def _enters_box(way, centre, half, until):
    """Whether a way may meet a box [m] before t = ``until``."""
    begin, end = 0.0, until
    for axis in range(3):
        o, v = (way.o.x, way.v.x) if axis == 0 else (way.o.y, way.v.y) if axis == 1 else (way.o.z, way.v.z)
        c, h = (centre.x, half.x) if axis == 0 else (centre.y, half.y) if axis == 1 else (centre.z, half.z)
        low, high = c - h - o, c + h - o
        if v == 0.0:
            if low > 0.0 or high < 0.0:
                return False
            continue
        a, b = low / v, high / v
        begin, end = max(begin, min(a, b)), min(end, max(a, b))
    return begin <= end * (1.0 + 2.0**-40)


@kernel
def _times_of_ball(way, p, radius):
    """(least t of a way's first place on a ball's surface, largest t); infinite without such a place."""
    w = sub(p, way.o)
    s = dot(w, way.v) / way.square
    across = sub(w, scale(s, way.v))
    square, outer, inner = dot(across, across), radius + way.extra + way.slack, radius - way.slack
    if not square <= outer * outer:
        return math.inf, math.inf
    half = math.sqrt((outer * outer - square) / way.square)
    if s + half < 0.0 or s - half > way.limit:
        return math.inf, math.inf
    known = math.inf
    if way.first and inner > 0.0 and square < inner * inner:
        half_inner = math.sqrt((inner * inner - square) / way.square)
        known = s - half_inner if s - half >= 0.0 else s + half
        known = known if s + half_inner >= 0.0 else math.inf
    return max(s - half, 0.0), known


@entry("int64(int64, int64, float64, int64, float64, float64, float64, boolean, int64, int64, int64, int64)")
def balls_on_way(tree_at, radii_at, radius, way_at, limit, extra, slack, first, ids_at, times_at, capacity, stack_at):
    """Write numbers and earliest t of the first ``capacity`` balls on a way; returns the number of all balls.

    radii, radius : of each ball, or 0 and the radius of all [m].   way : origin and vector, in the cloud's frame.
    limit, extra, slack, first : as of `_Way`.   stack : words as of `nearest_in_tree`.
    """
    tree, numbers = open_tree(tree_at), view_f64(way_at, 6)
    points, ids, times = points_of(tree), view_i64(ids_at, capacity), view_f64(times_at, capacity)
    v, stack = vec3_at(numbers, 3), view_i64(stack_at, WIDTH * (MAX_LEVELS + 1))
    way = _Way(vec3_at(numbers, 0), v, dot(v, v), limit, extra, slack, first)
    radii = view_f64(radii_at, tree.header[N_FACETS] if radii_at != 0 else 0)
    unit, middle = math.ldexp(1.0, int(tree.header[EXPONENT])), vec3_at(tree.numbers, CENTRE)
    reach = radius + extra + slack
    until, n, top = limit, 0, 1
    stack[0] = 0
    while top > 0:
        top -= 1
        box = box_at(tree, stack[top])
        half = Vec3(unit * box.half.x + reach, unit * box.half.y + reach, unit * box.half.z + reach)
        if not _enters_box(way, add(middle, scale(unit, box.centre)), half, until):
            continue
        link = link_of(tree.links, stack[top])
        if link >= 0:
            for slot in range(WIDTH):
                if tree.boxes[NODE * link + slot + 3 * WIDTH] > NOTHING / 2:
                    stack[top] = WIDTH * link + slot
                    top += 1
            continue
        run = ~link
        for place in range(run >> 3, (run >> 3) + (run & 7)):
            number = int(tree.ids[place])
            of_ball = radii[number] if radii_at != 0 else radius
            begin, known = _times_of_ball(way, vec3_at(points, 3 * number), of_ball)
            if begin == math.inf or begin > until:
                continue
            until = min(until, known)
            if n < capacity:
                ids[n], times[n] = number, begin
            n += 1
    if n > capacity:
        return n
    n_kept = 0
    for i in range(n):
        if times[i] <= until:
            ids[n_kept], times[n_kept] = ids[i], times[i]
            n_kept += 1
    return n_kept
