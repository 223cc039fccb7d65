"""The shapes that a union comes down to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.shapes.compound import Compound
from collide.shapes.shape import IDENTITY, Shape, kept_with_shape


class Leaf(NamedTuple):
    """A part of a union, itself no union, and its pose (4, 4) in the union."""

    shape: Shape
    X: np.ndarray


def leaves_of(shape: Shape, X_AS: np.ndarray = IDENTITY) -> list[Leaf]:
    """The parts of a union, unions of unions flattened, in order, with their poses (4, 4) in the union."""
    if not isinstance(shape, Compound):
        return [Leaf(shape, X_AS)]
    return leaves_of_union(shape) if X_AS is IDENTITY else _leaves(shape, X_AS)


@kept_with_shape("_leaves")
def leaves_of_union(shape: Compound) -> list[Leaf]:
    return _leaves(shape, IDENTITY)


@kept_with_shape("_meshed_leaves")
def meshed_leaves(shape: Compound) -> np.ndarray:
    """(leaves,) bool: which of them are meshes."""
    return np.array([leaf.shape.meshed for leaf in leaves_of_union(shape)], dtype=bool)


def _leaves(shape: Compound, X_AS: np.ndarray) -> list[Leaf]:
    return [
        leaf for item, X_SI in shape.items for leaf in leaves_of(item, X_SI if X_AS is IDENTITY else X_AS @ X_SI)
    ]
