"""Spheres around and within the bodies of a robot, and the parts around them, as `sphere_lanes.py` reads them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.kernels.lanes import LANES
from collide.lowering.convex_sets import PRIMITIVE_NUMBERS
from collide.lowering.packed_convex import CYLINDER, HALFSPACE, POINTS, PackedConvex
from collide.lowering.parts import convex_set_of
from collide.robots import motion_bounds as motions
from collide.robots import sphere_lanes as layout
from collide.robots.body_spheres import ROUNDING, are_all_corners, are_spheres, ball_around, spheres_of
from collide.robots.check_scene import BOX, HALF
from collide.robots.check_tables import CheckTables, RobotBody, RobotTables, Setting, Surroundings
from collide.robots.forward_kinematics import LINK_POSE
from collide.robots.robot import Robot
from collide.shapes.shape import Shape, kept_with_shape

#: Of fewer configurations none are asked by their spheres: of robots of spheres alone, and of others.
_FEWEST_EXACT, _FEWEST = 2, 4
#: Pairs that eight configurations may leave open and are remembered; where they leave more all pairs are asked.
_PAIRS = 256


class SphereRows(NamedTuple):
    """Spheres of a body.   counts : BODY_SPHERES integers, of spheres that begin at 0.   n_outer : how many are outer.
    rows : (1 + n, SPHERE), the sphere around the body before all.
    """

    counts: tuple[int, ...]
    n_outer: int
    rows: np.ndarray

    def counts_from(self, first: int) -> tuple[int, ...]:
        """The integers of spheres that begin at a number."""
        outer, n_outer, inner, n_inner, is_exact = self.counts
        return first + outer, n_outer, first + inner, n_inner, is_exact


class SphereTables(NamedTuple):
    """What is constant of a robot's links.   counts : (bodies, BODY_SPHERES) int64.   around_bodies : (bodies, SPHERE).
    spheres : (n, SPHERE).   are_exact : whether every body is a union of spheres.
    """

    counts: np.ndarray
    around_bodies: np.ndarray
    spheres: np.ndarray
    are_exact: bool


def sphere_tables(robot: RobotTables, bodies: Sequence[RobotBody], *, of_any: bool) -> SphereTables | None:
    """Those of a robot's links; ``None`` where a link has no end, and with moving obstacles: spheres lack the padding
    of pairs with them.

    of_any : False for ``None`` as well where fewer than half of the bodies are made of spheres, and spheres of the
        others take milliseconds a body.
    """
    is_sphere = [are_spheres(body.shape) for body in bodies]
    if any(body.is_obstacle for body in bodies):
        return None
    if not np.isfinite(robot.part_boxes).all() or not (of_any or 2 * sum(is_sphere) >= len(bodies)):
        return None
    counts = np.zeros((len(bodies), layout.BODY_SPHERES), dtype=np.int64)
    around, rows, n = np.zeros((len(bodies), layout.SPHERE)), [np.zeros((0, layout.SPHERE))], 0
    for k, body in enumerate(bodies):
        made = sphere_rows(body)
        counts[k], around[k] = made.counts_from(n), made.rows[0]
        n += len(made.rows) - 1
        rows.append(made.rows[1:])
    return SphereTables(counts, around, np.concatenate(rows), all(is_sphere))


@kept_with_shape("_sphere_rows")
def rows_of_shape(shape: Shape) -> dict[tuple, Any]:
    """What is made of a shape for robots, by padding. Primitives of equal numbers share it."""
    is_primitive = shape.__class__ in PRIMITIVE_NUMBERS
    return convex_set_of(shape).prepared.made.setdefault("robot rows", {}) if is_primitive else {}


def sphere_rows(body: RobotBody) -> SphereRows:
    """Those of a body, kept with its shape."""
    known, key = rows_of_shape(body.shape), ("spheres", body.padding)
    if key not in known:
        known[key] = _rows_of(body)
    return known[key]


def _rows_of(body: RobotBody) -> SphereRows:
    spheres = spheres_of(body)
    outer, inner = _padded(spheres.outer, body.padding, 1.0), _padded(spheres.inner, body.padding, -1.0)
    if spheres.is_exact:
        less = (outer - inner)[:, [layout.RADIUS, layout.PADDED_RADIUS]].max(axis=1)
        outer[:, layout.LESS_WITHIN], inner = less * (1.0 + ROUNDING), inner[:0]
    sphere = ball_around(spheres.outer[:, :3], spheres.outer[:, 3], steps=40)
    around, n_outer = _padded(sphere[None], body.padding, 1.0), len(outer)
    counts = 0, n_outer, n_outer, len(inner), int(spheres.is_exact)
    return SphereRows(counts, n_outer, np.concatenate([around, outer, inner]))


def _padded(spheres: np.ndarray, padding: float, sign: float) -> np.ndarray:
    """(n, SPHERE) of spheres (n, 4), larger (sign 1) or smaller (−1) by rounding."""
    out = np.zeros((len(spheres), layout.SPHERE))
    out[:, :4] = spheres
    size = np.abs(spheres).sum(axis=1) + padding
    out[:, layout.PADDED_RADIUS] = spheres[:, 3] + padding + sign * ROUNDING * size
    out[:, layout.RADIUS] += sign * ROUNDING * size
    return out


class SphereWorkspace:
    """A thread's buffers, and the header with their addresses.

    header, address : of `sphere_lanes.py`.   links : (LINK_POSE links, LANES).   verdicts : (2, LANES).
    """

    def __init__(self, robot: Robot, setting: Setting, spheres: SphereTables):
        tables, around = setting.tables, setting.surroundings
        kinds, numbers = _parts_around(tables, around)
        self._tables, spare = spheres, tables.spare_rows
        self.counts = np.concatenate([spheres.counts, np.zeros((spare.bodies, layout.BODY_SPHERES), dtype=np.int64)])
        self.around_bodies = np.concatenate([spheres.around_bodies, np.zeros((spare.bodies, layout.SPHERE))])
        self.spheres = np.concatenate([spheres.spheres, np.zeros((spare.spheres, layout.SPHERE))])
        n_bodies, n = len(self.counts), len(self.spheres)
        columns, self.verdicts = np.zeros((max(robot.dof, 1), LANES)), np.zeros((2, LANES))
        self.links = np.zeros((LINK_POSE * len(robot.links), LANES))
        self._buffers = {
            layout.COUNTS_AT: self.counts, layout.AROUND_BODIES_AT: self.around_bodies,
            layout.SPHERES_AT: self.spheres, layout.PART_KINDS_AT: kinds, layout.PART_NUMBERS_AT: numbers,
            layout.COLUMNS_AT: columns, layout.LINK_LANES_AT: self.links,
            layout.AROUND_LANES_AT: np.zeros((layout.SPHERE_PLACE * n_bodies, LANES)),
            layout.SPHERE_LANES_AT: np.zeros((layout.SPHERE_PLACE * n, LANES)),
            layout.SPANS_AT: np.zeros_like(columns), layout.FLAGS_AT: np.zeros(LANES),
            layout.PAIRS_AT: np.zeros((_PAIRS, layout.OPEN_PAIR), dtype=np.int64),
            layout.PIECES_AT: np.zeros((motions.MAX_PIECES + LANES, 2)), layout.HALF_LANES_AT: np.zeros((1, LANES)),
            layout.MOVED_LANES_AT: np.zeros((n_bodies * (len(robot.joints) + 1), LANES)),
            layout.PLACED_AT: np.zeros(n_bodies, dtype=np.int64), layout.VERDICTS_AT: self.verdicts,
        }
        self.header = np.zeros(layout.SPHERE_HEADER, dtype=np.int64)
        for word, buffer in self._buffers.items():
            self.header[word] = address_of(buffer)
        self.header[layout.N_SPHERES], self.header[layout.N_COLUMNS] = n, len(columns)
        self.header[layout.PAIR_CAPACITY] = _PAIRS
        self.address = address_of(self.header)

    def carry(self, setting: Setting) -> None:
        """Take over attached objects, all of which have spheres, and maps of a setting."""
        first, are_exact = len(self._tables.spheres), self._tables.are_exact
        for number, rows in enumerate(setting.objects, len(self._tables.counts)):
            made = rows.spheres
            assert made is not None
            self.counts[number], self.around_bodies[number] = made.counts_from(first), made.rows[0]
            end = first + len(made.rows) - 1
            self.spheres[first:end] = made.rows[1:]
            first, are_exact = end, are_exact and bool(made.counts[layout.IS_EXACT])
        header, maps = self.header, setting.maps
        header[layout.FEWEST] = _FEWEST_EXACT if are_exact else _FEWEST
        header[layout.N_MAPS] = 0 if maps is None else len(maps.ints)
        if maps is not None:
            header[layout.MAP_INTS_AT], header[layout.MAP_DOUBLES_AT] = address_of(maps.ints), address_of(maps.doubles)
            header[layout.MAP_CELLS_AT] = address_of(maps.cells)


    def tables(self, setting: Setting) -> dict[str, np.ndarray]:
        """Spheres and maps as kernels read them, by name (`checker_file.py`), and their header."""
        n, maps, made = len(setting.bodies), setting.maps, self.no_tables()
        if maps is not None:
            made |= {"map_ints": maps.ints, "map_doubles": maps.doubles, "map_cells": maps.cells}
        return made | {
            "header": self.header, "sphere_counts": self.counts[:n], "around_bodies": self.around_bodies[:n],
            "sphere_rows": self.spheres, "part_kinds": self._buffers[layout.PART_KINDS_AT],
            "part_numbers": self._buffers[layout.PART_NUMBERS_AT],
        }

    @staticmethod
    def no_tables() -> dict[str, np.ndarray]:
        """Empty tables of the same names."""
        of_spheres = ("sphere_counts", "around_bodies", "sphere_rows", "part_kinds", "part_numbers")
        empty = dict.fromkeys((*of_spheres, "map_ints", "map_doubles", "map_cells"), np.zeros(0))
        return {"header": np.zeros(layout.SPHERE_HEADER, dtype=np.int64), **empty}


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
    radius, slop = packed.radius, packed.slop + ROUNDING * (packed.reach + packed.radius)
    out[layout.AT_MOST], out[layout.AT_LEAST] = radius + slop, radius - slop
    if packed.kind == HALFSPACE:
        normal = packed.params[:3]
        out[:3], out[3] = normal / np.linalg.norm(normal), packed.params[3] / np.linalg.norm(normal)
        return layout.PLANE, out
    if packed.kind == CYLINDER:
        out[:2] = packed.params[:2]
        return layout.SWEPT_CYLINDER, out
    if packed.kind == POINTS and not is_bound and are_all_corners(packed.points):
        out[:3] = 0.5 * (packed.points.max(axis=0) - packed.points.min(axis=0))
        return layout.SWEPT_BOX, out
    out[:3] = box[HALF:BOX] * (1.0 + ROUNDING)
    out[layout.AT_MOST], out[layout.AT_LEAST] = ROUNDING * float(np.abs(box).sum()), -math.inf
    return layout.ONLY_BOXED, out
