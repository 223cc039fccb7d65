"""Casts of two unions of convex parts from Python, one at a time through the kernel of `union_cast.py`."""

from __future__ import annotations

import numpy as np

from collide.casts.cast_pairs import cast_pairs
from collide.casts.convex_casts import CastRows, nothing_met
from collide.casts.directions import Directions
from collide.casts.silhouette import CAST_DOUBLES, CAST_INTEGERS
from collide.casts.union_cast import (
    AT_START,
    ITEM_A,
    ITEM_B,
    OUT_NORMAL,
    OUT_POINT,
    T_UPPER,
    UNION_ROW,
    UNION_WORK,
    T,
    cast_single_union,
)
from collide.kernels import address_of, code_of
from collide.lowering.compound_layout import is_flat, layout_of
from collide.lowering.compound_table import CompoundTable
from collide.lowering.kind_of_shape import kind_of
from collide.narrowphase.composite.balls_on_ways import SingleWay, is_array
from collide.narrowphase.composite.composite import single_header
from collide.narrowphase.convex_batches import prepare_parts
from collide.narrowphase.dispatch import Method, method_of
from collide.narrowphase.prepared_pairs import kept_pair, single_calls_are_safe
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape


class UnionWay(SingleWay):
    """Single casts of two unions of convex parts; the parts' tables and the workspace are held."""

    __slots__ = ("_header", "_held")

    def __init__(self, A: Shape, B: Shape, table: CompoundTable):
        super().__init__(layout_of(A).ball, layout_of(B).ball)
        composite, space = single_header(table)
        work, doubles, integers = np.zeros(UNION_WORK), np.zeros(CAST_DOUBLES), np.zeros(CAST_INTEGERS, dtype=np.int64)
        self._held = table, space, work, doubles, integers
        self._header = np.array([
            code_of(cast_pairs), address_of(doubles), address_of(integers), address_of(work), *composite.tolist()
        ])

    def first_contact(self, X_WA: np.ndarray, X_WB: np.ndarray, vector: np.ndarray, limit: float) -> np.ndarray | None:
        """The kernel's answer (UNION_ROW,), empty where A meets nothing, or ``None``: to be asked as of a batch.

        X_WA, X_WB, vector : as kernels read them.
        """
        row = np.empty(UNION_ROW)
        at = address_of(X_WA), address_of(X_WB), address_of(vector)
        status = cast_single_union(address_of(self._header), *at, limit, address_of(row))
        return None if status < 0 else row[: UNION_ROW * status]

    def single_contact(self, X_WA, X_WB, direction_W, limit: float) -> np.ndarray | None:
        row = super().single_contact(X_WA, X_WB, direction_W, limit)  # soonest where bodies are far from each other
        is_read = row is None and is_array(X_WA, (4, 4)) and is_array(X_WB, (4, 4)) and is_array(direction_W, (3,))
        return self.first_contact(X_WA, X_WB, direction_W, limit) if is_read else row


def prepare_way(A: Shape, B: Shape) -> SingleWay | None:
    """Have casts of a union and another body look at balls around bodies, and of unions of convex parts at the parts'
    balls: the pair's way, or ``None`` of other shapes."""
    is_union = isinstance(A, Compound) or isinstance(B, Compound)
    if not is_union or B.is_region or not single_calls_are_safe():
        return None
    pair = kept_pair(A, B)
    if pair.cast is None:
        if method_of(kind_of(A), kind_of(B)) is Method.PARTS and is_flat(A) and is_flat(B):
            if pair.table is None:
                pair.take(prepare_parts(A, B))
            # Not of too many parts for single calls, nor of a part each.
            if pair.distance is not None and isinstance(pair.table, CompoundTable):
                pair.cast = UnionWay(A, B, pair.table)
        if pair.cast is None:
            pair.cast = SingleWay(layout_of(A).ball, layout_of(B).ball)
    return pair.cast


def cast_by_kernel(
    way: UnionWay, X_WA: np.ndarray, X_WB: np.ndarray, directions: Directions, limits: np.ndarray
) -> tuple[CastRows, np.ndarray]:
    """(rows of n casts, numbers of those left open by the kernel)."""
    n = len(limits)
    rows, is_open = nothing_met(n), []
    for k in range(n):
        X, Y = (poses[k if len(poses) > 1 else 0] for poses in (X_WA, X_WB))
        row = way.first_contact(X, Y, directions.vectors[k], float(limits[k]))
        if row is None:
            is_open.append(k)
        elif len(row):
            rows.hit[k] = True
            rows.t[k] = row[T : T_UPPER + 1]
            rows.normal[k], rows.point[k] = row[OUT_NORMAL : OUT_NORMAL + 3], row[OUT_POINT : OUT_POINT + 3]
            rows.item_a[k], rows.item_b[k], rows.at_start[k] = row[ITEM_A], row[ITEM_B], row[AT_START]
    return rows, np.array(is_open, dtype=np.int64)
