"""What the collision objects of hosts have in common: a geometry made of collide's shapes, at a pose.

Classes of a host's interface derive from these two; `object_tree.ObjectTree`, and so every host's managers, sees no
more of them than what is here.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from collide.errors import InvalidArgument
from collide.shapes.shape import Shape

#: Counts changes of geometries, so that trees see that boxes around them are old.
_changes = itertools.count(1)
latest_change = [0]
#: Boxes are wider than the bodies by this part of their coordinates, for rounding.
_SLACK = 1e-12


class HostGeometry:
    """Base of a host's geometries; of itself it has no points."""

    #: Lowest and highest corner (2, 3) of a box around it, in its frame; infinite where it has no end.
    _corners: np.ndarray | None = None
    #: Shapes whose common points are the set: one, or of a plane its two half-spaces.
    _shapes: tuple[Shape, ...] = ()
    #: Middle and half lengths of the box as six floats, None without end.
    _box: tuple[float, ...] | None = None

    @property
    def _shape(self) -> Shape:
        if not self._shapes:
            raise InvalidArgument(f"{type(self).__name__} has no facets yet: beginModel, addSubModel, endModel")
        return self._shapes[0]

    def _become(self, corners, *shapes: Shape) -> None:
        low, high = self._corners = np.array(corners, dtype=np.float64)
        is_bounded = np.isfinite(self._corners).all()
        self._box = tuple((0.5 * (low + high)).tolist() + (0.5 * (high - low)).tolist()) if is_bounded else None
        self._shapes = shapes
        latest_change[0] = next(_changes)


class HostObject:
    """A geometry at a pose ``_X`` (4, 4) in the world, changed in place; `_moved` is called after a change."""

    __slots__ = ("__weakref__", "_X", "_geometry", "_watchers")

    _X: np.ndarray
    _geometry: Any
    #: Sets of moved objects, of the trees that this one stands in.
    _watchers: tuple[set, ...]

    def _moved(self) -> None:
        for moved in self._watchers:
            moved.add(self)


def box_of(obj: HostObject) -> np.ndarray:
    """The box (6,) around one posed geometry in the world, low corner first; in floats, which is soonest of one."""
    if obj._geometry._box is None:
        return np.array([-np.inf] * 3 + [np.inf] * 3)
    x, y, z, hx, hy, hz = obj._geometry._box
    low, high = [], []
    for a, b, c, t in obj._X.tolist()[:3]:
        middle = a * x + b * y + c * z + t
        half = abs(a) * hx + abs(b) * hy + abs(c) * hz
        half += _SLACK * (abs(a * x) + abs(b * y) + abs(c * z) + abs(t) + half)
        low.append(middle - half)
        high.append(middle + half)
    return np.array(low + high)


def boxes_of_objects(corners: np.ndarray, X: np.ndarray) -> np.ndarray:
    """The same of many: boxes (n, 6) of corners (n, 2, 3) of geometries and poses (n, 4, 4)."""
    unbounded = ~np.isfinite(corners).all(axis=(1, 2))
    corners = np.where(unbounded[:, None, None], 0.0, corners)
    middles, half_lengths = 0.5 * (corners[:, 0] + corners[:, 1]), 0.5 * (corners[:, 1] - corners[:, 0])
    R, t = X[:, :3, :3], X[:, :3, 3]
    size = np.abs(R)
    middle = (R @ middles[:, :, None])[:, :, 0] + t
    half = (size @ half_lengths[:, :, None])[:, :, 0]
    half += _SLACK * ((size @ np.abs(middles)[:, :, None])[:, :, 0] + np.abs(t) + half)
    half[unbounded] = np.inf
    return np.concatenate([middle - half, middle + half], axis=1)
