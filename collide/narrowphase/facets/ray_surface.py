"""Rays against one posed surface: every facet a ray meets, or those that may be the first.

A ray is {o + t d, t ≥ 0} with o and d exact reals. Its segment to T d, T a power of two beyond the surface, is posed
without rounding: by the shift o, with ends 0 and T d. So whether it meets a closed facet is decided as for any two
triangles, in doubles with error bounds and then in integers: no ray slips between facets that share an edge.

Boxes are parted from the segment along their own axes and the cross products of these with the ray: nothing else can
part a segment from a box (S. Gottschalk, M. Lin and D. Manocha, "OBBTree", 1996). The nearest box is opened first, and
what begins beyond the nearest hit is left.

Where a ray crosses a facet's plane is a quotient n·(a − o) / n·d with proven errors of both: a bracket. Callers
settle in exact arithmetic which of several overlapping brackets comes first.
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
from collide.narrowphase.facets.exact_triangles import MEET, call_exactly
from collide.narrowphase.facets.filtered_triangles import TINY, sign_error
from collide.narrowphase.facets.posed_surfaces import ERROR, PLACING, M, place, transform
from collide.narrowphase.facets.surface_collision import link_of, no_slab

#: Doubles of a ray: origin (3), direction (3), T, and the largest t that counts.
RAY = 8
_T, _LIMIT = 6, 7
#: Doubles of a hit: number of the ray, of the facet, t from below, t, t from above, and 1 where t is to be worked out
#: exactly: the ray lies in the facet's plane, or doubles could not tell whether they meet.
HIT = 6
RAY_OF, FACET_OF, LOWER, VALUE, UPPER, OPEN = range(HIT)

#: Where a walk stands: ray, hits found.
AT_RAY, FOUND = range(2)
DONE, FULL, SINGULAR = range(3)
#: Hits that a leaf may add.
_MOST_AT_ONCE = 8
#: Doubles and floats of workspace. A ray in the units of the boxes: origin (3), direction to T (3), the error of a point on
#: it, the direction's largest component, and the least t at which it may meet boxes; then its direction in A's frame (3), and
#: room for a bracket (3).
_OWN = 9
_LINE = PLACING + CORNERS + NUMBERS + 16
DOUBLES = _LINE + _OWN + 6
FLOATS = 3 * FRAME + PROBE

_U = 2.0**-53
#: Boxes of a tree stay within this, in its units, and some.
_EXTENT = 1.01
MISSED, MET, UNCLEAR = range(3)


@kernel
def _set_line(header, numbers, placing, corners, ends, line, frame, probe):
    """The ray in the units of the boxes, and the axes across it; False where it clearly misses all of them.

    line : origin, direction, error of a point on it, largest component of the direction, first and last t.
    """
    scale = math.ldexp(1.0, int(-header[EXPONENT]))
    largest = 0.0
    away = 0.0
    for i in range(3):
        turned = 0.0
        for j in range(3):
            turned += placing[M + 3 * i + j] * ends[3 + j]
        line[_OWN + i] = turned
        line[i] = (corners[9 + i] - numbers[CENTRE + i]) * scale
        line[3 + i] = turned * scale
        largest = max(largest, abs(line[3 + i]))
        away = max(away, abs(line[i]), abs(numbers[CENTRE + i] * scale))
    error = 8.0 * scale * placing[ERROR] + 2.0**-46 * (away + largest)
    line[6] = error
    line[7] = largest
    first = 0.0
    last = 1.0
    room = _EXTENT + error
    for i in range(3):
        step = line[3 + i]
        if abs(step) > 2.0**-60 * largest:
            near = (-room - line[i]) / step
            far = (room - line[i]) / step
            if step < 0.0:
                near, far = far, near
            first = max(first, near)
            last = min(last, far)
        elif abs(line[i]) > room + abs(step):
            return False
    # A quotient is off by its rounding only: far less than what the room is too wide.
    if not first <= last or not largest > 0.0:
        return False
    line[8] = first
    x = line[3] / largest
    y = line[4] / largest
    z = line[5] / largest
    middle = 0.5 * (first + last)
    for k in range(FRAME):
        frame[k] = np.float32(0.0)
    frame[1] = np.float32(-z)
    frame[2] = np.float32(y)
    frame[3] = np.float32(z)
    frame[5] = np.float32(-x)
    frame[6] = np.float32(-y)
    frame[7] = np.float32(x)
    cx = line[0] + middle * line[3]
    cy = line[1] + middle * line[4]
    cz = line[2] + middle * line[5]
    probe[6] = np.float32(z * cy - y * cz)
    probe[7] = np.float32(x * cz - z * cx)
    probe[8] = np.float32(y * cx - x * cy)
    # Floats: 2^-24 of terms, at most 8 of them; the line is off by its error along each of two axes.
    size = max(abs(cx), abs(cy), abs(cz))
    reach = 2.0 * error + 2.0**-19 * (2.0 + 2.0 * size) + 2.0**-110
    for k in range(3):
        probe[9 + k] = np.float32(reach)
    _set_ends(line, last, probe)
    return True


@kernel(inline=True)
def _set_ends(line, last, probe):
    """The box around the ray's segment from where it may begin to meet boxes to ``last``."""
    middle = 0.5 * (line[8] + last)
    half = 0.5 * (last - line[8])
    for i in range(3):
        centre = line[i] + middle * line[3 + i]
        length = abs(half * line[3 + i])
        probe[i] = np.float32(centre)
        probe[3 + i] = np.float32(length + line[6] + 2.0**-19 * (abs(centre) + length + 1.0) + 2.0**-110)


@kernel
def _bracket(P, a, corners, line, error, out):
    """Bracket of t of the crossing of a facet's plane, in out[0 … 2]; False where doubles cannot tell.

    Bounds as in `filtered_triangles.py`: with edges up to L, sides of points at distance w: L² (8E + 64 u w).
    """
    ux = P[a + 3] - P[a]
    uy = P[a + 4] - P[a + 1]
    uz = P[a + 5] - P[a + 2]
    vx = P[a + 6] - P[a]
    vy = P[a + 7] - P[a + 1]
    vz = P[a + 8] - P[a + 2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    wx = P[a] - corners[9]
    wy = P[a + 1] - corners[10]
    wz = P[a + 2] - corners[11]
    dx = line[_OWN]
    dy = line[_OWN + 1]
    dz = line[_OWN + 2]
    side = nx * wx + ny * wy + nz * wz
    slope = nx * dx + ny * dy + nz * dz
    edge = max(abs(ux), abs(uy), abs(uz), abs(vx), abs(vy), abs(vz))
    square = edge * edge
    side_error = square * (8.0 * error + 64.0 * _U * max(abs(wx), abs(wy), abs(wz))) + TINY
    slope_error = square * (8.0 * error + 64.0 * _U * max(abs(dx), abs(dy), abs(dz))) + TINY
    if not abs(slope) > 2.0 * slope_error:
        return False
    t = side / slope
    # |side'/slope' − side/slope| ≤ (δside + |t| δslope) / (|slope| − δslope), and some for the rounding here.
    off = (side_error + abs(t) * slope_error) / (abs(slope) - slope_error) * (1.0 + 2.0**-40) + abs(t) * 2.0**-50
    out[0] = t - off
    out[1] = t
    out[2] = t + off
    return True


@kernel
def _meets(P, a, corners, line, error, out):
    """MISSED, MET or UNCLEAR by doubles, for the ray and one facet; where MET, out is the bracket of t."""
    ax = P[a] - corners[9]
    ay = P[a + 1] - corners[10]
    az = P[a + 2] - corners[11]
    bx = P[a + 3] - corners[9]
    by = P[a + 4] - corners[10]
    bz = P[a + 5] - corners[11]
    cx = P[a + 6] - corners[9]
    cy = P[a + 7] - corners[10]
    cz = P[a + 8] - corners[11]
    dx = line[_OWN]
    dy = line[_OWN + 1]
    dz = line[_OWN + 2]
    reach = max(abs(ax), abs(ay), abs(az), abs(bx), abs(by), abs(bz), abs(cx), abs(cy), abs(cz))
    reach = max(reach, abs(dx), abs(dy), abs(dz))
    limit = sign_error(reach, error)
    one = (ay * bz - az * by) * dx + (az * bx - ax * bz) * dy + (ax * by - ay * bx) * dz
    two = (by * cz - bz * cy) * dx + (bz * cx - bx * cz) * dy + (bx * cy - by * cx) * dz
    if (one > limit and two < -limit) or (one < -limit and two > limit):
        return MISSED
    three = (cy * az - cz * ay) * dx + (cz * ax - cx * az) * dy + (cx * ay - cy * ax) * dz
    if (one > limit and three < -limit) or (one < -limit and three > limit):
        return MISSED
    if (two > limit and three < -limit) or (two < -limit and three > limit):
        return MISSED
    if not _bracket(P, a, corners, line, error, out):
        return UNCLEAR
    if out[2] < 0.0 or out[0] > 1.0:
        return MISSED
    sure = (one > limit and two > limit and three > limit) or (one < -limit and two < -limit and three < -limit)
    return MET if sure and out[0] > 0.0 and out[2] < 1.0 else UNCLEAR


@kernel
def _range_of_corners(P, a, corners, line, error, out):
    """Bracket of t by the facet's corners, seen along the ray: for facets known to be met."""
    square = 0.0
    size = 0.0
    for i in range(3):
        d = line[_OWN + i]
        square += d * d
        size = max(size, abs(d))
    low = math.inf
    high = -math.inf
    far = 0.0
    for k in range(3):
        along = 0.0
        for i in range(3):
            w = P[a + 3 * k + i] - corners[9 + i]
            along += w * line[_OWN + i]
            far = max(far, abs(w))
        low = min(low, along)
        high = max(high, along)
    # Corners are off by E + u far, the direction by E: far more than enough for both, and the square.
    off = (8.0 * error + 64.0 * _U * (far + size)) * (size + far) * (1.0 + (far + size) / size)
    out[0] = (low - off) / square * (1.0 - math.copysign(2.0**-40, low - off))
    out[2] = (high + off) / square * (1.0 + math.copysign(2.0**-40, high + off))
    out[1] = 0.5 * out[0] + 0.5 * out[2]


@kernel
def _facets(P, ids, run, corners, line, out, error, arguments, decide, counters, ray, best, first_only, hits, found):
    """All triangles of a leaf; returns (hits there are now, the least t from above)."""
    for k in range(run & 7):
        a = 9 * ((run >> 3) + k)
        counters[1] += 1
        how = _meets(P, a, corners, line, error, out)
        if how == MISSED:
            continue
        unclear = how == UNCLEAR
        if unclear:
            counters[2] += 1
            for word in range(9):
                corners[word] = P[a + word]
            if call_exactly(decide, (MEET, *arguments)) == 0:
                continue
            if not _bracket(P, a, corners, line, error, out):
                _range_of_corners(P, a, corners, line, error, out)
        if out[0] > best:
            continue
        at = HIT * found
        hits[at + RAY_OF] = ray
        hits[at + FACET_OF] = ids[a // 9]
        hits[at + LOWER] = max(out[0], 0.0)
        hits[at + VALUE] = min(max(out[1], 0.0), out[2])
        hits[at + UPPER] = max(out[2], 0.0)
        hits[at + OPEN] = 1.0 if unclear else 0.0
        found += 1
        if first_only:
            best = min(best, out[2])
    return found, best


@kernel(inline=True)
def _begins(boxes, at, slot, x, y, z):
    """The least height of a box of a node along the direction (x, y, z)."""
    middle = x * boxes[at + slot] + y * boxes[at + WIDTH + slot] + z * boxes[at + 2 * WIDTH + slot]
    half = (
        abs(x) * boxes[at + 3 * WIDTH + slot] + abs(y) * boxes[at + 4 * WIDTH + slot] + abs(z) * boxes[at + 5 * WIDTH + slot]
    )
    return middle - half


@kernel
def _cast(
    boxes, links, P, ids, line, out, placing, corners, frame, probe, stack, keys, arguments, decide, counters, ray, limit,
    first_only, hits, found, capacity,
):  # fmt: skip
    """All candidates of one ray; returns how many hits there are now, −1 where there is no room."""
    begin = found
    best = limit
    x = line[3] / line[7]
    y = line[4] / line[7]
    z = line[5] / line[7]
    start = x * line[0] + y * line[1] + z * line[2]
    pace = x * line[3] + y * line[4] + z * line[5]
    # Heights of boxes are sums of doubles and floats, rounded; the ray is off by its error.
    slack = 4.0 * line[6] + 2.0**-40 * (abs(start) + pace + 4.0)
    stack[0] = 0
    keys[0] = -math.inf
    top = 1
    while top > 0:
        top -= 1
        if keys[top] > start + best * pace + slack:
            continue
        link = int(link_of(links, stack[top]))
        if link < 0:
            if found + _MOST_AT_ONCE > capacity:
                return -1
            before = best
            found, best = _facets(
                P, ids, ~link, corners, line, out, placing[ERROR], arguments, decide, counters, ray, best, first_only, hits,
                found,
            )  # fmt: skip
            if best < before:
                _set_ends(line, max(min(1.0, best), line[8]), probe)
            continue
        counters[0] += 1
        at = NODE * link
        mask = boxes_meeting(boxes, at, frame, probe)
        base = top
        for slot in range(WIDTH):
            if (mask >> slot) & 1:
                key = _begins(boxes, at, slot, x, y, z)
                place_at = top
                while place_at > base and keys[place_at - 1] < key:
                    keys[place_at] = keys[place_at - 1]
                    stack[place_at] = stack[place_at - 1]
                    place_at -= 1
                keys[place_at] = key
                stack[place_at] = link * WIDTH + slot
                top += 1
    if not first_only:
        return found
    kept = begin
    for k in range(begin, found):
        if hits[HIT * k + LOWER] <= best:
            if kept < k:
                for word in range(HIT):
                    hits[HIT * kept + word] = hits[HIT * k + word]
            kept += 1
    return kept


#: Of `cast_rays`.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, boolean, int64, int64, int64, int64, int64, int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def cast_rays(
    header_at, XA_at, step_a, rays_at, n, first_only, hits_at, capacity, counters_at, where_at, stack_at, n_stack, doubles_at,
    integers_at, decide,
):  # fmt: skip
    """Facets that n rays (RAY doubles each, in the world) meet, from where an earlier call stopped; DONE, FULL or SINGULAR.

    first_only : of each ray only those that may be met first, by their brackets of t.
    hits : out, HIT doubles each, those of a ray together; t in units of T.   counters : boxes, triangles, exact, a row a ray.
    """
    header, numbers, boxes, links, P, ids = open_tree(header_at)
    hits = view_f64(hits_at, HIT * capacity)
    where = view_i64(where_at, 2)
    stack = view_i64(stack_at, n_stack)
    header_b = view_i64(stack_at + 8 * n_stack, INTS)
    keys = view_f64(stack_at + 8 * (n_stack + 16), n_stack)
    placing = view_f64(doubles_at, PLACING)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    ends = view_f64(doubles_at + 8 * (PLACING + OWN_AT), 9)
    numbers_b = view_f64(doubles_at + 8 * (PLACING + CORNERS), NUMBERS)
    XB_at = doubles_at + 8 * (PLACING + CORNERS + NUMBERS)
    XB = view_f64(XB_at, 16)
    line = view_f64(doubles_at + 8 * _LINE, _OWN + 3)
    out = view_f64(doubles_at + 8 * (_LINE + _OWN + 3), 3)
    frames = view_f32(doubles_at + 8 * DOUBLES, 2 * FRAME)
    frame = view_f32(doubles_at + 8 * DOUBLES + 8 * FRAME, FRAME)
    probe = view_f32(doubles_at + 8 * DOUBLES + 12 * FRAME, PROBE)
    state = view_i64(integers_at, STATE)
    for k in range(16):
        XB[k] = 1.0 if k % 5 == 0 else 0.0
    no_slab(probe)
    found = where[FOUND]
    for ray in range(where[AT_RAY], n):
        given = view_f64(rays_at + 8 * RAY * ray, RAY)
        counters = view_i64(counters_at + 24 * ray, 3)
        largest = 0.0
        for i in range(3):
            XB[4 * i + 3] = given[i]
            ends[i] = 0.0
            ends[3 + i] = given[3 + i] * given[_T]
            ends[6 + i] = ends[3 + i]
            numbers_b[CENTRE + i] = 0.0
            numbers_b[REACH + i] = abs(ends[3 + i])
            largest = max(largest, abs(ends[3 + i]))
        header_b[EXPONENT] = math.frexp(largest)[1]
        XA_here = XA_at + 8 * step_a * ray
        if not place(header, numbers, view_f64(XA_here, 16), header_b, numbers_b, XB, placing, frames):
            where[AT_RAY] = ray
            return SINGULAR
        forget_poses(state)
        transform(placing, ends, 0, corners, 9)
        if not _set_line(header, numbers, placing, corners, ends, line, frame, probe):
            continue
        arguments = (doubles_at + 8 * PLACING, doubles_at, integers_at, XA_here, XB_at)
        now = _cast(
            boxes, links, P, ids, line, out, placing, corners, frame, probe, stack, keys, arguments, decide, counters, ray,
            given[_LIMIT], first_only, hits, found, capacity,
        )  # fmt: skip
        if now < 0:
            where[AT_RAY] = ray
            where[FOUND] = found
            for k in range(3):
                counters[k] = 0
            return FULL
        found = now
    where[AT_RAY] = n
    where[FOUND] = found
    return DONE
