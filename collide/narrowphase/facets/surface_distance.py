"""The distance of two posed surfaces, with nearest points and a proven bracket.

A traversal over pairs of boxes, nearest first, that leaves out what is proven farther than the nearest points so far.
The direction between these is an axis for all boxes to come: that, and starting near, is what saves most.

Leaves are measured in the world's axes with A's origin as theirs: x = R_A v, y = R_B w + (t_B − t_A). Both are off by
at most E a coordinate (`_WORLD_ERROR`), so a distance or the width of a slab is off by 4E. Whatever the boxes leave
out is farther than the bound at that time; every pair of triangles met adds its slab. Their least is the lower bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, NEAR_PROBE, boxes_nearest
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    N_NODES,
    NODE,
    REACH,
    SLAB,
    SLABS_AT,
    WIDTH,
    box_at,
    float_column_at,
    link_of,
    open_tree,
)
from collide.mesh.triangle import put_triangle, range_along, triangle_at
from collide.narrowphase.facets.box_probes import put_floats, set_probe
from collide.narrowphase.facets.exact_corners import CORNERS
from collide.narrowphase.facets.pair_heap import pop_heap, push_heap
from collide.narrowphase.facets.posed_surfaces import (
    INVERSE_A,
    INVERSE_B,
    MAX_UNIT_EXPONENT,
    PLACING,
    UNITS,
    is_swapped_order,
    put_in_frame_of_a,
    put_in_world,
    rotate_by_pose,
    shift_between,
)
from collide.narrowphase.facets.posed_trees import PosedTrees, facets_meet, pose_trees
from collide.narrowphase.facets.traversal import OF_A, OF_B, make_traversal, opens_b, word_of
from collide.narrowphase.facets.triangle_distance import common_point, nearest_points, separated_by, slab, widest_slab
from collide.numerics.vec3 import Vec3, absolute, add, divide, dot, max_abs, neg, put_vec3, scale, sub, vec3_at

# A row of results, doubles: distance, proven bounds, points on A and on B and the direction between them in the world.
DISTANCE, LOWER, UPPER, POINT_A, POINT_B, NORMAL = 0, 1, 2, 3, 6, 9
RESULT = 12
# And integers: facet of A, facet of B, whether the surfaces meet; boxes, triangles and exact decisions.
FACET_A, FACET_B, MEETS, BOXES, TRIANGLES, EXACT = range(6)
MARKS = 6

# What changes on the way, doubles ("near"): the direction from A to B (3) and, in units of A's boxes, its products with
# A's boxes (3), with B's (3) and with the shift (1), less rounding; the least lengths in the world of a gap of 1 along
# the axes of A's frame (3), of B's (3), along lines in A's frame and in B's; the best distance so far, also in units of
# A's boxes; the least slab; the bound of the error of a world coordinate; the nearest points so far (6).
_DIRECTION, _ALONG_A, _ALONG_B, _OFFSET, _WORTH_A, _WORTH_B, _LINE_A, _LINE_B = 0, 3, 6, 9, 10, 13, 16, 17
_BEST, _BOUND, _LEAST, _WORLD_ERROR, _POINTS = 18, 19, 20, 21, 22
# Then a pair of triangles in world axes (18), points of it (6), and up to seven triangles of A (63).
_TRIANGLES, _NEW, _OF_A = 28, 46, 52
# And integers: pairs on the heap, pairs of leaves met, of them since the best distance got better.
_INTS = _OF_A + 9 * 7
_HEAP_SIZE, _LEAVES, _LEAVES_WITHOUT_IMPROVEMENT = range(3)
NEAR = _INTS + 3

_U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: B's unit over A's beyond which floats might overflow.
_MAX_UNIT = 2.0**MAX_UNIT_EXPONENT
#: Depth first until so many pairs of leaves were met, to have a bound and a direction; then the nearest boxes first,
#: and again depth first, which costs no heap, while the bound has not got better for so many pairs of leaves.
_DEPTH_FIRST_LEAVES, _MAX_LEAVES_WITHOUT_IMPROVEMENT = 4, 16

#: Points nearer than so many times the error of a coordinate give no direction: it may be off by one over that.
_DIRECTION_RATIO = 2.0**26

DOUBLES = PLACING + CORNERS + NEAR
FLOATS = 2 * FRAME + NEAR_PROBE + 2 * WIDTH


class _Query(NamedTuple):
    """One pair of poses.

    slabs_a, slabs_b : of `mesh/bvh_slabs.py`.   shift : t_B − t_A.   unit_a, unit_b : boxes to the length of 1, each
        tree's.
    near, triangles, points, triangles_a, ints : as above.   gaps, order : of the children of a node.
    bounds : lower bounds of the pairs on the stack.   heap, keys : pairs in the order of their bounds, room for n_heap.
    """

    trees: PosedTrees
    slabs_a: np.ndarray
    slabs_b: np.ndarray
    shift: Vec3
    unit_a: float
    unit_b: float
    near: np.ndarray
    triangles: np.ndarray
    points: np.ndarray
    triangles_a: np.ndarray
    ints: np.ndarray
    gaps: np.ndarray
    order: np.ndarray
    bounds: np.ndarray
    heap: np.ndarray
    keys: np.ndarray
    n_heap: int
    marks: np.ndarray


class _NearPair(NamedTuple):
    """A `traversal.BoxPair` with the least products of both boxes with the direction, of A's with its opposite."""

    a: int
    b: int
    link_a: int
    link_b: int
    gap_a: float
    gap_b: float


# --- what does not change on the way ------------------------------------------------------------


@kernel
def _prepare(query, limit):
    """Start a pair of poses.   limit : nothing farther than this is looked for."""
    trees, near, marks = query.trees, query.near, query.marks
    A, B, XA, XB = trees.A, trees.B, trees.XA, trees.XB
    _set_worths(trees.placing, INVERSE_A, near, _WORTH_A, _LINE_A, 1.0)
    _set_worths(trees.placing, INVERSE_B, near, _WORTH_B, _LINE_B, 1.0 / trees.placing[UNITS])
    size = 0.0
    for i in range(3):
        terms = abs(XB[4 * i + 3] - XA[4 * i + 3])
        for j in range(3):
            terms += abs(XA[4 * i + j]) * A.numbers[REACH + j] + abs(XB[4 * i + j]) * B.numbers[REACH + j]
        size = max(size, terms)
    near[_WORLD_ERROR] = 8.0 * _U * size
    _set_direction(query, sub(_centre_in_world(XB, B), _centre_in_world(XA, A)))
    near[_BEST] = limit
    near[_BOUND] = limit * query.unit_a
    near[_LEAST] = math.inf
    marks[FACET_A] = -1
    marks[FACET_B] = -1
    for k in range(3):
        query.ints[k] = 0


@kernel
def _centre_in_world(X, tree):
    return add(rotate_by_pose(X, vec3_at(tree.numbers, CENTRE)), Vec3(X[3], X[7], X[11]))


@kernel
def _set_worths(placing, inverse, near, at, line, unit):
    """A gap of 1 along an axis of a frame is at least this long in the world: 1 over the row of the inverse.

    The inverse is off by at most 2⁻¹⁰ of its size where it is accepted, and by 2⁻⁵⁰ for rotations: the residual,
    measured again, is added.
    """
    largest = 0.0
    for i in range(3):
        row = 0.0
        across = 0.0
        for j in range(3):
            row += placing[inverse + 3 * i + j] ** 2
            product = 0.0
            for k in range(3):
                product += placing[inverse + 3 * k + i] * placing[inverse + 3 * k + j]
            across += abs(product)
        near[at + i] = row
        largest = max(largest, across)
    root = math.sqrt(largest)
    if unit > _MAX_UNIT:
        unit = 0.0
    slack = placing[inverse + 9] * 4.0 * root
    for i in range(3):
        near[at + i] = unit * (1.0 - 2.0**-18) / (math.sqrt(near[at + i]) + slack)
    near[line] = unit * (1.0 - 2.0**-18) / (root + slack)


@kernel
def _set_direction(query, direction):
    """Make the direction, from A to B and of any length, the axis of the boxes to come."""
    trees, near = query.trees, query.near
    A, B, XA, XB = trees.A, trees.B, trees.XA, trees.XB
    size = max_abs(direction)
    if not size > 0.0:
        direction = Vec3(1.0, 0.0, 0.0)
        size = 1.0
    direction = divide(direction, size)
    put_vec3(near, _DIRECTION, divide(direction, math.sqrt(dot(direction, direction)) * (1.0 + 2.0**-40)))
    unit = math.ldexp(1.0, int(B.header[EXPONENT] - A.header[EXPONENT]))
    offset = 0.0
    terms = 0.0
    spread = 0.0
    for i in range(3):
        shift = XB[4 * i + 3] - XA[4 * i + 3]
        offset += near[_DIRECTION + i] * shift
        terms += abs(shift)
    for j in range(3):
        along_a = 0.0
        along_b = 0.0
        for i in range(3):
            d = near[_DIRECTION + i]
            along_a += d * XA[4 * i + j]
            along_b += d * XB[4 * i + j]
            terms += abs(XA[4 * i + j] * A.numbers[CENTRE + j]) + abs(XB[4 * i + j] * B.numbers[CENTRE + j])
        offset += along_b * B.numbers[CENTRE + j] - along_a * A.numbers[CENTRE + j]
        near[_ALONG_A + j] = along_a
        near[_ALONG_B + j] = along_b * unit
        spread += abs(along_a) + abs(along_b * unit)
    if unit > _MAX_UNIT:
        put_vec3(near, _ALONG_B, Vec3(0.0, 0.0, 0.0))
        near[_OFFSET] = -math.inf
        return
    offset *= query.unit_a
    rounding = _FLOAT_ERROR * (abs(offset) + 1.001 * spread) + 2.0**-110 + 32.0 * _U * query.unit_a * terms
    near[_OFFSET] = offset - rounding


# --- boxes --------------------------------------------------------------------------------------


@kernel(inline=True)
def _gap_of_box(g, tree, slabs, unit, ref, link):
    """Least product of a box's contents with g, by the box and by its slab; of a leaf that of its corners."""
    if link < 0:
        first = ~link >> 3
        return unit * range_along(g, tree.triangles, first, first + (~link & 7), vec3_at(tree.numbers, CENTRE))[0]
    box = box_at(tree.boxes, ref)
    plain = dot(g, box.centre) - dot(absolute(g), box.half)
    at = SLAB * (ref >> 3) + (ref & 7)
    n = float_column_at(slabs, at)
    share = dot(g, n)
    thin = share * float(slabs[at + 3 * WIDTH]) - abs(share) * float(slabs[at + 4 * WIDTH])
    rest = sub(g, scale(share, n))
    thin += dot(rest, box.centre) - dot(absolute(rest), box.half)
    return max(plain, thin)


@kernel(inline=True)
def _pair_behind(query, word):
    A, B, near = query.trees.A, query.trees.B, query.near
    a = word >> 32
    b = word & 0xFFFFFFFF
    link_a = link_of(A.links, a)
    link_b = link_of(B.links, b)
    gap_a = _gap_of_box(neg(vec3_at(near, _ALONG_A)), A, query.slabs_a, query.unit_a, a, link_a)
    gap_b = _gap_of_box(vec3_at(near, _ALONG_B), B, query.slabs_b, query.unit_b, b, link_b)
    return _NearPair(a, b, link_a, link_b, gap_a, gap_b)


@kernel(inline=True)
def _is_beyond_bound(near, pair):
    """What was pushed before the direction turned is compared with it again."""
    return near[_OFFSET] + pair.gap_a + pair.gap_b >= near[_BOUND]


@kernel(inline=True)
def _set_near_probe(query, which, tree, ref, gap):
    """`set_probe`, and what distances need besides.   gap : `_gap_of_box` of the box."""
    near, probe = query.near, query.trees.probe
    set_probe(query.trees.placing, which, tree.boxes, ref, probe)
    probe_worth = _WORTH_A if which == 0 else _WORTH_B
    node_worth = _WORTH_B if which == 0 else _WORTH_A
    put_floats(probe, 12, vec3_at(near, node_worth))
    put_floats(probe, 15, vec3_at(near, probe_worth))
    probe[18] = np.float32(near[_LINE_A if which == 0 else _LINE_B])
    put_floats(probe, 19, vec3_at(near, _ALONG_B) if which == 0 else neg(vec3_at(near, _ALONG_A)))
    probe[22] = np.float32(near[_OFFSET] + gap)


@kernel(inline=True)
def _open_pair(query, pair, stack, top):
    """Push the children of the larger box that are nearer to the other one than the bound."""
    trees = query.trees
    A, B = trees.A, trees.B
    if _is_beyond_bound(query.near, pair):
        return top
    query.marks[BOXES] += 1
    if opens_b(A, B, pair, trees.placing[UNITS]):
        _set_near_probe(query, 0, A, pair.a, pair.gap_a)
        node = pair.link_b
        boxes_nearest(B.boxes, NODE * node, query.slabs_b, SLAB * node, trees.frame_a, trees.probe, query.gaps)
        return _push_nearest(query, stack, top, word_of(pair.a, WIDTH * node), OF_B)
    _set_near_probe(query, 1, B, pair.b, pair.gap_b)
    node = pair.link_a
    boxes_nearest(A.boxes, NODE * node, query.slabs_a, SLAB * node, trees.frame_b, trees.probe, query.gaps)
    return _push_nearest(query, stack, top, word_of(WIDTH * node, pair.b), OF_A)


@kernel(inline=True)
def _push_nearest(query, stack, top, word, step):
    """Push the children nearer than the bound, the nearest centres on top.   word, step : of `push_children`."""
    gaps, order, bound = query.gaps, query.order, query.near[_BOUND]
    count = 0
    for slot in range(WIDTH):
        if float(gaps[slot]) < bound:
            key = float(gaps[WIDTH + slot])
            k = count
            while k > 0 and float(gaps[WIDTH + order[k - 1]]) < key:
                order[k] = order[k - 1]
                k -= 1
            order[k] = slot
            count += 1
    for k in range(count):
        stack[top] = word + order[k] * step
        query.bounds[top] = float(gaps[order[k]])
        top += 1
    return top


@kernel(inline=True)
def _next_pair(query, stack, top):
    """Depth first, or the nearest of all pairs, as `_DEPTH_FIRST_LEAVES` says; what the bound excludes is left out."""
    ints, bounds, bound = query.ints, query.bounds, query.near[_BOUND]
    stale = ints[_LEAVES_WITHOUT_IMPROVEMENT] > _MAX_LEAVES_WITHOUT_IMPROVEMENT
    while top > 0 and (ints[_LEAVES] < _DEPTH_FIRST_LEAVES or stale or ints[_HEAP_SIZE] + top > query.n_heap):
        if bounds[top - 1] < bound:
            return top
        top -= 1
    while top > 0:
        top -= 1
        ints[_HEAP_SIZE] = push_heap(query.heap, query.keys, ints[_HEAP_SIZE], stack[top], bounds[top])
    if ints[_HEAP_SIZE] == 0 or query.keys[0] >= bound:
        return 0
    stack[0] = query.heap[0]
    ints[_HEAP_SIZE] = pop_heap(query.heap, query.keys, ints[_HEAP_SIZE])
    return 1


# --- triangles ----------------------------------------------------------------------------------


@kernel(inline=True)
def _visit_leaves(query, pair):
    """Compare the facets of two leaves with the best distance so far; True where two of them meet."""
    trees, near, ints = query.trees, query.near, query.ints
    if _is_beyond_bound(near, pair):
        return False
    ints[_LEAVES] += 1
    ints[_LEAVES_WITHOUT_IMPROVEMENT] += 1
    best = near[_BEST]
    a = ~pair.link_a >> 3
    b = ~pair.link_b >> 3
    for j in range(~pair.link_a & 7):
        put_in_world(trees.XA, Vec3(0.0, 0.0, 0.0), trees.A.triangles, 9 * (a + j), query.triangles_a, 9 * j)
    for i in range(~pair.link_b & 7):
        put_in_world(trees.XB, query.shift, trees.B.triangles, 9 * (b + i), query.triangles, 9)
        for j in range(~pair.link_a & 7):
            put_triangle(query.triangles, 0, triangle_at(query.triangles_a, 9 * j))
            if _measure(query, a + j, b + i):
                query.marks[MEETS] = 1
                return True
    if near[_BEST] < best:
        ints[_LEAVES_WITHOUT_IMPROVEMENT] = 0
        near[_BOUND] = near[_BEST] * query.unit_a
        _set_direction(query, sub(vec3_at(near, _POINTS + 3), vec3_at(near, _POINTS)))
    return False


@kernel(inline=True)
def _measure(query, a, b):
    """Compare facets a of A and b of B, as the query's triangles, with the best so far; True where they meet."""
    trees, near, T, points = query.trees, query.near, query.triangles, query.points
    error = 4.0 * near[_WORLD_ERROR]
    query.marks[TRIANGLES] += 1
    width = slab(T, vec3_at(near, _DIRECTION)) - error
    if width >= near[_BEST] or separated_by(T, near[_BEST] + 2.0 * error):
        return False
    apart = width > 0.0
    if not apart:
        put_in_frame_of_a(trees.placing, trees.B.triangles, 9 * b, trees.corners, 9)
        apart = not facets_meet(trees, a, b, query.marks, EXACT)
    length, width_between = nearest_points(T, points)
    if not apart:
        common_point(T, length, points)
        _keep_points(query, a, b)
        return True
    width = max(width, width_between - error)
    if width < min(length, near[_BEST]) * (1.0 - 2.0**-44) - error:
        width = max(width, widest_slab(T)[0] - 2.0 * error)
    near[_LEAST] = min(near[_LEAST], width)
    if length < near[_BEST]:
        near[_BEST] = length
        _keep_points(query, a, b)
    return False


@kernel(inline=True)
def _keep_points(query, a, b):
    for k in range(6):
        query.near[_POINTS + k] = query.points[k]
    query.marks[FACET_A] = a
    query.marks[FACET_B] = b


_traverse = make_traversal(_next_pair, _pair_behind, _visit_leaves, _open_pair)


# --- results ------------------------------------------------------------------------------------


@kernel
def _direction_between(query):
    """The unit vector from A to B along which the nearest triangles are apart; zeros where none can be told.

    The line between the nearest points, unless rounding has turned it. Points nearer than `_DIRECTION_RATIO` errors are
    compared with the normals and edges of both triangles, and the widest slab decides; within rounding, one of these.
    The points are then laid along that, through their middle: how far this moves them is how far they were from being
    the nearest.
    """
    trees, near, marks, T = query.trees, query.near, query.marks, query.triangles
    point_a = vec3_at(near, _POINTS)
    point_b = vec3_at(near, _POINTS + 3)
    direction = sub(point_b, point_a)
    size = max_abs(direction)
    width = -math.inf
    if size > 0.0:
        direction = divide(direction, size)
        direction = divide(direction, math.sqrt(dot(direction, direction)))
        if size > _DIRECTION_RATIO * near[_WORLD_ERROR]:
            return direction
    put_in_world(trees.XA, Vec3(0.0, 0.0, 0.0), trees.A.triangles, 9 * marks[FACET_A], T, 0)
    put_in_world(trees.XB, query.shift, trees.B.triangles, 9 * marks[FACET_B], T, 9)
    if size > 0.0:
        width = slab(T, direction)
    widest, normal = widest_slab(T)
    if widest <= width - 4.0 * near[_WORLD_ERROR]:
        return direction
    half = scale(0.5 * near[_BEST], normal)
    middle = add(scale(0.5, point_a), scale(0.5, point_b))
    put_vec3(near, _POINTS, sub(middle, half))
    put_vec3(near, _POINTS + 3, add(middle, half))
    return normal


@kernel
def _put_result(query, swapped, limit, out):
    """The row of results, and the facets' numbers; swapped : A and B change places there."""
    trees, near, marks = query.trees, query.near, query.marks
    meets = marks[MEETS] != 0
    has_points = marks[FACET_A] >= 0
    normal = Vec3(0.0, 0.0, 0.0)
    if has_points:
        if not meets:
            normal = _direction_between(query)
        marks[FACET_A] = trees.A.ids[marks[FACET_A]]
        marks[FACET_B] = trees.B.ids[marks[FACET_B]]
    length = 0.0 if meets else near[_BEST]
    error = 0.0 if meets else 4.0 * near[_WORLD_ERROR]
    out[DISTANCE] = length
    out[LOWER] = 0.0 if meets else max(0.0, min(near[_LEAST], length - error if has_points else limit))
    out[UPPER] = length + error if has_points else math.inf
    point_a = vec3_at(near, _POINTS)
    point_b = vec3_at(near, _POINTS + 3)
    if meets:
        point_a = add(scale(0.5, point_a), scale(0.5, point_b))
        point_b = point_a
    if swapped:
        point_a, point_b = point_b, point_a
        marks[FACET_A], marks[FACET_B] = marks[FACET_B], marks[FACET_A]
        normal = neg(normal)
    origin = Vec3(trees.XA[3], trees.XA[7], trees.XA[11])
    put_vec3(out, POINT_A, add(point_a, origin))
    put_vec3(out, POINT_B, add(point_b, origin))
    put_vec3(out, NORMAL, normal)


#: Of `near_surfaces`.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, int64, int64, int64, int64, int64, int64,"
    " int64, int64, int64)"
)


@entry(SIGNATURE)
def near_surfaces(
    header_a_at, header_b_at, XA_at, step_a, XB_at, step_b, n, same_tree, limit, results_at, marks_at, stack_at,
    n_stack, heap_at, n_heap, doubles_at, integers_at, exact_at,
):  # fmt: skip
    """Distances of two surfaces at n pairs of poses; returns how many were done (fewer: that matrix is singular).

    Arguments are flat: entries are called by address, from C too.
    limit : nothing farther than this is looked for; where nothing is found, facets are −1 and LOWER is it.
    results, marks : RESULT doubles and MARKS integers, zeros at first, a pose.   stack : 2·n_stack words and 8 more.
    """
    A = open_tree(header_a_at)
    B = open_tree(header_b_at)
    stack = view_i64(stack_at, n_stack)
    near_at = doubles_at + 8 * (PLACING + CORNERS)
    floats_at = doubles_at + 8 * DOUBLES
    for k in range(n):
        pose_a = XA_at + 8 * step_a * k
        pose_b = XB_at + 8 * step_b * k
        swapped = same_tree and is_swapped_order(view_f64(pose_a, 12), view_f64(pose_b, 12))
        if swapped:
            pose_a, pose_b = pose_b, pose_a
        trees, invertible = pose_trees(A, pose_a, B, pose_b, doubles_at, floats_at, NEAR_PROBE, integers_at, exact_at)
        if not invertible:
            return k
        query = _Query(
            trees, view_f32(A.header[SLABS_AT], SLAB * A.header[N_NODES]),
            view_f32(B.header[SLABS_AT], SLAB * B.header[N_NODES]), shift_between(trees.XA, trees.XB),
            math.ldexp(1.0, int(-A.header[EXPONENT])), math.ldexp(1.0, int(-B.header[EXPONENT])),
            view_f64(near_at, NEAR), view_f64(near_at + 8 * _TRIANGLES, 18), view_f64(near_at + 8 * _NEW, 6),
            view_f64(near_at + 8 * _OF_A, 63), view_i64(near_at + 8 * _INTS, 3),
            view_f32(floats_at + 8 * FRAME + 4 * NEAR_PROBE, 2 * WIDTH), view_i64(stack_at + 16 * n_stack, WIDTH),
            view_f64(stack_at + 8 * n_stack, n_stack), view_i64(heap_at, n_heap),
            view_f64(heap_at + 8 * n_heap, n_heap), n_heap, view_i64(marks_at + 8 * MARKS * k, MARKS),
        )  # fmt: skip
        _prepare(query, limit)
        stack[0] = 0
        query.bounds[0] = 0.0
        query.marks[MEETS] = 0
        _traverse(query, stack, 1)
        _put_result(query, swapped, limit, view_f64(results_at + 8 * RESULT * k, RESULT))
    return n
