"""Parts of posed bodies: where they stand, and balls that hold them.

A body is a run of parts, each with a pose in the body's frame. Where a part stands is the product of two poses: what
`tables.pose_table` makes of many at once, made here of one when somebody asks about it, the same bits.
"""

from __future__ import annotations

import math

from collide._jit import kernel, view_f64
from collide.geometry.error_free import two_product
from collide.geometry.tables import POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS, PRODUCT_SLOP, SAFE_PRODUCT, TERMS
from collide.geometry.union_table import MEASURE, TURNED

#: Balls apart by more than this share of the bodies' sizes and distance hold parts that are apart: their centres and
#: radii are good to 2⁻⁴⁵ of it, with all that rounding and slops of poses may add.
BALL_MARGIN = 2.0**-40


@kernel
def place_part(poses, at, body, parts, part, terms_at):
    """Row ``at`` becomes where a part stands; rows are numbers of doubles, ``part`` likewise in ``parts``.

    body : the row of the body's pose, its stretch known.   terms_at : 0, or where the exact terms of that row go.
    """
    poses[at + POSE_SLOP] = 0.0
    poses[at + POSE_TERMS] = -1.0
    if parts[part + TURNED] == 0.0:
        for k in range(12):
            poses[at + k] = poses[body + k]
        poses[at + POSE_STRETCH] = poses[body + POSE_STRETCH]
        return
    poses[at + POSE_STRETCH] = -1.0
    if _is_identity(poses, body):
        for k in range(12):
            poses[at + k] = parts[part + k]
        return
    exact = True
    stretch = 1.0
    shift = 0.0
    for i in range(3):
        r = body + 3 * i
        x = poses[r]
        y = poses[r + 1]
        z = poses[r + 2]
        stretch = max(stretch, abs(x) + abs(y) + abs(z))
        shift = max(shift, abs(poses[body + 9 + i]))
        for j in range(4):
            first = part + (j if j < 3 else 9)
            step = 3 if j < 3 else 1
            u = parts[first]
            v = parts[first + step]
            w = parts[first + 2 * step]
            a = x * u
            b = y * v
            c = z * w
            exact = exact and _is_safe(a, x, u) and _is_safe(b, y, v) and _is_safe(c, z, w)
            if j < 3:
                poses[at + 3 * i + j] = a + b + c
            else:
                poses[at + 9 + i] = a + b + c + poses[body + 9 + i]
    poses[at + POSE_SLOP] = PRODUCT_SLOP * (stretch * parts[part + MEASURE] + shift)
    if exact:
        poses[at + POSE_TERMS] = float(at // POSE)
        if terms_at != 0:
            write_terms(poses, body, parts, part, terms_at)


@kernel(inline=True)
def _is_identity(poses, p):
    """Whether a body stands at the origin: its parts keep their own poses, bit by bit."""
    if poses[p + 9] != 0.0 or poses[p + 10] != 0.0 or poses[p + 11] != 0.0:
        return False
    for k in range(9):
        if poses[p + k] != (1.0 if k % 4 == 0 else 0.0):
            return False
    return True


@kernel(inline=True)
def _is_safe(product, a, b):
    """Whether the low part of a product is a double."""
    return abs(product) > SAFE_PRODUCT or a == 0.0 or b == 0.0


@kernel
def write_terms(poses, body, parts, part, terms_at):
    """TERMS doubles that add up to each entry of the product of a body's pose and a part's."""
    terms = view_f64(terms_at, 12 * TERMS)
    for i in range(3):
        r = body + 3 * i
        for j in range(4):
            to = TERMS * (3 * i + j if j < 3 else 9 + i)
            first = part + (j if j < 3 else 9)
            step = 3 if j < 3 else 1
            for k in range(3):
                terms[to + 2 * k], terms[to + 2 * k + 1] = two_product(poses[r + k], parts[first + step * k])
            terms[to + 6] = 0.0 if j < 3 else poses[body + 9 + i]


@kernel(inline=True)
def place_ball(poses, body, numbers, at, x, y, z, ball, to):
    """Four doubles of ``ball`` at ``to`` become where a ball of a body is; (x, y, z) is where the body stands.

    numbers : a part's from CENTRE on, or a body's from BODY_CENTRE on, at ``at``: centre, radius of the core's, swept.
    """
    cx = numbers[at]
    cy = numbers[at + 1]
    cz = numbers[at + 2]
    ball[to] = (poses[body] * cx + poses[body + 1] * cy + poses[body + 2] * cz) + x
    ball[to + 1] = (poses[body + 3] * cx + poses[body + 4] * cy + poses[body + 5] * cz) + y
    ball[to + 2] = (poses[body + 6] * cx + poses[body + 7] * cy + poses[body + 8] * cz) + z
    ball[to + 3] = numbers[at + 3] * poses[body + POSE_STRETCH] + numbers[at + 4]


@kernel(inline=True)
def gap_of_balls(balls, i, j):
    """The distance of two balls, negative where they overlap, good to the BALL_MARGIN of their bodies."""
    x = balls[i] - balls[j]
    y = balls[i + 1] - balls[j + 1]
    z = balls[i + 2] - balls[j + 2]
    return math.sqrt(x * x + y * y + z * z) - (balls[i + 3] + balls[j + 3])
