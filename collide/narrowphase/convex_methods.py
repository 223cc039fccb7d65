"""The kernels' part of the table (`dispatch.py`): the method of two packed convex sets."""

from __future__ import annotations

from collide.kernels import kernel
from collide.lowering.packed_convex import HALFSPACE, POINTS

CAPSULES, HALFSPACE_CONVEX, HALFSPACES, CONVEX = range(4)


@kernel(inline=True)
def method(kind_a, n_a, kind_b, n_b):
    """CAPSULES, HALFSPACE_CONVEX, HALFSPACES or CONVEX; a half-space stands first."""
    if kind_a == HALFSPACE:
        return HALFSPACES if kind_b == HALFSPACE else HALFSPACE_CONVEX
    if kind_a == POINTS and kind_b == POINTS and n_a <= 2 and n_b <= 2:
        return CAPSULES
    return CONVEX
