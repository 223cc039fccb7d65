"""A point cloud and a mesh at many poses, by how far points near the mesh's box are from its facets.

Points are listed by a walk down the cloud's tree with the mesh's box (`convex_walk_kernel.py`), and asked together for
their nearest facets (`nearest_facet_kernel.py`); solids are asked whether points off all facets lie inside. A distance
has the error of the facets' walk and the rounding of a posed point. Undecided poses, and depths, are left to the union
of the balls nearby.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.facet_bodies import Body, body_of, reach_of
from collide.lowering.packed_convex import pack_points
from collide.narrowphase.bounds import PROMISE_STORED
from collide.narrowphase.convex_kernel_calls import scratch
from collide.narrowphase.facets.facet_queries import points_in_solid
from collide.narrowphase.facets.nearest_facets import facets_nearest
from collide.narrowphase.facets.nearest_item_calls import GapQuestion, Items
from collide.narrowphase.facets.winding_numbers import INSIDE, ON_SURFACE, UNDECIDED
from collide.narrowphase.fields.convex_walk_kernel import list_balls_near
from collide.results import PAIR_DTYPE, How
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape

#: Balls listed of a pose to begin with, and so many times more each time; balls listed together.
_FIRST, _GROWTH, _TOGETHER = 16, 8, 1 << 18
#: Of the numbers met, what rounding moves a posed point by. Matrices farther off a rotation are left to others.
_ROUNDING, _FAR_OFF = 2.0**-44, 2.0**-40
_CORNERS = np.array(list(np.ndindex(2, 2, 2)), dtype=bool)
#: What is known of a pose: nothing yet; the bodies are apart; they meet; left to others.
UNKNOWN, APART, MEETS, OPEN = range(4)


class CloudAndMesh:
    """The bodies at n pairs of poses X_WC, X_WM (n, 4, 4), C-contiguous.

    items : of the cloud.   slack : (n,) how far rounding may move points [m].   is_near : (n,) near rotations.
    meeting : (n,) a ball known to meet the mesh, or −1.
    """

    def __init__(self, cloud: PointCloud, items: Items, mesh: Shape, X_WC: np.ndarray, X_WM: np.ndarray):
        self.cloud, self.items, self.body, self.X_WC, self.X_WM = cloud, items, body_of(mesh), X_WC, X_WM
        self._box = pack_points(_corners_of_box(self.body), self.body.radius)
        off = _off_rotations(X_WC) + _off_rotations(X_WM)
        self.size = np.abs(X_WC[:, :3, 3]).sum(axis=1) + np.abs(X_WM[:, :3, 3]).sum(axis=1)
        self.size += items.reach + reach_of(self.body)
        self.meeting = np.full(len(off), -1)
        self.slack, self.is_near = (_ROUNDING + 8.0 * off) * self.size, off <= _FAR_OFF

    def states(self) -> np.ndarray:
        """(n,) APART, MEETS or OPEN."""
        states = np.where(self.is_near, UNKNOWN, OPEN)
        margins, max_balls = np.zeros(len(states)), _FIRST
        while (rows := np.flatnonzero(states == UNKNOWN)).size:
            for some in np.array_split(rows, -(-len(rows) * max_balls // _TOGETHER)):
                near, is_whole = self._near(some, margins[some], max_balls, states)
                touches, is_clear = near.gaps + near.errors < 0.0, near.gaps - near.errors > 0.0
                self._meet(near, np.flatnonzero(touches), states)
                self._look_inside(near, is_clear & (states[near.rows] != MEETS), states)
                known = is_whole & (states[some] == UNKNOWN)
                states[some[known]] = APART
                unclear = near.rows[~touches & ~is_clear]
                states[unclear[states[unclear] == APART]] = OPEN
            max_balls *= _GROWTH
        return states

    def gaps(self, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """(rows of PAIR_DTYPE (n,), (n,) bool whether they are written) of bodies that are apart.

        limit : of bodies farther apart than this no more is status than how far they are at least [m].
        """
        n = len(self.X_WC)
        rows, states = np.zeros(n, dtype=PAIR_DTYPE), np.where(self.is_near, UNKNOWN, OPEN)
        margins = np.full(n, limit)
        lower, upper, max_balls = np.full(n, math.inf), np.full(n, math.inf), _FIRST
        while (asked := np.flatnonzero(states == UNKNOWN)).size:
            for some in np.array_split(asked, -(-len(asked) * max_balls // _TOGETHER)):
                near, is_whole = self._near(some, margins[some], max_balls, states)
                touches = near.gaps - near.errors <= 0.0
                states[near.rows[touches]] = OPEN
                self._meet(near, np.flatnonzero(near.gaps + near.errors < 0.0), states)
                np.minimum.at(lower, near.rows, near.gaps - near.errors)
                np.minimum.at(upper, near.rows, near.gaps + near.errors)
                margins[some] = np.minimum(upper[some], limit)
                self._write(rows, near, limit)
                self._look_inside(near, states[near.rows] == UNKNOWN, states)
                states[some[is_whole & (states[some] == UNKNOWN)]] = APART
            max_balls *= _GROWTH
        apart = states == APART
        beyond = apart & (lower > limit)
        rows["lower"], rows["upper"] = lower, upper
        rows["lower"][beyond] = np.minimum(lower, math.nextafter(limit, math.inf))[beyond]
        rows["distance"] = np.clip(rows["distance"], rows["lower"], rows["upper"])
        rows["certified"] = upper <= lower + PROMISE_STORED * self.size
        rows["vertices_a"] = rows["vertices_b"] = -1
        return rows, apart

    def _near(
        self, some: np.ndarray, margins: np.ndarray, max_balls: int, states: np.ndarray
    ) -> tuple[_Near, np.ndarray]:
        """(balls near at some poses, (k,) bool whether all balls within the margins are among them)."""
        question = GapQuestion(self.items, self._box, scratch())
        counts, numbers = np.empty(len(some), dtype=np.int64), np.empty((len(some), max_balls), dtype=np.int64)
        status, X_WC, X_WM = np.empty(len(some), dtype=np.uint8), self.X_WC[some], self.X_WM[some]
        list_balls_near(
            address_of(question.header), address_of(X_WC), address_of(X_WM), len(some), address_of(margins), max_balls,
            address_of(counts), address_of(numbers), address_of(status),
        )
        states[some[status == 2]] = OPEN
        listed = np.arange(max_balls) < counts[:, None]
        at, ball = np.nonzero(listed)[0], numbers[listed]
        points = self.cloud.points[ball]
        p_W = np.einsum("kij,kj->ki", X_WC[at, :3, :3], points) + X_WC[at, :3, 3]
        p_M = np.einsum("kji,kj->ki", X_WM[at, :3, :3], p_W - X_WM[at, :3, 3])
        facets = facets_nearest(self.body.tree, np.ascontiguousarray(p_M), 1)
        gaps = facets.distance - self.cloud.radii[ball] - self.body.radius
        errors = facets.error + self.slack[some[at]] + 2.0**-51 * (facets.distance + self.cloud.radii[ball])
        corners, slack = self._box.points, self.slack[some[at], None]
        in_box = ((p_M >= corners.min(axis=0) - slack) & (p_M <= corners.max(axis=0) + slack)).all(axis=1)
        near = _Near(some[at], ball, p_W, facets.point, facets.facet, facets.distance, gaps, errors, in_box)
        return near, status == 1

    def _look_inside(self, near: _Near, asked: np.ndarray, states: np.ndarray) -> None:
        """Of some balls: MEETS where a point lies inside of a solid, OPEN where that is open."""
        asked = np.flatnonzero(asked & near.in_box) if self.body.solid else np.empty(0, dtype=np.int64)
        if len(asked):
            rows, points = near.rows[asked], self.cloud.points[near.numbers[asked]]
            where = points_in_solid(self.body.tree, self.X_WM[rows], points, self.X_WC[rows])
            states[rows[where == UNDECIDED]] = OPEN
            self._meet(near, asked[(where == INSIDE) | (where == ON_SURFACE)], states)

    def _meet(self, near: _Near, some: np.ndarray, states: np.ndarray) -> None:
        """Some balls meet the mesh."""
        states[near.rows[some]] = MEETS
        self.meeting[near.rows[some]] = near.numbers[some]

    def _write(self, rows: np.ndarray, near: _Near, limit: float) -> None:
        """The rows of the balls nearest so far."""
        order = np.lexsort((near.numbers, near.gaps, near.rows))
        first = order[np.flatnonzero(np.diff(near.rows[order], prepend=-1))]
        rows_before = rows[near.rows[first]]
        first = first[(rows_before["how"] == How.UNDECIDED) | (near.gaps[first] < rows_before["distance"])]
        at, ball = near.rows[first], near.numbers[first]
        X_WM = self.X_WM[at]
        y_W = np.einsum("kij,kj->ki", X_WM[:, :3, :3], near.places[first]) + X_WM[:, :3, 3]
        with np.errstate(invalid="ignore", divide="ignore"):  # of points on the surface nothing is status
            normal = (y_W - near.points[first]) / near.distances[first, None]
        rows["distance"][at], rows["normal"][at], rows["how"][at] = near.gaps[first], normal, How.CLOSED_FORM
        rows["point_a"][at] = near.points[first] + self.cloud.radii[ball, None] * normal
        rows["point_b"][at] = y_W - self.body.radius * normal
        rows["part_a"][at], rows["part_b"][at] = ball, near.facets[first]


class _Near(NamedTuple):
    """Balls near a mesh at poses by row, (k,) each: numbers, points in the world, nearest places in the mesh's frame,
    facets, distances of points from facets, gaps [m] and their errors [m], whether points may be in the mesh's box.
    """

    rows: np.ndarray
    numbers: np.ndarray
    points: np.ndarray
    places: np.ndarray
    facets: np.ndarray
    distances: np.ndarray
    gaps: np.ndarray
    errors: np.ndarray
    in_box: np.ndarray


def _corners_of_box(body: Body) -> np.ndarray:
    """(8, 3) corners of the box at the root of a mesh's tree."""
    centres, half = body.tree.boxes([0])
    unit, wider = math.ldexp(1.0, body.tree.exponent), 1.0 + 2.0**-50
    low, high = (body.tree.centre + unit * (centres[0, 0] + side * wider * half[0, 0]) for side in (-1.0, 1.0))
    return np.where(_CORNERS, high, low)


def _off_rotations(X: np.ndarray) -> np.ndarray:
    R = X[:, :3, :3]
    return np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2))
