"""What a search for the distance of two posed surfaces carries: query, results, and the direction that prunes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import kernel
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    HAS_ORIGINS,
    REACH,
    SLAB,
    WIDTH,
    box_at,
    float_column_at,
    origin_of,
)
from collide.mesh.triangle import range_along
from collide.narrowphase.facets.box_probes import set_box
from collide.narrowphase.facets.fine_probes import move_probe
from collide.narrowphase.facets.posed_surfaces import (
    INVERSE_A,
    INVERSE_B,
    MAX_UNIT_EXPONENT,
    UNITS,
    extent_of,
    rotate_by_pose,
)
from collide.narrowphase.facets.posed_trees import PosedTrees
from collide.narrowphase.facets.probe_parts import put_floats
from collide.numerics.vec3 import Vec3, absolute, add, divide, dot, max_abs, neg, put_vec3, scale, sub, vec3_at

# A row of results, doubles: distance, proven bounds, points on A and on B and the direction between them in the world.
DISTANCE, LOWER, UPPER, POINT_A, POINT_B, NORMAL = 0, 1, 2, 3, 6, 9
RESULT = 12
# And integers: facet of A, facet of B, whether the surfaces meet; nodes compared with a box, pairs of triangles, exact
# decisions.
FACET_A, FACET_B, MEETS, NODES, TRIANGLES, EXACT = range(6)
MARKS = 6

# What changes on the way, doubles ("near"): the direction from A to B (3) and, in units of A's boxes, its products with
# A's boxes (3), with B's (3) and with the shift (1), less rounding; the least lengths in the world of a gap of 1 along
# the axes of A's frame (3), of B's (3), along lines in A's frame and in B's; the best distance so far, also in units of
# A's boxes; the least slab; the bound of the error of a world coordinate; the nearest points so far (6); the length of
# which it is enough to know that the distance is no more.
DIRECTION, ALONG_A, ALONG_B, OFFSET = 0, 3, 6, 9
AXIS_SCALES_A, AXIS_SCALES_B, LINE_SCALE_A, LINE_SCALE_B = 10, 13, 16, 17
BEST, BOUND, LEAST, WORLD_ERROR, POINTS, ENOUGH = 18, 19, 20, 21, 22, 28
# Then a pair of triangles in world axes (18), points of it (6), and up to seven triangles of A (63).
TRIANGLES_AT, NEW, OF_A_AT = 29, 47, 53
# And integers: pairs on the heap, pairs of leaves met, of them since the best distance got better.
INTS = OF_A_AT + 9 * 7
HEAP_SIZE, LEAVES, LEAVES_WITHOUT_IMPROVEMENT = range(3)
NEAR = INTS + 3

U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: B's unit over A's beyond which floats might overflow.
_MAX_UNIT = 2.0**MAX_UNIT_EXPONENT


class DistanceQuery(NamedTuple):
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


# --- what does not change on the way ------------------------------------------------------------


@kernel
def prepare(query, limit, enough):
    """Start a pair of poses.   limit, enough : as of `near_surfaces`."""
    trees, near, marks = query.trees, query.near, query.marks
    A, B, XA, XB = trees.A, trees.B, trees.XA, trees.XB
    _set_scales(trees.placing, INVERSE_A, near, AXIS_SCALES_A, LINE_SCALE_A, 1.0)
    _set_scales(trees.placing, INVERSE_B, near, AXIS_SCALES_B, LINE_SCALE_B, 1.0 / trees.placing[UNITS])
    size = 0.0
    for i in range(3):
        terms = abs(XB[4 * i + 3] - XA[4 * i + 3])
        for j in range(3):
            terms += abs(XA[4 * i + j]) * A.numbers[REACH + j] + abs(XB[4 * i + j]) * B.numbers[REACH + j]
        size = max(size, terms)
    near[WORLD_ERROR] = 8.0 * U * size
    set_direction(query, sub(_centre_in_world(XB, B), _centre_in_world(XA, A)))
    near[BEST] = limit
    near[BOUND] = limit * query.unit_a
    near[LEAST] = math.inf
    near[ENOUGH] = enough
    marks[FACET_A] = -1
    marks[FACET_B] = -1
    for k in range(3):
        query.ints[k] = 0


@kernel
def _centre_in_world(X, tree):
    return add(rotate_by_pose(X, vec3_at(tree.numbers, CENTRE)), Vec3(X[3], X[7], X[11]))


@kernel
def _set_scales(placing, inverse, near, at, line, unit):
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
def set_direction(query, direction):
    """Make the direction, from A to B and of any length, the axis of the boxes to come."""
    trees, near = query.trees, query.near
    A, B, XA, XB = trees.A, trees.B, trees.XA, trees.XB
    size = max_abs(direction)
    if not size > 0.0:
        direction = Vec3(1.0, 0.0, 0.0)
        size = 1.0
    direction = divide(direction, size)
    put_vec3(near, DIRECTION, divide(direction, math.sqrt(dot(direction, direction)) * (1.0 + 2.0**-40)))
    unit = math.ldexp(1.0, int(B.header[EXPONENT] - A.header[EXPONENT]))
    offset = 0.0
    terms = 0.0
    spread = 0.0
    reach_a, reach_b = extent_of(A).reach, extent_of(B).reach
    for i in range(3):
        shift = XB[4 * i + 3] - XA[4 * i + 3]
        offset += near[DIRECTION + i] * shift
        terms += abs(shift)
    for j in range(3):
        along_a = 0.0
        along_b = 0.0
        for i in range(3):
            d = near[DIRECTION + i]
            along_a += d * XA[4 * i + j]
            along_b += d * XB[4 * i + j]
            terms += abs(XA[4 * i + j] * A.numbers[CENTRE + j]) + abs(XB[4 * i + j] * B.numbers[CENTRE + j])
        offset += along_b * B.numbers[CENTRE + j] - along_a * A.numbers[CENTRE + j]
        near[ALONG_A + j] = along_a
        near[ALONG_B + j] = along_b * unit
        spread += abs(along_a) * reach_a + abs(along_b * unit) * reach_b
    if unit > _MAX_UNIT:
        put_vec3(near, ALONG_B, Vec3(0.0, 0.0, 0.0))
        near[OFFSET] = -math.inf
        return
    offset *= query.unit_a
    rounding = _FLOAT_ERROR * (abs(offset) + spread) + 2.0**-110 + 32.0 * U * query.unit_a * terms
    near[OFFSET] = offset - rounding


@kernel(inline=True)
def upper_bound(near):
    """Of the surfaces' distance, by the nearest points so far."""
    return near[BEST] + 4.0 * near[WORLD_ERROR]


# --- boxes --------------------------------------------------------------------------------------


@kernel(inline=True)
def gap_of_box(g, tree, slabs, unit, ref, link):
    """Least product of a box's contents with g, by the box and by its slab; of a leaf that of its corners."""
    if link < 0:
        first = ~link >> 3
        return unit * range_along(g, tree.triangles, first, first + (~link & 7), vec3_at(tree.numbers, CENTRE))[0]
    box = box_at(tree, ref)
    plain = dot(g, box.centre) - dot(absolute(g), box.half)
    at = SLAB * (ref >> 3) + (ref & 7)
    n = float_column_at(slabs, at)
    share = dot(g, n)
    middle = float(slabs[at + 3 * WIDTH])
    if tree.header[HAS_ORIGINS] != 0:
        middle += dot(n, origin_of(tree.links, ref >> 3))
    thin = share * middle - abs(share) * float(slabs[at + 4 * WIDTH])
    rest = sub(g, scale(share, n))
    thin += dot(rest, box.centre) - dot(absolute(rest), box.half)
    return max(plain, thin)


@kernel(inline=True)
def is_beyond_bound(near, pair):
    """What was pushed before the direction turned is compared with it again."""
    return near[OFFSET] + pair.gap_a + pair.gap_b >= near[BOUND]


@kernel(inline=True)
def set_near_probe(query, which, tree, ref, gap, nodes, node):
    """Make a box the probe of a node of the other tree, with what distances need.   gap : `gap_of_box` of the box."""
    near, probe = query.near, query.trees.probe
    set_box(query.trees.placing, which, box_at(tree, ref), probe)
    probe_scales = AXIS_SCALES_A if which == 0 else AXIS_SCALES_B
    node_scales = AXIS_SCALES_B if which == 0 else AXIS_SCALES_A
    put_floats(probe, 12, vec3_at(near, node_scales))
    put_floats(probe, 15, vec3_at(near, probe_scales))
    probe[18] = np.float32(near[LINE_SCALE_A if which == 0 else LINE_SCALE_B])
    put_floats(probe, 19, vec3_at(near, ALONG_B) if which == 0 else neg(vec3_at(near, ALONG_A)))
    offset = near[OFFSET] + gap
    if nodes.header[HAS_ORIGINS] != 0:
        move_probe(nodes, node, query.trees.frame_a if which == 0 else query.trees.frame_b, probe, probe)
        direction = vec3_at(near, ALONG_B) if which == 0 else neg(vec3_at(near, ALONG_A))
        offset += dot(direction, origin_of(nodes.links, node))
    probe[22] = np.float32(offset)
