"""How far posed convex sets reach along a direction, in plain doubles: callers add the error."""

from __future__ import annotations

import math

import numpy as np

from collide.curved.curved_kinds import CURVED
from collide.curved.shape_kinds import HALFSPACE, POINTS
from collide.lowering.packed_convex import PackedConvex


def extent_of(packed: PackedConvex, X: np.ndarray, n: np.ndarray) -> float:
    """Support value of a convex set at a pose (4, 4) along unit n of the world."""
    R, t = np.ascontiguousarray(X[:3, :3]), np.ascontiguousarray(X[:3, 3])
    g = R.T @ n
    if packed.kind == POINTS:
        core = float((packed.points @ g).max())
    elif packed.kind == HALFSPACE:
        return math.inf  # bounded in one direction only, which a rounded normal never is
    else:
        core = float(CURVED[packed.kind].extents(packed.params, g))
    return core + float(t @ n) + packed.radius


def box_of(packed: PackedConvex) -> np.ndarray:
    """(6,) centre and half sides of a box around a set, in the set's own frame; infinite half sides for a
    half-space.
    """
    if packed.kind == HALFSPACE:
        return np.array([0.0, 0.0, 0.0, np.inf, np.inf, np.inf])
    if packed.kind == POINTS:
        low, high = packed.points.min(axis=0), packed.points.max(axis=0)
        return np.concatenate([0.5 * (low + high), 0.5 * (high - low) + packed.radius + packed.slop])
    return np.concatenate([np.zeros(3), _curved_half(packed) + packed.radius + packed.slop])


def _curved_half(packed: PackedConvex) -> np.ndarray:
    """Half sides of a curved core's box: three radii of an ellipsoid, else a radius and half a length."""
    from_radii = packed.params[:3]
    return from_radii if packed.params[2] > 0.0 else np.array([from_radii[0], from_radii[0], from_radii[1]])
