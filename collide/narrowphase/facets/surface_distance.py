"""The distance of two posed surfaces, with nearest points and a proven bracket.

A traversal over pairs of boxes, nearest first, that leaves out what is proven farther than the nearest points so far.
The direction between these is an axis for all boxes to come: that, and starting near, is what saves most.

Leaves are measured in the world's axes with A's origin as theirs: x = R_A v, y = R_B w + (t_B − t_A). Both are off by
at most E a coordinate (`WORLD_ERROR`), so a distance or the width of a slab is off by 4E. Whatever the boxes leave
out is farther than the bound at that time; every pair of triangles met adds its slab. Their least is the lower bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, NEAR_PROBE, boxes_nearest
from collide.mesh.bvh import EXPONENT, N_NODES, NODE, SLAB, SLABS_AT, WIDTH, box_size, link_of, open_tree
from collide.mesh.triangle import put_triangle, triangle_at
from collide.narrowphase.facets.distance_search import (
    ALONG_A,
    ALONG_B,
    BEST,
    BOUND,
    DIRECTION,
    DISTANCE,
    ENOUGH,
    EXACT,
    FACET_A,
    FACET_B,
    HEAP_SIZE,
    INTS,
    LEAST,
    LEAVES,
    LEAVES_WITHOUT_IMPROVEMENT,
    LOWER,
    MARKS,
    MEETS,
    NEAR,
    NEW,
    NODES,
    NORMAL,
    OF_A_AT,
    POINT_A,
    POINT_B,
    POINTS,
    RESULT,
    TRIANGLES,
    TRIANGLES_AT,
    UPPER,
    WORLD_ERROR,
    DistanceQuery,
    gap_of_box,
    is_beyond_bound,
    prepare,
    set_direction,
    set_near_probe,
    upper_bound,
)
from collide.narrowphase.facets.exact_corners import CORNERS
from collide.narrowphase.facets.large_facets import gap_to_facet, world_box
from collide.narrowphase.facets.pair_heap import pop_heap, push_heap
from collide.narrowphase.facets.posed_surfaces import (
    PLACING,
    UNITS,
    is_swapped_order,
    put_in_frame_of_a,
    put_in_world,
    shift_between,
)
from collide.narrowphase.facets.posed_trees import facets_meet, pose_trees
from collide.narrowphase.facets.traversal import OF_A, OF_B, make_traversal, opens_b, word_of
from collide.narrowphase.facets.triangle_distance import common_point, nearest_points, separated_by, slab, widest_slab
from collide.numerics.vec3 import Vec3, add, divide, dot, max_abs, neg, put_vec3, scale, sub, vec3_at

#: Depth first until so many pairs of leaves were met, to have a bound and a direction; then the nearest boxes first,
#: and again depth first, which costs no heap, while the bound has not got better for so many pairs of leaves.
_DEPTH_FIRST_LEAVES, _MAX_LEAVES_WITHOUT_IMPROVEMENT = 4, 16

#: A leaf is compared with a box facet by facet where it is so many times as large.
_LARGE = 2.0

#: Points nearer than so many times the error of a coordinate give no direction: it may be off by one over that.
_DIRECTION_RATIO = 2.0**26

#: No UPPER is so small: the distance is searched to the end.
IN_FULL = -1.0

DOUBLES = PLACING + CORNERS + NEAR
FLOATS = 2 * FRAME + NEAR_PROBE + 2 * WIDTH


class _NearPair(NamedTuple):
    """A `traversal.BoxPair` with the least products of both boxes with the direction, of A's with its opposite."""

    a: int
    b: int
    link_a: int
    link_b: int
    gap_a: float
    gap_b: float


@kernel(inline=True)
def _pair_behind(query, word):
    A, B, near = query.trees.A, query.trees.B, query.near
    a = word >> 32
    b = word & 0xFFFFFFFF
    link_a = link_of(A.links, a)
    link_b = link_of(B.links, b)
    gap_a = gap_of_box(neg(vec3_at(near, ALONG_A)), A, query.slabs_a, query.unit_a, a, link_a)
    gap_b = gap_of_box(vec3_at(near, ALONG_B), B, query.slabs_b, query.unit_b, b, link_b)
    return _NearPair(a, b, link_a, link_b, gap_a, gap_b)


@kernel(inline=True)
def _is_past_large_facets(query, pair):
    """Whether every facet of a leaf much larger than the other box is farther from the other box than the bound."""
    trees = query.trees
    A, B, units = trees.A, trees.B, trees.placing[UNITS]
    origin = Vec3(0.0, 0.0, 0.0)
    if pair.link_b < 0 and box_size(B.boxes, pair.b) > _LARGE * units * box_size(A.boxes, pair.a):
        box = world_box(trees.XA, origin, A, pair.a)
        return _are_farther(query.near, box, trees.XB, query.shift, B, ~pair.link_b)
    if pair.link_a < 0 and units * box_size(A.boxes, pair.a) > _LARGE * box_size(B.boxes, pair.b):
        box = world_box(trees.XB, query.shift, B, pair.b)
        return _are_farther(query.near, box, trees.XA, origin, A, ~pair.link_a)
    return False


@kernel
def _are_farther(near, box, X, shift, tree, run):
    """Whether all facets of a run are farther from a box than the bound.

    Corners of both are off by at most 8 E a coordinate, the rounding in the making of the box included: gaps along unit
    vectors, two of them combined, are off by less than 64 E.
    """
    bound = near[BEST] + 64.0 * near[WORLD_ERROR]
    if not bound < math.inf:
        return False
    for facet in range(run >> 3, (run >> 3) + (run & 7)):
        if not gap_to_facet(box, X, shift, tree.triangles, facet) > bound:
            return False
    return True


@kernel(inline=True)
def _open_pair(query, pair, stack, top):
    """Push the children of the larger box that are nearer to the other box than the bound."""
    trees = query.trees
    A, B = trees.A, trees.B
    if is_beyond_bound(query.near, pair) or _is_past_large_facets(query, pair):
        return top
    query.marks[NODES] += 1
    if opens_b(A, B, pair, trees.placing[UNITS]):
        node = pair.link_b
        set_near_probe(query, 0, A, pair.a, pair.gap_a, B, node)
        boxes_nearest(B.boxes, NODE * node, query.slabs_b, SLAB * node, trees.frame_a, trees.probe, query.gaps)
        return _push_nearest(query, stack, top, word_of(pair.a, WIDTH * node), OF_B)
    node = pair.link_a
    set_near_probe(query, 1, B, pair.b, pair.gap_b, A, node)
    boxes_nearest(A.boxes, NODE * node, query.slabs_a, SLAB * node, trees.frame_b, trees.probe, query.gaps)
    return _push_nearest(query, stack, top, word_of(WIDTH * node, pair.b), OF_A)


@kernel(inline=True)
def _push_nearest(query, stack, top, word, step):
    """Push the children nearer than the bound, the nearest centres on top.   word, step : of `push_children`."""
    gaps, order, bound = query.gaps, query.order, query.near[BOUND]
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
    ints, bounds, bound = query.ints, query.bounds, query.near[BOUND]
    stale = ints[LEAVES_WITHOUT_IMPROVEMENT] > _MAX_LEAVES_WITHOUT_IMPROVEMENT
    while top > 0 and (ints[LEAVES] < _DEPTH_FIRST_LEAVES or stale or ints[HEAP_SIZE] + top > query.n_heap):
        if bounds[top - 1] < bound:
            return top
        top -= 1
    while top > 0:
        top -= 1
        ints[HEAP_SIZE] = push_heap(query.heap, query.keys, ints[HEAP_SIZE], stack[top], bounds[top])
    if ints[HEAP_SIZE] == 0 or query.keys[0] >= bound:
        return 0
    stack[0] = query.heap[0]
    ints[HEAP_SIZE] = pop_heap(query.heap, query.keys, ints[HEAP_SIZE])
    return 1


# --- triangles ----------------------------------------------------------------------------------


@kernel(inline=True)
def _visit_leaves(query, pair):
    """Compare the facets of two leaves with the best distance so far; True where two facets meet, or are near enough to
    end the search."""
    trees, near, ints = query.trees, query.near, query.ints
    if is_beyond_bound(near, pair) or _is_past_large_facets(query, pair):
        return False
    ints[LEAVES] += 1
    ints[LEAVES_WITHOUT_IMPROVEMENT] += 1
    best = near[BEST]
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
    if near[BEST] < best:
        if upper_bound(near) <= near[ENOUGH]:
            return True
        ints[LEAVES_WITHOUT_IMPROVEMENT] = 0
        near[BOUND] = near[BEST] * query.unit_a
        set_direction(query, sub(vec3_at(near, POINTS + 3), vec3_at(near, POINTS)))
    return False


@kernel(inline=True)
def _measure(query, a, b):
    """Compare facets a of A and b of B, as the query's triangles, with the best so far; True where they meet."""
    trees, near, T, points = query.trees, query.near, query.triangles, query.points
    error = 4.0 * near[WORLD_ERROR]
    query.marks[TRIANGLES] += 1
    width = slab(T, vec3_at(near, DIRECTION)) - error
    if width >= near[BEST] or separated_by(T, near[BEST] + 2.0 * error):
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
    if width < min(length, near[BEST]) * (1.0 - 2.0**-44) - error:
        width = max(width, widest_slab(T)[0] - 2.0 * error)
    near[LEAST] = min(near[LEAST], width)
    if length < near[BEST]:
        near[BEST] = length
        _keep_points(query, a, b)
    return False


@kernel(inline=True)
def _keep_points(query, a, b):
    for k in range(6):
        query.near[POINTS + k] = query.points[k]
    query.marks[FACET_A] = a
    query.marks[FACET_B] = b


_traverse = make_traversal(_next_pair, _pair_behind, _visit_leaves, _open_pair)


# --- results ------------------------------------------------------------------------------------


@kernel
def _direction_between(query):
    """The unit vector from A to B along which the nearest triangles are apart; zeros where no direction can be told.

    The line between the nearest points, unless rounding has turned the line. Points nearer than `_DIRECTION_RATIO`
    errors are compared with the normals and edges of both triangles, and the widest slab decides; within rounding, a
    slab of the triangles. The points are then laid along the slab's normal, through their middle: how far this moves
    them is how far they were from being the nearest.
    """
    trees, near, marks, T = query.trees, query.near, query.marks, query.triangles
    point_a = vec3_at(near, POINTS)
    point_b = vec3_at(near, POINTS + 3)
    direction = sub(point_b, point_a)
    size = max_abs(direction)
    width = -math.inf
    if size > 0.0:
        direction = divide(direction, size)
        direction = divide(direction, math.sqrt(dot(direction, direction)))
        if size > _DIRECTION_RATIO * near[WORLD_ERROR]:
            return direction
    put_in_world(trees.XA, Vec3(0.0, 0.0, 0.0), trees.A.triangles, 9 * marks[FACET_A], T, 0)
    put_in_world(trees.XB, query.shift, trees.B.triangles, 9 * marks[FACET_B], T, 9)
    if size > 0.0:
        width = slab(T, direction)
    widest, normal = widest_slab(T)
    if widest <= width - 4.0 * near[WORLD_ERROR]:
        return direction
    half = scale(0.5 * near[BEST], normal)
    middle = add(scale(0.5, point_a), scale(0.5, point_b))
    put_vec3(near, POINTS, sub(middle, half))
    put_vec3(near, POINTS + 3, add(middle, half))
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
    length = 0.0 if meets else near[BEST]
    error = 0.0 if meets else 4.0 * near[WORLD_ERROR]
    out[DISTANCE] = length
    out[UPPER] = length + error if has_points else math.inf
    # Where the search ended early, facets that were not looked at may be nearer.
    unseen_nearer = meets or (has_points and out[UPPER] <= near[ENOUGH])
    out[LOWER] = 0.0 if unseen_nearer else max(0.0, min(near[LEAST], length - error if has_points else limit))
    point_a = vec3_at(near, POINTS)
    point_b = vec3_at(near, POINTS + 3)
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
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, float64, int64, int64, int64, int64,"
    " int64, int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def near_surfaces(
    header_a_at, header_b_at, XA_at, step_a, XB_at, step_b, n, same_tree, limit, enough, results_at, marks_at,
    stack_at, n_stack, heap_at, n_heap, doubles_at, integers_at, exact_at,
):
    """Distances of two surfaces at n pairs of poses; returns how many were done (fewer: the next matrix is singular).

    Arguments are flat: entries are called by address, from C too.
    limit : larger distances are not looked for; where nothing is found, facets are −1 and LOWER is the limit.
    enough : a search ends at an UPPER of no more than this, LOWER being 0 then; never at IN_FULL.
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
        query = DistanceQuery(
            trees, view_f32(A.header[SLABS_AT], SLAB * A.header[N_NODES]),
            view_f32(B.header[SLABS_AT], SLAB * B.header[N_NODES]), shift_between(trees.XA, trees.XB),
            math.ldexp(1.0, int(-A.header[EXPONENT])), math.ldexp(1.0, int(-B.header[EXPONENT])),
            view_f64(near_at, NEAR), view_f64(near_at + 8 * TRIANGLES_AT, 18), view_f64(near_at + 8 * NEW, 6),
            view_f64(near_at + 8 * OF_A_AT, 63), view_i64(near_at + 8 * INTS, 3),
            view_f32(floats_at + 8 * FRAME + 4 * NEAR_PROBE, 2 * WIDTH), view_i64(stack_at + 16 * n_stack, WIDTH),
            view_f64(stack_at + 8 * n_stack, n_stack), view_i64(heap_at, n_heap),
            view_f64(heap_at + 8 * n_heap, n_heap), n_heap, view_i64(marks_at + 8 * MARKS * k, MARKS),
        )
        prepare(query, limit, enough)
        stack[0] = 0
        query.bounds[0] = 0.0
        query.marks[MEETS] = 0
        _traverse(query, stack, 1)
        _put_result(query, swapped, limit, view_f64(results_at + 8 * RESULT * k, RESULT))
    return n
