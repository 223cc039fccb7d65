"""Labels of leaves inside the solid: facets wind around all points of a leaf alike, so a single point decides."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.errors import UnsupportedQuery
from collide.lowering.facet_bodies import body_of
from collide.narrowphase.facets.facet_queries import points_in_solid
from collide.narrowphase.facets.winding_numbers import INSIDE, OUTSIDE, UNDECIDED
from collide.papers.partitions.convex_cells import CellBlock, cell_blocks
from collide.papers.partitions.cut_polygons import edge_rows
from collide.papers.partitions.finished_tree import FinishedTree
from collide.papers.partitions.planes import Planes, signs_of
from collide.shapes.mesh import Mesh
from collide.surface_queries.contains import winds_around

#: Distances of tried points from a cut, in widths of the piece of facet in the cut.
_STEPS = tuple(2.0**-k for k in (2, 5, 8, 11, 14, 18, 22, 27, 32, 40))


def leaves_inside(tree: FinishedTree, mesh: Mesh, seats: np.ndarray, middles: np.ndarray) -> tuple[np.ndarray, int]:
    """((leaves,) bool, how many took fractions). The facets wind around all points of a leaf alike.

    seats : (cuts, 4), of `PartitionTree`.   middles : (places of the first level, 3), a point of each.
    """
    inside = np.zeros(tree.n_leaves, dtype=bool)
    remaining = np.arange(tree.n_leaves)
    for step in _STEPS:
        points = _candidates(tree, seats, middles, remaining, step)
        good = _strictly_in(tree, points, remaining)
        inside[remaining[good]] = _winds(mesh, points[good])
        remaining = remaining[~good]
        if len(remaining) == 0:
            return inside, 0
    n_fractions = 0
    low, high = tree.planes.vertices.min(axis=0), tree.planes.vertices.max(axis=0)  # all inside is within
    facet_boxes = _FacetBoxes(tree.planes)
    for block in cell_blocks(tree, remaining, low, high):
        n_fractions += _label_block(tree, mesh, block, inside, facet_boxes)
    return inside, n_fractions


def _label_block(tree: FinishedTree, mesh: Mesh, block: CellBlock, inside: np.ndarray, facets: _FacetBoxes) -> int:
    """Thin leaves: the mean of their corners, rounded; in fractions where rounding leaves the leaf."""
    rows, owner = edge_rows(block.faces)
    used, vertex = np.unique(block.edges.vertex.rows[rows], return_inverse=True)
    cell = block.faces.cell[owner]
    pairs = np.unique(np.stack((cell, np.ravel(vertex)), axis=1), axis=0)
    xyz, _ = block.vertices.rounded(used)
    count = np.bincount(pairs[:, 0], minlength=len(block.leaf))
    sums = np.stack([np.bincount(pairs[:, 0], xyz[pairs[:, 1], k], len(count)) for k in range(3)], axis=1)
    points = sums / count[:, None]
    good = _strictly_in(tree, points, block.leaf)
    inside[block.leaf[good]] = _winds(mesh, points[good])
    remaining = np.flatnonzero(~good)
    starts = np.cumsum(count) - count
    for k in remaining.tolist():
        corners = used[pairs[starts[k] : starts[k] + count[k], 1]]
        inside[block.leaf[k]] = _winds_around_cell(block, k, corners, facets)
    return len(remaining)


def _strictly_in(tree: FinishedTree, points: np.ndarray, leaves: np.ndarray) -> np.ndarray:
    """Which points lie in the open cells of their leaves."""
    touched = tree.touches(points)
    leaf = np.full(len(leaves), -1)
    leaf[touched.point] = touched.leaf
    return (np.bincount(touched.point, minlength=len(leaves)) == 1) & (leaf == leaves)


def _candidates(tree: FinishedTree, seats, middles, leaves: np.ndarray, step: float) -> np.ndarray:
    """A point of each leaf, if rounding and other cuts allow."""
    place = tree.place[leaves]
    cut = (place - 1) // 2
    points = np.empty((len(leaves), 3))
    boxes = (place == 0) | np.isnan(seats[cut, 3] if len(seats) else np.full(len(cut), np.nan))
    points[boxes] = middles[place[boxes]]
    rows = np.flatnonzero(~boxes)
    normal = tree.planes.normal[tree.plane[cut[rows]]]
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = normal / np.abs(normal).max(axis=1, keepdims=True)
        normal = np.nan_to_num(normal / np.sqrt((normal * normal).sum(axis=1, keepdims=True)))
    off = step * seats[cut[rows], 3] * np.where(place[rows] % 2 == 1, -1.0, 1.0)
    points[rows] = seats[cut[rows], :3] + off[:, None] * normal
    return points


def _winds(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Whether facets wind around points that lie on no facet with an area."""
    where = points_in_solid(body_of(mesh).tree, np.eye(4), points, np.eye(4)) if len(points) else np.zeros(0, dtype=int)
    for k in np.flatnonzero(where == UNDECIDED).tolist():
        where[k] = INSIDE if winds_around(mesh, np.eye(4), points[k]) else OUTSIDE
    return where != OUTSIDE


class _FacetBoxes:
    """The planes of facets, and the boxes that facets lie in."""

    def __init__(self, planes: Planes):
        self.planes = planes
        corners = planes.vertices[planes.faces]
        self.low, self.high = corners.min(axis=1), corners.max(axis=1)

    def ahead(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Facets in the way of a ray along +x from a point between low and high, by their boxes."""
        near = (self.low[:, 1:] <= high[1:]) & (self.high[:, 1:] >= low[1:])
        return np.flatnonzero(near.all(axis=1) & (self.high[:, 0] >= low[0]))


def _winds_around_cell(block: CellBlock, k: int, corners: np.ndarray, facets: _FacetBoxes) -> bool:
    """The same for a cell too thin for doubles: a finer point of it, and a ray along x, in integers."""
    exact = block.vertices.exact(corners)
    near, error = block.vertices.rounded(corners)
    rows = facets.ahead(near.min(axis=0) - error, near.max(axis=0) + error)
    faces = block.faces[np.searchsorted(block.faces.cell, k) : np.searchsorted(block.faces.cell, k, "right")]
    walls = block.vertices.planes.coefficients(faces.plane)
    for attempt in range(1, 50):
        weights = [1 + attempt * i * i % 97 for i in range(len(corners))]
        winding = _winding_number(facets.planes, rows, _point_between(exact, weights, walls, faces.side))
        if winding is not None:
            return winding > 0
    raise UnsupportedQuery("SpacePartition: every ray tried from a cell passes an edge; please report it")


def _point_between(corners: np.ndarray, weights: list[int], walls: np.ndarray, side: np.ndarray):
    """(x, y, z, w) Python integers, strictly within walls (f, 4): a mean of the corners to as few bits as will do."""
    total = sum(weights)
    weighed = [(weight, p[3], p[:3]) for weight, p in zip(weights, corners.tolist())]
    mean = [sum(weight * Fraction(p[k], w) for weight, w, p in weighed) / total for k in range(3)]
    bits = 64
    while True:
        point = np.array([[*(round(x * (1 << bits)) for x in mean), 1 << bits]], dtype=object)
        if np.array_equal(signs_of(point, walls), side):
            return point[0]
        bits *= 2


def _winding_number(planes: Planes, rows: np.ndarray, point) -> int | None:
    """The winding number of facets around a rational point, by the hits of a ray along +x with the rows; ``None`` at an
    edge.
    """
    x, y, z, w = point
    coefficients = planes.coefficients(rows)
    above = signs_of(np.array([[x, y, z, w]], dtype=object), coefficients)
    winding = 0
    for row, plane, side in zip(rows.tolist(), coefficients, above):
        turns = []
        corners = planes.grid_vertices[planes.faces[row]]
        for a, b in ((0, 1), (1, 2), (2, 0)):
            (ya, za), (yb, zb) = (corners[k, 1:] * w - np.array([y, z], dtype=object) for k in (a, b))
            turns.append(ya * zb - za * yb)
        if plane[0] == 0:  # seen along the ray it is a segment
            if all(t == 0 for t in turns):
                return None
            continue
        if any(t == 0 for t in turns) and not (min(turns) < 0 < max(turns)):
            return None
        if min(turns) > 0 or max(turns) < 0:
            ahead = side * (1 if plane[0] > 0 else -1) < 0  # the plane lies at larger x than the point
            winding += (1 if plane[0] > 0 else -1) if ahead else 0
    return winding
