"""Which leaves of a partition are inside its solid: one point of each leaf, asked of the winding numbers of the mesh."""

from __future__ import annotations

import numpy as np

from collide.errors import UnsupportedQuery
from collide.lowering.facet_bodies import body_of
from collide.narrowphase.facets.facet_queries import points_in_solid
from collide.narrowphase.facets.winding_numbers import INSIDE, OUTSIDE, UNDECIDED
from collide.partitions.convex_cells import cell_blocks
from collide.partitions.finished_tree import FinishedTree, exact_points
from collide.partitions.planes import signs_of
from collide.shapes.mesh import Mesh
from collide.surface_queries.contains import winds_around

#: How far off a cut points are tried, in widths of the piece of facet that lies in it.
_STEPS = (0.25, 0.03, 2e-3, 1e-4, 1e-6, 1e-8, 1e-11)


def leaves_inside(tree: FinishedTree, mesh: Mesh, seats: np.ndarray, middles: np.ndarray) -> tuple[np.ndarray, int]:
    """((leaves,) bool, how many took fractions). The facets wind around all points of a leaf alike.

    seats : (cuts, 4), of `PartitionTree`.   middles : (places of the first level, 3), a point of each.
    """
    inside = np.zeros(tree.n_leaves, dtype=bool)
    left = np.arange(tree.n_leaves)
    for step in _STEPS:
        points = _candidates(tree, seats, middles, left, step)
        touched = tree.touches(points)
        times = np.bincount(touched.point, minlength=len(left))
        leaf = np.full(len(left), -1)
        leaf[touched.point] = touched.leaf
        good = (times == 1) & (leaf == left)
        inside[left[good]] = _winds(mesh, points[good])
        left = left[~good]
        if len(left) == 0:
            return inside, 0
    for leaf in left.tolist():
        inside[leaf] = _winds_around_leaf(tree, leaf)
    return inside, len(left)


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


def _winds_around_leaf(tree: FinishedTree, leaf: int) -> bool:
    """The same for a leaf too thin to hold a double that was tried: a rational point of it, a ray along x, in integers."""
    planes = tree.planes
    low, high = planes.vertices.min(axis=0), planes.vertices.max(axis=0)
    for block in cell_blocks(tree, np.array([leaf]), low, high):
        if len(block.leaf) == 0:
            return False  # outside of the mesh's box
        rows = np.unique(block.edges.vertex.rows[np.concatenate([
            np.arange(b, b + c) for b, c in zip(block.faces.begin.tolist(), block.faces.count.tolist())
        ])])  # fmt: skip
        exact, near = block.vertices.exact(rows), block.vertices.xyz.rows[rows]
        error = float(block.vertices.error.rows[rows].max())
        for attempt in range(1, 50):
            weights = [1 + attempt * k * k % 97 for k in range(len(rows))]
            winding = _winding_number(planes, _mean(exact, weights), near.min(axis=0) - error, near.max(axis=0) + error)
            if winding is not None:
                return winding > 0
    raise UnsupportedQuery(f"SpacePartition: every ray tried from cell {leaf} passes an edge; please report it")


def _mean(points: np.ndarray, weights: list[int]) -> tuple[int, int, int, int]:
    """A weighted mean of homogeneous points, of Python integers."""
    common = 1
    for w in points[:, 3].tolist():
        common *= w
    sums = [sum(weight * p[k] * (common // p[3]) for weight, p in zip(weights, points.tolist())) for k in range(3)]
    return sums[0], sums[1], sums[2], common * sum(weights)


def _winding_number(planes, point, low: np.ndarray, high: np.ndarray) -> int | None:
    """How often facets wind around a rational point, by a ray along +x; None where it passes an edge.

    low, high : doubles between which the point lies.
    """
    x, y, z, w = point
    corners = planes.vertices[planes.faces]
    near = (corners[:, :, 0].max(axis=1) >= low[0]) & np.all(
        (corners[:, :, 1:].min(axis=1) <= high[1:]) & (corners[:, :, 1:].max(axis=1) >= low[1:]), axis=1
    )
    rows = np.flatnonzero(near)
    above = signs_of(np.array([[x, y, z, w]], dtype=object), planes.coefficients(rows)) if len(rows) else []
    winding = 0
    for row, side in zip(rows.tolist(), above):
        plane = planes.coefficients(np.array([row]))[0]
        turns = []
        exact = exact_points(planes, corners[row])
        for a, b in ((0, 1), (1, 2), (2, 0)):
            (ya, za), (yb, zb) = (exact[k, 1:3] * w // exact[k, 3] - np.array([y, z], dtype=object) for k in (a, b))
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
