"""Nearest points that engines give of bodies apart: whether each lies on its body, and no farther from the other.

Of overlaps engines mean different points, so that those are not judged.
"""

from __future__ import annotations

import numpy as np

from collide import distance
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.peers.question import is_compound_or_mesh
from collide.errors import CollideError
from collide.shapes import ConvexHull, Shape
from collide.transforms import pose

#: How far a point may be off, as a part of the pair's size: far more than the tolerance of any engine.
POINTS_TOLERANCE = 1e-4
_POINT = ConvexHull([[0.0, 0.0, 0.0]])


def points_off(case: Case, row: np.void, upper: float) -> tuple[float, str]:
    """How far an engine's nearest points of two bodies apart are surely off [m], and which way, in words.

    row : of `answers.TABLE_DTYPE`.   upper : proven bound of the distance [m].
    Gives 0 where there are no points, or no proven distance of a point to its body.
    """
    points = row["point_a"], row["point_b"]
    if not np.isfinite(points).all():
        return 0.0, ""
    between = float(np.linalg.norm(points[1] - points[0]))
    answer = f"points {points[0].tolist()} on A and {points[1].tolist()} on B"
    worst = max(between - upper, 0.0) if np.isfinite(upper) else 0.0, f"{answer} are {between!r} m apart"
    offs = [_off_surface(body.shape, body.X_WB, point) for body, point in zip(case.bodies, points)]
    if max(offs) > worst[0]:
        off, name = max(zip(offs, "AB"))
        exchanged = max(_off_surface(b.shape, b.X_WB, point) for b, point in zip(case.bodies, points[::-1]))
        why = "exchanged: each is on the other body" if exchanged <= 1e-6 * off else f"the one on {name} {off!r} m off"
        worst = off, f"{answer}, {why}"
    return worst


def _off_surface(shape: Shape, X_WB: np.ndarray, p_W: np.ndarray) -> float:
    """A proven lower bound of a point's distance to a body's surface [m]; of unions and meshes from outside alone."""
    try:
        r = distance(_POINT, shape, pose(p_W), X_WB)
    except CollideError:
        return 0.0
    inside = 0.0 if is_compound_or_mesh(shape) or not np.isfinite(r.upper) else -float(r.upper)
    outside = float(r.lower) if np.isfinite(r.lower) else 0.0
    return max(outside, inside, 0.0)
