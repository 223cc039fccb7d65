"""Depths of bodies that are not convex, made as short as is asked for."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.parts import is_single_convex
from collide.narrowphase.dispatch import Method, method_of
from collide.narrowphase.known_depth import Depth
from collide.pairs.pair_arguments import pose_at, shape_at
from collide.results import flipped
from collide.shapes.shape import Shape

#: Loaded when a least depth is first asked for.
of_unions = lazy_module("collide.narrowphase.composite.least_depth")
of_mesh_unions = lazy_module("collide.narrowphase.composite.least_mesh_depth")
of_facets = lazy_module("collide.narrowphase.facets.least_facet_depth")
#: How depths of bodies that are not convex are searched.
DepthSearch = Literal["quick", "least"]
_DEPTHS = {"quick": False, "least": True}


def checked_depth(depth: Any) -> bool:
    """Whether the least depth is asked for. Raises InvalidArgument."""
    if not isinstance(depth, str) or depth not in _DEPTHS:
        raise InvalidArgument(f'depth must be "quick" or "least", got {checks.brief(depth)}')
    return _DEPTHS[depth]


def shorten_depths(rows: np.ndarray, A, B, X_WA: np.ndarray, X_WB: np.ndarray) -> None:
    """Make depths of rows (n,) of overlapping unions and solids the least ones known, in place; shapes and poses as of
    `distance`."""
    for k in np.flatnonzero((rows["upper"] <= 0.0) & (rows["lower"] < 0.0) & np.isfinite(rows["lower"])).tolist():
        shapes = shape_at(A, k), shape_at(B, k)
        method = method_of(*map(kind_of, shapes))
        if method is Method.FACETS:
            search = of_facets
        elif method in (Method.CURVED, Method.MESH_PARTS):
            search = of_mesh_unions
        elif not any(shape.meshed for shape in shapes) and not all(map(is_single_convex, shapes)):
            search = of_unions
        else:
            continue
        rows[k : k + 1] = _shortened(search, rows[k : k + 1], *shapes, pose_at(X_WA, k), pose_at(X_WB, k))


def _shortened(search, row: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """A row (1,) with the least depth known; of swapped bodies the same, flipped.

    search : a module with ``key_of``, to order bodies by, and ``least_depth``.
    """
    if (search.key_of(B), X_WB.tolist()) < (search.key_of(A), X_WA.tolist()):
        return flipped(_shortened(search, flipped(row), B, A, X_WB, X_WA))
    distance, lower, upper = (float(row[name][0]) for name in ("distance", "lower", "upper"))
    known = Depth(-distance, -lower, row["normal"][0].copy(), -upper)
    depth = search.least_depth(A, B, X_WA, X_WB, known)
    if depth is known:
        return row
    row = row.copy()
    row["upper"], row["lower"] = -depth.least, -depth.proven
    row["distance"], row["normal"] = min(-depth.length, -depth.least), depth.normal + 0.0
    middle, half = 0.5 * (row["point_a"] + row["point_b"]), 0.5 * row["distance"] * row["normal"]
    row["point_a"], row["point_b"] = middle - half, middle + half
    return row
