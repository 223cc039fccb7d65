"""Whether two triangles meet, without rounding, whatever they are: proper, segments, points, in one plane or not.

Closed triangles meet exactly if an edge of one meets the other: surfaces that cross do so at the border of one of
them, and of two in one plane one may hold the other, edges and all. A triangle without area is its edges. So
everything comes down to segments against triangles and, where both have no area, against segments.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, native_call, view_f64, view_i64
from collide.narrowphase.facets.exact_corners import (
    CORNERS,
    DIGITS,
    SEEN_AT,
    STATE,
    TABLE,
    UNKNOWN,
    forget_points,
    see_points,
    shares_a_corner,
    sign1,
    sign2,
    sign3,
)
from collide.narrowphase.facets.posed_surfaces import PLACING

#: Of `decide_exactly`; walks call it where it was compiled, once for all of them.
SIGNATURE = "int64(int64, int64, int64, int64, int64, int64)"
#: What is asked of it: whether triangles meet; how a segment (corners 3 and 4) passes the triangle of A; whether two
#: triangles with one edge (corners 0 and 1, also 3 and 4) share more than that edge.
MEET, PASS, OVERLAP = range(3)
#: How a segment passes: by, through the inside, along an edge or corner or in the plane, from a point of the
#: triangle, or through it the other way (THROUGH begins where the corners are seen counter-clockwise).
BY, THROUGH, UNCLEAR, FROM, BACK = range(5)
#: Integers of its workspace.
INTEGERS = STATE + DIGITS


@entry(SIGNATURE)
def decide_exactly(what, corners_at, placing_at, integers_at, XA_at, XB_at):
    """MEET: 1 where the two triangles of the corners meet, as posed by the matrices given, else 0. PASS: BY … BACK."""
    corners = view_f64(corners_at, CORNERS)
    placing = view_f64(placing_at, PLACING)
    state = view_i64(integers_at, STATE)
    digits = view_i64(integers_at + 8 * STATE, DIGITS)
    context = (corners, placing, digits, state, view_f64(XA_at, 16), view_f64(XB_at, 16))
    if what == PASS:
        return passing_exactly(context)
    if what == OVERLAP:
        return 1 if _overlapping_exactly(context) else 0
    return 1 if meeting_exactly(context) else 0


#: ``call_exactly(decide_exactly.address, arguments)`` inside kernels.
call_exactly = native_call(SIGNATURE)


@kernel
def meeting_exactly(context):
    """Whether the two triangles of the corners share a point, as posed by the matrices given."""
    state = context[3]
    forget_points(state)
    if shares_a_corner(context):
        return True
    for k in range(15):
        state[TABLE + k] = UNKNOWN
    if _all_on_one_side(context, 0) or _all_on_one_side(context, 3):
        return False
    for which in range(2):
        for k in range(3):
            if _edge_crosses(context, which, k):
                return True
    flat = True
    for k in range(6):
        flat = flat and state[TABLE + k] == 0
    axis_a = _proper_axis(context, 0)
    axis_b = _proper_axis(context, 3)
    if axis_a < 0 and axis_b < 0:
        for i in range(3):
            for j in range(3):
                if _segments_meet(context, i, (i + 1) % 3, 3 + j, 3 + (j + 1) % 3):
                    return True
        return False
    if flat and axis_a >= 0 and axis_b >= 0:
        return _flat_triangles_meet(context, axis_a)
    for k in range(3):
        after = (k + 1) % 3
        in_a = axis_a >= 0 and state[TABLE + k] == 0 and state[TABLE + after] == 0
        if in_a and _segment_in_plane_meets(context, axis_a, 0, 3 + k, 3 + after):
            return True
        in_b = axis_b >= 0 and state[TABLE + 3 + k] == 0 and state[TABLE + 3 + after] == 0
        if in_b and _segment_in_plane_meets(context, axis_b, 3, k, after):
            return True
    return False


@kernel
def passing_exactly(context):
    """How the segment from corner 3 to corner 4 passes the triangle of A: BY … BACK."""
    forget_points(context[3])
    start = sign3(context, 0, 1, 2, 3)
    end = sign3(context, 0, 1, 2, 4)
    if start * end > 0:
        return BY
    if start == 0 and end == 0:
        # In the plane, where another segment has to tell; of a triangle without area nothing passes the inside.
        return UNCLEAR if _proper_axis(context, 0) >= 0 else BY
    least = 1
    most = -1
    for k in range(3):
        side = sign3(context, k, (k + 1) % 3, 3, 4)
        least = min(least, side)
        most = max(most, side)
    if least < 0 and most > 0:
        return BY
    if start == 0:
        return FROM
    if end == 0 or (least <= 0 and most >= 0):
        return UNCLEAR
    return THROUGH if start > 0 else BACK


@kernel
def _overlapping_exactly(context):
    """Whether triangles on one edge lie in one plane, on one side of it; of a triangle without area the edge is all."""
    forget_points(context[3])
    if sign3(context, 0, 1, 2, 5) != 0:
        return False
    axis = _proper_axis(context, 0)
    if axis < 0:
        return False
    return sign2(context, axis, 0, 1, 2) * sign2(context, axis, 0, 1, 5) > 0


@kernel
def _all_on_one_side(context, base):
    """Sides of the other triangle's corners of the plane of the one whose first corner is ``base``."""
    state = context[3]
    at = TABLE + base
    for k in range(3):
        state[at + k] = sign3(context, base, base + 1, base + 2, 3 - base + k)
    return state[at] != 0 and state[at] == state[at + 1] and state[at] == state[at + 2]


@kernel
def _edges(context, i, j):
    """Orientation of edge i of A and edge j of B."""
    state = context[3]
    at = TABLE + 6 + 3 * i + j
    if state[at] == UNKNOWN:
        state[at] = sign3(context, i, (i + 1) % 3, 3 + j, 3 + (j + 1) % 3)
    return state[at]


@kernel
def _edge_crosses(context, which, k):
    """Whether edge k of B (which = 0) or of A (1), not in the other's plane, goes through the other."""
    state = context[3]
    s = state[TABLE + 3 * which + k]
    t = state[TABLE + 3 * which + (k + 1) % 3]
    if s * t > 0 or (s == 0 and t == 0):
        return False
    least = 1
    most = -1
    for other in range(3):
        e = _edges(context, other, k) if which == 0 else _edges(context, k, other)
        least = min(least, e)
        most = max(most, e)
        if least < 0 and most > 0:
            return False
    return True


@kernel
def _proper_axis(context, base):
    """An axis along which the triangle, seen from afar, has an area; −1 where it has none along any."""
    corners = context[0]
    see_points(context)
    best = 0
    largest = -1.0
    for axis in range(3):
        y = (axis + 1) % 3
        z = (axis + 2) % 3
        a = SEEN_AT + 3 * base
        left = (corners[a + 3 + y] - corners[a + y]) * (corners[a + 6 + z] - corners[a + z])
        right = (corners[a + 3 + z] - corners[a + z]) * (corners[a + 6 + y] - corners[a + y])
        if abs(left - right) > largest:
            largest = abs(left - right)
            best = axis
    for k in range(3):
        axis = (best + k) % 3
        if sign2(context, axis, base, base + 1, base + 2) != 0:
            return axis
    return -1


# --- in one plane -------------------------------------------------------------------------------


@kernel
def _flat_triangles_meet(context, axis):
    """Both proper and in one plane: apart exactly if the line along an edge of one parts them."""
    for base in range(0, 6, 3):
        turn = sign2(context, axis, base, base + 1, base + 2)
        for k in range(3):
            after = (k + 1) % 3
            beyond = True
            for m in range(3):
                beyond = beyond and sign2(context, axis, base + k, base + after, 3 - base + m) * turn < 0
            if beyond:
                return False
    return True


@kernel
def _segment_in_plane_meets(context, axis, base, p, q):
    """A segment in the plane of a proper triangle: an end in it, or an edge crossed."""
    turn = sign2(context, axis, base, base + 1, base + 2)
    p_in = True
    q_in = True
    for k in range(3):
        i = base + k
        j = base + (k + 1) % 3
        at_p = sign2(context, axis, i, j, p) * turn
        at_q = sign2(context, axis, i, j, q) * turn
        if at_p < 0 and at_q < 0:
            return False
        p_in = p_in and at_p >= 0
        q_in = q_in and at_q >= 0
    if p_in or q_in:
        return True
    for k in range(3):
        i = base + k
        j = base + (k + 1) % 3
        if _cross_in_plane(context, axis, p, q, i, j):
            return True
    return False


@kernel
def _cross_in_plane(context, axis, p, q, i, j):
    """Whether two segments of a plane, not all four ends on one line, share a point."""
    a = sign2(context, axis, i, j, p)
    b = sign2(context, axis, i, j, q)
    if a * b > 0:
        return False
    c = sign2(context, axis, p, q, i)
    d = sign2(context, axis, p, q, j)
    if c * d > 0:
        return False
    return not (a == 0 and b == 0 and c == 0 and d == 0)


# --- segments in space --------------------------------------------------------------------------


@kernel
def _segments_meet(context, p, q, i, j):
    """Two segments, either of which may be a point."""
    if sign3(context, p, q, i, j) != 0:
        return False
    # In one plane. Where they are not parallel, seen along an axis of their cross product they cross or not.
    for axis in range(3):
        if _slant(context, axis, p, q, i, j) != 0:
            return _cross_in_plane(context, axis, p, q, i, j)
    # Parallel, or one is a point: on one line?
    for axis in range(3):
        if sign2(context, axis, p, q, i) != 0 or sign2(context, axis, p, q, j) != 0:
            return False
        if sign2(context, axis, i, j, p) != 0 or sign2(context, axis, i, j, q) != 0:
            return False
    for axis in range(3):
        if _ranges_part(context, axis, p, q, i, j):
            return False
    return True


@kernel
def _slant(context, axis, p, q, i, j):
    """Nonzero where the segments are not parallel as seen along an axis."""
    # (q − p) × (j − i) = (q − p) × (j − p) − (q − p) × (i − p): one sign or the other, unless both sides agree.
    to_i = sign2(context, axis, p, q, i)
    to_j = sign2(context, axis, p, q, j)
    if to_i != to_j:
        return 1
    of_p = sign2(context, axis, i, j, p)
    of_q = sign2(context, axis, i, j, q)
    return 1 if of_p != of_q else 0


@kernel
def _ranges_part(context, axis, p, q, i, j):
    return (
        (sign1(context, axis, p, i) > 0 and sign1(context, axis, p, j) > 0
         and sign1(context, axis, q, i) > 0 and sign1(context, axis, q, j) > 0)
        or (sign1(context, axis, p, i) < 0 and sign1(context, axis, p, j) < 0
            and sign1(context, axis, q, i) < 0 and sign1(context, axis, q, j) < 0)
    )  # fmt: skip
