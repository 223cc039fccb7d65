"""Compound: the union of posed shapes, for bodies that are not convex."""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidPose, InvalidShape, brief
from collide.shapes.shape import Shape
from collide.transforms import as_pose, as_poses


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
        Where items are empty, or not pairs with a shape first.
    InvalidPose
        Where a pose is not a single (4, 4) rigid transform.

    Notes
    -----
    Nested poses are multiplied out in float64, and every bracket accounts for the rounding. Against a convex shape or
    another compound only pairs of nearby parts are tested: a compound of two parts costs about as much as the parts one
    by one, a compound of more parts less. Making a compound of k parts, and its first query, are O(k log k). Balls
    around whole bodies leave far poses out of contacts, casts and times of impact; balls around groups of parts, and of
    groups, then around the parts, find the pairs to test.
    """

    __slots__ = ("items", "meshed", "poses")
    _fields = ("items",)
    items: tuple[tuple[Shape, np.ndarray], ...]
    #: Whether a mesh is among the items, however deep.
    meshed: bool
    #: (k, 4, 4) the poses X_CS of the items, read-only.
    poses: np.ndarray

    def __init__(self, items):
        try:
            pairs = [(shape, X) for shape, X in items]
        except (TypeError, ValueError):
            raise InvalidShape(
                f"Compound: items must be a sequence of (shape, pose) pairs, got {brief(items)}"
            ) from None
        if not pairs:
            raise InvalidShape(f"Compound: items is empty, {brief(items)}; at least one (shape, pose) is needed")
        poses = _all_checked(pairs)
        if poses is None:
            poses = np.array([_checked_pose(k, shape, X) for k, (shape, X) in enumerate(pairs)])
        poses.flags.writeable = False
        shapes = [shape for shape, _ in pairs]
        self._store(items=tuple(zip(shapes, poses)), meshed=any(shape.meshed for shape in shapes), poses=poses)

    @property
    def convex(self) -> bool:  # type: ignore[override]
        """True for a compound of one convex shape."""
        return len(self.items) == 1 and self.items[0][0].convex

    def _scaled(self, s: np.ndarray) -> Compound:
        """Of an item at (R, t) the image of p is S (R p + t) = (D R D) (D S' p) + S t with D the signs of S, where
        |S| R = R S' for a diagonal S': where the entries other than 0 of each column of R meet equal factors.
        """
        signs, items = np.sign(s), []
        for k, (item, X) in enumerate(self.items):
            R, X_CS = X[:3, :3], X.copy()
            along = np.abs(s)[np.abs(R).argmax(axis=0)]
            turned = np.argwhere((R != 0.0) & (np.abs(s)[:, None] != along))
            if len(turned):
                i, j = turned[0].tolist()
                raise InvalidShape(
                    f"items[{k}] is turned by R[{i}, {j}] = {R[i, j]:g} between axes of unequal factors, which would "
                    "shear it: such an entry must be 0. Scale the points of a ConvexHull or Mesh in the frame of the "
                    "Compound instead"
                )
            X_CS[:3, :3], X_CS[:3, 3] = signs[:, None] * R * signs, s * X[:3, 3]
            items.append((item.scaled(signs * along), X_CS))
        return Compound(items)

    def __repr__(self) -> str:
        return f"Compound(<{len(self.items)} items>)"

    def _key(self) -> tuple:
        return tuple((shape, (X + 0.0).tobytes()) for shape, X in self.items)


def _all_checked(pairs: list) -> np.ndarray | None:
    """The poses of the items, checked together; ``None`` where an item has to be checked alone."""
    for shape, X in pairs:
        if not isinstance(shape, Shape) or shape.is_region or shape.is_field:
            return None
        if X.__class__ is not np.ndarray or X.shape != (4, 4) or X.dtype != np.float64:
            return None
    X_CS = np.array([X for _, X in pairs])
    try:
        as_poses(X_CS)
    except InvalidPose:
        return None
    return X_CS


def _checked_pose(k: int, shape, X) -> np.ndarray:
    if not isinstance(shape, Shape):
        raise InvalidShape(f"Compound: items[{k}] must start with a shape, got {type(shape).__name__}")
    if shape.is_region:
        raise InvalidShape(
            f"Compound: items[{k}] is an HPolytope with bounded=False, or a Plane; make it a body of its own, or close "
            "it by half-spaces far away and leave bounded=False out"
        )
    if shape.is_field:
        raise InvalidShape(f"Compound: items[{k}] is a {type(shape).__name__}; make it a body of its own")
    return as_pose(X, f"Compound: items[{k}] pose")
