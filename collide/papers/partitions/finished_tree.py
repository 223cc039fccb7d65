"""A finished partition: cuts and leaves in order, what lies below each cut, and points located in it."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.papers.partitions import descent_kernel as words
from collide.papers.partitions.partition_tree import EMPTY, PartitionTree
from collide.papers.partitions.planes import Planes, signs_of

#: Points sent down the tree at once.
_AT_ONCE = 1 << 16


class Touches(NamedTuple):
    """Leaves touched by points, and cuts through points: both by rows of the points.

    point, leaf : (k,), sorted by point.   on_point, on_cut : (m,).
    """

    point: np.ndarray
    leaf: np.ndarray
    on_point: np.ndarray
    on_cut: np.ndarray


class FinishedTree:
    """A binary space partition whose leaves are numbered from left to right.

    plane : (cuts,) the plane of each cut.   below : (2 cuts + 1,) what stands at a place: a cut c ≥ 0, or ~leaf.
    first, last_below, last : (cuts,) the leaves below a cut are first … last_below, those above end with last.
    levels : the cuts at every depth, from the root's.   place : (leaves,), where each leaf stands.
    depth : the most cuts above a leaf.   mean_depth : over leaves.
    held_starts, held : facets in the plane and cell of cut c are held[held_starts[c] : held_starts[c + 1]].
    """

    def __init__(self, grown: PartitionTree, planes: Planes):
        self.planes = planes
        self.plane, self.below = grown.plane.rows.copy(), grown.below.rows.copy()
        n = len(self.plane)
        levels = [np.flatnonzero(self.below[:1] >= 0)]
        while len(levels[-1]):
            cuts = levels[-1]
            children = self.below[np.stack((2 * cuts + 1, 2 * cuts + 2), axis=1)].ravel()
            levels.append(children[children >= 0])
        sizes = np.where(self.below == EMPTY, 1, 0)  # leaves at and under each place
        for cuts in reversed(levels[:-1]):
            sizes[self._place_of(cuts)] = sizes[2 * cuts + 1] + sizes[2 * cuts + 2]
        starts = np.zeros(len(self.below), dtype=np.int64)
        depths = np.zeros(len(self.below), dtype=np.int64)
        at = self._place_of(np.arange(n))
        for cuts in levels[:-1]:
            for side in (1, 2):
                depths[2 * cuts + side] = depths[at[cuts]] + 1
            starts[2 * cuts + 1] = starts[at[cuts]]
            starts[2 * cuts + 2] = starts[at[cuts]] + sizes[2 * cuts + 1]
        places = np.flatnonzero(self.below == EMPTY)
        self.below[places] = ~starts[places]
        self.place = np.empty(len(places), dtype=np.int64)
        self.place[starts[places]] = places
        self.first, self.last = starts[at], starts[at] + sizes[at] - 1
        self.last_below, self.levels = starts[2 * np.arange(n) + 2] - 1, levels[:-1]
        self.depth, self.mean_depth = int(depths[places].max()), float(depths[places].mean())
        held = [np.concatenate(columns) for columns in zip(*grown.held)] or [np.zeros(0, dtype=np.int64)] * 2
        order = np.argsort(held[0], kind="stable")
        self.held = held[1][order]
        self.held_starts = np.searchsorted(held[0][order], np.arange(n + 1))

    def _place_of(self, cuts: np.ndarray) -> np.ndarray:
        """The place at which each cut stands."""
        if not hasattr(self, "_places"):
            places = np.flatnonzero(self.below >= 0)
            self._places = np.empty(len(self.plane), dtype=np.int64)
            self._places[self.below[places]] = places
        return self._places[cuts]

    @property
    def n_leaves(self) -> int:
        return len(self.place)

    @cached_property
    def _words(self) -> np.ndarray:
        """(cuts, WORDS) float64, as of `descent_kernel`."""
        planes, n = self.planes, len(self.plane)
        out = np.zeros((n, words.WORDS))
        links = out.view(np.int64)
        links[:, words.BELOW], links[:, words.ABOVE] = self.below[1::2], self.below[2::2]
        on_axis = self.plane >= 4 * planes.n
        k = self.plane[on_axis] - 4 * planes.n
        links[on_axis, words.AXIS], out[on_axis, words.OFFSET] = planes.axis.rows[k], planes.value.rows[k]
        f = self.plane[~on_axis]
        links[~on_axis, words.AXIS] = words.FACET
        out[~on_axis, :3] = planes.normal[f]
        out[~on_axis, words.OFFSET] = np.einsum("ij,ij->i", planes.normal[f], planes.origin[f])
        out[~on_axis, words.ERROR] = 2.0**-48 * planes.permanent[f].sum(axis=1)
        return out

    def leaves(self, points: np.ndarray) -> np.ndarray:
        """(k,) int64, the leaf of each point (k, 3), −1 for points on cuts or too near for doubles."""
        points = np.ascontiguousarray(points)
        leaf = np.empty(len(points), dtype=np.int64)
        words.descend(
            address_of(self._words), len(self.plane), int(self.below[0]), address_of(points), len(points),
            self.planes.largest, address_of(leaf),
        )
        return leaf

    def touches(self, points: np.ndarray) -> Touches:
        """The leaves whose closures hold the points (k, 3), and the cuts on which they lie, exactly."""
        parts = []
        for begin in range(0, len(points), _AT_ONCE):
            part = self._touches(points[begin : begin + _AT_ONCE])
            parts.append(part._replace(point=part.point + begin, on_point=part.on_point + begin))
        if not parts:
            return Touches(*(np.zeros(0, dtype=np.int64) for _ in range(4)))
        return Touches(*(np.concatenate(columns) for columns in zip(*parts)))

    def _touches(self, points: np.ndarray) -> Touches:
        point = np.arange(len(points))
        place = np.zeros(len(points), dtype=np.int64)
        done: list[tuple] = []
        on: list[tuple] = [(point[:0], point[:0])]
        while len(point):
            cut = self.below[place]
            ended = cut < 0
            if ended.any():
                done.append((point[ended], ~cut[ended]))
                point, cut = point[~ended], cut[~ended]
            sign = self._sides(points[point], self.plane[cut])
            place = 2 * cut + 1 + (sign > 0)
            flat = np.flatnonzero(sign == 0)
            if len(flat):
                on.append((point[flat], cut[flat]))
                point, place = np.append(point, point[flat]), np.append(place, place[flat] + 1)
        owner, leaf = (np.concatenate(columns) for columns in zip(*done))
        order = np.lexsort((leaf, owner))
        return Touches(owner[order], leaf[order], *(np.concatenate(columns) for columns in zip(*on)))

    def _sides(self, points: np.ndarray, cut: np.ndarray) -> np.ndarray:
        height, bound = self.planes.heights(points, np.zeros(len(points)), cut)
        sign = (height > bound).astype(np.int8) - (height < -bound).astype(np.int8)
        remaining = np.flatnonzero(np.abs(height) <= bound)
        remaining = remaining[cut[remaining] < 4 * self.planes.n]  # next to an axis-parallel plane doubles are exact
        if len(remaining):
            sign[remaining] = signs_of(
                exact_points(self.planes, points[remaining]), self.planes.coefficients(cut[remaining])
            )
        return sign


def exact_points(planes: Planes, points: np.ndarray) -> np.ndarray:
    """(k, 4) Python integers x, y, z, w > 0 of points (k, 3): x / w, … in units of 2^−grid."""
    above, below = planes.integers_of(points)
    w = below.max(axis=1)
    return np.concatenate((above * (w[:, None] // below), w[:, None]), axis=1)
