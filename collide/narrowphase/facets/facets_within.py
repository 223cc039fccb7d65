"""All pairs of facets of two posed surfaces that meet or come within a distance, with nearest points of each.

The traversal of `surface_collision.py` with enlarged boxes: a distance d in the world is at most d times the length of
a row of the inverse along that axis of a frame. Triangles are measured as in `surface_distance.py`, in the world's axes
with A's origin as theirs, x = R_A v, y = R_B w + (t_B − t_A), both off by at most E a coordinate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.kernels.lanes import LANES, any_of, view_lanes
from collide.mesh.box_overlap import FRAME, PROBE
from collide.mesh.bvh import CENTRE, EXPONENT, MAX_LEAF, REACH, box_at, open_tree
from collide.mesh.triangle import put_triangle, triangle_at
from collide.narrowphase.facets.exact_corners import CORNERS
from collide.narrowphase.facets.posed_surfaces import (
    INVERSE_A,
    INVERSE_B,
    PLACING,
    put_in_frame_of_a,
    put_in_world,
    rotate_by_pose,
    shift_between,
)
from collide.narrowphase.facets.posed_trees import (
    MAX_FACET_PAIRS,
    PosedTrees,
    facets_meet,
    make_open_larger,
    pose_trees,
)
from collide.narrowphase.facets.surface_collision import FULL, SINGULAR
from collide.narrowphase.facets.traversal import make_traversal, pair_of_trees
from collide.narrowphase.facets.triangle_distance import common_point, nearest_points, separated_by
from collide.numerics.vec3 import Vec3, absolute, add, cross, dot, norm, put_vec3, scale, sub, vec3_at

# A pair, doubles: distance of its nearest points, proven lower bound, point of A, point of B; both points are the
# common one where they meet. And integers: facet of A, facet of B, whether they meet.
LENGTH, LOWER, POINT_A, POINT_B = 0, 1, 2, 5
NUMBERS_OF_PAIR = 8
FACET_A, FACET_B, MEETS = range(3)
INTS_OF_PAIR = 3

# Doubles of workspace besides a placing and corners: reaches along both frames' axes (6), two triangles (18), points
# (6), two integers, the facet pairs found and those decided exactly; leaves of either tree that were placed last, each
# in the slot of its number, and which they are.
_REACHES, _TRIANGLES, _POINTS, _COUNTERS, _LEAVES = 0, 6, 24, 30, 32
_N_PAIRS, _EXACT = range(2)
# What `list_near_pairs` is asked about seen along directions: words of a header, then doubles of each view. How many
# views; the height of the stack to go on with, 0 to begin; how many pairs are listed before; which bodies' facets have
# two sides, bits. A view: two unit vectors across the direction and the direction itself; limits of the gap along it;
# how far apart facets may lie seen along it; each of the three vectors, worked out by the kernel, as a row and an
# offset for boxes of A's tree, of B's; cosines of the facet that faces along the direction more, and of the other, at
# least, but for facets whose boxes are no farther apart than a reach.
N_VIEWS, STACKED, N_LISTED, TWO_SIDES, VIEWS_AT = range(5)
LEAST_GAP, LARGEST_GAP, BESIDE, _ROWS_OF_A, _ROWS_OF_B, FACES_ALONG, FACES, ANYWAY = 9, 10, 11, 12, 24, 36, 37, 38
VIEW = 39
#: Facets seen along a direction share points where they are no farther apart than so much of both together.
BETWEEN_SHADOWS = 2.0**-6

#: A normal whose length is below this part of the edges' product may be rounding: the facet has none.
_FLAT_FACET = 2.0**-44

#: Slots for leaves of a tree. Doubles of a leaf: corners of its triangles, then rows of eight, of each triangle the
#: least x, y, z and the largest, then normals.
_SLOTS, _BOXES, _NORMALS = 16, 9 * MAX_LEAF + 1, 9 * MAX_LEAF + 1 + 6 * LANES
_OF_LEAF = _NORMALS + 3 * LANES
DOUBLES = PLACING + CORNERS + _LEAVES + 2 * _SLOTS * (_OF_LEAF + 1)
FLOATS = 2 * FRAME + PROBE

#: Reaches beyond this, in units of boxes, would leave the floats: nothing is culled there.
_MAX_REACH = 1e30
_U = 2.0**-53


class _Query(NamedTuple):
    """reach : largest distance of a pair [m].   error : bound of the error of a coordinate in the world.

    shift : t_B − t_A.
    leaves, leaves_at, placed : the leaves placed last, their address, their first triangles.
    out, facets : doubles and integers of the pairs listed, room for ``capacity`` pairs.
    measures : whether the pairs are measured.   views, n_views, two_sides : of pairs, those let through by a view are
    listed; of `N_VIEWS` and its neighbours.
    """

    trees: PosedTrees
    reach: float
    error: float
    shift: Vec3
    reaches: np.ndarray
    triangles: np.ndarray
    points: np.ndarray
    counters: np.ndarray
    leaves: np.ndarray
    leaves_at: int
    placed: np.ndarray
    out: np.ndarray
    facets: np.ndarray
    capacity: int
    measures: bool
    views: np.ndarray
    n_views: int
    two_sides: int


@kernel
def _set_reaches(A, B, placing, reach, out):
    """``reach`` of the world along the axes of A's frame and of B's, in units of their boxes; rounded up."""
    for which in range(2):
        inverse = INVERSE_A if which == 0 else INVERSE_B
        exponent = A.header[EXPONENT] if which == 0 else B.header[EXPONENT]
        unit = math.ldexp(1.0, int(-exponent))
        largest = 0.0
        for k in range(9):
            largest = max(largest, abs(placing[inverse + k]))
        for i in range(3):
            row = 0.0
            for j in range(3):
                row += placing[inverse + 3 * i + j] ** 2
            length = math.sqrt(row) + 4.0 * placing[inverse + 9] * largest
            out[3 * which + i] = min(reach * unit * length * (1.0 + 2.0**-18), _MAX_REACH)


@kernel(inline=True)
def _widen_probe(query, which, probe):
    """Enlarge a probe's half lengths and slab by the reach."""
    reaches = query.reaches
    probe_axes = 3 * which
    node_axes = 3 - probe_axes
    half_width = float(probe[16])
    for i in range(3):
        probe[3 + i] = np.float32((float(probe[3 + i]) + reaches[node_axes + i]) * (1.0 + 2.0**-20))
        probe[9 + i] = np.float32((float(probe[9 + i]) + reaches[probe_axes + i]) * (1.0 + 2.0**-20))
    if half_width > 0.0:
        probe[16] = np.float32(
            half_width * (1.0 + 2.0**-20) + reaches[probe_axes] + reaches[probe_axes + 1] + reaches[probe_axes + 2]
        )


@kernel
def world_error(A, XA, B, XB):
    """Bound of the error of a coordinate in the world's axes."""
    size = 0.0
    for i in range(3):
        terms = abs(XA[4 * i + 3]) + abs(XB[4 * i + 3])
        for j in range(3):
            terms += abs(XA[4 * i + j]) * A.numbers[REACH + j] + abs(XB[4 * i + j]) * B.numbers[REACH + j]
        size = max(size, terms)
    return 8.0 * _U * size


@kernel(inline=True)
def _unless_full(query, _stack, top):
    return -top if query.counters[_N_PAIRS] + MAX_FACET_PAIRS > query.capacity else top


@kernel
def _set_rows(tree, X, shift, query, rows_at):
    """Set each view's rows and offsets: row · c + offset is the place of a box's centre c, in tree units, as seen.

    shift : of the body's origin, from that of A [m].
    """
    unit = math.ldexp(1.0, int(tree.header[EXPONENT]))
    middle = add(rotate_by_pose(X, vec3_at(tree.numbers, CENTRE)), shift)
    for i in range(3 * query.n_views):
        at = VIEW * (i // 3)
        axis = vec3_at(query.views, at + 3 * (i % 3))
        to = at + rows_at + 4 * (i % 3)
        for j in range(3):
            query.views[to + j] = unit * (axis.x * X[j] + axis.y * X[4 + j] + axis.z * X[8 + j])
        query.views[to + 3] = dot(axis, middle)


@kernel(inline=True)
def _are_seen(views, k, low_a, high_a, low_b, high_b):
    """Whether a view lets two spans along its vector k (0, 1 across, 2 along) through.

    Facets within boxes lie farther apart than the boxes do, and are no wider: what is refused of boxes is refused of
    all facets within.
    """
    at = VIEW * (k // 3)
    if k % 3 == 2:
        return low_b - high_a <= views[at + LARGEST_GAP] and high_b - low_a >= views[at + LEAST_GAP]
    apart = max(low_b - high_a, low_a - high_b)
    return not apart > BETWEEN_SHADOWS * (high_a - low_a + high_b - low_b) + views[at + BESIDE]


@kernel
def _boxes_are_seen(query, pair):
    """Whether some view lets pairs of facets in two boxes through."""
    a, b = box_at(query.trees.A, pair.a), box_at(query.trees.B, pair.b)
    views = query.views
    for view in range(query.n_views):
        is_seen = True
        for k in range(3 * view + 2, 3 * view - 1, -1):
            at = VIEW * view + 4 * (k % 3)
            of_a, of_b = vec3_at(views, at + _ROWS_OF_A), vec3_at(views, at + _ROWS_OF_B)
            middle_a, half_a = dot(of_a, a.centre) + views[at + _ROWS_OF_A + 3], dot(absolute(of_a), a.half)
            middle_b, half_b = dot(of_b, b.centre) + views[at + _ROWS_OF_B + 3], dot(absolute(of_b), b.half)
            if not _are_seen(views, k, middle_a - half_a, middle_a + half_a, middle_b - half_b, middle_b + half_b):
                is_seen = False
                break
        if is_seen:
            return True
    return False


@kernel(inline=True)
def _span_along(axis, leaves, at):
    """(least, largest) height of a triangle along a vector."""
    p, q, r = dot(axis, vec3_at(leaves, at)), dot(axis, vec3_at(leaves, at + 3)), dot(axis, vec3_at(leaves, at + 6))
    return min(p, q, r), max(p, q, r)


@kernel(inline=True)
def _face_along(query, view, at_a, i, at_b, j):
    """Whether triangles i and j of two leaves face along a view's direction, or are as near as counts anyway."""
    leaves, at = query.leaves, VIEW * view
    nhat = vec3_at(query.views, at + 6)
    cosine_a = dot(vec3_at(leaves, at_a + _NORMALS + 3 * i), nhat)
    cosine_b = -dot(vec3_at(leaves, at_b + _NORMALS + 3 * j), nhat)
    if query.two_sides & 1:
        cosine_a = abs(cosine_a)
    if query.two_sides & 2:
        cosine_b = abs(cosine_b)
    if max(cosine_a, cosine_b) >= query.views[at + FACES_ALONG] and min(cosine_a, cosine_b) >= query.views[at + FACES]:
        return True
    anyway = query.views[at + ANYWAY] + 8.0 * query.error
    return not _boxes_apart(leaves, at_a + _BOXES + i, at_b + _BOXES + j, anyway)


@kernel
def _facets_are_seen(query, at_a, a, at_b, b):
    """Whether some view lets triangles a and b of two leaves through."""
    leaves, i, j = query.leaves, at_a + 9 * a, at_b + 9 * b
    for view in range(query.n_views):
        is_seen = _face_along(query, view, at_a, a, at_b, b)
        if not is_seen:
            continue
        for k in range(3 * view + 2, 3 * view - 1, -1):
            axis = vec3_at(query.views, VIEW * view + 3 * (k % 3))
            low_a, high_a = _span_along(axis, leaves, i)
            low_b, high_b = _span_along(axis, leaves, j)
            if not _are_seen(query.views, k, low_a, high_a, low_b, high_b):
                is_seen = False
                break
        if is_seen:
            return True
    return False


@kernel(inline=True)
def _visit_leaves(query, pair):
    """List the facet pairs of two leaves that come within the reach."""
    if query.n_views > 0 and not _boxes_are_seen(query, pair):
        return False
    trees, T, leaves = query.trees, query.triangles, query.leaves
    first_a, n_a, first_b, n_b = ~pair.link_a >> 3, ~pair.link_a & 7, ~pair.link_b >> 3, ~pair.link_b & 7
    bound = query.reach + 8.0 * query.error
    at_a = _placed_leaf(query, 0, trees.A, trees.XA, Vec3(0.0, 0.0, 0.0), first_a, n_a)
    at_b = _placed_leaf(query, 1, trees.B, trees.XB, query.shift, first_b, n_b)
    rows = view_lanes(query.leaves_at + 8 * (at_a + _BOXES), 6)
    for j in range(n_b):
        box_b = at_b + _BOXES + j
        if not any_of(
            (leaves[box_b] - rows[3] <= bound) & (rows[0] - leaves[box_b + 3 * LANES] <= bound)
            & (leaves[box_b + LANES] - rows[4] <= bound) & (rows[1] - leaves[box_b + 4 * LANES] <= bound)
            & (leaves[box_b + 2 * LANES] - rows[5] <= bound) & (rows[2] - leaves[box_b + 5 * LANES] <= bound)
        ):
            continue
        b, of_b = first_b + j, at_b + 9 * j
        is_placed = False
        for i in range(n_a):
            if _boxes_apart(leaves, at_a + _BOXES + i, box_b, bound):
                continue
            if query.n_views > 0 and not _facets_are_seen(query, at_a, i, at_b, j):
                continue
            if not is_placed:
                put_in_frame_of_a(trees.placing, trees.B.triangles, 9 * b, trees.corners, 9)
                put_triangle(T, 9, triangle_at(leaves, of_b))
                is_placed = True
            put_triangle(T, 0, triangle_at(leaves, at_a + 9 * i))
            if separated_by(T, bound):
                continue
            if query.measures:
                _measure(query, first_a + i, b)
            else:
                put_vec3(query.points, 0, Vec3(0.0, 0.0, 0.0))
                put_vec3(query.points, 3, Vec3(0.0, 0.0, 0.0))
                _list(query, first_a + i, b, math.inf, math.inf, False)
    return False


@kernel(inline=True)
def _placed_leaf(query, side, tree, X, shift, first, n):
    """Place of a leaf's triangles in ``leaves``, rotated by a pose X and shifted, with their boxes.

    A leaf meets several leaves of the second tree, mostly one after the next: a slot holds the leaf between them.
    """
    slot = _SLOTS * side + (first // MAX_LEAF) % _SLOTS
    at = _OF_LEAF * slot
    if query.placed[slot] != first:
        query.placed[slot] = first
        _place_leaf(query.leaves, at, tree, X, shift, first, n)
        if query.n_views > 0:
            for i in range(n):
                put_vec3(query.leaves, at + _NORMALS + 3 * i, unit_normal(triangle_at(query.leaves, at + 9 * i)))
    return at


@kernel
def _place_leaf(leaves, at, tree, X, shift, first, n):
    for i in range(LANES):
        for j in range(3):
            low, high = at + _BOXES + LANES * j + i, at + _BOXES + LANES * (3 + j) + i
            leaves[low], leaves[high] = math.inf, -math.inf
        if i >= n:
            continue
        put_in_world(X, shift, tree.triangles, 9 * (first + i), leaves, at + 9 * i)
        for j in range(3):
            p, q, r = leaves[at + 9 * i + j], leaves[at + 9 * i + 3 + j], leaves[at + 9 * i + 6 + j]
            leaves[at + _BOXES + LANES * j + i] = min(p, q, r)
            leaves[at + _BOXES + LANES * (3 + j) + i] = max(p, q, r)


@kernel
def unit_normal(triangle):
    """The unit vector across a triangle; 0 where the direction may be rounding."""
    u, v = sub(triangle.q, triangle.p), sub(triangle.r, triangle.p)
    n = cross(u, v)
    length = norm(n)
    return scale(1.0 / length, n) if length > _FLAT_FACET * (norm(u) * norm(v)) else Vec3(0.0, 0.0, 0.0)


@kernel(inline=True)
def _boxes_apart(leaves, i, j, bound):
    """Whether two triangles' boxes are farther apart along an axis than the bound."""
    return (
        leaves[j] - leaves[i + 3 * LANES] > bound
        or leaves[i] - leaves[j + 3 * LANES] > bound
        or leaves[j + LANES] - leaves[i + 4 * LANES] > bound
        or leaves[i + LANES] - leaves[j + 4 * LANES] > bound
        or leaves[j + 2 * LANES] - leaves[i + 5 * LANES] > bound
        or leaves[i + 2 * LANES] - leaves[j + 5 * LANES] > bound
    )


@kernel(inline=True)
def _measure(query, a, b):
    """List facets a of A and b of B, whose corners are the query's triangles, unless they are beyond the reach."""
    points, counters = query.points, query.counters
    meets = facets_meet(query.trees, a, b, counters, _EXACT)
    length, width = nearest_points(query.triangles, points)
    lower = max(0.0, min(width, length) - 4.0 * query.error)
    if not meets and lower > query.reach:
        return
    if meets:
        common_point(query.triangles, length, points)
        middle = add(scale(0.5, vec3_at(points, 0)), scale(0.5, vec3_at(points, 3)))
        put_vec3(points, 0, middle)
        put_vec3(points, 3, middle)
        length = 0.0
        lower = 0.0
    _list(query, a, b, length, lower, meets)


@kernel(inline=True)
def _list(query, a, b, length, lower, meets):
    """Append a pair, whose nearest points are the query's."""
    counters = query.counters
    out = NUMBERS_OF_PAIR * counters[_N_PAIRS]
    query.out[out + LENGTH] = length
    query.out[out + LOWER] = lower
    for k in range(6):
        query.out[out + POINT_A + k] = query.points[k]
    out = INTS_OF_PAIR * counters[_N_PAIRS]
    query.facets[out + FACET_A] = query.trees.A.ids[a]
    query.facets[out + FACET_B] = query.trees.B.ids[b]
    query.facets[out + MEETS] = 1 if meets else 0
    counters[_N_PAIRS] += 1


_open_larger = make_open_larger(_widen_probe)


@kernel(inline=True)
def _open_if_seen(query, pair, stack, top):
    if query.n_views > 0 and not _boxes_are_seen(query, pair):
        return top
    return _open_larger(query, pair, stack, top)


_traverse = make_traversal(_unless_full, pair_of_trees, _visit_leaves, _open_if_seen)


#: Of `list_near_pairs`.
SIGNATURE = (
    "int64(int64, int64, int64, int64, float64, int64, int64, int64, int64, int64, int64, int64, int64, boolean, int64)"
)


@entry(SIGNATURE)
def list_near_pairs(
    header_a_at, header_b_at, XA_at, XB_at, reach, out_at, facets_at, capacity, stack_at, n_stack, doubles_at,
    integers_at, exact_at, measures, views_at,
):
    """How many pairs of facets come within ``reach`` at a pair of poses (16 doubles each); −FULL, −SINGULAR.

    Every pair at most ``reach`` apart is listed; a few pairs farther apart by rounding may be.
    measures : if False, distances are infinite, no pair meets, and more pairs farther apart may be listed.
    out, facets : NUMBERS_OF_PAIR doubles and INTS_OF_PAIR integers a pair, room for ``capacity`` pairs.
    views : 0; or address of a header and of views, without which no pair is left out. Listed are then pairs that a view
    lets through, behind the N_LISTED of the header. After −FULL the header has the number of pairs listed, and a call
    with the same stack goes on from there.
    Arguments are flat, as of all entries.
    """
    words = view_i64(views_at, VIEWS_AT)
    n_views = words[N_VIEWS] if views_at != 0 else 0
    A = open_tree(header_a_at)
    B = open_tree(header_b_at)
    trees, invertible = pose_trees(
        A, XA_at, B, XB_at, doubles_at, doubles_at + 8 * DOUBLES, PROBE, integers_at, exact_at
    )
    if not invertible:
        return -SINGULAR
    numbers_at = doubles_at + 8 * (PLACING + CORNERS)
    error = world_error(A, trees.XA, B, trees.XB)
    leaves_at = numbers_at + 8 * _LEAVES
    placed = view_i64(leaves_at + 16 * _SLOTS * _OF_LEAF, 2 * _SLOTS)
    for slot in range(2 * _SLOTS):
        placed[slot] = -1
    query = _Query(
        trees, reach, error, shift_between(trees.XA, trees.XB), view_f64(numbers_at + 8 * _REACHES, 6),
        view_f64(numbers_at + 8 * _TRIANGLES, 18), view_f64(numbers_at + 8 * _POINTS, 6),
        view_i64(numbers_at + 8 * _COUNTERS, 2), view_f64(leaves_at, 2 * _SLOTS * _OF_LEAF), leaves_at, placed,
        view_f64(out_at, NUMBERS_OF_PAIR * capacity), view_i64(facets_at, INTS_OF_PAIR * capacity), capacity,
        measures, view_f64(views_at + 8 * VIEWS_AT, VIEW * n_views), n_views, words[TWO_SIDES] if views_at != 0 else 0,
    )
    _set_reaches(A, B, trees.placing, reach + 8.0 * error, query.reaches)
    _set_rows(A, trees.XA, Vec3(0.0, 0.0, 0.0), query, _ROWS_OF_A)
    _set_rows(B, trees.XB, query.shift, query, _ROWS_OF_B)
    query.counters[_N_PAIRS] = words[N_LISTED] if views_at != 0 else 0
    query.counters[_EXACT] = 0
    stack = view_i64(stack_at, n_stack)
    top = words[STACKED] if views_at != 0 else 0
    if top == 0:
        stack[0], top = 0, 1
    top = _traverse(query, stack, top)
    if views_at != 0:
        words[N_LISTED], words[STACKED] = query.counters[_N_PAIRS], -top
    return -FULL if top != 0 else query.counters[_N_PAIRS]
