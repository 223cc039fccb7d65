"""How a support tree lies in memory: an int64 header, a run of doubles, runs of 32-bit integers.

Node 0 lists the vertices of the coarsest subset, every other node the candidates of a coarse vertex
in the next finer subset. Node i's entries are ``nodes[i] … nodes[i + 1]``, at least 8 of them; their
coordinates stand together, all x, all y, all z, from double ``3·nodes[i]`` on, so that a scan reads a run of memory. An
entry's number is a node of the next level or, in the lists of the last level, a row of the given points. Neighbours
stand in cyclic order, counter-clockwise from outside.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.support.tree_layout import FEWEST, exact_range

#: No coordinate may be larger in size: products with a direction, and their halves, stay finite.
LARGEST_COORDINATE = 2.0**480
_PARTS = ("nodes", "owners", "entries", "ring_starts", "ring")


class SupportTree:
    """Candidate lists and neighbours over the vertices of a hull; read-only once made.

    points : (n, 3) points of the hull; ids are rows of ``points``.
    nodes : (nodes + 1,) int32, where each node's entries begin.
    owners : (nodes,) int32, row of the vertex whose candidates a node lists; −1 for node 0.
    entries : (entries,) int32, node of the next level, or row of ``points`` at the last.
    list_coordinates : (3·entries,) coordinates of the entries, list by list.
    ring_starts, ring : (n + 1,), (links,) int32: the hull neighbours of row i are
        ``ring[ring_starts[i] : ring_starts[i + 1]]``.
    flat : whether all points are in a plane, exactly: both sides are equally far along the plane's normal.
    depth : number of lists a query scans.
    address : of the header; kernels take no more. Valid as long as the object lives.
    """

    def __init__(self, points, flat, depth, nodes, owners, entries, list_coordinates, ring_starts, ring):
        self.points = checked_points(points)
        self.flat, self.depth = bool(flat), int(depth)
        self.nodes, self.owners, self.entries, self.ring_starts, self.ring = (
            np.ascontiguousarray(part, dtype=np.int32) for part in (nodes, owners, entries, ring_starts, ring)
        )
        self.list_coordinates = np.ascontiguousarray(list_coordinates, dtype=np.float64).reshape(-1)
        self._check_structure()
        self.range = np.empty(3)
        exact_range(address_of(self.points), len(self.points), address_of(self.range))
        self.header = np.array(
            [len(self.points), self.depth, len(self.nodes) - 1, len(self.entries), len(self.ring),
             *(address_of(part) for part in (
                 self.nodes, self.entries, self.list_coordinates, self.ring_starts, self.ring,
                 self.range)), self.flat, address_of(self.points)],
            dtype=np.int64,
        )
        self.address = address_of(self.header)
        for part in (self.header, self.range, self.list_coordinates, *(getattr(self, name) for name in _PARTS)):
            part.flags.writeable = False

    @property
    def nbytes(self) -> int:
        """Bytes of the tree, with the coordinates given."""
        arrays = (self.points, self.header, self.list_coordinates, *(getattr(self, name) for name in _PARTS))
        return sum(array.nbytes for array in arrays)

    def _check_structure(self) -> None:
        """Everything that a kernel relies on to stay inside the arrays and to come to an end."""
        n, nodes, entries = len(self.points), self.nodes, self.entries
        _require(self.depth >= 1, "no level")
        _require(len(nodes) >= 2 and nodes[0] == 0 and nodes[-1] == len(entries), "nodes do not cover the entries")
        _require((np.diff(nodes) >= FEWEST).all(), f"a list of fewer than {FEWEST} entries")
        _require(len(self.owners) == len(nodes) - 1 and self.owners[0] == -1, "owners do not fit the nodes")
        _require((self.owners[1:] >= 0).all() and self.owners.max() < n, "an owner outside the points")
        _require(len(self.list_coordinates) == 3 * len(entries), "coordinates do not fit the entries")
        starts, ring = self.ring_starts, self.ring
        _require(len(starts) == n + 1 and starts[0] == 0 and starts[-1] == len(ring), "rings do not fit the points")
        degree = np.diff(starts)
        _require((degree >= 0).all(), "a ring of negative length")
        _require(len(ring) == 0 or (0 <= ring.min() and ring.max() < n), "a neighbour outside the points")
        _require((degree[ring] > 0).all(), "a neighbour without neighbours")
        self._check_levels()

    def _check_levels(self) -> None:
        """Entries of a level lead to the nodes of the next one, all of them, and of the last to vertices."""
        first, end = 0, 1
        for _ in range(self.depth - 1):
            _require(end < len(self.nodes), "fewer levels than the depth says")
            links = self.entries[self.nodes[first] : self.nodes[end]]
            _require(links.min() == end and links.max() < len(self.nodes) - 1, "levels do not lead to each other")
            first, end = end, int(links.max()) + 1
        _require(end == len(self.nodes) - 1, "more nodes than the levels lead to")
        ids = self.entries[self.nodes[first] :]
        _require(ids.min() >= 0 and ids.max() < len(self.points), "an entry outside the points")
        rows = self.rows_of_entries()
        carried = list_coordinates_of(self.points, self.nodes, rows)
        _require(np.array_equal(self.list_coordinates, carried), "entries carry other coordinates than the points")
        _require((np.diff(self.ring_starts)[rows] > 0).all(), "an entry that is no vertex")

    def rows_of_entries(self) -> np.ndarray:
        """(entries,) row of the point that every entry stands for."""
        first, end = 0, 1
        for _ in range(self.depth - 1):
            first, end = end, int(self.entries[self.nodes[first] : self.nodes[end]].max()) + 1
        last = self.nodes[first]
        return np.concatenate([self.owners[self.entries[:last]], self.entries[last:]])


def list_coordinates_of(points: np.ndarray, nodes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(3·entries,) the points of these rows, laid out list by list."""
    places, strides = coordinate_places(nodes)
    coordinates = np.empty(3 * len(rows))
    for axis in range(3):
        coordinates[places + axis * strides] = points[rows, axis]
    return coordinates


def coordinate_places(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For every entry: where its x stands, and how much further its y does."""
    nodes = nodes.astype(np.int64)
    lengths = np.diff(nodes)
    return np.arange(nodes[-1]) + np.repeat(2 * nodes[:-1], lengths), np.repeat(lengths, lengths)


def checked_points(points) -> np.ndarray:
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError("points must be (n, 3) and finite")
    if not len(points) or np.abs(points).max() > LARGEST_COORDINATE:
        raise ValueError(f"support tree: coordinates must not be larger than {LARGEST_COORDINATE:g}")
    return points


def _require(condition, what: str) -> None:
    if not condition:
        raise ValueError(f"support tree: {what}")
