"""Contacts of fields: of the items within the margin, as a union; a face between two cells has no contact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.contact.contact_rows import no_rows
from collide.narrowphase.fields.field_items import items_within, turned_back
from collide.narrowphase.fields.items_of import items_of
from collide.pairs.pair_arguments import pose_at
from collide.shapes.shape import Shape

#: Rows of a pair: ``rows_of(A, B, X_WA, X_WB)``, poses (1, 4, 4).
RowsOf = Callable[[Shape, Shape, np.ndarray, np.ndarray], np.ndarray]


def field_contacts(
    rows_of: RowsOf, A, B, X_WA: np.ndarray, X_WB: np.ndarray, n: int, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of n pairs, in some of which a field stands; parts of fields are numbers of items.

    rows_of : what answers two other shapes.   A, B : shapes, or sequences of n.   X_WA, X_WB : checked.
    """
    pieces = []
    for k in range(n):
        shapes = [S if isinstance(S, Shape) else S[k] for S in (A, B)]
        poses = [np.ascontiguousarray(pose_at(X, k)) for X in (X_WA, X_WB)]
        pieces.append(_contacts_of(rows_of, shapes, poses, margin))
    rows = np.concatenate(pieces) if pieces else no_rows()
    return rows, np.cumsum([len(piece) for piece in pieces])


def _contacts_of(rows_of: RowsOf, shapes: list, poses: list, margin: float) -> np.ndarray:
    fields = []
    for side in range(2):
        field, B = shapes[side], shapes[1 - side]
        if field.is_field:
            items = items_of(field)
            some = items_within(items, B, poses[side], poses[1 - side], margin)
            if not len(some):
                return no_rows()
            union = items.merged(some)
            fields.append((side, items, union))
            shapes[side] = union.shape
    rows = rows_of(*shapes, *(X[None] for X in poses)).copy()  # a single call's rows may be read-only
    keep = np.ones(len(rows), dtype=bool)
    for side, items, union in fields:
        part, point = ("part_a", "point_a") if side == 0 else ("part_b", "point_b")
        X_WF, outwards = poses[side], rows["normal"] if side == 0 else -rows["normal"]
        p_F, n_F = turned_back(X_WF[:3, :3], rows[point] - X_WF[:3, 3]), turned_back(X_WF[:3, :3], outwards)
        name = f"facet{part[-2:]}" if union.names_facets else part
        if union.names_facets:  # corners and edges have numbers in the mesh made for this question
            rows[f"feature{part[-2:]}"] = -1
        rows[name] = items.name(union, rows[name], p_F)
        keep &= ~items.hidden(rows[name], p_F, n_F)
    return rows[keep] if keep.any() else rows
