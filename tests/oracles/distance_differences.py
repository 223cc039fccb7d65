"""Differences of proven signed distances along a change of both poses, in decimals of 80 digits.

A pose changes along a twist (ω, v) to exp(h ω) R, o + h v, for h = ±2⁻²⁴: cubes of h are far below what derivatives are
compared to, and brackets of distances are narrower than h by twelve digits.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from typing import NamedTuple

import numpy as np
from curved_cells import CONTEXT, Pose, Vector, dot, exact, make_pose, vector
from curved_oracle import Body, bracket_bodies
from decimal_angles import decimal_sine_cosine

STEP = Decimal(2) ** -24


class Slope(NamedTuple):
    """Derivative of the signed distance along a twist.

    before, after : one-sided differences.   error : what the brackets leave open.
    """

    before: float
    after: float
    error: float

    @property
    def middle(self) -> float:
        return 0.5 * (self.before + self.after)


def slope(A, B, X_WA, X_WB, twist, step: Decimal = STEP) -> Slope:
    """The slope along a twist of twelve numbers: ω and v of A, then of B."""
    with localcontext(CONTEXT):
        pose_a, pose_b = make_pose(X_WA), make_pose(X_WB)
        ends = []
        for h in (-step, Decimal(0), step):
            a, b = (moved(pose, twist[k : k + 6], h) for pose, k in ((pose_a, 0), (pose_b, 6)))
            found = bracket_bodies(Body(A, a), Body(B, b))
            ends.append(((found.lower + found.upper) / 2, found.upper - found.lower))
        (low, off), (middle, _), (high, off_high) = ends
        return Slope(float((middle - low) / step), float((high - middle) / step), float((off + off_high) / step))


def moved(pose: Pose, twist, h: Decimal) -> Pose:
    """A pose after a turn by h ω about its origin and a shift by h v."""
    omega, v = vector(twist[:3]), vector(twist[3:])
    R = _rotation(omega, h)
    columns = [[dot(row, vector(of[k] for of in pose.rows)) for k in range(3)] for row in R]
    shift: Vector = tuple(t + h * x for t, x in zip(pose.shift, v))  # type: ignore[assignment]
    return Pose(tuple(tuple(row) for row in columns), shift)  # type: ignore[arg-type]


def _rotation(omega: Vector, h: Decimal) -> tuple[Vector, Vector, Vector]:
    """Rodrigues' formula for exp(h ω)."""
    length = dot(omega, omega).sqrt()
    if not length or not h:
        return tuple(vector(row) for row in np.eye(3))  # type: ignore[return-value]
    x, y, z = (c / length for c in omega)
    s, c = decimal_sine_cosine(h * length)  # type: ignore[arg-type]
    d = 1 - c
    return (
        (c + d * x * x, d * x * y - s * z, d * x * z + s * y),
        (d * x * y + s * z, c + d * y * y, d * y * z - s * x),
        (d * x * z - s * y, d * y * z + s * x, c + d * z * z),
    )


__all__ = ["STEP", "Slope", "exact", "moved", "slope"]
