"""The support tree of a shape's points, built when a query first needs it and kept with the shape."""

from __future__ import annotations

import numpy as np

from collide.base.fork_safe_lock import ForkSafeLock
from collide.base.log import log_duration
from collide.hull.exact_hull import convex_hull
from collide.support.build_support_tree import build_support_tree
from collide.support.support_tree import SupportTree

#: A hull of fewer vertices is scanned, too, however many points there are.
MIN_VERTICES = 32


class LazySupportTree:
    """A support tree that is built when its address is first asked for.   points : (n, 3)."""

    def __init__(self, points: np.ndarray):
        self._points = points
        self._tree: SupportTree | None = None
        self._too_small = False

    @property
    def tree(self) -> SupportTree | None:
        """The tree; None where the hull has too few vertices."""
        if self._tree is None and not self._too_small:
            with _build_lock():
                if self._tree is None and not self._too_small:
                    with log_duration("support tree of a hull of %d points made", len(self._points)):
                        self._tree = _built(self._points)
                    self._too_small = self._tree is None
        return self._tree

    @property
    def address(self) -> int:
        """What kernels take: the tree's address, 0 without a tree."""
        return self.tree.address if self.tree is not None else 0


#: Held while a tree is built: one at a time, since a tree of 100,000 points is a matter of a second.
_build_lock = ForkSafeLock()


def _built(points: np.ndarray) -> SupportTree | None:
    hull = convex_hull(points)
    if hull.dimension < 2 or len(hull.vertices) < MIN_VERTICES:
        return None
    try:
        return build_support_tree(points, hull.vertices, hull.facets)
    except ValueError:  # a hull so degenerate that no order of neighbours is certain: it is scanned
        return None
