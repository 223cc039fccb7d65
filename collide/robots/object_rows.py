"""Rows of an attached object in a checker's tables: rows kept with the shape, moved to the pose in the link by kernels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.robots.bounding_spheres import SphereRows, rows_of_shape, sphere_rows
from collide.robots.check_scene import HALF, UNBOUNDED_HALF
from collide.robots.check_tables import RobotBody, RobotTables, robot_tables
from collide.robots.object_rows_kernel import move_parts, move_spheres
from collide.robots.robot import Robot
from collide.robots.robot_bodies import Attached, body_of_object

_NO_MATRICES = np.zeros((0, 3, 3))


class ObjectRows(NamedTuple):
    """An attached object.   body : of the robot.   tables : of the body alone.   n_parts : without twins.
    is_bounded : False with a half-space.   spheres : in the link, or ``None``.
    """

    item: Attached
    body: RobotBody
    tables: RobotTables
    n_parts: int
    is_bounded: bool
    spheres: SphereRows | None

    def with_spheres(self) -> ObjectRows:
        """With spheres, where the object has an end."""
        if self.spheres is not None or not self.is_bounded:
            return self
        spheres = sphere_rows(RobotBody("", 0, self.item.shape, self.body.padding))
        rows = spheres.rows.copy()
        move_spheres(address_of(self.item.X_LS), address_of(rows), len(rows), 1 + spheres.n_outer)
        return self._replace(spheres=spheres._replace(rows=rows))


def rows_of_object(robot: Robot, item: Attached, padding: float, *, is_padded: bool) -> ObjectRows:
    """Those of an object to be attached.   padding : its swelling [m].   is_padded : whether a checker's parts have
    twins.
    """
    body = body_of_object(robot, item, padding)
    known, key = rows_of_shape(item.shape), ("tables", padding, is_padded)
    of_shape = known.get(key)
    if of_shape is None:
        of_shape = known[key] = robot_tables([RobotBody("", 0, item.shape, padding)], _NO_MATRICES, is_padded=is_padded)
    parts, box = of_shape.parts.copy(), of_shape.body_boxes.copy()
    skew = move_parts(
        address_of(item.X_LS), address_of(of_shape.parts), address_of(parts), len(parts), address_of(box))
    tables = of_shape._replace(parts=parts, body_boxes=box, skew=of_shape.skew + skew)
    is_bounded = bool(box[0, HALF] < UNBOUNDED_HALF)
    return ObjectRows(item, body, tables, len(parts) // (1 + is_padded), is_bounded, None)
