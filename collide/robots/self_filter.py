"""Points of a cloud on or in a robot, in a sensor's view of the surroundings.

Points outside the box around all bodies are left out first, then points outside the box of each body, along the axes of
the world and turned with the link; the rest are asked as balls of radius padding + radius, at once, as by
`collide.collide`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from collide.base.poses_at import poses_at
from collide.pairs import query
from collide.robots.check_scene import HALF
from collide.robots.check_tables import RobotBody, without_meshes
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull

#: What roundings of boxes and of points are, as a part of the numbers met.
_ROUNDING = 2.0**-40
_ORIGIN = np.zeros((1, 3))


def points_of_robot(
    bodies: Sequence[RobotBody], body_boxes: np.ndarray, X_WLs: np.ndarray, points_W: np.ndarray,
    radii: np.ndarray | float, padding: Mapping[str, float], slop: float, threads: int,
) -> np.ndarray:
    """(n,) bool: points within padding of a body's shape.

    body_boxes : (bodies, BOX).   X_WLs : (links, 4, 4).   points_W : (n, 3).
    radii : of balls around the points [m], of all or (n,).   slop : how far rounding may have moved points [m], added
        to radii.
    """
    belongs = np.zeros(len(points_W), dtype=bool)
    extra = np.array([padding.get(body.name, 0.0) for body in bodies]) + float(np.max(radii, initial=0.0)) + slop
    boxes = [_box_in_world(body_boxes[k], X_WLs[body.link], extra[k]) for k, body in enumerate(bodies)]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    near = _within(points_W, np.arange(len(points_W)), low, high)
    columns = np.ascontiguousarray(points_W[near].T)
    for k, body in enumerate(bodies):
        some = np.flatnonzero(_are_inside(columns, *boxes[k]))
        some = some[~belongs[near[some]]]
        some = some[_are_in_turned_box(columns[:, some].T, body_boxes[k], X_WLs[body.link], extra[k])]
        if len(some):
            which, by = near[some], padding.get(body.name, 0.0)
            of_balls = radii if np.ndim(radii) == 0 else radii[which]  # type: ignore[index]
            belongs[which] = _meet(body, X_WLs[body.link], columns[:, some].T, _sums(of_balls, by, slop), threads)
    return belongs


def points_in_world(p_C: np.ndarray, X_WC: np.ndarray | None) -> tuple[np.ndarray, float]:
    """((n, 3) points in the world, how far rounding may have moved them [m])."""
    if X_WC is None or (X_WC == np.eye(4)).all():
        return p_C, 0.0
    R, t = X_WC[:3, :3], X_WC[:3, 3]
    size = 3.0 * float(np.abs(p_C).max(initial=0.0)) * float(np.abs(R).max()) + float(np.abs(t).max())
    return p_C @ R.T + t, 2.0**-48 * size


def _within(points: np.ndarray, some: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Some rows of points, less rows outside a box; an axis at a time, on fewer and fewer rows."""
    for axis in range(3):
        x = points[some, axis] if axis else points[:, 0]
        some = some[(x >= low[axis]) & (x <= high[axis])]
    return some


def _are_inside(columns: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(k,) bool: points, as columns (3, k), within a box."""
    x, y, z = columns
    return (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])


def _box_in_world(box: np.ndarray, X_WL: np.ndarray, extra: float) -> tuple[np.ndarray, np.ndarray]:
    """(low, high) of a box of a link in the world, larger by ``extra`` [m], rounding added."""
    centre = X_WL[:3, :3] @ box[:HALF] + X_WL[:3, 3]
    half = np.abs(X_WL[:3, :3]) @ box[HALF:] + extra + _slack(box, X_WL, extra)
    return centre - half, centre + half


def _are_in_turned_box(points_W: np.ndarray, box: np.ndarray, X_WL: np.ndarray, extra: float) -> np.ndarray:
    """(k,) bool: points that may lie within ``extra`` [m] of a box of a link."""
    points_L = (points_W - X_WL[:3, 3]) @ X_WL[:3, :3]
    return (np.abs(points_L - box[:HALF]) <= box[HALF:] + extra + _slack(box, X_WL, extra)).all(axis=1)


def _slack(box: np.ndarray, X_WL: np.ndarray, extra: float) -> float:
    """How far roundings, and a matrix that is not quite a rotation, may move a side of a box [m]."""
    off = float(np.abs(X_WL[:3, :3].T @ X_WL[:3, :3] - np.eye(3)).max())
    size = float(np.abs(box).sum() + np.abs(X_WL[:3, 3]).sum()) + extra
    return (_ROUNDING + 8.0 * off) * size


def _sums(radii: np.ndarray | float, padding: float, slop: float) -> np.ndarray | float:
    """Radii of balls that meet a body where the given balls are within the padding; rounded upwards if at all."""
    sums = np.asarray(radii) + padding
    rounded = (sums - padding != radii) | (sums - radii != padding)
    sums = np.where(rounded, np.nextafter(sums, math.inf), sums)
    return sums if not slop else np.nextafter(sums + slop, math.inf)


def _meet(
    body: RobotBody, X_WL: np.ndarray, points_W: np.ndarray, radii: np.ndarray | float, threads: int
) -> np.ndarray:
    """(k,) bool: balls around points (k, 3) in contact with a body.   radii : of all, or (k,)."""
    X_WB = poses_at(points_W)
    X_WA, shape = np.ascontiguousarray(X_WL), without_meshes(body.shape) or body.shape
    if isinstance(shape, Compound) and len(shape.items) == 1 and (shape.items[0][1] == np.eye(4)).all():
        shape = shape.items[0][0]
    if np.ndim(radii) == 0:
        ball = ConvexHull(_ORIGIN, radius=float(radii))
        return query.collide(shape, ball, X_WA, X_WB, check_poses=False, threads=threads)
    distinct, which = np.unique(radii, return_inverse=True)
    balls = [ConvexHull(_ORIGIN, radius=radius) for radius in distinct.tolist()]
    shapes = [balls[k] for k in which.reshape(-1).tolist()]
    return query.collide([shape] * len(shapes), shapes, X_WA, X_WB, check_poses=False, threads=threads)
