"""Derivatives of the time of impact by the implicit function theorem.

At the first contact, at time t, the signed distance d of the bodies is 0, and falls at the rate ḋ = ∂d/∂t < 0. Moved
by a change θ of a motion, the contact comes at t(θ) with d(t(θ), θ) = 0, so that dt/dθ = −(∂d/∂θ) / ḋ. With g the
derivative of d by a body's pose, angular and linear, as of `distance`, and a body that turns at ω and moves at v,

    ḋ = Σ over both bodies  g · (ω, v),
    dt by a shift of the whole motion, after the turn about the origin at the contact:  −g / ḋ,
    dt by the velocities, the start held:  −(t Jᵀ g_ω, t g_v) / ḋ,  J = ∫₀¹ exp(s t [ω]×) ds.

J is the left Jacobian of rotations: exp(t [ω + δ]×) is exp([t J δ]×) exp(t [ω]×) to first order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.derivatives.uniqueness import Uniqueness
from collide.motion.impact_query import checked_omega, poses_in_motion, time_of_impact
from collide.motion.impact_rows import TimeOfImpact
from collide.pairs.query import distance
from collide.transforms import as_poses

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.shapes.shape import Shape
    from collide.transforms import PoseLike

#: A rate below this part of the speed of both witness points is of bodies that graze each other.
_GRAZING = 1e-6


class ImpactDerivatives(NamedTuple):
    """Times of impact of N motions, and their derivatives; NaN where ``reason`` says why.

    impact : `TimeOfImpact`, of a batch.
    rate : (N,) how fast the distance falls at the contact [m in unit time], below 0.
    d_time_A, d_time_B : (N, 6) by a turn of the whole motion of A, or B, about the body's origin at the contact
        [1/rad], then by a shift [1/m], along the axes of W.
    d_time_velocity_A, d_time_velocity_B : (N, 6) by the angular velocity [1/rad], then by the velocity of the origin
        [1/m], both of unit time, the pose at the start held.
    reason : list of N, None beside derivatives.
    """

    impact: TimeOfImpact
    rate: np.ndarray
    d_time_A: np.ndarray
    d_time_B: np.ndarray
    d_time_velocity_A: np.ndarray
    d_time_velocity_B: np.ndarray
    reason: list[str | None]


def impact_derivatives(
    A: Shape, B: Shape, X_WA0: PoseLike, X_WA1: PoseLike, X_WB0: PoseLike, X_WB1: PoseLike, *,
    omega_WA: ArrayLike | None = None, omega_WB: ArrayLike | None = None, tolerance: float = 1e-9,
) -> ImpactDerivatives:
    """When two moving bodies first touch, and how the time changes with the motions.

    Parameters
    ----------
    A, B, X_WA0, X_WA1, X_WB0, X_WB1, omega_WA, omega_WB, tolerance
        As of `time_of_impact`; derivatives are taken within the tolerance of the contact.

    Returns
    -------
    ImpactDerivatives
        Of N motions, N = 1 for a single motion. Derivatives are NaN where bodies do not meet, meet at the start, or
        graze each other, and where the distance has no derivative at the contact (docs/derivatives.md).

    Raises
    ------
    InvalidArgument, InvalidPose, UnsupportedQuery
        As of `time_of_impact`.

    Notes
    -----
    O(1) a motion beside `time_of_impact` and `distance` with derivatives, by the implicit function theorem.
    """
    poses: list[Any] = [as_poses(X, name) for X, name in (
        (X_WA0, "X_WA0"), (X_WA1, "X_WA1"), (X_WB0, "X_WB0"), (X_WB1, "X_WB1"))]
    omegas = [checked_omega(omega, name)[0] for omega, name in ((omega_WA, "omega_WA"), (omega_WB, "omega_WB"))]
    n = max(len(X) for X in (*poses, *(omega for omega in omegas if omega is not None)))
    poses = [np.broadcast_to(X, (n, 4, 4)).copy() for X in poses]
    impact = time_of_impact(A, B, *poses, omega_WA=omegas[0], omega_WB=omegas[1], tolerance=tolerance)
    sides = []
    for (X0, X1), omega in zip((poses[:2], poses[2:]), omegas):
        rotation = _rotation_vectors(X0, X1) if omega is None else np.broadcast_to(omega, (n, 3))
        sides.append((poses_in_motion(X0, X1, impact.time, omega_WA=omega), rotation, X1[:, :3, 3] - X0[:, :3, 3]))
    r: Any = distance(A, B, sides[0][0], sides[1][0], derivatives=True)
    gradients = r.d_distance_A, r.d_distance_B
    twists = [np.hstack([rotation, velocity]) for _, rotation, velocity in sides]
    rate: np.ndarray = sum(np.einsum("ij,ij->i", g, twist) for g, twist in zip(gradients, twists))
    speed = sum(
        np.linalg.norm(velocity, axis=1) + np.linalg.norm(np.cross(rotation, point - X[:, :3, 3]), axis=1)
        for (X, rotation, velocity), point in zip(sides, (r.point_a, r.point_b))
    )
    reason = [
        _reason(*row) for row in zip(
            impact.hit.tolist(), impact.certified.tolist(), impact.upper.tolist(), r.uniqueness.tolist(),
            (rate < -_GRAZING * speed).tolist(),
        )
    ]
    known = np.array([why is None for why in reason], dtype=bool)
    scale = np.where(known, -1.0 / np.where(known, rate, 1.0), np.nan)[:, None]
    of_A, of_B = (scale * g for g in gradients)
    of_velocity_A, of_velocity_B = (
        scale * impact.time[:, None] * np.hstack([_by_rotations(g[:, :3], impact.time[:, None] * rotation), g[:, 3:]])
        for g, (_, rotation, _) in zip(gradients, sides)
    )
    rate = np.where(known, rate, np.nan)
    return ImpactDerivatives(impact, rate, of_A, of_B, of_velocity_A, of_velocity_B, reason)


def _reason(hit: bool, certified: bool, upper: float, uniqueness: int, is_falling: bool) -> str | None:
    if not hit:
        return "the bodies do not meet"
    if upper == 0.0:
        return "the bodies are in contact at the start"
    if not certified:
        return "the contact is not proven"
    if uniqueness != Uniqueness.UNIQUE:
        return f"the distance has no derivative at the contact: {Uniqueness(uniqueness).meaning}"  # type: ignore[call-arg]
    return None if is_falling else "the bodies graze each other"


def _rotation_vectors(X0: np.ndarray, X1: np.ndarray) -> np.ndarray:
    """(n, 3) rotation vectors [rad], at most half a turn, that lead from the first poses to the second."""
    R = X1[:, :3, :3] @ X0[:, :3, :3].transpose(0, 2, 1)
    trace = np.trace(R, axis1=1, axis2=2)
    skew = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    cosine = 0.5 * np.sqrt(np.clip(1.0 + trace, 0.0, 4.0))  # of half the angle
    # R + Rᵀ + (1 − trace R) 1 is 2 (1 − cos θ) a aᵀ, for the axis a: its longest row has the direction of a.
    rows = R + R.transpose(0, 2, 1) + (1.0 - trace)[:, None, None] * np.eye(3)
    axis = rows[np.arange(len(R)), np.linalg.norm(rows, axis=2).argmax(axis=1)]
    axis /= np.maximum(np.linalg.norm(axis, axis=1), np.finfo(float).tiny)[:, None]
    axis *= np.where((skew * axis).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    angle = 2.0 * np.arctan2(np.sqrt(1.0 - cosine**2), cosine)
    is_small = np.linalg.norm(skew, axis=1) < 1e-4
    return np.where((is_small & (cosine > 0.5))[:, None], 0.5 * skew, angle[:, None] * axis)


def _by_rotations(g: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(n, 3) Jᵀ g: J = 1 + (1 − cos θ)/θ² [φ]× + (θ − sin θ)/θ³ [φ]×² of turns φ (n, 3) by θ = |φ|."""
    angle = np.linalg.norm(phi, axis=1)[:, None]
    is_small = angle < 1e-3
    t = np.where(is_small, 1.0, angle)
    first = np.where(is_small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(t)) / t**2)
    second = np.where(is_small, 1.0 / 6.0 - angle**2 / 120.0, (t - np.sin(t)) / t**3)
    once = np.cross(g, phi)  # [φ]×ᵀ g
    return g + first * once + second * np.cross(once, phi)
