"""Whether two triangles meet, without rounding, of all kinds: proper, segments, points, in a common plane or not.

Closed triangles meet exactly if an edge of either meets the other: crossing surfaces cross at the border of at least
one triangle, and in a common plane either triangle may hold the other, edges and all. A triangle without area is its
edges. So all cases are segments against triangles and, where both have no area, segments against segments.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import entry, kernel, native_call, view_f64, view_i64
from collide.narrowphase.facets.exact_corners import (
    CORNERS,
    DIGITS,
    EXACT_AT,
    STATE,
    TABLE,
    UNKNOWN,
    ExactPair,
    choose_exact_frame,
    invalidate_points,
    shares_a_corner,
    sign1,
    sign2,
    sign3,
)
from collide.narrowphase.facets.posed_surfaces import PLACING

#: Of `decide_exactly`, which is compiled once: traversals call it by its address.
SIGNATURE = "int64(int64, int64, int64, int64, int64, int64)"
#: Its questions: whether triangles meet; how a segment (corners 3 and 4) passes the triangle of A; whether two
#: triangles with one edge (corners 0 and 1, also 3 and 4) share more than that edge.
MEET, PASS, OVERLAP = range(3)
#: How a segment passes: by; through the inside, from the side on which the corners are seen counter-clockwise; along an
#: edge or corner or in the plane; from a point of the triangle; through the inside the other way.
BY, THROUGH, UNCLEAR, FROM, BACK = range(5)
#: Integers of its workspace.
INTEGERS = STATE + DIGITS


class ExactCall(NamedTuple):
    """Addresses: of `decide_exactly`, and of what it takes."""

    address: int
    corners_at: int
    placing_at: int
    integers_at: int
    XA_at: int
    XB_at: int


@entry(SIGNATURE)
def decide_exactly(what, corners_at, placing_at, integers_at, XA_at, XB_at):
    """MEET, OVERLAP: 1 where the two triangles of the corners do, at these poses, else 0. PASS: BY … BACK."""
    pair = ExactPair(
        view_f64(corners_at, CORNERS), view_f64(placing_at, PLACING), view_i64(integers_at + 8 * STATE, DIGITS),
        view_i64(integers_at, STATE), view_f64(XA_at, 16), view_f64(XB_at, 16),
    )
    invalidate_points(pair.state)
    if what == PASS:
        return _passing_exactly(pair)
    if what == OVERLAP:
        return 1 if _overlapping_exactly(pair) else 0
    return 1 if _meeting_exactly(pair) else 0


_call_exactly = native_call(SIGNATURE)


@kernel
def ask_exactly(exact, what):
    """What `decide_exactly` answers.   exact : an `ExactCall`."""
    arguments = (what, exact.corners_at, exact.placing_at, exact.integers_at, exact.XA_at, exact.XB_at)
    return _call_exactly(exact.address, arguments)


@kernel
def _meeting_exactly(pair):
    """Whether the two triangles of the corners share a point."""
    state = pair.state
    if shares_a_corner(pair):
        return True
    for k in range(15):
        state[TABLE + k] = UNKNOWN
    if _all_on_one_side(pair, 0) or _all_on_one_side(pair, 3):
        return False
    for which in range(2):
        for k in range(3):
            if _edge_crosses(pair, which, k):
                return True
    coplanar = True
    for k in range(6):
        coplanar = coplanar and state[TABLE + k] == 0
    axis_a = _proper_axis(pair, 0)
    axis_b = _proper_axis(pair, 3)
    if axis_a < 0 and axis_b < 0:
        for i in range(3):
            for j in range(3):
                if _segments_meet(pair, i, (i + 1) % 3, 3 + j, 3 + (j + 1) % 3):
                    return True
        return False
    if coplanar and axis_a >= 0 and axis_b >= 0:
        return _coplanar_triangles_meet(pair, axis_a)
    for k in range(3):
        after = (k + 1) % 3
        in_a = axis_a >= 0 and state[TABLE + k] == 0 and state[TABLE + after] == 0
        if in_a and _segment_in_plane_meets(pair, axis_a, 0, 3 + k, 3 + after):
            return True
        in_b = axis_b >= 0 and state[TABLE + 3 + k] == 0 and state[TABLE + 3 + after] == 0
        if in_b and _segment_in_plane_meets(pair, axis_b, 3, k, after):
            return True
    return False


@kernel
def _passing_exactly(pair):
    """How the segment from corner 3 to corner 4 passes the triangle of A: BY … BACK."""
    start = sign3(pair, 0, 1, 2, 3)
    end = sign3(pair, 0, 1, 2, 4)
    if start * end > 0:
        return BY
    if start == 0 and end == 0:
        # In the plane, where another segment decides; nothing passes the inside of a triangle without area.
        return UNCLEAR if _proper_axis(pair, 0) >= 0 else BY
    lowest = 1
    highest = -1
    for k in range(3):
        side = sign3(pair, k, (k + 1) % 3, 3, 4)
        lowest = min(lowest, side)
        highest = max(highest, side)
    if lowest < 0 and highest > 0:
        return BY
    if start == 0:
        return FROM
    if end == 0 or (lowest <= 0 and highest >= 0):
        return UNCLEAR
    return THROUGH if start > 0 else BACK


@kernel
def _overlapping_exactly(pair):
    """Whether triangles on a common edge lie in one plane, on the same side of the edge; False of a triangle without
    area, no more than the edge itself."""
    if sign3(pair, 0, 1, 2, 5) != 0:
        return False
    axis = _proper_axis(pair, 0)
    if axis < 0:
        return False
    return sign2(pair, axis, 0, 1, 2) * sign2(pair, axis, 0, 1, 5) > 0


@kernel
def _all_on_one_side(pair, base):
    """Whether a triangle's corners lie on one side of the plane of the other, whose first corner is ``base``.

    The sides go into the table.
    """
    state = pair.state
    at = TABLE + base
    for k in range(3):
        state[at + k] = sign3(pair, base, base + 1, base + 2, 3 - base + k)
    return state[at] != 0 and state[at] == state[at + 1] and state[at] == state[at + 2]


@kernel
def _edges(pair, i, j):
    """Orientation of edge i of A and edge j of B."""
    state = pair.state
    at = TABLE + 6 + 3 * i + j
    if state[at] == UNKNOWN:
        state[at] = sign3(pair, i, (i + 1) % 3, 3 + j, 3 + (j + 1) % 3)
    return state[at]


@kernel
def _edge_crosses(pair, which, k):
    """Whether edge k of B (which = 0) or of A (1), not in the other's plane, goes through the other."""
    state = pair.state
    s = state[TABLE + 3 * which + k]
    t = state[TABLE + 3 * which + (k + 1) % 3]
    if s * t > 0 or (s == 0 and t == 0):
        return False
    lowest = 1
    highest = -1
    for m in range(3):
        side = _edges(pair, m, k) if which == 0 else _edges(pair, k, m)
        lowest = min(lowest, side)
        highest = max(highest, side)
        if lowest < 0 and highest > 0:
            return False
    return True


@kernel
def _proper_axis(pair, base):
    """An axis along which the triangle's projection has an area; −1 of a triangle without area."""
    corners = pair.corners
    choose_exact_frame(pair)
    best = 0
    largest = -1.0
    for axis in range(3):
        y = (axis + 1) % 3
        z = (axis + 2) % 3
        a = EXACT_AT + 3 * base
        area = (corners[a + 3 + y] - corners[a + y]) * (corners[a + 6 + z] - corners[a + z])
        area -= (corners[a + 3 + z] - corners[a + z]) * (corners[a + 6 + y] - corners[a + y])
        if abs(area) > largest:
            largest = abs(area)
            best = axis
    for k in range(3):
        axis = (best + k) % 3
        if sign2(pair, axis, base, base + 1, base + 2) != 0:
            return axis
    return -1


# --- in one plane -------------------------------------------------------------------------------


@kernel
def _coplanar_triangles_meet(pair, axis):
    """Whether triangles with area in a common plane meet: apart exactly if the line along an edge separates them."""
    for base in range(0, 6, 3):
        orientation = sign2(pair, axis, base, base + 1, base + 2)
        for k in range(3):
            after = (k + 1) % 3
            beyond = True
            for m in range(3):
                beyond = beyond and sign2(pair, axis, base + k, base + after, 3 - base + m) * orientation < 0
            if beyond:
                return False
    return True


@kernel
def _segment_in_plane_meets(pair, axis, base, p, q):
    """A segment in the plane of a proper triangle: an end in it, or an edge crossed."""
    orientation = sign2(pair, axis, base, base + 1, base + 2)
    p_in = True
    q_in = True
    for k in range(3):
        i = base + k
        j = base + (k + 1) % 3
        at_p = sign2(pair, axis, i, j, p) * orientation
        at_q = sign2(pair, axis, i, j, q) * orientation
        if at_p < 0 and at_q < 0:
            return False
        p_in = p_in and at_p >= 0
        q_in = q_in and at_q >= 0
    if p_in or q_in:
        return True
    for k in range(3):
        i = base + k
        j = base + (k + 1) % 3
        if _segments_cross(pair, axis, p, q, i, j):
            return True
    return False


@kernel
def _segments_cross(pair, axis, p, q, i, j):
    """Whether two segments of a plane, not all four ends on one line, share a point."""
    a = sign2(pair, axis, i, j, p)
    b = sign2(pair, axis, i, j, q)
    if a * b > 0:
        return False
    c = sign2(pair, axis, p, q, i)
    d = sign2(pair, axis, p, q, j)
    if c * d > 0:
        return False
    return not (a == 0 and b == 0 and c == 0 and d == 0)


# --- segments in space --------------------------------------------------------------------------


@kernel
def _segments_meet(pair, p, q, i, j):
    """Two segments, either of which may be a point."""
    if sign3(pair, p, q, i, j) != 0:
        return False
    # In one plane. Where they are not parallel, seen along an axis of their cross product they cross or not.
    for axis in range(3):
        if _not_parallel(pair, axis, p, q, i, j):
            return _segments_cross(pair, axis, p, q, i, j)
    # Parallel, or one is a point: on one line?
    for axis in range(3):
        if sign2(pair, axis, p, q, i) != 0 or sign2(pair, axis, p, q, j) != 0:
            return False
        if sign2(pair, axis, i, j, p) != 0 or sign2(pair, axis, i, j, q) != 0:
            return False
    for axis in range(3):
        if _ranges_apart(pair, axis, p, q, i, j):
            return False
    return True


@kernel
def _not_parallel(pair, axis, p, q, i, j):
    """Whether the segments' projections along an axis are not parallel."""
    # (q − p) × (j − i) = (q − p) × (j − p) − (q − p) × (i − p): one sign or the other, unless both sides agree.
    to_i = sign2(pair, axis, p, q, i)
    to_j = sign2(pair, axis, p, q, j)
    return to_i != to_j or sign2(pair, axis, i, j, p) != sign2(pair, axis, i, j, q)


@kernel
def _ranges_apart(pair, axis, p, q, i, j):
    """Whether both ends i, j are beyond both ends p, q along an axis, on one side."""
    side = sign1(pair, axis, p, i)
    return side != 0 and (
        sign1(pair, axis, p, j) == side and sign1(pair, axis, q, i) == side and sign1(pair, axis, q, j) == side
    )
