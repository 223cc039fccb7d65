"""Links as bodies: the shape of each, its pose in the link, and a convex set around the shape."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from collide.pairs.query import collide, distance
from collide.robots.robot import Robot
from collide.shapes.compound import Compound
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape
from collide.shapes.tessellation import tessellate

#: How far curved surfaces may lie outside their points in the hull around a link [m]; the hull is grown by as much.
_HULL_TOLERANCE = 1e-3


class LinkBody(NamedTuple):
    """The collision elements of a link as a single shape.

    shape : in its own frame B.   X_LB : (4, 4) pose of B in the link.
    hull : a convex set around ``shape``, ``None`` for a convex shape.
    """

    link: str
    shape: Shape
    X_LB: np.ndarray
    hull: Shape | None


class LinkPoses(NamedTuple):
    """Where all links stand: X_WLs (N, links, 4, 4), and the position of each link in it."""

    X_WLs: np.ndarray
    number_of: dict[str, int]

    def of(self, body: LinkBody, rows=slice(None)) -> np.ndarray:
        """(n, 4, 4) poses X_WB of a link's shape."""
        return self.X_WLs[rows, self.number_of[body.link]] @ body.X_LB


def link_bodies(robot: Robot) -> list[LinkBody]:
    """A body for each link with collision geometry, in the order of the links."""
    bodies = []
    for link in robot.links:
        elements = robot.geometry.get(link, ())
        if len(elements) == 1:
            shape, X_LB = elements[0].shape, elements[0].X_LG
        elif elements:
            shape, X_LB = Compound([(element.shape, element.X_LG) for element in elements]), np.eye(4)
        else:
            continue
        bodies.append(LinkBody(link, shape, X_LB, None if shape.convex else _hull_around(shape)))
    return bodies


def _hull_around(shape: Shape) -> Shape:
    if isinstance(shape, PointCloud):
        return ConvexHull(shape.points, radius=float(shape.radii.max()))
    vertices, _ = tessellate(shape, tolerance=_HULL_TOLERANCE)
    return ConvexHull(vertices, radius=_HULL_TOLERANCE)


def link_poses(robot: Robot, Q: np.ndarray) -> LinkPoses:
    """Where the links stand at configurations Q (N, dof)."""
    return LinkPoses(robot.link_poses(Q), {link: k for k, link in enumerate(robot.links)})


def pair_hits(A: LinkBody, B: LinkBody, poses: LinkPoses) -> np.ndarray:
    """(N,) bool: configurations in which two links collide. Only pairs with overlapping hulls test the shapes."""
    X_WA, X_WB = poses.of(A), poses.of(B)
    if A.hull is None and B.hull is None:
        return collide(A.shape, B.shape, X_WA, X_WB)
    hits = np.array(collide(A.hull or A.shape, B.hull or B.shape, X_WA, X_WB))
    rows = np.flatnonzero(hits)
    if len(rows):
        hits[rows] = collide(A.shape, B.shape, X_WA[rows], X_WB[rows])
    return hits


def pair_gaps(A: LinkBody, B: LinkBody, poses: LinkPoses, rows=slice(None)) -> np.ndarray:
    """(n,) gaps [m] of two links, 0 where they collide."""
    return np.atleast_1d(distance(A.shape, B.shape, poses.of(A, rows), poses.of(B, rows), signed=False).distance)


def moving_columns(robot: Robot, bodies: list[LinkBody]) -> dict[tuple[int, int], np.ndarray]:
    """Columns of a configuration that move two links against each other.

    Found by forward kinematics, at a configuration without symmetry: each column is moved alone.

    Returns
    -------
    dict of (int, int) to (k,) int
        Numbers of two bodies, the smaller first → columns; without columns the links are rigidly joined.
    """
    random = np.random.default_rng(20)
    base, moved = random.uniform(0.3, 0.7, robot.dof), random.uniform(0.8, 1.2, robot.dof)
    Q = np.vstack([base, np.where(np.eye(robot.dof, dtype=bool), moved, base)])
    X_WLs = robot.link_poses(Q)
    index = {link: k for k, link in enumerate(robot.links)}
    X_WBs = [X_WLs[:, index[body.link]] for body in bodies]
    inverses = [np.linalg.inv(X_WB) for X_WB in X_WBs]
    moving = {}
    for i, j in combinations(range(len(bodies)), 2):
        X_AB = inverses[i] @ X_WBs[j]
        shifts = np.abs(X_AB[1:] - X_AB[0]).max(axis=(1, 2))
        moving[i, j] = np.flatnonzero(shifts > 1e-9)
    return moving
