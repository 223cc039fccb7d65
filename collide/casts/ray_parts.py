"""Rays against posed convex parts: chords in doubles, and what these leave open of polytopes decided exactly."""

from __future__ import annotations

from fractions import Fraction
from threading import local
from typing import NamedTuple

import numpy as np

from collide.broadphase.box_tree import BoxTree
from collide.casts.cut_parts import (
    FIRST,
    FIRST_LOWER,
    FIRST_NORMAL,
    FIRST_SIDE,
    FIRST_UPPER,
    LAST,
    LAST_LOWER,
    LAST_NORMAL,
    LAST_SIDE,
    LAST_UPPER,
    RAY,
    RAY_ROW,
    STATE,
    cut_parts,
)
from collide.casts.directions import Directions
from collide.casts.exact_cast import cast_exactly, corners_of
from collide.casts.posed_parts import PosedParts
from collide.casts.ray_hits import RayEvents
from collide.casts.rays_in_tree import MAX_WIDTH, TREE_RAY_DOUBLES, TREE_RAY_INTEGERS, parts_on_rays
from collide.curved.chords import MET, MISSED, UNCLEAR
from collide.kernels import address_of
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.numerics.exact_points import integers, rounded
from collide.numerics.exact_vectors import inner

#: Columns of both ends of a chord: from below, the value, from above.
_BRACKETS = [FIRST_LOWER, LAST_LOWER], [FIRST, LAST], [FIRST_UPPER, LAST_UPPER]


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
    limits = directions.limits(limit)[questions[:, 0]]
    met = np.flatnonzero(rows[:, STATE] != MISSED)
    rows, asked, limits = rows[met], questions[met], limits[met]
    exact, ends = np.zeros(len(rows), dtype=bool), _ends_of(rows)
    is_open = _are_open(rows, ends, limits)
    if every:  # flat parts, and rays that touch: is it one place, or two?
        is_open |= rows[:, FIRST_UPPER] >= rows[:, LAST_LOWER]
    for k in np.flatnonzero(is_open).tolist():
        if _has_exact_numbers(parts, asked[k, 1]):
            exact[k] = True
            _settle(parts, asked[k], origins, directions.vectors, limits[k], rows[k])
    return _events(rows, met, asked, limits, exact, _ends_of(rows) if exact.any() else ends, directions)


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


class _Ends(NamedTuple):
    """Both ends of k chords, (k, 2): value, lower, upper of t.   wide : bracketed too widely to be certified."""

    value: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    wide: np.ndarray


def _ends_of(rows: np.ndarray) -> _Ends:
    lower, value, upper = (rows[:, columns] for columns in _BRACKETS)
    far = np.where(np.isfinite(value), np.abs(value), 0.0).max(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        wide = np.isfinite(upper) & np.isfinite(lower) & ~(upper - lower <= MAX_WIDTH * far)
    return _Ends(value, lower, upper, wide)


def _are_open(rows: np.ndarray, ends: _Ends, limits: np.ndarray) -> np.ndarray:
    """(k,) bool: chords not decided by doubles, or with ends bracketed too widely: both sides of the origin or of the
    limit are possible.
    """
    _, lower, upper, wide = ends
    is_ahead, is_before = upper >= 0.0, lower <= limits[:, None]
    is_open = (lower <= 0.0) & is_ahead | is_before & (upper > limits[:, None]) | wide & is_ahead & is_before
    return is_open.any(axis=1) | (rows[:, STATE] == UNCLEAR)


def _events(rows, met, asked, limits, exact, ends: _Ends, directions: Directions) -> RayEvents:
    """The ends of chords that count, from the origin to the limit: first ends, then last ends."""
    value, lower, upper, wide = ends
    limit = limits[:, None]
    counts = np.isfinite(value) & (upper >= 0.0) & (lower <= limit)
    proven = (rows[:, STATE] == MET)[:, None] & (lower >= 0.0) & (upper <= limit)
    if exact.any():  # what was decided exactly is as it is said, within doubles that hold it
        counts &= ~exact[:, None] | ((value >= 0.0) & (value <= limit))
        proven |= exact[:, None]
    last, k = np.nonzero(counts.T)
    t = np.clip(np.stack([value[k, last], lower[k, last], upper[k, last]], axis=1), 0.0, None)
    t[:, :2] = np.minimum(t[:, :2], limits[k, None])
    ray, is_proven = asked[k, 0], proven[k, last]
    with np.errstate(over="ignore", under="ignore"):
        t = np.ldexp(t, -directions.exponents[ray, None])
    normal = rows[:, FIRST_NORMAL : LAST_NORMAL + 3].reshape(-1, 2, 3)[k, last]
    side = rows[k, FIRST_SIDE + last].astype(np.int64)
    return RayEvents(ray, t, normal, side, met[k], is_proven, is_proven & ~wide[k, last])


# --- exactly ------------------------------------------------------------------------------------


def _has_exact_numbers(parts: PosedParts, part: int) -> bool:
    packed = parts.packed(part)
    return packed.kind in (POINTS, HALFSPACE) and not (packed.radius or packed.slop)


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
