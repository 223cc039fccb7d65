"""First contacts by dense sampling and subdivision: no code of the engine, numpy and scipy alone.

A body's pose at a time is worked out with scipy's rotations; how far two bodies are apart comes from separating axes,
all of them, or from closed forms. Where bodies overlap the value is negative. `judge` looks at many
times, and ever closer at those around the least values and around the first contact found.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
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
) -> Judged:  # fmt: skip
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


# --- gaps ---------------------------------------------------------------------------------------


def polytope_gap(points_a, normals_a, edges_a, points_b, normals_b, edges_b) -> Gap:
    """The gap along the best of all separating axes (Gottschalk, Lin and Manocha 1996): minus the depth of overlaps, a
    lower bound of the distance of bodies apart, positive where they are."""

    def gap(R_WA, p_WA, R_WB, p_WB):
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
