"""Whether points are inside a closed surface: how often it winds around them, by the facets that a segment passes.

A segment that leaves counts one for every facet passed from behind, and one less for every facet passed from its
front. Around points inside the surface winds once or more: parts that overlap are one body, cavities are none of it.

The segment goes from the point to one beyond the surface's box, in the frame the point is given in, along an axis of
it; ends are doubles there, so both are posed without rounding. Where it passes an edge or a corner, or runs in a
facet's plane, another is tried, slightly off the axis. Signs are those of `exact_corners.py`: never wrong.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PROBE, boxes_meeting
from collide.mesh.bvh import CENTRE, EXPONENT, NODE, NUMBERS, REACH, WIDTH, TreeView, open_tree
from collide.mesh.triangle import put_triangle, triangle_at
from collide.narrowphase.facets.box_probes import clear_slab, set_probe
from collide.narrowphase.facets.exact_corners import B_LOCAL_AT, CORNERS, STATE, invalidate_pose_cache
from collide.narrowphase.facets.exact_triangles import BACK, BY, FROM, PASS, THROUGH, UNCLEAR, ExactCall, ask_exactly
from collide.narrowphase.facets.filtered_triangles import AMBIGUOUS, APART, segment_against_triangle
from collide.narrowphase.facets.posed_surfaces import (
    ERROR,
    INVERSE_B,
    PLACING,
    Extent,
    extent_of,
    place,
    put_in_frame_of_a,
)
from collide.narrowphase.facets.traversal import OF_B, any_pair, box_of_tree, make_traversal, push_children

OUTSIDE, ON_SURFACE, INSIDE, UNDECIDED, SINGULAR = range(5)
#: From a facet's back to its front, and the other way.
LEAVING, ENTERING = BACK, THROUGH
#: Segments tried for a point: along the axes of its frame, then off them.
TRIES = 6 + 32
# Counters, a row of integers a point: boxes compared, triangles tested, of them decided exactly.
BOXES, TRIANGLES, EXACT = range(3)
COUNTERS = 3
# What a segment has passed so far, integers: facets from behind less those from the front; whether one was passed at an
# edge or corner; whether it starts on the surface.
_WINDING, _IS_UNCLEAR, _IS_ON_SURFACE = range(3)
#: Doubles and floats of workspace: those of a segment's one box come last.
DOUBLES = PLACING + CORNERS + NUMBERS
FLOATS = 2 * FRAME + PROBE + NODE


class _Query(NamedTuple):
    """One segment: corners 3 and 4, and the probe, seen from the tree.   passed : as above."""

    tree: TreeView
    placing: np.ndarray
    corners: np.ndarray
    frame: np.ndarray
    probe: np.ndarray
    exact: ExactCall
    counters: np.ndarray
    passed: np.ndarray


@kernel
def _pseudo_random(k):
    """A number between 0 and 1, always the same for k."""
    return float((k * 40503 + 12829) % 65521) / 65521.0


@kernel
def _set_segment(tree, XA, XB, inverse_b, x, attempt, ends):
    """From the point x of B's frame to beyond A's box: ends becomes both and the point again (9 doubles)."""
    # A's middle and reach in B's frame, roughly; whoever is beyond twice that is outside.
    size = math.ldexp(2.0, int(tree.header[EXPONENT]))
    stretch = 0.0
    axis = attempt % 3
    middle = 0.0
    for i in range(3):
        world = XA[4 * i + 3] - XB[4 * i + 3]
        for j in range(3):
            world += XA[4 * i + j] * tree.numbers[CENTRE + j]
            stretch += abs(XA[4 * i + j])
        middle += inverse_b[3 * axis + i] * world
    shrink = 0.0
    for k in range(9):
        shrink = max(shrink, abs(inverse_b[k]))
    reach = 4.0 * size * stretch * shrink
    sign = 1.0 if attempt % 6 < 3 else -1.0
    far = middle + sign * reach
    # Beyond by more than rounding, however far out the middle is.
    far += sign * (abs(middle) * 2.0**-40 + abs(x[axis]) * 2.0**-40)
    if sign * (far - x[axis]) <= 0.0:
        far = x[axis] + sign * reach
    length = abs(far - x[axis])
    for i in range(3):
        ends[i] = x[i]
        ends[3 + i] = far if i == axis else x[i]
        if attempt >= 6 and i != axis:
            ends[3 + i] += length * (_pseudo_random(3 * attempt + i) - 0.5) * 2.0**-5
        ends[6 + i] = x[i]


@kernel
def _set_box_of_segment(ends, numbers, node):
    """The box around the segment as the only one of a tree, whose numbers and node these become; its exponent."""
    largest = 0.0
    for i in range(3):
        numbers[CENTRE + i] = 0.5 * ends[i] + 0.5 * ends[3 + i]
        numbers[REACH + i] = max(abs(ends[i]), abs(ends[3 + i]))
        largest = max(largest, 0.5 * abs(ends[i] - ends[3 + i]))
    exponent = max(math.frexp(largest)[1], -900)
    unit = math.ldexp(1.0, -exponent)
    for i in range(3):
        low = abs(min(ends[i], ends[3 + i]) - numbers[CENTRE + i])
        high = abs(max(ends[i], ends[3 + i]) - numbers[CENTRE + i])
        node[WIDTH * i] = np.float32(0.0)
        node[WIDTH * (3 + i)] = np.float32(max(low, high) * unit * (1.0 + 2.0**-20) + 2.0**-110)
    return exponent


@kernel
def _how_passed(query, a):
    """How the segment passes facet a: BY, THROUGH, BACK, FROM or UNCLEAR; in doubles, else exactly."""
    triangles, corners = query.tree.triangles, query.corners
    verdict, above = segment_against_triangle(triangles, 9 * a, corners, 9, 12, query.placing[ERROR])
    if verdict == AMBIGUOUS:
        query.counters[EXACT] += 1
        put_triangle(corners, 0, triangle_at(triangles, 9 * a))
        return ask_exactly(query.exact, PASS)
    if verdict == APART:
        return BY
    return THROUGH if above else BACK


@kernel(inline=True)
def _visit_leaf(query, pair):
    """Count the facets of a leaf that the segment passes; True where it starts on one."""
    run = ~pair.link_a
    passed = query.passed
    for a in range(run >> 3, (run >> 3) + (run & 7)):
        query.counters[TRIANGLES] += 1
        how = _how_passed(query, a)
        if how == FROM:
            passed[_IS_ON_SURFACE] = 1
            return True
        if how == UNCLEAR:
            passed[_IS_UNCLEAR] = 1
        passed[_WINDING] += (how == LEAVING) - (how == ENTERING)
    return False


@kernel(inline=True)
def _open_box(query, pair, stack, top):
    query.counters[BOXES] += 1
    mask = boxes_meeting(query.tree.boxes, NODE * pair.link_a, query.frame, query.probe)
    return push_children(stack, top, mask, WIDTH * pair.link_a, OF_B)


_traverse = make_traversal(any_pair, box_of_tree, _visit_leaf, _open_box)


@kernel
def _winding(query, stack):
    """OUTSIDE or INSIDE by the facets that the segment passes; ON_SURFACE; UNDECIDED where it passes an edge."""
    passed = query.passed
    passed[_WINDING] = 0
    passed[_IS_UNCLEAR] = 0
    passed[_IS_ON_SURFACE] = 0
    stack[0] = 0
    _traverse(query, stack, 1)
    if passed[_IS_ON_SURFACE] != 0:
        return ON_SURFACE
    if passed[_IS_UNCLEAR] != 0:
        return UNDECIDED
    return INSIDE if passed[_WINDING] > 0 else OUTSIDE


#: Of `points_inside`.
SIGNATURE = (
    "void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def points_inside(
    header_a_at, XA_at, step_a, XB_at, step_b, points_at, step_points, n, answers_at, counters_at, stack_at, n_stack,
    doubles_at, integers_at, exact_at,
):  # fmt: skip
    """Where point k of B's frame (3 doubles; step 3 or 0) is, for n pairs of poses: OUTSIDE … SINGULAR.

    counters : COUNTERS integers a point.   Arguments are flat: entries are called by address, from C too.
    """
    tree = open_tree(header_a_at)
    stack = view_i64(stack_at, n_stack)
    passed = view_i64(stack_at + 8 * n_stack, 3)
    placing = view_f64(doubles_at, PLACING)
    inverse_b = view_f64(doubles_at + 8 * INVERSE_B, 9)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    ends = view_f64(doubles_at + 8 * (PLACING + B_LOCAL_AT), 9)
    numbers_b = view_f64(doubles_at + 8 * (PLACING + CORNERS), NUMBERS)
    frame_a = view_f32(doubles_at + 8 * DOUBLES, FRAME)
    frame_b = view_f32(doubles_at + 8 * DOUBLES + 4 * FRAME, FRAME)
    probe = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME, PROBE)
    node = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME + 4 * PROBE, NODE)
    state = view_i64(integers_at, STATE)
    answers = view_i64(answers_at, n)
    for k in range(n):
        exact = ExactCall(
            exact_at, doubles_at + 8 * PLACING, doubles_at, integers_at, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k
        )
        XA = view_f64(exact.XA_at, 16)
        XB = view_f64(exact.XB_at, 16)
        x = view_f64(points_at + 8 * step_points * k, 3)
        counters = view_i64(counters_at + 8 * COUNTERS * k, COUNTERS)
        query = _Query(tree, placing, corners, frame_b, probe, exact, counters, passed)
        for i in range(3):
            numbers_b[CENTRE + i] = x[i]
            numbers_b[REACH + i] = abs(x[i])
        if not place(extent_of(tree), XA, Extent(numbers_b, 0), XB, placing, frame_a, frame_b):
            answers[k] = SINGULAR
            continue
        invalidate_pose_cache(state)
        answers[k] = UNDECIDED
        for attempt in range(TRIES):
            _set_segment(tree, XA, XB, inverse_b, x, attempt, ends)
            exponent = _set_box_of_segment(ends, numbers_b, node)
            place(extent_of(tree), XA, Extent(numbers_b, exponent), XB, placing, frame_a, frame_b)
            put_in_frame_of_a(placing, ends, 0, corners, 9)
            set_probe(placing, 1, node, 0, probe)
            clear_slab(probe)
            answers[k] = _winding(query, stack)
            if answers[k] != UNDECIDED:
                break
