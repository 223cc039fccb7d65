"""Labels of leaves inside the solid: winding numbers, carried from leaf to leaf across cuts; exact, and without points.

Every cut has a witness, a convex polygon in the cut's plane and within the cut's cell, with corners p0, p1, p2, … Take
the point p0 + ε (p1 − p0) + ε² (p2 − p0) + … for an ε > 0 as small as need be: all weights of the corners are above 0,
so the point is within the polygon, and on the side of a plane where the first corner off the plane lies. The point is
sent down both sides of its cut, by signs of corners alone, to two leaves that touch around the point. Their winding
numbers differ by the facets in the cut's plane that cover the point. A cut links a leaf below with a leaf above, so all
cuts link all leaves to a tree, and around a leaf beyond the mesh facets wind 0 times.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.papers.partitions.finished_tree import FinishedTree
from collide.papers.partitions.orthogonal_level import OrthogonalLevel
from collide.papers.partitions.partition_tree import Links, PartitionTree
from collide.papers.partitions.vertices import Vertices


class Witnesses(NamedTuple):
    """Convex polygons, each within its cut.   cut : (k,) ascending.   begin, n_corners : (k,), in `vertex`."""

    cut: np.ndarray
    begin: np.ndarray
    n_corners: np.ndarray
    vertex: np.ndarray

    def signs(
        self, rows: np.ndarray, planes: np.ndarray, sign_of: Callable[[np.ndarray, np.ndarray], np.ndarray]
    ) -> np.ndarray:
        """(k,) int8, the sides of planes with the points of witnesses: each the first nonzero sign of the corners.

        sign_of : (vertices (m,), planes (m,)) → signs (m,).
        """
        sign, waiting, k = np.zeros(len(rows), dtype=np.int8), np.arange(len(rows)), 0
        while len(waiting):
            if (self.n_corners[rows[waiting]] <= k).any():
                raise AssertionError("a plane below a cut is the cut's own: please report it")
            sign[waiting] = sign_of(self.vertex[self.begin[rows[waiting]] + k], planes[waiting])
            waiting, k = waiting[sign[waiting] == 0], k + 1
        return sign


def witnesses_of_axes(level: OrthogonalLevel) -> tuple[Vertices, Witnesses]:
    """Of the cuts of the first level: the rectangles in which the cuts meet the cubes of their cells."""
    tree, planes = level.tree, level.vertices.planes.with_own_axis_planes()
    places = np.flatnonzero(tree.below.rows >= 0)
    places = places[tree.plane.rows[tree.below.rows[places]] >= 4 * planes.n]
    places = places[np.argsort(tree.below.rows[places])]
    cut = tree.below.rows[places]
    plane = tree.plane.rows[cut]
    k, rows = plane - 4 * planes.n, np.arange(len(cut))
    axis, ends = planes.axis.rows[k], np.stack((level.low.rows[places], level.high.rows[places]), axis=1)
    ends[rows, :, axis] = planes.value.rows[k, None]
    names = planes.add_axis_planes(np.tile(np.arange(3), 2 * len(cut)), ends.ravel()).reshape(-1, 2, 3)
    names[rows, :, axis] = plane[:, None]
    vertices, xyz = Vertices(planes), np.arange(3)
    loop = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    which = np.zeros((len(cut), 4, 3), dtype=np.int64)
    for side in range(2):
        which[rows, :, (axis + 1 + side) % 3] = loop[:, side]
    corner = (rows[:, None, None], which, xyz)
    made = vertices.add(ends[corner].reshape(-1, 3), np.zeros(4 * len(cut)), names[corner].reshape(-1, 3))
    return vertices, Witnesses(cut, 4 * rows, np.full(len(cut), 4), made)


def links_of(tree: PartitionTree, vertices: Vertices, witnesses: Witnesses, held) -> Links:
    """The leaves next to witnesses, and the steps between.

    held : [(cuts, facets)], of `PartitionTree.held`, all of the witnesses' cuts at least.
    """
    cut = witnesses.cut
    place = _sent_down(tree, vertices, witnesses, np.concatenate((2 * cut + 1, 2 * cut + 2)))
    return Links(cut, place[: len(cut)], place[len(cut) :], _steps(tree, vertices, witnesses, held))


def _sent_down(tree: PartitionTree, vertices: Vertices, witnesses: Witnesses, place: np.ndarray) -> np.ndarray:
    """The places of leaves that points of witnesses come to from places (2 k,), the witnesses taken twice."""
    below, plane = tree.below.rows, tree.plane.rows
    active = np.arange(len(place))
    while len(active := active[below[place[active]] >= 0]):
        cut = below[place[active]]
        sign = witnesses.signs(active % len(witnesses.cut), plane[cut], lambda *pairs: vertices.sides(*pairs).sign)
        place[active] = 2 * cut + 1 + (sign > 0)
    return place


def _steps(tree: PartitionTree, vertices: Vertices, witnesses: Witnesses, held) -> np.ndarray:
    """(k,) winding numbers below the cuts less those above, next to the witnesses."""
    steps = np.zeros(len(witnesses.cut), dtype=np.int64)
    cuts, facets = (np.concatenate(columns) for columns in zip((steps[:0], steps[:0]), *held))
    row = np.minimum(np.searchsorted(witnesses.cut, cuts), max(len(steps) - 1, 0))
    mine = witnesses.cut[row] == cuts if len(steps) else np.zeros(len(cuts), dtype=bool)
    row, facets, plane = row[mine], facets[mine], tree.plane.rows[cuts[mine]]
    covers = facets == plane  # a witness is a piece of the facet whose plane cuts
    rows = np.flatnonzero(~covers)
    covers[rows] = _covers(vertices, witnesses, row[rows], facets[rows])
    row, against = row[covers], vertices.planes.run_against(facets[covers], plane[covers])
    np.add.at(steps, row, np.where(against, -1, 1))
    return steps


def _covers(vertices: Vertices, witnesses: Witnesses, rows: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(k,) bool: facets cover the points of witnesses in their planes."""
    planes = vertices.planes
    first = witnesses.vertex[witnesses.begin[rows]]
    corners = planes.vertices[planes.faces[facets]]
    xyz, slack = vertices.xyz.rows[first], 2.0 * vertices.error.rows[first, None]
    covers = ((xyz + slack >= corners.min(axis=1)) & (xyz - slack <= corners.max(axis=1))).all(axis=1)
    for edge in range(3):
        near = np.flatnonzero(covers)
        line = planes.n + 3 * facets[near] + edge
        inner = vertices.exact_signs(planes.faces[facets[near], (edge + 2) % 3], line)
        covers[near] = witnesses.signs(rows[near], line, vertices.exact_signs) == inner
    return covers


def winding_numbers(tree: FinishedTree, links: list[Links]) -> np.ndarray:
    """(leaves,) int64, how often facets wind around each leaf.   links : of all cuts, each once."""
    winding = np.zeros(tree.n_leaves, dtype=np.int64)
    if not links:
        return winding
    cut, below, above, step = (np.concatenate(columns) for columns in zip(*links))
    order = np.argsort(cut)
    below, above, step = ~tree.below[below[order]], ~tree.below[above[order]], step[order]
    for cuts in reversed(tree.levels):  # all leaves above a cut are raised to fit the leaves below
        raised = np.zeros(tree.n_leaves + 1, dtype=np.int64)
        by = winding[below[cuts]] - step[cuts] - winding[above[cuts]]
        raised[tree.last_below[cuts] + 1] = by
        np.add.at(raised, tree.last[cuts] + 1, -by)
        winding += np.cumsum(raised)[:-1]
    return winding - _beyond(tree, winding)


def _beyond(tree: FinishedTree, winding: np.ndarray) -> int:
    """The number of all leaves that hold corners of a box around the mesh."""
    corners = tree.planes.vertices[tree.planes.faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    ends = np.stack((np.minimum(low - (high - low), np.nextafter(low, -np.inf)),
                     np.maximum(high + (high - low), np.nextafter(high, np.inf))))
    far = tree.touches(ends[(np.arange(8)[:, None] >> np.arange(3)) & 1, np.arange(3)])
    numbers = np.unique(winding[far.leaf])
    if len(numbers) != 1:
        raise AssertionError("facets wind around leaves beyond the mesh: please report it")
    return int(numbers[0])
