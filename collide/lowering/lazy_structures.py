"""What queries need of many points besides the points: made when first needed, and kept with the packed set.

A support tree answers support queries in logarithmic time (`support/`); a few coarse points, chosen so that they span
most of the hull, begin them.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of
from collide.lowering.packed_convex import PackedConvex, on_cache_lines
from collide.support.coarse_points import COARSE, choose_coarse
from collide.support.lazy_support_tree import LazySupportTree

#: So many points have coarse points: twice as many as then stand for them.
_MIN_FOR_COARSE = 64
#: Fewer points are scanned: it takes no longer, and needs no hull. Decided by the number of points alone, so that an
#: answer does not depend on what was asked before.
MIN_FOR_TREE = 224


def coarse_address(packed: PackedConvex) -> int:
    """Address of 4·COARSE doubles: x, y, z of each coarse point, and their ids as int64 bits; 0 for few points."""
    if len(packed.points) < _MIN_FOR_COARSE:
        return 0
    made = packed.prepared.made
    if "coarse" not in made:
        block, points = on_cache_lines(4 * COARSE), np.ascontiguousarray(packed.points)
        choose_coarse(address_of(points), len(points), address_of(block))
        block.flags.writeable = False
        made.setdefault("coarse", block)  # of two threads that ask at once both may make one: the first counts
    return address_of(made["coarse"])


def may_have_tree(packed: PackedConvex) -> bool:
    """Whether the set's points are of a hull, and many enough for a support tree."""
    return packed.prepared.with_tree and len(packed.points) >= MIN_FOR_TREE


def support_tree_of(packed: PackedConvex) -> LazySupportTree:
    """The points' support tree, made when its address is first asked for."""
    made = packed.prepared.made
    return made["tree"] if "tree" in made else made.setdefault("tree", LazySupportTree(packed.points))
