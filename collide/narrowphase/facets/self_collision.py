"""A surface against itself: pairs of facets that share more than the corners and edges they have in common.

Corners are the same where their coordinates are. Facets with no common corner must not meet at all. With one, v, they
share more exactly if the edge opposite v of one meets the other: whatever point besides v both have, the ray from v
through it leaves one of them over that edge. With two, they overlap exactly if they lie in one plane on one side of the
common edge. With three they are one facet twice. Common corners are points, each counted once. A facet without area is
the segment or the point that its corners span: an edge that a neighbour has too is nothing more, a longer one is.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PROBE, boxes_meeting
from collide.mesh.bvh import (
    EXPONENT,
    N_FACETS,
    NODE,
    WIDTH,
    open_tree,
)
from collide.narrowphase.facets.exact_corners import CORNERS, OWN_AT, STATE, forget_poses
from collide.narrowphase.facets.exact_triangles import MEET, OVERLAP, call_exactly
from collide.narrowphase.facets.filtered_triangles import (
    APART,
    MEETING,
    TINY,
    UNSURE,
    meeting_in_doubles,
    orientation,
    sign_error,
)
from collide.narrowphase.facets.posed_surfaces import FRAMES, PLACING, place
from collide.narrowphase.facets.surface_collision import box_size, link_of

#: Doubles and floats of workspace: a placing, corners, and a pose that moves nothing.
DOUBLES, FLOATS = PLACING + CORNERS + 16, 2 * FRAME + PROBE
BOXES, TRIANGLES, EXACT = range(3)
#: Doubles that are known of a facet's plane.
PLANE = 4
#: Where a walk stands.
TOP, FOUND = range(2)
DONE, FULL = range(2)
_MOST_AT_ONCE = 64


@kernel(inline=True)
def _same(P, a, b):
    return P[a] == P[b] and P[a + 1] == P[b + 1] and P[a + 2] == P[b + 2]


@kernel(inline=True)
def _shared(P, a, b):
    """(how many points are corners of both, which corner of a the last one is, and which of b)."""
    count = 0
    of_a = -1
    of_b = -1
    for j in range(3):
        if (j > 0 and _same(P, b, b + 3 * j)) or (j > 1 and _same(P, b + 3, b + 3 * j)):
            continue
        for i in range(3):
            if _same(P, a + 3 * i, b + 3 * j):
                count += 1
                of_a = i
                of_b = j
                break
    return count, of_a, of_b


@kernel
def _load(P, a, i, j, k, corners, at):
    """Corners i, j, k of a facet as corners at, at + 1, at + 2 of the exact stage."""
    for axis in range(3):
        corners[3 * at + axis] = P[a + 3 * i + axis]
        corners[3 * at + 3 + axis] = P[a + 3 * j + axis]
        corners[3 * at + 6 + axis] = P[a + 3 * k + axis]
    if at == 3:
        for word in range(9):
            corners[OWN_AT + word] = corners[9 + word]


@kernel
def _between(P, v, p, q, corners, arguments, decide, counters):
    """Whether corner v lies between corners p and q: facets without area can be so, and no others."""
    for axis in range(3):
        if P[v + axis] < min(P[p + axis], P[q + axis]) or P[v + axis] > max(P[p + axis], P[q + axis]):
            return False
    counters[EXACT] += 1
    _load(P, v, 0, 0, 0, corners, 0)
    _load(P, p, 0, (q - p) // 3, (q - p) // 3, corners, 3)
    return call_exactly(decide, (MEET, *arguments)) != 0


@kernel
def _opposite_meets(P, a, i, b, corners, error, arguments, decide, counters):
    """Whether what facet a has opposite its corner i meets facet b: an edge, or less where a has no area."""
    v = a + 3 * i
    p = a + 3 * ((i + 1) % 3)
    q = a + 3 * ((i + 2) % 3)
    if _same(P, p, v):
        p = q
    if _same(P, q, v):
        q = p
    if _same(P, p, v):
        return False
    if _between(P, v, p, q, corners, arguments, decide, counters):
        return _edge_meets(P, p, p, b, corners, error, arguments, decide, counters) or _edge_meets(
            P, q, q, b, corners, error, arguments, decide, counters
        )
    return _edge_meets(P, p, q, b, corners, error, arguments, decide, counters)


@kernel
def _edge_meets(P, p, q, b, corners, error, arguments, decide, counters):
    """Whether the edge between corners p and q of one facet meets facet b."""
    far = 0.0
    for axis in range(3):
        x = P[b + axis]
        far = max(far, abs(P[b + 3 + axis] - x), abs(P[b + 6 + axis] - x), abs(P[p + axis] - x), abs(P[q + axis] - x))
    limit = sign_error(far, error)
    start = orientation(P, b, P, b + 3, P, b + 6, P, p)
    end = orientation(P, b, P, b + 3, P, b + 6, P, q)
    if (start > limit and end > limit) or (start < -limit and end < -limit):
        return False
    one = orientation(P, b, P, b + 3, P, p, P, q)
    two = orientation(P, b + 3, P, b + 6, P, p, P, q)
    if (one > limit and two < -limit) or (one < -limit and two > limit):
        return False
    three = orientation(P, b + 6, P, b, P, p, P, q)
    if (one > limit and three < -limit) or (one < -limit and three > limit):
        return False
    if (two > limit and three < -limit) or (two < -limit and three > limit):
        return False
    counters[EXACT] += 1
    _load(P, b, 0, 1, 2, corners, 0)
    _load(P, p, 0, (q - p) // 3, (q - p) // 3, corners, 3)
    return call_exactly(decide, (MEET, *arguments)) != 0


@kernel(inline=True)
def _one_side(P, v, face, of_face, other, of_other, error):
    """Whether the two corners of ``other`` besides the common one, v, are certainly on one side of the face's plane."""
    c = face + 3 * ((of_face + 1) % 3)
    d = face + 3 * ((of_face + 2) % 3)
    p = other + 3 * ((of_other + 1) % 3)
    q = other + 3 * ((of_other + 2) % 3)
    x = P[v]
    y = P[v + 1]
    z = P[v + 2]
    ux = P[c] - x
    uy = P[c + 1] - y
    uz = P[c + 2] - z
    vx = P[d] - x
    vy = P[d + 1] - y
    vz = P[d + 2] - z
    px = P[p] - x
    py = P[p + 1] - y
    pz = P[p + 2] - z
    qx = P[q] - x
    qy = P[q + 1] - y
    qz = P[q + 2] - z
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    one = nx * px + ny * py + nz * pz
    two = nx * qx + ny * qy + nz * qz
    far = max(
        abs(ux), abs(uy), abs(uz), abs(vx), abs(vy), abs(vz), abs(px), abs(py), abs(pz), abs(qx), abs(qy), abs(qz)
    )
    limit = sign_error(far, error)
    return (one > limit and two > limit) or (one < -limit and two < -limit)


@kernel
def _set_planes(P, n, planes):
    """PLANE doubles a facet: the edges' cross product, and the longest edge along an axis, squared."""
    for facet in range(n):
        a = 9 * facet
        x = P[a]
        y = P[a + 1]
        z = P[a + 2]
        ux = P[a + 3] - x
        uy = P[a + 4] - y
        uz = P[a + 5] - z
        vx = P[a + 6] - x
        vy = P[a + 7] - y
        vz = P[a + 8] - z
        edge = max(max(abs(ux), abs(uy), abs(uz)), max(abs(vx), abs(vy), abs(vz)))
        at = PLANE * facet
        planes[at] = uy * vz - uz * vy
        planes[at + 1] = uz * vx - ux * vz
        planes[at + 2] = ux * vy - uy * vx
        planes[at + 3] = edge * edge


@kernel(inline=True)
def _is_corner(P, a, x, y, z):
    """Whether a point is a corner of a facet. No branches: they cannot be foreseen, and cost more than all of this."""
    return (
        ((x == P[a]) & (y == P[a + 1]) & (z == P[a + 2]))
        | ((x == P[a + 3]) & (y == P[a + 4]) & (z == P[a + 5]))
        | ((x == P[a + 6]) & (y == P[a + 7]) & (z == P[a + 8]))
    )


@kernel(inline=True)
def _off_plane(P, planes, one, other, reach):
    """Whether all corners of the other facet that are none of the one's are certainly on one side of its plane, and there is one.

    Then the other has the common corners in that plane, and what is between them: no more. Coordinates are exact, so with
    edges up to L a side at distance w is off by 64 u L² w, as in `filtered_triangles.py`. reach : no w is more, along any axis.
    """
    a = 9 * one
    b = 9 * other
    nx = planes[PLANE * one]
    ny = planes[PLANE * one + 1]
    nz = planes[PLANE * one + 2]
    x = P[a]
    y = P[a + 1]
    z = P[a + 2]
    px = P[b] - x
    py = P[b + 1] - y
    pz = P[b + 2] - z
    qx = P[b + 3] - x
    qy = P[b + 4] - y
    qz = P[b + 5] - z
    rx = P[b + 6] - x
    ry = P[b + 7] - y
    rz = P[b + 8] - z
    first = nx * px + ny * py + nz * pz
    second = nx * qx + ny * qy + nz * qz
    third = nx * rx + ny * ry + nz * rz
    limit = planes[PLANE * one + 3] * reach * 2.0**-47 + TINY
    above = (first > limit) | (second > limit) | (third > limit)
    below = (first < -limit) | (second < -limit) | (third < -limit)
    return (
        (above != below)
        & ((abs(first) > limit) | _is_corner(P, a, P[b], P[b + 1], P[b + 2]))
        & ((abs(second) > limit) | _is_corner(P, a, P[b + 3], P[b + 4], P[b + 5]))
        & ((abs(third) > limit) | _is_corner(P, a, P[b + 6], P[b + 7], P[b + 8]))
    )


@kernel
def _across_a_side(P, planes, one, other, reach):
    """Whether all corners of b that are no ends of some side of a are certainly beyond that side, seen along a's normal.

    Facets around a vertex of a smooth surface are so. The wall on a side holds nothing of a but the side, and of b its
    common corners with it. Sides of points at distance w: 256 u L³ w.
    """
    a = 9 * one
    b = 9 * other
    nx = planes[PLANE * one]
    ny = planes[PLANE * one + 1]
    nz = planes[PLANE * one + 2]
    square = planes[PLANE * one + 3]
    limit = square * math.sqrt(square) * reach * 2.0**-44 + TINY
    for k in range(3):
        i = a + 3 * k
        j = a + 3 * ((k + 1) % 3)
        x = P[i]
        y = P[i + 1]
        z = P[i + 2]
        ex = P[j] - x
        ey = P[j + 1] - y
        ez = P[j + 2] - z
        mx = ey * nz - ez * ny
        my = ez * nx - ex * nz
        mz = ex * ny - ey * nx
        beyond = True
        proper = False
        for c in range(b, b + 9, 3):
            wx = P[c] - x
            wy = P[c + 1] - y
            wz = P[c + 2] - z
            outside = mx * wx + my * wy + mz * wz > limit
            proper = proper | outside
            beyond = beyond & (
                outside
                | ((wx == 0.0) & (wy == 0.0) & (wz == 0.0))
                | ((P[c] == P[j]) & (P[c + 1] == P[j + 1]) & (P[c + 2] == P[j + 2]))
            )
        if beyond & proper:
            return True
    return False


@kernel
def _conflict(P, a, b, corners, error, arguments, decide, counters):
    """Whether two facets share more than corners and edges."""
    count, i, j = _shared(P, a, b)
    if count == 0:
        verdict = meeting_in_doubles(P, P, b, a, error)
        if verdict != UNSURE:
            return verdict != APART
        counters[EXACT] += 1
        _load(P, a, 0, 1, 2, corners, 0)
        _load(P, b, 0, 1, 2, corners, 3)
        return call_exactly(decide, (MEET, *arguments)) == MEETING
    if count == 1:
        if _one_side(P, a + 3 * i, b, j, a, i, error) or _one_side(P, a + 3 * i, a, i, b, j, error):
            return False
        return _opposite_meets(P, a, i, b, corners, error, arguments, decide, counters) or _opposite_meets(
            P, b, j, a, corners, error, arguments, decide, counters
        )
    if count > 2:
        return True
    # Two: turn both so that the corner that is not common comes last.
    free_a = _free(P, a, b)
    free_b = _free(P, b, a)
    if free_a < 0 or free_b < 0:
        return False  # a facet without area on an edge of the other
    far = 0.0
    for axis in range(3):
        x = P[a + 3 * free_a + axis]
        for k in range(3):
            far = max(far, abs(P[a + 3 * k + axis] - x), abs(P[b + 3 * k + axis] - x))
    v = a + 3 * ((free_a + 1) % 3)
    w = a + 3 * ((free_a + 2) % 3)
    if abs(orientation(P, v, P, w, P, a + 3 * free_a, P, b + 3 * free_b)) > sign_error(far, error):
        return False
    counters[EXACT] += 1
    _load(P, a, (free_a + 1) % 3, (free_a + 2) % 3, free_a, corners, 0)
    _load(P, b, (free_b + 1) % 3, (free_b + 2) % 3, free_b, corners, 3)
    if call_exactly(decide, (OVERLAP, *arguments)) != 0:
        return True
    x = a + 3 * free_a
    y = b + 3 * free_b
    for _ in range(2):  # neither has an area, and both reach beyond the same end of the common edge
        if _between(P, w, v, x, corners, arguments, decide, counters) and _between(
            P, w, v, y, corners, arguments, decide, counters
        ):
            return True
        v, w = w, v
    return False


@kernel
def _free(P, a, b):
    """The corner of a that is none of b's; −1 where all are."""
    for i in range(3):
        shared = False
        for j in range(3):
            shared = shared or _same(P, a + 3 * i, b + 3 * j)
        if not shared:
            return i
    return -1


@kernel(inline=True)
def _set_own_probe(placing, nodes, ref, probe):
    """Make the box behind a reference the probe among boxes of its own tree, where only their own axes tell."""
    at = NODE * (ref >> 3) + (ref & 7)
    for i in range(3):
        probe[i] = nodes[at + WIDTH * i]
        probe[3 + i] = np.float32(float(nodes[at + WIDTH * (3 + i)]) + placing[FRAMES + 12 + i])


@kernel
def _forget_other_axes(frame, probe):
    for k in range(FRAME):
        frame[k] = np.float32(0.0)
    for k in range(6, PROBE):
        probe[k] = np.float32(0.0)
    for k in range(9, 12):
        probe[k] = np.float32(1.0)


@entry(
    "int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)"
)
def walk_itself(
    header_at, pairs_at, capacity, counters_at, where_at, planes_at, stack_at, n_stack, doubles_at, integers_at, decide
):
    """Pairs of facets of one surface that share more than corners and edges; DONE or FULL, then to be called again.

    planes : room for PLANE doubles a facet, kept between calls.
    pairs : out, the smaller facet number times the number of facets plus the larger.
    """
    header, numbers, boxes, links, P, ids = open_tree(header_at)
    pairs = view_i64(pairs_at, capacity)
    counters = view_i64(counters_at, 3)
    where = view_i64(where_at, 2)
    planes = view_f64(planes_at, PLANE * header[N_FACETS])
    stack = view_i64(stack_at, n_stack)
    placing = view_f64(doubles_at, PLACING)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    still_at = doubles_at + 8 * (PLACING + CORNERS)
    still = view_f64(still_at, 16)
    frames = view_f32(doubles_at + 8 * DOUBLES, 2 * FRAME)
    frame = view_f32(doubles_at + 8 * DOUBLES, FRAME)
    probe = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME, PROBE)
    for k in range(16):
        still[k] = 1.0 if k % 5 == 0 else 0.0
    place(header, numbers, still, header, numbers, still, placing, frames)
    forget_poses(view_i64(integers_at, STATE))
    _forget_other_axes(frame, probe)
    arguments = (doubles_at + 8 * PLACING, doubles_at, integers_at, still_at, still_at)
    unit = math.ldexp(1.0, int(header[EXPONENT]))
    wider = 2.0**-16 + 2.0 * max(placing[FRAMES + 12], placing[FRAMES + 13], placing[FRAMES + 14])
    top = where[TOP]
    found = where[FOUND]
    if top == 0:
        _set_planes(P, header[N_FACETS], planes)
        stack[0] = 0
        top = 1
    while top > 0:
        if found + _MOST_AT_ONCE > capacity:
            where[TOP] = top
            where[FOUND] = found
            return FULL
        top -= 1
        one = stack[top] >> 32
        two = stack[top] & 0xFFFFFFFF
        link = int(link_of(links, one))
        other = int(link_of(links, two))
        if link < 0 and other < 0:
            # Boxes that meet hold both facets: no coordinate differs by more than their widths, and what probes are enlarged by.
            reach = unit * (2.01 * (box_size(boxes, one) + box_size(boxes, two)) + wider)
            for i in range(~link & 7):
                a = (~link >> 3) + i
                for j in range(i + 1 if one == two else 0, ~other & 7):
                    b = (~other >> 3) + j
                    counters[TRIANGLES] += 1
                    if _off_plane(P, planes, a, b, reach):
                        continue
                    if _off_plane(P, planes, b, a, reach) or _across_a_side(P, planes, a, b, reach):
                        continue
                    if _conflict(P, 9 * a, 9 * b, corners, 0.0, arguments, decide, counters):
                        x = min(ids[a], ids[b])
                        y = max(ids[a], ids[b])
                        pairs[found] = int(x) * header[N_FACETS] + int(y)
                        found += 1
            continue
        if one == two:
            # Every child with itself and with those after it.
            for first in range(WIDTH):
                child = link * WIDTH + first
                if boxes[NODE * link + 3 * WIDTH + first] < 0.0:
                    continue
                counters[BOXES] += 1
                _set_own_probe(placing, boxes, child, probe)
                mask = boxes_meeting(boxes, NODE * link, frame, probe)
                for slot in range(first, WIDTH):
                    if (mask >> slot) & 1:
                        stack[top] = (child << 32) | (link * WIDTH + slot)
                        top += 1
            continue
        counters[BOXES] += 1
        if link < 0 or (other >= 0 and box_size(boxes, two) > box_size(boxes, one)):
            fixed = one
            node = other
        else:
            fixed = two
            node = link
        _set_own_probe(placing, boxes, fixed, probe)
        mask = boxes_meeting(boxes, NODE * node, frame, probe)
        for slot in range(WIDTH):
            if (mask >> slot) & 1:
                stack[top] = (fixed << 32) | (node * WIDTH + slot)
                top += 1
    where[TOP] = 0
    where[FOUND] = found
    return DONE
