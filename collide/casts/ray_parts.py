"""Rays against posed convex parts: chords in doubles, and what these leave open of polytopes decided exactly."""

from __future__ import annotations

from fractions import Fraction
from threading import local
from typing import NamedTuple

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.casts.cut_parts import (
    FIRST,
    FIRST_SIDE,
    LAST,
    LAST_SIDE,
    RAY,
    RAY_ROW,
    STATE,
    cut_parts,
)
from collide.casts.directions import Directions
from collide.casts.exact_cast import cast_exactly, corners_of
from collide.casts.posed_parts import PosedParts
from collide.casts.ray_ends import list_open_chords, write_chord_ends
from collide.casts.ray_hits import RayEvents
from collide.casts.rays_in_tree import TREE_RAY_DOUBLES, TREE_RAY_INTEGERS, parts_on_rays
from collide.curved.chords import MET
from collide.kernels import address_of
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.numerics.exact_points import integers, rounded
from collide.numerics.exact_vectors import inner


class _Workspace(local):
    """Scratch memory of one thread."""

    def __init__(self) -> None:
        self.doubles = np.zeros(TREE_RAY_DOUBLES)
        self.integers = np.zeros(TREE_RAY_INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_workspace = _Workspace()


def parts_met(
    parts: PosedParts, questions: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Where rays enter and leave convex parts, from their origins on to the limit.

    questions : (k, 2) int64, a ray and a part each.   limit : of t, in lengths of the directions given.
    every : both ends of each; else at least the first.   The events' items are numbers of the questions.
    """
    rows = np.zeros((len(questions), RAY_ROW))
    if len(questions):
        rays = _as_rays(origins, directions)
        cut_parts(
            *parts.table.addresses, address_of(parts.poses.rows), address_of(parts.shape_of), address_of(questions),
            address_of(rays), len(questions), every, address_of(rows), *_workspace.addresses,
        )
    limits, k = directions.limits(limit)[questions[:, 0]], len(questions)
    listed, exact = np.empty(k, dtype=np.int64), np.zeros(k, dtype=np.uint8)
    of_chords = address_of(questions), address_of(rows), address_of(limits), k
    count = list_open_chords(
        *parts.table.addresses, address_of(parts.shape_of), *of_chords, every, address_of(listed)
    )
    for i in listed[:count].tolist():
        exact[i] = True
        _settle(parts, questions[i], origins, directions.vectors, limits[i], rows[i])
    return _events(rows, questions, limits, exact, np.ascontiguousarray(directions.exponents))


class TreeOfParts(NamedTuple):
    """Bodies of posed parts in a box-tree.

    table : of the parts' shapes, its trees built.   poses : of the parts.   shape_of : (parts,) int64, the parts' rows
    of the table.
    first : (bodies + 1,) int64, the first part of each.   meshed : (bodies,) int64, 1 of bodies whose parts are only
    bounds.
    """

    table: ShapeTable
    poses: PoseTable
    shape_of: np.ndarray
    tree: BoxTree
    first: np.ndarray
    meshed: np.ndarray


def candidate_parts(
    bodies: TreeOfParts, skipped: np.ndarray, origins, directions: Directions, limit: float, rows: np.ndarray | None
) -> np.ndarray:
    """(k, 2) int64: a ray and a part with the ray's possible first wall, or any wall.

    skipped : (bodies,) int64, 1 of bodies not asked.   rows : (n,) of `WORLD_HIT_DTYPE`, to become the answers of rays
    whose first wall is proven: rays without pairs; None for all walls.   The rest as of `parts_met`.
    """
    n, tree, first = len(origins), bodies.tree, bodies.first
    rays = _as_rays(origins, directions)
    limits = directions.limits(limit)
    header = np.array(
        [
            address_of(tree.nodes), address_of(tree.links), tree.n_nodes, address_of(first), len(first) - 1,
            address_of(skipped), address_of(bodies.meshed), address_of(tree.unbounded), len(tree.unbounded),
        ],
        dtype=np.int64,
    )
    rows_at = 0 if rows is None else address_of(rows)
    capacity = 64 + 4 * n
    while True:
        pairs = np.empty((capacity, 2), dtype=np.int64)
        count = parts_on_rays(
            *bodies.table.addresses, address_of(bodies.poses.rows), address_of(bodies.shape_of), address_of(header),
            address_of(rays), address_of(limits), address_of(directions.exponents), n, rows_at, address_of(pairs),
            capacity, *_workspace.addresses,
        )
        if count <= capacity:
            return pairs[:count]
        capacity = count


def _as_rays(origins: np.ndarray, directions: Directions) -> np.ndarray:
    rays = np.empty((len(origins), RAY))
    rays[:, :3], rays[:, 3:] = origins, directions.vectors
    return rays


def _events(rows, questions, limits, exact, exponents) -> RayEvents:
    """The ends of chords that count, from the origin to the limit: first ends, then last ends."""
    k = len(rows)
    t, normals, columns = np.empty((2 * k, 3)), np.empty((2 * k, 3)), np.empty((2 * k, 3), dtype=np.int64)
    flags = np.empty((2 * k, 2), dtype=bool)
    chords = *map(address_of, (rows, questions, limits, exponents, exact)), k
    count = write_chord_ends(*chords, *map(address_of, (t, normals, columns, flags)))
    (ray, side, item), (proven, certified) = columns[:count].T.copy(), flags[:count].T.copy()
    return RayEvents(ray, t[:count], normals[:count], side, item, proven, certified)


# --- exactly ------------------------------------------------------------------------------------


def _settle(parts: PosedParts, asked, origins, vectors, limit: float, row: np.ndarray) -> None:
    """Write a row anew from exact numbers: MISSED ends are infinite, ends that do not count are so as well."""
    origin, direction = origins[asked[0]], vectors[asked[0]]
    if parts.packed(asked[1]).kind == HALFSPACE:
        first, last = _chord_of_plane(parts, asked[1], origin, direction)
    else:
        first, last = _chord_of_points(parts, asked[1], origin, direction)
        if first == last:  # one place, one wall
            last = None
    row[STATE] = MET
    row[FIRST_SIDE] = row[LAST_SIDE] = -1.0 if parts.packed(asked[1]).kind != HALFSPACE else 0.0
    for value, t in ((FIRST, first), (LAST, last)):
        row[value - 1 : value + 2] = np.nan
        if t is not None and 0 <= t <= float(limit):
            row[value], row[value - 1], row[value + 1] = rounded(t)
            row[value] = min(row[value], limit)
            row[value - 1] = max(row[value - 1], 0.0)


def _chord_of_points(parts: PosedParts, part: int, origin, direction) -> tuple[Fraction | None, Fraction | None]:
    """Exact t at which a ray's line enters and leaves a hull: casts of a point from far away, to and fro."""
    d, d_exponent = integers(direction)
    whole, o_exponent = integers(origin)
    points = parts.exact(part).vertices
    grid = min(o_exponent, points.grid)
    x, y, z = (c << (o_exponent - grid) for c in whole)
    o, vertices = (x, y, z), points.on_grid(grid)
    unit = Fraction(2) ** (grid - d_exponent)
    # Farther than all of it is from the origin: the largest component of d is at least 1.
    far = 4 * (vertices.reach + max(map(abs, o))) + 1
    corners = corners_of(vertices)
    ends = []
    for sign in (1, -1):
        begin = (o[0] - sign * far * d[0], o[1] - sign * far * d[1], o[2] - sign * far * d[2])
        t = cast_exactly([begin], corners, [sign * c for c in d]).t
        ends.append(None if t is None else sign * (t - far) * unit)
    return ends[0], ends[1]


def _chord_of_plane(parts: PosedParts, part: int, origin, direction) -> tuple[Fraction | None, Fraction | None]:
    """Exact t at which a ray's line enters, or else leaves, a half-space; 0 for a line in its plane."""
    normal, offset = parts.exact(part).plane
    height = inner(normal, [Fraction(v) for v in origin.tolist()]) - offset
    pace = inner(normal, [Fraction(v) for v in direction.tolist()])
    if pace == 0:
        return (Fraction(0), None) if height == 0 else (None, None)
    return (-height / pace, None) if pace < 0 else (None, -height / pace)
