"""A smooth least distance over pairs, and its derivative: for optimisers that stall where the nearest pair changes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument


class SoftMinimum(NamedTuple):
    """Smooth least distances of N groups of pairs.

    value : (N,) [m].   gradient : (N, m) its derivatives; ``None`` of distances alone.
    weights : (M,) shares of the rows in the gradient, which add up to 1 for each of N.
    """

    value: np.ndarray
    gradient: np.ndarray | None
    weights: np.ndarray


def soft_minimum(distances, gradients=None, *, sharpness: float, starts=None) -> SoftMinimum:
    """−log Σ exp(−k d) / k over distances d: a smooth least distance, of all pairs that are nearly as near.

    Parameters
    ----------
    distances : (M,) array_like
        [m]; infinite ones have no say.
    gradients : (M, m) array_like, optional
        Their derivatives, as of `RobotDistances.gradient` or `PairDerivatives`; rows of NaN are refused where they
        have a say.
    sharpness : float
        k [1/m]. Of n distances the value lies within log(n) / k below the least.
    starts : (N + 1,) array_like of int, optional
        Where rows of each of N groups begin and end, as of `RobotDistances.starts`; by default all are a group.

    Returns
    -------
    SoftMinimum
        Where a group is empty, or all its distances are infinite, the value is infinite and its gradient 0. Of bounds
        below and above the distances the values bound the value: it grows with every distance.

    Raises
    ------
    InvalidArgument
    """
    d = checks.array("distances", distances, "(M,)", InvalidArgument)
    k = checks.length("sharpness", sharpness)
    if d.ndim != 1 or np.isnan(d).any() or (d == -math.inf).any():
        raise InvalidArgument(f"distances must be (M,) numbers, without NaN and −inf, got {checks.brief(distances)}")
    if k == 0.0:
        raise InvalidArgument("sharpness must be above 0 [1/m]")
    ends = _ends(starts, len(d))
    n = len(ends) - 1
    of = np.repeat(np.arange(n), np.diff(ends))
    least = np.full(n, math.inf)
    np.minimum.at(least, of, d)
    shift = np.where(np.isfinite(least), least, 0.0)
    weights = np.exp(-k * (d - shift[of]))
    total = np.bincount(of, weights, n)
    weights /= np.where(total > 0.0, total, 1.0)[of]
    with np.errstate(divide="ignore"):
        value = np.where(total > 0.0, shift - np.log(total) / k, math.inf)
    return SoftMinimum(value, None if gradients is None else _weighted(gradients, distances, weights, of, n), weights)


def _weighted(gradients, distances, weights: np.ndarray, of: np.ndarray, n: int) -> np.ndarray:
    g = checks.array("gradients", gradients, "(M, m)", InvalidArgument)
    if g.ndim != 2 or len(g) != len(weights):
        wanted = f"({len(weights)}, m), a row for each of distances, {checks.brief(distances)}"
        raise InvalidArgument(f"gradients must be {wanted}; got {g.shape}")
    lost = np.isnan(g).any(axis=1) & (weights > 0.0)
    if lost.any():
        row = int(np.argmax(lost))
        raise InvalidArgument(
            f"gradients[{row}] is NaN and has a share of {weights[row]:.2g}: leave rows without a gradient out"
        )
    out = np.zeros((n, g.shape[1]))
    np.add.at(out, of, np.where(weights[:, None] > 0.0, weights[:, None] * g, 0.0))
    return out


def _ends(starts, count: int) -> np.ndarray:
    if starts is None:
        return np.array([0, count])
    ends = checks.array("starts", starts, "(N + 1,)", InvalidArgument)
    if ends.ndim != 1 or not len(ends) or ends[0] != 0 or ends[-1] != count or (np.diff(ends) < 0).any():
        text = checks.brief(starts)
        raise InvalidArgument(f"starts must rise from 0 to the number of distances, {count}, got {text}")
    return ends.astype(np.int64)
