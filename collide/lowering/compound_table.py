"""Bodies of several convex parts as the kernels read them: a row for each part, a row for each body.

Rows of parts hold the part's pose in its body, and a ball around the part: most pairs of parts are far apart, and
balls say so before any further work.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.lowered_sets import LoweredSets, in_rows
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex
from collide.lowering.set_rows import KIND, RADIUS, REACH, SLOP
from collide.lowering.shape_table import ShapeTable

# Doubles of a part: its pose in the body (R row by row, then t), 1 where that is more than the identity, the farthest
# its core's points and its shift reach, summed; a ball in the body's frame that holds its core, and the radius swept
# over it.
TURNED, MEASURE, CENTRE, BALL, SWEPT_RADIUS = 12, 13, 14, 17, 18
PART = 19
# Doubles of a body: such a ball for all of it, the largest radius swept, and how far its bounded parts reach.
BODY_CENTRE, BODY_BALL, BODY_SWEPT, BODY_REACH = 0, 3, 4, 5
BODY = 6
# Doubles of a ball in the world: its centre, from where body A stands, and its radius.
BALL_IN_WORLD = 4
# Integers of a body: its first part, how many there are, and its first group of parts.
FIRST, COUNT, FIRST_GROUP = 0, 1, 2
BODY_INTS = 3
#: Parts that are near each other stand in groups of so many, the last one of what is left.
GROUP = 16
# Doubles of a group: such a ball for all of it, and the largest radius swept.
GROUP_BALL = 5

#: Radii of balls are rounded up by more than a dozen roundings.
_OUTWARD = 1 + 2.0**-45


class Balls(NamedTuple):
    """Balls in the frame of a shape, ``stride`` doubles apart, from an address on; stride 0, a single ball for all."""

    at: int
    stride: int
    n: int


class LaidOut(NamedTuple):
    """A body: its convex parts, (parts, PART) doubles, (BODY,) doubles; its parts by their places (parts,) int64, each
    GROUP in turn of parts near each other, and (groups, GROUP_BALL) doubles."""

    packed: LoweredSets
    parts: np.ndarray
    ball: np.ndarray
    by_place: np.ndarray
    groups: np.ndarray


def lay_out(parts: Sequence[tuple[PackedConvex, np.ndarray]]) -> LaidOut:
    """A body, by its convex parts and their poses (4, 4) in it."""
    sets, X = (parts := in_rows(parts)).sets, parts.X_BP
    rows = np.zeros((len(parts), PART))
    rows[:, :9], rows[:, 9:12] = X[:, :3, :3].reshape(-1, 9), X[:, :3, 3]
    rows[:, TURNED] = (X != np.eye(4)).any(axis=(1, 2))
    rows[:, MEASURE] = sets.numbers[:, REACH] + np.abs(X[:, :3, 3]).sum(axis=1)
    rows[:, SWEPT_RADIUS] = sets.numbers[:, RADIUS]
    balls = _balls_of(sets)
    rows[:, CENTRE : CENTRE + 3] = (X[:, :3, :3] @ balls[:, :3, None])[:, :, 0] + X[:, :3, 3]
    # A matrix that passes for a rotation may lengthen a little.
    rows[:, BALL] = balls[:, 3] * np.maximum(1.0, _stretches(X)) * _OUTWARD
    centres, radii = rows[:, CENTRE : CENTRE + 3], rows[:, BALL]
    body = np.zeros(BODY)
    body[BODY_CENTRE : BODY_CENTRE + 3] = middle = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
    body[BODY_BALL] = (np.sqrt(np.square(centres - middle).sum(axis=1)) + radii).max() * _OUTWARD
    body[BODY_SWEPT] = rows[:, SWEPT_RADIUS].max()
    reaches = np.sqrt(np.square(centres).sum(axis=1)) + radii + rows[:, SWEPT_RADIUS]
    body[BODY_REACH] = reaches[np.isfinite(reaches)].max(initial=0.0)
    by_place = _by_place(centres)
    groups = _groups_of(centres[by_place], radii[by_place], rows[by_place, SWEPT_RADIUS])
    return LaidOut(sets, rows, body, by_place, groups)


def _stretches(X: np.ndarray) -> np.ndarray:
    """(k,) by how much matrices (k, 4, 4) lengthen a vector at most: the root of the largest sum of a row of |RᵀR|."""
    x, y, z = (np.ascontiguousarray(X[:, :3, axis].T) for axis in range(3))
    xx, yy, zz, xy, yz, zx = (
        np.abs(u[0] * v[0] + u[1] * v[1] + u[2] * v[2]) for u, v in ((x, x), (y, y), (z, z), (x, y), (y, z), (z, x))
    )
    return np.sqrt(np.maximum(np.maximum(xx + xy + zx, yy + yz + xy), zz + zx + yz))


def _by_place(centres: np.ndarray) -> np.ndarray:
    """(k,) numbers of points (k, 3) along Morton's curve: as they are, where they are one group."""
    low = centres.min(axis=0)
    span = float((centres.max(axis=0) - low).max())
    if len(centres) <= GROUP or span == 0.0:
        return np.arange(len(centres))
    cells = ((centres - low) / span * 1023.0).astype(np.int64)
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        cells = (cells | cells << shift) & mask  # ten bits, three apart
    return np.argsort(cells[:, 0] | cells[:, 1] << 1 | cells[:, 2] << 2, kind="stable")


def _groups_of(centres: np.ndarray, balls: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(groups, GROUP_BALL) by radii of balls of parts, and those swept over their cores: what is in a part's ball is
    within its radius and the way between both centres."""
    starts = np.arange(0, len(balls), GROUP)
    groups = np.empty((len(starts), GROUP_BALL))
    groups[:, :3] = 0.5 * (np.minimum.reduceat(centres, starts) + np.maximum.reduceat(centres, starts))
    across = np.sqrt(np.square(centres - np.repeat(groups[:, :3], GROUP, axis=0)[: len(balls)]).sum(axis=1))
    groups[:, 3] = np.maximum.reduceat(across + balls, starts) * _OUTWARD
    groups[:, 4] = np.maximum.reduceat(radii, starts)
    return groups


def _balls_of(sets: LoweredSets) -> np.ndarray:
    """(k, 4) centres and radii of balls that hold the cores of convex sets, as they are stored and as they were
    described."""
    kinds, slops = sets.ints[:, KIND], sets.numbers[:, SLOP]
    balls = np.zeros((len(sets), 4))
    balls[:, 3] = np.where(kinds == HALFSPACE, np.inf, sets.numbers[:, REACH] + slops)
    has_points = kinds[sets.by_numbers] == POINTS
    of_numbers = sets.by_numbers[has_points]  # corners of boxes around the origin, all equally far (`corners_of`)
    balls[of_numbers, 3] = np.sqrt(np.square(sets.columns[has_points, :, 0]).sum(axis=1)) + slops[of_numbers]
    for k in np.setdiff1d(np.flatnonzero(kinds == POINTS), of_numbers, assume_unique=True).tolist():
        points = sets[k].points
        balls[k, :3] = centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        balls[k, 3] = np.sqrt(np.square(points - centre).sum(axis=1).max()) + slops[k]
    return balls


class CompoundTable:
    """Bodies of convex parts in the tables that kernels read, with everything these point to kept alive."""

    def __init__(self, bodies: Sequence[LaidOut]):
        self.counts = np.array([len(body.packed) for body in bodies], dtype=np.int64)
        self.first = np.cumsum(self.counts) - self.counts
        self.table = ShapeTable.of_bodies([body.packed for body in bodies])
        self._parts = np.concatenate([body.parts for body in bodies])
        n_groups = np.array([len(body.groups) for body in bodies])
        self._bodies = np.ascontiguousarray(np.stack([self.first, self.counts, np.cumsum(n_groups) - n_groups], axis=1))
        self._by_place = np.concatenate([body.by_place for body in bodies])
        self._groups = np.concatenate([body.groups for body in bodies])
        self._balls = np.array([body.ball for body in bodies])
        #: Rows of parts that any two of these bodies take at most.
        self.max_parts = 2 * int(self.counts.max())
        tables = self._parts, self._bodies, self._balls, self._by_place, self._groups
        self.addresses = *self.table.addresses, *map(address_of, tables)

    def build_trees(self, which: np.ndarray | None) -> None:
        """Have the support trees of these bodies; of bodies 0 and 1 without."""
        if self.table.is_built:
            return
        used = [0, 1] if which is None else np.unique(which).tolist()
        self.table.build_trees(np.concatenate([np.arange(self.first[k], self.first[k] + self.counts[k]) for k in used]))
