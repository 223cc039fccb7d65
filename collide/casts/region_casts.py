"""Casts onto regions of half-spaces: how far a moved body may come before the rest of its way is decided.

After a while the body is behind all planes of its approach; from then on the body can only leave half-spaces. So the
first contact is not later, and a box around the way so far closes the region for the cast. A plane approached very
slowly, against its distance, is left to a second look, with a box around `_FARTHEST` times the first way.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from collide.least_distance.posed_sets import exact_pose, planes_at
from collide.lowering.closed_regions import reach_of
from collide.numerics.exact_vectors import dot
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import Shape

#: Planes approached more slowly than this, in parts of the speed, come later; slower than rounding, not at all.
_SLOW, _NOT_AT_ALL = 2.0**-10, 2.0**-44
#: So far, in units of the first way and the sizes of both, casts are followed.
_FARTHEST = 2.0**24


class Way:
    """How far a body may be moved onto a region until a contact or the proof of a miss.

    near, far : t of a first and of a second look; far is not larger where the first look settles the cast.
    is_whole : no first contact is after ``far``.   misses : proven to have no contact.
    """

    def __init__(self, A: Shape, X_WA: np.ndarray, region: HPolytope, X_WB: np.ndarray, vector: np.ndarray):
        inverse = np.linalg.inv(X_WB[:3, :3])
        centre, step = inverse @ (X_WA[:3, 3] - X_WB[:3, 3]), inverse @ vector
        reach = reach_of(A) * (1.0 + 1e-3)
        lengths = np.sqrt(np.square(region.normals).sum(axis=1))
        speed = float(np.linalg.norm(step))
        rate = -(region.normals @ step) / (lengths * speed)
        height = (region.normals @ centre - region.offsets) / lengths
        with np.errstate(divide="ignore", invalid="ignore"):
            behind = np.where(height + reach > 0.0, (height + reach) / (np.maximum(rate, 0.0) * speed), 0.0)
        start = (float(np.linalg.norm(centre)) + reach + region.boundary_within) / speed
        self.near = max(float(behind[rate > _SLOW].max(initial=0.0)), start) * (1.0 + 1e-6)
        slow = (rate <= _SLOW) & (rate > _NOT_AT_ALL) & (height + reach > 0.0)
        farthest = _FARTHEST * self.near
        wanted = float(behind[slow].max(initial=0.0)) * (1.0 + 1e-6)
        self.far, self.is_whole = min(max(wanted, self.near), farthest), wanted <= farthest
        beside = np.flatnonzero((np.abs(rate) <= _NOT_AT_ALL) & (height + reach > 0.0))
        self.misses = False
        if len(beside):
            self._look_at(beside, region, X_WB, vector, height > reach + 2.0**-40 * (abs(start) * speed + reach))

    def _look_at(self, rows: np.ndarray, region: HPolytope, X_WB: np.ndarray, vector: np.ndarray, is_outside) -> None:
        """Decide exactly whether planes parallel to the motion, within rounding, are approached."""
        exact = [Fraction(v) for v in vector.tolist()]
        planes = planes_at(region.normals[rows], region.offsets[rows], exact_pose(X_WB))
        for row, (*normal, _) in zip(rows.tolist(), planes):
            if dot(normal, exact) >= 0:
                self.misses = self.misses or bool(is_outside[row])
            else:
                self.is_whole = False


def limits_of(ways: list[Way], limits: np.ndarray, *, far: bool) -> np.ndarray:
    """(n,) limits of t of a first or second look."""
    return np.minimum(limits, [way.far if far else way.near for way in ways])


def are_to_be_asked_again(ways: list[Way], hit: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Numbers of the casts that a second look may find to hit."""
    return np.flatnonzero([
        not met and not way.misses and way.far > way.near and limit > way.near
        for way, met, limit in zip(ways, hit.tolist(), limits.tolist())
    ])


def are_proven(ways: list[Way], hit: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(n,) bool: whether what was found is all there is to find."""
    return hit | [
        way.misses or way.is_whole or limit <= way.far < math.inf for way, limit in zip(ways, limits.tolist())
    ]
