"""A step of the exact stage: a closed region, whose corners are rounded, against points swept by a ball.

The planes as given decide, and the points as given, at poses as given: whether the least distance of the hull from the
intersection of the half-spaces exceeds the radius is a least-distance program in integers (`least_distance/`). Only
half-spaces that cut the ball around the points take part: the others hold all of it.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.least_distance.nearest_pair import APART, nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.least_distance.posed_rows import rows_of_planes, rows_of_points
from collide.least_distance.posed_sets import planes_at, planes_near, points_at
from collide.lowering.packed_convex import POINTS
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.narrowphase.bounds import PROMISE_STORED
from collide.results import EXACT


def settle_regions(
    rows: np.ndarray,
    undecided: np.ndarray,
    pairs: np.ndarray,
    table: ShapeTable,
    poses: PoseTable,
    shape_of: np.ndarray,
) -> None:
    """Settle in place the undecided rows (given by number) of a closed region and swept points."""
    for k in undecided.tolist():
        parts = [int(part) for part in pairs[k]]
        packed = [table.packed[shape_of[part]] for part in parts]
        planes = [shape.prepared.made.get("planes") for shape in packed]
        for region, body in ((0, 1), (1, 0)):
            if planes[region] is not None and packed[body].kind == POINTS and packed[body].slop == 0.0:
                X = [_matrix(poses.rows[part]) for part in parts]
                normals, offsets = planes[region]
                near = planes_near(normals, offsets, X[region], X[body], packed[body].reach + packed[body].radius)
                exact = poses.exact(parts[region]), poses.exact(parts[body])
                is_apart = _are_apart(normals[near], offsets[near], packed[body].points, packed[body].radius, *exact)
                size = sum(shape.reach + shape.radius for shape in packed) + float(np.abs((X[1] - X[0])[:3, 3]).max())
                _settle(rows[k : k + 1], is_apart, size)
                break


def _are_apart(normals, offsets, points: np.ndarray, radius: float, pose_of_planes, pose_of_points) -> bool:
    """Whether points (n, 3) are farther than the radius [m] from a region of half-spaces, both at exact poses."""
    if not len(normals):
        return False
    halfspaces = rows_of_planes(planes_at(normals, offsets, pose_of_planes))
    pair = nearest_pair(rows_of_points(points_at(points, pose_of_points)), halfspaces, Work())
    return pair.kind == APART and sum(u * u for u in pair.u) > (Fraction(radius) * pair.denominator) ** 2


def _matrix(row: np.ndarray) -> np.ndarray:
    """The (4, 4) matrix of a row of poses."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = row[:9].reshape(3, 3), row[9:12]
    return X


def _settle(row: np.ndarray, is_apart: bool, size: float) -> None:
    row["how"], row["exact"], row["hit"] = EXACT, 1, not is_apart
    if is_apart:
        row["lower"] = np.maximum(row["lower"], 0.0)
        row["distance"] = np.where(row["distance"] > 0.0, row["distance"], row["upper"])
    else:
        row["upper"] = np.minimum(row["upper"], 0.0)
        row["distance"] = np.minimum(row["distance"], row["upper"])
    row["certified"] = row["upper"] - row["lower"] <= PROMISE_STORED * size
