"""Balls of a cloud near another shape, or on its way, and some balls as a union.

A ball is left out where its centre is farther from the box around the other shape, along an axis of the cloud's frame,
than the distance and the ball's radius: rounding is added to the box.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from collide.lowering.extents import extent_of
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import bounding_parts_of
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Halfspace
from collide.shapes.shape import IDENTITY, Shape
from collide.transforms import inverse_pose

#: What rounding of a box's sides is, as a part of the numbers met.
_ROUNDING = 2.0**-40
#: Balls asked about to begin with, and so many times more each time.
_FIRST_ASKED, _GROWTH = 16, 4
#: Heights over a plane that differ by less than this part of the size are looked at again, ball by ball.
_LEVEL = 2.0**-36
_AXES = np.concatenate([np.eye(3), -np.eye(3)])


class BoxAround(NamedTuple):
    """A box along the axes of a cloud's frame around another shape [m]; infinite around half-spaces."""

    low: np.ndarray
    high: np.ndarray


def box_in_frame(shape: Shape, X_WC: np.ndarray, X_WS: np.ndarray) -> BoxAround:
    """The box around a shape at X_WS in the frame at X_WC, (4, 4) each, rounding added."""
    X_CS = inverse_pose(X_WC) @ X_WS
    low, high = np.full(3, math.inf), np.full(3, -math.inf)
    for packed, X_SP in bounding_parts_of(shape):
        if packed.kind == HALFSPACE:
            return BoxAround(np.full(3, -math.inf), np.full(3, math.inf))
        X_CP = X_CS @ X_SP
        ends = np.array([extent_of(packed, X_CP, axis) for axis in _AXES])
        low, high = np.minimum(low, -ends[3:]), np.maximum(high, ends[:3])
    size = np.abs(low).max() + np.abs(high).max() + np.abs(X_WC[:3, 3]).sum() + np.abs(X_WS[:3, 3]).sum()
    off = sum(np.abs(X[:3, :3].T @ X[:3, :3] - np.eye(3)).max() for X in (X_WC, X_WS))
    slack = (_ROUNDING + 8.0 * off) * size
    return BoxAround(low - slack, high + slack)


def balls_within(cloud: PointCloud, box: BoxAround, distance: float) -> np.ndarray:
    """Rows of the balls that may come within a distance of what is in a box [m], ascending."""
    reach = distance * (1.0 + 2.0**-40) + float(np.max(cloud.radius))
    some = cloud.tree.in_box(box.low - reach, box.high + reach)
    if np.ndim(cloud.radius) == 0:
        return some
    reaches, points = (cloud.radius[some] + distance * (1.0 + 2.0**-40))[:, None], cloud.points[some]
    return some[((points >= box.low - reaches) & (points <= box.high + reaches)).all(axis=1)]


def balls_on_way(
    cloud: PointCloud, X_WC: np.ndarray, origin: np.ndarray, vector: np.ndarray, limit: float, extra: float,
    *, first: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, earliest t) of the balls on the way of a ball from an origin along a vector of the world, by t.

    limit : of t.   extra : radius of the moving ball [m].   first : whether balls behind a ball met for sure may be
    left out.
    """
    R, t = X_WC[:3, :3], X_WC[:3, 3]
    way = np.concatenate([(origin - t) @ R, vector @ R])
    size = np.abs(cloud.points).max() + np.max(cloud.radius) + np.abs(t).sum() + np.abs(origin).sum() + extra
    slack = (_ROUNDING + 8.0 * np.abs(R.T @ R - np.eye(3)).max()) * size
    return cloud.tree.on_way(cloud.radius, way, limit, extra, slack, first)


def lowest_balls(A: PointCloud, B: Halfspace, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """Rows of the balls that are lowest over a plane, rounding counted in."""
    n = X_WB[:3, :3] @ B.normal
    heights = A.points @ (X_WA[:3, :3].T @ n) - A.radii
    size = np.abs(A.points).max() + float(np.max(A.radius)) + np.abs(X_WA[:3, 3]).sum() + np.abs(X_WB[:3, 3]).sum()
    return np.flatnonzero(heights <= heights.min() + _LEVEL * size)


def first_balls(numbers: np.ndarray, times: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """(balls, when the next is met at the earliest), more and more of them, of balls by the time from which they may be
    met: who knows an impact before the next ball goes no further.
    """
    n = _FIRST_ASKED
    while len(numbers):
        if n >= len(numbers):
            yield numbers, math.inf
            return
        yield numbers[:n], float(times[n])
        n *= _GROWTH


def ball(cloud: PointCloud, k: int) -> ConvexHull:
    """A ball of a cloud, as a shape in the cloud's frame."""
    return ConvexHull(cloud.points[k : k + 1], radius=float(cloud.radii[k]))


def union_of(cloud: PointCloud, some: np.ndarray) -> Shape:
    """Some balls as one shape, whose parts are numbered as these."""
    if len(some) == 1:
        return ball(cloud, int(some[0]))
    return Compound([(ball(cloud, k), IDENTITY) for k in some.tolist()])
