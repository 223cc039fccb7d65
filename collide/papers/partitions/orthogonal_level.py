"""The first level of a space partition: cubes cut at their middles, until each holds few corners of facets' boxes.

J. Erickson, "Local polyhedra and geometric graphs" (2005), lemma 5.2, after M. de Berg, "Linear size binary space
partitions for uncluttered scenes" (2000). A cube with more than κ corners of facets' axis-aligned boxes (de Berg's
guards) is cut into eight. Where all but κ of them are in an eighth, the smallest cube at the eighth's corner with all
but κ is cut off instead, so that empty levels cost nothing. Beyond the lemma, cells of few facets are not cut.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from collide.numerics.growing_rows import GrowingRows
from collide.papers.partitions.cut_polygons import Edges, Polygons, cut_polygons, edge_rows, joined
from collide.papers.partitions.partition_tree import EMPTY, PartitionTree
from collide.papers.partitions.vertices import Vertices


class Guards(NamedTuple):
    """Corners of facets' boxes that lie inside a cell: xyz (k, 3), cell (k,) its place."""

    xyz: np.ndarray
    cell: np.ndarray


class OrthogonalLevel:
    """Cells of the first level, and the pieces of facets in them.

    low, high : (places, 3) of a cell's cube; cells at the rim extend beyond their cubes.
    polygons : pieces of facets, `cell` the place.
    """

    def __init__(self, tree: PartitionTree, vertices: Vertices, edges: Edges, kappa: int, n_spared: int):
        self.tree, self.vertices, self.edges, self.kappa, self.n_spared = tree, vertices, edges, kappa, n_spared
        self.low, self.high = GrowingRows.empty(float, 3), GrowingRows.empty(float, 3)
        planes = vertices.planes
        n = planes.n
        carrier = n + 3 * np.arange(n)[:, None] + np.arange(3)
        begin = 3 * np.arange(n)
        edges.add(planes.faces.ravel(), carrier.ravel())
        nothing = np.zeros(n, dtype=np.int64)
        self.polygons = Polygons(np.arange(n), nothing, begin, np.full(n, 3), nothing)
        corners = planes.vertices[planes.faces]
        self.boxes = np.stack((corners.min(axis=1), corners.max(axis=1)), axis=1)  # of the polygons, (k, 2, 3)
        low, high = self.boxes[:, 0].min(axis=0), self.boxes[:, 1].max(axis=0)
        self.low.add(low[None])
        self.high.add(low[None] + (high - low).max())
        which = (np.arange(8)[:, None] >> np.arange(3)) & 1
        xyz = np.stack([self.boxes[:, which[:, k], k] for k in range(3)], axis=2).reshape(-1, 3)
        xyz = xyz[((xyz > self.low.rows[0]) & (xyz < self.high.rows[0])).all(axis=1)]
        self.guards = Guards(xyz, np.zeros(len(xyz), dtype=np.int64))

    def grow(self, progress) -> None:
        """Cut until no cell is to be cut."""
        active = np.zeros(1, dtype=np.int64)
        depth = 0
        while len(active := self._crowded(active)):
            depth += 1
            with progress(f"cutting space along the axes, round {depth}: {self.tree.plane.n + 1:,} cells"):
                active = self._cut_once(active)

    def _crowded(self, cells: np.ndarray) -> np.ndarray:
        """The cells with more than κ guards, more than ``n_spared`` facets, and room for a cut in doubles."""
        n = self.tree.below.n
        guards = np.bincount(self.guards.cell, minlength=n)[cells]
        facets = np.bincount(self.polygons.cell, minlength=n)[cells]
        low, high = self.low.rows[cells], self.high.rows[cells]
        middle = low + 0.5 * (high - low)
        wide = ((low < middle) & (middle < high)).all(axis=1)
        return cells[(guards > self.kappa) & (facets > self.n_spared) & wide]

    def _cut_once(self, cells: np.ndarray) -> np.ndarray:
        """Cut cells once along each axis; returns the places below of the cubes among them."""
        place = np.full(self.tree.below.n, -1)
        place[cells] = np.arange(len(cells))
        row = place[self.guards.cell]
        inside = row >= 0
        value, keep = self._where(cells, self.guards.xyz[inside], row[inside])
        places, parent = cells, np.arange(len(cells))
        for axis in range(3):
            facets = np.bincount(self.polygons.cell, minlength=self.tree.below.n)
            places, parent = places[facets[places] > 0], parent[facets[places] > 0]
            below, above = self._cut_along(axis, places, value[parent, axis])
            side = keep[parent, axis]
            places = np.concatenate((below[side <= 0], above[side >= 0]))
            parent = np.concatenate((parent[side <= 0], parent[side >= 0]))
        return places

    def _where(self, cells: np.ndarray, guards: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(coordinate to cut at (c, 3), which side is cut on (c, 3): −1 below, 1 above, 0 both)."""
        low, high = self.low.rows[cells], self.high.rows[cells]
        middle = low + 0.5 * (high - low)
        eighth = ((guards > middle[row]) << np.arange(3)).sum(axis=1)
        counts = np.bincount(8 * row + eighth, minlength=8 * len(cells)).reshape(-1, 8)
        total = counts.sum(axis=1)
        best = counts.argmax(axis=1)
        upper = ((best[:, None] >> np.arange(3)) & 1).astype(bool)
        # The distance from the cube's corner within which all but κ guards lie.
        corner = np.where(upper, high, low)
        distance = np.abs(guards - corner[row]).max(axis=1)
        order = np.lexsort((distance, row))
        first = np.cumsum(total) - total
        width = distance[order[first + np.maximum(total - self.kappa, 1) - 1]]
        value = np.where(upper, high - width[:, None], low + width[:, None])
        shrinks = (counts.max(axis=1) >= total - self.kappa) & ((low < value) & (value < high)).all(axis=1)
        value = np.where(shrinks[:, None], value, middle)
        return value, np.where(shrinks[:, None], np.where(upper, 1, -1), 0)

    def _cut_along(self, axis: int, places: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cut the cells at places by planes x[axis] = value; returns the places below and above."""
        planes = self.vertices.planes.add_axis_planes(np.full(len(places), axis), value)
        cuts = self.tree.cut(places, planes)
        below, above = 2 * cuts + 1, 2 * cuts + 2
        low, high = np.repeat(self.low.rows[places], 2, axis=0), np.repeat(self.high.rows[places], 2, axis=0)
        high[0::2, axis] = low[1::2, axis] = value
        self.low.add(low)
        self.high.add(high)
        number = np.full(self.tree.below.n, -1)
        number[places] = np.arange(len(places))
        self._cut_guards(axis, number, value, below)
        self._cut_facets(axis, number, value, planes, cuts)
        self.tree.other_bytes = self.vertices.n_bytes + self.edges.n_bytes + 96 * len(self.polygons.cell)
        self.tree.other_bytes += self.guards.xyz.nbytes + self.guards.cell.nbytes
        return below, above

    def _cut_guards(self, axis: int, number: np.ndarray, value: np.ndarray, below: np.ndarray) -> None:
        row = number[self.guards.cell]
        rows = np.flatnonzero(row >= 0)
        row, x = row[rows], self.guards.xyz[rows, axis]
        cell = self.guards.cell.copy()
        cell[rows] = below[row] + (x > value[row])
        on = np.ones(len(cell), dtype=bool)
        on[rows] = x != value[row]  # those on a cut are inside no cell
        self.guards = Guards(self.guards.xyz[on], cell[on])

    def _cut_facets(self, axis: int, number: np.ndarray, value: np.ndarray, planes, cuts: np.ndarray) -> None:
        row = number[self.polygons.cell]
        of_cut = np.flatnonzero(row >= 0)
        at = row[of_cut]
        over = self.boxes[of_cut, 0, axis] > value[at]
        under = self.boxes[of_cut, 1, axis] < value[at]
        cell = self.polygons.cell.copy()
        cell[of_cut] = 2 * cuts[at] + 1 + over
        close = ~(over | under)
        rows, at = of_cut[close], at[close]
        if len(rows) == 0:
            self.polygons = replace(self.polygons, cell=cell)
            return
        cut = cut_polygons(self.vertices, self.edges, self.polygons[rows], planes[at])
        cell[rows] = 2 * cuts[at] + 1 + cut.above
        flat = ~(cut.below | cut.above)
        self.tree.hold(cuts[at[flat]], self.polygons.plane[rows[flat]])
        remaining = np.ones(len(cell), dtype=bool)
        remaining[rows[flat | (cut.below & cut.above)]] = False
        split_cuts = cuts[at[cut.both]]
        pieces = joined(replace(cut.minus, cell=2 * split_cuts + 1), replace(cut.plus, cell=2 * split_cuts + 2))
        self.polygons = joined(replace(self.polygons, cell=cell)[remaining], pieces)
        self.boxes = np.concatenate((self.boxes[remaining], self._boxes_of(pieces)))

    def _boxes_of(self, polygons: Polygons) -> np.ndarray:
        """(k, 2, 3) boxes around polygons, rounding counted in."""
        if len(polygons.cell) == 0:
            return np.zeros((0, 2, 3))
        rows, _ = edge_rows(polygons)
        vertex = self.edges.vertex.rows[rows]
        xyz, error = self.vertices.xyz.rows[vertex], self.vertices.error.rows[vertex, None]
        first = np.cumsum(polygons.count) - polygons.count
        low, high = np.minimum.reduceat(xyz - 2.0 * error, first), np.maximum.reduceat(xyz + 2.0 * error, first)
        return np.stack((low, high), axis=1)

    def leaves_without_facets(self) -> np.ndarray:
        """Places of leaves that no facet meets."""
        empty = self.tree.below.rows == EMPTY
        empty[self.polygons.cell] = False
        return np.flatnonzero(empty)
