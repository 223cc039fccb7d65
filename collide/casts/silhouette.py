"""Seen along a direction: whether a line passes through a Minkowski difference D = A ⊖ B, proven in doubles.

A + λ d meets B where λ e is a point of D, e = −d. Seen along e, D is a convex set in the plane and the line a point,
the origin. A polygon of support points grows towards the side where the origin is nearest to its outside, as GJK does
in the plane (G. van den Bergen, "Ray casting against general convex objects with application to continuous collision
detection", 2004), until a support line has the origin beyond it, or the polygon holds it with some clearance. Where
rounding allows neither, the line grazes D: that is left open.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.gjk.minkowski_difference import (
    POINT,
    POINT_OF_A,
    POINT_OF_B,
    difference_point,
    has_trees,
    point_at,
    settle_point,
)
from collide.numerics.vec3 import Vec3, add, cross, dot, norm, put_vec3, scale, sub, unit_orthogonal, vec3_at

#: Support points of one cast: of the polygon, then four of a portal.
_MAX_POINTS = 44
SLOTS = _MAX_POINTS + 4
#: Doubles and integers of workspace: the points, and as seen; their vertices, the ring and one to write the next in.
CAST_DOUBLES = (POINT + 2) * SLOTS
CAST_INTEGERS = 4 * SLOTS

#: What is said of a line: it misses D; it passes through; doubles cannot tell.
MISSED, CROSSED, GRAZED = range(3)

#: A polygon that holds the origin so deep, in units of its extent, is not widened any more.
_DEEP = 2.0**-4
#: A clearance of this many errors is proven, and enough to stop with where the polygon cannot be widened.
_MIN_ERRORS = 16.0
#: The first direction is turned by an angle of this tangent, off the axes that boxes have in common.
_SKEW = 0.17


class Cast(NamedTuple):
    """A cast of a pair, in W's axes.

    pair : a `PosedPair`, A moves.   points : POINT doubles a support point of D, radii included.
    seen : two doubles each: how far along ``across`` and ``up``.   ids : two each.   ring : the polygon's points.
    e : against the direction of the cast.   length : |e|.   across, up : unit vectors, (across, up, e) right-handed.
    radius_a, radius_b : of balls swept over the cores.
    error : largest distance of a computed point of D from the true point.   size : no point of D is farther from 0.
    """

    pair: Any
    points: Any
    seen: Any
    ids: Any
    ring: Any
    e: Vec3
    length: float
    across: Vec3
    up: Vec3
    radius_a: float
    radius_b: float
    error: float
    size: float


class Outline(NamedTuple):
    """What `line_through` found.

    outcome : MISSED, CROSSED or GRAZED.   n : points of the ring.
    clearance : of the line from the ring's edges, proven, where it passes through.
    """

    outcome: int
    n: int
    clearance: float


@kernel
def open_cast(pair, direction, radius_a, radius_b, error, size, doubles_at, integers_at):
    """The `Cast` of a pair along a direction; workspace of CAST_DOUBLES and CAST_INTEGERS."""
    e = scale(-1.0, direction)
    length = norm(e)
    across = unit_orthogonal(e)
    up = cross(scale(1.0 / length, e), across)
    return Cast(
        pair, view_f64(doubles_at, POINT * SLOTS), view_f64(doubles_at + 8 * POINT * SLOTS, 2 * SLOTS),
        view_i64(integers_at, 2 * SLOTS), view_i64(integers_at + 16 * SLOTS, 2 * SLOTS), e, length, across, up,
        radius_a, radius_b, error, size,
    )


@kernel
def sample(cast, k, v):
    """Point k becomes the point of D farthest in direction v; returns its product with v."""
    points = cast.points
    difference_point(cast.pair, points, cast.ids, k, v)
    if has_trees(cast.pair):
        settle_point(cast.pair, points, cast.ids, k, v)
    if cast.radius_a + cast.radius_b > 0.0:
        unit = scale(1.0 / norm(v), v)
        at = POINT * k
        a = add(vec3_at(points, at + POINT_OF_A), scale(cast.radius_a, unit))
        b = sub(vec3_at(points, at + POINT_OF_B), scale(cast.radius_b, unit))
        put_vec3(points, at + POINT_OF_A, a)
        put_vec3(points, at + POINT_OF_B, b)
        put_vec3(points, at, add(point_at(points, k), scale(cast.radius_a + cast.radius_b, unit)))
    w = point_at(points, k)
    cast.seen[2 * k] = dot(w, cast.across)
    cast.seen[2 * k + 1] = dot(w, cast.up)
    return dot(w, v)


@kernel(inline=True)
def _sample_seen(cast, k, x, y):
    """Point k becomes the one farthest in the direction (x, y) of the plane; True where the line is proven to miss D.

    The direction is across e but for rounding, and a point λ e of D is no farther from 0 than D is large.
    """
    v = add(scale(x, cast.across), scale(y, cast.up))
    height = sample(cast, k, v)
    skew = abs(dot(v, cast.e)) / cast.length
    return height < -(norm(v) * (cast.error + 2.0**-49 * cast.size) + skew * cast.size)


@kernel(inline=True)
def _cross(seen, i, j):
    return seen[2 * i] * seen[2 * j + 1] - seen[2 * i + 1] * seen[2 * j]


@kernel(inline=True)
def _side(seen, i, j, k):
    """Twice the area of the triangle i j k: positive where k lies to the left of the way from i to j."""
    x = seen[2 * j] - seen[2 * i]
    y = seen[2 * j + 1] - seen[2 * i + 1]
    return x * (seen[2 * k + 1] - seen[2 * i + 1]) - y * (seen[2 * k] - seen[2 * i])


@kernel
def _insert(cast, n, k):
    """Take point k into the ring of n points, kept convex and counter-clockwise; returns the new n."""
    ring, seen = cast.ring, cast.seen
    if n == 0 or (n == 1 and (seen[2 * k] != seen[2 * ring[0]] or seen[2 * k + 1] != seen[2 * ring[0] + 1])):
        ring[n] = k
        return n + 1
    if n == 1:
        return 1
    if n == 2:
        return _insert_third(cast, k)
    first = -1  # of the edges that k lies to the right of, which follow one another
    count = 0
    for i in range(n):
        if _side(seen, ring[i], ring[(i + 1) % n], k) < 0.0:
            count += 1
            if not _side(seen, ring[(i + n - 1) % n], ring[i], k) < 0.0:
                first = i
    if first < 0:
        return n
    n_kept = n - count + 1
    for i in range(n_kept):
        ring[SLOTS + i] = ring[(first + count + i) % n]
    for i in range(n_kept):
        ring[i] = ring[SLOTS + i]
    ring[n_kept] = k
    return n_kept + 1


@kernel(inline=True)
def _insert_third(cast, k):
    ring, seen = cast.ring, cast.seen
    i, j = ring[0], ring[1]
    side = _side(seen, i, j, k)
    if side == 0.0:  # all on one line: keep its ends
        x = seen[2 * j] - seen[2 * i]
        y = seen[2 * j + 1] - seen[2 * i + 1]
        along = x * (seen[2 * k] - seen[2 * i]) + y * (seen[2 * k + 1] - seen[2 * i + 1])
        if along < 0.0:
            ring[0] = k
        elif along > x * x + y * y:
            ring[1] = k
        return 2
    ring[1] = j if side > 0.0 else k
    ring[2] = k if side > 0.0 else j
    return 3


class _Edge(NamedTuple):
    """The edge of the ring nearest to the origin, from inside or outside.

    inside : how far the origin is to the left of the edge.   x, y : out of the ring: away from the edge, or from the
        ring's nearest point to an origin outside.   reach : how far the ring reaches along (x, y).
    """

    inside: float
    x: float
    y: float
    reach: float


@kernel
def _nearest_edge(cast, n):
    """The `_Edge` of a ring of two points or more."""
    ring, seen = cast.ring, cast.seen
    least = math.inf
    nearest = math.inf
    out_x = 0.0
    out_y = 0.0
    reach = 0.0
    near_x = 0.0
    near_y = 0.0
    i = ring[n - 1]
    for k in range(n):
        j = ring[k]
        x = seen[2 * j] - seen[2 * i]
        y = seen[2 * j + 1] - seen[2 * i + 1]
        square = x * x + y * y
        if not square > 0.0:
            i = j
            continue
        length = math.sqrt(square)
        inside = _cross(seen, i, j) / length
        if inside < least:
            least = inside
            out_x = y / length
            out_y = -x / length
            reach = max(
                seen[2 * i] * out_x + seen[2 * i + 1] * out_y, seen[2 * j] * out_x + seen[2 * j + 1] * out_y
            )
        s = min(max(-(seen[2 * i] * x + seen[2 * i + 1] * y) / square, 0.0), 1.0)
        px = seen[2 * i] + s * x
        py = seen[2 * i + 1] + s * y
        distance = math.sqrt(px * px + py * py)
        if distance < nearest:
            nearest = distance
            near_x = px
            near_y = py
        i = j
    tolerance = 2.0 * cast.error
    if (n == 2 or least < -tolerance) and nearest > tolerance:
        # Outside: towards the origin, where a support line may have it beyond.
        return _Edge(-nearest, -near_x / nearest, -near_y / nearest, -nearest)
    return _Edge(least, out_x, out_y, reach)


@kernel(inline=True)
def _first_direction(cast):
    """A direction from D's middle to the line, seen along the line and turned a little; any where both coincide."""
    x = dot(cast.pair.t, cast.across)
    y = dot(cast.pair.t, cast.up)
    length = math.sqrt(x * x + y * y)
    if not length > 2.0**-40 * cast.size:
        return 0.8, 0.6
    return (x - _SKEW * y) / length, (y + _SKEW * x) / length


@kernel
def _where_to_look(cast, n, stuck):
    """The `_Edge` beyond which the next point is looked for."""
    if n > 1:
        edge = _nearest_edge(cast, n)
        if n == 2 and stuck > 0:  # a segment has two sides
            edge = _Edge(edge.inside, -edge.x, -edge.y, -edge.reach)
        return edge
    x = cast.seen[2 * cast.ring[0]]
    y = cast.seen[2 * cast.ring[0] + 1]
    length = math.sqrt(x * x + y * y)
    if length > 0.0:
        return _Edge(-length, -x / length, -y / length, -length)
    return _Edge(0.0, 1.0 if stuck == 0 else -1.0, 0.0, 0.0)


@kernel
def line_through(cast):
    """The `Outline` of D about the line {λ e}."""
    x, y = _first_direction(cast)
    n = 0
    extent = 0.0
    for k in range(4):
        if _sample_seen(cast, k, x, y):
            return Outline(MISSED, n, 0.0)
        extent = max(extent, abs(cast.seen[2 * k]) + abs(cast.seen[2 * k + 1]))
        n = _insert(cast, n, k)
        x, y = -y, x
    stuck = 0
    inside = 0.0
    for k in range(4, _MAX_POINTS):
        edge = _where_to_look(cast, n, stuck)
        inside = edge.inside
        if n > 2 and inside > _DEEP * extent and inside > _MIN_ERRORS * cast.error:
            break
        if _sample_seen(cast, k, edge.x, edge.y):
            return Outline(MISSED, n, 0.0)
        extent = max(extent, abs(cast.seen[2 * k]) + abs(cast.seen[2 * k + 1]))
        gain = cast.seen[2 * k] * edge.x + cast.seen[2 * k + 1] * edge.y - edge.reach
        n = _insert(cast, n, k)
        stuck = 0 if gain > 4.0 * cast.error else stuck + 1
        if stuck > (1 if n < 3 else 0):
            break
    proven = n > 2 and inside > _MIN_ERRORS * cast.error
    return Outline(CROSSED if proven else GRAZED, n, inside - 4.0 * cast.error)
