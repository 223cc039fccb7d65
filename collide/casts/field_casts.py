"""Casts of and onto fields: the items that a body may meet on its way, the first of them first, as unions."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from collide.casts.convex_casts import CastRows, nothing_met
from collide.casts.directions import Directions
from collide.lowering.closed_regions import reach_of
from collide.narrowphase.fields.field_items import FieldItems, first_items, items_on_way, lowest_items
from collide.narrowphase.fields.items_of import items_of
from collide.pairs.pair_arguments import pose_at
from collide.shapes.primitives import Halfspace
from collide.shapes.shape import Shape

#: What casts two other shapes: ``cast(A, B, X_WA, X_WB, directions, limits)``.
Cast = Callable[..., CastRows]


def field_casts(
    cast: Cast, A, B, X_WA: np.ndarray, X_WB: np.ndarray, directions: Directions, limits: np.ndarray
) -> CastRows:
    """First contacts of n casts, where fields move or stand; items are items of fields.

    cast : what answers other shapes; further arguments as of `cast_batch`.
    """
    out = nothing_met(len(limits))
    for k in range(len(limits)):
        shapes = [S if isinstance(S, Shape) else S[k] for S in (A, B)]
        poses = [np.ascontiguousarray(pose_at(X, k)) for X in (X_WA, X_WB)]
        of_k = Directions(directions.vectors[k : k + 1], directions.exponents[k : k + 1])
        for column, values in zip(out, _first_contact(cast, shapes, poses, of_k, limits[k : k + 1])):
            column[k] = values[0]
    return out


def _first_contact(cast: Cast, shapes: list, poses: list, direction: Directions, limit: np.ndarray) -> CastRows:
    side = next((side for side in (1, 0) if shapes[side].is_field), None)
    X = [pose[None] for pose in poses]
    if side is None:
        return cast(*shapes, *X, direction, limit)
    items, B = items_of(shapes[side]), shapes[1 - side]
    numbers, times = _items_met(items, B, poses[side], poses[1 - side], direction.vectors[0], limit[0], side)
    rows = nothing_met(1)
    for some, next_time in first_items(numbers, times):
        union = items.union_of(some)
        pair = [union.shape, B] if side == 0 else [B, union.shape]
        rows = _first_contact(cast, pair, poses, direction, limit)
        met = rows.item_a if side == 0 else rows.item_b
        if not union.names_facets:  # of a mesh casts name the mesh
            met[rows.hit] = union.numbers[met[rows.hit]]
        if rows.hit[0] and rows.proven[0] and rows.t[0, 2] < next_time:
            break
    return rows


def _items_met(
    items: FieldItems, B: Shape, X_WF: np.ndarray, X_WB: np.ndarray, vector: np.ndarray, limit: float, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """(numbers, earliest t) of the items that B may meet.   side : 0 where the field moves, 1 where the field
    stands.
    """
    if isinstance(B, Halfspace):
        some = lowest_items(items, X_WB[:3, :3] @ B.normal, X_WF, X_WB)
        return some, np.zeros(len(some))
    way = -vector if side == 0 else vector
    reach = reach_of(B)
    if not reach < math.inf:
        return items.every(), np.zeros(len(items.every()))
    return items_on_way(items, X_WF, X_WB[:3, 3], way, float(limit), reach)
