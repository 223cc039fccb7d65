"""Sizes of what questions about unions read and work in, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

import numpy as np

from collide.kernels import entry, view_i64
from collide.lowering.compound_table import BALL_IN_WORLD, BODY, BODY_INTS, GROUP, GROUP_BALL, PART
from collide.lowering.shape_table import TERM_ROW
from collide.narrowphase.composite.composite_block import BLOCK, HEADER, LIST, NEAR, SLOTS
from collide.narrowphase.composite.composite_rows import SCORE

#: In this order (`native/capi_compound.h`).
_CONSTANTS = np.array(
    [
        PART, BODY, BODY_INTS, GROUP, GROUP_BALL, BALL_IN_WORLD, TERM_ROW, HEADER, BLOCK, LIST, NEAR, SLOTS,
        SCORE * BLOCK,
    ],
    dtype=np.int64,
)


@entry("int64(int64, int64)")
def write_composite_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
