"""Sizes of a World's tree and of rays through it, for callers in C, who cannot read Python's constants."""

from __future__ import annotations

import numpy as np

from collide.broadphase.allowed_rows import ROW_OF_A_KEY
from collide.broadphase.boxes_ahead import SWEEP
from collide.broadphase.graded_boxes import LINK, STACK
from collide.broadphase.moved_bodies import SINGLE_PARTS
from collide.broadphase.tree_in_memory import TRAITS, TREE
from collide.broadphase.walk_boxes import STACK_OF_PAIRS
from collide.casts.cut_parts import RAY
from collide.casts.rays_in_tree import HIT_ROW, TREE_OF_PARTS, TREE_RAY_DOUBLES, TREE_RAY_INTEGERS
from collide.kernels import entry, view_i64

#: In this order (`native/capi_world.h`): layouts of a tree and of its bodies, workspaces of its kernels, layouts and
#: workspaces of rays.
_CONSTANTS = np.array([
    TREE, LINK, TRAITS, SINGLE_PARTS, ROW_OF_A_KEY, SWEEP, STACK, STACK_OF_PAIRS,
    RAY, TREE_OF_PARTS, TREE_RAY_DOUBLES, TREE_RAY_INTEGERS, HIT_ROW,
], dtype=np.int64)


@entry("int64(int64, int64)")
def write_world_constants(out_at, n):
    """Write the first n of `_CONSTANTS`; returns how many there are."""
    out = view_i64(out_at, n)
    for at in range(min(n, len(_CONSTANTS))):
        out[at] = _CONSTANTS[at]
    return len(_CONSTANTS)
