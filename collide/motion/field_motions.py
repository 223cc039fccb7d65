"""Times of impact of fields: the items that a body may meet on its way, the first of them first, as unions."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from collide.lowering.closed_regions import reach_of
from collide.motion.convex_impact import CONTACT, FREE
from collide.motion.impact_rows import free_rows
from collide.motion.motions import Motions
from collide.narrowphase.fields.field_items import FieldItems, first_items, items_on_way
from collide.narrowphase.fields.items_of import items_of
from collide.shapes.shape import Shape

#: What answers other shapes: ``answer(A, B, motions)``, a row of `IMPACT_DTYPE` for one motion.
Answer = Callable[[Shape, Shape, Motions], np.ndarray]


def field_impacts(answer: Answer, shapes: list[Shape], a: np.ndarray, b: np.ndarray, motions: Motions) -> np.ndarray:
    """Rows of `IMPACT_DTYPE` of motions with fields; parts of fields are numbers of items.

    shapes : distinct.   a, b : (n,) numbers of the shapes A and B, motion by motion.
    """
    rows = free_rows(len(a))
    for k, (i, j) in enumerate(zip(a.tolist(), b.tolist())):
        some = np.array([k])
        rows[k : k + 1] = _first_impact(answer, shapes[i], shapes[j], motions.picked(some).spread(1))
    return rows


def _first_impact(answer: Answer, A: Shape, B: Shape, motions: Motions) -> np.ndarray:
    side = next((side for side, shape in ((1, B), (0, A)) if shape.is_field), None)
    if side is None:
        return answer(A, B, motions)
    field, body, name = (A, B, "part_a") if side == 0 else (B, A, "part_b")
    items, row = items_of(field), free_rows(1)
    for some, next_time in first_items(*_items_met(items, body, motions if side == 0 else motions.swapped())):
        union = items.union_of(some)
        row = _first_impact(answer, *((union.shape, B) if side == 0 else (A, union.shape)), motions)
        if row["status"][0] != FREE:
            row[name] = union.numbers[row[name]]
            if row["status"][0] == CONTACT and row["upper"][0] < next_time:
                break
    return row


def _items_met(items: FieldItems, B: Shape, motions: Motions) -> tuple[np.ndarray, np.ndarray]:
    """(numbers, earliest time) of the items on B's way, the field being A: all items where the field turns.

    Without a turn B's origin moves on a line of the field's frame.
    """
    X0, X1, Y0, Y1 = (X[0] for X in motions[:4])
    omega, reach = motions.omega_WA, reach_of(B)
    turns = not np.array_equal(X0[:3, :3], X1[:3, :3]) or (omega is not None and bool(np.any(omega)))
    if turns or not reach < math.inf:
        every = items.every()
        return every, np.zeros(len(every))
    vector = (Y1[:3, 3] - X1[:3, 3]) - (Y0[:3, 3] - X0[:3, 3])
    size = sum(float(np.abs(X[:3, 3]).sum()) for X in (X0, X1, Y0, Y1))
    if not np.abs(vector).max() > 2.0**-40 * size:  # no way worth the name
        vector, reach = np.array([1.0, 0.0, 0.0]), reach + float(np.abs(vector).sum()) + 1.0
        numbers, _ = items_on_way(items, X0, Y0[:3, 3], vector, 0.0, reach)
        return np.sort(numbers), np.zeros(len(numbers))
    return items_on_way(items, X0, Y0[:3, 3], vector, 1.0, reach + 2.0**-40 * size)
