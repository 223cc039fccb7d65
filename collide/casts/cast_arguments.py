"""Arguments of casts as callers hand them in: directions, rays, points, shapes that can be moved."""

from __future__ import annotations

import math

import numpy as np

from collide.base import argument_checks as checks
from collide.casts.directions import LONGEST, MIN_RATIO, SHORTEST, Directions, scale_directions
from collide.errors import UnsupportedQuery
from collide.kernels import address_of
from collide.lowering.closed_regions import reach_of
from collide.shapes.shape import Shape
from collide.transforms import LARGEST


def checked_directions(caller: str, name: str, values, thing: str) -> tuple[Directions, bool]:
    """(directions, whether a single one was handed in). Raises InvalidArgument.

    thing : "a ray", for messages.
    """
    values_read, single = checks.vectors(caller, name, values)
    n = len(values_read)
    scaled, exponents = np.empty((n, 3)), np.empty(n, dtype=np.int64)
    if scale_directions(address_of(values_read), n, address_of(scaled), address_of(exponents)) < n:
        sizes = np.abs(values_read).max(axis=1)
        checks.refuse_rows(caller, name, values_read, sizes == 0.0, f"has length 0: {thing} needs a direction")
        complaint = f"has no component within [{SHORTEST:g}, {LONGEST:g}]"
        checks.refuse_rows(caller, name, values_read, (sizes < SHORTEST) | (sizes > LONGEST), complaint)
        thin = (values_read != 0.0) & (np.abs(values_read) < MIN_RATIO * sizes[:, None])
        complaint = "has components that differ by more than 2^500; make them 0"
        checks.refuse_rows(caller, name, values_read, thin.any(axis=1), complaint)
    return Directions(scaled, exponents), single


def checked_rays(caller: str, origins_W, directions_W, **counts: int) -> tuple[np.ndarray, Directions, bool]:
    """((n, 3) origins, n directions, whether a single ray was handed in).

    counts : lengths of other arguments that go with the rays. Raises InvalidArgument.
    """
    origins, single_origin = checks.vectors(caller, "origins_W", origins_W)
    directions, single_direction = checked_directions(caller, "directions_W", directions_W, "a ray")
    _refuse_far(caller, "origins_W", origins)
    n = checks.matched_count(caller, **counts, origins_W=len(origins), directions_W=len(directions.vectors))
    origins = origins if len(origins) == n else np.ascontiguousarray(np.broadcast_to(origins, (n, 3)))
    return origins, directions.repeated(n), single_origin and single_direction


def checked_points(caller: str, name: str, values) -> np.ndarray:
    """(n, 3) points. Raises InvalidArgument."""
    points, _ = checks.vectors(caller, name, values)
    _refuse_far(caller, name, points)
    return points


def _refuse_far(caller: str, name: str, points: np.ndarray) -> None:
    sizes = np.abs(points)
    if sizes.max(initial=0.0) > LARGEST:
        checks.refuse_rows(caller, name, points, sizes.max(axis=1) > LARGEST, f"exceeds {LARGEST:g}")


def refuse_unbounded(what: str, shapes) -> None:
    """Raises UnsupportedQuery for half-spaces, and unions with half-spaces, as the moved body."""
    for shape in [shapes] if isinstance(shapes, Shape) else {id(shape): shape for shape in shapes}.values():
        if reach_of(shape) == math.inf:
            raise UnsupportedQuery(
                f"{what}: {type(shape).__name__} has no end and cannot be cast; exchange the shapes and turn the "
                "direction round, or cast a large Box"
            )
