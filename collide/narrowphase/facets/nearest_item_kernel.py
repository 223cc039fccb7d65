"""A mesh and a curved shape, or a field and a convex set: a walk down the box-tree, the convex engine at items.

Items are facets of a mesh, balls of a point cloud, boxes of cells of a grid, or prisms of terrain. They are taken
nearest first, by the gaps between boxes along their axes and along the normal of the nearest item so far; what is
farther than the least upper bound is left out, and an item that meets the shape ends the walk. The bracket of the whole
is the least of the items'. A boolean is a walk with the upper bound 0 from the beginning, and whether the bodies come
within a margin a walk with the margin.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.curved.curved_kinds import curved_support
from collide.fields.cell_tree_kernel import (
    box_word,
    cells_along,
    child_of,
    high_corner,
    is_solid,
    level_of,
    low_corner,
    number_of,
    open_cells,
    plane_at,
    root_word,
    x_of,
    y_of,
    z_of,
)
from collide.fields.point_tree_kernel import points_of
from collide.fields.terrain_kernel import (
    ALONG,
    blocks_within,
    box_of_cells,
    corner_of_prism,
    open_terrain,
    top_of_cell,
)
from collide.kernels import entry, kernel, native_call, prepared, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import BLOCK, POINTS
from collide.lowering.shape_table import (
    ADDRESS,
    INTS,
    KIND,
    NUMBERS,
    PADDED,
    PARAMS,
    POSE,
    POSE_SLOP,
    RADIUS,
    RANK,
    REACH,
    SLOP,
)
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    N_FACETS,
    NODE,
    NOTHING,
    WIDTH,
    TreeView,
    box_at,
    float_column_at,
    link_of,
    open_tree,
)
from collide.mesh.bvh import REACH as TREE_REACH
from collide.narrowphase.fallback_searches import lay_row_apart
from collide.narrowphase.finish_rows import forget_depth
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.pose_batches import clear_rows, set_pose
from collide.narrowphase.rows import (
    BEYOND,
    BODY_B,
    CERTIFIED,
    COUNT,
    DISTANCE,
    HIT,
    HOW,
    ITERATIONS,
    LOWER,
    NORMAL,
    PART_A,
    PART_B,
    POINT_A,
    POINT_B,
    ROW,
    UPPER,
    VERTICES_A,
    VERTICES_B,
    copy_row,
    is_undecided_or_refused,
    view_row,
)
from collide.numerics.rigid_poses import off_rotation
from collide.numerics.vec3 import (
    Vec3,
    absolute,
    column_at,
    dot,
    neg,
    norm,
    norm1,
    put_vec3,
    rotate_back,
    scale,
    sub,
    vec3_at,
)
from collide.support.support_mapping import support_vertex

_answer_pairs_at = native_call(SIGNATURE)

# Header: addresses of `answer_pairs`, of the tree, of two rows of the `ShapeTable` (an item, the shape), of the item's
# coordinates, of two poses, their shape rows, one pair, a row, the workspace, and two stacks of so many places; whether
# the shape stands first in single calls; what items are, and the address of balls' radii, point by point, or 0; of the
# shape's box in its frame, centre and half sides, and of the floats of a probe (`fields/convex_walk_kernel.py`);
# doubles: the reach of the items from their origin, the largest radius of theirs, and the width that is promised, as a
# part of the size.
(
    CORE, TREE_AT, INTS_AT, NUMBERS_AT, COORDINATES_AT, POSES_AT, SHAPE_OF_AT, PAIRS_AT, ROW_AT, DOUBLES_AT,
    INTEGERS_AT, STACK_AT, BOUNDS_AT, EXCHANGED, ITEMS_ARE, RADII_AT, BOX_AT, PROBE_AT, REACH_OF_ITEMS, LARGEST_RADIUS,
    PROMISE,
) = range(21)
HEADER = 21
#: Doubles of a box.
BOX = 6
#: What items are.
FACETS, BALLS, CELLS, PRISMS = range(4)
#: How a pose ends: left to the long way; apart; apart, unless the shape is inside the mesh; a facet meets the shape; a
#: facet is within the margin, or may be.
LONG_WAY, SURFACES_APART, MAYBE_INSIDE, MEETS, NEAR = -1, 1, 0, 2, 3
#: Where so many facets of a mesh leave it open whether it meets the shape, polytopes around and inside the shape may
#: decide sooner: a tube around a cylinder, whose facets are all near.
_MAX_ASKED = 64

#: A matrix farther off a rotation is left to the long way.
_FAR_OFF = 2.0**-40
#: Of the pair's size, what rounding takes off a gap between boxes.
_ROUNDING = 2.0**-44
#: Facets are looked at that are farther than a limit by so many times what rounding takes off a gap.
NEAR_SLACK = 64.0


class _Walk(NamedTuple):
    """What a walk works on: the tree, the header's words, rows of the tables, the poses.

    t : p_WB − p_WA.   low, high : the shape's box along the items' axes, from their origin [m].
    slack : what rounding and radii take off every gap [m].
    """

    header_at: int
    tree: TreeView
    words: Any
    ints: Any
    numbers: Any
    poses: Any
    t: Vec3
    low: Vec3
    high: Vec3
    slack: float


class Nearest(NamedTuple):
    """The nearest of the items asked about so far.

    key, place : of the best row, the first of the rows.   lower, upper : least bounds of all items [m].
    limit : items farther away do not count: the least of upper bounds and of the limit that was given [m].
    open_lower : least lower bound of the items without a certificate [m].   along, above : direction in the items'
    frame in which the shape is looked for, and height of the shape's lowest point [m].
    failed : an item has no proven gap: the item asked last.   n_asked : how many items were asked about.
    """

    key: float
    place: int
    lower: float
    upper: float
    limit: float
    open_lower: float
    along: Vec3
    above: float
    failed: bool
    n_asked: int


@kernel(inline=True)
def begin_nearest(limit):
    """The `Nearest` before any item is asked about."""
    return Nearest(math.inf, -1, math.inf, math.inf, limit, math.inf, Vec3(0.0, 0.0, 0.0), -math.inf, False, 0)


@kernel(inline=True)
def height_along(walk, d):
    """How far the shape reaches along a direction of the world, from its own origin."""
    g, ints = rotate_back(walk.poses, POSE, d), walk.ints
    radius = walk.numbers[NUMBERS + RADIUS]
    if ints[INTS + KIND] != POINTS:
        return dot(g, curved_support(ints[INTS + KIND], walk.numbers, NUMBERS + PARAMS, g)) + radius
    m = ints[INTS + PADDED]
    coordinates = view_f64(ints[INTS + ADDRESS], 3 * m)
    return dot(g, column_at(coordinates, m, support_vertex(coordinates, m, g))) + radius


@kernel(inline=True)
def _column(R, axis):
    return Vec3(R[axis], R[3 + axis], R[6 + axis])


@kernel(inline=True)
def _gap_of_box(walk, nearest, centre, half):
    """A lower bound of the distance of the shape from a box of the mesh's frame; below 0 where none is known."""
    x = max(centre.x - half.x - walk.high.x, walk.low.x - centre.x - half.x)
    y = max(centre.y - half.y - walk.high.y, walk.low.y - centre.y - half.y)
    z = max(centre.z - half.z - walk.high.z, walk.low.z - centre.z - half.z)
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    gap = math.sqrt(x * x + y * y + z * z) * (1.0 - 2.0**-38)
    along = nearest.above - dot(nearest.along, centre) - dot(absolute(nearest.along), half)
    return max(gap, along) - walk.slack


@kernel(inline=True)
def _box_of_item(walk, place):
    """(centre, half lengths) of the box of a facet, or of a ball's centre."""
    tree = walk.tree
    if walk.words[ITEMS_ARE] == BALLS:
        return vec3_at(points_of(tree), 3 * int(tree.ids[place])), Vec3(0.0, 0.0, 0.0)
    p, q, r = vec3_at(tree.triangles, 9 * place), vec3_at(tree.triangles, 9 * place + 3), vec3_at(
        tree.triangles, 9 * place + 6
    )
    low = Vec3(min(p.x, q.x, r.x), min(p.y, q.y, r.y), min(p.z, q.z, r.z))
    high = Vec3(max(p.x, q.x, r.x), max(p.y, q.y, r.y), max(p.z, q.z, r.z))
    return scale(0.5, Vec3(low.x + high.x, low.y + high.y, low.z + high.z)), scale(0.5, sub(high, low))


@kernel
def _put_cell(walk, word):
    """A box of cells as row 0 of the tables."""
    cells, coordinates = open_cells(walk.words[TREE_AT]), view_f64(walk.words[COORDINATES_AT], 3 * BLOCK)
    low, high = low_corner(cells, word), high_corner(cells, word)
    for k in range(BLOCK):
        coordinates[k] = high.x if k & 4 else low.x
        coordinates[BLOCK + k] = high.y if k & 2 else low.y
        coordinates[2 * BLOCK + k] = high.z if k & 1 else low.z
    x, y, z = max(-low.x, high.x), max(-low.y, high.y), max(-low.z, high.z)
    walk.numbers[REACH] = math.sqrt(x * x + y * y + z * z) * (1 + 1e-15)


@kernel
def _put_prism(walk, place):
    """What lies between a triangle of terrain and the bottom as row 0 of the tables."""
    terrain, coordinates = open_terrain(walk.words[TREE_AT]), view_f64(walk.words[COORDINATES_AT], 3 * BLOCK)
    square = 0.0
    for k in range(BLOCK):
        p = corner_of_prism(terrain, place, k % 6)
        coordinates[k], coordinates[BLOCK + k], coordinates[2 * BLOCK + k] = p.x, p.y, p.z
        square = max(square, dot(p, p))
    walk.numbers[REACH] = math.sqrt(square) * (1 + 1e-15)


@kernel
def _put_item(walk, place):
    """An item as row 0 of the tables."""
    words, tree = walk.words, walk.tree
    if words[ITEMS_ARE] == CELLS:
        _put_cell(walk, place)
        return
    if words[ITEMS_ARE] == PRISMS:
        _put_prism(walk, place)
        return
    coordinates = view_f64(words[COORDINATES_AT], 3 * BLOCK)
    corners, at, n = tree.triangles, 9 * place, 3
    if words[ITEMS_ARE] == BALLS:
        number = int(tree.ids[place])
        corners, at, n = points_of(tree), 3 * number, 1
        if words[RADII_AT] != 0:
            walk.numbers[RADIUS] = view_f64(words[RADII_AT], number + 1)[number]
    reach = 0.0
    for corner in range(n):
        p = vec3_at(corners, at + 3 * corner)
        coordinates[corner] = p.x
        coordinates[BLOCK + corner] = p.y
        coordinates[2 * BLOCK + corner] = p.z
        reach = max(reach, p.x * p.x + p.y * p.y + p.z * p.z)
    for k in range(n, BLOCK):
        coordinates[k] = coordinates[0]
        coordinates[BLOCK + k] = coordinates[BLOCK]
        coordinates[2 * BLOCK + k] = coordinates[2 * BLOCK]
    walk.numbers[REACH] = math.sqrt(reach) * (1 + 1e-15)


@kernel
def ask_item(walk, place, depths, limit):
    """The row of an item and the shape, written behind the best row.   depths : whether a depth is wanted.   limit : of
    items farther away no more is told [m]."""
    words = walk.words
    _put_item(walk, place)
    row_at = words[ROW_AT] + ROW
    clear_rows(row_at, 1)
    _answer_pairs_at(
        words[CORE],
        (
            words[INTS_AT], words[NUMBERS_AT], words[POSES_AT], 0, words[SHAPE_OF_AT], words[PAIRS_AT], 1, False,
            depths, False, limit, row_at, words[DOUBLES_AT], words[INTEGERS_AT],
        ),
    )
    return view_row(row_at)


@kernel
def whether_item(walk, place, axis, margin):
    """The row of whether an item comes within a margin of the shape [m]: hit, lower bound, the normal of a miss.

    axis : from the item to the shape, to begin with.
    """
    words = walk.words
    _put_item(walk, place)
    row_at = words[ROW_AT] + ROW
    clear_rows(row_at, 1)
    row = view_row(row_at)
    put_vec3(row.doubles, NORMAL, axis)
    _answer_pairs_at(
        words[CORE],
        (
            words[INTS_AT], words[NUMBERS_AT], words[POSES_AT], 0, words[SHAPE_OF_AT], words[PAIRS_AT], 1, True, False,
            True, margin, row_at, words[DOUBLES_AT], words[INTEGERS_AT],
        ),
    )
    return row


@kernel
def with_item(walk, nearest, place, limit):
    """The `Nearest` with one item more.   limit : of the walk [m].

    A walk without a limit asks an item only whether the item is nearer. In a walk with a limit the question takes
    longer than the distance.
    """
    row = ask_item(walk, place, False, nearest.limit if limit == math.inf else math.inf)
    lower, upper = row.doubles[LOWER], row.doubles[UPPER]
    failed = nearest.failed or is_undecided_or_refused(row) or not lower > 0.0
    key, best, along, above = nearest.key, nearest.place, nearest.along, nearest.above
    own_key = 2.0 * upper - lower
    if own_key < key or (own_key == key and place < best):
        key, best = own_key, place
        copy_row(walk.words[ROW_AT] + ROW, walk.words[ROW_AT])
        n = scale(1.0 - 2.0**-40, vec3_at(row.doubles, NORMAL))
        along = rotate_back(walk.poses, 0, n)
        above = dot(n, walk.t) - height_along(walk, neg(n))
    open_lower = nearest.open_lower if row.flags[CERTIFIED] != 0 else min(nearest.open_lower, lower)
    return Nearest(
        key, place if failed else best, min(nearest.lower, lower), min(nearest.upper, upper),
        min(nearest.limit, upper), open_lower, along, above, failed, nearest.n_asked + 1,
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
        bound = _gap_of_box(walk, nearest, centre, scale(unit, half))
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
                bound = _gap_of_box(walk, nearest, centre, scale(0.5, Vec3(hx - lx, hy - ly, hz - lz)))
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
    """`_walk_down` of a tree of cells: the place of an item is the word of its box."""
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
    if not bounds.half.z >= 0.0 or _gap_of_box(walk, nearest, bounds.centre, bounds.half) > nearest.limit:
        return nearest
    for i in range(ALONG * row, min(ALONG * (row + 1), terrain.rows)):
        for j in range(ALONG * column, min(ALONG * (column + 1), terrain.columns)):
            bounds = box_of_cells(terrain, i, j, 1, top_of_cell(terrain, i, j))
            if not bounds.half.z >= 0.0 or _gap_of_box(walk, nearest, bounds.centre, bounds.half) > nearest.limit:
                continue
            for triangle in range(2):
                if nearest.failed or nearest.lower <= enough or nearest.n_asked > max_asked:
                    return nearest
                nearest = with_item(walk, nearest, 2 * (i * terrain.columns + j) + triangle, limit)
    return nearest


@kernel
def _walk_terrain(walk, limit, enough, max_asked):
    """`_walk_down` of terrain: the blocks below the shape, then, for the least bound so far, the blocks around; blocks
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


@kernel(inline=True)
def _number_of_item(walk, place):
    """The number that results name."""
    if walk.words[ITEMS_ARE] == CELLS:
        return number_of(open_cells(walk.words[TREE_AT]), place)
    if walk.words[ITEMS_ARE] == PRISMS:
        return place
    return int(walk.tree.ids[place])


@kernel
def _walk_down(walk, limit, enough, max_asked):
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
            centre, half = _box_of_item(walk, place)
            if not (nearest.failed or _gap_of_box(walk, nearest, centre, half) > nearest.limit):
                nearest = with_item(walk, nearest, place, limit)
    return nearest


@kernel
def _places_within(walk, limit, capacity, places):
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
            centre, half = _box_of_item(walk, place)
            if not _gap_of_box(walk, nearest, centre, half) > limit:
                if n < capacity:
                    places[n] = place
                n += 1
    return n


@kernel
def rows_within(walk, limit, capacity, rows_at, places_at):
    """(state, n) of the facets no farther than a limit [m]: writes their rows, with depths, and their places.

    state : SURFACES_APART or MAYBE_INSIDE where n is 0; LONG_WAY where boxes of more than ``capacity`` facets are near,
    or a facet is undecided; else NEAR.   rows, places : room for ``capacity``.
    """
    places = view_i64(places_at, capacity)
    # Looked at are facets a little farther away: what is near is told by their rows, as in batches.
    n_looked_at = _places_within(walk, limit + NEAR_SLACK * walk.slack, capacity, places)
    if n_looked_at > capacity:
        return LONG_WAY, 0
    n = 0
    for i in range(n_looked_at):
        row = ask_item(walk, places[i], True, math.inf)
        if row.doubles[LOWER] > limit:
            continue
        if is_undecided_or_refused(row):
            return LONG_WAY, n
        copy_row(walk.words[ROW_AT] + ROW, rows_at + ROW * n)
        places[n] = places[i]
        n += 1
    return (NEAR if n > 0 else _inside_or_apart(walk)), n


@kernel
def set_poses(header_at, XA_at, XB_at, check):
    """Write one pair of poses into the tables; False where a matrix is no pose."""
    poses = view_f64(view_i64(header_at, HEADER)[POSES_AT], 2 * POSE)
    return set_pose(poses, 0, view_f64(XA_at, 16), check) and set_pose(poses, POSE, view_f64(XB_at, 16), check)


@kernel
def begin_walk(header_at):
    """(whether the pose of the items is near a rotation, the `_Walk`, the shape's box still at its origin)."""
    words = view_i64(header_at, HEADER)
    ints, numbers = view_i64(words[INTS_AT], 2 * INTS), view_f64(words[NUMBERS_AT], 2 * NUMBERS)
    poses, tree = view_f64(words[POSES_AT], 2 * POSE), open_tree(words[TREE_AT])
    off = off_rotation(poses)
    t = sub(vec3_at(poses, POSE + 9), vec3_at(poses, 9))
    reach = norm1(vec3_at(tree.numbers, TREE_REACH)) + numbers[NUMBERS + REACH] + numbers[NUMBERS + RADIUS] + norm1(t)
    radius = view_f64(header_at + 8 * LARGEST_RADIUS, 1)[0]
    slack = (_ROUNDING + 8.0 * off) * (reach + radius) + numbers[NUMBERS + SLOP] + radius
    slack += poses[POSE_SLOP] + poses[POSE + POSE_SLOP]
    return off < _FAR_OFF, _Walk(header_at, tree, words, ints, numbers, poses, t, t, t, slack)


@kernel
def with_box(walk):
    """The `_Walk` with the box of the shape along the axes of the items."""
    t, poses = walk.t, walk.poses
    x, y, z = _column(poses, 0), _column(poses, 1), _column(poses, 2)
    low = Vec3(
        dot(x, t) - height_along(walk, neg(x)), dot(y, t) - height_along(walk, neg(y)),
        dot(z, t) - height_along(walk, neg(z)),
    )
    high = Vec3(
        dot(x, t) + height_along(walk, x), dot(y, t) + height_along(walk, y), dot(z, t) + height_along(walk, z)
    )
    return _Walk(walk.header_at, walk.tree, walk.words, walk.ints, walk.numbers, poses, t, low, high, walk.slack)


@kernel
def place_pair(header_at, XA_at, XB_at, check):
    """(whether both matrices are poses, and near rotations, the `_Walk`) of one pair of poses."""
    placed = set_poses(header_at, XA_at, XB_at, check)
    is_near, walk = begin_walk(header_at)
    return placed and is_near, with_box(walk)


@kernel
def _inside_or_apart(walk):
    """SURFACES_APART or MAYBE_INSIDE, of surfaces that are apart: by the middle of the shape's box."""
    centre = scale(0.5, Vec3(walk.low.x + walk.high.x, walk.low.y + walk.high.y, walk.low.z + walk.high.z))
    reach = vec3_at(walk.tree.numbers, TREE_REACH)
    inside = abs(centre.x) <= reach.x + walk.slack and abs(centre.y) <= reach.y + walk.slack
    return MAYBE_INSIDE if inside and abs(centre.z) <= reach.z + walk.slack else SURFACES_APART


@kernel(inline=True)
def _max_asked(walk):
    """After how many items a boolean is given up: of balls and cells, whose unions take longer, after all."""
    return _MAX_ASKED if walk.words[ITEMS_ARE] == FACETS else walk.tree.header[N_FACETS]


@kernel
def _is_proven_hit(row):
    return row.flags[HIT] != 0 and not is_undecided_or_refused(row)


@kernel
def _write_meeting(walk, place, row_at):
    """The mesh's row, without a depth, where a facet meets the shape: at a point of both, by the row of the facet asked
    last."""
    facet, row = view_row(walk.words[ROW_AT] + ROW), view_row(row_at)
    forget_depth(facet)
    put_vec3(row.doubles, POINT_A, vec3_at(facet.doubles, POINT_A))
    put_vec3(row.doubles, POINT_B, vec3_at(facet.doubles, POINT_B))
    row.words[PART_A] = _number_of_item(walk, place)
    row.flags[HIT], row.flags[HOW], row.flags[CERTIFIED] = 1, facet.flags[HOW], 1
    for k in range(4):
        row.words[VERTICES_A + k] = row.words[VERTICES_B + k] = -1


@kernel
def _gap(header_at, XA_at, XB_at, check, depths, row_at):
    """The row of one pair of poses, the mesh's first; LONG_WAY, SURFACES_APART or MAYBE_INSIDE, and without depths
    MEETS."""
    is_placed, walk = place_pair(header_at, XA_at, XB_at, check)
    if not is_placed:
        return LONG_WAY
    return finish_gap(walk, _walk_down(walk, math.inf, 0.0, walk.tree.header[N_FACETS]), depths, row_at)


@kernel
def finish_gap(walk, nearest, depths, row_at):
    """Write the row of the nearest item, or, without depths, of an item that meets the shape; returns as `_gap`."""
    walk = with_box(walk)
    if nearest.failed and not depths:
        meeting = _walk_down(walk, 0.0, 0.0, _max_asked(walk))  # the item that batches name
        if not (meeting.failed and _is_proven_hit(view_row(walk.words[ROW_AT] + ROW))):
            return LONG_WAY
        _write_meeting(walk, meeting.place, row_at)
        return MEETS
    if nearest.failed or nearest.place < 0:
        return LONG_WAY
    _write_gap(walk, nearest, row_at)
    return _inside_or_apart(walk)


@kernel
def _state(header_at, XA_at, XB_at, check, margin):
    """`_state_of_walk` of one pair of poses, the mesh's first."""
    is_placed, walk = place_pair(header_at, XA_at, XB_at, check)
    if not is_placed:
        return LONG_WAY, -1, 0
    return _state_of_walk(walk, margin)


@kernel
def _state_of_walk(walk, margin):
    """(state, place, how) of a mesh, or of items, and a shape.

    state : LONG_WAY, SURFACES_APART, MAYBE_INSIDE, MEETS or, with a margin above 0 [m], NEAR: apart is then farther
    apart than the margin.   place : of MEETS the triangle meeting the shape, in the order of the tree.   how : index
    into `results.HOW`.
    """
    max_asked = _max_asked(walk)
    nearest = _walk_down(walk, margin, margin, max_asked)
    if nearest.failed:
        row = view_row(walk.words[ROW_AT] + ROW)
        return (MEETS if _is_proven_hit(row) else LONG_WAY), nearest.place, int(row.flags[HOW])
    if nearest.n_asked > max_asked:
        return LONG_WAY, -1, 0
    return (NEAR if nearest.lower <= margin else _inside_or_apart(walk)), -1, 0


@kernel
def _write_gap(walk, nearest, row_at):
    """The mesh's row from the best facet's and the least of all brackets."""
    copy_row(walk.words[ROW_AT], row_at)
    row = view_row(row_at)
    of_best = row.doubles[DISTANCE]
    distance = min(max(of_best, nearest.lower), nearest.upper)
    row.doubles[LOWER], row.doubles[UPPER], row.doubles[DISTANCE] = nearest.lower, nearest.upper, distance
    if distance != of_best:
        lay_row_apart(row)
    numbers = walk.numbers
    reach, promise = view_f64(walk.header_at + 8 * REACH_OF_ITEMS, 1)[0], view_f64(walk.header_at + 8 * PROMISE, 1)[0]
    size = reach + numbers[NUMBERS + REACH] + norm(walk.t)
    certified = nearest.open_lower > nearest.upper or nearest.upper - nearest.lower <= promise * size
    row.flags[CERTIFIED] = 1 if certified else 0
    row.flags[HIT] = row.flags[BEYOND] = row.flags[COUNT] = 0
    row.words[PART_A], row.words[PART_B] = _number_of_item(walk, nearest.place), 0
    row.words[ITERATIONS] = 0
    for k in range(4):
        row.words[VERTICES_A + k] = row.words[VERTICES_B + k] = -1


@kernel
def take_part(header_at, ints_at, numbers_at, pose_at, box_at):
    """Make a convex set the shape that is asked about: its rows of a `ShapeTable`, its row of poses, its box."""
    words = view_i64(header_at, HEADER)
    ints, numbers = view_i64(words[INTS_AT], 2 * INTS), view_f64(words[NUMBERS_AT], 2 * NUMBERS)
    poses, box = view_f64(words[POSES_AT], 2 * POSE), view_f64(words[BOX_AT], BOX)
    from_ints, from_numbers = view_i64(ints_at, INTS), view_f64(numbers_at, NUMBERS)
    from_pose, from_box = view_f64(pose_at, POSE), view_f64(box_at, BOX)
    for k in range(INTS):
        ints[INTS + k] = from_ints[k]
    ints[INTS + RANK] = 1  # behind the items, as in other tables
    for k in range(NUMBERS):
        numbers[NUMBERS + k] = from_numbers[k]
    for k in range(POSE):
        poses[POSE + k] = from_pose[k]
    for k in range(BOX):
        box[k] = from_box[k]


#: How a part's state is asked for, wherever items have a kernel for it.
PART_SIGNATURE = "int64(int64, int64, int64, int64, int64, float64)"


@entry(PART_SIGNATURE)
def state_of_part(header_at, ints_at, numbers_at, pose_at, box_at, margin):
    """The state, as of `_state_of_walk`, of items where they stand and a part as of `take_part`; never NEAR where an
    item is known to meet the part.

    With a margin an item within it ends the walk: whether another meets the part is asked once more.
    """
    take_part(header_at, ints_at, numbers_at, pose_at, box_at)
    is_near, walk = begin_walk(header_at)
    if not is_near:
        return LONG_WAY
    walk = with_box(walk)
    state, _, _ = _state_of_walk(walk, margin)
    if state == NEAR and _state_of_walk(walk, 0.0)[0] == MEETS:
        return MEETS
    return state


#: The same for a part's gap.
GAP_SIGNATURE = "int64(int64, int64, int64, int64, int64, float64, int64)"


@entry(GAP_SIGNATURE)
def gap_of_part(header_at, ints_at, numbers_at, pose_at, box_at, limit, row_at):
    """The row of a part as of `take_part`, as A, and of items where they stand; returns as `finish_part`.

    limit : parts farther away have no row [m].
    """
    take_part(header_at, ints_at, numbers_at, pose_at, box_at)
    is_near, walk = begin_walk(header_at)
    if not is_near:
        return LONG_WAY
    walk = with_box(walk)
    return finish_part(walk, _walk_down(walk, limit, 0.0, walk.tree.header[N_FACETS]), row_at)


@kernel
def finish_part(walk, nearest, row_at):
    """Write the row of a part and the nearest item: NEAR; SURFACES_APART of items beyond the limit; LONG_WAY."""
    if nearest.failed:
        return LONG_WAY
    if nearest.place < 0:
        return SURFACES_APART
    _write_gap(walk, nearest, row_at)
    finish_single(row_at, True)
    return NEAR


@entry("int64(int64, int64, int64, int64, boolean, int64, int64)")
def curved_gaps(header_at, XA_at, XB_at, n, depths, rows_at, states_at):
    """Rows of items and a shape at n pairs of checked poses that are apart, or, without depths, meet; returns how many
    are written.

    header : of HEADER integers.   XA, XB : 16 doubles a pose.   rows : of PAIR_DTYPE.   states : a byte a pose, 1 where
    its row is written.
    """
    states, n_written = view_u8(states_at, n), 0
    for k in range(n):
        status = _gap(header_at, XA_at + 128 * k, XB_at + 128 * k, False, depths, rows_at + ROW * k)
        states[k] = 0 if status == LONG_WAY else 1
        n_written += int(states[k])
    return n_written


@entry("int64(int64, int64, int64, int64, float64, int64, int64, int64)")
def curved_states_of(header_at, XA_at, XB_at, n, margin, states_at, places_at, how_at):
    """States of a mesh and a shape at n pairs of checked poses; returns how many are not left to the long way.

    header, XA, XB : as of `curved_gaps`.   margin, states, places, how : of `_state`, n integers each.
    """
    states, places, how = view_i64(states_at, n), view_i64(places_at, n), view_i64(how_at, n)
    n_decided = 0
    for k in range(n):
        states[k], places[k], how[k] = _state(header_at, XA_at + 128 * k, XB_at + 128 * k, False, margin)
        n_decided += int(states[k] != LONG_WAY)
    return n_decided


@entry(prepared.ROW, nogil=False)
def curved_state_single(header_at, XA_at, XB_at, row_at, _unused, margin):
    """1 with the bodies' state, as of `_state`, in the first word of a row; LONG_WAY.

    header : as of `curved_gap_single`.
    """
    exchanged = view_i64(header_at, HEADER)[EXCHANGED] != 0
    state, _, _ = _state(header_at, XB_at if exchanged else XA_at, XA_at if exchanged else XB_at, True, margin)
    if state == LONG_WAY:
        return LONG_WAY
    view_i64(row_at, 1)[0] = state
    return 1


@entry(prepared.ROW, nogil=False)
def curved_gap_single(header_at, XA_at, XB_at, row_at, depths, _unlimited):
    """ROW zero bytes become the row of bodies whose surfaces are apart, or, without depths, meet; returns as `_gap`.

    header : its [EXCHANGED] says that the shape stands first.
    """
    exchanged = view_i64(header_at, HEADER)[EXCHANGED] != 0
    status = _gap(header_at, XB_at if exchanged else XA_at, XA_at if exchanged else XB_at, True, depths, row_at)
    if status != LONG_WAY:
        finish_single(row_at, exchanged)
    return status


@kernel
def finish_single(row_at, exchanged):
    """Name the bodies of a row of a single call.   exchanged : the shape stands first."""
    row = view_row(row_at)
    row.words[BODY_B] = 1
    if exchanged:
        normal, p_a = vec3_at(row.doubles, NORMAL), vec3_at(row.doubles, POINT_A)
        put_vec3(row.doubles, NORMAL, sub(Vec3(0.0, 0.0, 0.0), normal))
        put_vec3(row.doubles, POINT_A, vec3_at(row.doubles, POINT_B))
        put_vec3(row.doubles, POINT_B, p_a)
        row.words[PART_A], row.words[PART_B] = row.words[PART_B], row.words[PART_A]
