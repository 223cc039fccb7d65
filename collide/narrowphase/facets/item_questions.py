"""Items and a shape as kernels ask about them: their tables and poses, an item at a time, the nearest so far.

Items are facets of a mesh, balls of a point cloud, boxes of cells of a grid, or prisms of terrain. What tells them
apart is here: how an item is written into the tables, its box, its number in results.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.curved.curved_kinds import curved_support
from collide.fields.cell_tree_kernel import (
    high_corner,
    low_corner,
    number_of,
    open_cells,
)
from collide.fields.point_tree_kernel import points_of
from collide.fields.terrain_kernel import (
    corner_of_prism,
    open_terrain,
)
from collide.kernels import kernel, native_call, view_f64, view_i64
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
from collide.mesh.bvh import REACH as TREE_REACH
from collide.mesh.bvh import (
    TreeView,
    open_tree,
)
from collide.narrowphase.pair_kernel import SIGNATURE
from collide.narrowphase.pose_batches import clear_rows, set_pose
from collide.narrowphase.rows import (
    CERTIFIED,
    LOWER,
    NORMAL,
    ROW,
    UPPER,
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
#: A matrix farther off a rotation is left to the long way.
_FAR_OFF = 2.0**-40
#: Of the pair's size, what rounding takes off a gap between boxes.
_ROUNDING = 2.0**-44


class Walk(NamedTuple):
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


@kernel
def set_poses(header_at, XA_at, XB_at, check):
    """Write one pair of poses into the tables; False where a matrix is no pose."""
    poses = view_f64(view_i64(header_at, HEADER)[POSES_AT], 2 * POSE)
    return set_pose(poses, 0, view_f64(XA_at, 16), check) and set_pose(poses, POSE, view_f64(XB_at, 16), check)


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


@kernel
def begin_walk(header_at):
    """(whether the pose of the items is near a rotation, the `Walk`, the shape's box still at its origin)."""
    words = view_i64(header_at, HEADER)
    ints, numbers = view_i64(words[INTS_AT], 2 * INTS), view_f64(words[NUMBERS_AT], 2 * NUMBERS)
    poses, tree = view_f64(words[POSES_AT], 2 * POSE), open_tree(words[TREE_AT])
    off = off_rotation(poses, 0)
    t = sub(vec3_at(poses, POSE + 9), vec3_at(poses, 9))
    reach = norm1(vec3_at(tree.numbers, TREE_REACH)) + numbers[NUMBERS + REACH] + numbers[NUMBERS + RADIUS] + norm1(t)
    radius = view_f64(header_at + 8 * LARGEST_RADIUS, 1)[0]
    slack = (_ROUNDING + 8.0 * off) * (reach + radius) + numbers[NUMBERS + SLOP] + radius
    slack += poses[POSE_SLOP] + poses[POSE + POSE_SLOP]
    return off < _FAR_OFF, Walk(header_at, tree, words, ints, numbers, poses, t, t, t, slack)


@kernel
def with_box(walk):
    """The `Walk` with the box of the shape along the axes of the items."""
    t, poses = walk.t, walk.poses
    x, y, z = _column(poses, 0), _column(poses, 1), _column(poses, 2)
    low = Vec3(
        dot(x, t) - height_along(walk, neg(x)), dot(y, t) - height_along(walk, neg(y)),
        dot(z, t) - height_along(walk, neg(z)),
    )
    high = Vec3(
        dot(x, t) + height_along(walk, x), dot(y, t) + height_along(walk, y), dot(z, t) + height_along(walk, z)
    )
    return Walk(walk.header_at, walk.tree, walk.words, walk.ints, walk.numbers, poses, t, low, high, walk.slack)


@kernel
def place_pair(header_at, XA_at, XB_at, check):
    """(whether both matrices are poses, and near rotations, the `Walk`) of one pair of poses."""
    placed = set_poses(header_at, XA_at, XB_at, check)
    is_near, walk = begin_walk(header_at)
    return placed and is_near, with_box(walk)


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
def gap_of_box(walk, nearest, centre, half):
    """A lower bound of the distance of the shape from a box of the mesh's frame; below 0 where none is known."""
    x = max(centre.x - half.x - walk.high.x, walk.low.x - centre.x - half.x)
    y = max(centre.y - half.y - walk.high.y, walk.low.y - centre.y - half.y)
    z = max(centre.z - half.z - walk.high.z, walk.low.z - centre.z - half.z)
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    gap = math.sqrt(x * x + y * y + z * z) * (1.0 - 2.0**-38)
    along = nearest.above - dot(nearest.along, centre) - dot(absolute(nearest.along), half)
    return max(gap, along) - walk.slack


@kernel(inline=True)
def box_of_item(walk, place):
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


@kernel(inline=True)
def number_of_item(walk, place):
    """The number that results name."""
    if walk.words[ITEMS_ARE] == CELLS:
        return number_of(open_cells(walk.words[TREE_AT]), place)
    if walk.words[ITEMS_ARE] == PRISMS:
        return place
    return int(walk.tree.ids[place])


@kernel
def ask_item(walk, place, depths, limit):
    """The row of an item and the shape, written behind the best row.   depths : whether a depth is wanted.   limit : of
    items farther away no more is told [m]."""
    return _answer(walk, place, Vec3(0.0, 0.0, 0.0), False, depths, limit)


@kernel
def whether_item(walk, place, axis, margin):
    """The row of whether an item comes within a margin of the shape [m]: hit, lower bound, the normal of a miss.

    axis : from the item to the shape, to begin with.
    """
    return _answer(walk, place, axis, True, False, margin)


@kernel
def _answer(walk, place, axis, boolean, depths, limit):
    """The row of `answer_pairs` of an item and the shape."""
    words = walk.words
    _put_item(walk, place)
    row_at = words[ROW_AT] + ROW
    clear_rows(row_at, 1)
    row = view_row(row_at)
    put_vec3(row.doubles, NORMAL, axis)
    _answer_pairs_at(
        words[CORE],
        (
            words[INTS_AT], words[NUMBERS_AT], words[POSES_AT], 0, words[SHAPE_OF_AT], words[PAIRS_AT], 1, boolean,
            depths, boolean, limit, row_at, words[DOUBLES_AT], words[INTEGERS_AT],
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
