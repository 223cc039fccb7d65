"""Sizes of the tables and workspaces of robots, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

import numpy as np

from collide.broadphase.graded_boxes import LINK as NODE_LINK
from collide.kernels import entry, view_i64
from collide.kernels.lanes import LANES
from collide.lowering.compound_table import PART
from collide.robots import check_scene as scene
from collide.robots import motion_bounds as motions
from collide.robots import sphere_lanes as spheres
from collide.robots.forward_kinematics import JOINT_DOUBLES, JOINT_INTS, LINK_POSE
from collide.robots.map_layout import MAP_DOUBLES, MAP_INTS
from collide.robots.nearest_pairs import SEARCH
from collide.robots.sample_motions import CURSOR, OPEN_SAMPLE

#: In this order (`native/capi_robot.h`): headers; rows of tables; rows of workspaces.
_CONSTANTS = np.array([
    scene.HEADER, motions.MOTION_HEADER, spheres.SPHERE_HEADER, SEARCH,
    JOINT_INTS, JOINT_DOUBLES, scene.BODY_INTS, scene.BOX, PART, NODE_LINK, spheres.BODY_SPHERES, spheres.SPHERE,
    spheres.PART_NUMBERS, MAP_INTS, MAP_DOUBLES,
    LINK_POSE, LANES, scene.OPEN_INTS, spheres.OPEN_PAIR, spheres.SPHERE_PLACE, motions.INTERVAL,
    motions.MAX_INTERVALS, motions.MAX_PIECES, motions.ITEM, motions.OPEN_INTERVAL, motions.MAX_DEGREE, CURSOR,
    OPEN_SAMPLE,
], dtype=np.int64)


@entry("int64(int64, int64)")
def write_robot_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
