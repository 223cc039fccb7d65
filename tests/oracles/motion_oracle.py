"""First contacts by dense sampling and subdivision: no code of the engine, numpy and scipy alone.

A body's pose at a time is worked out with scipy's rotations; how far two bodies are apart comes from separating axes,
all of them, or from closed forms. Where bodies overlap the value is negative. `judge` looks at many times, and ever
closer at those around the least values. `subdivide` leaves no time out: a span is free where the gap at its middle is
more than points can move in half of it, and is cut into shorter ones otherwise.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

#: gap(R_WA, p_WA, R_WB, p_WB) → (n,), of (n, 3, 3) and (n, 3).
Gap = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class BodyMotion:
    """n bodies of one shape in motion: (n, 4, 4) at both ends, or their angular velocities (n, 3) besides."""

    def __init__(self, X0: np.ndarray, X1: np.ndarray, omega: np.ndarray | None = None):
        self.start = Rotation.from_matrix(X0[:, :3, :3])
        self.p0, self.p1 = X0[:, :3, 3], X1[:, :3, 3]
        between = Rotation.from_matrix(X1[:, :3, :3]) * self.start.inv()
        self.omega = between.as_rotvec() if omega is None else omega

    def some(self, which: np.ndarray) -> BodyMotion:
        """Those of these numbers, which may repeat."""
        body = copy.copy(self)
        body.start, body.p0, body.p1, body.omega = (
            self.start[which], self.p0[which], self.p1[which], self.omega[which]
        )
        return body

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """((n, 3, 3), (n, 3)) at n times."""
        turned = Rotation.from_rotvec(time[:, None] * self.omega) * self.start
        return turned.as_matrix(), self.p0 + time[:, None] * (self.p1 - self.p0)


class Judged(NamedTuple):
    """Of n motions: whether a contact was seen before ``lower``, by how much and when; the gap at ``lower`` and at
    ``upper``; the least gap seen in all of the time before ``lower``, or before 1."""

    missed: np.ndarray
    depth: np.ndarray
    time: np.ndarray
    at_lower: np.ndarray
    at_upper: np.ndarray
    least: np.ndarray


def judge(
    gap: Gap, A: BodyMotion, B: BodyMotion, lower: np.ndarray, upper: np.ndarray, *, samples: int = 32,
    rounds: int = 7, tolerance: float | np.ndarray = 0.0,
) -> Judged:
    """Look for contacts before ``lower`` (1 where a motion is said to be free).

    tolerance : gaps below minus this are contacts [m].   samples : times to begin with, evenly.   rounds : of
    subdivision: each looks at eight times between the neighbours of the least gap so far.
    """

    def at(time: np.ndarray) -> np.ndarray:
        return gap(*A.at(time), *B.at(time))

    # the very end is left out: there the gap is 0 by right
    last = lower * (1.0 - 1e-12) - 1e-13
    grid = np.linspace(0.0, 1.0, samples + 1)[:, None] * np.maximum(last, 0.0)
    values = np.array([at(time) for time in grid])
    rows = np.arange(len(last))
    best = values.argmin(axis=0)
    least, when = values[best, rows], grid[best, rows]
    left, right = grid[np.maximum(best - 1, 0), rows], grid[np.minimum(best + 1, samples), rows]
    for _ in range(rounds):
        times = left + np.linspace(0.0, 1.0, 9)[:, None] * (right - left)
        inner = np.array([at(time) for time in times])
        best = inner.argmin(axis=0)
        better = inner[best, rows] < least
        least, when = np.where(better, inner[best, rows], least), np.where(better, times[best, rows], when)
        left, right = times[np.maximum(best - 1, 0), rows], times[np.minimum(best + 1, 8), rows]
    looked_at = last > 0.0
    missed = looked_at & (least < -tolerance)
    return Judged(missed, -least, when, at(lower), at(np.minimum(upper, 1.0)), least)


class Subdivided(NamedTuple):
    """Of n motions: whether a contact was seen before ``lower``, by how much and when; and how many gaps were asked."""

    missed: np.ndarray
    depth: np.ndarray
    time: np.ndarray
    n_gaps: int


def speeds(A: BodyMotion, B: BodyMotion, reach_a: float, reach_b: float) -> np.ndarray:
    """(n,) bounds of how fast any two points of A and B come nearer each other, seen from W or from A.

    reach_a, reach_b : distances of their points from their origins at most; that of a half-space A is infinite.
    """
    turn_a, turn_b = (np.linalg.norm(body.omega, axis=1) for body in (A, B))
    d0, d1 = B.p0 - A.p0, B.p1 - A.p1
    v = np.linalg.norm(d1 - d0, axis=1)
    farthest = np.maximum(np.linalg.norm(d0, axis=1), np.linalg.norm(d1, axis=1))
    from_a = v + turn_a * (farthest + reach_b) + turn_b * reach_b
    return from_a if np.isinf(reach_a) else np.minimum(from_a, v + turn_a * reach_a + turn_b * reach_b)


def subdivide(
    gap: Gap, A: BodyMotion, B: BodyMotion, lower: np.ndarray, speed: np.ndarray, floor: float,
    tolerance: float | np.ndarray = 0.0,
) -> Subdivided:
    """Prove that there is no contact before ``lower`` (1 where a motion is said to be free), or find one.

    speed : (n,) bounds of `speeds`.   tolerance : gaps below minus this are contacts [m].
    floor : spans in which nothing moves by more than this [m] are not cut any more: a contact that is overlooked is
        shallower than the floor.
    """
    n = len(lower)
    missed, depth, when, n_gaps = np.zeros(n, dtype=bool), np.full(n, -np.inf), np.zeros(n), 0
    tolerance = np.broadcast_to(tolerance, n)
    motion = np.flatnonzero(lower > 0.0)
    left, right = np.zeros(len(motion)), lower[motion] * (1.0 - 1e-12)
    while len(motion):
        middle, half = 0.5 * (left + right), 0.5 * (right - left) * speed[motion] * (1.0 + 1e-9)
        gaps = np.empty(len(motion))
        for some in np.array_split(np.arange(len(motion)), len(motion) // 4096 + 1):
            at = middle[some]
            gaps[some] = gap(*A.some(motion[some]).at(at), *B.some(motion[some]).at(at))
        n_gaps += len(motion)
        deepest = np.lexsort((-gaps, motion))[::-1]  # the least gap of each motion comes last
        of, first = np.unique(motion[deepest], return_index=True)
        least = deepest[first]
        better = -gaps[least] > depth[of]
        depth[of[better]], when[of[better]] = -gaps[least][better], middle[least][better]
        missed = depth > tolerance
        todo = (gaps <= half) & (half > floor) & ~missed[motion]
        pieces = np.clip(np.ceil(half[todo] / np.maximum(gaps[todo], 1e-300)), 2, 8).astype(np.int64)
        begin, width = np.repeat(left[todo], pieces), np.repeat((right - left)[todo] / pieces, pieces)
        rank = np.arange(len(begin)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        motion = np.repeat(motion[todo], pieces)
        left, right = begin + rank * width, begin + (rank + 1) * width
    return Subdivided(missed, depth, when, n_gaps)


# --- gaps ---------------------------------------------------------------------------------------


def polytope_gap(points_a, normals_a, edges_a, points_b, normals_b, edges_b) -> Gap:
    """The gap along the best of all separating axes (Gottschalk, Lin and Manocha 1996): minus the depth of overlaps, a
    lower bound of the distance of bodies apart, positive where they are."""

    n_axes = len(normals_a) + len(normals_b) + len(edges_a) * len(edges_b)
    at_once = max(4_000_000 // (n_axes * (len(points_a) + len(points_b))), 1)

    def gap(*poses):
        n = len(poses[0])
        parts = [some_gaps(*(of[k : k + at_once] for of in poses)) for k in range(0, n, at_once)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def some_gaps(R_WA, p_WA, R_WB, p_WB):
        a = np.einsum("nij,kj->nki", R_WA, points_a)
        b = np.einsum("nij,kj->nki", R_WB, points_b) + (p_WB - p_WA)[:, None]
        faces = np.concatenate([normals_a @ R_WA.transpose(0, 2, 1), normals_b @ R_WB.transpose(0, 2, 1)], axis=1)
        e, f = edges_a @ R_WA.transpose(0, 2, 1), edges_b @ R_WB.transpose(0, 2, 1)
        across = np.cross(e[:, :, None], f[:, None]).reshape(len(a), -1, 3)
        length = np.linalg.norm(across, axis=2)
        across /= np.where(length > 1e-7, length, 1.0)[:, :, None]
        axes = np.concatenate([faces, across], axis=1)
        of_a, of_b = axes @ a.transpose(0, 2, 1), axes @ b.transpose(0, 2, 1)
        gaps = np.maximum(of_b.min(axis=2) - of_a.max(axis=2), of_a.min(axis=2) - of_b.max(axis=2))
        gaps[:, faces.shape[1] :][length <= 1e-7] = -np.inf
        return gaps.max(axis=1)

    return gap


def box_features(size) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points, normals, edges) of a box."""
    return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size, np.eye(3), np.eye(3)


def simplex_features(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points, normals, edges) of a tetrahedron or a triangle."""
    edges = np.array([q - p for p, q in itertools.combinations(points, 2)])
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    normals = np.array([np.cross(q - p, r - p) for p, q, r in itertools.combinations(points, 3)])
    if len(points) == 3:  # a flat body is separated in its own plane, too
        normals = np.concatenate([normals, np.cross(normals[0], edges)])
    return points, normals / np.linalg.norm(normals, axis=1)[:, None], edges


def hull_features(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(vertices, normals, edges) of the hull of points in general position."""
    hull = ConvexHull(points)
    pairs = np.unique(np.sort(hull.simplices[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    edges = points[pairs[:, 1]] - points[pairs[:, 0]]
    return points[hull.vertices], hull.equations[:, :3], edges / np.linalg.norm(edges, axis=1)[:, None]


def moved_features(features, R: np.ndarray, p) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Those of the polytope turned by R and moved by p."""
    points, normals, edges = features
    return points @ R.T + np.asarray(p), normals @ R.T, edges @ R.T


def segment_gap(half_a: float, half_b: float, radius: float) -> Gap:
    """Capsules, or spheres where a half length is 0: the nearest points of two segments (Ericson 2005, 5.1.9)."""

    def gap(R_WA, p_WA, R_WB, p_WB):
        u, v, w = R_WA[:, :, 2] * half_a, R_WB[:, :, 2] * half_b, p_WB - p_WA
        best = np.full(len(w), np.inf)
        uu, vv, uv = (u * u).sum(axis=1), (v * v).sum(axis=1), (u * v).sum(axis=1)
        wu, wv = (w * u).sum(axis=1), (w * v).sum(axis=1)

        def along(value, square):
            return np.clip(value / np.where(square > 0.0, square, 1.0), -1.0, 1.0)

        det = uu * vv - uv * uv
        safe = np.where(det > 1e-14 * uu * vv, det, 1.0)
        inner = np.clip((wu * vv - wv * uv) / safe, -1.0, 1.0)
        for s in (inner, np.ones_like(wu), -np.ones_like(wu), along(wu + uv, uu), along(wu - uv, uu)):
            t = along(s * uv - wv, vv)
            for s2 in (s, along(wu + t * uv, uu)):
                best = np.minimum(best, np.linalg.norm(w + t[:, None] * v - s2[:, None] * u, axis=1))
        return best - radius

    return gap


def point_gap(distance: Callable[[np.ndarray], np.ndarray], radius: float) -> Gap:
    """A sphere A and any body B, by the signed distance of points in B's frame."""

    def gap(R_WA, p_WA, R_WB, p_WB):
        return distance(np.einsum("nji,nj->ni", R_WB, p_WA - p_WB)) - radius

    return gap


def box_distance(half: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    def distance(p):
        q = np.abs(p) - half
        return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)

    return distance


def _polygon_distance(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Signed distance of points (n, 2) from a convex polygon whose corners run counter-clockwise."""
    best, inside = np.full(len(p), np.inf), np.full(len(p), -np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        e = b - a
        t = np.clip((p - a) @ e / (e @ e), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(p - a - t[:, None] * e, axis=1))
        inside = np.maximum(inside, (p - a) @ np.array([e[1], -e[0]]) / np.linalg.norm(e))
    return np.where(inside <= 0.0, inside, best)


def round_distance(profile: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Of a body of revolution about z, by the corners (r, z) of its profile, mirrored at the axis."""

    def distance(p):
        return _polygon_distance(np.stack([np.hypot(p[:, 0], p[:, 1]), p[:, 2]], axis=1), profile)

    return distance


def cylinder_distance(radius: float, length: float) -> Callable[[np.ndarray], np.ndarray]:
    h = 0.5 * length
    return round_distance(np.array([(-radius, -h), (radius, -h), (radius, h), (-radius, h)]))


def cone_distance(radius: float, length: float) -> Callable[[np.ndarray], np.ndarray]:
    h = 0.5 * length
    return round_distance(np.array([(-radius, -h), (radius, -h), (0.0, h)]))


def ellipsoid_distance(radii: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The nearest point is a² p / (t + a²), coordinate by coordinate, for the one t > −min a² that puts it on the
    surface (Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013)."""
    square = radii * radii

    def distance(p):
        p = np.abs(p)
        low = (-square + radii * p).max(axis=1)  # one term alone is 1 there
        high = -square.min() + np.linalg.norm(radii * p, axis=1)
        for _ in range(64):
            t = 0.5 * (low + high)
            outside = (np.square(radii * p / np.maximum(t[:, None] + square, 1e-300))).sum(axis=1) > 1.0
            low, high = np.where(outside, t, low), np.where(outside, high, t)
        x = square * p / np.maximum(high[:, None] + square, 1e-300)
        return np.sign(high) * np.linalg.norm(p - x, axis=1)

    return distance


def plane_gap(normal: np.ndarray, offset: float, points: np.ndarray, radius: float = 0.0) -> Gap:
    """A half-space A and the hull of points B."""

    def gap(R_WA, p_WA, R_WB, p_WB):
        n = R_WA @ (normal / np.linalg.norm(normal))
        x = np.einsum("nij,kj->nki", R_WB, points) + (p_WB - p_WA)[:, None]
        return np.einsum("nki,ni->nk", x, n).min(axis=1) - offset / np.linalg.norm(normal) - radius

    return gap


def union_gap(gaps: list[Gap]) -> Gap:
    """The least of several."""

    def gap(*poses):
        return np.min([one(*poses) for one in gaps], axis=0)

    return gap
