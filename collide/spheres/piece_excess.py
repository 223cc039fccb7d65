"""How far convex pieces exceed a body: the greatest distance of a point of the pieces from the body, bracketed."""

from __future__ import annotations

import numpy as np

from collide.base.poses_at import poses_at
from collide.pairs.query import distance
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.spheres.body_facets import BodyPart, is_same, reach_bounds
from collide.spheres.moved_cells import SolidFacets

#: A bracket this narrow, in parts of the excess or of the size, is narrow enough.
_NARROW, _LEAST = 0.01, 5e-4
#: Cells that leave the body by less, in parts of the size, as facets that lie flush do, are taken first.
_FLUSH = 2.0**-30
#: The share of a way towards the middle of a cell, where the rest of the way is along a normal.
_TOWARDS = 2.0**-8
#: Points asked about at most, and for each facet around pieces; cells halved at a time.
_MAX_POINTS, _POINTS_A_FACET, _ROUND = 40_000, 8, 1000
#: Points times facets of open surfaces asked about at most, all together and at a time.
_MAX_WINDING, _WINDING = 6_000_000, 500_000
_POINT = ConvexHull(np.zeros((1, 3)))
_ENDS = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])


def piece_excess(parts: list[BodyPart], pieces: list[BodyPart]) -> tuple[float, float]:
    """(lower, upper) of the greatest distance of a point of convex pieces from a body [m], proven; both by their parts.

    Pieces are cut into tetrahedra, the tetrahedra with the largest upper bounds in halves. As of `excess_bracket`, what
    a surface wraps counts as body, and ``lower`` is 0 for a body with a surface.
    """
    pieces = [piece for piece in pieces if not any(is_same(piece, part) for part in parts)]
    if not pieces:
        return 0.0, 0.0
    judge = _Judge(parts, pieces)
    for k, piece in enumerate(pieces):
        judge.reach(piece.mesh.vertices, np.full(len(piece.mesh.vertices), k))
    cells = np.concatenate([_cells(piece) for piece in pieces])
    owner = np.repeat(np.arange(len(pieces)), [len(piece.mesh.faces) for piece in pieces])
    bounds = judge.bounds(cells, owner, np.full(len(cells), np.inf))
    n_points = judge.n_points + max(_MAX_POINTS, _POINTS_A_FACET * len(cells))
    while judge.n_points < n_points:
        order = np.argsort(-bounds, kind="stable")[: judge.n_cells]
        worst = order[bounds[order] > judge.limit]
        if not len(worst):
            break
        smaller, owners = _halved(cells[worst]), np.repeat(owner[worst], 2)
        below = judge.bounds(smaller, owners, np.repeat(bounds[worst], 2))
        cells = np.concatenate([np.delete(cells, worst, axis=0), smaller])
        owner, bounds = (np.append(np.delete(a, worst), b) for a, b in ((owner, owners), (bounds, below)))
    return judge.lower, max(float(bounds.max()), judge.lower)


class _Judge:
    """Bounds of cells, and the largest lower bound met.

    lower : of the excess [m].   n_points : asked about.   n_cells : to be halved at a time.
    """

    def __init__(self, parts: list[BodyPart], pieces: list[BodyPart]):
        self._meshes = [part for part in parts if isinstance(part.shape, Mesh)]
        self._convex = [part for part in parts if not isinstance(part.shape, Mesh)]
        self._deviations = np.array([piece.deviation for piece in pieces])
        vertices = np.concatenate([part.mesh.vertices for part in (*parts, *pieces)])
        self._size, self._slack = float(np.ptp(vertices, axis=0).max()), 2.0**-46 * float(np.abs(vertices).max())
        self._solids = [SolidFacets(part, self._slack) for part in self._meshes if part.solid]
        self._n_open, self._n_winding = sum(len(part.mesh.faces) for part in parts if not part.solid), 0
        self.n_cells = min(_ROUND, max(1, _WINDING // max(self._n_open, 1)))
        self.lower, self.n_points = 0.0, 0

    @property
    def limit(self) -> float:
        """Cells with a lower upper bound [m] need not be halved."""
        return self.lower + max(_NARROW * self.lower, _LEAST * self._size)

    def reach(self, points: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """Upper bounds (k,) of how far points (k, 3) of the facets around pieces are from the body, negative inside.

        The piece itself has a point no farther off than the deviation, and the distances of both from the body differ
        by no more.
        """
        self.n_points += len(points)
        self._n_winding += len(points) * self._n_open
        is_affordable = self._n_winding <= _MAX_WINDING
        self._n_winding -= 0 if is_affordable else len(points) * self._n_open
        lower, upper = reach_bounds(self._meshes, points, wrapped=is_affordable)
        for part in self._convex:
            away = distance(part.shape, _POINT, part.X, poses_at(points), signed=False, check_poses=False)
            lower, upper = np.minimum(lower, away.lower), np.minimum(upper, away.upper)
        self.lower = max(self.lower, float((lower - self._deviations[owner]).max()) - self._slack)
        return upper

    def bounds(self, cells: np.ndarray, owner: np.ndarray, known: np.ndarray) -> np.ndarray:
        """(k,) upper bounds of how far a point of each cell (k, 4, 3) is from the body; ``known`` : of larger cells.

        No point is farther from the body than the middle and the way from there. The distance from a convex part is
        convex: on a cell a corner has the largest. Points in a solid after a way are no farther off than the way.
        """
        middles = cells.mean(axis=1)
        reach = np.sqrt(np.square(cells - middles[:, None]).sum(axis=2)).max(axis=1) + self._slack
        out = np.minimum(known, np.maximum(self.reach(middles, owner) + reach, 0.0))
        X = poses_at(cells.reshape(-1, 3))
        for part in self._convex:
            away = distance(part.shape, _POINT, part.X, X, signed=False, check_poses=False).upper
            np.minimum(out, np.reshape(away, (-1, 4)).max(axis=1), out=out)
        for solid in self._solids:
            for way, share in ((_FLUSH * self._size, 1.0), (self.limit, _TOWARDS), (self.limit, 0.5)):
                rows = np.flatnonzero((out > self.limit) & (reach > way))
                out[rows[solid.hold_moved(cells[rows], way, share)]] = way + self._slack
        return out


def _cells(piece: BodyPart) -> np.ndarray:
    """(m, 4, 3) tetrahedra from a point inside of a piece to the facets around."""
    inner = np.broadcast_to(piece.mesh.vertices.mean(axis=0), (len(piece.mesh.faces), 1, 3))
    return np.concatenate([piece.corners, inner], axis=1)


def _halved(cells: np.ndarray) -> np.ndarray:
    """The halves (2 k, 4, 3) of tetrahedra, cut at the middle of their longest edges."""
    edge = np.square(cells[:, _ENDS[:, 0]] - cells[:, _ENDS[:, 1]]).sum(axis=2).argmax(axis=1)
    rows, (first, second) = np.arange(len(cells)), _ENDS[edge].T
    middle = 0.5 * (cells[rows, first] + cells[rows, second])
    out = np.repeat(cells, 2, axis=0)
    out[2 * rows, second], out[2 * rows + 1, first] = middle, middle
    return out
