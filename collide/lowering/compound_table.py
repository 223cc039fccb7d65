"""Bodies of several convex parts as the kernels read them: one row a part, one a body.

Rows of parts hold where each stands in its body, and a ball around it: most pairs of parts are far apart, and balls
say so before anything is worked out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex
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
# Integers of a body: its first part, and how many there are.
FIRST, COUNT = 0, 1

#: Radii of balls are rounded up by more than a dozen roundings.
_OUTWARD = 1 + 2.0**-45


class LaidOut(NamedTuple):
    """One body: its convex parts, (parts, PART) doubles, (BODY,) doubles."""

    packed: tuple[PackedConvex, ...]
    parts: np.ndarray
    ball: np.ndarray


def lay_out(parts: Sequence[tuple[PackedConvex, np.ndarray]]) -> LaidOut:
    """A body, by its convex parts and their poses (4, 4) in it."""
    X = np.array([pose for _, pose in parts])
    rows = np.zeros((len(parts), PART))
    rows[:, :9], rows[:, 9:12] = X[:, :3, :3].reshape(-1, 9), X[:, :3, 3]
    rows[:, TURNED] = (X != np.eye(4)).any(axis=(1, 2))
    rows[:, MEASURE] = [packed.reach for packed, _ in parts] + np.abs(X[:, :3, 3]).sum(axis=1)
    rows[:, SWEPT_RADIUS] = [packed.radius for packed, _ in parts]
    of_set = {id(packed): packed for packed, _ in parts}
    ball_of = {key: _ball_of(packed) for key, packed in of_set.items()}
    balls = np.array([ball_of[id(packed)] for packed, _ in parts])
    rows[:, CENTRE : CENTRE + 3] = (X[:, :3, :3] @ balls[:, :3, None])[:, :, 0] + X[:, :3, 3]
    # A matrix that passes for a rotation may lengthen a little.
    stretch = np.sqrt(np.abs(np.swapaxes(X[:, :3, :3], 1, 2) @ X[:, :3, :3]).sum(axis=2).max(axis=1))
    rows[:, BALL] = balls[:, 3] * np.maximum(1.0, stretch) * _OUTWARD
    centres, radii = rows[:, CENTRE : CENTRE + 3], rows[:, BALL]
    body = np.zeros(BODY)
    body[BODY_CENTRE : BODY_CENTRE + 3] = middle = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
    body[BODY_BALL] = (np.sqrt(np.square(centres - middle).sum(axis=1)) + radii).max() * _OUTWARD
    body[BODY_SWEPT] = rows[:, SWEPT_RADIUS].max()
    reaches = np.sqrt(np.square(centres).sum(axis=1)) + radii + rows[:, SWEPT_RADIUS]
    body[BODY_REACH] = reaches[np.isfinite(reaches)].max(initial=0.0)
    return LaidOut(tuple(packed for packed, _ in parts), rows, body)


def _ball_of(packed: PackedConvex) -> tuple[float, float, float, float]:
    """Centre and radius of a ball that holds the core of a convex set, as it is stored and as it was described."""
    if packed.kind == HALFSPACE:
        return 0.0, 0.0, 0.0, np.inf
    if packed.kind != POINTS:
        return 0.0, 0.0, 0.0, packed.reach + packed.slop
    centre = 0.5 * (packed.points.min(axis=0) + packed.points.max(axis=0))
    return *centre, float(np.sqrt(np.square(packed.points - centre).sum(axis=1).max())) + packed.slop


class CompoundTable:
    """Bodies of convex parts in the tables that kernels read, with everything these point to kept alive."""

    def __init__(self, bodies: Sequence[LaidOut]):
        self.counts = np.array([len(body.packed) for body in bodies], dtype=np.int64)
        self.first = np.cumsum(self.counts) - self.counts
        self.table = ShapeTable([packed for body in bodies for packed in body.packed])
        self._parts = np.concatenate([body.parts for body in bodies])
        self._bodies = np.ascontiguousarray(np.stack([self.first, self.counts], axis=1))
        self._balls = np.array([body.ball for body in bodies])
        #: Rows of parts that any two of these bodies take at most.
        self.max_parts = 2 * int(self.counts.max())
        self.addresses = *self.table.addresses, *map(address_of, (self._parts, self._bodies, self._balls))

    def build_trees(self, which: np.ndarray | None) -> None:
        """Have the support trees of these bodies; of bodies 0 and 1 without."""
        if self.table.is_built:
            return
        used = [0, 1] if which is None else np.unique(which).tolist()
        self.table.build_trees(np.concatenate([np.arange(self.first[k], self.first[k] + self.counts[k]) for k in used]))
