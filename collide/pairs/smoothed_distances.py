"""Distances smoothed over small motions of B: for optimisers that stall where a gradient is 0 or jumps.

With φ ~ N(0, σ²) [rad] and v ~ N(0, τ²) [m] along the axes of B, the pose of B is R exp(φ), o + R v, and the smoothed
distance is the mean of the distance over all φ and v: as smooth as the normal distribution, whatever the bodies are.

The derivative by (ω, u), a pose exp(ω) R, o + u of B, comes in two ways, both without bias:

- of first order, the mean of derivatives of samples: each moves rigidly with B, so its moment about o is the moment
  about its own origin plus R v × f of its force f;
- of zeroth order, of distances alone: moving B is moving the density on the samples. A rotation by ω takes φ to
  log(exp(Rᵀω) exp(φ)), along a field whose divergence by Haar's measure, of density h = 2 (1 − cos θ) / θ², θ = |φ|, is
  0. So d/dω E[d] = E[(d − d₀) Rφ (1/σ² + h'(θ) / (θ h(θ)))], and d/du E[d] = E[(d − d₀) R v / τ²], for every number
  d₀: the distance without motion, which leaves less variance.

Samples come in pairs of opposite motions. Standard errors are those of the means of pairs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.pairs.pair_arguments import pose_batch
from collide.pairs.query import distance
from collide.shapes.shape import checked_shape
from collide.transforms import rotation_from_unit

if TYPE_CHECKING:
    from collide.transforms import PoseLike

#: Of wider angles [rad] nothing is left but that every rotation is as likely.
_WIDEST = 10.0
#: Below this angle [rad] the series of h'(θ) / (θ h(θ)) is used: −1/6 − θ²/360, off by θ⁴/15120.
_SMALL = 2.0**-6
_MAX_SAMPLES = 1 << 20


class SmoothedDistances(NamedTuple):
    """Means over n samples for N pairs of poses, and their standard errors.

    distance : (N,) smoothed distances [m].
    d_distance_A, d_distance_B : (N, 6) derivatives by the poses of A and of B, as of `PairDerivatives`: a rotation
        [m/rad] about the body's origin, then a shift [m/m], along the axes of W.
    distance_error, d_distance_A_error, d_distance_B_error : standard errors, of the same shapes.
    missing : (N,) int64, samples without a derivative, left out of those means; 0 of zeroth order.
    """

    distance: np.ndarray
    d_distance_A: np.ndarray
    d_distance_B: np.ndarray
    distance_error: np.ndarray
    d_distance_A_error: np.ndarray
    d_distance_B_error: np.ndarray
    missing: np.ndarray


def smoothed_distances(
    A, B, X_WA: PoseLike, X_WB: PoseLike, *, angle: float, length: float, samples: int = 64, order: int = 1,
    seed: int = 0, threads: int = 1,
) -> SmoothedDistances:
    """Signed distances of A and B, smoothed over small random motions of B, and derivatives that exist everywhere.

    Parameters
    ----------
    A, B : Shape
    X_WA, X_WB : (4, 4) or (N, 4, 4) array_like, float64
        Poses [m].
    angle, length : float
        Standard deviations σ [rad], at most 10, and τ [m] of the motions along each axis of B. Of zeroth order both are
        above 0.
    samples : int
        Motions of each pair of poses, an even number; the same for all, so that means are smooth functions of poses.
    order : 1 or 0
        1: means of derivatives, the less noisy where bodies are smooth; 0: of distances alone, which also sees what
        derivatives do not, for instance the far side of a thin body.
    seed : int
        Of the motions.
    threads : int

    Returns
    -------
    SmoothedDistances

    Raises
    ------
    InvalidArgument, InvalidPose, InvalidShape

    Notes
    -----
    One batch of N · samples pairs. Variances are finite, and means of samples near the truth by a few standard errors.
    """
    for name, shape in (("A", A), ("B", B)):
        checked_shape(f"smoothed_distances: {name}", shape)
    sigma, tau = checks.length("angle", angle), checks.length("length", length)
    if sigma > _WIDEST:
        raise InvalidArgument(f"angle is a standard deviation of rotations, at most {_WIDEST:g} rad, got {sigma:g}")
    n = checks.integer("samples", samples, 4)
    if n % 2 or n > _MAX_SAMPLES:
        raise InvalidArgument(f"samples must be an even number, 4 ... {_MAX_SAMPLES}, got {n}")
    if checks.integer("order", order, 0) > 1:
        raise InvalidArgument(f"order must be 0 or 1, got {order}")
    if order == 0 and not (sigma > 0.0 and tau > 0.0):
        raise InvalidArgument("order=0 divides by angle and length: both must be above 0")
    X_WA, X_WB = np.broadcast_arrays(*(pose_batch(X, name)[0] for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB"))))
    motions = np.random.default_rng(checks.integer("seed", seed, 0)).normal(size=(n // 2, 6))
    motions = np.concatenate([motions, -motions]) * np.repeat([sigma, tau], 3)
    R_WB, o_WA, o_WB = X_WB[:, :3, :3], X_WA[:, :3, 3], X_WB[:, :3, 3]
    X_moved = np.broadcast_to(X_WB[:, None], (len(X_WB), n, 4, 4)).copy()
    X_moved[..., :3, :3] = R_WB[:, None] @ rotations(motions[:, :3])
    shifts = motions[:, 3:] @ R_WB.transpose(0, 2, 1)
    X_moved[..., :3, 3] += shifts
    X_WA_all = np.repeat(X_WA, n, axis=0)
    options: dict[str, Any] = {"threads": threads, "derivatives": order == 1}
    r: Any = distance(A, B, X_WA_all, X_moved.reshape(-1, 4, 4), **options)
    distances = r.distance.reshape(-1, n)
    if order == 1:
        by_b = r.d_distance_B.reshape(-1, n, 6).copy()
        by_b[..., :3] += np.cross(shifts, by_b[..., 3:])
    else:
        without: Any = distance(A, B, X_WA, X_WB, threads=threads).distance
        by_b = (distances - without[:, None])[..., None] * _scores(motions, R_WB, sigma, tau)
    # The distance depends on the relative pose alone: moved alike, A and B undo each other.
    by_a = -by_b
    by_a[..., :3] -= np.cross((o_WB - o_WA)[:, None], by_b[..., 3:])
    means = [_mean(values) for values in (distances[..., None], by_a, by_b)]
    missing = np.isnan(by_b[..., 0]).sum(axis=1)
    return SmoothedDistances(
        means[0][0][:, 0], means[1][0], means[2][0], means[0][1][:, 0], means[1][1], means[2][1], missing
    )


def rotations(phi: np.ndarray) -> np.ndarray:
    """(n, 3, 3) exp(φ) of (n, 3) [rad], by the unit quaternion of half the angle."""
    half = 0.5 * np.linalg.norm(phi, axis=1)
    xyz = 0.5 * np.sinc(half / np.pi)[:, None] * phi
    return np.moveaxis(rotation_from_unit(np.cos(half), *xyz.T), -1, 0)


def _scores(motions: np.ndarray, R_WB: np.ndarray, sigma: float, tau: float) -> np.ndarray:
    """(N, n, 6) by what distances of samples are multiplied for the derivative of their mean by the pose of B."""
    phi, v = motions[:, :3], motions[:, 3:]
    theta = np.linalg.norm(phi, axis=1)
    t = np.maximum(theta, _SMALL)
    of_haar = np.where(theta < _SMALL, -1.0 / 6.0 - theta**2 / 360.0, (np.sin(t) / (1.0 - np.cos(t)) - 2.0 / t) / t)
    scores = np.concatenate([phi * (1.0 / sigma**2 + of_haar)[:, None], v / tau**2], axis=1)
    R_T = R_WB.transpose(0, 2, 1)
    return np.concatenate([scores[:, :3] @ R_T, scores[:, 3:] @ R_T], axis=2)


def _mean(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((N, k) means over samples (N, n, k) but NaN, (N, k) their standard errors by pairs of opposite motions)."""
    half = values.shape[1] // 2
    both = np.stack([values[:, :half], values[:, half:]])
    n_known = (~np.isnan(both)).sum(axis=0)
    of_pairs = np.where(n_known > 0, np.nansum(both, axis=0) / np.maximum(n_known, 1), math.nan)
    m = (n_known > 0).sum(axis=1)
    mean = np.where(m > 0, np.nansum(of_pairs, axis=1) / np.maximum(m, 1), math.nan)
    square = np.nansum(np.square(of_pairs - mean[:, None]), axis=1)
    return mean, np.where(m > 1, np.sqrt(square / np.maximum(m * (m - 1), 1)), math.nan)
