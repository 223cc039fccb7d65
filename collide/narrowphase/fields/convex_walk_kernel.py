"""Whether balls of a cloud meet a convex set, or come within a margin of it: a walk down the tree with the set's box.

Nodes and points are compared, eight at once, with the set's own box along six axes, and with the planes that parted the
set from the last balls asked about (`mesh/box_overlap.py`). Balls left by these floats are asked of the narrowphase. A
ball as the set goes by distances from its centre (`ball_walk_kernel.py`).
"""

from __future__ import annotations

import math

import numpy as np

from collide.fields.point_tree_kernel import LEAF_FLOATS, MAX_LEVELS, floats_of, points_of
from collide.kernels import entry, kernel, view_f32, view_f64, view_i64, view_u8
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import ADDRESS, COUNT, INTS, KIND, NUMBERS, PADDED, POSE, POSE_SLOP, RADIUS, SLOP
from collide.mesh.box_overlap import FRAME, PRISM, PROBE, boxes_within, points_within
from collide.mesh.bvh import CENTRE, EXPONENT, MAX_LEAF, NODE, NOTHING, WIDTH, link_of
from collide.narrowphase.facets.item_questions import (
    BOUNDS_AT,
    BOX,
    BOX_AT,
    LONG_WAY,
    MEETS,
    NEAR,
    POSES_AT,
    PROBE_AT,
    RADII_AT,
    ROW_AT,
    STACK_AT,
    SURFACES_APART,
    Nearest,
    ask_item,
    begin_nearest,
    begin_walk,
    height_along,
    set_poses,
    whether_item,
    with_item,
)
from collide.narrowphase.fields.ball_walk_kernel import MEETS as BALLS_MEET
from collide.narrowphase.fields.ball_walk_kernel import OPEN, state_of_balls
from collide.narrowphase.rows import HIT, LOWER, NORMAL, ROW, is_undecided_or_refused, view_row
from collide.numerics.rigid_poses import off_rotation
from collide.numerics.vec3 import (
    Vec3,
    absolute,
    add,
    column_at,
    divide,
    dot,
    neg,
    norm,
    norm1,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)

#: Of the numbers met, in units of the tree, what floats and their sums round.
_FLOAT_ROUNDING = 2.0**-19
#: Where a probe has the square of how far from its box is near.
_SQUARE = 12
#: Floats hold lengths below, in units, and their products.
_LARGEST = 2.0**60
#: Of balls that are left to others.
_UNTOLD = Nearest(math.inf, -1, math.inf, math.inf, math.inf, math.inf, Vec3(0.0, 0.0, 0.0), -math.inf, True, 0)
#: Normals of a smaller size say nothing.
_LEAST_NORMAL = 1e-100


@kernel
def _set_probe(walk, margin, frame, probe):
    """Make the set's box the probe, wider by the margin, radii and rounding; returns by how many units, or −1 where
    floats are too small for the box.

    The point y of a ball within the margin [m] is within w = margin + slack of a point m + A λ of the box, |λ_j| ≤ h_j,
    with the axes a_j of the box as columns of A: y differs from m along axis i of the tree by at most Σ |a_j[i]| h_j +
    w. Along the axes of the box y − m is λ + (AᵀA − I) λ + Aᵀe with |e| ≤ w. No entry of AᵀA − I is above off, so this
    is farther from the box, in all, than w by at most √3 · off · |h|₁ + 1.5 · off · w, less than 2 · off · size.
    """
    tree, poses, box = walk.tree, walk.poses, view_f64(walk.words[BOX_AT], BOX)
    per_metre = math.ldexp(1.0, -int(tree.header[EXPONENT]))
    c = rotate_back(poses, 0, add(rotate(poses, POSE, vec3_at(box, 0)), walk.t))
    m, h = scale(per_metre, sub(c, vec3_at(tree.numbers, CENTRE))), scale(per_metre, vec3_at(box, 3))
    wider = per_metre * (margin + walk.slack)
    size = 4.0 + norm1(m) + norm1(h) + wider
    off = off_rotation(view_f64(walk.words[POSES_AT] + 8 * POSE, POSE), 0)
    wider += (_FLOAT_ROUNDING + 2.0 * off) * size
    if not (size + wider) * (2.0 + off) < _LARGEST:  # 2 + off is more than the length of an axis
        return -1.0
    reach = Vec3(wider, wider, wider)
    for j in range(3):
        a = rotate_back(poses, 0, Vec3(poses[POSE + j], poses[POSE + 3 + j], poses[POSE + 6 + j]))
        half = h.x if j == 0 else h.y if j == 1 else h.z
        reach = add(reach, scale(half, absolute(a)))
        frame[3 * j], frame[3 * j + 1], frame[3 * j + 2] = np.float32(a.x), np.float32(a.y), np.float32(a.z)
        probe[6 + j], probe[9 + j] = np.float32(-dot(a, m)), np.float32(half)
    probe[0], probe[1], probe[2] = np.float32(m.x), np.float32(m.y), np.float32(m.z)
    probe[3], probe[4], probe[5] = np.float32(reach.x), np.float32(reach.y), np.float32(reach.z)
    probe[_SQUARE] = np.float32(wider * wider * (1.0 + _FLOAT_ROUNDING))
    for k in range(PROBE, PRISM):
        probe[k] = np.float32(0.0)
    return wider


@kernel
def _put_plane(walk, n, wider, number, probe):
    """Let a probe leave out what lies beyond the plane of normal n, of the world, that bounds the set.

    Points x of the set have n·x ≥ b. A ball within the margin has n·y ≥ b − wider for its point y.   number : how many
    planes were put before: the last three count.
    """
    length = norm(n)
    if not length > _LEAST_NORMAL:
        return
    n = divide(n, length)  # a radius reaches as far along unit vectors alone
    g = rotate_back(walk.poses, 0, n)
    per_metre = math.ldexp(1.0, -int(walk.tree.header[EXPONENT]))
    least = dot(n, walk.t) - height_along(walk, neg(n)) - dot(g, vec3_at(walk.tree.numbers, CENTRE))
    least = per_metre * least - wider
    at = PROBE + 4 * (number % 3)
    probe[at], probe[at + 1], probe[at + 2] = np.float32(-g.x), np.float32(-g.y), np.float32(-g.z)
    probe[at + 3] = np.float32(least - _FLOAT_ROUNDING * (abs(least) + 8.0))


@kernel
def _state_of_ball(walk, place, margin):
    """MEETS, NEAR, SURFACES_APART or LONG_WAY of a ball and the set, and a normal from the ball to the set.

    Booleans look for a direction that parts two bodies, and often leave a point in a polytope open: the distance is
    asked then.
    """
    box, tree = view_f64(walk.words[BOX_AT], BOX), walk.tree
    p = vec3_at(points_of(tree), 3 * int(tree.ids[place]))
    to_set = sub(add(rotate(walk.poses, POSE, vec3_at(box, 0)), walk.t), rotate(walk.poses, 0, p))
    row = whether_item(walk, place, to_set, margin)
    n = vec3_at(row.doubles, NORMAL)
    if is_undecided_or_refused(row):
        row = ask_item(walk, place, False, math.inf)
    if is_undecided_or_refused(row):
        return LONG_WAY, n
    if row.flags[HIT] != 0:
        return MEETS, n
    return (NEAR if margin > 0.0 and not row.doubles[LOWER] > margin else SURFACES_APART), n


@kernel(inline=True)
def _open_probe(walk):
    """(frame, probe) of a walk's workspace."""
    at = walk.words[PROBE_AT]
    return view_f32(at, FRAME), view_f32(at + 4 * FRAME, PRISM)


@kernel(inline=True)
def _open_stack(walk):
    """(stack, keys) of a walk's workspace."""
    n = WIDTH * (MAX_LEVELS + 1)
    return view_i64(walk.words[STACK_AT], n), view_f64(walk.words[BOUNDS_AT], n)


@kernel(inline=True)
def _nearness(frame, probe, x, y, z):
    """The squared distance of a place from the probe's box, below 0 inside of it: an order, not a bound."""
    square, inside = np.float32(0.0), np.float32(-math.inf)
    for axis in range(3):
        j = 3 * axis
        along = probe[6 + axis] + frame[j] * x + frame[j + 1] * y + frame[j + 2] * z
        gap = abs(along) - probe[9 + axis]
        square += max(gap, np.float32(0.0)) * max(gap, np.float32(0.0))
        inside = max(inside, gap)
    return square if inside > 0.0 else inside


@kernel
def _push_boxes(tree, node, frame, probe, stack, keys, top):
    """Put boxes of a node that meet the probe on the stack, the nearest on top; returns its height."""
    first, boxes, near = top, tree.boxes, boxes_within(tree.boxes, NODE * node, frame, probe)
    for slot in range(WIDTH):
        if not near >> slot & 1:
            continue
        at = NODE * node + slot
        key = float(_nearness(frame, probe, boxes[at], boxes[at + WIDTH], boxes[at + 2 * WIDTH]))
        k = top
        while k > first and keys[k - 1] < key:
            keys[k], stack[k] = keys[k - 1], stack[k - 1]
            k -= 1
        keys[k], stack[k] = key, WIDTH * node + slot
        top += 1
    return top


@kernel
def _next_leaf(tree, frame, probe, stack, keys, top):
    """(link of the next leaf, stack's height without the leaf): nodes on top are opened; 0 for an empty stack."""
    while top > 0:
        top -= 1
        link = link_of(tree.links, stack[top])
        if link < 0:
            return link, top
        top = _push_boxes(tree, link, frame, probe, stack, keys, top)
    return 0, 0


@kernel(inline=True)
def _nearest_of(near, floats, leaf, frame, probe):
    """The number of the nearest point of a leaf among those of a mask."""
    nearest, least = -1, np.float32(math.inf)
    for i in range(MAX_LEAF):
        if near >> i & 1:
            at = leaf + i
            key = _nearness(frame, probe, floats[at], floats[at + WIDTH], floats[at + 2 * WIDTH])
            if key < least or nearest < 0:
                nearest, least = i, key
    return nearest


@kernel
def _state_by_box(walk, margin):
    """MEETS; NEAR at the first ball within a margin above 0 [m]; SURFACES_APART; LONG_WAY where a ball is left open."""
    tree, (frame, probe) = walk.tree, _open_probe(walk)
    wider, floats = _set_probe(walk, margin, frame, probe), floats_of(tree)
    if wider < 0.0:
        return LONG_WAY
    (stack, keys), n_planes, answer = _open_stack(walk), 0, SURFACES_APART
    link, top = _next_leaf(tree, frame, probe, stack, keys, _push_boxes(tree, 0, frame, probe, stack, keys, 0))
    while link < 0:
        first, leaf = ~link >> 3, LEAF_FLOATS * ((~link >> 3) // MAX_LEAF)
        remaining = (1 << (~link & 7)) - 1
        near = points_within(floats, leaf, frame, probe) & remaining
        while near != 0:
            i = _nearest_of(near, floats, leaf, frame, probe)
            state, n = _state_of_ball(walk, first + i, margin)
            if state == MEETS or state == NEAR:
                return state
            remaining &= ~(1 << i)
            if state == LONG_WAY:
                answer = LONG_WAY
            else:
                _put_plane(walk, n, wider, n_planes, probe)
                n_planes += 1
            near = points_within(floats, leaf, frame, probe) & remaining
        link, top = _next_leaf(tree, frame, probe, stack, keys, top)
    return answer


@kernel
def _state_by_centre(walk, margin):
    """MEETS, NEAR, SURFACES_APART or LONG_WAY of a ball as the set and balls of one radius."""
    ints, numbers, poses = walk.ints, walk.numbers, walk.poses
    padded = ints[INTS + PADDED]
    centre = column_at(view_f64(ints[INTS + ADDRESS], 3 * padded), padded, 0)
    radii = numbers[RADIUS] + numbers[NUMBERS + RADIUS] + margin
    slop = numbers[NUMBERS + SLOP] + poses[POSE_SLOP] + poses[POSE + POSE_SLOP]
    stack = view_i64(walk.words[STACK_AT], WIDTH * (MAX_LEVELS + 1))
    state = state_of_balls(walk.tree, poses, centre, radii, slop, off_rotation(poses, 0), stack)
    if state == OPEN:
        return LONG_WAY
    return SURFACES_APART if state != BALLS_MEET else NEAR if margin > 0.0 else MEETS


@kernel
def _place_nearby(tree, frame, probe):
    """The place of a ball near the probe: at each node the box goes on whose centre is the nearest."""
    boxes, link = tree.boxes, link_of(tree.links, 0)
    while link >= 0:
        at, nearest, least = NODE * link, -1, np.float32(math.inf)
        for slot in range(WIDTH):
            if boxes[at + slot + 3 * WIDTH] > NOTHING / 2:
                key = _nearness(frame, probe, boxes[at + slot], boxes[at + slot + WIDTH], boxes[at + slot + 2 * WIDTH])
                if key < least or nearest < 0:
                    nearest, least = slot, key
        link = link_of(tree.links, WIDTH * link + nearest)
    first, remaining = ~link >> 3, (1 << (~link & 7)) - 1
    return first + _nearest_of(remaining, floats_of(tree), LEAF_FLOATS * (first // MAX_LEAF), frame, probe)


@kernel
def nearest_ball(walk, limit):
    """The `Nearest` of all balls within a limit [m]: a ball nearby first, then the balls within the least upper bound
    so far.
    """
    tree, (frame, probe) = walk.tree, _open_probe(walk)
    if _set_probe(walk, 0.0, frame, probe) < 0.0:
        return _UNTOLD
    (stack, keys), floats, asked = _open_stack(walk), floats_of(tree), _place_nearby(tree, frame, probe)
    nearest, wider = _with_ball(walk, begin_nearest(limit), asked, -1.0, frame, probe)
    link, top = _next_leaf(tree, frame, probe, stack, keys, _push_boxes(tree, 0, frame, probe, stack, keys, 0))
    while link < 0 and not nearest.failed:
        first, leaf, remaining = ~link >> 3, LEAF_FLOATS * ((~link >> 3) // MAX_LEAF), (1 << (~link & 7)) - 1
        if 0 <= asked - first < MAX_LEAF:
            remaining &= ~(1 << (asked - first))
        near = points_within(floats, leaf, frame, probe) & remaining
        while near != 0 and not nearest.failed:
            i = _nearest_of(near, floats, leaf, frame, probe)
            remaining &= ~(1 << i)
            nearest, wider = _with_ball(walk, nearest, first + i, wider, frame, probe)
            near = points_within(floats, leaf, frame, probe) & remaining
        link, top = _next_leaf(tree, frame, probe, stack, keys, top)
    return nearest


@kernel
def _with_ball(walk, nearest, place, wider, frame, probe):
    """(`Nearest`, how much wider the probe is) with a ball more: the probe is as wide as the least upper bound, and
    leaves out what lies beyond the plane of the ball's row.

    wider : below 0 of a probe for another distance.
    """
    before = nearest.limit
    nearest = with_item(walk, nearest, place, math.inf)
    if nearest.failed:
        return nearest, wider
    if nearest.limit < before or wider < 0.0:
        wider = _set_probe(walk, nearest.limit, frame, probe)
        if wider < 0.0:
            return _UNTOLD, wider
    _put_plane(walk, vec3_at(view_row(walk.words[ROW_AT] + ROW).doubles, NORMAL), wider, nearest.n_asked, probe)
    return nearest, wider


@kernel
def state_of_cloud(walk, margin):
    """`_state_by_centre` or `_state_by_box`; NEAR only where no ball is known to meet the set."""
    is_ball = walk.ints[INTS + KIND] == POINTS and walk.ints[INTS + COUNT] == 1 and walk.words[RADII_AT] == 0
    state = _state_by_centre(walk, margin) if is_ball else _state_by_box(walk, margin)
    if state == NEAR and (_state_by_centre(walk, 0.0) if is_ball else _state_by_box(walk, 0.0)) == MEETS:
        return MEETS
    return state


@kernel
def _list_near(walk, margin, max_balls, numbers, at):
    """(how many balls were listed from ``at`` on, whether these are all) of the balls whose points may be within the
    margin and radii of the set's box, about the nearest first; −1 where floats are too small for the box.

    An infinite margin lists one ball nearby.
    """
    tree, (frame, probe) = walk.tree, _open_probe(walk)
    if _set_probe(walk, 0.0 if margin == math.inf else margin, frame, probe) < 0.0:
        return -1, False
    if margin == math.inf:
        numbers[at] = int(tree.ids[_place_nearby(tree, frame, probe)])
        return 1, False
    (stack, keys), floats, n = _open_stack(walk), floats_of(tree), 0
    link, top = _next_leaf(tree, frame, probe, stack, keys, _push_boxes(tree, 0, frame, probe, stack, keys, 0))
    while link < 0:
        near = points_within(floats, LEAF_FLOATS * ((~link >> 3) // MAX_LEAF), frame, probe)
        for i in range(~link & 7):
            if near >> i & 1:
                if n == max_balls:
                    return n, False
                numbers[at + n] = int(tree.ids[(~link >> 3) + i])
                n += 1
        link, top = _next_leaf(tree, frame, probe, stack, keys, top)
    return n, True


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def list_balls_near(header_at, XA_at, XB_at, n, margins_at, max_balls, counts_at, numbers_at, states_at):
    """Balls of a cloud near a convex set's box at n pairs of checked poses: whatever has a point within the margin, of
    each pose, of the set is among them, but for poses with ``max_balls`` balls, whose list may be cut short.

    margins : (n,) [m].   counts : (n,).   numbers : (n, max_balls).   states : a byte a pose: 0 for a list cut short,
    1 for a whole list, 2 for poses left to others.
    """
    margins, counts = view_f64(margins_at, n), view_i64(counts_at, n)
    numbers, states = view_i64(numbers_at, n * max_balls), view_u8(states_at, n)
    for k in range(n):
        placed = set_poses(header_at, XA_at + 128 * k, XB_at + 128 * k, False)
        is_near, walk = begin_walk(header_at)
        count, is_whole = -1, False
        if placed and is_near:
            count, is_whole = _list_near(walk, margins[k], max_balls, numbers, max_balls * k)
        states[k] = 2 if count < 0 else 1 if is_whole else 0
        counts[k] = max(count, 0)
