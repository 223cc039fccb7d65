"""Eight doubles at once: a number for kernels, with the arithmetic of doubles in every lane.

`Lanes` have the operators of numbers, so a kernel of plain expressions compiles for them as written: eight questions of
the same kind take the time of one or two. A kernel with branches says `select` instead of ``if``; the functions here
take doubles as well, so the same source serves both. Comparisons of lanes give a mask: eight booleans, with ``&``,
``|`` and ``~``. No lane depends on another, and each has the bits of the same computation in doubles.

LLVM has vectors of eight doubles whatever the processor: see `vectors.py`.

Without compilation lanes are numpy arrays of eight, masks arrays of booleans.
"""

from __future__ import annotations

from collide.kernels.mode import WITH_NUMBA
from collide.kernels.plain_lanes import LANES

if WITH_NUMBA:
    from collide.kernels.compiled_lanes import (
        any_of,
        bits_of,
        product_error,
        root_of,
        select,
        transpose_eight,
        view_lanes,
    )
else:
    from collide.kernels.plain_lanes import any_of, bits_of, root_of, select, transpose_eight, view_lanes

__all__ = ["LANES", "any_of", "bits_of", "root_of", "select", "transpose_eight", "view_lanes"]
if WITH_NUMBA:
    __all__ += ["product_error"]
