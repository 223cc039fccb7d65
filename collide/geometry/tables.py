"""Layout of the flat tables that kernels read: one row a shape, one row a posed part.

Rows are flat because nine arrays cost 500 ns a call in Python and four addresses cost 170.
"""

from __future__ import annotations

import numpy as np

from collide._jit import address_of
from collide.geometry.packing import PackedConvex

# One row of integers a shape.
KIND, COUNT, PADDED, ADDRESS, LOWEST, RANK = range(6)
INTS = 6
# One row of doubles a shape; PARAMS is the first of four.
RADIUS, REACH, SLOP, PARAMS = range(4)
NUMBERS = 7
# One row of doubles a posed part: R row by row (9), t (3), slop of the pose (1).
POSE = 13

#: Rounding of a part's world pose when it is a product of two: at most 4u of its terms an entry, so
#: 4√3u·reach for the rotation and as much for the shift; doubled.
_PRODUCT_SLOP = 16 * 2.0**-53


class ShapeTable:
    """Distinct convex sets, row by row, with everything they point to kept alive.

    ``rank`` orders the rows by content, so that a pair is worked on in the same order whichever
    way it is asked: that makes swapped answers the exact mirror of each other.
    """

    def __init__(self, packed: list[PackedConvex]):
        self.packed = packed
        self.ints = np.zeros((len(packed), INTS), dtype=np.int64)
        self.numbers = np.zeros((len(packed), NUMBERS))
        for k, p in enumerate(packed):
            self.ints[k] = p.kind, len(p.points), p.coordinates.shape[1], address_of(p.coordinates), p.lowest, 0
            self.numbers[k, :PARAMS] = p.radius, p.reach, p.slop
            self.numbers[k, PARAMS:] = p.params
        order = {c: rank for rank, c in enumerate(sorted({p.content for p in packed}))}
        self.ints[:, RANK] = [order[p.content] for p in packed]


def pose_rows(X_WB: np.ndarray, X_BP: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """(k, POSE) rows of k posed parts.

    X_WB : (k, 4, 4) body poses.   X_BP : (k, 4, 4) the parts' poses in their bodies.   reach : (k,).

    A part without a pose of its own keeps the numbers given, bit by bit, and so does one of a body at
    the origin. Elsewhere the product is
    written out, so that a batch rounds as a single pose does.
    """
    rows = np.empty((len(X_WB), POSE))
    R_WB, p_WB = X_WB[:, :3, :3], X_WB[:, :3, 3]
    rows[:, :9] = R_WB.reshape(-1, 9)
    rows[:, 9:12] = p_WB
    rows[:, 12] = 0.0
    identity = np.eye(4)
    own = (X_BP != identity).any(axis=(1, 2))
    unmoved = own & (X_WB == identity).all(axis=(1, 2))  # a body at the origin: its parts' own poses
    rows[unmoved, :9], rows[unmoved, 9:12] = X_BP[unmoved, :3, :3].reshape(-1, 9), X_BP[unmoved, :3, 3]
    own = np.flatnonzero(own & ~unmoved)
    if len(own):
        R, p, X = R_WB[own], p_WB[own], X_BP[own]
        rows[own, :9] = _product(R, X[:, :3, :3]).reshape(-1, 9)
        rows[own, 9:12] = _product(R, X[:, :3, 3:])[:, :, 0] + p
        rows[own, 12] = _PRODUCT_SLOP * (reach[own] + np.abs(X[:, :3, 3]).sum(axis=1) + np.abs(p).max(axis=1))
    return rows


def _product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    return A[:, :, 0:1] * B[:, 0:1, :] + A[:, :, 1:2] * B[:, 1:2, :] + A[:, :, 2:3] * B[:, 2:3, :]
