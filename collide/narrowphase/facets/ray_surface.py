"""Rays against one posed surface: every facet a ray meets, or the facets that may be the first.

A ray is {o + t d, t ≥ 0} with o and d exact reals. Its segment to T d, T a power of two beyond the surface, is posed
without rounding: by the shift o, with ends 0 and T d. So whether the segment meets a closed facet is decided as for
any two triangles, in doubles with error bounds and then in integers: no ray slips between facets that share an edge.

Boxes are parted from the segment along their own axes and the cross products of these with the ray: nothing else can
part a segment from a box (S. Gottschalk, M. Lin and D. Manocha, "OBBTree", 1996). The nearest box is opened first, and
boxes beginning beyond the nearest hit are left.

Where a ray crosses a facet's plane is a quotient n·(a − o) / n·d with proven errors of both: a bracket. Callers
settle in exact arithmetic which of several overlapping brackets comes first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.mesh.box_overlap import boxes_meeting
from collide.mesh.bvh import CENTRE, NODE, REACH, WIDTH, box_at, open_tree
from collide.narrowphase.facets.exact_triangles import MEET
from collide.narrowphase.facets.filtered_triangles import AMBIGUOUS, APART
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
from collide.narrowphase.facets.ray_line import (
    BRACKET,
    RayLine,
    bracket,
    bracket_by_corners,
    line_of,
    meets_facet,
    set_ends,
    set_line_probe,
)
from collide.narrowphase.facets.traversal import box_of_tree, make_traversal
from collide.numerics.vec3 import Vec3, absolute, divide, dot, vec3_at

#: Doubles of a ray: origin (3), direction (3), T, and the largest t that counts.
RAY = 8
_T, _LIMIT = 6, 7
#: Doubles of a hit: number of the ray, of the facet, t from below, t, t from above, and 1 where t is to be worked out
#: exactly: the ray lies in the facet's plane, or doubles could not tell whether they meet; the facet's place in the
#: tree.
HIT = 7
RAY_OF, FACET_OF, LOWER, VALUE, UPPER, OPEN, PLACE = range(HIT)

# Progress, integers: the ray, the hits found.
AT_RAY, N_HITS = range(2)
DONE, FULL, SINGULAR = range(3)
#: Hits that a leaf may add.
_MAX_HITS = 8
# Doubles that change on the way: the least upper bound of t so far, and a bracket of t (3).
_BEST = 0
#: Doubles and floats of workspace: those of a segment, the ray's pose, and what changes.
DOUBLES = SEGMENT_DOUBLES + 16 + 4
FLOATS = SEGMENT_FLOATS


class _Query(NamedTuple):
    """A ray.

    along : to_end over its largest component.
    height, pace, slack : heights along ``along``, of the start, of a step of t = 1, and the bound of their error.
    keys : the heights at which the boxes on the stack begin.   best : _BEST, then a bracket.
    hits : out, room for ``capacity``.   progress : as above.
    """

    segment: PosedSegment
    line: RayLine
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
def _test_facet(query, a):
    """Add facet a to the hits where the ray meets the facet and no nearer hit is proven."""
    segment, line, out = query.segment, query.line, query.best
    triangles, corners = segment.tree.triangles, segment.corners
    segment.counters[TRIANGLES] += 1
    verdict = meets_facet(triangles, 9 * a, corners, line, out)
    if verdict == APART:
        return
    if verdict == AMBIGUOUS:
        if ask_segment_exactly(segment, a, MEET) == 0:
            return
        if not bracket(triangles, 9 * a, corners, line, out):
            bracket_by_corners(triangles, 9 * a, corners, line, out)
    t = vec3_at(out, BRACKET)
    if t.x > out[_BEST]:
        return
    at = HIT * query.progress[N_HITS]
    query.hits[at + RAY_OF] = query.ray
    query.hits[at + FACET_OF] = segment.tree.ids[a]
    query.hits[at + LOWER] = max(t.x, 0.0)
    query.hits[at + VALUE] = min(max(t.y, 0.0), t.z)
    query.hits[at + UPPER] = max(t.z, 0.0)
    query.hits[at + OPEN] = 1.0 if verdict == AMBIGUOUS else 0.0
    query.hits[at + PLACE] = a
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
        set_ends(query.line, max(min(1.0, query.best[_BEST]), query.line.first), query.segment.probe)
    return False


@kernel(inline=True)
def _open_box(query, pair, stack, top):
    """Push the children that the ray may meet, the child beginning first on top."""
    keys, segment = query.keys, query.segment
    segment.counters[NODES] += 1
    probe = probe_of_node(segment.tree, pair.link_a, segment.frame_b, segment.probe, segment.moved)
    mask = boxes_meeting(segment.tree.boxes, NODE * pair.link_a, segment.frame_b, probe)
    base = top
    for slot in range(WIDTH):
        if (mask >> slot) & 1:
            box = box_at(segment.tree, WIDTH * pair.link_a + slot)
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
    """List all candidates of a ray; False where the room for hits is used up."""
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
):
    """Facets met by n rays (RAY doubles each, in the world), from where an earlier call stopped.

    Returns DONE, FULL or SINGULAR. Arguments are flat, as of all entries.
    first_only : of each ray only facets that may be met first, by their brackets of t.
    hits : out, HIT doubles each, a ray's hits together; t in units of T.   counters : COUNTERS integers a ray.
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
        )
        progress[AT_RAY] = k
        if not place_segment(segment, _set_ray(ray, segment)):
            return SINGULAR
        line = line_of(segment)
        if not line.first <= line.last:
            continue
        set_line_probe(line, segment.frame_b, segment.probe)
        along = divide(line.to_end, line.size)
        height = dot(along, line.start)
        pace = dot(along, line.to_end)
        # Heights of boxes are sums of doubles and floats, rounded; the ray is off by its error.
        slack = 4.0 * line.box_error + 2.0**-40 * (abs(height) + pace + 4.0)
        best[_BEST] = ray[_LIMIT]
        query = _Query(
            segment, line, along, height, pace, slack, keys, best, k, first_only, hits, capacity, progress
        )
        if not _cast(query, stack):
            for word in range(COUNTERS):
                segment.counters[word] = 0
            return FULL
    progress[AT_RAY] = n
    return DONE
