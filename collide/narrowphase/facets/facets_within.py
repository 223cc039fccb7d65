"""All pairs of facets of two posed surfaces that meet or come within a distance, with nearest points of each.

The walk of `surface_collision.py` with boxes that reach out: a gap d in the world is at most d times the length of a row of the
inverse along that axis of a frame. Triangles are measured as in `surface_distance.py`, in the world's axes with A's origin as
theirs, x = R_A v, y = R_B w + (t_B − t_A), both off by at most E a coordinate.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PROBE, boxes_meeting
from collide.mesh.bvh import (
    EXPONENT,
    NODE,
    REACH,
    WIDTH,
    open_tree,
)
from collide.narrowphase.facets.exact_corners import CORNERS, STATE, forget_poses
from collide.narrowphase.facets.posed_surfaces import (
    ERROR,
    INVERSE_A,
    INVERSE_B,
    PLACING,
    UNITS,
    place,
    to_world,
    transform,
)
from collide.narrowphase.facets.surface_collision import (
    FULL,
    SINGULAR,
    box_size,
    certainly_meeting,
    link_of,
    no_slab,
    set_probe,
    set_slab,
)
from collide.narrowphase.facets.triangle_distance import beyond, common_point, nearest_points

# A pair, doubles: distance of its nearest points, proven lower bound, point of A, point of B; both points are the
# common one where they meet. And integers: facet of A, facet of B, whether they meet.
LENGTH, LOWER, POINT_A, POINT_B = 0, 1, 2, 5
NUMBERS_OF_PAIR = 8
FACET_A, FACET_B, MEETS = range(3)
INTS_OF_PAIR = 3

#: Doubles and floats of workspace: a placing, corners, reaches along both frames' axes (6), two triangles (18), points (6).
_REACHES, _PAIR, _NEW, _MARKS = 0, 6, 24, 30
DOUBLES = PLACING + CORNERS + 32
FLOATS = 2 * FRAME + PROBE

#: As many pairs as two leaves may add.
_MOST_AT_ONCE = 64
#: Reaches beyond this, in units of boxes, would leave the floats: nothing is parted there.
_FARTHEST = 1e30
_U = 2.0**-53


@kernel
def _set_reaches(header_a, header_b, placing, reach, out):
    """How far ``reach`` of the world is along the axes of A's frame and of B's, in units of their boxes; rounded up."""
    for which in range(2):
        inverse = INVERSE_A if which == 0 else INVERSE_B
        exponent = header_a[EXPONENT] if which == 0 else header_b[EXPONENT]
        scale = math.ldexp(1.0, int(-exponent))
        largest = 0.0
        for k in range(9):
            largest = max(largest, abs(placing[inverse + k]))
        for i in range(3):
            row = 0.0
            for j in range(3):
                row += placing[inverse + 3 * i + j] ** 2
            length = math.sqrt(row) + 4.0 * placing[inverse + 9] * largest
            out[3 * which + i] = min(reach * scale * length * (1.0 + 2.0**-18), _FARTHEST)


@kernel(inline=True)
def _reach_out(which, reaches, probe):
    """Enlarge a probe's half lengths and slab by the reach; which: 0 for a box of A, 1 for one of B."""
    own = 3 * which
    other = 3 - own
    wide = float(probe[16])
    for i in range(3):
        probe[3 + i] = np.float32((float(probe[3 + i]) + reaches[other + i]) * (1.0 + 2.0**-20))
        probe[9 + i] = np.float32((float(probe[9 + i]) + reaches[own + i]) * (1.0 + 2.0**-20))
    if wide > 0.0:
        probe[16] = np.float32(wide * (1.0 + 2.0**-20) + reaches[own] + reaches[own + 1] + reaches[own + 2])


@kernel
def _world_error(numbers_a, XA, numbers_b, XB):
    """Largest error of a coordinate in the world's axes."""
    size = 0.0
    for i in range(3):
        terms = abs(XA[4 * i + 3]) + abs(XB[4 * i + 3])
        for j in range(3):
            terms += abs(XA[4 * i + j]) * numbers_a[REACH + j] + abs(XB[4 * i + j]) * numbers_b[REACH + j]
        size = max(size, terms)
    return 8.0 * _U * size


@kernel
def _near_leaves(
    P, W, ids_a, ids_b, run_a, run_b, XA, XB, placing, corners, context, reach, error, T, new, marks, out, told, found
):
    """All triangles of two leaves; returns how many pairs there are now."""
    for i in range(run_b & 7):
        b = (run_b >> 3) + i
        to_world(XB, XB[3] - XA[3], XB[7] - XA[7], XB[11] - XA[11], W, 9 * b, T, 9)
        transform(placing, W, 9 * b, corners, 9)
        for j in range(run_a & 7):
            a = (run_a >> 3) + j
            to_world(XA, 0.0, 0.0, 0.0, P, 9 * a, T, 0)
            if beyond(T, reach + 8.0 * error):
                continue
            meets = certainly_meeting(P, W, 9 * a, 9 * b, corners, context, marks, 0)
            length, width = nearest_points(T, new)
            lower = max(0.0, min(width, length) - 4.0 * error)
            if not meets and lower > reach:
                continue
            if meets:
                common_point(T, length, new)
                length = 0.0
                lower = 0.0
            at = NUMBERS_OF_PAIR * found
            out[at + LENGTH] = length
            out[at + LOWER] = lower
            for k in range(3):
                middle = 0.5 * new[k] + 0.5 * new[3 + k]
                out[at + POINT_A + k] = middle if meets else new[k]
                out[at + POINT_B + k] = middle if meets else new[3 + k]
            told[INTS_OF_PAIR * found + FACET_A] = ids_a[a]
            told[INTS_OF_PAIR * found + FACET_B] = ids_b[b]
            told[INTS_OF_PAIR * found + MEETS] = 1 if meets else 0
            found += 1
    return found


#: Of `list_near_pairs`.
SIGNATURE = "int64(int64, int64, int64, int64, float64, int64, int64, int64, int64, int64, int64, int64, int64)"


@entry(SIGNATURE)
def list_near_pairs(
    header_a_at, header_b_at, XA_at, XB_at, reach, out_at, told_at, capacity, stack_at, n_stack, doubles_at, integers_at,
    decide,
):  # fmt: skip
    """How many pairs of facets come within ``reach`` at one pair of poses (16 doubles each); −FULL, −SINGULAR.

    Every pair whose distance is at most ``reach`` is listed; a few that are farther by rounding may be.
    out, told : NUMBERS_OF_PAIR doubles and INTS_OF_PAIR integers a pair, room for ``capacity`` of them.
    """
    header_a, numbers_a, boxes_a, links_a, P, ids_a = open_tree(header_a_at)
    header_b, numbers_b, boxes_b, links_b, W, ids_b = open_tree(header_b_at)
    out = view_f64(out_at, NUMBERS_OF_PAIR * capacity)
    told = view_i64(told_at, INTS_OF_PAIR * capacity)
    stack = view_i64(stack_at, n_stack)
    placing = view_f64(doubles_at, PLACING)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    own_at = doubles_at + 8 * (PLACING + CORNERS)
    reaches = view_f64(own_at + 8 * _REACHES, 6)
    T = view_f64(own_at + 8 * _PAIR, 18)
    new = view_f64(own_at + 8 * _NEW, 6)
    marks = view_i64(own_at + 8 * _MARKS, 1)
    frame_a = view_f32(doubles_at + 8 * DOUBLES, FRAME)
    frame_b = view_f32(doubles_at + 8 * DOUBLES + 4 * FRAME, FRAME)
    frames = view_f32(doubles_at + 8 * DOUBLES, 2 * FRAME)
    probe = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME, PROBE)
    state = view_i64(integers_at, STATE)
    XA = view_f64(XA_at, 16)
    XB = view_f64(XB_at, 16)
    if not place(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, frames):
        return -SINGULAR
    forget_poses(state)
    marks[0] = 0
    error = _world_error(numbers_a, XA, numbers_b, XB)
    _set_reaches(header_a, header_b, placing, reach + 8.0 * error, reaches)
    context = (decide, doubles_at + 8 * PLACING, doubles_at, integers_at, XA_at, XB_at, placing[ERROR])
    units = placing[UNITS]
    found = 0
    stack[0] = 0
    top = 1
    while top > 0:
        if found + _MOST_AT_ONCE > capacity:
            return -FULL
        top -= 1
        a = stack[top] >> 32
        b = stack[top] & 0xFFFFFFFF
        link_a = int(link_of(links_a, a))
        link_b = int(link_of(links_b, b))
        if link_a < 0 and link_b < 0:
            found = _near_leaves(
                P, W, ids_a, ids_b, ~link_a, ~link_b, XA, XB, placing, corners, context, reach, error, T, new, marks, out,
                told, found,
            )  # fmt: skip
        elif link_a < 0 or (link_b >= 0 and box_size(boxes_b, b) > units * box_size(boxes_a, a)):
            set_probe(placing, 0, boxes_a, a, probe)
            if link_a < 0:
                set_slab(placing, 0, P, numbers_a, header_a[EXPONENT], ~link_a, probe)
            else:
                no_slab(probe)
            _reach_out(0, reaches, probe)
            mask = boxes_meeting(boxes_b, NODE * link_b, frame_a, probe)
            for slot in range(WIDTH):
                if (mask >> slot) & 1:
                    stack[top] = (a << 32) | (link_b * WIDTH + slot)
                    top += 1
        else:
            set_probe(placing, 1, boxes_b, b, probe)
            if link_b < 0:
                set_slab(placing, 1, W, numbers_b, header_b[EXPONENT], ~link_b, probe)
            else:
                no_slab(probe)
            _reach_out(1, reaches, probe)
            mask = boxes_meeting(boxes_a, NODE * link_a, frame_b, probe)
            for slot in range(WIDTH):
                if (mask >> slot) & 1:
                    stack[top] = ((link_a * WIDTH + slot) << 32) | b
                    top += 1
    return found
