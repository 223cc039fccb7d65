"""What fields are made of, by number: balls of a cloud, boxes of cells of a grid; and the items near another shape.

An item is left out where it is farther from the box around the other shape, along an axis of the items' frame, than the
distance: rounding is added to the box.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from collide.lowering.extents import extent_of
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import bounding_parts_of
from collide.lowering.shape_table import moved_pose
from collide.narrowphase.facets.nearest_item_calls import Items
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.shape import IDENTITY, Shape
from collide.transforms import inverse_pose

#: What rounding of a box's sides is, as a part of the numbers met.
ROUNDING = 2.0**-40
#: Items asked about to begin with, and so many times more each time.
_FIRST_ASKED, _GROWTH = 16, 4
#: Heights over a plane that differ by less than this part of the size are looked at again, item by item.
_LEVEL = 2.0**-36
_AXES = np.concatenate([np.eye(3), -np.eye(3)])
#: Matrices no farther off rotations are rounded rotations; farther off they are inverted.
_ROTATION, _FAR_OFF = 1e-13, 2.0**-10


class BoxAround(NamedTuple):
    """A box along the axes of the items' frame around another shape [m]; infinite around half-spaces.

    stretch : lengths in the items' frame are at most so many times as long as in the world.
    """

    low: np.ndarray
    high: np.ndarray
    stretch: float = 1.0

    def reach(self, distance: Any) -> Any:
        """How far distances of the world, a number or an array, reach in the frame, rounding added [m]."""
        return distance * self.stretch * (1.0 + ROUNDING)


class NamedUnion(NamedTuple):
    """Some items as one shape, in the field's frame.

    numbers : (n,) the number in results for each part: of the item, of the least of ``sizes`` (n, 3) cells, or of the
    facet of terrain.   names_facets : whether parts are facets of a mesh.
    """

    shape: Shape
    numbers: np.ndarray
    sizes: np.ndarray | None = None
    names_facets: bool = False


class FieldItems(ABC):
    """The items of a field.

    X_FG : (4, 4) pose of the frame of the items in the field's.   walked : items with a tree to walk down, or `None`.
    names_are_changed : whether `names_of_walked` are others than the items'.
    is_one_part : whether the union of many items has a single part.   low, high : (3,) box around all items, in their
    frame [m].
    """

    X_FG: np.ndarray = IDENTITY
    walked: Items | None = None
    is_one_part = False
    names_are_changed = False
    low: np.ndarray
    high: np.ndarray

    def pose(self, X_WF: np.ndarray) -> np.ndarray:
        """The pose of the items' frame, rounded."""
        return X_WF if self.X_FG is IDENTITY else X_WF @ self.X_FG

    def poses_of_items(self, X_WF: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses (n, 4, 4) of the items' frame, and how far rounding may move items [m] (n,)."""
        if self.X_FG is IDENTITY:
            return X_WF, np.zeros(1)
        reach = float(np.linalg.norm(np.maximum(np.abs(self.low), np.abs(self.high)))) * (1.0 + 2.0**-50)
        return moved_pose(X_WF, self.X_FG, np.full(len(X_WF), reach))

    @abstractmethod
    def every(self) -> np.ndarray:
        """All numbers, ascending."""

    @abstractmethod
    def within(self, box: BoxAround, distance: float) -> np.ndarray:
        """Numbers of the items that may come within a distance of what is in a box [m], ascending."""

    @abstractmethod
    def on_way(self, way: np.ndarray, limit: float, extra: float, slack: float, first: bool):
        """(numbers, earliest t) of the items on the way of a ball from a place along a vector (6,), by t.

        limit : of t.   extra : radius of the moving ball [m].   slack : of places [m].   first : whether items behind
        an item met for sure may be left out.
        """

    @abstractmethod
    def lowest(self, n: np.ndarray, slack: float) -> np.ndarray:
        """Numbers of the items that are higher along a normal than the lowest by no more than a slack [m],
        ascending.
        """

    def extreme(self, n: np.ndarray, slack: float) -> np.ndarray:
        """Numbers of items as low along a normal as all of `lowest`, maybe fewer, ascending."""
        return self.lowest(n, slack)

    @abstractmethod
    def least_height(self, number: int, n: np.ndarray) -> float:
        """Of an item along a normal [m]."""

    def below(self, n: np.ndarray, height: float) -> np.ndarray:
        """Numbers of the items that reach below a height along a normal [m], ascending."""
        least = self.least_height(int(self.lowest(n, 0.0)[0]), n)
        return self.lowest(n, height - least) if least <= height else np.empty(0, dtype=np.int64)

    @abstractmethod
    def hulls(self, some: np.ndarray) -> list[Any]:
        """Items as shapes in the items' frame: convex hulls, but for the inside of a solid."""

    def some(self) -> np.ndarray:
        """The number of an item."""
        return np.zeros(1, dtype=np.int64)

    def hidden(self, numbers: np.ndarray, p_F: np.ndarray, n_F: np.ndarray) -> np.ndarray:
        """(n,) bool: whether points (n, 3), of surfaces by their numbers in results, lie within the field: what is
        next to each point along a direction (n, 3) is the field again.
        """
        return np.zeros(len(p_F), dtype=bool)

    def union_of(self, some: np.ndarray) -> NamedUnion:
        """Some items as one shape, in the field's frame, item by item."""
        return NamedUnion(as_union(self.hulls(some), self.X_FG), some)

    def merged(self, some: np.ndarray) -> NamedUnion:
        """Some items as one shape of as few parts as may be."""
        return self.union_of(some)

    def name(self, union: NamedUnion, part: np.ndarray, p_F: np.ndarray) -> np.ndarray:
        """What results name for parts (n,) of a union, at points (n, 3) of the field's frame; −1 for −1."""
        return np.where(part < 0, -1, union.numbers[part])

    def names_of_walked(self, rows: np.ndarray, X_WG: np.ndarray) -> np.ndarray:
        """(n,) what results name in place of the items of walks, of their rows at poses (n, 4, 4) of the items."""
        return rows["part_a"]

    def nearest(self, box: BoxAround) -> np.ndarray:
        """Numbers of some items near the middle of a box, among them maybe the nearest; at least one."""
        centre = BoxAround(*np.repeat([0.5 * (box.low + box.high)], 2, axis=0))
        away = np.maximum(np.maximum(self.low - centre.high, centre.low - self.high), 0.0).max()
        distance, step = float(away), 0.01 * float((self.high - self.low).max()) + 2.0**-40 * float(away) + 1e-300
        while True:
            distance, step = distance + step, 2.0 * step
            some = self.within(centre, distance)
            if len(some):
                return some[:1]


def as_union(hulls: list[Any], X: np.ndarray) -> Shape:
    """Shapes at a pose as one shape, whose parts are numbered as these."""
    is_ball = isinstance(hulls[0], ConvexHull) and len(hulls[0].points) == 1  # its only facet has the number 0
    if len(hulls) == 1 and is_ball:
        return hulls[0]
    return Compound([(hull, X) for hull in hulls])


def box_in_frame(shape: Shape, X_WC: np.ndarray, X_WS: np.ndarray) -> BoxAround:
    """The box around a shape at X_WS in the frame at X_WC, (4, 4) each, rounding added.

    A place p of the frame is R⁻¹ (q − t) of a place q of the world. Where RᵀR is within off ≤ 2⁻¹⁰ of the identity, Rᵀ
    stands for R⁻¹, and is wrong by at most 3 off |p|; other matrices are inverted, which rounds by their condition.
    """
    R, t = X_WC[:3, :3], X_WC[:3, 3]
    off, off_s = (float(np.abs(X[:3, :3].T @ X[:3, :3] - np.eye(3)).max()) for X in (X_WC, X_WS))
    inverse, stretch, condition = R.T, 1.0 if off < _ROTATION else 1.0 + 2.0 * off, 1.0
    if off > _FAR_OFF:
        inverse = np.linalg.inv(R)
        stretch = float(np.linalg.norm(inverse))
        condition = stretch * float(np.linalg.norm(R))
    X_CS = np.eye(4)
    X_CS[:3, :3], X_CS[:3, 3] = inverse @ X_WS[:3, :3], inverse @ (X_WS[:3, 3] - t)
    low, high = np.full(3, math.inf), np.full(3, -math.inf)
    for packed, X_SP in bounding_parts_of(shape):
        if packed.kind == HALFSPACE:
            return BoxAround(np.full(3, -math.inf), np.full(3, math.inf))
        X_CP = X_CS @ X_SP
        ends = np.array([extent_of(packed, X_CP, axis) for axis in _AXES]) + packed.radius * (stretch - 1.0)
        low, high = np.minimum(low, -ends[3:]), np.maximum(high, ends[:3])
    size = np.abs(low).max() + np.abs(high).max() + stretch * (np.abs(t).sum() + np.abs(X_WS[:3, 3]).sum())
    slack = (ROUNDING * condition + 8.0 * (0.0 if off > _FAR_OFF else off) + 8.0 * off_s) * size
    return BoxAround(low - slack, high + slack, stretch)


def turned_back(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rᵀ v of vectors (…, 3): products added up in order, each rounded once, as C does."""
    return vectors[..., :1] * R[0] + vectors[..., 1:2] * R[1] + vectors[..., 2:] * R[2]


def items_on_way(
    items: FieldItems, X_WF: np.ndarray, origin: np.ndarray, vector: np.ndarray, limit: float, extra: float,
    *, first: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """`FieldItems.on_way` from an origin along a vector of the world."""
    X_WG = items.pose(X_WF)
    R, t = X_WG[:3, :3], X_WG[:3, 3]
    way = np.concatenate([turned_back(R, origin - t), turned_back(R, vector)])
    return items.on_way(way, limit, extra, rounding_of_places(items, X_WG[None], origin[None], extra), first)


def rounding_of_places(items: FieldItems, X_WG: np.ndarray, p_W: np.ndarray, extra: float = 0.0) -> float:
    """How far any of the places of `rounding_of_each` may be off [m]."""
    return float(rounding_of_each(items, X_WG, p_W, extra).max())


def rounding_of_each(items: FieldItems, X_WG: np.ndarray, p_W: np.ndarray, extra: float = 0.0) -> np.ndarray:
    """(n,) how far places of the world (n, 3) may be off in the items' frame at poses (n, 4, 4) [m].   extra : of what
    is around them."""
    R, t = X_WG[:, :3, :3], X_WG[:, :3, 3]
    size = _reach(items) + np.abs(t).sum(axis=1) + np.abs(p_W).sum(axis=1) + extra
    return (ROUNDING + 8.0 * np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2))) * size


def items_within(
    items: FieldItems, B: Shape, X_WF: np.ndarray, X_WB: np.ndarray, distance: float
) -> np.ndarray:
    """Numbers of items near another shape, ascending: all items within a distance of the shape [m] are among them.
    Items are left out by the box around the shape, or, beside shapes without end, by a half-space around the shape.
    """
    X_WG = items.pose(X_WF)
    parts = bounding_parts_of(B)
    if len(parts) > 1 or parts[0][0].kind != HALFSPACE:
        return items.within(box_in_frame(B, X_WG, X_WB), distance)
    packed, X_BP = parts[0]
    X_GP = inverse_pose(X_WG) @ X_WB @ X_BP
    length = float(np.linalg.norm(packed.params[:3]))
    n = X_GP[:3, :3] @ packed.params[:3] / length
    height = float(packed.params[3]) / length + float(n @ X_GP[:3, 3])
    size = _reach(items) + abs(height) + np.abs(X_WG[:3, 3]).sum() + np.abs(X_WB[:3, 3]).sum() + distance
    off = sum(np.abs(X[:3, :3].T @ X[:3, :3] - np.eye(3)).max() for X in (X_WG, X_WB))
    return items.below(n, height + distance * (1.0 + ROUNDING) + (ROUNDING + 8.0 * off) * size)


def lowest_items(items: FieldItems, n_W: np.ndarray, X_WF: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """Numbers of items that are lowest along a normal of any length above 0, rounding counted in: no item is lower than
    all of these.
    """
    X_WG, n_W = items.pose(X_WF), n_W / np.linalg.norm(n_W)  # heights are in metres, as radii and the level are
    size = _reach(items) + np.abs(X_WF[:3, 3]).sum() + np.abs(X_WB[:3, 3]).sum()
    return items.extreme(X_WG[:3, :3].T @ n_W, _LEVEL * size)


def _reach(items: FieldItems) -> float:
    return float(np.maximum(np.abs(items.low), np.abs(items.high)).sum())


def first_items(numbers: np.ndarray, times: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """(items, when the next is met at the earliest), more and more of them, of items by the time from which they may be
    met: who knows an impact before the next item goes no further.
    """
    n = _FIRST_ASKED
    while len(numbers):
        if n >= len(numbers):
            yield numbers, math.inf
            return
        yield numbers[:n], float(times[n])
        n *= _GROWTH
