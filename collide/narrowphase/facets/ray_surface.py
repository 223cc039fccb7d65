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
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.mesh.box_overlap import boxes_meeting
from collide.mesh.bvh import CENTRE, EXPONENT, NODE, REACH, WIDTH, box_at, open_tree
from collide.mesh.triangle import normal_of, triangle_at
from collide.narrowphase.facets.box_probes import clear_slab, put_floats
from collide.narrowphase.facets.exact_triangles import MEET
from collide.narrowphase.facets.filtered_triangles import (
    AMBIGUOUS,
    APART,
    MEETING,
    TINY,
    opposed,
    same_side,
    sign_error,
)
from collide.narrowphase.facets.posed_segment import (
    BOXES,
    COUNTERS,
    SEGMENT_DOUBLES,
    SEGMENT_FLOATS,
    TRIANGLES,
    PosedSegment,
    ask_segment_exactly,
    open_segment,
    place_segment,
)
from collide.narrowphase.facets.posed_surfaces import ERROR, M
from collide.narrowphase.facets.traversal import box_of_tree, make_traversal
from collide.numerics.vec3 import (
    Vec3,
    absolute,
    add,
    cross,
    divide,
    dot,
    max_abs,
    put_vec3,
    rotate,
    scale,
    sub,
    vec3_at,
)

#: Doubles of a ray: origin (3), direction (3), T, and the largest t that counts.
RAY = 8
_T, _LIMIT = 6, 7
#: Doubles of a hit: number of the ray, of the facet, t from below, t, t from above, and 1 where t is to be worked out
#: exactly: the ray lies in the facet's plane, or doubles could not tell whether they meet.
HIT = 6
RAY_OF, FACET_OF, LOWER, VALUE, UPPER, OPEN = range(HIT)

# Progress, integers: the ray, the hits found.
AT_RAY, N_HITS = range(2)
DONE, FULL, SINGULAR = range(3)
#: Hits that a leaf may add.
_MAX_HITS = 8
# Doubles that change on the way: the least upper bound of t so far, and a bracket of t (3).
_BEST, _BRACKET = 0, 1
#: Doubles and floats of workspace: those of a segment, the ray's pose, and what changes.
DOUBLES = SEGMENT_DOUBLES + 16 + 4
FLOATS = SEGMENT_FLOATS

_U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: Boxes of a tree stay within this, in its units, and some.
_EXTENT = 1.01


class _Line(NamedTuple):
    """A ray's segment from its origin to T times its direction.

    direction : in A's frame, as long as to T.   error : bound of the error of a coordinate there.
    In units of the boxes, from the tree's centre:
    start, to_end : origin, and from there to the end.   box_error : bound of the error of a point's coordinate.
    size : the largest component of to_end.   first, last : t between which boxes may be met.
    """

    direction: Vec3
    error: float
    start: Vec3
    to_end: Vec3
    box_error: float
    size: float
    first: float
    last: float


class _Query(NamedTuple):
    """One ray.

    along : to_end over its largest component.
    height, pace, slack : heights along it, of the start, of a step of t = 1, and the bound of their error.
    keys : the heights at which the boxes on the stack begin.   best : _BEST, then a bracket.
    hits : out, room for ``capacity``.   progress : as above.
    """

    segment: PosedSegment
    line: _Line
    along: Vec3
    height: float
    pace: float
    slack: float
    keys: np.ndarray
    best: np.ndarray
    ray: int
    first_only: bool
    hits: np.ndarray
    capacity: int
    progress: np.ndarray


@kernel
def _line_of(segment):
    """The ray's segment; ``last`` is below ``first`` where it clearly misses all boxes."""
    tree, placing = segment.tree, segment.placing
    unit = math.ldexp(1.0, int(-tree.header[EXPONENT]))
    centre = vec3_at(tree.numbers, CENTRE)
    direction = rotate(placing, M, vec3_at(segment.ends, 3))
    start = scale(unit, sub(vec3_at(segment.corners, 9), centre))
    to_end = scale(unit, direction)
    size = max_abs(to_end)
    error = 8.0 * unit * placing[ERROR] + 2.0**-46 * (max(max_abs(start), max_abs(scale(unit, centre))) + size)
    half = _EXTENT + error
    first, last = _clip(start.x, to_end.x, half, size, 0.0, 1.0)
    first, last = _clip(start.y, to_end.y, half, size, first, last)
    first, last = _clip(start.z, to_end.z, half, size, first, last)
    if not size > 0.0:
        last = -1.0
    return _Line(direction, placing[ERROR], start, to_end, error, size, first, last)


@kernel(inline=True)
def _clip(start, step, half, size, first, last):
    """(first, last) t of a line within −half … half along an axis, and within those given; last is −1 for none."""
    if abs(step) > 2.0**-60 * size:
        near = (-half - start) / step
        far = (half - start) / step
        if step < 0.0:
            near, far = far, near
        # A quotient is off by its rounding only: far less than what ``half`` is too wide.
        return max(first, near), min(last, far)
    return first, (-1.0 if abs(start) > half + abs(step) else last)


@kernel
def _set_probe(line, frame, probe):
    """The axes across the line, and its box, as the probe of the tree's boxes."""
    along = divide(line.to_end, line.size)
    put_floats(frame, 0, Vec3(0.0, -along.z, along.y))
    put_floats(frame, 3, Vec3(along.z, 0.0, -along.x))
    put_floats(frame, 6, Vec3(-along.y, along.x, 0.0))
    centre = add(line.start, scale(0.5 * (line.first + line.last), line.to_end))
    put_floats(probe, 6, cross(centre, along))
    # Floats: 2^-24 of terms, at most 8 of them; the line is off by its error along each of two axes.
    reach = 2.0 * line.box_error + _FLOAT_ERROR * (2.0 + 2.0 * max_abs(centre)) + 2.0**-110
    put_floats(probe, 9, Vec3(reach, reach, reach))
    clear_slab(probe)
    _set_ends(line, line.last, probe)


@kernel(inline=True)
def _set_ends(line, last, probe):
    """The box around the line from where it may begin to meet boxes to t = ``last``, as the probe's."""
    centre = add(line.start, scale(0.5 * (line.first + last), line.to_end))
    half = absolute(scale(0.5 * (last - line.first), line.to_end))
    put_floats(probe, 0, centre)
    put_floats(
        probe, 3,
        Vec3(_enlarged(line, centre.x, half.x), _enlarged(line, centre.y, half.y), _enlarged(line, centre.z, half.z)),
    )  # fmt: skip


@kernel(inline=True)
def _enlarged(line, centre, half):
    return half + line.box_error + _FLOAT_ERROR * (abs(centre) + half + 1.0) + 2.0**-110


@kernel
def _bracket(triangles, a, corners, line, out):
    """Bracket of t of the crossing of a facet's plane, in out[_BRACKET …]; False where doubles cannot tell.

    Bounds as in `filtered_triangles.py`: with edges up to L, sides of points at distance w: L² (8E + 64 u w).
    """
    triangle = triangle_at(triangles, a)
    n = normal_of(triangle)
    w = sub(triangle.p, vec3_at(corners, 9))
    side = dot(n, w)
    slope = dot(n, line.direction)
    edge = max(max_abs(sub(triangle.q, triangle.p)), max_abs(sub(triangle.r, triangle.p)))
    square = edge * edge
    side_error = square * (8.0 * line.error + 64.0 * _U * max_abs(w)) + TINY
    slope_error = square * (8.0 * line.error + 64.0 * _U * max_abs(line.direction)) + TINY
    if not abs(slope) > 2.0 * slope_error:
        return False
    t = side / slope
    # |side'/slope' − side/slope| ≤ (δside + |t| δslope) / (|slope| − δslope), and some for the rounding here.
    error = (side_error + abs(t) * slope_error) / (abs(slope) - slope_error) * (1.0 + 2.0**-40) + abs(t) * 2.0**-50
    put_vec3(out, _BRACKET, Vec3(t - error, t, t + error))
    return True


@kernel
def _meets(triangles, a, corners, line, out):
    """APART, MEETING or AMBIGUOUS by doubles, for the ray and one facet; where MEETING, out is the bracket of t."""
    origin = vec3_at(corners, 9)
    p = sub(vec3_at(triangles, a), origin)
    q = sub(vec3_at(triangles, a + 3), origin)
    r = sub(vec3_at(triangles, a + 6), origin)
    d = line.direction
    limit = sign_error(max(max_abs(p), max_abs(q), max_abs(r), max_abs(d)), line.error)
    x = dot(cross(p, q), d)
    y = dot(cross(q, r), d)
    if opposed(x, y, limit):
        return APART
    z = dot(cross(r, p), d)
    if opposed(x, z, limit) or opposed(y, z, limit):
        return APART
    if not _bracket(triangles, a, corners, line, out):
        return AMBIGUOUS
    if out[_BRACKET + 2] < 0.0 or out[_BRACKET] > 1.0:
        return APART
    certain = same_side(Vec3(x, y, z), limit) and out[_BRACKET] > 0.0 and out[_BRACKET + 2] < 1.0
    return MEETING if certain else AMBIGUOUS


@kernel
def _bracket_by_corners(triangles, a, corners, line, out):
    """Bracket of t by the facet's corners, projected onto the ray: for facets known to be met."""
    square = dot(line.direction, line.direction)
    size = max_abs(line.direction)
    low = math.inf
    high = -math.inf
    far = 0.0
    for k in range(a, a + 9, 3):
        w = sub(vec3_at(triangles, k), vec3_at(corners, 9))
        low = min(low, dot(w, line.direction))
        high = max(high, dot(w, line.direction))
        far = max(far, max_abs(w))
    # Corners are off by E + u far, the direction by E: far more than enough for both, and the square.
    error = (8.0 * line.error + 64.0 * _U * (far + size)) * (size + far) * (1.0 + (far + size) / size)
    lower = (low - error) / square * (1.0 - math.copysign(2.0**-40, low - error))
    upper = (high + error) / square * (1.0 + math.copysign(2.0**-40, high + error))
    put_vec3(out, _BRACKET, Vec3(lower, 0.5 * lower + 0.5 * upper, upper))


@kernel
def _test_facet(query, a):
    """Add facet a to the hits where the ray meets it and may meet it first."""
    segment, line, out = query.segment, query.line, query.best
    triangles, corners = segment.tree.triangles, segment.corners
    segment.counters[TRIANGLES] += 1
    verdict = _meets(triangles, 9 * a, corners, line, out)
    if verdict == APART:
        return
    if verdict == AMBIGUOUS:
        if ask_segment_exactly(segment, a, MEET) == 0:
            return
        if not _bracket(triangles, 9 * a, corners, line, out):
            _bracket_by_corners(triangles, 9 * a, corners, line, out)
    t = vec3_at(out, _BRACKET)
    if t.x > out[_BEST]:
        return
    at = HIT * query.progress[N_HITS]
    query.hits[at + RAY_OF] = query.ray
    query.hits[at + FACET_OF] = segment.tree.ids[a]
    query.hits[at + LOWER] = max(t.x, 0.0)
    query.hits[at + VALUE] = min(max(t.y, 0.0), t.z)
    query.hits[at + UPPER] = max(t.z, 0.0)
    query.hits[at + OPEN] = 1.0 if verdict == AMBIGUOUS else 0.0
    query.progress[N_HITS] += 1
    if query.first_only:
        out[_BEST] = min(out[_BEST], t.z)


@kernel(inline=True)
def _nearest_box(query, _stack, top):
    """The stack's height without boxes on top that begin beyond the nearest hit."""
    while top > 0 and query.keys[top - 1] > query.height + query.best[_BEST] * query.pace + query.slack:
        top -= 1
    return top


@kernel(inline=True)
def _visit_leaf(query, pair):
    """Test the ray and a leaf's facets; True where there may be no room for all of them."""
    if query.progress[N_HITS] + _MAX_HITS > query.capacity:
        query.progress[N_HITS] = -1
        return True
    best = query.best[_BEST]
    run = ~pair.link_a
    for a in range(run >> 3, (run >> 3) + (run & 7)):
        _test_facet(query, a)
    if query.best[_BEST] < best:
        _set_ends(query.line, max(min(1.0, query.best[_BEST]), query.line.first), query.segment.probe)
    return False


@kernel(inline=True)
def _open_box(query, pair, stack, top):
    """Push the children that the ray may meet, the one that begins first on top."""
    keys, segment = query.keys, query.segment
    segment.counters[BOXES] += 1
    mask = boxes_meeting(segment.tree.boxes, NODE * pair.link_a, segment.frame_b, segment.probe)
    base = top
    for slot in range(WIDTH):
        if (mask >> slot) & 1:
            box = box_at(segment.tree.boxes, WIDTH * pair.link_a + slot)
            key = dot(query.along, box.centre) - dot(absolute(query.along), box.half)
            at = top
            while at > base and keys[at - 1] < key:
                keys[at] = keys[at - 1]
                stack[at] = stack[at - 1]
                at -= 1
            keys[at] = key
            stack[at] = WIDTH * pair.link_a + slot
            top += 1
    return top


_traverse = make_traversal(_nearest_box, box_of_tree, _visit_leaf, _open_box)


@kernel
def _cast(query, stack):
    """All candidates of one ray; False where there is no room for more hits."""
    begin = query.progress[N_HITS]
    stack[0] = 0
    query.keys[0] = -math.inf
    _traverse(query, stack, 1)
    end = query.progress[N_HITS]
    if end < 0:
        query.progress[N_HITS] = begin
        return False
    if query.first_only:  # drop what begins beyond the nearest hit after all
        hits = query.hits
        n_kept = begin
        for k in range(begin, end):
            if hits[HIT * k + LOWER] <= query.best[_BEST]:
                if n_kept < k:
                    for word in range(HIT):
                        hits[HIT * n_kept + word] = hits[HIT * k + word]
                n_kept += 1
        query.progress[N_HITS] = n_kept
    return True


@kernel
def _set_ray(ray, segment):
    """The ray's segment, from 0 to T d where its origin is the frame's; returns the exponent of its unit."""
    XB, numbers, ends = segment.XB, segment.numbers, segment.ends
    largest = 0.0
    for k in range(16):
        XB[k] = 1.0 if k % 5 == 0 else 0.0
    for i in range(3):
        XB[4 * i + 3] = ray[i]
        ends[i] = 0.0
        ends[3 + i] = ray[3 + i] * ray[_T]
        ends[6 + i] = ends[3 + i]
        numbers[CENTRE + i] = 0.0
        numbers[REACH + i] = abs(ends[3 + i])
        largest = max(largest, abs(ends[3 + i]))
    return 0 + math.frexp(largest)[1]  # 64 bits, as the exponents of trees


@entry(
    "int64(int64, int64, int64, int64, int64, boolean, int64, int64, int64, int64, int64, int64, int64, int64, int64)"
)
def cast_rays(
    header_at, XA_at, step_a, rays_at, n, first_only, hits_at, capacity, counters_at, progress_at, stack_at, n_stack,
    doubles_at, integers_at, exact_at,
):  # fmt: skip
    """Facets that n rays (RAY doubles each, in the world) meet, from where an earlier call stopped.

    Returns DONE, FULL or SINGULAR. Arguments are flat, as those of all entries.
    first_only : of each ray only those that may be met first, by their brackets of t.
    hits : out, HIT doubles each, those of a ray together; t in units of T.   counters : COUNTERS integers a ray.
    """
    tree = open_tree(header_at)
    hits = view_f64(hits_at, HIT * capacity)
    progress = view_i64(progress_at, 2)
    stack = view_i64(stack_at, n_stack)
    keys = view_f64(stack_at + 8 * (n_stack + 16), n_stack)
    XB_at = doubles_at + 8 * SEGMENT_DOUBLES
    best = view_f64(XB_at + 8 * 16, 4)
    for k in range(progress[AT_RAY], n):
        ray = view_f64(rays_at + 8 * RAY * k, RAY)
        segment = open_segment(
            tree, XA_at + 8 * step_a * k, XB_at, doubles_at, doubles_at + 8 * DOUBLES, integers_at, exact_at,
            counters_at + 8 * COUNTERS * k,
        )  # fmt: skip
        progress[AT_RAY] = k
        if not place_segment(segment, _set_ray(ray, segment)):
            return SINGULAR
        line = _line_of(segment)
        if not line.first <= line.last:
            continue
        _set_probe(line, segment.frame_b, segment.probe)
        along = divide(line.to_end, line.size)
        height = dot(along, line.start)
        pace = dot(along, line.to_end)
        # Heights of boxes are sums of doubles and floats, rounded; the ray is off by its error.
        slack = 4.0 * line.box_error + 2.0**-40 * (abs(height) + pace + 4.0)
        best[_BEST] = ray[_LIMIT]
        query = _Query(
            segment, line, along, height, pace, slack, keys, best, k, first_only, hits, capacity, progress
        )  # fmt: skip
        if not _cast(query, stack):
            for word in range(COUNTERS):
                segment.counters[word] = 0
            return FULL
    progress[AT_RAY] = n
    return DONE
