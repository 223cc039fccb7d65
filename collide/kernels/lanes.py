"""Eight doubles at once: a number for kernels, whose arithmetic is that of doubles in every lane.

`Lanes` have the operators of numbers, so that a kernel of plain expressions compiles for them as it stands: eight
questions of one kind are worked on in the time of one or two. What has branches says `select` instead of ``if``; the
functions here take doubles as well, so that one source serves both. Comparisons of lanes give a mask: eight booleans,
with ``&``, ``|`` and ``~``. No lane depends on another, and each has the bits that doubles would have.

LLVM has vectors of eight doubles whatever the processor: see `vectors.py`.

Without compilation lanes are numpy arrays of eight, masks arrays of booleans.
"""

from __future__ import annotations

from collide.kernels.mode import WITH_NUMBA
from collide.kernels.plain_lanes import LANES

if WITH_NUMBA:
    from collide.kernels.compiled_lanes import any_of, product_error, root_of, select, transpose_eight, view_lanes
else:
    from collide.kernels.plain_lanes import any_of, root_of, select, transpose_eight, view_lanes

__all__ = ["LANES", "any_of", "root_of", "select", "transpose_eight", "view_lanes"]
if WITH_NUMBA:
    __all__ += ["product_error"]
