"""When two meshes in motion are proven to meet by a facet's point of either inside the other, a solid.

Facets prove a meeting where they cross clear of rounding. Facets of bodies coming together flush, face in face and edge
on edge, never do: they touch, or lie in the same plane. The proof is then a point of a facet, its centre, inside the
other body:

    distance from all facets > e,   and they wind around it once or more,   at the poses as computed,

where e bounds how far the true point and facets are from the computed poses. Moved in a line to their true places,
facets never pass the point, so they still wind around the point as often. Points of a facet belong to a body, solid or
not; only the other body must be a solid.

A centre is enough where bodies come together flush: where two faces lie on each other, a border of the common region
inside either face is crossed by facets of the other body. Where no border is crossed, the region is a whole face of
both, and the centres of its facets are within it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.base.poses_at import poses_at
from collide.lowering.facet_bodies import body_of
from collide.mesh.bvh import MeshTree
from collide.narrowphase.facets.facet_queries import points_in_solid, surface_distances
from collide.narrowphase.facets.winding_numbers import INSIDE
from collide.shapes.convex_hull import ConvexHull

#: Times asked behind the last one that is free [unit time]. The first few are enough where bodies come together at some
#: thousandths of their size in unit time, or faster.
_LATER = 2.0**-44 * 8.0 ** np.arange(15)
_AT_FIRST = 4
#: So many facets of a body at most are asked for their centres.
_MAX_CENTRES = 64
_UNIT = 2.0**-53
_POINT = ConvexHull(np.zeros((1, 3)))



class Placed(NamedTuple):
    """Poses (4, 4) of A and B at a time, from A's origin, and by how much they miss the motion together [m]."""

    X_A: np.ndarray
    X_B: np.ndarray
    error: float


class CommonPoints:
    """Facets of two meshes A and B that may meet, and whether points can be inside A and B."""

    def __init__(self, trees: list[MeshTree], corners: list[np.ndarray], are_solid: list[bool]):
        """trees : of A and B.   corners : (k, 3, 3) of facets of each.   are_solid : whether A and B are."""
        self._trees, self._are_solid = trees, are_solid
        self._centres = [some[:: -(-len(some) // _MAX_CENTRES)].mean(axis=1) for some in corners]

    def first_time(self, begin: float, place: Callable[[float], Placed], far: bool) -> float:
        """The first of some times after ``begin`` when a centre is proven inside the other mesh, or infinity.

        place : where both are at a time, 0 … 1.   far : look far ahead; else next to ``begin`` only.
        """
        times = np.unique(np.minimum(begin + (_LATER if far else _LATER[:_AT_FIRST]), 1.0))
        times = times[times > begin]
        placed = [place(time) for time in times.tolist()]
        if not placed:
            return np.inf
        proven = self._inside(placed, 0) | self._inside(placed, 1)
        return float(times[proven.argmax()]) if proven.any() else np.inf

    def _inside(self, placed: list[Placed], side: int) -> np.ndarray:
        """(n,) bool: whether the mesh of a side is proven to hold a centre of the other one, placed n times."""
        if not self._are_solid[side]:
            return np.zeros(len(placed), dtype=bool)
        tree, centres = self._trees[side], self._centres[1 - side]
        X, X_other = (np.stack([at[k] for at in placed]) for k in (side, 1 - side))
        points = (centres @ X_other[:, :3, :3].transpose(0, 2, 1) + X_other[:, None, :3, 3]).reshape(-1, 3)
        which = np.repeat(np.arange(len(placed)), len(centres))
        # Rounding of a centre, 3 u of its largest coordinate each, and of where the pose has it, 4 u of what is summed
        size = np.abs(centres).sum(axis=1).max() * np.abs(X_other[:, :3, :3]).max(axis=(1, 2))
        size += np.abs(X_other[:, :3, 3]).max(axis=1)
        error = np.array([at.error for at in placed]) + 32 * _UNIT * size
        rows = np.flatnonzero(points_in_solid(tree, X[which], points, np.eye(4)) == INSIDE)
        proven = np.zeros(len(placed), dtype=bool)
        if len(rows):
            gaps = surface_distances(tree, body_of(_POINT).tree, X[which[rows]], poses_at(points[rows]))
            proven[which[rows[gaps.lower > error[which[rows]]]]] = True
        return proven
