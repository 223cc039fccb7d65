"""Parts of posed bodies: their poses in the world, and balls around them.

A body is a run of parts, each with a pose in the body's frame. The pose of a part in the world is the product of two
poses: `shape_table.pose_table` makes many at once, this module makes a single product on demand, the same bits.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64
from collide.lowering.compound_table import MEASURE, PART, TURNED
from collide.lowering.shape_table import (
    LOW_PARTS,
    POSE,
    POSE_SLOP,
    POSE_STRETCH,
    POSE_TERMS,
    PRODUCT_SLOP,
    SAFE_PRODUCT,
    TERMS,
)
from collide.numerics.error_free import two_product, two_sum

#: Balls apart by more than this share of the bodies' sizes and distance hold parts that are apart: their centres and
#: radii are good to 2⁻⁴⁵ of it, with all that rounding and slops of poses may add.
BALL_MARGIN = 2.0**-40


@kernel
def place_part(poses, at, body, parts, part, terms_at):
    """Row ``at`` becomes where a part stands; rows are numbers of doubles, ``part`` likewise in ``parts``.

    body : the row of the body's pose, its stretch known.
    terms_at : 0, or where the row's terms go: their low parts are
        written.
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
    low = view_f64(terms_at + 8 * LOW_PARTS, 12 if terms_at != 0 else 0)
    least = math.inf
    stretch = 1.0
    shift = 0.0
    for i in range(3):
        r = body + 3 * i
        t = poses[body + 9 + i]
        stretch = max(stretch, abs(poses[r]) + abs(poses[r + 1]) + abs(poses[r + 2]))
        shift = max(shift, abs(t))
        for j in range(4):
            first = part + (j if j < 3 else 9)
            step = 3 if j < 3 else 1
            a, a_low = two_product(poses[r], parts[first])
            b, b_low = two_product(poses[r + 1], parts[first + step])
            c, c_low = two_product(poses[r + 2], parts[first + 2 * step])
            least = min(least, abs(a), abs(b), abs(c))
            entry = a + b + c if j < 3 else a + b + c + t
            to = 3 * i + j if j < 3 else 9 + i
            poses[at + to] = entry
            if terms_at != 0:
                total, rest = two_sum(0.0 + a, a_low)
                total, e = two_sum(total, b)
                total, f = two_sum(total, b_low)
                rest = (rest + e) + f
                total, e = two_sum(total, c)
                total, f = two_sum(total, c_low)
                rest = (rest + e) + f
                if j == 3:
                    total, e = two_sum(total, t)
                    rest += e
                low[to] = rest + (total - entry)
    poses[at + POSE_SLOP] = PRODUCT_SLOP * (stretch * parts[part + MEASURE] + shift)
    if least > SAFE_PRODUCT or _are_safe(poses, body, parts, part):
        poses[at + POSE_TERMS] = float(at // POSE)


@entry("int64(int64, int64, int64)")
def place_all_parts(parts_at, n, poses_at):
    """Write n rows of POSE doubles: where the parts of a body stand whose own pose is row n; returns 0."""
    parts, poses = view_f64(parts_at, PART * n), view_f64(poses_at, POSE * (n + 1))
    for k in range(n):
        place_part(poses, POSE * k, POSE * n, parts, PART * k, 0)
    return 0


@kernel
def _are_safe(poses, body, parts, part):
    """Whether low parts of all products are doubles, or 0."""
    for i in range(3):
        for j in range(4):
            for k in range(3):
                remaining = poses[body + 3 * i + k]
                factor = parts[part + (3 * k + j if j < 3 else 9 + k)]
                if not (abs(remaining * factor) > SAFE_PRODUCT or remaining == 0.0 or factor == 0.0):
                    return False
    return True


@kernel
def is_exact_product(poses, body, parts, part):
    """Whether the product of a body's pose and a part's is rounded nowhere, as `shape_table.moved_pose` tells."""
    for i in range(3):
        for j in range(4):
            total = 0.0
            for k in range(3):
                remaining = poses[body + 3 * i + k]
                factor = parts[part + (3 * k + j if j < 3 else 9 + k)]
                high, low = two_product(remaining, factor)
                total, rest = two_sum(total, high)
                is_safe = abs(high) > SAFE_PRODUCT or remaining == 0.0 or factor == 0.0
                if low != 0.0 or rest != 0.0 or not is_safe:
                    return False
            if j == 3 and two_sum(total, poses[body + 9 + i])[1] != 0.0:
                return False
    return True


@kernel(inline=True)
def _is_identity(poses, p):
    """Whether a body stands at the origin: its parts keep their own poses, bit by bit."""
    if poses[p + 9] != 0.0 or poses[p + 10] != 0.0 or poses[p + 11] != 0.0:
        return False
    for k in range(9):
        if poses[p + k] != (1.0 if k % 4 == 0 else 0.0):
            return False
    return True


@kernel
def write_terms(poses, body, parts, part, terms_at):
    """TERMS doubles that add up to each entry of the product of a body's pose and a part's."""
    terms = view_f64(terms_at, LOW_PARTS)
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
