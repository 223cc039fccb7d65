"""How fast points of one body in motion come nearer the other: motion bounds of first order.

Mirtich ("Impulse-based dynamic simulation of rigid body systems", 1996) bounds the speed of a body's points by |v| +
|ω| ρ. Here the least of three bounds counts, as seen from the world, from A and from B. From A, a point r of B, with
B's origin at d, moves by

    v + ω_B × r − ω_A × (d + r)  =  (v − ω_A × d) + (ω_B − ω_A) × r :

bodies that turn together stand still. The distance of the bodies changes no faster.
"""

from __future__ import annotations

from collide.kernels import kernel
from collide.motion.moving_body import ANGLE, DRIFT_REACH, OUTWARD, REACH_OF_CORE
from collide.motion.moving_pair import omega_of
from collide.numerics.vec3 import cross, norm, sub


@kernel
def speed_bound(a, b, v, d_begin, d_end):
    """μ of two moving bodies whose origins are from d_begin to d_end apart, in a straight line [m in unit time]."""
    omega_a, omega_b = omega_of(a), omega_of(b)
    reach_a, reach_b = a[REACH_OF_CORE], b[REACH_OF_CORE]
    turning = norm(sub(omega_b, omega_a))
    from_world = norm(v) + a[ANGLE] * reach_a + b[ANGLE] * reach_b
    # what is linear in time is largest at one of the ends
    moved_a = max(norm(sub(v, cross(omega_a, d_begin))), norm(sub(v, cross(omega_a, d_end))))
    moved_b = max(norm(sub(v, cross(omega_b, d_begin))), norm(sub(v, cross(omega_b, d_end))))
    from_a, from_b = moved_a + turning * reach_b, moved_b + turning * reach_a
    drift = (1.0 + a[ANGLE] + b[ANGLE]) * (a[DRIFT_REACH] + b[DRIFT_REACH])
    size = norm(v) + (a[ANGLE] + b[ANGLE]) * (reach_a + reach_b + norm(d_begin) + norm(d_end))
    return min(from_world, from_a, from_b) * OUTWARD + drift + 2.0**-46 * size
