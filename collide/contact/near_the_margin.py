"""Contacts near the margin, perhaps let in by rounding: `distance` then decides whether bodies are within the margin.

Parts of unions stand at rounded poses, and are asked a little beyond the margin. The pose and the bodies tell how far:
a pair's rows are the same bits whatever else is in a batch.
"""

from __future__ import annotations

import math

import numpy as np

from collide.contact.contact_rows import CONTACT_DTYPE
from collide.kernels import kernel, view_f64
from collide.results import field_at

#: Contacts nearer to the margin than this part of the pair's size are judged by the bodies' distance.
ROUNDING = 2.0**-40

#: Of the size: rounding of poses takes some 2⁻⁵⁰ of it.
_LEEWAY = -44

_CONTACT = CONTACT_DTYPE.itemsize
_UPPER = field_at(CONTACT_DTYPE, "upper", 8)


@kernel
def is_near_the_margin(out_at, n, margin, reach, XA_at, XB_at):
    """Whether the deepest of n contacts of a pair is to be judged by the bodies' distance.

    reach : how far both bodies reach from their origins, summed [m].
    """
    least = math.inf
    for k in range(n):
        least = min(least, view_f64(out_at + _CONTACT * k, _CONTACT // 8)[_UPPER])
    size = 4.0 * reach
    for i in range(3):
        size += abs(view_f64(XB_at, 16)[4 * i + 3] - view_f64(XA_at, 16)[4 * i + 3])
    return n > 0 and least > margin - ROUNDING * size


@kernel
def leeway_of(reach, XA_at, XB_at):
    """How far beyond the margin parts are asked [m], far more than rounding may have moved them: a power of two.

    reach : as of `is_near_the_margin`.
    """
    of_a, of_b = 0.0, 0.0
    for i in range(3):
        of_a += abs(view_f64(XA_at, 16)[4 * i + 3])
        of_b += abs(view_f64(XB_at, 16)[4 * i + 3])
    return math.ldexp(1.0, int(math.frexp(reach + of_a + of_b)[1]) + _LEEWAY)


def leeways(reach, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """The same of poses (n, 4, 4) or (1, 4, 4).   reach : a number, or (n,)."""
    of_a, of_b = (np.abs(X[:, :3, 3]).sum(axis=1) for X in (X_WA, X_WB))
    return np.ldexp(1.0, np.frexp(reach + of_a + of_b)[1] + _LEEWAY)
