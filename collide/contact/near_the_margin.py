"""Contacts so near to the margin that rounding may have let them in: `distance` then decides whether they count."""

from __future__ import annotations

import math

from collide.contact.contact_rows import CONTACT_DTYPE
from collide.kernels import kernel, view_f64
from collide.results import field_at

#: Contacts nearer to the margin than this part of the pair's size are judged by the bodies' distance.
ROUNDING = 2.0**-40

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
