"""Sizes of the rows and rooms of casts and rays, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

import numpy as np

from collide.casts.cast_pairs import CAST_ROW, QUESTION
from collide.casts.close_casts import MARKS, PACE_TERMS
from collide.casts.cut_parts import RAY, RAY_DOUBLES, RAY_ROW
from collide.casts.silhouette import CAST_DOUBLES, CAST_INTEGERS
from collide.casts.union_cast import UNION_HEADER, UNION_ROW, UNION_WORK
from collide.kernels import entry, view_i64
from collide.narrowphase.facets import ray_surface

#: In this order (`native/capi_casts.h`).
_CONSTANTS = np.array(
    [
        QUESTION, CAST_ROW, MARKS, PACE_TERMS, RAY, RAY_ROW, max(CAST_DOUBLES, RAY_DOUBLES), CAST_INTEGERS,
        ray_surface.RAY, ray_surface.HIT, UNION_HEADER, UNION_WORK, UNION_ROW,
    ],
    dtype=np.int64,
)


@entry("int64(int64, int64)")
def write_cast_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
