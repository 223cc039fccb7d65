"""The obstacle to a translating polygon: configuration obstacles in the plane, exactly.

As in space (`configuration_obstacle.py`): all sums of an edge and a vertex whose normals agree, with signs, are closed
chains whose winding number around x is the Euler characteristic of A ∩ (R B + x) (L. Guibas, L. Ramshaw, J. Stolfi,
"A kinetic framework for computational geometry", 1983). Without holes the characteristic is the number of parts of the
overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, InvalidPose, brief
from collide.numerics.exact_points import integers
from collide.solids.limits import UNLIMITED, Limits
from collide.solids.plane_arrangement import PlaneArrangement, PlanePoint, Vector


class PlanarObstacle(NamedTuple):
    """The positions x [m] with a hit of the polygons A and R B + x.

    rings : the borders, (k, 2) each: outer rings counter-clockwise, holes clockwise; straight corners are left out.
    moved : the farthest a corner was moved by rounding to doubles [m].
    n_pieces, n_corners, n_faces, n_asked : edges of the convolution, points of their arrangement, its faces, and the
        faces decided by asking the polygons at a point.
    """

    rings: list[np.ndarray]
    moved: float
    n_pieces: int
    n_corners: int
    n_faces: int
    n_asked: int

    @property
    def area(self) -> float:
        """The area [m²], rounded."""
        return float(sum(0.5 * (_cross(r - r[0], np.roll(r, -1, axis=0) - r[0])).sum() for r in self.rings))


class ExactPolygon(NamedTuple):
    """A polygon with holes in integers.   points : by id.   before, after : of every point its neighbours."""

    points: list[Vector]
    before: list[int]
    after: list[int]
    n_rings: int

    def along(self) -> list[Vector]:
        """For every point the vector to the next point."""
        return [(self.points[j][0] - x, self.points[j][1] - y) for (x, y), j in zip(self.points, self.after)]


class ExactPlanarObstacle(NamedTuple):
    """Before rounding: the arrangement, which faces belong, and 2^grid, the unit of its coordinates."""

    arrangement: PlaneArrangement
    keep: np.ndarray
    grid: int
    n_pieces: int
    n_asked: int


def planar_obstacle(A, B, R, limits: Limits, check: bool = True) -> PlanarObstacle:
    """`configuration_obstacle` for polygons, lists of rings (k, 2)."""
    exact = exact_planar_obstacle(A, B, R, limits, check)
    arrangement, unit = exact.arrangement, exact.grid
    rings = []
    for ring in border_rings(arrangement, exact.keep):
        corners = np.array([_rounded(arrangement.points[p], unit) for p in ring])
        changed = (corners != np.roll(corners, 1, axis=0)).any(axis=1)
        if changed.sum() > 2:
            rings.append(corners[changed])
    if not rings:
        raise InvalidArgument(
            "configuration_obstacle: rounding leaves nothing of it: A and B are too small for doubles"
        )
    largest = np.concatenate(rings)
    moved = float(np.sqrt(np.square(0.5 * np.spacing(np.abs(largest))).sum(axis=1).max()))
    return PlanarObstacle(rings, moved, exact.n_pieces, len(arrangement.points), len(exact.keep), exact.n_asked)


def exact_planar_obstacle(A, B, R, limits: Limits = UNLIMITED, check: bool = True) -> ExactPlanarObstacle:
    """The same before rounding."""
    limits.stage("putting edges and corners together")
    rotation = np.eye(2) if R is None else checks.array("configuration_obstacle: R", R, "(2, 2)", InvalidArgument)
    if rotation.shape != (2, 2) or not np.isfinite(rotation).all():
        raise InvalidArgument(f"configuration_obstacle: R of polygons must be a (2, 2) rotation, got {brief(R)}")
    off = rotation @ rotation.T - np.eye(2)
    if check and (np.abs(off).max() > 1e-9 or np.linalg.det(rotation) < 0.0):
        raise InvalidPose(f"configuration_obstacle: R must be a rotation: R Rᵀ − I is {np.abs(off).max():.3g}")
    a, grid_a = _exact_rings("A", A, np.eye(2))
    b, grid_b = _exact_rings("B", B, -rotation)
    grid = min(grid_a, grid_b)
    A, B = (_polygon(name, rings, g - grid) for name, rings, g in (("A", a, grid_a), ("B", b, grid_b)))
    points, segments = _convolution(A, B)
    arrangement = PlaneArrangement(points, segments, limits)
    keep = arrangement.winding != 0
    asked: list[int] = []
    if A.n_rings > 1 or B.n_rings > 1:
        asked = np.flatnonzero(~keep).tolist()
        for face in limits.watched("asking the polygons themselves", asked):
            keep[face] = polygons_meet_at(A, B, arrangement.point_within(face))
    return ExactPlanarObstacle(arrangement, keep, grid, len(segments), len(asked))


def border_rings(arrangement: PlaneArrangement, keep: np.ndarray) -> list[list[int]]:
    """Points around the faces to keep, on the left of the rings; rings touching in a point are separated at the
    point.
    """
    inside = keep[arrangement.face]
    border = inside & ~inside[np.arange(len(inside)) ^ 1]
    onward = arrangement.onward
    starts = arrangement.edges.ravel()
    remaining = set(np.flatnonzero(border).tolist())
    rings = []
    while remaining:
        h = first = min(remaining)
        ring = []
        while True:
            remaining.discard(h)
            n = int(onward[h])
            while not border[n]:
                n = int(onward[n ^ 1])
            (a, b), (c, d) = arrangement.direction(h), arrangement.direction(n)
            if a * d != b * c or a * c + b * d < 0:
                ring.append(int(starts[n]))
            h = n
            if h == first:
                break
        rings.append(ring)
    return rings


def polygons_meet_at(A: ExactPolygon, B: ExactPolygon, x: PlanePoint) -> bool:
    """Whether A has a point in common with x − B."""
    w = x[2]
    p = [(a * w, b * w) for a, b in A.points]
    q = [(x[0] - a * w, x[1] - b * w) for a, b in B.points]
    low, high = [], []
    for points, after in ((p, A.after), (q, B.after)):
        near = np.array([[float(c) for c in v] for v in points])
        low.append(np.minimum(near, near[after]))
        high.append(np.maximum(near, near[after]))
    slack = 2.0**-48 * max(float(np.abs(bound).max()) for bound in (*low, *high))
    apart = (low[0][:, None] > high[1][None] + slack) | (low[1][None] > high[0][:, None] + slack)
    for i, j in np.argwhere(~apart.any(axis=2)).tolist():
        if _segments_meet(p[i], p[A.after[i]], q[j], q[B.after[j]]):
            return True
    return any(_holds(q, B.after, v) for v in p) or any(_holds(p, A.after, v) for v in q)


# --- the convolution --------------------------------------------------------------------------------------------------


def _convolution(A: ExactPolygon, B: ExactPolygon) -> tuple[list[Vector], np.ndarray]:
    """(points, directed segments (k, 2) of them): edges and corners whose normals agree, run back where the corner is
    reflex. Parallel edges are told apart as if B were turned by an infinitely small angle.
    """
    along_p, along_q = A.along(), B.along()
    turns = _turn_signs(along_p, along_q)
    at_q = _corner_counts(B, along_q, -turns[:, B.before], turns)
    at_p = _corner_counts(A, along_p, turns[A.before].T, -turns.T)
    pieces = []
    for k, (edges, counts) in enumerate(((A, at_q), (B, at_p))):
        e, v = np.nonzero(counts)
        ends = np.stack([e, np.array(edges.after)[e]], axis=1)
        ends = np.where(counts[e, v][:, None] < 0, ends[:, ::-1], ends)
        corner = np.repeat(v[:, None], 2, axis=1)
        pieces.append(np.stack([ends, corner] if k == 0 else [corner, ends], axis=2))
    pairs, which = np.unique(np.concatenate(pieces).reshape(-1, 2), axis=0, return_inverse=True)
    ids: dict[Vector, int] = {}
    of_pair = np.array(
        [
            ids.setdefault((A.points[i][0] + B.points[j][0], A.points[i][1] + B.points[j][1]), len(ids))
            for i, j in pairs.tolist()
        ]
    )
    return list(ids), of_pair[which.reshape(-1, 2)]


def _turn_signs(e: list[Vector], g: list[Vector]) -> np.ndarray:
    """(n, m) int8 signs of e × g, never 0: parallel ones as if g were turned to the left a little."""
    near_e, near_g = (np.array([[x / max(abs(a), abs(b)) for x in (a, b)] for a, b in v]) for v in (e, g))
    near = near_e[:, :1] * near_g[None, :, 1] - near_e[:, 1:] * near_g[None, :, 0]
    signs = np.sign(near).astype(np.int8)
    for i, j in np.argwhere(np.abs(near) <= 2.0**-48).tolist():
        (a, b), (c, d) = e[i], g[j]
        value = a * d - b * c or a * c + b * d
        signs[i, j] = (value > 0) - (value < 0)
    return signs


def _corner_counts(B: ExactPolygon, along: list[Vector], after_into: np.ndarray, before_out: np.ndarray) -> np.ndarray:
    """(edges, corners of B) int8: 1 where an edge's direction is between the edges at a convex corner, −1 at a reflex
    corner.

    after_into : signs of (the edge into each corner) × (each direction).
    before_out : of (each direction) × (the edge out of each corner).
    """
    bend = np.array([_sign(along[i], along[k]) for k, i in enumerate(B.before)], dtype=np.int8)
    between = (after_into == bend) & (before_out == bend)
    return np.where(between, bend, 0).astype(np.int8)


def _sign(a: Vector, b: Vector) -> int:
    value = a[0] * b[1] - a[1] * b[0]
    return (value > 0) - (value < 0)


# --- polygons as they are given ---------------------------------------------------------------------------------------


def _exact_rings(name: str, rings, R: np.ndarray) -> tuple[list[list[Vector]], int]:
    """(rings under R in integers, exponent of their unit)."""
    if isinstance(rings, np.ndarray) and rings.ndim == 2:
        rings = [rings]
    if not isinstance(rings, Sequence) or not len(rings):
        raise InvalidArgument(
            f"configuration_obstacle: {name} must be a solid or a list of rings (k, 2), got {brief(rings)}"
        )
    out = []
    for k, ring in enumerate(rings):
        try:
            corners = np.array(ring, dtype=np.float64)
        except (TypeError, ValueError):
            corners = np.zeros(0)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
            raise InvalidArgument(
                f"configuration_obstacle: ring {k} of {name} must be (k, 2) finite corners, k ≥ 3, got {brief(ring)}"
            )
        out.append(corners)
    flat, grid = integers(np.concatenate(out))
    rotation, turn_grid = integers(R)
    a, b, c, d = rotation
    placed = [(a * x + b * y, c * x + d * y) for x, y in zip(flat[0::2], flat[1::2])]
    ends = np.cumsum([0] + [len(ring) for ring in out]).tolist()
    return [placed[i:j] for i, j in pairwise(ends)], grid + turn_grid


def _polygon(name: str, rings: list[list[Vector]], shift: int) -> ExactPolygon:
    """Rings on a finer grid, checked: they touch nowhere, and wind once around what they enclose."""
    points: list[Vector] = []
    before: list[int] = []
    after: list[int] = []
    for ring in rings:
        start, n = len(points), len(ring)
        points += [(x << shift, y << shift) for x, y in ring]
        before += [start + (k - 1) % n for k in range(n)]
        after += [start + (k + 1) % n for k in range(n)]
    same = len(points) - len(set(points))
    arrangement = None
    if not same:
        arrangement = PlaneArrangement(points, np.stack([np.arange(len(points)), after], axis=1))
    if arrangement is None or len(arrangement.points) > len(points) or len(arrangement.edges) < len(points):
        raise InvalidArgument(
            f"configuration_obstacle: edges of {name} touch or cross, or corners are in one place; give "
            "rings that do not"
        )
    wrong = sorted(set(arrangement.winding.tolist()) - {0, 1})
    if wrong or len(arrangement._splits):
        raise InvalidArgument(
            f"configuration_obstacle: the rings of {name} wind {wrong[0] if wrong else 0} times around a part of the "
            "plane: outer rings must be counter-clockwise, holes clockwise"
        )
    return ExactPolygon(points, before, after, len(rings))


def _segments_meet(a: Vector, b: Vector, c: Vector, d: Vector) -> bool:
    def side(p, q, r):
        value = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        return (value > 0) - (value < 0)

    at_c, at_d, at_a, at_b = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    if at_c == at_d == 0:
        return all(max(min(a[k], b[k]), min(c[k], d[k])) <= min(max(a[k], b[k]), max(c[k], d[k])) for k in range(2))
    return at_c * at_d <= 0 and at_a * at_b <= 0


def _holds(points: list[Vector], after: list[int], v: Vector) -> bool:
    """Whether rings wind around a point off all of them."""
    total = 0
    for (x, y), j in zip(points, after):
        u, w = points[j]
        if (y > v[1]) != (w > v[1]):
            value = (u - x) * (v[1] - y) - (w - y) * (v[0] - x)
            if (value > 0) == (w > v[1]):
                total += 1 if w > v[1] else -1
    return total > 0


def _rounded(p: PlanePoint, grid: int) -> tuple[float, float]:
    up, down = max(grid, 0), max(-grid, 0)
    w = p[2] << down
    return (p[0] << up) / w + 0.0, (p[1] << up) / w + 0.0


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
