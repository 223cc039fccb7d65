"""Arrays that a kernel fills with as many items as match, made anew at the full number when the first are too short."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.kernels import address_of

#: Items that the first arrays hold: more than bodies of usual sizes are near.
_FIRST_LISTED = 256


def listed(list_into: Callable[..., int], *dtypes: type) -> list[np.ndarray]:
    """One array (n,) per dtype. O(n)

    list_into : of the addresses of the arrays and their length; fills at most so many items and returns the number
        of all.
    """
    size = _FIRST_LISTED
    while True:
        arrays: list[np.ndarray] = [np.empty(size, dtype=dtype) for dtype in dtypes]
        n = list_into(*map(address_of, arrays), size)
        if n <= size:
            return [array[:n] for array in arrays]
        size = n
