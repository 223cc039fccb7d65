"""Where a line enters a Minkowski difference D: a portal of three support points, refined.

The line passes through a triangle of points of D, the portal. The support point of D along the portal's normal, on the
side the line comes from, makes a tetrahedron with the portal; the line enters the tetrahedron through one of three new
portals, and so on until no support point is nearer (G. Snethen, "XenoCollide: complex collision made simple", Game
Programming Gems 7, 2008, with a line that may begin outside). Support planes bound the entry from below, portals
from above: a linear program and its dual.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.casts.rounded_entry import guess_entry
from collide.casts.silhouette import CROSSED, MISSED, SLOTS, line_through, sample
from collide.kernels import kernel
from collide.narrowphase.gjk.minkowski_difference import (
    POINT,
    POINT_OF_B,
    Places,
    copy_point,
    is_repeated,
    point_at,
)
from collide.numerics.vec3 import Vec3, add, cross, dot, neg, norm, scale, sub, vec3_at

#: How a cast ends. MISS: nothing is met, proven. HIT: something is, λ > 0, proven. BEHIND: the line enters D at λ ≤ 0,
#: or that cannot be told: whether the bodies meet at the start decides. OPEN: rounding leaves open whether they meet
#: at all, or within the limit. LEVEL: the motion may be along the plane of a half-space; the bracket is of the gap.
MISS, HIT, BEHIND, OPEN, LEVEL = range(5)

#: A portal is near enough to a support plane at this part of the error.
_FLAT_ENOUGH = 0.25
_MAX_ROUNDS = 120


class Entry(NamedTuple):
    """Where the line {λ e} enters D.

    status : MISS, HIT, BEHIND or OPEN.   lower, value, upper : λ, lower ≤ truth ≤ upper of a line that enters.
    normal : unit normal of D at the entry, against the line.   point : of B, touched by A, in W's axes from B's origin.
    """

    status: int
    lower: float
    value: float
    upper: float
    normal: Vec3
    point: Vec3


class _Front(NamedTuple):
    """What refining came to.

    lower, normal : λ and unit normal of the best support plane.   w : a point of D at the line.   touching : its of B.
    """

    lower: float
    normal: Vec3
    w: Vec3
    touching: Vec3


@kernel(inline=True)
def _nothing(status):
    return Entry(status, 0.0, 0.0, 0.0, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))


@kernel(inline=True)
def _cross_seen(seen, i, j):
    return seen[2 * i] * seen[2 * j + 1] - seen[2 * i + 1] * seen[2 * j]


@kernel(inline=True)
def _move_point(cast, source, target):
    copy_point(cast.points, cast.ids, source, target)
    cast.seen[2 * target] = cast.seen[2 * source]
    cast.seen[2 * target + 1] = cast.seen[2 * source + 1]


@kernel(inline=True)
def _first_portal(cast, n):
    """Put the triangle of the ring's fan that the line passes through into the last slots but the spare."""
    ring, seen = cast.ring, cast.seen
    first = ring[0]
    at = 1
    for k in range(2, n - 1):
        x = seen[2 * ring[k]] - seen[2 * first]
        y = seen[2 * ring[k] + 1] - seen[2 * first + 1]
        if y * seen[2 * first] - x * seen[2 * first + 1] >= 0.0:
            at = k
    second = ring[at]
    third = ring[at + 1]
    _move_point(cast, first, SLOTS - 4)
    _move_point(cast, second, SLOTS - 3)
    _move_point(cast, third, SLOTS - 2)


@kernel(inline=True)
def _farthest_of_ring(cast, n):
    """The largest λ of the ring's points: the line leaves D no earlier than it passes the ring."""
    far = dot(point_at(cast.points, cast.ring[0]), cast.e)
    for k in range(1, n):
        far = max(far, dot(point_at(cast.points, cast.ring[k]), cast.e))
    return far / (cast.length * cast.length)


@kernel(inline=True)
def _dropped(seen, a, b, c, spare, error):
    """Which of the portal's points (0, 1, 2) gives way to the spare point, the line passing through the new portal.

    Where the line passes through an edge two choices will do: taken is the larger portal, seen along the line. A spare
    point straight before a point of the portal takes its place.
    """
    to_a, to_b, to_c = _cross_seen(seen, spare, a), _cross_seen(seen, spare, b), _cross_seen(seen, spare, c)
    ab, bc, ca = _cross_seen(seen, a, b), _cross_seen(seen, b, c), _cross_seen(seen, c, a)
    without_a, without_b, without_c = min(to_b, -to_c), min(to_c, -to_a), min(to_a, -to_b)
    # Twice their areas; of those that the line passes by more than rounding, less than nothing.
    area_a, area_b, area_c = bc + to_b - to_c, ca + to_c - to_a, ab + to_a - to_b
    extent = max(abs(seen[2 * spare]), abs(seen[2 * spare + 1])) + math.sqrt(abs(ab) + abs(bc) + abs(ca))
    tolerance = -2.0 * error * extent
    if without_a < tolerance and without_b < tolerance and without_c < tolerance:
        area_a, area_b, area_c = without_a, without_b, without_c
    else:
        area_a = area_a if without_a >= tolerance else -math.inf
        area_b = area_b if without_b >= tolerance else -math.inf
        area_c = area_c if without_c >= tolerance else -math.inf
    if area_a >= area_b and area_a >= area_c:
        return 0
    return 1 if area_b >= area_c else 2


@kernel(inline=True)
def _bound(cast, v, length, height):
    """λ from below by the support plane across v, |v| = ``length``, at a height; −∞ where it bounds nothing."""
    slope = -dot(v, cast.e)
    if not slope > 2.0**-50 * length * cast.length:
        return -math.inf
    bound = (-height - length * cast.error) / slope
    return bound - abs(bound) * 2.0**-50 * (1.0 + length * cast.length / slope)


@kernel
def _refine(cast):
    """The `_Front` where the line enters."""
    points, seen, ids = cast.points, cast.seen, cast.ids
    a, b, c, spare = SLOTS - 4, SLOTS - 3, SLOTS - 2, SLOTS - 1
    lower = -cast.size / cast.length
    best = scale(-1.0 / cast.length, cast.e)
    has_radius = cast.radius_a + cast.radius_b > 0.0
    for _ in range(_MAX_ROUNDS):
        if has_radius:
            guess = guess_entry(cast, a, b, c)
            if guess.exists:
                height = sample(cast, spare, guess.normal)
                bound = _bound(cast, guess.normal, 1.0, height)
                if bound > lower:
                    lower = bound
                    best = guess.normal
                if height - dot(guess.w, guess.normal) <= _FLAT_ENOUGH * cast.error:
                    return _Front(lower, best, guess.w, guess.touching)
        pa, pb, pc = point_at(points, a), point_at(points, b), point_at(points, c)
        v = cross(sub(pc, pa), sub(pb, pa))
        length = norm(v)
        if not length > 0.0:
            break
        height = sample(cast, spare, v)
        bound = _bound(cast, v, length, height)
        if bound > lower:
            lower = bound
            best = scale(1.0 / length, v)
        known = max(dot(pa, v), dot(pb, v), dot(pc, v))
        if not height - known > _FLAT_ENOUGH * length * cast.error:
            break
        if not has_radius and is_repeated(ids, Places(3, a, b, c, spare)):
            break
        dropped = _dropped(seen, a, b, c, spare, cast.error)
        if dropped == 0:
            a, spare = spare, a
        elif dropped == 1:
            b, spare = spare, b
        else:
            c, spare = spare, c
    return _on_portal(cast, a, b, c, lower, best)


@kernel
def _on_portal(cast, a, b, c, lower, normal):
    """The `_Front` at a portal: its point on the line."""
    points, seen = cast.points, cast.seen
    of_a = max(_cross_seen(seen, b, c), 0.0)
    of_b = max(_cross_seen(seen, c, a), 0.0)
    of_c = max(_cross_seen(seen, a, b), 0.0)
    total = of_a + of_b + of_c
    if not total > 0.0:
        of_a, of_b, of_c, total = 1.0, 1.0, 1.0, 3.0
    of_a, of_b, of_c = of_a / total, of_b / total, of_c / total
    for _ in range(2):  # thin portals: what rounding left is taken off again
        x = of_a * seen[2 * a] + of_b * seen[2 * b] + of_c * seen[2 * c]
        y = of_a * seen[2 * a + 1] + of_b * seen[2 * b + 1] + of_c * seen[2 * c + 1]
        of_a = max(of_a + _across(seen, b, c, x, y) / total, 0.0)
        of_b = max(of_b + _across(seen, c, a, x, y) / total, 0.0)
        of_c = max(of_c + _across(seen, a, b, x, y) / total, 0.0)
        rest = of_a + of_b + of_c
        of_a, of_b, of_c = of_a / rest, of_b / rest, of_c / rest
    w = _mixed(points, a, b, c, 0, of_a, of_b, of_c)
    return _Front(lower, normal, w, _mixed(points, a, b, c, POINT_OF_B, of_a, of_b, of_c))


@kernel(inline=True)
def _across(seen, i, j, x, y):
    """The way from point j to point i, across (x, y)."""
    return (seen[2 * i] - seen[2 * j]) * y - (seen[2 * i + 1] - seen[2 * j + 1]) * x


@kernel
def cast_line(cast, limit, whole):
    """The `Entry` of the line into D.   limit : largest λ counted.   whole : count λ below 0, too."""
    ahead = sample(cast, 0, cast.e)
    if not whole and ahead < -cast.length * (cast.error + 2.0**-50 * cast.size):
        return _nothing(MISS)
    outline = line_through(cast)
    if outline.outcome == MISSED:
        return _nothing(MISS)
    if outline.outcome != CROSSED:
        return _grazing(cast, outline.n, ahead, -math.inf if whole else 0.0)
    far = _farthest_of_ring(cast, outline.n)
    _first_portal(cast, outline.n)
    front = _refine(cast)
    w = front.w
    off = norm(Vec3(dot(w, cast.across), dot(w, cast.up), 0.0)) + 2.0 * cast.error
    value = dot(w, cast.e) / (cast.length * cast.length)
    # A point of D beside the line and the ring around it, behind: the line is in D where both are mixed so that they
    # meet it.
    upper = value + 2.0 * cast.error / cast.length
    upper += off / (off + outline.clearance) * max(far - value, 0.0) * (1.0 + 2.0**-40)
    lower = min(front.lower, upper)
    status = HIT
    if lower <= 0.0:
        status = BEHIND
    elif lower > limit:
        status = MISS
    elif upper > limit:
        status = OPEN
    return Entry(status, lower, min(max(value, lower), upper), upper, front.normal, front.touching)


@kernel(cold=True)
def _grazing(cast, n, ahead, least):
    """The `Entry` of a line whose crossing of D doubles can neither prove nor refute: λ anywhere along D.   ahead : how
    far D reaches along e.   least : smallest λ counted.
    """
    ring, seen, points = cast.ring, cast.seen, cast.points
    nearest = 0
    for k in range(1, n):
        x, y = seen[2 * ring[k]], seen[2 * ring[k] + 1]
        near_x, near_y = seen[2 * ring[nearest]], seen[2 * ring[nearest] + 1]
        if x * x + y * y < near_x * near_x + near_y * near_y:
            nearest = k
    w = point_at(points, ring[nearest])
    touching = vec3_at(points, POINT * ring[nearest] + POINT_OF_B)
    normal = scale(1.0 / cast.length, neg(cast.e))
    square = cast.length * cast.length
    behind = -sample(cast, SLOTS - 1, neg(cast.e))
    error = cast.error / cast.length * (1.0 + 2.0**-40)
    lower = max(behind / square - error, least)
    upper = ahead / square + error
    return Entry(OPEN, lower, min(max(dot(w, cast.e) / square, lower), upper), upper, normal, touching)


@kernel(inline=True)
def _mixed(points, a, b, c, first, weight_a, weight_b, weight_c):
    """A weighted sum of three points' coordinates from ``first`` on."""
    total = scale(weight_a, vec3_at(points, POINT * a + first))
    total = add(total, scale(weight_b, vec3_at(points, POINT * b + first)))
    return add(total, scale(weight_c, vec3_at(points, POINT * c + first)))
