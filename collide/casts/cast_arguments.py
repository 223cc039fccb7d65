"""Arguments of casts as callers hand them in: directions, rays, points, shapes that can be moved."""

from __future__ import annotations

import math

import numpy as np

from collide.base import argument_checks as checks
from collide.casts.directions import Directions
from collide.errors import UnsupportedQuery
from collide.lowering.closed_regions import reach_of
from collide.shapes.shape import Shape
from collide.transforms import LARGEST

#: The largest component of a direction stays within these; its others are 0 or at least this part of the largest.
_DIRECTIONS = (1e-100, 1e100)
_MIN_RATIO = 2.0**-500


def checked_directions(caller: str, name: str, values, thing: str) -> tuple[Directions, bool]:
    """(directions, whether a single one was handed in). Raises InvalidArgument.

    thing : "a ray", for messages.
    """
    values_read, single = checks.vectors(caller, name, values)
    sizes = np.abs(values_read).max(axis=1)
    checks.refuse_rows(caller, name, values_read, sizes == 0.0, f"has length 0: {thing} needs a direction")
    low, high = _DIRECTIONS
    complaint = f"has no component within [{low:g}, {high:g}]"
    checks.refuse_rows(caller, name, values_read, (sizes < low) | (sizes > high), complaint)
    exponents = np.frexp(sizes)[1].astype(np.int64)
    scaled = np.ldexp(values_read, -exponents[:, None])
    thin = (scaled != 0.0) & (np.abs(scaled) < _MIN_RATIO)
    complaint = "has components that differ by more than 2^500; make them 0"
    checks.refuse_rows(caller, name, scaled, thin.any(axis=1), complaint)
    return Directions(scaled, exponents), single


def checked_rays(caller: str, origins_W, directions_W, **counts: int) -> tuple[np.ndarray, Directions, bool]:
    """((n, 3) origins, n directions, whether a single ray was handed in).

    counts : lengths of other arguments that go with the rays. Raises InvalidArgument.
    """
    origins, single_origin = checks.vectors(caller, "origins_W", origins_W)
    directions, single_direction = checked_directions(caller, "directions_W", directions_W, "a ray")
    checks.refuse_rows(caller, "origins_W", origins, np.abs(origins).max(axis=1) > LARGEST, f"exceeds {LARGEST:g}")
    n = checks.matched_count(caller, **counts, origins_W=len(origins), directions_W=len(directions.vectors))
    origins = np.ascontiguousarray(np.broadcast_to(origins, (n, 3)))
    return origins, directions.repeated(n), single_origin and single_direction


def checked_points(caller: str, name: str, values) -> np.ndarray:
    """(n, 3) points. Raises InvalidArgument."""
    points, _ = checks.vectors(caller, name, values)
    checks.refuse_rows(caller, name, points, np.abs(points).max(axis=1) > LARGEST, f"exceeds {LARGEST:g}")
    return points


def refuse_unbounded(what: str, shapes) -> None:
    """Raises UnsupportedQuery for half-spaces, and unions with half-spaces, as the moved body."""
    for shape in [shapes] if isinstance(shapes, Shape) else {id(shape): shape for shape in shapes}.values():
        if reach_of(shape) == math.inf:
            raise UnsupportedQuery(
                f"{what}: {type(shape).__name__} has no end and cannot be cast; exchange the shapes and turn the "
                "direction round, or cast a large Box"
            )
