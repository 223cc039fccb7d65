"""Whether points are inside a closed surface: how often it winds around them, by the facets that a segment passes.

A segment that leaves counts one for every facet passed from behind, and one less for every facet passed from its
front. Around points inside the surface winds once or more: parts that overlap are one body, cavities are none of it.

The segment goes from the point to one beyond the surface's box, in the frame the point is given in, along an axis of
it; ends are doubles there, so both are posed without rounding. Where it passes an edge or a corner, or runs in a
facet's plane, another is tried, slightly off the axis. Signs are those of `exact_corners.py`: never wrong.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PROBE, boxes_meeting
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    INTS,
    NODE,
    NUMBERS,
    REACH,
    WIDTH,
    open_tree,
)
from collide.narrowphase.facets.exact_corners import CORNERS, OWN_AT, STATE, forget_poses
from collide.narrowphase.facets.exact_triangles import BACK, BY, FROM, PASS, THROUGH, UNCLEAR, call_exactly
from collide.narrowphase.facets.filtered_triangles import orientation, sign_error
from collide.narrowphase.facets.posed_surfaces import (
    ERROR,
    INVERSE_B,
    PLACING,
    place,
    transform,
)
from collide.narrowphase.facets.surface_collision import link_of, no_slab, set_probe

OUTSIDE, ON_SURFACE, INSIDE, UNDECIDED, SINGULAR = range(5)
#: From a facet's back to its front, and the other way.
LEAVING, ENTERING = BACK, THROUGH
#: Segments tried for a point: along the axes of its frame, then off them.
TRIES = 6 + 32
#: Doubles, floats and integers of workspace besides the exact stage's: the fake tree of a segment with them.
DOUBLES = PLACING + CORNERS + NUMBERS
FLOATS = 2 * FRAME + PROBE + NODE


@kernel
def _mixed(k):
    """A number between 0 and 1 that looks like chance and is always the same."""
    return float((k * 40503 + 12829) % 65521) / 65521.0


@kernel
def _set_segment(header_a, numbers_a, XA, XB, inverse_b, x, attempt, ends):
    """From the point x of B's frame to beyond A's box: ends becomes both and the point again (9 doubles)."""
    # A's middle and reach in B's frame, roughly; whoever is beyond twice that is outside.
    size = math.ldexp(2.0, int(header_a[EXPONENT]))
    stretch = 0.0
    axis = attempt % 3
    middle = 0.0
    for i in range(3):
        world = XA[4 * i + 3] - XB[4 * i + 3]
        for j in range(3):
            world += XA[4 * i + j] * numbers_a[CENTRE + j]
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
            ends[3 + i] += length * (_mixed(3 * attempt + i) - 0.5) * 2.0**-5
        ends[6 + i] = x[i]


@kernel
def _set_tree_of_segment(ends, header_b, numbers_b, node):
    """A tree of one box around the segment: header, numbers and node."""
    largest = 0.0
    for i in range(3):
        numbers_b[CENTRE + i] = 0.5 * ends[i] + 0.5 * ends[3 + i]
        numbers_b[REACH + i] = max(abs(ends[i]), abs(ends[3 + i]))
        largest = max(largest, 0.5 * abs(ends[i] - ends[3 + i]))
    exponent = max(math.frexp(largest)[1], -900)
    header_b[EXPONENT] = exponent
    scale = math.ldexp(1.0, -exponent)
    for i in range(3):
        low = abs(min(ends[i], ends[3 + i]) - numbers_b[CENTRE + i])
        high = abs(max(ends[i], ends[3 + i]) - numbers_b[CENTRE + i])
        node[WIDTH * i] = np.float32(0.0)
        node[WIDTH * (3 + i)] = np.float32(max(low, high) * scale * (1.0 + 2.0**-20) + 2.0**-110)


@kernel
def _pass(P, a, corners, error):
    """How the segment passes the triangle, in doubles: BY, THROUGH, BACK, or UNCLEAR, which here is for the exact stage."""
    far = 0.0
    for axis in range(3):
        x = P[a + axis]
        far = max(far, abs(P[a + 3 + axis] - x), abs(P[a + 6 + axis] - x))
        far = max(far, abs(corners[9 + axis] - x), abs(corners[12 + axis] - x))
    limit = sign_error(far, error)
    start = orientation(P, a, P, a + 3, P, a + 6, corners, 9)
    end = orientation(P, a, P, a + 3, P, a + 6, corners, 12)
    if (start > limit and end > limit) or (start < -limit and end < -limit):
        return BY
    one = orientation(P, a, P, a + 3, corners, 9, corners, 12)
    two = orientation(P, a + 3, P, a + 6, corners, 9, corners, 12)
    if (one > limit and two < -limit) or (one < -limit and two > limit):
        return BY
    three = orientation(P, a + 6, P, a, corners, 9, corners, 12)
    if (one > limit and three < -limit) or (one < -limit and three > limit):
        return BY
    if (two > limit and three < -limit) or (two < -limit and three > limit):
        return BY
    sure = abs(start) > limit and abs(end) > limit and abs(one) > limit and abs(two) > limit and abs(three) > limit
    if not sure:
        return UNCLEAR
    return THROUGH if start > 0.0 else BACK


#: Of `points_inside`.
SIGNATURE = (
    "void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def points_inside(
    header_a_at, XA_at, step_a, XB_at, step_b, points_at, step_points, n, answers_at, counters_at, stack_at, n_stack,
    doubles_at, integers_at, decide,
):  # fmt: skip
    """Where point k of B's frame (3 doubles; step 3 or 0) is, for n pairs of poses: OUTSIDE … SINGULAR.

    counters : boxes, triangles and exact decisions, a row a point.
    """
    header_a, numbers_a, boxes_a, links_a, P, _ = open_tree(header_a_at)
    stack = view_i64(stack_at, n_stack)
    header_b = view_i64(stack_at + 8 * n_stack, INTS)
    placing = view_f64(doubles_at, PLACING)
    inverse_b = view_f64(doubles_at + 8 * INVERSE_B, 9)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    ends = view_f64(doubles_at + 8 * (PLACING + OWN_AT), 9)
    numbers_b = view_f64(doubles_at + 8 * (PLACING + CORNERS), NUMBERS)
    frames = view_f32(doubles_at + 8 * DOUBLES, 2 * FRAME)
    frame_b = view_f32(doubles_at + 8 * DOUBLES + 4 * FRAME, FRAME)
    probe = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME, PROBE)
    node = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME + 4 * PROBE, NODE)
    state = view_i64(integers_at, STATE)
    answers = view_i64(answers_at, n)
    for k in range(n):
        XA = view_f64(XA_at + 8 * step_a * k, 16)
        XB = view_f64(XB_at + 8 * step_b * k, 16)
        x = view_f64(points_at + 8 * step_points * k, 3)
        counters = view_i64(counters_at + 24 * k, 3)
        arguments = (
            PASS, doubles_at + 8 * PLACING, doubles_at, integers_at, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k,
        )  # fmt: skip
        header_b[EXPONENT] = 0
        for i in range(3):
            numbers_b[CENTRE + i] = x[i]
            numbers_b[REACH + i] = abs(x[i])
        if not place(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, frames):
            answers[k] = SINGULAR
            continue
        forget_poses(state)
        answers[k] = UNDECIDED
        for attempt in range(TRIES):
            _set_segment(header_a, numbers_a, XA, XB, inverse_b, x, attempt, ends)
            _set_tree_of_segment(ends, header_b, numbers_b, node)
            place(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, frames)
            transform(placing, ends, 0, corners, 9)
            set_probe(placing, 1, node, 0, probe)
            no_slab(probe)
            answers[k] = _winding(
                P, boxes_a, links_a, stack, placing, corners, frame_b, probe, decide, arguments, counters
            )
            if answers[k] != UNDECIDED:
                break


@kernel
def _winding(P, boxes, links, stack, placing, corners, frame, probe, decide, arguments, counters):
    """OUTSIDE or INSIDE by the facets that the segment passes; ON_SURFACE; UNDECIDED where one is passed at its edge."""
    passed = 0
    unclear = False
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        link = int(link_of(links, stack[top]))
        if link >= 0:
            counters[0] += 1
            mask = boxes_meeting(boxes, NODE * link, frame, probe)
            for slot in range(WIDTH):
                if (mask >> slot) & 1:
                    stack[top] = link * WIDTH + slot
                    top += 1
            continue
        first = ~link >> 3
        for a in range(first, first + (~link & 7)):
            counters[1] += 1
            how = _pass(P, 9 * a, corners, placing[ERROR])
            if how == UNCLEAR:
                counters[2] += 1
                for k in range(9):
                    corners[k] = P[9 * a + k]
                how = call_exactly(decide, arguments)
            if how == FROM:
                return ON_SURFACE
            unclear = unclear or how == UNCLEAR
            passed += (how == LEAVING) - (how == ENTERING)
    if unclear:
        return UNDECIDED
    return INSIDE if passed > 0 else OUTSIDE
