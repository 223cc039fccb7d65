"""Compound: the union of posed shapes, for bodies that are not convex."""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidPose, InvalidShape
from collide.lowering.packed_convex import PackedConvex
from collide.shapes.shape import Shape
from collide.transforms import as_poses

#: One product of two poses rounds each coordinate of a point by at most this many units in the
#: last place of its terms: three products and three sums for the rotation, one more for the shift.
_ULPS_PER_PRODUCT = 8
_ULP = 2.0**-53


class Compound(Shape):
    """The union of shapes, each at its own pose.

    Parameters
    ----------
    items : sequence of (Shape, X_CS)
        A shape S and its (4, 4) pose in the compound's frame C, each. Compounds may be nested, and meshes be among
        them.

    Raises
    ------
    InvalidShape
        Where items are no pairs that begin with a shape, or there are none.
    InvalidPose
        Where a pose is not one (4, 4) rigid transform.

    Notes
    -----
    Nested poses are multiplied out in float64, and every bracket accounts for the rounding. Against a convex shape or
    another compound only pairs of parts that come near are tested: a compound costs about as much as its parts one by
    one where it has two, and less the more it has.
    """

    __slots__ = ("items",)
    _fields = __slots__
    items: tuple[tuple[Shape, np.ndarray], ...]

    def __init__(self, items):
        try:
            pairs = [(shape, X) for shape, X in items]
        except (TypeError, ValueError):
            raise InvalidShape("Compound: items must be a sequence of (shape, pose) pairs") from None
        if not pairs:
            raise InvalidShape("Compound: items is empty; at least one (shape, pose) is needed")
        self._store(items=tuple(_check_item(k, shape, X) for k, (shape, X) in enumerate(pairs)))

    @property
    def convex(self) -> bool:  # type: ignore[override]
        """True for a compound of one convex shape."""
        return not self.meshed and len(self.parts()) == 1

    @property
    def meshed(self) -> bool:  # type: ignore[override]
        """Whether a mesh is among the items, however deep."""
        return any(shape.meshed for shape, _ in self.items)

    def __repr__(self) -> str:
        return f"Compound(<{len(self.items)} items>)"

    def _key(self) -> tuple:
        return tuple((shape, (X + 0.0).tobytes()) for shape, X in self.items)

    def _pack(self):
        return tuple(
            _placed(packed, X_CS, X_SP) for shape, X_CS in self.items for packed, X_SP in shape.parts()
        )

    def bounding_parts(self):
        """Convex sets that hold the union: its parts, and for a mesh one hull around it.

        Returns
        -------
        tuple of (PackedConvex, (4, 4) float64)
            As of `parts`.
        """
        if not self.meshed:
            return self.parts()
        if not hasattr(self, "_bounds"):
            placed = ((packed, X_CS, X_SP) for shape, X_CS in self.items for packed, X_SP in shape.bounding_parts())
            self._store(_bounds=tuple(_placed(*part) for part in placed))
        return self._bounds


def _check_item(k: int, shape, X) -> tuple[Shape, np.ndarray]:
    if not isinstance(shape, Shape):
        raise InvalidShape(f"Compound: items[{k}] must start with a shape, got {type(shape).__name__}")
    X = as_poses(X, f"Compound: items[{k}] pose")
    if len(X) != 1:
        raise InvalidPose(f"Compound: items[{k}] pose must be one (4, 4) matrix, got {len(X)}")
    X = X[0].copy()
    X.flags.writeable = False
    return shape, X


def _placed(packed: PackedConvex, X_CS: np.ndarray, X_SP: np.ndarray) -> tuple[PackedConvex, np.ndarray]:
    """A part in the compound's frame, its slop grown by what the product of poses rounds."""
    if np.array_equal(X_SP, np.eye(4)):
        return packed, X_CS
    X_CP = X_CS @ X_SP
    scale = packed.reach + np.abs(X_SP[:3, 3]).sum() + np.abs(X_CS[:3, 3]).max()
    return packed._replace(slop=packed.slop + 2 * _ULPS_PER_PRODUCT * _ULP * scale), X_CP
