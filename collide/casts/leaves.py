"""The shapes that a union comes down to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.shapes.compound import Compound
from collide.shapes.shape import IDENTITY, Shape


class Leaf(NamedTuple):
    """A part of a union, itself no union, and its pose (4, 4) in the union."""

    shape: Shape
    X: np.ndarray


def leaves_of(shape: Shape, X_AS: np.ndarray = IDENTITY) -> list[Leaf]:
    """The parts of a union, unions of unions flattened, in order, with their poses (4, 4) in the union."""
    if not isinstance(shape, Compound):
        return [Leaf(shape, X_AS)]
    return [
        leaf for item, X_SI in shape.items for leaf in leaves_of(item, X_SI if X_AS is IDENTITY else X_AS @ X_SI)
    ]
