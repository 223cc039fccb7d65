"""Whether a box and a sphere meet, in closed form: the box's point nearest to the centre, and the plane across.

Gaps and depths of the pair are `convex_convex.py`'s, whose deciding feature gives the last digits.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.posed_pair import radius_of
from collide.narrowphase.rows import NORMAL, write_decision
from collide.numerics.vec3 import Vec3, add, column_at, dot, norm, put_vec3, rotate, rotate_back, scale, sub, vec3_at
from collide.results import FORMULA


@kernel(inline=True)
def is_box_and_sphere(pair):
    """Whether a core is a point, and the other core a `Box`: half sizes stand among the numbers of a box."""
    A, B = pair.A, pair.B
    if A.n != 1 and B.n != 1:
        return False
    box = B if A.n == 1 else A
    return box.kind == POINTS and pair.numbers[box.params_at] > 0.0


@kernel(cold=True)
def decide_box_sphere(ordered, limit, row):
    """Write the row of a boolean; False, and nothing, where doubles leave the sign open.

    With R the box's matrix and c the centre from the box's origin: R l is a point of the box for any l within the half
    sizes h, so the gap is at most |v|, v = c − R l; and the plane across v bounds it from below by
    (v·c − Σ |v·Rᵢ| hᵢ) / |v|, whatever R and v. Both are sums of fewer terms than `bounds.py` counts: 64u·S holds.
    """
    pair = ordered.pair
    box, ball, sign = (pair.B, pair.A, -1.0) if pair.A.n == 1 else (pair.A, pair.B, 1.0)
    h = vec3_at(pair.numbers, box.params_at)
    c = add(rotate(pair.poses, ball.pose_at, column_at(ball.coords, ball.padded, 0)), scale(sign, pair.t))
    g = rotate_back(pair.poses, box.pose_at, c)
    inside = Vec3(min(max(g.x, -h.x), h.x), min(max(g.y, -h.y), h.y), min(max(g.z, -h.z), h.z))
    v = sub(c, rotate(pair.poses, box.pose_at, inside))
    gap = norm(v)
    radius = radius_of(pair, pair.A) + radius_of(pair, pair.B)
    error = ERROR * ordered.size + ordered.slop
    lower, upper = -math.inf, gap + error - radius
    if gap > 0.0:
        along = rotate_back(pair.poses, box.pose_at, v)
        reach = abs(along.x) * h.x + abs(along.y) * h.y + abs(along.z) * h.z
        lower = (dot(v, c) - reach) / gap - error - radius
    if not (lower > 0.0 or upper <= 0.0):
        return False
    write_decision(row, gap - radius, lower, upper, FORMULA, limit)
    if lower > 0.0:
        put_vec3(row.doubles, NORMAL, scale((-sign if ordered.flip else sign) / gap, v))
    return True
