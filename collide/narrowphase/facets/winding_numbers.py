"""Whether points are inside a closed surface: how often the surface winds around them, by the facets on a segment.

A segment out of the surface counts 1 for every facet passed from behind, and −1 for every facet passed from its front.
Around points inside the surface winds once or more: parts that overlap are one body, cavities are no part of the body.

The segment goes from the point to a point beyond the surface's box, along an axis of the point's frame; both ends are
doubles in the point's frame, and so are posed without rounding. Where the segment passes an edge or a corner, or runs
in a facet's plane, another segment is tried, slightly off the axis. Signs are those of `exact_corners.py`: never
wrong.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import boxes_meeting
from collide.mesh.bvh import CENTRE, EXPONENT, NODE, REACH, WIDTH, Box, float_column_at, open_tree
from collide.narrowphase.facets.box_probes import set_box
from collide.narrowphase.facets.exact_triangles import BACK, BY, FROM, PASS, THROUGH, UNCLEAR
from collide.narrowphase.facets.filtered_triangles import AMBIGUOUS, APART, segment_against_triangle
from collide.narrowphase.facets.fine_probes import probe_of_node
from collide.narrowphase.facets.posed_segment import (
    COUNTERS,
    NODES,
    SEGMENT_DOUBLES,
    SEGMENT_FLOATS,
    TRIANGLES,
    PosedSegment,
    ask_segment_exactly,
    open_segment,
    place_segment,
)
from collide.narrowphase.facets.posed_surfaces import ERROR, INVERSE_B
from collide.narrowphase.facets.probe_parts import clear_slab
from collide.narrowphase.facets.traversal import OF_B, any_pair, box_of_tree, make_traversal, push_children

OUTSIDE, ON_SURFACE, INSIDE, UNDECIDED, SINGULAR = range(5)
#: From a facet's back to its front, and the other way.
LEAVING, ENTERING = BACK, THROUGH
#: Segments tried for a point: along the axes of its frame, then off them.
TRIES = 6 + 32
# What a segment has passed so far, integers: facets from behind less those from the front; whether one was passed at an
# edge or corner; whether it starts on the surface.
_WINDING, _IS_UNCLEAR, _IS_ON_SURFACE = range(3)
#: Doubles and floats of workspace: those of the segment's one box come last.
DOUBLES = SEGMENT_DOUBLES
FLOATS = SEGMENT_FLOATS + NODE


class _Query(NamedTuple):
    """One segment.   passed : as above."""

    segment: PosedSegment
    passed: np.ndarray


@kernel
def _pseudo_random(k):
    """A number between 0 and 1, always the same for k."""
    return float((k * 40503 + 12829) % 65521) / 65521.0


@kernel
def _set_ends(segment, x, attempt):
    """From the point x of B's frame to beyond A's box."""
    tree, XA, XB, ends = segment.tree, segment.XA, segment.XB, segment.ends
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
        middle += segment.placing[INVERSE_B + 3 * axis + i] * world
    shrink = 0.0
    for k in range(9):
        shrink = max(shrink, abs(segment.placing[INVERSE_B + k]))
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
def _set_box(segment, node):
    """The box around the segment as the only one of a tree, whose node and numbers these become; its exponent."""
    ends, numbers = segment.ends, segment.numbers
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
def _how_passed(segment, a):
    """How the segment passes facet a: BY, THROUGH, BACK, FROM or UNCLEAR; in doubles, else exactly."""
    triangles, error = segment.tree.triangles, segment.placing[ERROR]
    verdict, above = segment_against_triangle(triangles, 9 * a, segment.corners, 9, 12, error)
    if verdict == AMBIGUOUS:
        return ask_segment_exactly(segment, a, PASS)
    if verdict == APART:
        return BY
    return THROUGH if above else BACK


@kernel(inline=True)
def _visit_leaf(query, pair):
    """Count the facets of a leaf on the segment; True where the segment starts on a facet."""
    run = ~pair.link_a
    passed = query.passed
    for a in range(run >> 3, (run >> 3) + (run & 7)):
        query.segment.counters[TRIANGLES] += 1
        how = _how_passed(query.segment, a)
        if how == FROM:
            passed[_IS_ON_SURFACE] = 1
            return True
        if how == UNCLEAR:
            passed[_IS_UNCLEAR] = 1
        passed[_WINDING] += (how == LEAVING) - (how == ENTERING)
    return False


@kernel(inline=True)
def _open_box(query, pair, stack, top):
    segment = query.segment
    segment.counters[NODES] += 1
    probe = probe_of_node(segment.tree, pair.link_a, segment.frame_b, segment.probe, segment.moved)
    mask = boxes_meeting(segment.tree.boxes, NODE * pair.link_a, segment.frame_b, probe)
    return push_children(stack, top, mask, WIDTH * pair.link_a, OF_B)


_traverse = make_traversal(any_pair, box_of_tree, _visit_leaf, _open_box)


@kernel
def _winding(query, stack):
    """OUTSIDE or INSIDE by the facets on the segment; ON_SURFACE; UNDECIDED where the segment passes an edge."""
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
):
    """Where point k of B's frame (3 doubles; step 3 or 0) is, for n pairs of poses: OUTSIDE … SINGULAR.

    counters : COUNTERS integers a point.   Arguments are flat: entries are called by address, from C too.
    """
    tree = open_tree(header_a_at)
    stack = view_i64(stack_at, n_stack)
    passed = view_i64(stack_at + 8 * n_stack, 3)
    floats_at = doubles_at + 8 * DOUBLES
    node = view_f32(floats_at + 4 * SEGMENT_FLOATS, NODE)
    answers = view_i64(answers_at, n)
    for k in range(n):
        segment = open_segment(
            tree, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k, doubles_at, floats_at, integers_at, exact_at,
            counters_at + 8 * COUNTERS * k,
        )
        x = view_f64(points_at + 8 * step_points * k, 3)
        for i in range(3):
            segment.numbers[CENTRE + i] = x[i]
            segment.numbers[REACH + i] = abs(x[i])
            segment.ends[i] = segment.ends[3 + i] = segment.ends[6 + i] = x[i]
        if not place_segment(segment, 0):
            answers[k] = SINGULAR
            continue
        answers[k] = UNDECIDED
        for attempt in range(TRIES):
            _set_ends(segment, x, attempt)
            place_segment(segment, _set_box(segment, node))
            box = Box(float_column_at(node, 0), float_column_at(node, 3 * WIDTH))
            set_box(segment.placing, 1, box, segment.probe)
            clear_slab(segment.probe)
            answers[k] = _winding(_Query(segment, passed), stack)
            if answers[k] != UNDECIDED:
                break
