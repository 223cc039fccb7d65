"""How far posed convex sets reach along a direction, in plain doubles: callers add the error."""

from __future__ import annotations

import math

import numpy as np

from collide.lowering.packed_convex import PackedConvex
from collide.support.shape_kinds import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS


def extent_of(packed: PackedConvex, X: np.ndarray, n: np.ndarray) -> float:
    """Support value of a convex set at a pose (4, 4) along unit n of the world."""
    R, t = np.ascontiguousarray(X[:3, :3]), np.ascontiguousarray(X[:3, 3])
    g = R.T @ n
    p = packed.params
    if packed.kind == POINTS:
        core = float((packed.points @ g).max())
    elif packed.kind == ELLIPSOID:
        core = float(np.linalg.norm(p[:3] * g))
    elif packed.kind == CYLINDER:
        core = p[0] * math.hypot(g[0], g[1]) + p[1] * abs(g[2])
    elif packed.kind == CONE:
        core = max(p[1] * g[2], p[0] * math.hypot(g[0], g[1]) - p[1] * g[2])
    else:
        assert packed.kind == HALFSPACE
        return math.inf  # bounded in one direction only, which a rounded normal never is
    return core + float(t @ n) + packed.radius
