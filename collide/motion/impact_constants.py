"""Sizes of what `find_impacts` reads and writes, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

import numpy as np

from collide.kernels import entry, view_i64
from collide.lowering.compound_table import PART
from collide.motion.impact_jobs import ANSWER, HEADER, JOB
from collide.motion.moving_body import BODY
from collide.numerics.sine_cosine import LARGEST_ANGLE

#: In this order (`native/capi_impact.c`).
_CONSTANTS = np.array([HEADER, JOB, PART, BODY, ANSWER, int(LARGEST_ANGLE)], dtype=np.int64)


@entry("int64(int64, int64)")
def write_impact_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
