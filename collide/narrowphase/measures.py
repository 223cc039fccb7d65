"""How much room kernels take and where things stand in it, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

from collide.geometry.coarse_points import COARSE
from collide.geometry.hulls.first_simplex import APICES
from collide.geometry.hulls.orientation import DIGITS as HULL_DIGITS
from collide.geometry.hulls.orientation import WORK
from collide.geometry.hulls.quickhull import FACET, PLANE, STATE
from collide.geometry.support_tree.lists import STACK
from collide.geometry.tables import INTS, NUMBERS, POSE
from collide.kernels import entry, view_i64
from collide.narrowphase.answer import DOUBLES, INTEGERS, REQUESTS_AT
from collide.narrowphase.decide import WORKSPACE
from collide.narrowphase.poses import BLOCK, HEADER
from collide.narrowphase.rows import ROW

#: In this order: rooms of the narrowphase, layouts, rooms of hulls and of support trees (`native/capi_internal.h`).
_MEASURES = (
    DOUBLES, INTEGERS, REQUESTS_AT, WORKSPACE, BLOCK, HEADER, INTS, NUMBERS, POSE, ROW, COARSE, APICES, HULL_DIGITS, WORK,
    FACET, PLANE, STATE, STACK,
)  # fmt: skip


@entry("int64(int64, int64)")
def tell_measures(out_at, n):
    """Write the first n of `_MEASURES`; returns how many there are."""
    out = view_i64(out_at, n)
    at = 0
    for measure in _MEASURES:
        if at < n:
            out[at] = measure
        at += 1
    return at
