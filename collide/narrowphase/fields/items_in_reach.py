"""The items of a field within reach of a moving body, as a single shape."""

from __future__ import annotations

import numpy as np

from collide.lowering.parts import bounding_parts_of
from collide.narrowphase.fields.field_items import items_within
from collide.narrowphase.fields.items_of import items_of
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape

#: Items of which a shape is made at most; pairs of its parts and the body's; never fewer parts than the last.
_MAX_ITEMS, _MAX_PAIRS, _FEWEST = 8192, 512, 24


def union_in_reach(field: Shape, B: Shape, X_WF: np.ndarray, X_WB: np.ndarray, length: float) -> tuple[Shape, bool]:
    """(a shape within the field, in the field's frame; whether B, moved by no more than a length [m], meets the shape
    exactly where B meets the field).

    X_WF, X_WB : (4, 4) poses. The shape is the union of all items within the length of the box around B, of very many
    items every k-th: a lower bound of the union's depth is a lower bound of the field's in any case.
    """
    items = items_of(field)
    some = items_within(items, B, X_WF, X_WB, length)
    step = 1 if items.is_one_part else -(-len(some) // _MAX_ITEMS)
    union = items.merged(some[::step]).shape
    n_parts = len(union.items) if isinstance(union, Compound) else 1
    max_parts = _FEWEST if B.is_field else max(_FEWEST, _MAX_PAIRS // len(bounding_parts_of(B)))
    if isinstance(union, Compound) and n_parts > max_parts:
        return Compound(union.items[:: -(-n_parts // max_parts)]), False
    return union, step == 1
