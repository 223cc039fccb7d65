"""Spheres around and within the bodies of a robot, and the parts around them, as `sphere_lanes.py` reads them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.kernels.lanes import LANES
from collide.lowering.packed_convex import CYLINDER, HALFSPACE, POINTS, PackedConvex
from collide.robots import motion_bounds as motions
from collide.robots import sphere_lanes as layout
from collide.robots.check_scene import BOX, HALF
from collide.robots.check_tables import CheckTables, RobotTables, Setting, Surroundings
from collide.robots.forward_kinematics import LINK_POSE
from collide.robots.robot import Robot

#: Radii are larger, or smaller, by this share of all that goes into them.
_ROUNDING = 2.0**-44
#: Of fewer configurations none are asked by their spheres: of robots of spheres alone, and of others.
_FEWEST_EXACT, _FEWEST = 2, 4


class SphereTables(NamedTuple):
    """What is constant of a robot.   counts : (bodies, BODY_SPHERES) int64.   around_bodies : (bodies, SPHERE).
    spheres : (n, SPHERE).   fewest : of fewer configurations none are asked by their spheres.
    """

    counts: np.ndarray
    around_bodies: np.ndarray
    spheres: np.ndarray
    fewest: int


class BodySpheres(NamedTuple):
    """Spheres of a body in its link.   outer, inner : (n, 4) centres and radii; the body lies within the union of the
    outer ones, and the inner ones lie within the body.   is_exact : whether the body is the union of the outer ones.
    """

    outer: np.ndarray
    inner: np.ndarray
    is_exact: bool


def sphere_tables(robot: RobotTables, paddings: Sequence[float]) -> SphereTables | None:
    """Those of a robot's bodies; ``None`` where a body has no end, and where fewer than half are made of spheres."""
    if not np.isfinite(robot.part_boxes).all():
        return None
    of_bodies = [_spheres_of(robot, k) for k in range(len(robot.bodies))]
    if 2 * sum(body.is_exact for body in of_bodies) < len(of_bodies):
        return None
    counts = np.zeros((len(of_bodies), layout.BODY_SPHERES), dtype=np.int64)
    around, rows, n = np.zeros((len(of_bodies), layout.SPHERE)), [], 0
    for k, (body, padding) in enumerate(zip(of_bodies, paddings)):
        counts[k] = n, len(body.outer), n + len(body.outer), len(body.inner), body.is_exact
        n += len(body.outer) + len(body.inner)
        rows += [_padded(body.outer, padding, 1.0), _padded(body.inner, padding, 1.0 if body.is_exact else -1.0)]
        around[k] = _padded(_sphere_around(body.outer)[None], padding, 1.0)[0]
    is_exact = all(body.is_exact for body in of_bodies)
    return SphereTables(counts, around, np.concatenate(rows), _FEWEST_EXACT if is_exact else _FEWEST)


def _spheres_of(robot: RobotTables, body: int) -> BodySpheres:
    _, first, count = robot.bodies[body].tolist()
    packed = robot.table.packed[first : first + count]
    parts = robot.parts[first : first + count]
    nothing = np.zeros((0, 4))
    if all(part.kind == POINTS and len(part.points) == 1 for part in packed) and not robot.is_bound[first]:
        centres = [_moved(part.points[0], row) for part, row in zip(packed, parts)]
        spheres = np.column_stack([centres, [part.radius for part in packed]])
        return BodySpheres(spheres, nothing, True)
    box = robot.body_boxes[body]
    return BodySpheres(np.array([[*box[:HALF], np.linalg.norm(box[HALF:]) * (1.0 + _ROUNDING)]]), nothing, False)


def _moved(point: np.ndarray, row: np.ndarray) -> np.ndarray:
    """A point of a part in the link.   row : of `compound_table`."""
    return row[:9].reshape(3, 3) @ point + row[9:12]


def _padded(spheres: np.ndarray, padding: float, sign: float) -> np.ndarray:
    """(n, SPHERE) of spheres (n, 4), larger (sign 1) or smaller (−1) by rounding."""
    out = np.zeros((len(spheres), layout.SPHERE))
    out[:, :4] = spheres
    size = np.abs(spheres).sum(axis=1) + padding
    out[:, layout.PADDED_RADIUS] = spheres[:, 3] + padding + sign * _ROUNDING * size
    out[:, layout.RADIUS] += sign * _ROUNDING * size
    return out


def _sphere_around(spheres: np.ndarray) -> np.ndarray:
    """(4,) a sphere around spheres (n, 4): about the middle of their box, moved towards the farthest a few times."""
    low = (spheres[:, :3] - spheres[:, 3:]).min(axis=0)
    high = (spheres[:, :3] + spheres[:, 3:]).max(axis=0)
    best, centre = None, 0.5 * (low + high)
    for step in range(1, 40):
        reach = np.linalg.norm(spheres[:, :3] - centre, axis=1) + spheres[:, 3]
        farthest = int(reach.argmax())
        if best is None or reach[farthest] < best[3]:
            best = np.array([*centre, reach[farthest] * (1.0 + _ROUNDING)])
        centre = centre + (spheres[farthest, :3] - centre) / (step + 1.0)
    assert best is not None
    return best


class SphereWorkspace:
    """A thread's buffers, and the header with their addresses.

    header, address : of `sphere_lanes.py`.   links : (LINK_POSE links, LANES).   verdicts : (2, LANES).
    """

    def __init__(self, robot: Robot, setting: Setting, spheres: SphereTables):
        tables, around = setting.tables, setting.surroundings
        kinds, numbers = _parts_around(tables, around)
        n_bodies, n = len(spheres.counts), len(spheres.spheres)
        columns, self.verdicts = np.zeros((max(robot.dof, 1), LANES)), np.zeros((2, LANES))
        self.links = np.zeros((LINK_POSE * len(robot.links), LANES))
        self._buffers = {
            layout.COUNTS_AT: spheres.counts, layout.AROUND_BODIES_AT: spheres.around_bodies,
            layout.SPHERES_AT: spheres.spheres, layout.PART_KINDS_AT: kinds, layout.PART_NUMBERS_AT: numbers,
            layout.COLUMNS_AT: columns, layout.LINK_LANES_AT: self.links,
            layout.AROUND_LANES_AT: np.zeros((layout.SPHERE_PLACE * n_bodies, LANES)),
            layout.SPHERE_LANES_AT: np.zeros((layout.SPHERE_PLACE * n, LANES)),
            layout.PIECES_AT: np.zeros((motions.MAX_PIECES + LANES, 2)), layout.HALF_LANES_AT: np.zeros((1, LANES)),
            layout.MOVED_LANES_AT: np.zeros((n_bodies * (len(robot.joints) + 1), LANES)),
            layout.PLACED_AT: np.zeros(n_bodies, dtype=np.int64), layout.VERDICTS_AT: self.verdicts,
        }
        self.header = np.zeros(layout.SPHERE_HEADER, dtype=np.int64)
        for word, buffer in self._buffers.items():
            self.header[word] = address_of(buffer)
        self.header[layout.N_SPHERES], self.header[layout.N_COLUMNS] = n, len(columns)
        self.header[layout.FEWEST] = spheres.fewest
        self.address = address_of(self.header)


def _parts_around(tables: CheckTables, around: Surroundings) -> tuple[np.ndarray, np.ndarray]:
    """((parts,) kinds, (parts, PART_NUMBERS)) of the parts around."""
    kinds = np.zeros(len(around.packed), dtype=np.int64)
    numbers = np.zeros((len(around.packed), layout.PART_NUMBERS))
    boxes = tables.part_boxes[len(tables.part_boxes) - len(around.packed) :]
    for k, (packed, is_bound) in enumerate(zip(around.packed, around.is_bound.tolist())):
        kinds[k], numbers[k] = _part_of(packed, boxes[k], is_bound)
    return kinds, numbers


def _part_of(packed: PackedConvex, box: np.ndarray, is_bound: bool) -> tuple[int, np.ndarray]:
    """(kind, numbers) of a part around.   box : (BOX,) around it."""
    out = np.zeros(layout.PART_NUMBERS)
    radius, slop = packed.radius, packed.slop + _ROUNDING * (packed.reach + packed.radius)
    out[layout.AT_MOST], out[layout.AT_LEAST] = radius + slop, radius - slop
    if packed.kind == HALFSPACE:
        normal = packed.params[:3]
        out[:3], out[3] = normal / np.linalg.norm(normal), packed.params[3] / np.linalg.norm(normal)
        return layout.PLANE, out
    if packed.kind == CYLINDER:
        out[:2] = packed.params[:2]
        return layout.SWEPT_CYLINDER, out
    if packed.kind == POINTS and not is_bound and _are_all_corners(packed.points):
        out[:3] = 0.5 * (packed.points.max(axis=0) - packed.points.min(axis=0))
        return layout.SWEPT_BOX, out
    out[:3] = box[HALF:BOX] * (1.0 + _ROUNDING)
    out[layout.AT_MOST], out[layout.AT_LEAST] = _ROUNDING * float(np.abs(box).sum()), -math.inf
    return layout.ONLY_BOXED, out


def _are_all_corners(points: np.ndarray) -> bool:
    """Whether the hull of points is their box: the points are its corners, or two of them along an axis, or one."""
    low, high = points.min(axis=0), points.max(axis=0)
    if not ((points == low) | (points == high)).all():
        return False
    n_corners = 2 ** int((low != high).sum())
    return len(np.unique(points, axis=0)) == n_corners
