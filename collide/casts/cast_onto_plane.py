"""A convex body cast onto a half-space: its point deepest behind the plane, and how fast that comes nearer."""

from __future__ import annotations

from collide.casts.portal import BEHIND, HIT, LEVEL, MISS, OPEN, Entry
from collide.kernels import kernel
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.halfspace_convex import plane_in_world, reach_of_plane
from collide.narrowphase.posed_pair import radius_of
from collide.numerics.vec3 import add, column_at, divide, dot, neg, norm, rotate, rotate_back, scale, sub
from collide.support.support_mapping import settled_vertex, support


@kernel
def cast_onto_plane(pair, direction, size, slop, limit):
    """The `Entry` of a half-space B against the body A, moved along a direction by up to ``limit`` times it."""
    A, B = pair.A, pair.B
    distance, skew = reach_of_plane(pair, B)
    error = ERROR * (size + distance) * skew + slop
    plane = plane_in_world(pair, B)
    nhat = divide(plane.normal, plane.length)
    g = neg(rotate_back(pair.poses, A.pose_at, nhat))
    k, corner, _ = support(A.kind, A.coords, A.padded, pair.numbers, A.params_at, A.tree, 0, -1, g)
    if A.tree != 0:
        k = settled_vertex(A.coords, A.padded, A.tree, k, g)
        corner = column_at(A.coords, A.padded, k)
    radius = radius_of(pair, A)
    a = sub(rotate(pair.poses, A.pose_at, corner), pair.t)
    gap = dot(a, nhat) - plane.offset / plane.length - radius
    pace = -dot(nhat, direction)
    length = norm(direction)
    pace_error = 2.0**-49 * skew * length
    touching = sub(a, scale(radius, nhat))
    if gap - error <= 0.0:
        # Where they do not meet at the start after all, a body that moves away never meets it.
        upper = -1.0 if pace < -pace_error else max(gap + error, 0.0) / max(pace - pace_error, 2.0**-60 * length)
        return Entry(BEHIND, min(gap - error, 0.0) / length, 0.0, upper, neg(nhat), touching)
    if not abs(pace) > pace_error:
        return Entry(LEVEL, gap - error, gap, gap + error, neg(nhat), touching)
    if pace < 0.0:
        return Entry(MISS, 0.0, 0.0, 0.0, neg(nhat), touching)
    value = gap / pace
    lower = (gap - error) / (pace + pace_error) * (1.0 - 2.0**-50)
    upper = (gap + error) / (pace - pace_error) * (1.0 + 2.0**-50)
    status = HIT
    if lower > limit:
        status = MISS
    elif upper > limit:
        status = OPEN
    return Entry(status, lower, value, upper, neg(nhat), add(touching, scale(value, direction)))
