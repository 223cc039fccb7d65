"""A pair as the exact stage has it, its numbers read back as Fractions; seeded pairs for it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from digit_numbers import number_at, put_number
from naive import LATTICE_ROTATIONS, Case, hull_points, pose, random_pose
from posed_bodies import PosedBodies

import collide
from collide.narrowphase.exact import exact_workspace as W
from collide.numerics.digits import BITS


class ExactBodies(PosedBodies):
    """A pair in integers, its poses loaded."""

    def __init__(self, *case, with_trees: bool = False):
        super().__init__(*case, with_trees=with_trees)
        self.digits = np.zeros(W.INTEGERS, dtype=np.int64)
        self.exact = W.exact_pair(self.ordered, self.poses.terms.ravel(), self.digits, 0.0, 0.0)
        assert W.fits(self.exact)
        W.load_poses(self.exact)

    def number(self, at: int, n: int) -> Fraction:
        return Fraction(number_at(self.digits, at, n))

    def point(self, k: int) -> list[Fraction]:
        unit = Fraction(2) ** int(BITS * self.exact.grid)
        return [unit * self.number(W.point_at(self.exact.d, k, axis), self.exact.d) for axis in range(3)]

    def direction(self, n: int) -> list[Fraction]:
        return [self.number(W.direction_at(self.exact.d, axis), n) for axis in range(3)]

    def set_direction(self, direction) -> int:
        """Three integers; returns how many digits their components have."""
        n = self.exact.d
        for axis, x in enumerate(direction):
            put_number(self.digits, W.direction_at(n, axis), n, int(x))
        return n


def drawn(rng, kind: str) -> Case:
    A, B = (collide.ConvexHull(hull_points(rng, int(rng.integers(1, 9)))) for _ in range(2))
    case = Case(A, B, random_pose(rng), random_pose(rng))
    if kind == "lattice":
        A, B = (collide.ConvexHull(rng.integers(-1, 2, size=(int(rng.integers(1, 9)), 3)) * 0.5) for _ in range(2))
        turns = [LATTICE_ROTATIONS[k] for k in rng.integers(0, 24, 2)]
        return Case(A, B, pose(turns[0]), pose(turns[1], rng.integers(-2, 3, 3) * 0.5))
    if kind == "far apart in size":
        return case._replace(A=collide.ConvexHull(A.points * 2.0**-70), B=collide.ConvexHull(B.points * 2.0**60))
    if kind == "composed":
        A, B = (collide.Compound([(shape, random_pose(rng))]) for shape in (A, B))
        return case._replace(A=A, B=B)
    return case
