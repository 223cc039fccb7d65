"""coal's small things: lists under their C++ names, `Triangle`, and `AABB` with what is done with boxes."""

from __future__ import annotations

import numpy as np

from collide.adapters.hosts.host_numbers import of_kind, real, shaped, whole
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument


class _StdVec(list):
    """A list under the name that coal has for it in Python; a list does wherever one is taken."""

    def reserve(self, new_cap):
        """Nothing to do: lists grow by themselves."""

    def tolist(self, deep_copy=False):
        """A list of the same items, or of copies of them."""
        return [item.copy() if deep_copy and hasattr(item, "copy") else item for item in self]

    def copy(self):
        """One like it, with the same items."""
        return type(self)(self)


class StdVec_Vec3s(_StdVec):
    """Points (3,)."""

    def append(self, value):
        """value : (3,)."""
        super().append(shaped("a point", value, (3,)).copy())


class StdVec_Vec6(_StdVec):
    """Vectors (6,)."""


class StdVec_Triangle(_StdVec):
    """Of `Triangle`."""


class StdVec_Contact(_StdVec):
    """Of `Contact`."""


class StdVec_ContactPatch(_StdVec):
    """Of `ContactPatch`."""


class StdVec_CollisionRequest(_StdVec):
    """Of `CollisionRequest`."""


class StdVec_CollisionResult(_StdVec):
    """Of `CollisionResult`."""


class StdVec_ContactPatchRequest(_StdVec):
    """Of `ContactPatchRequest`."""


class StdVec_ContactPatchResult(_StdVec):
    """Of `ContactPatchResult`."""


class StdVec_DistanceRequest(_StdVec):
    """Of `DistanceRequest`."""


class StdVec_DistanceResult(_StdVec):
    """Of `DistanceResult`."""


class Triangle:
    """Three rows of a model's vertices."""

    __slots__ = ("_rows",)

    def __init__(self, p1=0, p2=0, p3=0):
        self.set(p1, p2, p3)

    def set(self, p1, p2, p3):
        """Rows of its corners."""
        self._rows = (whole("p1", p1), whole("p2", p2), whole("p3", p3))

    @staticmethod
    def size():
        """3."""
        return 3

    def __getitem__(self, k):
        return self._rows[k]

    def __len__(self):
        return 3

    def __eq__(self, other):
        return isinstance(other, Triangle) and self._rows == other._rows

    __hash__ = object.__hash__

    def __repr__(self):
        return f"Triangle{self._rows}"


def triangle_rows(triangles) -> np.ndarray:
    """(m, 3) int64 of a list of `Triangle`, or an array of integers. Raises InvalidArgument."""
    rows = checks.plain_array(
        "triangles", [tuple(triangle) for triangle in triangles], "(m, 3)", InvalidArgument
    )
    if not len(rows):
        return np.zeros((0, 3), dtype=np.int64)
    if rows.ndim != 2 or rows.shape[1] != 3 or rows.dtype.kind not in "iu":
        raise InvalidArgument(f"triangles must be integers (m, 3), got {rows.dtype} {rows.shape}")
    return rows.astype(np.int64)


class AABB:
    """A box along the axes, from ``min_`` (3,) to ``max_`` (3,) [m]; without arguments one that holds nothing.

    ``AABB(v)``, a point; ``AABB(a, b)``, ``AABB(a, b, c)``, around points; ``AABB(box)``; ``AABB(box, delta)``, grown
    by delta (3,) on each side.
    """

    def __init__(self, *args):
        largest = np.full(3, np.finfo(float).max)
        corners = np.array([largest, -largest])
        if args and isinstance(args[0], AABB):
            corners = np.array([args[0].min_, args[0].max_])
            if len(args) == 2:
                delta = shaped("delta", args[1], (3,))
                corners += [-delta, delta]
        elif args:
            points = np.array([shaped("v", v, (3,)) for v in args])
            corners = np.array([points.min(axis=0), points.max(axis=0)])
        self.min_, self.max_ = corners

    def contain(self, other):
        """Whether a point (3,), or another box, lies within it."""
        low, high = (other.min_, other.max_) if isinstance(other, AABB) else (shaped("p", other, (3,)),) * 2
        return bool((self.min_ <= low).all() and (high <= self.max_).all())

    def overlap(self, other, overlapping_part=None):
        """Whether the boxes share a point; the box that they share goes into ``overlapping_part``."""
        of_kind("other", other, AABB)
        low, high = np.maximum(self.min_, other.min_), np.minimum(self.max_, other.max_)
        meets = bool((low <= high).all())
        if meets and overlapping_part is not None:
            overlapping_part.min_, overlapping_part.max_ = low, high
        return meets

    def distance(self, other):
        """Least distance to another box, 0 where they meet [m]."""
        of_kind("other", other, AABB)
        apart = np.maximum(0.0, np.maximum(other.min_ - self.max_, self.min_ - other.max_))
        return float(np.linalg.norm(apart))

    def center(self):
        """The middle (3,)."""
        return 0.5 * (self.min_ + self.max_)

    def width(self):
        """Along x."""
        return float(self.max_[0] - self.min_[0])

    def height(self):
        """Along y."""
        return float(self.max_[1] - self.min_[1])

    def depth(self):
        """Along z."""
        return float(self.max_[2] - self.min_[2])

    def volume(self):
        """[m³]."""
        return self.width() * self.height() * self.depth()

    def size(self):
        """The volume, as coal has it."""
        return self.volume()

    def expand(self, *args):
        """``expand(delta)`` grows it on each side by a length or (3,), ``expand(box, ratio)`` becomes what ``ratio``
        times this less ``box`` gives, corner by corner, as in coal; returns itself.
        """
        if len(args) == 2:
            box, ratio = of_kind("box", args[0], AABB), real("ratio", args[1])
            self.min_, self.max_ = ratio * self.min_ - box.min_, ratio * self.max_ - box.max_
        else:
            delta = real("delta", args[0]) if np.isscalar(args[0]) else shaped("delta", args[0], (3,))
            self.min_, self.max_ = self.min_ - delta, self.max_ + delta
        return self

    def __add__(self, other):
        return _around(self, other if isinstance(other, AABB) else AABB(other))

    def __iadd__(self, other):
        joined = self + other
        self.min_, self.max_ = joined.min_, joined.max_
        return self

    def __eq__(self, other):
        return isinstance(other, AABB) and bool((self.min_ == other.min_).all() and (self.max_ == other.max_).all())

    __hash__ = object.__hash__


def _around(a: AABB, b: AABB) -> AABB:
    box = AABB()
    box.min_, box.max_ = np.minimum(a.min_, b.min_), np.maximum(a.max_, b.max_)
    return box


def translate(aabb, t):
    """The box moved by t (3,)."""
    box = AABB(aabb)
    t = shaped("t", t, (3,))
    box.min_, box.max_ = box.min_ + t, box.max_ + t
    return box


def rotate(aabb, R):
    """The box around a box turned by R (3, 3)."""
    R = shaped("R", R, (3, 3))
    corners = np.array([[(aabb.min_, aabb.max_)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]) @ R.T
    return AABB(corners.min(axis=0), corners.max(axis=0))
