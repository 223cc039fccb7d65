"""Two posed surfaces: whether they meet, and every pair of facets that does.

A walk over pairs of boxes, depth first on a stack, the larger box opened into its eight; leaves end in triangles
that doubles part or not, and in integers where doubles cannot tell. The order is fixed, so the first pair found is.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PRISM, PROBE, boxes_meeting, boxes_meeting_prism
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    NODE,
    WIDTH,
    open_tree,
)
from collide.narrowphase.facets.exact_corners import CORNERS, OWN_AT, STATE, forget_poses
from collide.narrowphase.facets.exact_triangles import MEET, call_exactly
from collide.narrowphase.facets.filtered_triangles import MEETING, TINY, UNSURE, meeting_in_doubles
from collide.narrowphase.facets.posed_surfaces import (
    ERROR,
    FRAME_SIZE,
    FRAMES,
    PLACING,
    UNITS,
    balls_apart,
    later,
    place,
    transform,
)

# What rides along, a row of integers a pose: pairs of boxes looked at, triangles tested, decided exactly.
BOXES, TRIANGLES, EXACT = range(3)
COUNTERS = 3

#: Doubles and floats of workspace; integers are `exact.INTEGERS`.
DOUBLES = PLACING + CORNERS
FLOATS = 2 * FRAME + PRISM

#: Where a walk stands: pose, height of the stack, pairs found.
POSE, TOP, FOUND = range(3)
#: What it says: all poses done, room for pairs gone, or a matrix that cannot be inverted.
DONE, FULL, SINGULAR = range(3)
#: A reference with this bit is to a triangle, not to a box: a leaf opened against boxes becomes its triangles.
TRIANGLE = 1 << 30
#: So many times as large as the box that is opened.
LARGE = 2.0
#: Pairs that a pair of leaves may add.
_MOST_AT_ONCE = 64


@kernel(inline=True)
def set_probe(placing, which, nodes, ref, probe):
    """Make the box behind a reference (node times 8 plus slot) the probe; which: 0 for A's box, 1 for B's."""
    at = NODE * (ref >> 3) + (ref & 7)
    _set_box(
        placing, which, float(nodes[at]), float(nodes[at + WIDTH]), float(nodes[at + 2 * WIDTH]),
        float(nodes[at + 3 * WIDTH]), float(nodes[at + 4 * WIDTH]), float(nodes[at + 5 * WIDTH]), probe,
    )  # fmt: skip


@kernel(inline=True)
def _set_box(placing, which, x, y, z, hx, hy, hz, probe):
    """Make a box of A or B, in its tree's units, the probe."""
    own = FRAMES + FRAME_SIZE * which
    other = FRAMES + FRAME_SIZE * (1 - which)
    for i in range(3):
        a = placing[other + 3 * i]
        b = placing[other + 3 * i + 1]
        c = placing[other + 3 * i + 2]
        probe[i] = np.float32(a * x + b * y + c * z + placing[other + 9 + i])
        probe[3 + i] = np.float32(abs(a) * hx + abs(b) * hy + abs(c) * hz + placing[other + 12 + i])
    probe[6] = np.float32(placing[own + 9] - x)
    probe[7] = np.float32(placing[own + 10] - y)
    probe[8] = np.float32(placing[own + 11] - z)
    probe[9] = np.float32(hx + placing[own + 12])
    probe[10] = np.float32(hy + placing[own + 13])
    probe[11] = np.float32(hz + placing[own + 14])


@kernel
def set_prism(placing, which, triangles, numbers, exponent, t, probe):
    """Make a triangle the probe: its box, the slab along its plane, and a half-space along each edge.

    Against the finer boxes of the other body a large triangle that lies across its axes is little of its box: this is
    what parts it from them.
    """
    scale = math.ldexp(1.0, int(-exponent))
    p = (
        (triangles[9 * t] - numbers[CENTRE]) * scale,
        (triangles[9 * t + 1] - numbers[CENTRE + 1]) * scale,
        (triangles[9 * t + 2] - numbers[CENTRE + 2]) * scale,
    )
    q = (
        (triangles[9 * t + 3] - numbers[CENTRE]) * scale,
        (triangles[9 * t + 4] - numbers[CENTRE + 1]) * scale,
        (triangles[9 * t + 5] - numbers[CENTRE + 2]) * scale,
    )
    r = (
        (triangles[9 * t + 6] - numbers[CENTRE]) * scale,
        (triangles[9 * t + 7] - numbers[CENTRE + 1]) * scale,
        (triangles[9 * t + 8] - numbers[CENTRE + 2]) * scale,
    )
    low = (min(p[0], q[0], r[0]), min(p[1], q[1], r[1]), min(p[2], q[2], r[2]))
    high = (max(p[0], q[0], r[0]), max(p[1], q[1], r[1]), max(p[2], q[2], r[2]))
    _set_box(
        placing, which, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]),
        0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]), 0.5 * (high[2] - low[2]), probe,
    )  # fmt: skip
    u = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    v = (r[0] - p[0], r[1] - p[1], r[2] - p[2])
    w = (r[0] - q[0], r[1] - q[1], r[2] - q[2])
    n = _unit(_cross(u, v))
    middle, reach = _set_line(placing, which, n, probe, 12)
    heights = (_dot(n, p), _dot(n, q), _dot(n, r))
    low_n = min(heights[0], heights[1], heights[2])
    high_n = max(heights[0], heights[1], heights[2])
    probe[15] = np.float32(middle - 0.5 * (low_n + high_n))
    probe[16] = np.float32(reach + 0.5 * (high_n - low_n) + 2.0**-19 * abs(middle))
    _set_edge(placing, which, _unit(_cross(u, n)), p, q, r, probe, PROBE)
    _set_edge(placing, which, _unit(_cross(w, n)), p, q, r, probe, PROBE + 4)
    _set_edge(placing, which, _unit(_cross(n, v)), p, q, r, probe, PROBE + 8)


@kernel(inline=True)
def _set_edge(placing, which, out, p, q, r, probe, at):
    """The half-space of direction ``out`` that just holds three points."""
    middle, reach = _set_line(placing, which, out, probe, at)
    top = max(_dot(out, p), _dot(out, q), _dot(out, r))
    probe[at + 3] = np.float32(middle - top - reach - 2.0**-19 * abs(middle))


@kernel(inline=True)
def _set_line(placing, which, n, probe, at):
    """Write a direction of the probe's frame, in the node's; (its product with the shift, what rounding can do to it)."""
    own = FRAMES + FRAME_SIZE * which
    middle = n[0] * placing[own + 9] + n[1] * placing[own + 10] + n[2] * placing[own + 11]
    # Of the frame, of heights and of the sums of floats; a triangle is within its units.
    reach = 2.0**-19 * 6.0 + 2.0**-110
    reach += abs(n[0]) * placing[own + 12] + abs(n[1]) * placing[own + 13] + abs(n[2]) * placing[own + 14]
    for j in range(3):
        entry = n[0] * placing[own + j] + n[1] * placing[own + 3 + j] + n[2] * placing[own + 6 + j]
        probe[at + j] = np.float32(entry)
        reach += 2.0**-19 * abs(entry)
    return middle, reach


@kernel(inline=True)
def _unit(n):
    """Scaled so that its largest component is 1; 0 where it is next to nothing."""
    size = max(abs(n[0]), abs(n[1]), abs(n[2]))
    if not size > TINY:
        return 0.0, 0.0, 0.0
    return n[0] / size, n[1] / size, n[2] / size


@kernel(inline=True)
def _cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@kernel(inline=True)
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@kernel
def set_slab(placing, which, triangles, numbers, exponent, run, probe):
    """Add the slab around a leaf's triangles to the probe of its box.

    A box around a large triangle that lies across its axes holds whole regions of a finer mesh. Where leaves are
    opened against nodes this is what parts them.
    """
    first = 9 * (run >> 3)
    last = first + 9 * (run & 7)
    x = 0.0
    y = 0.0
    z = 0.0
    for a in range(first, last, 9):
        ux = triangles[a + 3] - triangles[a]
        uy = triangles[a + 4] - triangles[a + 1]
        uz = triangles[a + 5] - triangles[a + 2]
        vx = triangles[a + 6] - triangles[a]
        vy = triangles[a + 7] - triangles[a + 1]
        vz = triangles[a + 8] - triangles[a + 2]
        x += uy * vz - uz * vy
        y += uz * vx - ux * vz
        z += ux * vy - uy * vx
    size = max(abs(x), abs(y), abs(z))
    if not size > TINY:
        no_slab(probe)
        return
    x /= size
    y /= size
    z /= size
    low = math.inf
    high = -math.inf
    for k in range(first, last, 3):
        height = (
            x * (triangles[k] - numbers[CENTRE])
            + y * (triangles[k + 1] - numbers[CENTRE + 1])
            + z * (triangles[k + 2] - numbers[CENTRE + 2])
        )
        low = min(low, height)
        high = max(high, height)
    scale = math.ldexp(1.0, int(-exponent))
    at = FRAMES + FRAME_SIZE * which
    offset = x * placing[at + 9] + y * placing[at + 10] + z * placing[at + 11] - 0.5 * (low + high) * scale
    # What rounding can do to the frame, to heights and to the sums of floats.
    reach = 0.5 * (high - low) * scale + 2.0**-19 * (3.0 + abs(offset)) + 2.0**-110
    reach += abs(x) * placing[at + 12] + abs(y) * placing[at + 13] + abs(z) * placing[at + 14]
    for j in range(3):
        entry = x * placing[at + j] + y * placing[at + 3 + j] + z * placing[at + 6 + j]
        probe[12 + j] = np.float32(entry)
        reach += 2.0**-19 * abs(entry)
    probe[15] = np.float32(offset)
    probe[16] = np.float32(reach)


@kernel(inline=True)
def no_slab(probe):
    for k in range(12, 17):
        probe[k] = np.float32(0.0)


@kernel(inline=True)
def box_size(nodes, ref):
    """Sum of the half lengths of the box behind a reference."""
    at = NODE * (ref >> 3) + (ref & 7) + 3 * WIDTH
    return float(nodes[at]) + float(nodes[at + WIDTH]) + float(nodes[at + 2 * WIDTH])


@kernel(inline=True)
def link_of(links, ref):
    return links[NODE * (ref >> 3) + 6 * WIDTH + (ref & 7)]


@kernel(inline=True)
def _behind(links, ref):
    """The link behind a reference to a box; for one to a triangle, the link of a leaf of its own."""
    return ~(((ref ^ TRIANGLE) << 3) | 1) if ref & TRIANGLE else int(link_of(links, ref))


@kernel
def certainly_meeting(P, W, a, b, corners, context, counters, exact):
    """Whether triangle P[a:] of A meets W[b:] of B, of which A sees corners 9 … 17: in doubles, else exactly.

    counters[exact] counts what doubles could not tell.   context : addresses of the exact stage and of what it takes.
    """
    decide, corners_at, placing_at, integers_at, XA_at, XB_at, error = context
    verdict = meeting_in_doubles(P, corners, 9, a, error)
    if verdict == UNSURE:
        counters[exact] += 1
        for k in range(9):
            corners[k] = P[a + k]
            corners[OWN_AT + k] = W[b + k]
        return call_exactly(decide, (MEET, corners_at, placing_at, integers_at, XA_at, XB_at)) != 0
    return verdict == MEETING


@kernel
def _leaves(
    P, W, ids_a, ids_b, run_a, run_b, placing, corners, context, flip, first_only, pairs, found, counters
):
    """All triangles of two leaves; returns how many pairs there are now."""
    n_b = len(ids_b)
    for i in range(run_b & 7):
        b = (run_b >> 3) + i
        transform(placing, W, 9 * b, corners, 9)
        for j in range(run_a & 7):
            a = (run_a >> 3) + j
            counters[TRIANGLES] += 1
            if certainly_meeting(P, W, 9 * a, 9 * b, corners, context, counters, EXACT):
                one = int(ids_a[a])
                two = int(ids_b[b])
                pairs[found] = two * n_b + one if flip else one * n_b + two
                found += 1
                if first_only:
                    return found
    return found


#: Of `walk_surfaces`.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, int64, int64, int64, int64, int64, int64,"
    " int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def walk_surfaces(
    header_a_at, header_b_at, XA_at, step_a, XB_at, step_b, n, alike, first_only, pairs_at, capacity, starts_at, counters_at,
    where_at, stack_at, n_stack, doubles_at, integers_at, decide,
):  # fmt: skip
    """Facet pairs of two surfaces at n pairs of poses, from where an earlier call stopped; DONE, FULL or SINGULAR.

    XA, XB : matrices of 16 doubles; step 16 or, for a single pose, 0.
    alike : the trees are equal; poses are then exchanged by their numbers, and answers turned back.
    pairs : out, facet of A times the number of B's facets plus facet of B; of pose k those from starts[k] to
        starts[k + 1]. With ``first_only`` at most one a pose.
    counters : COUNTERS integers a pose.   where : POSE, TOP, FOUND; zeros at first.
    """
    header_a, numbers_a, boxes_a, links_a, P, ids_a = open_tree(header_a_at)
    header_b, numbers_b, boxes_b, links_b, W, ids_b = open_tree(header_b_at)
    pairs = view_i64(pairs_at, capacity)
    starts = view_i64(starts_at, n + 1)
    where = view_i64(where_at, 3)
    stack = view_i64(stack_at, n_stack)
    placing = view_f64(doubles_at, PLACING)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    frame_a = view_f32(doubles_at + 8 * DOUBLES, FRAME)
    frame_b = view_f32(doubles_at + 8 * DOUBLES + 4 * FRAME, FRAME)
    frames = view_f32(doubles_at + 8 * DOUBLES, 2 * FRAME)
    probe = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME, PRISM)
    state = view_i64(integers_at, STATE)
    found = where[FOUND]
    k = where[POSE]
    top = where[TOP]
    while k < n:
        pose_a = XA_at + 8 * step_a * k
        pose_b = XB_at + 8 * step_b * k
        flip = alike and later(view_f64(pose_a, 12), view_f64(pose_b, 12))
        if flip:
            pose_a, pose_b = pose_b, pose_a
        XA = view_f64(pose_a, 16)
        XB = view_f64(pose_b, 16)
        counters = view_i64(counters_at + 8 * COUNTERS * k, COUNTERS)
        if top == 0 and balls_apart(XA, numbers_a, XB, numbers_b, 0.0):
            starts[k] = found
            k += 1
            starts[k] = found
            continue
        if not place(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, frames):
            where[POSE] = k
            return SINGULAR
        forget_poses(state)
        context = (
            decide, doubles_at + 8 * PLACING, doubles_at, integers_at, pose_a, pose_b, placing[ERROR],
        )  # fmt: skip
        units = placing[UNITS]
        if top == 0:
            starts[k] = found
            stack[0] = 0
            top = 1
        while top > 0:
            if found + _MOST_AT_ONCE > capacity:
                where[POSE] = k
                where[TOP] = top
                where[FOUND] = found
                return FULL
            top -= 1
            a = stack[top] >> 32
            b = stack[top] & 0xFFFFFFFF
            link_a = _behind(links_a, a)
            link_b = _behind(links_b, b)
            if link_a < 0 and link_b < 0:
                found = _leaves(
                    P, W, ids_a, ids_b, ~link_a, ~link_b, placing, corners, context, flip, first_only,
                    pairs, found, counters,
                )
                if first_only and found > starts[k]:
                    top = 0
                continue
            if link_a < 0 and (a & TRIANGLE or box_size(boxes_a, a) * units > LARGE * box_size(boxes_b, b)):
                for t in range(~link_a >> 3, (~link_a >> 3) + (~link_a & 7)):
                    counters[BOXES] += 1
                    set_prism(placing, 0, P, numbers_a, header_a[EXPONENT], t, probe)
                    mask = boxes_meeting_prism(boxes_b, NODE * link_b, frame_a, probe)
                    for slot in range(WIDTH):
                        if (mask >> slot) & 1:
                            stack[top] = ((TRIANGLE | t) << 32) | (link_b * WIDTH + slot)
                            top += 1
            elif link_b < 0 and (b & TRIANGLE or box_size(boxes_b, b) > LARGE * units * box_size(boxes_a, a)):
                for t in range(~link_b >> 3, (~link_b >> 3) + (~link_b & 7)):
                    counters[BOXES] += 1
                    set_prism(placing, 1, W, numbers_b, header_b[EXPONENT], t, probe)
                    mask = boxes_meeting_prism(boxes_a, NODE * link_a, frame_b, probe)
                    for slot in range(WIDTH):
                        if (mask >> slot) & 1:
                            stack[top] = ((link_a * WIDTH + slot) << 32) | TRIANGLE | t
                            top += 1
            elif link_a < 0 or (link_b >= 0 and box_size(boxes_b, b) > units * box_size(boxes_a, a)):
                counters[BOXES] += 1
                set_probe(placing, 0, boxes_a, a, probe)
                if link_a < 0:
                    set_slab(placing, 0, P, numbers_a, header_a[EXPONENT], ~link_a, probe)
                else:
                    no_slab(probe)
                mask = boxes_meeting(boxes_b, NODE * link_b, frame_a, probe)
                for slot in range(WIDTH):
                    if (mask >> slot) & 1:
                        stack[top] = (a << 32) | (link_b * WIDTH + slot)
                        top += 1
            else:
                counters[BOXES] += 1
                set_probe(placing, 1, boxes_b, b, probe)
                if link_b < 0:
                    set_slab(placing, 1, W, numbers_b, header_b[EXPONENT], ~link_b, probe)
                else:
                    no_slab(probe)
                mask = boxes_meeting(boxes_a, NODE * link_a, frame_b, probe)
                for slot in range(WIDTH):
                    if (mask >> slot) & 1:
                        stack[top] = ((link_a * WIDTH + slot) << 32) | b
                        top += 1
        k += 1
        starts[k] = found
    where[POSE] = k
    where[TOP] = 0
    where[FOUND] = found
    return DONE
