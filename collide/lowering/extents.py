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
