"""What pair queries and worlds ask of a pair of shapes with a mesh in it: unions, or two single bodies."""

from __future__ import annotations

import math

import numpy as np

from collide.lowering.composite_parts import is_union
from collide.narrowphase.composite.composite_meshes import union_rows, union_states
from collide.narrowphase.convex_bodies import convex_hits, convex_rows
from collide.narrowphase.facets.mesh_hits import APART, OPEN
from collide.narrowphase.facets.mesh_rows import mesh_rows, mesh_states
from collide.narrowphase.fallback_searches import lay_points_apart
from collide.results import UNDECIDED
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape


def pair_hits(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool for poses (n, 4, 4): whether two shapes, a mesh among them or in one, share a point; True where open."""
    return _states(A, B, X_WA, X_WB, open_ones=False) != APART


def pair_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4): what `pair_hits` says, and whether that is proven."""
    return _states(A, B, X_WA, X_WB, open_ones=True)


def _states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, open_ones: bool) -> np.ndarray:
    if is_union(A) or is_union(B):
        states = union_states(A, B, X_WA, X_WB, open_ones=open_ones)
    else:
        states = mesh_states(A, B, X_WA, X_WB)
    left = np.flatnonzero(states == OPEN)
    covers = _covers(A, B) if len(left) else None  # a mesh's hull is made when it is first needed
    if covers is not None:
        states[left[~convex_hits(*covers, _some(X_WA, left), _some(X_WB, left))]] = APART
    return states


def pair_rows(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool = True) -> np.ndarray:
    """Rows (PAIR_DTYPE) for poses (n, 4, 4); limit, depths as in `distance`.

    part_a, part_b : of a `Compound` the number of its part, in the order of its items, nested ones in their place; of
    any other shape the facet.
    """
    rows_of = union_rows if is_union(A) or is_union(B) else mesh_rows
    rows = rows_of(A, B, X_WA, X_WB, limit=limit, depths=depths)
    left = np.flatnonzero(rows["how"] == UNDECIDED)
    covers = _covers(A, B) if len(left) else None
    if covers is not None:
        told = convex_rows(*covers, _some(X_WA, left), _some(X_WB, left), depths=False)
        apart = told["lower"] > 0.0
        _part(rows, left[apart], told[apart], limit)
    return rows


def convex_cover(shape: Shape) -> Shape | None:
    """What holds the shape and is made of convex parts, where there is such: the convex engine settles what facets leave
    open, since integers give it the last digits, and takes the poses of parts without rounding them."""
    if isinstance(shape, Mesh):
        return shape.convex_hull
    return None if shape.meshed else shape


def _covers(A: Shape, B: Shape) -> tuple[Shape, Shape] | None:
    one, other = convex_cover(A), convex_cover(B)
    return None if one is None or other is None else (one, other)


def _some(X: np.ndarray, which: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(X[which])


def _part(rows: np.ndarray, at: np.ndarray, told: np.ndarray, limit: float) -> None:
    """Make open rows gaps, in place, as their covers are proven to be apart."""
    row = rows[at]
    row["hit"], row["how"], row["normal"] = False, told["how"], told["normal"]
    row["lower"] = told["lower"]
    row["beyond"] = row["lower"] > limit
    row["certified"] = row["beyond"]
    upper = np.maximum(row["upper"], row["lower"])
    row["distance"] = np.where(row["beyond"], row["lower"], np.clip(told["distance"], row["lower"], upper))
    row["upper"] = np.where(row["beyond"], math.inf, upper)
    lay_points_apart(row, np.arange(len(row)))
    rows[at] = row
