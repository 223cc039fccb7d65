"""Which class a pair is in: one rule, read off its proven bracket, for reports, checks, trajectories and comparisons.

With lower ≤ signed distance ≤ upper proven, and the rounding of the pair (`roundings`):

========== ==========================================================================================
touching   the bracket reaches to both sides of 0 (the sign is open), or it lies within ± the rounding
near       apart by more than the rounding
colliding  they share a point, and may do so by more than the rounding
shallow    colliding, but proven less deep than a limit: −lower < limit
========== ==========================================================================================

How an answer was found plays no part: integers also settle the last digits of ordinary gaps and depths.
"""

from __future__ import annotations

import numpy as np

from collide.lowering.parts import bounding_parts_of
from collide.results import UNDECIDED

COLLIDING, SHALLOW, TOUCHING, NEAR = NAMES = ("colliding", "shallow", "touching", "near")

#: Gaps and depths up to this part of a pair's largest coordinate are below rounding: 9.1e-13, a picometre at a
#: metre. Poses that were worked out in doubles, along the joints of a robot say, are not known better.
ROUNDING = 2.0**-40


def body_sizes(bodies) -> np.ndarray:
    """(n,) largest coordinate in the world that each body may reach [m]; of a half-space, of its frame's origin.

    bodies : with ``shape`` and ``X_WB`` (4, 4).
    """
    reaches: dict[int, float] = {}
    for body in bodies:
        if id(body.shape) not in reaches:
            reaches[id(body.shape)] = _reach(body.shape)
    return np.array([float(np.abs(body.X_WB[:3, 3]).max()) + reaches[id(body.shape)] for body in bodies])


def _reach(shape) -> float:
    parts = bounding_parts_of(shape)
    return max((packed.reach + packed.radius + float(np.linalg.norm(X[:3, 3])) for packed, X in parts), default=0.0)


def roundings(size_a, size_b):
    """The rounding of pairs [m], given the `body_sizes` of the two bodies (numbers, or arrays of one shape)."""
    return ROUNDING * np.maximum(size_a, size_b)


def is_touching(lower, upper, rounding):
    """Whether a bracket [lower, upper] says only that two bodies touch within rounding; numbers or arrays [m]."""
    return ((lower < 0.0) & (upper > 0.0)) | (np.maximum(-lower, upper) <= rounding)


def proven_distances(rows: np.ndarray) -> np.ndarray:
    """(n,) signed distances [m] for ranking pairs. An overlap not certified ranks by its proven depth, the upper end of
    the bracket: the length of some separating translation is no measure of depth.
    """
    return np.where(rows["hit"] & ~rows["certified"], rows["upper"], rows["distance"])


def classify(rows: np.ndarray, rounding, *, clearance: float, min_depth: float) -> dict[str, np.ndarray]:
    """Class -> indices of the rows in it, ascending; rows proven farther apart than the clearance are left out.

    rows : of `collide.results.PAIR_DTYPE`.   rounding : (n,) or a number [m].
    """
    touching = ~rows["beyond"] & ((rows["how"] == UNDECIDED) | is_touching(rows["lower"], rows["upper"], rounding))
    hit = rows["hit"] & ~touching
    # the depth is at most −lower: below min_depth only when that is proven
    shallow = hit & (-rows["lower"] < min_depth)
    near = ~(rows["hit"] | touching | rows["beyond"]) & (rows["lower"] <= clearance)
    masks = {COLLIDING: hit & ~shallow, SHALLOW: shallow, TOUCHING: touching, NEAR: near}
    return {name: np.flatnonzero(mask) for name, mask in masks.items()}
