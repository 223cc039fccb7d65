"""The last digits of the gap between two convex sets, a cylinder, cone or ellipsoid among them.

`curved_features.py` proposes a direction n and nearest points a, b. Proven are the lower bound −σ_A(n) − σ_B(−n) over
|n|, with σ the supports over all of both sets (the gap is the largest of these over all n), and the upper bound
|b − a|, for a and b within their sets.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import SMALLEST_NORMAL, SUBNORMAL
from collide.narrowphase.gap.curved_features import ERROR, beyond, nearest_features
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.vec3 import Vec3, divide, scale

#: How near to a flat feature, in radians, a direction of GJK is for that feature to be taken.
_FLAT = 1e-4
#: What points may be off the normal by, of the gap: the upper bound is too large by half its square.
_ACROSS = 2.0**-51


class CurvedGap(NamedTuple):
    """lower ≤ gap ≤ upper of two cores, each within ``error`` [m]; n from A to B; nearest points in W's axes, a from
    A's origin, b from B's."""

    is_proven: bool
    lower: DD
    upper: DD
    error: float
    nhat: Vec3
    a: Vec3
    b: Vec3


@kernel
def refine_curved_gap(ordered, work, n_points, nhat):
    """The `CurvedGap` of cores apart, from GJK's last simplex of n points and the direction n̂ from A to B.

    The memory of EPA serves as workspace. False where poses are rounded products, or nothing better is proven.
    """
    s = nearest_features(ordered, work, n_points, True, nhat, _FLAT, _ACROSS, work.epa_at)
    pair, unit = ordered.pair, s.unit
    v = dd.sub_vec3(dd.add_vec3(s.q.point, s.t), s.p.point)
    length = dd.sqrt(dd.inner(s.n, s.n))
    excess = dd.add(
        beyond(pair, pair.A, s.p, s.n, unit, work), beyond(pair, pair.B, s.q, dd.neg_vec3(s.n), unit, work)
    )
    lower = dd.div(dd.sub(dd.inner(s.n, v), excess), length)
    upper = dd.sqrt(dd.inner(v, v))
    error, over = ERROR * s.size, 1.0 / unit
    vanishing = SUBNORMAL if lower.high * over < SMALLEST_NORMAL else 0.0
    is_proven = s.is_found and 0.5 < length.high < 2.0 and lower.high > 4.0 * error and upper.high < math.inf
    return CurvedGap(
        is_proven, dd.scale(over, lower), dd.scale(over, upper), over * error + vanishing,
        divide(dd.leading(s.n), length.high), scale(over, dd.leading(s.p.point)), scale(over, dd.leading(s.q.point))
    )
