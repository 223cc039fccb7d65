"""Two convex shapes at two poses as kernels take them, for tests that call kernels of the narrowphase one by one."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cached_property

import numpy as np
from naive import corners
from naive_triangles import world_points

import collide
from collide.kernels import address_of
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.pair_workspace import DOUBLES, INTEGERS, Query, Workspace, workspace_at
from collide.narrowphase.posed_pair import ordered_pair


class PosedBodies:
    """The `OrderedPair` of A at X_WA and B at X_WB, and the buffers that it sees.

    ordered, pair : as kernels have them; ``ordered.flip`` says whether B comes first.   error : of a bound in doubles
    [m].   X : the poses of the bodies as worked on, and shapes : those.
    """

    def __init__(
        self, A: collide.Shape, B: collide.Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, with_trees: bool = False
    ):
        (packed_a, X_AP), (packed_b, X_BP) = (parts_of(shape)[0] for shape in (A, B))
        self.table = ShapeTable([packed_a, packed_b])
        if with_trees:
            self.table.build_trees(np.arange(2))
        self.poses = pose_table(
            np.array([X_WA, X_WB]), np.array([X_AP, X_BP]), np.array([packed_a.reach, packed_b.reach])
        )
        self._shape_of = np.arange(2)
        self.ordered = ordered_pair(
            address_of(self.table.ints), address_of(self.table.numbers), address_of(self.poses.rows),
            address_of(self._shape_of), 0, 1,
        )
        self.pair = self.ordered.pair
        self.error = ERROR * self.ordered.size + self.ordered.slop
        self.radius = packed_a.radius + packed_b.radius
        self.shapes, self.X = ((B, A), (X_WB, X_WA)) if self.ordered.flip else ((A, B), (X_WA, X_WB))

    @cached_property
    def work(self) -> Workspace:
        """A workspace of the narrowphase, zeroed."""
        self._buffers = np.zeros(DOUBLES), np.zeros(INTEGERS, dtype=np.int64)
        return workspace_at(*map(address_of, self._buffers))

    def query(self, *, boolean: bool = False, depths: bool = True, limit: float = math.inf) -> Query:
        return Query(boolean, depths, limit, address_of(self.poses.terms), False)

    def difference(self) -> dict[tuple[int, int], list[Fraction]]:
        """The points of A ⊖ B, exactly, by the vertices of the bodies as worked on."""
        a, b = (world_points(corners(shape)[0], X) for shape, X in zip(self.shapes, self.X))
        return {(i, j): [x - y for x, y in zip(p, q)] for i, p in enumerate(a) for j, q in enumerate(b)}
